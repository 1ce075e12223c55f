//! `simulate`: simulates a rig along a trajectory and writes the recording of its sensors, or a model under the forces of a
//! recording.

use std::path::{Path, PathBuf};

use modelmill::Host;
use modelmill::recording::RecordingOptions;
use modelmill::text::table::count;
use serde_json::json;

use crate::args::SimulateArgs;
use crate::failure::{CommandFailure, CommandOutcome};
use crate::output::OutputFile;
use crate::{commands, terminal};

/// Writes `t`, the coordinates and one column per drive; for a model also the rates.
pub(crate) fn run(host: &Host, args: &SimulateArgs) -> CommandOutcome {
    match (args.data.as_ref().or(args.command.as_ref()), &args.trajectory) {
        (Some(data), _) => simulate_model(host, args, data),
        (None, Some(trajectory)) => simulate_rig(host, args, trajectory),
        (None, None) => Err(CommandFailure::Usage(
            "--trajectory of a rig, or --data or --command of a model, is needed".to_owned(),
        )),
    }
}

/// The motion of a model under the forces or the signals of a recording.
fn simulate_model(host: &Host, args: &SimulateArgs, data: &Path) -> CommandOutcome {
    let model = args.parameters.apply_to(host, commands::model(host, &args.rig)?)?;
    let inputs = commands::files_of(data);
    let inputs = model.files().chain(inputs.iter().map(PathBuf::as_path));
    let inputs: Vec<&Path> = inputs.chain(args.parameters.file().map(PathBuf::as_path)).collect();
    let target = OutputFile::new(&args.out, inputs)?;
    let reading = RecordingOptions {
        columns: args.map.clone(),
        ..RecordingOptions::default()
    };
    let files = commands::files_of(data);
    let files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    let runs = [files];
    let [mut recordings, _] = if args.command.is_some() {
        model.prepare_recordings_from_signals([&runs, &[]], &reading)
    } else {
        model.prepare_recordings_with_signals([&runs, &[]], &reading)
    };
    let Some(recording) = recordings.pop() else {
        return Err(CommandFailure::Input(format!("{} has no samples", data.display())));
    };
    let made = model.simulate_motion(&recording?, &model.values)?;
    target.write(&made.csv())?;
    if args.json {
        return terminal::print_json(&json!({
            "model": model.name,
            "parameters": args.parameters.name(),
            "out": args.out.display().to_string(),
            "samples": made.samples(),
            "input": made.input.name(),
            "coordinates": made.coordinates,
        }));
    }
    terminal::note(&format!(
        "{}: {} of {} under the {} of {}",
        target.path().display(),
        count(made.samples(), "sample", "samples"),
        made.coordinates.join(", "),
        made.input.name(),
        data.display()
    ));
    Ok(())
}

/// The sensors of a rig along a trajectory.
fn simulate_rig(host: &Host, args: &SimulateArgs, trajectory: &Path) -> CommandOutcome {
    let loaded = commands::rig(host, &args.rig)?;
    let mut inputs: Vec<&Path> = loaded.sources.paths().collect();
    inputs.push(trajectory);
    let target = OutputFile::new(&args.out, inputs)?;
    // The seed of the rig file is used without --seed.
    let made = host.simulate(&args.rig, trajectory, &args.map, args.seed)?;
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
