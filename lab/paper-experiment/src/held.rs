//! The paper's situation put to the tool: parameters from CAD, which are fixed, and recordings of a robot whose contact
//! points are beside the axes of the cranks. The diagnosis has no hint which mass or length is wrong.

use modelmill::diagnose::{DiagnosisOptions, FixedParameters, MissingEffect, words};
use modelmill::recording::RecordingOptions;
use modelmill::segment::RecordingSegment;
use modelmill::{Model, Outcome};

use crate::bundled;

/// Results of two diagnoses of the paper's model with fixed parameters.
pub(crate) struct HeldDiagnosis {
    /// The true distance of the contact points, m.
    pub(crate) offset: f64,
    /// Mass of the misplaced platform (kg) and distance of the contact points (m), found together.
    pub(crate) first: [Option<f64>; 2],
    /// The mass after the distance was written into the model file, kg.
    pub(crate) second: Option<f64>,
    /// Error on the validation run before and after the first diagnosis (nrms).
    pub(crate) errors: [f64; 2],
    /// Effects that explain the recordings as well as the distance.
    pub(crate) alternatives: Vec<String>,
}

impl HeldDiagnosis {
    /// Diagnoses the paper's model along an identification and a verification run.
    pub(crate) fn new(paper: &Model, runs: [&RecordingSegment; 2], offset: f64) -> Outcome<Self> {
        let (first, errors) = diagnose(paper, runs, 0.0)?;
        let effect = |effects: &[MissingEffect], kind: &str| -> Option<MissingEffect> {
            effects.iter().find(|one| one.effect.kind == kind).cloned()
        };
        let value = |effect: &Option<MissingEffect>| -> Option<f64> { Some(effect.as_ref()?.estimates.first()?.value) };
        let distance = effect(&first, "constant_error");
        let found = [value(&effect(&first, "lumped_mass_placement")), value(&distance)];
        // As a user would do: the distance is written into the model file, with tenths of a millimetre.
        let second = match found[1] {
            Some(distance) => {
                let (again, _) = diagnose(paper, runs, (1e4 * distance).round() / 1e4)?;
                value(&effect(&again, "lumped_mass_placement"))
            }
            None => None,
        };
        Ok(Self {
            offset,
            first: found,
            second,
            errors,
            alternatives: distance
                .iter()
                .flat_map(|one| &one.indistinguishable_from)
                .map(words::effect)
                .collect(),
        })
    }
}

/// The effects that the paper's model lacks if its file has a constant `eA` for the distance, and the error on the
/// validation run before and after.
fn diagnose(paper: &Model, runs: [&RecordingSegment; 2], distance: f64) -> Outcome<(Vec<MissingEffect>, [f64; 2])> {
    let text = format!(
        "schema = 1\nname = \"spidermill_contact\"\nextends = \"spidermill-paper.toml\"\n\
         [constants]\neA = {{ value = {distance}, unit = \"m\" }}\n\
         [[point]]\nname = \"A_left\"\nat = [\"dA\", \"eA\"]\n\
         [[point]]\nname = \"A_right\"\nat = [\"dA\", \"-eA\"]\n"
    );
    let model = bundled::variant(paper.host(), "the paper's model", "contact.toml", &text)?;
    let recordings =
        runs.map(|run| model.recording_of_table(&run.run.file, table(&model, run), &RecordingOptions::default()));
    let [fit, check] = recordings;
    let (fit, check) = (fit?, check?);
    let options = DiagnosisOptions {
        fixed: FixedParameters::All,
        repeat_with_nominal: false,
    };
    let findings = model.diagnose(&[&fit], &[&check], &options)?;
    let steps = &findings.diagnosis.steps;
    let ends = [steps.first(), steps.last()].map(|step| step.map_or(f64::NAN, |step| step.check));
    Ok((findings.missing, ends))
}

/// The columns of a run, as they would stand in a file.
fn table(model: &Model, segment: &RecordingSegment) -> Vec<(String, Vec<f64>)> {
    let run = &segment.run;
    let mut columns = vec![("t".to_owned(), run.time.clone())];
    for (i, name) in model.active_coordinates().into_iter().enumerate() {
        for (suffix, values) in [("", &run.q), ("_d", &run.qd), ("_dd", &run.qdd)] {
            columns.push((format!("{name}{suffix}"), values[i].clone()));
        }
    }
    columns.extend(model.row_names().into_iter().zip(run.force.iter().flatten().cloned()));
    columns
}
