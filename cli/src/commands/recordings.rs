//! `recordings`: lists the contents of recordings, and proposes their columns for a model.

use std::path::{Path, PathBuf};

use modelmill::recording::{ColumnProposal, RecordingContents};
use modelmill::{Error, Host, Model, Outcome};
use serde_json::{Value, json};

use crate::args::RecordingsArgs;
use crate::commands;
use crate::failure::{CommandFailure, CommandOutcome};
use crate::flags::FlagWording;
use crate::terminal;

/// Prints tables and topics with their columns, and the proposed columns for a model.
pub(crate) fn run(host: &Host, args: &RecordingsArgs) -> CommandOutcome {
    let model = args
        .model
        .as_ref()
        .map(|path| commands::model(host, path))
        .transpose()?;
    // All files are read first, so that an error is not mixed with output. A file that cannot be read stops no other.
    let (mut found, mut unread) = (Vec::new(), Vec::new());
    for path in &args.files {
        match listed_recording(host, model.as_ref(), path) {
            Ok(listed) => found.push(listed),
            Err(Error::Cancelled) => return Err(Error::Cancelled.into()),
            Err(error) => unread.push((path, error)),
        }
    }
    if !found.is_empty() {
        print_recordings(args, &found, &unread)?;
    }
    let Some((_, last)) = unread.pop() else {
        return Ok(());
    };
    if unread.is_empty() {
        return Err(last.into());
    }
    let errors = unread.iter().map(|(_, error)| error).chain([&last]);
    let errors: Vec<String> = errors.map(|error| error.format_for(&FlagWording)).collect();
    Err(CommandFailure::Input(format!(
        "{} of {} recordings cannot be read:\n  {}",
        errors.len(),
        args.files.len(),
        errors.join("\n  ")
    )))
}

/// The contents of the files of a recording, and the proposed columns for a model.
type ListedRecording = (Vec<RecordingContents>, Option<ColumnProposal>);

/// Reads one recording. With a model, the files of one run are joined.
fn listed_recording(host: &Host, model: Option<&Model>, path: &Path) -> Outcome<ListedRecording> {
    let files = match model {
        Some(_) => commands::files_of(path),
        None => vec![path.to_owned()],
    };
    let contents = files
        .iter()
        .map(|file| host.recordings(file))
        .collect::<Result<Vec<_>, _>>()?;
    let files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    let proposal = model.map(|model| model.propose_columns(&files)).transpose()?;
    Ok((contents, proposal))
}

/// Prints the recordings that could be read; JSON also names the others.
fn print_recordings(args: &RecordingsArgs, found: &[ListedRecording], unread: &[(&PathBuf, Error)]) -> CommandOutcome {
    if args.json {
        let objects = found.iter().flat_map(|(contents, proposal)| {
            let proposal = proposal.as_ref().map(ColumnProposal::json);
            contents.iter().map(move |one| match &proposal {
                Some(proposal) => one.json_with_proposal(proposal),
                None => one.json(),
            })
        });
        let unread = unread
            .iter()
            .map(|(path, error)| json!({ "file": path.display().to_string(), "says": error.format_for(&FlagWording) }));
        return terminal::print_json(&json!({
            "recordings": objects.collect::<Vec<Value>>(),
            "unread": unread.collect::<Vec<Value>>(),
        }));
    }
    let style = terminal::style();
    let texts = found.iter().flat_map(|(contents, proposal)| {
        let listed = contents.iter().map(move |one| one.text(style));
        listed.chain(proposal.as_ref().map(ColumnProposal::text))
    });
    terminal::print(&texts.collect::<Vec<_>>().join("\n\n"))
}
