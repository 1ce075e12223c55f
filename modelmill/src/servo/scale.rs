//! What can be known of `H p - S k = 0`: the exact base parameters, and the directions that data of the true machine
//! leave open.
//!
//! The exact reduction finds columns that are dependent for all states. Data of the true machine obey one more law,
//! the equation itself, so that every multiple of the true parameters fits as well. Each group of drives that share no
//! parameter has a multiple of its own. Groups are found as the null space of the equations at random states, with
//! signals that obey them for random parameters: what holds there holds for almost all parameters (Schwartz-Zippel).

use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_runtime::RandomBits;
use modelmill_spec::ServoForce;
use nalgebra::DMatrix;

use super::thresholds::{NULL_ENTRY, NULL_SHARE, SCALE_ROWS_PER_COLUMN};
use crate::error::{Error, Outcome};
use crate::model::{Model, reachable_states};

/// The base parameters that the signals of a model with actuators do not determine completely.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoScale {
    /// Groups of base parameters of which only ratios can be identified; empty if all values can be identified.
    pub freedoms: Vec<ScaleFreedom>,
}

/// A group of base parameters of which only ratios can be known.
#[derive(Clone, Debug, PartialEq)]
pub struct ScaleFreedom {
    /// Indices of the base parameters of the group.
    pub base: Vec<usize>,
    /// How many values must be known so that all values of the group can be identified; 1 if only its scale is unknown.
    pub open: usize,
    /// Names of parameters: if the value of one of them is known, it determines the scale.
    pub fixed_by: Vec<String>,
    /// The base parameter relative to which all others of the group are reported: a gain if there is one.
    pub reference: usize,
}

impl ServoScale {
    /// Analyses the equations of a model with actuators.
    ///
    /// Fails when random states of the mechanism cannot be evaluated.
    pub(super) fn new(model: &Model) -> Outcome<Self> {
        let unknown: Vec<usize> = (0..model.base.len()).filter(|k| !model.is_known(*k)).collect();
        if unknown.is_empty() {
            return Ok(Self { freedoms: Vec::new() });
        }
        let failed =
            |reason: String| Error::input(format!("{}: what can be known was not found: {reason}", model.path));
        let rows = consistent_rows(model, unknown.len()).map_err(failed)?;
        let null = null_space(&rows, &unknown).map_err(failed)?;
        Ok(Self {
            freedoms: groups(&null, &unknown)
                .into_iter()
                .map(|group| freedom(model, group))
                .collect(),
        })
    }

    /// Whether only the ratio of a base parameter to others can be known.
    pub fn is_open(&self, base: usize) -> bool {
        self.freedoms.iter().any(|freedom| freedom.base.contains(&base))
    }
}

/// Regressor rows of the drives with actuators at random states whose signals obey the equations for random parameters,
/// and rows of drives with measured forces.
fn consistent_rows(model: &Model, n_unknown: usize) -> Result<DMatrix<f64>, String> {
    let mechanism = &model.derivation.mechanism;
    let n_drives = mechanism.drives.len();
    let wanted = SCALE_ROWS_PER_COLUMN * (n_unknown + 4);
    let mut columns = reachable_states(model, wanted)?;
    let evaluator = ModelEvaluator::new(&model.derivation);
    let mut random = RandomBits::new(0x7365_7276);
    // Known base parameters are 1 times numbers of the file; all others are random and not zero.
    let values: Vec<f64> = (0..model.base.len())
        .map(|k| {
            if model.is_known(k) {
                model.values[k]
            } else {
                0.5 + random.below_one()
            }
        })
        .collect();
    let active: Vec<usize> = (0..mechanism.coordinates.len())
        .filter(|i| !mechanism.coordinates[*i].passive)
        .collect();
    // The first signal of each drive follows from its equation; further ones are free, such as a feed-forward force.
    let is_first = |k: usize| {
        let drive = mechanism.servo_forces[k].drive;
        mechanism.servo_forces[..k].iter().all(|force| force.drive != drive)
    };
    let first: Vec<&ServoForce> = (0..mechanism.servo_forces.len())
        .filter(|k| is_first(*k))
        .map(|k| &mechanism.servo_forces[k])
        .collect();
    // Every row is affine in its signal, so that two evaluations give the signal that obeys the equation.
    let evaluate = |at: Option<f64>, columns: &mut [Vec<Vec<f64>>; 4]| {
        for servo in &first {
            let signal = active.iter().position(|i| *i == servo.signal.0).unwrap_or(0);
            if let Some(at) = at {
                columns[0][signal].fill(at);
            }
        }
        let slices = |k: usize| columns[k].iter().map(Vec::as_slice).collect();
        let states = MotionStates {
            q: slices(0),
            qd: slices(1),
            qdd: slices(2),
            load: slices(3),
        };
        evaluator.regressor(&states).map_err(|fault| fault.to_string())
    };
    let zero = evaluate(Some(0.0), &mut columns)?;
    let one = evaluate(Some(1.0), &mut columns)?;
    for servo in &first {
        let signal = active.iter().position(|i| *i == servo.signal.0).unwrap_or(0);
        for sample in 0..wanted {
            let row = sample * n_drives + servo.drive.0;
            let sum = |of: &DMatrix<f64>| values.iter().enumerate().map(|(k, p)| p * of[(row, k)]).sum::<f64>();
            let slope = sum(&one) - sum(&zero);
            if slope == 0.0 {
                return Err(format!(
                    "the signal of `{}` has no effect",
                    mechanism.drives[servo.drive.0].name
                ));
            }
            columns[0][signal][sample] = -sum(&zero) / slope;
        }
    }
    let all = evaluate(None, &mut columns)?;
    // Rows of coordinates that nothing drives hold only along motions that obey them, which these states do not.
    let is_used = |d: &usize| mechanism.is_servo_row(*d) || mechanism.drives[*d].is_driven;
    let used: Vec<usize> = (0..n_drives).filter(is_used).collect();
    let rows: Vec<usize> = (0..wanted)
        .flat_map(|s| used.iter().map(move |d| s * n_drives + d))
        .collect();
    Ok(all.select_rows(&rows))
}

/// An orthonormal basis of the directions of the unknown parameters without effect, one per column; columns of the
/// equations are scaled first, which changes no zero.
fn null_space(rows: &DMatrix<f64>, unknown: &[usize]) -> Result<DMatrix<f64>, String> {
    let n = unknown.len();
    let mut scaled = rows.select_columns(unknown);
    for mut column in scaled.column_iter_mut() {
        let norm = column.norm();
        if norm > 0.0 {
            column /= norm;
        }
    }
    let svd = scaled
        .try_svd(false, true, f64::EPSILON, 10_000)
        .ok_or("the singular values do not converge")?;
    let directions = svd.v_t.ok_or("the singular vectors do not converge")?;
    let largest = svd.singular_values.max();
    let open: Vec<usize> = (0..n)
        .filter(|i| svd.singular_values[*i] <= NULL_SHARE * largest)
        .collect();
    Ok(DMatrix::from_fn(n, open.len(), |k, i| directions[(open[i], k)]))
}

/// Groups of parameters that change together, each with the number of directions in it. Two parameters change together
/// if the projection on the open directions couples them.
fn groups(null: &DMatrix<f64>, unknown: &[usize]) -> Vec<(Vec<usize>, usize)> {
    let projector = null * null.transpose();
    let largest = projector.diagonal().iter().fold(0.0_f64, |most, x| most.max(*x));
    let is_coupled = |i: usize, j: usize| projector[(i, j)].abs() > NULL_ENTRY * largest;
    let mut group: Vec<Option<usize>> = vec![None; unknown.len()];
    let mut n_groups = 0;
    for first in 0..unknown.len() {
        if group[first].is_some() || !is_coupled(first, first) {
            continue;
        }
        let mut open = vec![first];
        while let Some(i) = open.pop() {
            if group[i].is_none() {
                group[i] = Some(n_groups);
                open.extend((0..unknown.len()).filter(|j| group[*j].is_none() && is_coupled(i, *j)));
            }
        }
        n_groups += 1;
    }
    (0..n_groups)
        .map(|g| {
            let members: Vec<usize> = (0..unknown.len()).filter(|i| group[*i] == Some(g)).collect();
            // As many directions are open as the rows of the group span.
            let open = null.select_rows(&members).rank(NULL_ENTRY);
            (members.into_iter().map(|i| unknown[i]).collect(), open)
        })
        .collect()
}

/// A group with the parameters that fix it.
fn freedom(model: &Model, (base, open): (Vec<usize>, usize)) -> ScaleFreedom {
    let mechanism = &model.derivation.mechanism;
    let servo = mechanism.servo_forces.iter().flat_map(|force| &force.terms);
    let gains: Vec<usize> = servo.flat_map(|term| &term.parameters).map(|(p, _)| p.0).collect();
    let effects = mechanism.effects.iter().flat_map(|effect| &effect.terms);
    let of_effects: Vec<usize> = effects.map(|term| term.parameter.0).collect();
    // A base parameter that is one parameter to the first power is fixed by that number.
    let single = |k: usize| match model.products_of(k).as_slice() {
        [(product, _)] => match product.0.as_slice() {
            [(p, 1)] => Some(*p),
            _ => None,
        },
        _ => None,
    };
    let is_gain = |k: &usize| single(*k).is_some_and(|p| gains.contains(&p));
    let has_gain = |k: &usize| {
        let products = model.products_of(*k);
        products
            .iter()
            .any(|(product, _)| product.0.iter().any(|(p, _)| gains.contains(p)))
    };
    let reference = base
        .iter()
        .find(|k| is_gain(k))
        .or_else(|| base.iter().find(|k| has_gain(k)));
    // The numbers of effects cannot be written into a model file.
    let fixed_by = base
        .iter()
        .filter_map(|k| single(*k))
        .filter(|p| !of_effects.contains(p) || gains.contains(p));
    ScaleFreedom {
        reference: reference.or(base.first()).copied().unwrap_or(0),
        open,
        fixed_by: fixed_by.map(|p| mechanism.parameters[p].name.clone()).collect(),
        base,
    }
}
