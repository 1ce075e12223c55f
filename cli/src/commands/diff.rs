//! `diff`: reports what a variant of a model changes; along recordings also changes of forces, power, work and error.

use modelmill::model::ModelChanges;
use modelmill::recording::PreparedRecording;
use modelmill::variants::VariantComparison;
use modelmill::{Host, Model, RecordingNote};

use crate::args::DiffArgs;
use crate::failure::CommandOutcome;
use crate::flags::FlagWording;
use crate::{commands, terminal};

/// Prints the changes between two models, and draws both into one picture if requested.
pub(crate) fn run(host: &Host, args: &DiffArgs) -> CommandOutcome {
    let before = commands::model(host, &args.before)?;
    // Remarks on the second model would repeat those on the first.
    let quiet = host.clone().without_notes();
    let after = commands::model(&quiet, &args.after)?;
    let inputs = before.files().chain(after.files());
    if let Some(target) = args.drawing.target(inputs)? {
        args.drawing.draw(&target, &after, Some(&before))?;
    }
    // Changes of the models themselves need no recording.
    let changes = ModelChanges::from_models(&before, &after);
    let variants = variants(args, &before, &after)?;
    if args.json {
        let mut object = changes.json(&before, &after);
        if let Some(variants) = variants {
            object["along"] = variants.json(&FlagWording);
        }
        return terminal::print_json(&object);
    }
    let style = terminal::style();
    let mut text = changes.text(&before, &after, style);
    if let Some(variants) = variants {
        text = format!("{text}\n\n{}", variants.text(style));
    }
    terminal::print(&text)
}

/// Compares both models along the recordings; none without `--data`.
fn variants(args: &DiffArgs, before: &Model, after: &Model) -> CommandOutcome<Option<VariantComparison>> {
    if args.data.is_empty() {
        return Ok(None);
    }
    VariantComparison::check([before, after])?;
    let reading = args.preparation.reading();
    let [first, _] = commands::recordings(before, [&args.data, &[]], &reading)?;
    let [second, _] = commands::recordings(after, [&args.data, &[]], &reading)?;
    // A remark on a recording that both models produce is printed once.
    let told: Vec<&RecordingNote> = first.iter().flat_map(PreparedRecording::notes).collect();
    for note in second.iter().flat_map(PreparedRecording::notes) {
        if !told.contains(&note) {
            terminal::remark(note);
        }
    }
    // Both models follow the same motion, each with its own prepared recordings.
    let [first, second] = [&first, &second].map(|runs| runs.iter().collect::<Vec<_>>());
    let variants = VariantComparison::along_recordings([before, after], [&first, &second])?;
    for note in &variants.notes {
        terminal::remark(note);
    }
    Ok(Some(variants))
}
