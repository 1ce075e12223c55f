//! Rods along linear drives: the generalised forces of a slender rod that rotates about the first point of the drive
//! and slides through the second one.
//!
//! Let `a` be the first point, `u` the unit vector along the drive and `g` gravity. A mass element at the distance `s`
//! has the position `a + s u`. D'Alembert's principle, summed over the elements, gives `du'(Jr u'' + Sr (a'' - g)) +
//! da'(Sr u'' + mr (a'' - g))`, with the second moment `Jr`, the first moment `Sr` and the mass `mr` of the rod.

use modelmill_spec::{DriveIdx, DriveKind, EffectPlace, Mechanism, ModelEffect, PointIdx};

use crate::DeriveError;
use crate::expr::vector::SymbolicVector;
use crate::expr::{Atom, ExprId, Graph};
use crate::loops::segment::position_in_base;
use crate::regressor::projection::LoopProjection;
use crate::tree::KinematicTree;

/// The linear drives of an effect, with their points. The model file is checked for other places; a mechanism built by
/// a program has no rod there.
fn drive_lines(mechanism: &Mechanism, effect: &ModelEffect) -> Vec<(DriveIdx, [PointIdx; 2])> {
    let line = |place: &EffectPlace| match place {
        EffectPlace::Drive(d) => match mechanism.drives[d.0].kind {
            DriveKind::Linear { from, to } => Some((*d, [from, to])),
            DriveKind::Joint(_) => None,
        },
        _ => None,
    };
    effect.places.iter().filter_map(line).collect()
}

/// Generalised forces `[drive][t][c]` of the rod along each drive, for `Jr`, `Sr` and `mr` of one each, on coordinate
/// c.
pub(super) fn generalised_forces(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &KinematicTree,
    projection: &LoopProjection,
    gravity: &SymbolicVector,
    effect: &ModelEffect,
) -> Result<Vec<Vec<Vec<ExprId>>>, DeriveError> {
    let n = mechanism.coordinates.len();
    let mut all = Vec::new();
    for (drive, [from, to]) in drive_lines(mechanism, effect) {
        // Both points in the axes of the base.
        let a = position_in_base(graph, mechanism, tree, from.0)?;
        let end = position_in_base(graph, mechanism, tree, to.0)?;
        let length = projection.drives[drive.0].coordinate;
        all.push(forces_along_rod(graph, [a, end], length, gravity, n));
    }
    Ok(all)
}

/// Generalised forces on `n` coordinates of a rod from `a` to `end`, for `Jr`, `Sr` and `mr` of one each.
fn forces_along_rod(
    graph: &mut Graph,
    [a, end]: [SymbolicVector; 2],
    length: ExprId,
    gravity: &SymbolicVector,
    n: usize,
) -> Vec<Vec<ExprId>> {
    // The vector along the rod, and its inverse lengths.
    let d: SymbolicVector = std::array::from_fn(|i| graph.sub(end[i], a[i]));
    let per_length = graph.pow(length, -1);
    let per_square = graph.pow(length, -2);

    let derivative = |graph: &mut Graph, v: &SymbolicVector| -> SymbolicVector {
        let of = graph.time_derivative(v);
        [of[0], of[1], of[2]]
    };
    // First and second time derivative.
    let d1 = derivative(graph, &d);
    let d2 = derivative(graph, &d1);
    // `across` is l u' and `turning` is l u''; neither contains a root.
    let along = graph.dot(&d, &d1);
    let stretch = graph.mul(along, per_square);
    let slide = graph.scale_vector(stretch, &d);
    let across: SymbolicVector = std::array::from_fn(|i| graph.sub(d1[i], slide[i]));
    let swing = graph.dot(&across, &across);
    let pull = graph.dot(&d, &d2);
    let pull = graph.add(pull, swing);
    let pull = graph.mul(pull, per_square);
    let inward = graph.scale_vector(pull, &d);
    let twice = graph.add(stretch, stretch);
    let sideways = graph.scale_vector(twice, &across);
    let turning: SymbolicVector = std::array::from_fn(|i| {
        let rest = graph.sub(d2[i], inward[i]);
        graph.sub(rest, sideways[i])
    });
    // `centripetal` is u' . u'.
    let centripetal = graph.mul(swing, per_square);

    // Acceleration of the first point minus gravity.
    let pivot_speed = derivative(graph, &a);
    let pivot = derivative(graph, &pivot_speed);
    let lifted: SymbolicVector = std::array::from_fn(|i| graph.sub(pivot[i], gravity[i]));
    let lifted_along = graph.dot(&d, &lifted);
    let lifted_along = graph.mul(lifted_along, per_square);

    let mut forces = vec![Vec::new(); 3];
    for coordinate in 0..n {
        let by = |graph: &mut Graph, v: &SymbolicVector| -> SymbolicVector {
            let slopes = graph.differentiate(v, Atom::Coordinate(coordinate));
            [slopes[0], slopes[1], slopes[2]]
        };
        let (by_d, by_a) = (by(graph, &d), by(graph, &a));
        // l dl/dq
        let radial = graph.dot(&by_d, &d);
        // Coefficients of the second moment, the first moment and the mass.
        // du' u''
        let second = {
            let turned = graph.dot(&by_d, &turning);
            let inward = graph.mul(radial, centripetal);
            let moment = graph.add(turned, inward);
            graph.mul(moment, per_square)
        };
        // du'(a'' - g) + da' u''
        let first = {
            let carried = graph.dot(&by_d, &lifted);
            let inward = graph.mul(radial, lifted_along);
            let carried = graph.sub(carried, inward);
            let reaction = graph.dot(&by_a, &turning);
            let force = graph.add(carried, reaction);
            graph.mul(force, per_length)
        };
        // da'(a'' - g)
        let mass = graph.dot(&by_a, &lifted);
        for (column, force) in forces.iter_mut().zip([second, first, mass]) {
            column.push(force);
        }
    }
    forces
}

/// Forces at both ends of the rod along each drive, N.
pub(super) fn point_forces(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &KinematicTree,
    projection: &LoopProjection,
    gravity: &SymbolicVector,
    effect: &ModelEffect,
    moments: &[ExprId],
) -> Result<Vec<(PointIdx, SymbolicVector)>, DeriveError> {
    let mut all = Vec::new();
    for (drive, points) in drive_lines(mechanism, effect) {
        let length = projection.drives[drive.0].coordinate;
        let [a, b] = points.map(|point| position_in_base(graph, mechanism, tree, point.0));
        let forces = end_forces(graph, [a?, b?], length, gravity, moments);
        all.extend(points.into_iter().zip(forces));
    }
    Ok(all)
}

/// Forces at the two ends of a rod, in the axes of the base, for its second moment, first moment and mass.
///
/// The balance of moments about the first point gives the force at the second one, which is perpendicular to the rod
/// because the rod slides there. All other forces act at the first point.
fn end_forces(
    graph: &mut Graph,
    [a, b]: [SymbolicVector; 2],
    length: ExprId,
    gravity: &SymbolicVector,
    moments: &[ExprId],
) -> [SymbolicVector; 2] {
    let [second, first, mass] = [0, 1, 2].map(|k| moments.get(k).copied().unwrap_or(Graph::ZERO));
    let per_length = graph.pow(length, -1);
    let twice_derived = |graph: &mut Graph, v: &SymbolicVector| -> SymbolicVector {
        let once = graph.time_derivative(v);
        let twice = graph.time_derivative(&once);
        [twice[0], twice[1], twice[2]]
    };
    let d = graph.sub_vectors(&b, &a);
    let u = graph.scale_vector(per_length, &d);
    // u'' and the acceleration of the first point.
    let turning = twice_derived(graph, &u);
    let pivot = twice_derived(graph, &a);
    let lifted = graph.sub_vectors(&pivot, gravity);
    let sum = |graph: &mut Graph, [x, y]: [ExprId; 2]| {
        let x = graph.scale_vector(x, &turning);
        let y = graph.scale_vector(y, &lifted);
        graph.add_vectors(&[x, y])
    };
    // Weight and inertia times distance, without the part along the rod.
    let swung = sum(graph, [second, first]);
    let along = graph.dot(&u, &swung);
    let along = graph.scale_vector(along, &u);
    // The part perpendicular to the rod.
    let square = graph.sub_vectors(&swung, &along);
    let at_second = graph.scale_vector(per_length, &square);
    // The balance of forces of the rod.
    let total = sum(graph, [first, mass]);
    [graph.sub_vectors(&total, &at_second), at_second]
}
