//! A tilt of the base about the axis of a joint on the base is the same as a wrong zero of the joint's encoder: the zero
//! becomes an alternative of a tilt that was found. The search compares both at first order only, where an error of some
//! degrees differs from a tilt.

use modelmill_identify::diagnose::{
    CandidateEffect, ColumnSource, ForceColumn, IdentifiedEffect, LocatedEffect, TiltCandidate,
};
use nalgebra::{DMatrix, DVector};

use super::encoders::ENCODER_ZERO;
use super::thresholds::{TILT_AXIS_MOST_DEVIATIONS, ZERO_AS_TILT_MOST_DIFFERENCE};

/// A joint on the base, and the tilt that acts as its zero.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BaseJoint {
    /// The zero of its encoder.
    zero: LocatedEffect,
    /// Direction of its axis, one component for each parameter of the tilt; of length 1.
    axis: Vec<f64>,
}

/// The joints whose zero acts as a tilt of the base, among some candidates; `values` are the base parameters with which
/// the columns of the zeros were computed.
pub(super) fn base_joints(tilts: &[CandidateEffect], zeros: &[CandidateEffect], values: &[f64]) -> Vec<BaseJoint> {
    let tilt = tilts.iter().find_map(|one| match &one.source {
        ColumnSource::Tilt(tilt) => Some(tilt),
        _ => None,
    });
    let Some(tilt) = tilt else {
        return Vec::new();
    };
    let columns = tilt_columns(tilt, values);
    let zeros = zeros.iter().filter(|one| one.effect.kind == ENCODER_ZERO);
    let joint = |one: &CandidateEffect| {
        let ColumnSource::Columns(choices) = &one.source else {
            return None;
        };
        let axis = tilt_axis(&columns, choices.first()?.columns.first()?)?;
        Some(BaseJoint {
            zero: one.effect.clone(),
            axis,
        })
    };
    zeros.filter_map(joint).collect()
}

/// Change of the forces with a small tilt about each axis, for given base parameters.
fn tilt_columns(tilt: &TiltCandidate, values: &[f64]) -> Vec<ForceColumn> {
    let level = vec![0.0; tilt.axes.len()];
    let directions = tilt.directions(&level).into_iter();
    let column = |direction: [f64; 3]| {
        let channels = tilt.components[0].base.first().map_or(0, |one| one.0.len());
        let mut sum = ForceColumn(vec![None; channels]);
        for (share, component) in direction.iter().zip(&tilt.components) {
            for (value, change) in values.iter().zip(&component.base) {
                sum.add(share * value, change);
            }
        }
        sum
    };
    directions.map(column).collect()
}

/// The direction of the tilt that has the forces of a column, of length 1; `None` if no tilt has them.
fn tilt_axis(tilts: &[ForceColumn], column: &ForceColumn) -> Option<Vec<f64>> {
    let channels = column.0.len();
    let samples = column.0.iter().flatten().map(Vec::len).max()?;
    let value = |of: &ForceColumn, row: usize| {
        let channel = of.0.get(row / samples).and_then(Option::as_ref);
        channel.map_or(0.0, |values| values[row % samples])
    };
    let rows = channels * samples;
    let matrix = DMatrix::from_fn(rows, tilts.len(), |row, k| value(&tilts[k], row));
    let wanted = DVector::from_fn(rows, |row, _| value(column, row));
    let factors = (matrix.transpose() * &matrix)
        .cholesky()?
        .solve(&(matrix.transpose() * &wanted));
    let rest = (&wanted - matrix * &factors).norm();
    let length = factors.norm();
    let is_same = length > 0.0 && rest < ZERO_AS_TILT_MOST_DIFFERENCE * wanted.norm();
    is_same.then(|| (factors / length).as_slice().to_vec())
}

/// Adds the zeros of joints as alternatives to a tilt about their axes. Both are then equally likely.
pub(super) fn add_zeros_as_alternatives(effects: &mut [IdentifiedEffect], tilt: usize, joints: &[BaseJoint]) {
    for found in effects.iter_mut().filter(|found| found.candidate == tilt) {
        for joint in joints {
            let is_new = !found.indistinguishable_from.contains(&joint.zero);
            if is_new && is_about_axis(found, &joint.axis) {
                found.indistinguishable_from.push(joint.zero.clone());
                found.probability /= 1.0 + found.probability;
            }
        }
    }
}

/// Whether a tilt is about an axis within its uncertainty. A component without a standard deviation is not known.
fn is_about_axis(found: &IdentifiedEffect, axis: &[f64]) -> bool {
    let along: f64 = found.estimates.iter().zip(axis).map(|(angle, part)| angle * part).sum();
    let parts = found.estimates.iter().zip(axis).zip(&found.standard_deviations);
    let mut parts = parts.map(|((angle, part), deviation)| (angle - along * part, deviation.unwrap_or(f64::INFINITY)));
    parts.all(|(apart, deviation)| apart.abs() <= TILT_AXIS_MOST_DEVIATIONS * deviation)
}

#[cfg(test)]
mod tests {
    use modelmill_identify::diagnose::EffectSupport;

    use super::*;

    /// The forces of a wrong zero are those of a tilt about the axis of its joint, whatever its direction; other forces are
    /// those of no tilt.
    #[test]
    fn axes_of_base_joints_are_found() {
        let wave = |phase: f64| {
            let values = (0..200)
                .map(|k| (0.1 * f64::from(k) + phase).sin())
                .collect::<Vec<f64>>();
            ForceColumn(vec![Some(values.clone()), None, Some(values)])
        };
        let tilts = [wave(0.0), wave(1.2)];
        let mut zero = ForceColumn(vec![None; 3]);
        zero.add(-0.06, &tilts[0]);
        zero.add(0.08, &tilts[1]);
        let axis = tilt_axis(&tilts, &zero).expect("a tilt");
        assert!((axis[0] + 0.6).abs() < 1e-9 && (axis[1] - 0.8).abs() < 1e-9, "{axis:?}");
        // A force of one drive only.
        let mut other = zero.clone();
        other.0[2] = None;
        assert_eq!(tilt_axis(&tilts, &other), None);
    }

    /// A tilt of some degrees with its standard deviations.
    fn found_tilt(estimates: [f64; 2], deviations: [Option<f64>; 2]) -> IdentifiedEffect {
        IdentifiedEffect {
            effect: LocatedEffect {
                kind: "gravity_tilt".to_owned(),
                at: vec!["base".to_owned()],
            },
            candidate: 3,
            constants: Vec::new(),
            estimates: estimates.to_vec(),
            standard_deviations: deviations.to_vec(),
            probability: 0.9,
            support: EffectSupport {
                gain: 0.9,
                t: 10.0,
                unexplained: 0.0,
                white_residual: true,
                share: 1.0,
                has_clear_value: true,
            },
            indistinguishable_from: Vec::new(),
            shared_with: Vec::new(),
            is_measured: false,
        }
    }

    /// Only a tilt that may be about the axis of the joint has the zero as its alternative, and shares its probability.
    #[test]
    fn zeros_are_alternatives_of_tilts_about_their_axes() {
        let zero = LocatedEffect {
            kind: ENCODER_ZERO.to_owned(),
            at: vec!["q1".to_owned()],
        };
        let joint = BaseJoint {
            zero: zero.clone(),
            axis: vec![1.0, 0.0],
        };
        let about = [
            found_tilt([0.06, 0.001], [Some(0.001), Some(0.001)]),
            found_tilt([0.06, 0.02], [Some(0.001), None]),
        ];
        for mut found in about {
            add_zeros_as_alternatives(std::slice::from_mut(&mut found), 3, &[joint.clone(), joint.clone()]);
            assert_eq!(found.indistinguishable_from, std::slice::from_ref(&zero));
            assert!(found.probability < 0.5, "{}", found.probability);
        }
        let mut across = found_tilt([0.06, 0.02], [Some(0.001), Some(0.001)]);
        add_zeros_as_alternatives(std::slice::from_mut(&mut across), 3, &[joint]);
        assert_eq!(across.indistinguishable_from, []);
        assert!((across.probability - 0.9).abs() < 1e-12, "{}", across.probability);
    }
}
