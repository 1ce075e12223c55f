//! Gravity that pulls the other way: a machine that hangs where its model stands, or the sign of `gravity` in the model file.
//!
//! Decision: no second derivation is needed. The columns at standstill are those of gravity, and they change their
//! sign.

use modelmill_boundary::message;
use modelmill_boundary::text::Remedy;
use modelmill_identify::ForceAudit;
use nalgebra::DVector;

use super::rows::Rows;
use super::{BETTER, Finding, GRAVITY};
use crate::model::Model;
use crate::stretch::Stretch;
use crate::text::table::percent;

/// Relative errors, friction and offsets of the drives taken off, below which nothing is wrong with gravity.
const BEARABLE: f64 = 0.01;

/// Says so where gravity the other way explains the forces far better.
pub(super) fn upside_down(
    model: &Model,
    data: &Stretch,
    samples: &[usize],
    measured: &DVector<f64>,
) -> Option<Finding> {
    if model.gravity().iter().all(|g| *g == 0.0) {
        return None;
    }
    let error = |regressor| ForceAudit::new(regressor)?.error(measured);
    let before = error(Rows::new(model, data, samples)?.regressor)?;
    if before < BEARABLE {
        return None;
    }
    let after = error(Rows::upside_down(model, data, samples)?)?;
    (after < BETTER * before).then(|| {
        let says = "gravity seems to pull the other way".to_owned();
        let file = &data.run.file;
        let note = message!(
            "In {file} {says}: the best fit of the model with friction and offsets of its drives is off by {} as it is, and \
             would be off by {} then. Check {}, and which way up the machine is mounted; something \
             that more than balances its weight looks alike.",
            percent(Some(before)),
            percent(Some(after)),
            Remedy::edit("gravity")
        );
        Finding::suspicion(GRAVITY, vec!["base".to_owned()], says, file, note)
    })
}
