//! `compare`: how far the model is off along recordings, and where.

use serde_json::json;

use crate::along;
use crate::args::CompareArgs;
use crate::data::{self, Data};
use crate::failure::{Failure, Outcome};
use crate::model;
use crate::show;
use crate::suspects;
use crate::table::count;
use crate::terminal;

/// Prints error figures and the regions where the error lives.
pub(crate) fn run(args: &CompareArgs) -> Outcome {
    let model = model::derive(&args.model)?;
    let values = model.values(&args.parameters)?;
    let mut data = data::read_all(&model, &args.data, &args.preparation)?;
    data::note_twins(&mut data, &mut []);
    suspects::examine(&model, &mut data);
    let measured = data
        .iter()
        .map(along::measured)
        .collect::<Outcome<Vec<_>>>()?;
    let forces = data
        .iter()
        .map(|one| along::forces(&model, one, &values))
        .collect::<Outcome<Vec<_>>>()?;
    let pairs = measured
        .iter()
        .map(Vec::as_slice)
        .zip(forces.iter().map(Vec::as_slice));
    let figures = along::figures(&model.drives(), pairs)?;
    let places = along::places(&model, &data, &measured, &forces)?;
    if args.json {
        let notes: Vec<_> = data.iter().flat_map(Data::notes).collect();
        let mut object = json!({
            "model": model.name,
            "parameters": args.parameters.name(),
        });
        let figures = serde_json::to_value(&figures).map_err(Failure::input)?;
        if let (Some(object), Some(figures)) = (object.as_object_mut(), figures.as_object()) {
            object.extend(figures.clone());
            object.insert("where".to_owned(), json!(places.regions));
            object.insert("data".to_owned(), json!(notes));
        }
        return terminal::print_json(&object);
    }
    let style = terminal::style();
    let mut lines = vec![style.bold(&format!(
        "{} with {} parameters on {}",
        model.name,
        args.parameters.name(),
        data.iter()
            .map(|one| one.run.file.as_str())
            .collect::<Vec<_>>()
            .join(", "),
    ))];
    lines.push(format!("  {}", count(figures.samples, "sample", "samples")));
    lines.push(String::new());
    lines.extend(show::figures(&[("error", &figures)]));
    lines.push(String::new());
    lines.push(style.bold("where the error lives"));
    lines.extend(show::places(&places));
    terminal::print(&lines.join("\n"))
}
