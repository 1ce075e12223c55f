//! Detects gravity of the wrong sign: a machine mounted upside down relative to its model, or a wrong sign of
//! `gravity` in the model file.
//!
//! Decision: no second derivation is needed. The columns at standstill are those of gravity, which change their
//! sign.

use modelmill_boundary::message;
use modelmill_boundary::text::Remedy;
use modelmill_identify::ForceAudit;
use nalgebra::DVector;

use super::rows::AuditRows;
use super::thresholds::{CORRECTION_MOST_RATIO, GRAVITY_LEAST_ERROR};
use super::{AuditFinding, GRAVITY};
use crate::model::Model;
use crate::segment::RecordingSegment;
use crate::text::table::percent;

/// A finding if reversed gravity explains the forces far better. `measured` are the forces at the samples, interleaved.
pub(super) fn reversed_gravity_finding(
    model: &Model,
    data: &RecordingSegment,
    samples: &[usize],
    measured: &DVector<f64>,
) -> Option<AuditFinding> {
    if model.gravity().iter().all(|g| *g == 0.0) {
        return None;
    }
    let error = |regressor| ForceAudit::new(regressor)?.error(measured);
    // Both fits include friction, inertia and offsets of the drives.
    let before = error(AuditRows::new(model, data, samples)?.regressor)?;
    if before < GRAVITY_LEAST_ERROR {
        return None;
    }
    let after = error(AuditRows::with_reversed_gravity(model, data, samples)?)?;
    (after < CORRECTION_MOST_RATIO * before).then(|| {
        let says = "gravity seems to point in the opposite direction".to_owned();
        let file = &data.run.file;
        let note = message!(
            "In {file} {says}. The best fit of the model with friction and offsets of its drives has an error of {} as it is, and \
             {} with reversed gravity. Check {}, and how the machine is mounted; a device \
             that more than balances its weight looks the same.",
            percent(Some(before)),
            percent(Some(after)),
            Remedy::edit("gravity")
        );
        AuditFinding::suspicion(GRAVITY, vec!["base".to_owned()], says, file, note)
    })
}
