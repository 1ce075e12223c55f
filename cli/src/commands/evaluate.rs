//! `evaluate`: the model's forces along a recording.

use std::fmt::Write as _;
use std::path::Path;

use crate::along;
use crate::args::EvaluateArgs;
use crate::data;
use crate::failure::Outcome;
use crate::model;
use crate::output::Target;
use crate::table::count;
use crate::terminal;

/// Writes `t` and one column per drive.
pub(crate) fn run(args: &EvaluateArgs) -> Outcome {
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
    // The model's own force, when it acts: without a delay of its reading.
    let data = data::read_as_recorded(&model, &args.data, &args.preparation)?;
    let mut text = format!("t,{}\n", model.drives().join(","));
    let mut samples = 0;
    for stretch in &data {
        let forces = along::forces(&model, stretch, &values)?;
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
    match target {
        Some(target) => {
            target.write(&text)?;
            terminal::note(&format!(
                "{}: {} of {}",
                target.path().display(),
                count(samples, "sample", "samples"),
                model.drives().join(", ")
            ));
            Ok(())
        }
        None => terminal::print(&text),
    }
}
