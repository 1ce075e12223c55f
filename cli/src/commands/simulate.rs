//! `simulate`: simulates a rig along a trajectory and writes the recording of its sensors.

use std::path::Path;

use modelmill::Host;
use modelmill::text::table::count;
use serde_json::json;

use crate::args::SimulateArgs;
use crate::failure::CommandOutcome;
use crate::output::OutputFile;
use crate::terminal;

/// Writes `t`, the coordinates and one column per drive.
pub(crate) fn run(host: &Host, args: &SimulateArgs) -> CommandOutcome {
    let loaded = host.rig(&args.rig)?;
    let mut inputs: Vec<&Path> = loaded.sources.paths().collect();
    inputs.push(&args.trajectory);
    let target = OutputFile::new(&args.out, inputs)?;
    // The seed of the rig file is used without --seed.
    let made = host.simulate(&args.rig, &args.trajectory, &args.map, args.seed)?;
    target.write(&made.csv())?;
    if args.json {
        let columns = made.run.columns.iter();
        let columns: Vec<&str> = columns.map(|(name, _)| name.as_str()).collect();
        return terminal::print_json(&json!({
            "rig": made.rig,
            "out": args.out.display().to_string(),
            "samples": made.samples(),
            "seed": made.seed,
            "columns": columns,
            "notes": made.notes,
        }));
    }
    for note in &made.notes {
        terminal::note(note);
    }
    terminal::note(&format!(
        "{}: {} of {}, seed {}",
        target.path().display(),
        count(made.samples(), "sample", "samples"),
        made.drives.join(", "),
        made.seed
    ));
    Ok(())
}
