//! Candidates for Dahl friction (P. R. Dahl, AIAA Journal 14, 1976): after each reversal it builds up over a
//! distance, like bristles that bend before they slip. It depends on the earlier motion, so a model file cannot
//! contain it.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::diagnose::{
    CandidateEffect, CandidateNature, ColumnChoice, ColumnSource, EffectParameter, ForceColumn, LocatedEffect,
    SignConstraint,
};

use crate::along;
use crate::error::Outcome;
use crate::model::Model;
use crate::segment::RecordingSegment;

use super::numbers::stack;
use crate::regressors::SegmentList;

/// Distances that are tried, as parts of the travel of the drive.
const LENGTHS: [f64; 12] = [
    0.001, 0.002, 0.004, 0.007, 0.012, 0.02, 0.035, 0.06, 0.1, 0.17, 0.3, 0.5,
];

/// Dahl friction of every drive.
///
/// Fails when a pose has no solution.
pub(crate) fn dahl_candidates(model: &Model, all: &SegmentList<'_>) -> Outcome<Vec<CandidateEffect>> {
    let evaluator = ModelEvaluator::new(&model.derivation);
    let drives = model.row_names();
    let mut candidates = Vec::new();
    let positions = |one: &RecordingSegment| -> Outcome<Vec<Vec<f64>>> {
        let mut columns = along::columns(model, one, |states| evaluator.drive_motion(states))?;
        columns.truncate(drives.len());
        Ok(columns)
    };
    // The travel over all recordings sets the scale of the distances.
    let mut travels = vec![[f64::INFINITY, f64::NEG_INFINITY]; drives.len()];
    for (one, _) in all {
        for (travel, values) in travels.iter_mut().zip(positions(one)?) {
            for x in values {
                *travel = [travel[0].min(x), travel[1].max(x)];
            }
        }
    }
    for (d, drive) in drives.iter().enumerate() {
        let travel = travels[d][1] - travels[d][0];
        if travel.is_nan() || travel <= 0.0 {
            continue;
        }
        let lengths = LENGTHS.map(|part| part * travel);
        // The states of all distances are computed together, to evaluate the positions once.
        let of_lengths = stack(all, |one| {
            let position = &positions(one)?[d];
            Ok(lengths.map(|length| bristle_states(position, length)).to_vec())
        })?;
        // The search tries one distance after the other.
        let choice = |(length, states): (f64, Vec<f64>)| {
            let mut column = ForceColumn(vec![None; drives.len()]);
            column.0[d] = Some(states);
            ColumnChoice {
                constants: vec![("length".to_owned(), length)],
                columns: vec![column],
            }
        };
        let choices = lengths.into_iter().zip(of_lengths).map(choice).collect();
        candidates.push(CandidateEffect {
            effect: LocatedEffect {
                kind: "dahl_friction".to_owned(),
                at: vec![drive.clone()],
            },
            parameters: vec![EffectParameter {
                symbol: "Fc".to_owned(),
                unit: model.force_unit(d).to_owned(),
                sign: SignConstraint::Positive,
            }],
            searched_constants: 1,
            is_part_of_load: false,
            refines: Some("coulomb_friction".to_owned()),
            nature: CandidateNature::Effect,
            is_per_run: false,
            source: ColumnSource::Columns(choices),
        });
    }
    Ok(candidates)
}

/// The state of the bristles along a position, between -1 and 1, by `dz/dx = (sign - z) / length`. Each step
/// uses the exact solution of this equation, so large steps are stable.
fn bristle_states(position: &[f64], length: f64) -> Vec<f64> {
    let mut state = 0.0_f64;
    let mut before = position.first().copied().unwrap_or(0.0);
    let step = |x: &f64| {
        let moved = x - before;
        before = *x;
        let bound = if moved < 0.0 { -1.0 } else { 1.0 };
        // The sign of the motion is constant between two samples.
        state = bound + (state - bound) * (-moved.abs() / length).exp();
        state
    };
    position.iter().map(step).collect()
}
