//! Candidates for compliance and backlash of gears. The encoder measures the motor side. The load is displaced
//! by torque times compliance, or by half the play towards the loaded flank. This acts on the forces like an
//! error of the encoder. Inertia of the motor and impacts between flanks are neglected.

use modelmill_identify::diagnose::{
    CandidateEffect, CandidateNature, ColumnChoice, ColumnSource, EffectParameter, ForceColumn, LocatedEffect,
    SignConstraint,
};
use modelmill_spec::DriveKind;

use crate::along;
use crate::error::Outcome;
use crate::model::Model;
use crate::regressors::SegmentList;

use super::numbers::stack;

/// Kind of the compliance of a drive.
pub(crate) const COMPLIANCE: &str = "drive_compliance";

/// Kinds with their parameters. The displacement of the load is torque times compliance, or half the play to
/// either side.
const KINDS: [(&str, &str); 2] = [(COMPLIANCE, "compliance"), ("backlash", "play")];

/// Compliance and backlash of every drive on a joint. `slopes` are the derivatives of the forces by position,
/// rate and acceleration of each coordinate; `values` are the base parameters.
///
/// Fails when a pose has no solution.
pub(crate) fn gears(
    model: &Model,
    all: &SegmentList<'_>,
    values: &[f64],
    slopes: &[Option<[ForceColumn; 3]>],
) -> Outcome<Vec<CandidateEffect>> {
    // Friction of motor and gear does not load the gear, so effects are left out of the load.
    let carried: Vec<f64> = (values.iter().enumerate())
        .map(|(k, value)| if model.is_effect(k) { 0.0 } else { *value })
        .collect();
    let n = model.row_names().len();
    let loads = stack(all, |one| {
        let loads = along::forces(model, one, &carried)?;
        // Central differences in time.
        let rate = |values: &[f64]| -> Vec<f64> {
            let last = values.len().saturating_sub(1);
            let time = &one.run.time;
            let slope = |i: usize| {
                let (a, b) = (i.saturating_sub(1), (i + 1).min(last));
                (values[b] - values[a]) / (time[b] - time[a]).max(f64::MIN_POSITIVE)
            };
            (0..values.len()).map(slope).collect()
        };
        // The displacement of the load has a rate and an acceleration too, in proportion to those of the torque.
        let rates: Vec<Vec<f64>> = loads.iter().map(|load| rate(load)).collect();
        let bends = rates.iter().map(|of| rate(of)).collect::<Vec<_>>();
        Ok(loads.into_iter().chain(rates).chain(bends).collect())
    })?;
    let mechanism = &model.derivation.mechanism;
    let active = model.active_coordinates();
    let driven = mechanism.drives.iter().filter(|drive| drive.is_driven);
    let mut candidates = Vec::new();
    // Only gears at joints are modelled.
    for (d, drive) in driven.enumerate() {
        let DriveKind::Joint(joint) = drive.kind else {
            continue;
        };
        let name = &mechanism.coordinates[joint.0].name;
        // Gears at passive joints have no recorded motion.
        let Some(i) = active.iter().position(|one| one == name) else {
            continue;
        };
        let Some(slopes) = slopes.get(i).and_then(Option::as_ref) else {
            continue;
        };
        // Units depend on the kind of the joint.
        let is_angle = model.active_coordinate_types()[i].1;
        for (kind, symbol) in KINDS {
            let is_yielding = kind == COMPLIANCE;
            // Displacement of the load and its derivatives: order 0, 1 and 2.
            let shift = |order: usize, sample: usize| match (is_yielding, order) {
                (true, order) => loads[order * n + d][sample],
                // Half the play, towards the side that the load presses.
                (false, 0) => 0.5 * loads[d][sample].signum(),
                (false, _) => 0.0,
            };
            let mut column = ForceColumn(vec![None; n]);
            for (order, slope) in slopes.iter().enumerate() {
                let mut part = slope.clone();
                for values in part.0.iter_mut().flatten() {
                    for (sample, x) in values.iter_mut().enumerate() {
                        *x *= shift(order, sample);
                    }
                }
                // Forces belong to the true position, so the error enters with a minus sign.
                column.add(-1.0, &part);
            }
            if column.is_zero() {
                continue;
            }
            // The unit of compliance or play depends on the kind of joint.
            let unit = match (is_yielding, is_angle) {
                (true, true) => "rad/(N m)",
                (true, false) => "m/N",
                (false, true) => "rad",
                (false, false) => "m",
            };
            candidates.push(CandidateEffect {
                effect: LocatedEffect {
                    kind: kind.to_owned(),
                    at: vec![drive.name.clone()],
                },
                parameters: vec![EffectParameter {
                    symbol: symbol.to_owned(),
                    unit: unit.to_owned(),
                    sign: SignConstraint::Positive,
                }],
                searched_constants: 0,
                is_part_of_load: false,
                refines: None,
                nature: CandidateNature::Effect,
                is_per_run: false,
                source: ColumnSource::Columns(vec![ColumnChoice {
                    constants: Vec::new(),
                    columns: vec![column],
                }]),
            });
        }
    }
    Ok(candidates)
}
