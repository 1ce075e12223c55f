//! `simulate`: a rig driven along a trajectory, as a recording.

use std::fmt::Write as _;
use std::path::Path;

use modelmill_identify::{ReadOptions, Recording};
use modelmill_rig::{Rig, Run, Samples, SimulationError, Trajectory, TrajectoryError};
use serde_json::json;

use crate::args::SimulateArgs;
use crate::failure::{Failure, Outcome};
use crate::model;
use crate::output::Target;
use crate::progress::watched;
use crate::table::count;
use crate::terminal;

/// Writes `t`, the coordinates and one column per drive.
pub(crate) fn run(args: &SimulateArgs) -> Outcome {
    let loaded = load(&args.rig)?;
    let rig = &loaded.rig;
    let mut inputs: Vec<&Path> = loaded.sources.paths().collect();
    inputs.push(&args.trajectory);
    let target = Target::new(&args.out, inputs)?;
    let recording = Recording::read_with(
        &args.trajectory,
        &ReadOptions {
            renames: args.map.clone(),
            ..ReadOptions::default()
        },
    )?;
    let mut notes = Vec::new();
    let trajectory = trajectory(rig, &recording, &mut notes)?;
    let steps = modelmill_rig::n_instants(rig, &trajectory);
    let made = watched(&format!("simulating {}", rig.name), steps, |done| {
        modelmill_rig::simulate(rig, &trajectory, args.seed, || done.add(1))
    });
    let made = made.map_err(|error| refusal(rig, &args.rig, &recording, &trajectory, &error))?;
    notes.extend(made.notes.iter().cloned());
    target.write(&csv(&made))?;
    let samples = made.columns.first().map_or(0, |(_, time)| time.len());
    if args.json {
        let columns: Vec<&str> = made.columns.iter().map(|(name, _)| name.as_str()).collect();
        return terminal::print_json(&json!({
            "rig": rig.name,
            "out": args.out.display().to_string(),
            "samples": samples,
            "seed": args.seed.unwrap_or(rig.seed),
            "columns": columns,
            "notes": notes,
        }));
    }
    for note in &notes {
        terminal::note(note);
    }
    let drives: Vec<&str> = rig.drives.iter().map(|drive| drive.name.as_str()).collect();
    terminal::note(&format!(
        "{}: {} of {}, seed {}",
        target.path().display(),
        count(samples, "sample", "samples"),
        drives.join(", "),
        args.seed.unwrap_or(rig.seed)
    ));
    Ok(())
}

/// Reads a rig file.
pub(crate) fn load(path: &Path) -> Outcome<modelmill_rig::Loaded> {
    if path.is_dir() {
        return Err(Failure::Input(format!(
            "{} is a folder; a rig file (TOML) is expected, such as those in model-spec/rigs",
            path.display()
        )));
    }
    modelmill_rig::load_file(path).map_err(|failure| {
        if modelmill_spec::load_file_with(path, model::libraries()).is_ok() {
            return Failure::Input(format!(
                "{} is a model file; a rig file is expected, which describes the whole machine (rig/README.md; \
                 model-spec/rigs holds some). Forces of a model along a motion come from `modelmill evaluate MODEL --data \
                 RUN --out FORCES.csv`",
                path.display()
            ));
        }
        Failure::Rendered(failure.render(terminal::errors_in_colour()))
    })
}

/// The columns `t` and, per coordinate, its values and what there is of its derivatives.
fn trajectory(rig: &Rig, recording: &Recording, notes: &mut Vec<String>) -> Outcome<Trajectory> {
    let given = |name: String| -> Outcome<Option<Vec<f64>>> {
        if recording.has(&name) {
            Ok(Some(recording.column(&name)?.to_vec()))
        } else {
            Ok(None)
        }
    };
    let mut samples = Vec::new();
    let mut found = Vec::new();
    for coordinate in &rig.coordinates {
        let name = &coordinate.name;
        let one = Samples {
            q: recording.column(name)?.to_vec(),
            qd: given(format!("{name}_d"))?,
            qdd: given(format!("{name}_dd"))?,
        };
        if one.qd.is_none() || one.qdd.is_none() {
            found.push(name.as_str());
        }
        samples.push(one);
    }
    if !found.is_empty() {
        notes.push(format!(
            "derivatives of {} are differences over five samples: noise or rounding of the positions would show in \
             the forces; give the columns with _d and _dd where they are known",
            found.join(", ")
        ));
    }
    let names: Vec<&str> = rig.coordinates.iter().map(|c| c.name.as_str()).collect();
    Trajectory::new(recording.column("t")?.to_vec(), samples).map_err(|error| {
        let file = recording.file();
        Failure::Input(match &error {
            TrajectoryError::TimeGoesBack { sample } => {
                format!(
                    "{file}, line {}, column `t`: {error}",
                    recording.line(*sample).unwrap_or(0)
                )
            }
            TrajectoryError::Faulty { coordinate } => {
                format!(
                    "{file}, column `{}`: {error}",
                    names.get(*coordinate).unwrap_or(&"")
                )
            }
            TrajectoryError::Empty | TrajectoryError::TooShort => format!("{file}: {error}"),
        })
    })
}

/// Why there is no run: with the line of the trajectory where the rig could not follow.
fn refusal(
    rig: &Rig,
    path: &Path,
    recording: &Recording,
    trajectory: &Trajectory,
    error: &SimulationError,
) -> Failure {
    let SimulationError::Pose { time, .. } = error else {
        return Failure::Input(format!("{}: {error}", path.display()));
    };
    let after = trajectory.time().partition_point(|t| t <= time);
    let line = recording.line(after.saturating_sub(1)).unwrap_or(0);
    let state = trajectory.at(*time);
    let pose: Vec<String> = rig
        .coordinates
        .iter()
        .zip(&state.q)
        .map(|(coordinate, q)| format!("{} = {q:.6}", coordinate.name))
        .collect();
    Failure::Input(format!(
        "{}, line {line} ({}): {error}; check units (rad, m) and signs, and which column is which coordinate",
        recording.file(),
        pose.join(", ")
    ))
}

fn csv(made: &Run) -> String {
    let names: Vec<&str> = made.columns.iter().map(|(name, _)| name.as_str()).collect();
    let mut text = names.join(",");
    text.push('\n');
    let samples = made.columns.first().map_or(0, |(_, time)| time.len());
    for i in 0..samples {
        for (k, (_, values)) in made.columns.iter().enumerate() {
            let _ = write!(text, "{}{}", if k == 0 { "" } else { "," }, values[i]);
        }
        text.push('\n');
    }
    text
}
