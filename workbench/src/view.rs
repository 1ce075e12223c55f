//! JSON views for the page: the model with its base parameters and those of the saved file, errors, findings.

use modelmill::diagnose::DiagnosisFindings;
use modelmill::excite::limits;
use modelmill::identify::Identification;
use modelmill::model::ModelCheck;
use modelmill::print::{self, RemedyWording, edit};
use modelmill::recording::PreparedRecording;
use modelmill::{EffectKind, Error, Model, RecordingNote, report};
use serde_json::{Value, json};

use crate::options::WorkbenchCommands;

/// View of a derivation: warnings and notes if the text is valid, else its faults with their lines.
pub(crate) fn derivation_view(found: &Result<Model, Error>, path: &str, wording: &dyn RemedyWording) -> Value {
    match found {
        Ok(model) => json!({
            "valid": true,
            "diagnostics": print::warnings(&model.loaded, wording),
            "notes": model.notes.iter().chain(&model.base_parameter_values().notes).map(|note| note.json(wording)).collect::<Vec<_>>(),
        }),
        Err(Error::Model(faults)) => print::faults(faults, wording),
        Err(error) => print::refusal(&error.format_for(wording), path),
    }
}

/// View of the base parameters with their values and those of the saved model, of coordinates and drives.
pub(crate) fn equations(model: &Model, saved: Option<&Model>) -> Value {
    let value = |model: &Model, k: usize| model.has_values(k).then(|| model.values[k]);
    let base: Vec<Value> = (model.base.iter().enumerate())
        .map(|(k, base)| {
            // Base parameters of two models correspond if their expressions are equal.
            let same = |one: &&Model| one.base.iter().position(|b| b.expression == base.expression);
            let before = saved.and_then(|saved| Some((saved, same(&saved)?)));
            let was = before.and_then(|(saved, i)| value(saved, i));
            let now = value(model, k);
            let change = match (saved, before) {
                (None, _) => "same",
                (Some(_), None) => "new",
                (Some(_), Some(_)) if was == now => "same",
                (Some(_), Some(_)) => "changed",
            };
            json!({
                "name": base.name,
                "retained": base.retained,
                "expression": base.expression,
                "unit": base.unit,
                "value": now,
                "was": was,
                "change": change,
            })
        })
        .collect();
    // Base parameters of the saved model that the edited one does not have.
    let gone: Vec<&str> = (saved.iter().flat_map(|saved| &saved.base))
        .filter(|old| model.base.iter().all(|new| new.expression != old.expression))
        .map(|old| old.expression.as_str())
        .collect();
    let summary = ModelCheck {
        model: model.clone(),
        summary: model.summary(),
        rank: None,
        warnings: Vec::new(),
        magnitudes: model.magnitudes(),
    };
    json!({
        "base": base,
        "gone": gone,
        "summary": summary.text(modelmill::text::TerminalStyle::PLAIN),
        "products": model.derivation.reduction.products.len(),
        "coordinates": model.active_coordinate_types().iter().map(|(name, is_angle)| {
            let mut all = model.derivation.mechanism.coordinates.iter();
            let nominal = all.find(|c| c.name == *name).map_or(0.0, |c| c.nominal);
            let limits = position_limits(model, name);
            json!({ "name": name, "angle": is_angle, "nominal": nominal, "limits": limits })
        }).collect::<Vec<_>>(),
        "drives": model.row_names(),
    })
}

/// Smallest and largest position of a coordinate by the limits of the model file, rad or m.
fn position_limits(model: &Model, name: &str) -> Option<[f64; 2]> {
    let known = limits::merged_limits(model, &[]).ok()?;
    let coordinates = &model.derivation.mechanism.coordinates;
    let mut all = known.coordinates.iter();
    let (_, found) = all.find(|(i, _)| coordinates[i.0].name == name)?;
    found
        .position
        .filter(|[low, high]| low.is_finite() && high.is_finite() && low < high)
}

/// View of the errors along recordings, with nominal and with identified values, and of the remarks on recordings and
/// fit. Each remark occurs once.
pub(crate) fn errors(
    found: &Identification,
    recordings: &[Vec<PreparedRecording>; 2],
    wording: &dyn RemedyWording,
) -> Value {
    let remarks = recordings.iter().flatten().flat_map(PreparedRecording::notes);
    let mut notes: Vec<&RecordingNote> = Vec::new();
    for note in remarks.chain(&found.notes) {
        if !notes.contains(&note) {
            notes.push(note);
        }
    }
    json!({
        "nominal": { "fit": found.nominal_fit, "check": found.nominal_check },
        "identified": { "fit": found.fit.fit, "check": found.fit.check },
        "samples": found.fit.samples,
        "notes": notes.iter().map(|note| note.json(wording)).collect::<Vec<_>>(),
    })
}

/// View of a diagnosis: its JSON, the verdict as a sentence, the picture of the error after each added effect, and the
/// effects that can be added.
pub(crate) fn findings(findings: &DiagnosisFindings, commands: &dyn WorkbenchCommands) -> Value {
    let model = &findings.before.model;
    let mut view_json = findings.json(commands);
    view_json["says"] = json!(findings.verdict_text());
    view_json["picture"] = json!(report::steps_picture(findings));
    view_json["judged"] = json!(findings.validation.phrase());
    view_json["entries"] = findings
        .entries_to_add()
        .iter()
        .map(|entry| {
            let mut view_json = edit::effect_json(entry);
            view_json["command"] = json!(commands.format_effect(model, entry));
            view_json
        })
        .collect();
    view_json
}

/// Data for completions in the editor: the schema of model files, and the known kinds of effects.
pub(crate) fn completion_data(kinds: &[EffectKind]) -> Value {
    let schema: Value = serde_json::from_str(modelmill::SCHEMA).unwrap_or_default();
    json!({ "schema": schema, "kinds": print::effects::json(kinds)["kinds"] })
}
