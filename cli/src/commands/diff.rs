//! `diff`: what a variant changes, for people who review it.

use modelmill::Host;
use modelmill::model::Changes;

use crate::args::DiffArgs;
use crate::failure::Outcome;
use crate::{commands, terminal};

/// Prints what changed between two models.
pub(crate) fn run(host: &Host, args: &DiffArgs) -> Outcome {
    let before = commands::model(host, &args.before)?;
    let after = commands::model(host, &args.after)?;
    let inputs = before.files().chain(after.files());
    if let Some(target) = args.drawing.target(inputs)? {
        args.drawing.draw(&target, &after, Some(&before))?;
    }
    let changes = Changes::between(&before, &after);
    if args.json {
        return terminal::print_json(&changes.json(&before, &after));
    }
    terminal::print(&changes.text(&before, &after, terminal::style()))
}
