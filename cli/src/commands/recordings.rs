//! `recordings`: lists the contents of recordings, and proposes their columns for a model.

use std::path::{Path, PathBuf};

use modelmill::Host;
use modelmill::recording::ColumnProposal;
use serde_json::{Value, json};

use crate::args::RecordingsArgs;
use crate::commands;
use crate::failure::CommandOutcome;
use crate::terminal;

/// Prints tables and topics with their columns, and the proposed columns for a model.
pub(crate) fn run(host: &Host, args: &RecordingsArgs) -> CommandOutcome {
    let model = args
        .model
        .as_ref()
        .map(|path| commands::model(host, path))
        .transpose()?;
    // All files are read first, so that an error is not mixed with output.
    let mut found = Vec::new();
    for path in &args.files {
        let files = match model {
            Some(_) => commands::files_of(path),
            None => vec![path.clone()],
        };
        let contents = files
            .iter()
            .map(|file| host.recordings(file))
            .collect::<Result<Vec<_>, _>>()?;
        let files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
        let proposal = model.as_ref().map(|model| model.propose_columns(&files)).transpose()?;
        found.push((contents, proposal));
    }
    if args.json {
        let objects = found.iter().flat_map(|(contents, proposal)| {
            let proposal = proposal.as_ref().map(ColumnProposal::json);
            contents.iter().map(move |one| match &proposal {
                Some(proposal) => one.json_with_proposal(proposal),
                None => one.json(),
            })
        });
        return terminal::print_json(&json!({ "recordings": objects.collect::<Vec<Value>>() }));
    }
    let style = terminal::style();
    let texts = found.iter().flat_map(|(contents, proposal)| {
        let listed = contents.iter().map(move |one| one.text(style));
        listed.chain(proposal.as_ref().map(ColumnProposal::text))
    });
    terminal::print(&texts.collect::<Vec<_>>().join("\n\n"))
}
