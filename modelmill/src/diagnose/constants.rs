//! Candidates for a wrong length or angle of the model: first and second derivatives of the base columns by
//! each constant, by central differences. Fixed base parameters follow the constant, because their values are
//! computed from it: their derivative is that of column times value.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::diagnose::{
    CandidateEffect, CandidateNature, ColumnSource, ConstantCorrection, EffectParameter, ForceColumn, ForceSensitivity,
    LocatedEffect, SignConstraint,
};

use crate::model::Model;
use crate::regressors::{SegmentList, regressor};

use super::payloads::reach;
use super::thresholds::CONSTANT_LEAST_EFFECT;

/// Steps of the differences: this part of the machine's size, or of a radian.
const STEP: f64 = 1e-3;

/// A candidate for the error of each length and angle; `is_held` is true for base parameters that are fixed.
pub(crate) fn constants(model: &Model, all: &SegmentList<'_>, is_held: &dyn Fn(usize) -> bool) -> Vec<CandidateEffect> {
    let derivation = &model.derivation;
    let mechanism = &derivation.mechanism;
    // The columns for a constant that differs by a step.
    let usual: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
    let changes = BaseValueChanges::new(model, &usual);
    let along = |k: usize, step: f64| {
        let mut moved = usual.clone();
        moved[k] += step;
        regressor(all, &ModelEvaluator::with_constants(derivation, moved), model)
    };
    // The columns at the nominal constants are the same for all of them.
    let mut middle = None;
    let mut candidates = Vec::new();
    for (k, constant) in mechanism.constants.iter().enumerate() {
        // Other units, such as those of counts, are no geometry.
        let step = match constant.unit.as_str() {
            "m" => STEP * reach(mechanism),
            "rad" => STEP,
            _ => continue,
        };
        // With another length the loops may not close along the recordings.
        let (Ok(back), Ok(ahead)) = (along(k, -step), along(k, step)) else {
            continue;
        };
        if middle.is_none() {
            middle = along(k, 0.0).ok();
        }
        let Some(middle) = &middle else { continue };
        // First and second derivative; fixed base parameters are summed with the values that belong to the constant.
        let [values_back, values_ahead] = [-step, step].map(|step| changes.values(model, k, step));
        let [mut slope, mut bend] = [(); 2].map(|()| ForceSensitivity {
            base: Vec::new(),
            fixed: ForceColumn(vec![None; model.drives().len()]),
        });
        for (p, middle) in middle.iter().enumerate() {
            let sum = |parts: [(f64, &ForceColumn); 3]| {
                let mut sum = ForceColumn(vec![None; model.drives().len()]);
                for (factor, part) in parts.into_iter().filter(|(factor, _)| *factor != 0.0) {
                    sum.add(factor, part);
                }
                without_rounding(sum)
            };
            // Estimated base parameters get the change of their column, fixed ones that of their force.
            let [at_back, at_middle, at_ahead] = if is_held(p) {
                [values_back[p], model.nominal[p], values_ahead[p]]
            } else {
                [1.0; 3]
            };
            // The central first and second difference.
            let (first, second) = (0.5 / step, 1.0 / (step * step));
            let first = sum([
                (first * at_ahead, &ahead[p]),
                (0.0, middle),
                (-first * at_back, &back[p]),
            ]);
            let second = sum([
                (second * at_ahead, &ahead[p]),
                (-2.0 * second * at_middle, middle),
                (second * at_back, &back[p]),
            ]);
            for (part, change) in [(&mut slope, first), (&mut bend, second)] {
                if is_held(p) {
                    part.fixed.add(1.0, &change);
                } else {
                    part.base.push(change);
                }
            }
        }
        // A constant without effect on any force is no candidate.
        if slope.fixed.is_zero() && slope.base.iter().all(ForceColumn::is_zero) {
            continue;
        }
        candidates.push(CandidateEffect {
            effect: LocatedEffect {
                kind: "constant_error".to_owned(),
                at: vec![constant.name.clone()],
            },
            parameters: vec![EffectParameter {
                symbol: "error".to_owned(),
                unit: constant.unit.clone(),
                sign: SignConstraint::Any,
            }],
            searched_constants: 0,
            is_part_of_load: true,
            refines: None,
            nature: CandidateNature::Effect,
            is_per_run: false,
            source: ColumnSource::Constant(ConstantCorrection {
                first_derivative: slope,
                second_derivative: bend,
            }),
        });
    }
    candidates
}

/// Base parameters as functions of the constants: masses, centres and inertias keep their nominal values.
struct BaseValueChanges {
    /// Nominal values of the dynamic parameters.
    parameters: Vec<f64>,
    /// The constants of the model file.
    constants: Vec<f64>,
    /// Base parameters for both.
    base: Vec<f64>,
}

impl BaseValueChanges {
    /// The base parameters at the constants of the model file.
    fn new(model: &Model, constants: &[f64]) -> Self {
        let derivation = &model.derivation;
        let parameters: Vec<f64> = derivation.mechanism.parameters.iter().map(|p| p.nominal).collect();
        Self {
            base: derivation.base_values(&parameters, constants),
            constants: constants.to_vec(),
            parameters,
        }
    }

    /// The values of the model, which may be identified ones, with the change that belongs to a step of one constant.
    fn values(&self, model: &Model, constant: usize, step: f64) -> Vec<f64> {
        let mut moved = self.constants.clone();
        moved[constant] += step;
        let there = model.derivation.base_values(&self.parameters, &moved);
        let changes = there.iter().zip(&self.base).map(|(there, here)| there - here);
        model
            .nominal
            .iter()
            .zip(changes)
            .map(|(value, change)| value + change)
            .collect()
    }
}

/// The column without channels that are rounding only.
fn without_rounding(mut column: ForceColumn) -> ForceColumn {
    for slot in &mut column.0 {
        let most = slot.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
        if most < CONSTANT_LEAST_EFFECT {
            *slot = None;
        }
    }
    column
}
