//! `recordings`: lists the contents of recordings.

use modelmill::Host;
use modelmill::recording::RecordingContents;
use serde_json::{Value, json};

use crate::args::RecordingsArgs;
use crate::failure::CommandOutcome;
use crate::terminal;

/// Prints tables and topics with their columns.
pub(crate) fn run(host: &Host, args: &RecordingsArgs) -> CommandOutcome {
    // All files are read first, so that an error is not mixed with output.
    let mut found = Vec::new();
    for path in &args.files {
        found.push(host.recordings(path)?);
    }
    if args.json {
        let found: Vec<Value> = found.iter().map(RecordingContents::json).collect();
        return terminal::print_json(&json!({ "recordings": found }));
    }
    let texts = found.iter().map(|contents| contents.text(terminal::style()));
    terminal::print(&texts.collect::<Vec<_>>().join("\n\n"))
}
