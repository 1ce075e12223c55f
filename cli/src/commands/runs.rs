//! `runs`: reports what changed between recordings of one machine.

use std::path::PathBuf;

use modelmill::Host;
use modelmill::recording::has_recording_extension;
use modelmill::report::runs_page;
use modelmill::runs::UnreadRun;

use crate::args::runs::RunsArgs;
use crate::failure::{CommandFailure, CommandOutcome};
use crate::flags::FlagWording;
use crate::output::{self, OutputFile};
use crate::{commands, terminal};

/// Name of the page in its folder.
const PAGE: &str = "runs.html";

/// Format of the file of `--out`.
enum RunsFileFormat {
    /// The page `runs.html` in a folder.
    Page,
    /// All results as one JSON object.
    Json,
}

/// Prints the changes relative to the first run and over all runs, and writes page or JSON if requested.
pub(crate) fn run(host: &Host, args: &RunsArgs) -> CommandOutcome {
    let data = expand_paths(&args.data)?;
    let inputs = || [&args.model].into_iter().chain(&data).map(PathBuf::as_path);
    // The ending of --out decides between JSON and a page; the target is checked before the long computation.
    let written = match &args.out {
        Some(out) if out.extension().is_some_and(|e| e.eq_ignore_ascii_case("json")) => {
            Some((OutputFile::new(out, inputs())?, RunsFileFormat::Json))
        }
        Some(out) => {
            output::make_folder(out)?;
            Some((OutputFile::new(&out.join(PAGE), inputs())?, RunsFileFormat::Page))
        }
        None => None,
    };
    let model = commands::model(host, &args.model)?;
    let reading = args.preparation.reading();
    // A run that cannot be read is passed on with its error; the library decides whether the others are sufficient.
    let files: Vec<Vec<PathBuf>> = data.iter().map(|path| commands::files_of(path)).collect();
    let [read, _] = model.prepare_recordings_with_signals([&commands::runs_of(&files), &[]], &reading);
    let recordings = data.iter().zip(read).map(|(path, read)| {
        read.map_err(|error| UnreadRun {
            file: path.display().to_string(),
            error,
        })
    });
    let found = model.runs(recordings, &args.runs_options())?;
    match &written {
        Some((target, RunsFileFormat::Page)) => target.write(&runs_page(&found, &FlagWording))?,
        Some((target, RunsFileFormat::Json)) => {
            target.write(&format!("{:#}\n", found.json(&FlagWording)))?;
        }
        None => {}
    }
    if args.json {
        return terminal::print_json(&found.json(&FlagWording));
    }
    terminal::print(&found.text(terminal::style(), &FlagWording))?;
    match &written {
        Some((target, _)) => terminal::print(&format!("Written to {}.", target.path().display())),
        None => Ok(()),
    }
}

/// Replaces folders and patterns by the recordings in them, in the order of [`natural_sort_key`].
/// Fails if a folder or a pattern has no recording.
fn expand_paths(paths: &[PathBuf]) -> CommandOutcome<Vec<PathBuf>> {
    let mut all = Vec::new();
    for path in paths {
        let text = path.to_string_lossy();
        // A folder gives its files with the ending of a recording, a pattern gives all files that match.
        let mut found: Vec<PathBuf> = if path.is_dir() {
            let entries = std::fs::read_dir(path)
                .map_err(|error| CommandFailure::Input(format!("the folder {text} cannot be read: {error}")))?;
            let files = entries.flatten().map(|entry| entry.path());
            files
                .filter(|file| file.is_file() && has_recording_extension(file))
                .collect()
        } else if text.contains(['*', '?']) && !path.exists() {
            let matching =
                glob::glob(&text).map_err(|error| CommandFailure::Input(format!("--data {text}: {}", error.msg)))?;
            matching.flatten().filter(|file| file.is_file()).collect()
        } else {
            all.push(path.clone());
            continue;
        };
        if found.is_empty() {
            return Err(CommandFailure::Input(format!(
                "--data {text}: no recording was found; from a folder, files that end in .csv, .parquet, .mat, .h5, .mcap, .db3, \
                 .gz or .zst are read; a pattern with * or ? matches files of any name"
            )));
        }
        found.sort_by_cached_key(|file| natural_sort_key(&file.to_string_lossy()));
        all.extend(found);
    }
    Ok(all)
}

/// A name as pieces of text and numbers: `run9` comes before `run10`.
fn natural_sort_key(name: &str) -> Vec<(String, u64)> {
    let mut pieces = Vec::new();
    let mut rest = name;
    while !rest.is_empty() {
        // Each piece is a text without digits and the number after it.
        let text = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
        let (before, after) = rest.split_at(text);
        let digits = after.find(|c: char| !c.is_ascii_digit()).unwrap_or(after.len());
        let (number, left) = after.split_at(digits);
        // Digits that are too many for a number stay in the order of their text.
        let value = number.parse().unwrap_or(u64::MAX);
        pieces.push((before.to_owned(), value));
        rest = left;
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::natural_sort_key;

    #[test]
    fn numbers_in_names_count_as_numbers() {
        let mut names = ["run10.csv", "run9.csv", "run9a.csv", "a.csv", "run010.csv"];
        names.sort_by_cached_key(|name| natural_sort_key(name));
        assert_eq!(names, ["a.csv", "run9.csv", "run9a.csv", "run10.csv", "run010.csv"]);
    }
}
