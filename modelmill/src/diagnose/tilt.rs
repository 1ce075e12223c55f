//! Change of the forces with gravity along each axis of the base, for a base that may be tilted.

use modelmill_codegen::{Derivation, ModelEvaluator, ParameterMonomial};
use modelmill_identify::diagnose::{ForceColumn, ForceSensitivity, TiltCandidate};
use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::error::Outcome;
use crate::model::Model;

use super::thresholds::TILT_LEAST_EFFECT;
use crate::regressors::{SegmentList, regressor};

/// Constants of a tilt, about x, y and z.
pub(crate) const TILTS: [&str; 3] = ["tx", "ty", "tz"];

/// Derivative of each base column, and of the forces of all other nominal parameters, by gravity along each axis of the
/// base (per m/s^2), and the axes about which a tilt has an effect. Forces are linear in gravity, so two evaluations for each axis, with gravity in both
/// directions, are exact.
///
/// Fails when a pose has no solution.
pub(crate) fn tilt(derivation: &Derivation, model: &Model, all: &SegmentList<'_>) -> Outcome<TiltCandidate> {
    let mechanism = &derivation.mechanism;
    let usual: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
    let gravity = model.gravity();
    let size = gravity.iter().map(|g| g * g).sum::<f64>().sqrt();
    let mut tilt = TiltCandidate {
        gravity,
        axes: Vec::new(),
        components: std::array::from_fn(|_| ForceSensitivity::default()),
    };
    // Without gravity a tilt has no effect.
    if size == 0.0 {
        return Ok(tilt);
    }
    let own = &model.derivation.reduction;
    let parameters = &model.derivation.mechanism.parameters;
    let nominal: Vec<f64> = parameters.iter().map(|p| p.nominal).collect();
    let constants = &model.derivation.mechanism.constants;
    let constants: Vec<f64> = constants.iter().map(|c| c.value).collect();
    let level = model.derivation.base_values(&nominal, &constants);
    for (axis, component) in tilt.components.iter_mut().enumerate() {
        // The base is turned so that gravity points along the axis, in either direction.
        let along = |sign: f64| {
            let mut constants = usual.clone();
            let angles = angles_to(gravity.map(|g| sign * g / size), axis);
            for (symbol, angle) in TILTS.iter().zip(angles) {
                let name = format!("candidate_{symbol}");
                if let Some(at) = mechanism.constants.iter().position(|c| c.name == name) {
                    constants[at] = angle;
                }
            }
            regressor(all, &ModelEvaluator::with_constants(derivation, constants), model)
        };
        // Half the difference of both directions is the part that changes with gravity.
        let [before, after] = [along(-1.0)?, along(1.0)?];
        // The difference of both directions, per unit of gravity.
        let changes: Vec<ForceColumn> = (after.iter().zip(&before))
            .map(|(after, before)| {
                let mut change = ForceColumn(vec![None; model.row_names().len()]);
                change.add(0.5 / size, after);
                change.add(-0.5 / size, before);
                change
            })
            .collect();
        let products = &derivation.reduction.products;
        let change_of = |product: &ParameterMonomial| changes.iter().zip(products).find(|(_, other)| *other == product);
        // What the parameters have in addition to the base: those that act on no drive while the base is level, such as
        // the first moments of a link on a vertical axis, and dependencies that hold for level gravity only.
        component.fixed = ForceColumn(vec![None; model.row_names().len()]);
        for (change, product) in changes.iter().zip(products) {
            component.fixed.add(product.value(&nominal), change);
        }
        // The base columns in the order of the model.
        for (retained, value) in own.retained.iter().zip(&level) {
            let change = change_of(&own.products[*retained]);
            let none = ForceColumn(vec![None; model.row_names().len()]);
            let change = change.map_or(none, |(change, _)| change.clone());
            component.fixed.add(-value, &change);
            component.base.push(change);
        }
    }
    // Only axes about which a tilt changes the forces are tried.
    let every = TiltCandidate {
        axes: vec![0, 1, 2],
        ..tilt.clone()
    };
    for (axis, direction) in every.directions(&[0.0; 3]).into_iter().enumerate() {
        let changes_forces = |part: &dyn Fn(&ForceSensitivity) -> ForceColumn| {
            let mut change = ForceColumn(vec![None; model.row_names().len()]);
            for (share, component) in direction.iter().zip(&tilt.components) {
                change.add(*share, &part(component));
            }
            let values = change.0.iter().flatten().flatten();
            values.fold(0.0_f64, |m, x| m.max(x.abs())) > TILT_LEAST_EFFECT
        };
        let has_effect = changes_forces(&|one| one.fixed.clone())
            || (0..own.retained.len()).any(|k| changes_forces(&|one| one.base[k].clone()));
        if has_effect {
            tilt.axes.push(axis);
        }
    }
    Ok(tilt)
}

/// Angles of a base, about x, y and z, in which a direction lies along an axis: a column of Rz Ry Rx is the direction.
fn angles_to(direction: [f64; 3], axis: usize) -> [f64; 3] {
    let along = Vector3::from(direction);
    // Any vector that is not along it completes the frame.
    let other = Vector3::ith(along.iamin(), 1.0);
    let next = along.cross(&other).normalize();
    // The three vectors are the columns of a rotation.
    let mut turn = Matrix3::zeros();
    turn.set_column(axis, &along);
    turn.set_column((axis + 1) % 3, &next);
    turn.set_column((axis + 2) % 3, &along.cross(&next));
    let (x, y, z) = Rotation3::from_matrix_unchecked(turn).euler_angles();
    [x, y, z]
}
