//! `effects`: the library of effects, as a list, or the description of one kind.

use std::fmt::Write as _;

use modelmill::Host;
use modelmill::print::effects;

use crate::args::effects::EffectsArgs;
use crate::failure::CommandOutcome;
use crate::{commands, terminal};

/// Prints all kinds as a table, or one kind with its equation and parameters.
pub(crate) fn run(host: &Host, args: &EffectsArgs) -> CommandOutcome {
    // A model file can define kinds in addition to those of the libraries.
    let mut kinds = match &args.model {
        Some(path) => commands::load(host, path)?.kinds,
        None => host.kinds()?,
    };
    if let Some(name) = &args.kind {
        let kind = effects::kind(&kinds, name)?.clone();
        if !args.json {
            let mut text = effects::kind_text(&kind, terminal::style());
            for other in effects::related_kinds(&kinds, name) {
                let _ = write!(text, "\n\nsee also {}: {}", other.name, other.says);
            }
            return terminal::print(&text);
        }
        kinds = vec![kind];
    }
    if args.json {
        return terminal::print_json(&effects::json(&kinds));
    }
    let mut lines = effects::kind_table(&kinds);
    lines.push(String::new());
    lines.push("`modelmill effects KIND` explains one; `modelmill add MODEL KIND --at PLACE` adds it.".to_owned());
    terminal::print(&lines.join("\n"))
}
