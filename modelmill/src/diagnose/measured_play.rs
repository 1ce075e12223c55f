//! Play of a joint that the positions of a recording show. Input: the findings of a diagnosis; output: the same with
//! this play as an effect.
//!
//! Decision: play between an encoder and the body that it measures belongs to the machine, so that a rigid model lacks
//! it, whether or not the forces show it. Its width is measured in the positions, which show it far more clearly.

use modelmill_identify::diagnose::{
    CandidateEffect, DiagnosisVerdict, Disturbance, EffectSupport, IdentifiedEffect, ModelDiagnosis,
};
use modelmill_spec::DriveKind;

use crate::model::Model;

/// Kind of the effect, and of the disturbance that is replaced by it.
const KIND: &str = "backlash";

/// The t value of a width without a standard deviation: any that counts as certain.
const CERTAIN_T: f64 = 100.0;

/// Turns play that was measured in the positions of driven joints into effects. Forces that show the same play keep
/// their effect.
pub(crate) fn report_as_effects(model: &Model, candidates: &[CandidateEffect], diagnosis: &mut ModelDiagnosis) {
    let coordinates: Vec<String> = (diagnosis.disturbances.iter())
        .filter(|one| one.kind == KIND)
        .flat_map(|one| one.at.iter().cloned())
        .collect();
    for coordinate in coordinates {
        let Some(drive) = drive_of(model, &coordinate) else {
            continue;
        };
        let is_its = |kind: &str, at: &[String]| kind == KIND && at == std::slice::from_ref(&drive);
        let Some(candidate) = candidates
            .iter()
            .position(|one| is_its(&one.effect.kind, &one.effect.at))
        else {
            continue;
        };
        let is_measured = |one: &Disturbance| one.kind == KIND && one.at.contains(&coordinate);
        let (measured, others): (Vec<Disturbance>, Vec<Disturbance>) = std::mem::take(&mut diagnosis.disturbances)
            .into_iter()
            .partition(is_measured);
        diagnosis.disturbances = others;
        let is_known = |found: &IdentifiedEffect| is_its(&found.effect.kind, &found.effect.at);
        if measured.is_empty() || diagnosis.effects.iter().any(is_known) {
            continue;
        }
        diagnosis.possible_effects.retain(|found| !is_known(found));
        let (width, deviation) = mean_width(&measured);
        // What is measured directly is certain, as far as anything is.
        let support = EffectSupport {
            white_residual: true,
            t: deviation.filter(|std| *std > 0.0).map_or(CERTAIN_T, |std| width / std),
            gain: 1.0,
            unexplained: 0.0,
            share: 1.0,
            has_clear_value: true,
        };
        diagnosis.effects.push(IdentifiedEffect {
            effect: candidates[candidate].effect.clone(),
            candidate,
            constants: Vec::new(),
            estimates: vec![width],
            standard_deviations: vec![deviation],
            probability: support.probability(),
            support,
            indistinguishable_from: Vec::new(),
            shared_with: Vec::new(),
            is_measured: true,
        });
        if diagnosis.verdict == DiagnosisVerdict::Adequate {
            diagnosis.verdict = DiagnosisVerdict::MissingEffect;
        }
        for one in diagnosis
            .candidates
            .iter_mut()
            .filter(|one| is_its(&one.effect.kind, &one.effect.at))
        {
            one.rejection_reason = None;
        }
    }
}

/// The drive of a joint; `None` if nothing drives it directly.
fn drive_of(model: &Model, coordinate: &str) -> Option<String> {
    let mechanism = &model.derivation.mechanism;
    let moves = |kind: DriveKind| matches!(kind, DriveKind::Joint(i) if mechanism.coordinates[i.0].name == coordinate);
    let mut drives = mechanism.drives.iter().filter(|drive| drive.is_driven);
    drives.find(|drive| moves(drive.kind)).map(|drive| drive.name.clone())
}

/// Mean width of the recordings that show the play, with its standard deviation, rad or m.
fn mean_width(measured: &[Disturbance]) -> (f64, Option<f64>) {
    let all: Vec<_> = measured.iter().flat_map(|one| &one.estimates).collect();
    let n = all.len().max(1) as f64;
    let width = all.iter().map(|one| one.value).sum::<f64>() / n;
    let variances: Option<Vec<f64>> = all.iter().map(|one| one.standard_deviation.map(|s| s * s)).collect();
    let deviation = variances.map(|variances| variances.iter().sum::<f64>().sqrt() / n);
    (width, deviation)
}
