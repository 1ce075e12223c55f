//! `evaluate`: the model's forces along a recording, of the drives or in the joints.

use std::fmt::Write as _;
use std::path::Path;

use modelmill_codegen::Reactions;

use crate::along;
use crate::args::{EvaluateArgs, ParameterSource};
use crate::data;
use crate::failure::{Failure, Outcome};
use crate::model;
use crate::output::Target;
use crate::table::count;
use crate::terminal;

/// Writes `t` and one column per drive, or per component of a reaction.
pub(crate) fn run(args: &EvaluateArgs) -> Outcome {
    if args.reactions && args.parameters != ParameterSource::Nominal {
        return Err(Failure::Usage(
            "--reactions takes the model file's parameters: a fit holds base parameters, and joints are loaded by what no \
             drive feels; write identified masses and inertias into the model file (`interpret`, `identify --physical`)"
                .to_owned(),
        ));
    }
    let model = model::derive(&args.model)?;
    let mut inputs: Vec<&Path> = model.files.iter().map(AsRef::as_ref).collect();
    inputs.push(&args.data);
    inputs.extend(args.parameters.file().map(AsRef::<Path>::as_ref));
    let target = args
        .out
        .as_ref()
        .map(|path| Target::new(path, inputs))
        .transpose()?;
    let values = model.values(&args.parameters)?;
    let reactions = if args.reactions {
        let derived = model.derivation.reactions();
        Some(derived.map_err(|error| Failure::Input(format!("{}: {error}", model.path)))?)
    } else {
        None
    };
    let columns = reactions
        .as_ref()
        .map_or_else(|| model.drives(), |reactions| components(reactions).told);
    // The model's own force, when it acts: without a delay of its reading.
    let data = data::read_as_recorded(&model, &args.data, &args.preparation)?;
    let mut text = format!("t,{}\n", columns.join(","));
    let mut samples = 0;
    for stretch in &data {
        let forces = match &reactions {
            Some(reactions) => along::reactions(&model, stretch, reactions)?,
            None => along::forces(&model, stretch, &values)?,
        };
        let time = stretch.time();
        samples += time.len();
        for (i, t) in time.iter().enumerate() {
            let _ = write!(text, "{t}");
            for force in &forces {
                let _ = write!(text, ",{}", force[i]);
            }
            text.push('\n');
        }
    }
    let left_out = reactions.map_or_else(Vec::new, |r| components(&r).left_out);
    if !left_out.is_empty() {
        terminal::note(&format!(
            "not determined by equations of motion, since the mechanism is held there more often than once: {}",
            left_out.join(", ")
        ));
    }
    match target {
        Some(target) => {
            target.write(&text)?;
            terminal::note(&format!(
                "{}: {} of {}",
                target.path().display(),
                count(samples, "sample", "samples"),
                columns.join(", ")
            ));
            Ok(())
        }
        None => terminal::print(&text),
    }
}

/// Names of the components of all reactions, such as `elbow.Fx`, `elbow.Mz`, and of a loop `closure.Fx`.
struct Components {
    /// Those that are determined, in the order of the program's outputs.
    told: Vec<String>,
    left_out: Vec<String>,
}

fn components(reactions: &Reactions) -> Components {
    let mut found = Components {
        told: Vec::new(),
        left_out: Vec::new(),
    };
    let mut sort = |name: &str, kind: char, places: &[Option<usize>; 3]| {
        for (axis, place) in ['x', 'y', 'z'].into_iter().zip(places) {
            let column = format!("{name}.{kind}{axis}");
            match place {
                Some(_) => found.told.push(column),
                None => found.left_out.push(column),
            }
        }
    };
    for joint in &reactions.joints {
        sort(&joint.name, 'F', &joint.force);
        sort(&joint.name, 'M', &joint.moment);
    }
    for closed in &reactions.loops {
        sort(&closed.name, 'F', &closed.force);
    }
    found
}
