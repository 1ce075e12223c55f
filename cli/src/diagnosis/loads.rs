//! What the drives carry, for kinds of effects that depend on it.

use modelmill_codegen::Evaluator;
use modelmill_identify::diagnose::{Column, factors};

use crate::along;
use crate::data::Data;
use crate::failure::Outcome;
use crate::model::Model;
use crate::standstill::drive_rates;

use super::numbers::{regressor, stack};

/// The recordings with the loads that the bodies make, for kinds that depend on them. The measured forces are no such load:
/// they hold friction already, so that a share of them with the sign of the rate explains itself. The base is fitted beside
/// friction of every drive.
pub(super) fn loads(model: &Model, fit: &[Data], check: &[Data]) -> Outcome<Vec<(Data, bool)>> {
    let mut carried: Vec<(Data, bool)> = (fit.iter().map(|one| (one.clone(), false)))
        .chain(check.iter().map(|one| (one.clone(), true)))
        .collect();
    let all: Vec<(&Data, bool)> = carried
        .iter()
        .map(|(one, is_check)| (one, *is_check))
        .collect();
    let measured = Column::new(stack(&all, |one| Ok(one.run.measured()?.to_vec()))?);
    let base = regressor(&all, &Evaluator::new(&model.derivation), model)?;
    let rates = stack(&all, |one| drive_rates(model, one))?;
    let mut friction = Vec::new();
    for (d, rate) in rates.iter().enumerate() {
        let signs: Vec<f64> = rate.iter().map(|v| v.signum()).collect();
        for values in [rate.clone(), signs, vec![1.0; rate.len()]] {
            let mut column = Column(vec![None; rates.len()]);
            column.0[d] = Some(values);
            friction.push(column);
        }
    }
    let free: Vec<usize> = (0..base.len()).filter(|k| !model.is_known(*k)).collect();
    let found = beside(&measured, &base, &free, &friction);
    let mut values = model.nominal.clone();
    for (k, value) in free.iter().zip(found) {
        values[*k] = value;
    }
    // The load is what is carried before any effect.
    for (k, value) in values.iter_mut().enumerate() {
        if model.is_effect(k) {
            *value = 0.0;
        }
    }
    for (one, _) in &mut carried {
        let evaluator = Evaluator::new(&model.derivation);
        let forces = along::columns(model, one, |states| {
            evaluator.inverse_dynamics(states, &values)
        })?;
        one.load = Some(forces);
    }
    Ok(carried)
}

/// Least squares factors of some base columns beside others.
fn beside(measured: &Column, base: &[Column], free: &[usize], others: &[Column]) -> Vec<f64> {
    let columns: Vec<&Column> = free.iter().map(|k| &base[*k]).chain(others).collect();
    factors(measured, &columns)
        .into_iter()
        .take(free.len())
        .collect()
}
