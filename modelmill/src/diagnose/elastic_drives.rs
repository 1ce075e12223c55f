//! Elastic drives in place of eccentric encoders. An encoder on the motor side has the deflection of its drive, and the
//! weight of what a horizontal axis carries deflects it once per turn, as an eccentric disc does.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::diagnose::{Disturbance, LocatedEffect};
use modelmill_spec::DriveKind;

use super::gears::COMPLIANCE;
use super::model_versions::ModelVersion;
use super::thresholds::ELASTIC_LEAST_SHARE;
use crate::segment::picked_states::PickedStates;

/// Largest number of samples of a segment that are compared.
const LOOKED_AT: usize = 500;

/// An error of an encoder that an elastic drive explains equally well.
#[derive(Clone, Debug, PartialEq)]
pub struct ElasticAlternative {
    /// Name of the coordinate whose encoder seems to be eccentric.
    pub coordinate: String,
    /// The compliance of its drive.
    pub compliance: LocatedEffect,
}

/// The drives whose deflection under the weight is the error of an eccentric encoder, once per turn, that was found.
pub(super) fn elastic_alternatives(version: &ModelVersion, disturbances: &[Disturbance]) -> Vec<ElasticAlternative> {
    let eccentric = disturbances.iter().filter(|one| one.kind == "encoder_eccentricity");
    let found = eccentric.filter_map(|one| {
        let value = |name: &str| Some(one.estimates.iter().find(|value| value.name == name)?.value);
        let is_once = value("times_per_turn")?.round().abs() <= 1.0;
        let (coordinate, wave) = (one.at.first()?, [value("sine")?, value("cosine")?]);
        is_once.then(|| elastic_drive(version, coordinate, wave))?
    });
    found.collect()
}

/// The drive at a coordinate, if its weight explains a wave of the position, given by its sine and cosine.
fn elastic_drive(version: &ModelVersion, coordinate: &str, [sine, cosine]: [f64; 2]) -> Option<ElasticAlternative> {
    let model = &version.model;
    let mechanism = &model.derivation.mechanism;
    let driven = mechanism.drives.iter().filter(|drive| drive.is_driven);
    let at = |kind: &DriveKind| match kind {
        DriveKind::Joint(joint) => mechanism.coordinates[joint.0].name == coordinate,
        DriveKind::Linear { .. } => false,
    };
    let (d, drive) = driven.enumerate().find(|(_, drive)| at(&drive.kind))?;
    let i = model
        .active_coordinates()
        .into_iter()
        .position(|name| name == coordinate)?;
    // A slide has no turns.
    if !model.active_coordinate_types()[i].1 {
        return None;
    }
    // Friction does not load the gear.
    let carried: Vec<f64> = (model.values.iter().enumerate())
        .map(|(k, value)| if model.is_effect(k) { 0.0 } else { *value })
        .collect();
    let (mut weights, mut errors) = (Vec::new(), Vec::new());
    for one in &version.data {
        let n = one.run.samples();
        let samples: Vec<usize> = (0..n).step_by(n.div_ceil(LOOKED_AT).max(1)).collect();
        let mut states = PickedStates::new(&one.run, &samples);
        for motion in states.qd.iter_mut().chain(&mut states.qdd) {
            motion.fill(0.0);
        }
        let evaluator = ModelEvaluator::new(&model.derivation);
        let forces = evaluator.inverse_dynamics(&states.as_motion(), &carried).ok()?;
        weights.extend_from_slice(&forces[d]);
        errors.extend(samples.iter().map(|k| {
            let (sin, cos) = one.run.q[i][*k].sin_cos();
            sine * sin + cosine * cos
        }));
    }
    let (slope, share) = explained_share(&weights, &errors)?;
    (slope > 0.0 && share > ELASTIC_LEAST_SHARE).then(|| ElasticAlternative {
        coordinate: coordinate.to_owned(),
        compliance: LocatedEffect {
            kind: COMPLIANCE.to_owned(),
            at: vec![drive.name.clone()],
        },
    })
}

/// The slope of the line through points (x, y) by least squares, and the share of the variance of y that it explains;
/// `None` if x or y is constant.
fn explained_share(x: &[f64], y: &[f64]) -> Option<(f64, f64)> {
    let n = x.len() as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / n;
    let (x_mean, y_mean) = (mean(x), mean(y));
    let product = |a: &[f64], a_mean: f64, b: &[f64], b_mean: f64| -> f64 {
        a.iter().zip(b).map(|(a, b)| (a - a_mean) * (b - b_mean)).sum()
    };
    let (xx, yy) = (product(x, x_mean, x, x_mean), product(y, y_mean, y, y_mean));
    let xy = product(x, x_mean, y, y_mean);
    (xx > 0.0 && yy > 0.0).then(|| (xy / xx, xy * xy / (xx * yy)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_explains_the_part_of_the_variance_that_follows_it() {
        let x = [0.0, 1.0, 2.0, 3.0];
        assert_eq!(explained_share(&x, &[1.0, 3.0, 5.0, 7.0]), Some((2.0, 1.0)));
        assert_eq!(explained_share(&x, &[1.0, -1.0, -1.0, 1.0]), Some((0.0, 0.0)));
        assert_eq!(explained_share(&x, &[2.0; 4]), None);
    }
}
