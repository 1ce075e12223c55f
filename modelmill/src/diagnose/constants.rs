//! Candidates for a wrong length or angle of the model: first and second derivatives of the base columns by
//! each constant, by central differences. Fixed base parameters follow the constant, because their values are
//! computed from it: their derivative is that of column times value.
//!
//! Decision: the forces are a polynomial of second degree in the error. A first search uses small steps; what it claims
//! is searched again with the claimed error as step, so that the polynomial is exact there. What a polynomial of small
//! steps leaves of a wrong length of 5 % looked like further wrong lengths (`lab/numpy-plant`).

use std::ops::Range;

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::diagnose::{
    CandidateEffect, CandidateNature, ColumnSource, ConstantCorrection, EffectParameter, ForceColumn, ForceSensitivity,
    LocatedEffect, SignConstraint,
};

use crate::model::Model;
use crate::regressors::{SegmentList, regressor};

use super::named_zeros::NamedZeros;
use super::payloads::reach;
use super::thresholds::CONSTANT_LEAST_EFFECT;

/// The kind of these candidates.
pub(super) const CONSTANT_ERROR: &str = "constant_error";

/// Steps of the differences: this part of the machine's size, or of a radian.
const STEP: f64 = 1e-3;

/// The error of a constant that a search claims.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ClaimedConstant {
    /// Name of the constant, or of a zero.
    pub(crate) name: String,
    /// Its error, m or rad.
    pub(crate) value: f64,
}

/// A candidate for the error of each length and angle, and of each named zero; `is_held` is true for base parameters that
/// are fixed. `claimed` are errors that an earlier search found: their steps make the polynomial exact there.
pub(crate) fn constants(
    model: &Model,
    all: &SegmentList<'_>,
    named: Option<&NamedZeros>,
    claimed: &[ClaimedConstant],
    is_held: &dyn Fn(usize) -> bool,
) -> Vec<CandidateEffect> {
    let positions: Vec<usize> = (0..model.base.len()).collect();
    let n_own = model.derivation.mechanism.constants.len();
    let mut candidates = GeometryColumns::new(model, model, &positions, is_held).candidates(all, claimed, 0..n_own);
    if let Some(named) = named {
        let n_all = named.model.derivation.mechanism.constants.len();
        let columns = GeometryColumns::new(model, &named.model, &named.positions, is_held);
        candidates.extend(columns.candidates(all, claimed, n_own..n_all));
    }
    candidates
}

/// Columns of a model as functions of its constants, for the candidates of a given model.
struct GeometryColumns<'a> {
    /// The given model.
    model: &'a Model,
    /// The model whose columns are evaluated: the given one, or that with named zeros.
    evaluated: &'a Model,
    /// For each of its base parameters, the estimated one of the given model with the same column.
    estimated: Vec<Option<usize>>,
    /// Whether the forces of parameters without an estimate that belongs to them are part of the candidates.
    has_rest: bool,
    /// Values of the constants.
    constants: Vec<f64>,
    /// Base values of the evaluated model.
    changes: BaseValueChanges,
}

impl<'a> GeometryColumns<'a> {
    /// `positions` has the base parameter of the evaluated model for each of the given one.
    fn new(model: &'a Model, evaluated: &'a Model, positions: &[usize], is_held: &dyn Fn(usize) -> bool) -> Self {
        let mut estimated = vec![None; evaluated.base.len()];
        let mut shifts = vec![0.0; evaluated.base.len()];
        let constants: Vec<f64> = evaluated
            .derivation
            .mechanism
            .constants
            .iter()
            .map(|c| c.value)
            .collect();
        let own = BaseValueChanges::new(
            model,
            &constants[..model.derivation.mechanism.constants.len()],
            Vec::new(),
        );
        for (k, at) in positions.iter().enumerate() {
            estimated[*at] = (!is_held(k)).then_some(k);
            // Values of an earlier fit replace those of the nominal parameters.
            shifts[*at] = model.values[k] - own.base[k];
        }
        Self {
            changes: BaseValueChanges::new(evaluated, &constants, shifts),
            has_rest: evaluated.base.len() > positions.len(),
            model,
            evaluated,
            estimated,
            constants,
        }
    }

    /// The columns where one constant differs by a step; `None` if the loops do not close there.
    fn columns(&self, all: &SegmentList<'_>, k: usize, step: f64) -> Option<Vec<ForceColumn>> {
        let mut moved = self.constants.clone();
        moved[k] += step;
        let evaluator = ModelEvaluator::with_constants(&self.evaluated.derivation, moved);
        regressor(all, &evaluator, self.evaluated).ok()
    }

    /// A candidate for each of some constants.
    fn candidates(
        &self,
        all: &SegmentList<'_>,
        claimed: &[ClaimedConstant],
        wanted: Range<usize>,
    ) -> Vec<CandidateEffect> {
        let mechanism = &self.evaluated.derivation.mechanism;
        // The columns at the nominal constants are the same for all of them.
        let mut middle = None;
        let mut candidates = Vec::new();
        for k in wanted {
            let constant = &mechanism.constants[k];
            // Other units, such as those of counts, are no geometry.
            let step = match constant.unit.as_str() {
                "m" => STEP * reach(mechanism),
                "rad" => STEP,
                _ => continue,
            };
            // With another length the loops may not close along the recordings.
            let sides = |step: f64| self.columns(all, k, -step).zip(self.columns(all, k, step));
            let claim = claimed.iter().find(|claim| claim.name == constant.name);
            let exact = claim.map(|claim| claim.value.abs()).filter(|value| *value > step);
            let exact = exact.and_then(|value| Some((value, sides(value)?)));
            let Some((step, (back, ahead))) = exact.or_else(|| Some((step, sides(step)?))) else {
                continue;
            };
            if middle.is_none() {
                middle = self.columns(all, k, 0.0);
            }
            let Some(middle) = &middle else { continue };
            let Some(correction) = self.correction(k, step, [&back, middle, &ahead]) else {
                continue;
            };
            // A constant without effect on any force is no candidate.
            let slope = &correction.first_derivative;
            if slope.fixed.is_zero() && slope.base.iter().all(ForceColumn::is_zero) {
                continue;
            }
            candidates.push(candidate(&constant.name, &constant.unit, correction));
        }
        candidates
    }

    /// First and second derivative of the columns by a constant, from those at both sides and in the middle. `None` if
    /// base values do not exist there.
    fn correction(&self, k: usize, step: f64, columns: [&[ForceColumn]; 3]) -> Option<ConstantCorrection> {
        let n_drives = self.model.row_names().len();
        let values = [-step, 0.0, step].map(|step| self.changes.values(self.evaluated, k, step));
        let needs_values = self.has_rest || self.estimated.iter().any(Option::is_none);
        if needs_values && values.iter().flatten().any(|x| !x.is_finite()) {
            return None;
        }
        // The central first and second difference.
        let weights = [
            [-0.5 / step, 0.0, 0.5 / step],
            [1.0 / (step * step), -2.0 / (step * step), 1.0 / (step * step)],
        ];
        let [first_derivative, second_derivative] = weights.map(|weights| {
            let mut part = ForceSensitivity {
                base: vec![ForceColumn(vec![None; n_drives]); self.model.base.len()],
                fixed: ForceColumn(vec![None; n_drives]),
            };
            let difference = |p: usize, factors: [f64; 3]| {
                let mut sum = ForceColumn(vec![None; n_drives]);
                for i in (0..3).filter(|i| weights[*i] != 0.0) {
                    sum.add(weights[i] * factors[i], &columns[i][p]);
                }
                without_rounding(sum)
            };
            // Estimated base parameters get the change of their column, fixed ones that of their force.
            for (p, estimated) in self.estimated.iter().enumerate() {
                if let Some(k) = estimated {
                    part.base[*k] = difference(p, [1.0; 3]);
                }
                // The values of all others follow the constant. With named zeros, estimated values keep what they have
                // at the nominal constants, and the change of their nominal values is a force of the others.
                if estimated.is_none() || self.has_rest {
                    let kept = if estimated.is_some() { values[1][p] } else { 0.0 };
                    let factors = [0, 1, 2].map(|i| values[i][p] - kept);
                    part.fixed.add(1.0, &difference(p, factors));
                }
            }
            // Estimated base parameters alone have columns, in their order.
            let is_estimated: Vec<bool> = (0..self.model.base.len())
                .map(|k| self.estimated.contains(&Some(k)))
                .collect();
            let mut is_estimated = is_estimated.into_iter();
            part.base.retain(|_| is_estimated.next().unwrap_or(false));
            part
        });
        Some(ConstantCorrection {
            first_derivative,
            second_derivative,
        })
    }
}

/// The candidate for the error of a constant.
fn candidate(name: &str, unit: &str, correction: ConstantCorrection) -> CandidateEffect {
    CandidateEffect {
        effect: LocatedEffect {
            kind: CONSTANT_ERROR.to_owned(),
            at: vec![name.to_owned()],
        },
        parameters: vec![EffectParameter {
            symbol: "error".to_owned(),
            unit: unit.to_owned(),
            sign: SignConstraint::Any,
        }],
        searched_constants: 0,
        is_part_of_load: true,
        refines: None,
        nature: CandidateNature::Effect,
        is_per_run: false,
        source: ColumnSource::Constant(correction),
    }
}

/// Base parameters as functions of the constants: masses, centres and inertias keep their nominal values.
struct BaseValueChanges {
    /// Nominal values of the dynamic parameters.
    parameters: Vec<f64>,
    /// The constants of the model file.
    constants: Vec<f64>,
    /// Base parameters for both.
    base: Vec<f64>,
    /// What is added to them.
    shifts: Vec<f64>,
}

impl BaseValueChanges {
    /// The base parameters at the constants of the model file.
    fn new(model: &Model, constants: &[f64], shifts: Vec<f64>) -> Self {
        let derivation = &model.derivation;
        let parameters: Vec<f64> = derivation.mechanism.parameters.iter().map(|p| p.nominal).collect();
        Self {
            base: derivation.base_values(&parameters, constants),
            constants: constants.to_vec(),
            parameters,
            shifts,
        }
    }

    /// The base parameters where one constant differs by a step.
    fn values(&self, model: &Model, constant: usize, step: f64) -> Vec<f64> {
        let mut moved = self.constants.clone();
        moved[constant] += step;
        let there = model.derivation.base_values(&self.parameters, &moved);
        there
            .iter()
            .zip(&self.shifts)
            .map(|(there, shift)| there + shift)
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
