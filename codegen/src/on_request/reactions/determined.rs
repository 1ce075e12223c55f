//! Which components of reactions are determined by the equations of motion.
//!
//! Forces at the cuts that do no work in any virtual motion may have any size. They are the null space of the
//! transposed Jacobian of all closure equations. A component is determined if it depends on none of them.
//!
//! Decision: all unknowns of a cut are kept as symbols first. The pin of a planar loop may transmit moments that the
//! point in the model cannot; they are unknowns too. The null space is that of the file's geometry, but lengths across
//! the plane of a loop are random, so that a length of zero hides nothing.

use modelmill_algebra::field::RandomStream;
use modelmill_spec::Mechanism;
use nalgebra::DMatrix;

use super::loads::CutLoop;
use crate::expr::{Atom, EvaluationTape, ExprId, FloatDomain, Graph};
use crate::loops::numeric_poses::{NumericLoops, uniform_symmetric};
use crate::regressor::UnreducedEquations;

/// Number of random poses.
const POSES: usize = 4;
/// Distance of these poses from the nominal one, in rad or relative to the size of the loops.
const REACH: f64 = 0.05;
/// Part of the largest value of its kind below which a value counts as zero.
const ZERO_TOLERANCE: f64 = 1e-7;

/// For every component, whether it is determined.
///
/// The null space is that of the file's geometry at poses near the nominal one. Forces across the plane of a planar
/// loop belong to it in every geometry, and so do moments that a pin there could transmit. Components that depend on
/// these are found with random lengths, so that a length of zero does not hide the dependence.
pub(super) fn determined_components(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    cuts: &[CutLoop],
    components: &[ExprId],
) -> Vec<bool> {
    let mut determined = vec![true; components.len()];
    let unknowns: Vec<Atom> = cuts.iter().flat_map(|cut| cut.force).collect();
    if unknowns.is_empty() {
        return determined;
    }
    let tape = EvaluationTape::new(graph, components);
    // The contribution of one unit of an unknown to each component; without parameters there is no other contribution.
    let reach = |of: Atom, value: &dyn Fn(Atom) -> f64| {
        let atom = |atom: Atom| match atom {
            Atom::Base(_) => f64::from(u8::from(atom == of)),
            Atom::Parameter(_) | Atom::Rate(_) | Atom::Acceleration(_) | Atom::Load(_) => 0.0,
            other => value(other),
        };
        tape.evaluate(&FloatDomain(atom))
    };
    let mut stream = RandomStream::new(17);
    // First the unknowns that no geometry determines, at random constants and coordinates.
    for free in unconstrained_unknowns(cuts) {
        for _ in 0..POSES {
            // The same seed for all atoms of a pose, so that each keeps its value.
            let seed = stream.next_bits();
            let drawn = |atom: Atom| match atom {
                Atom::Pi => std::f64::consts::PI,
                Atom::Constant(i) => 0.5 + uniform_symmetric(&mut RandomStream::new(seed ^ (2 * i as u64 + 1))),
                Atom::Coordinate(i) => 0.5 + uniform_symmetric(&mut RandomStream::new(seed ^ (2 * i as u64 + 2))),
                _ => 0.0,
            };
            let Some(found) = reach(free, &drawn) else {
                continue;
            };
            for (determined, x) in determined.iter_mut().zip(found) {
                *determined &= x.abs() <= ZERO_TOLERANCE;
            }
        }
    }

    // Then the null space at the file's geometry.
    let gaps: Vec<ExprId> = cuts.iter().flat_map(|cut| cut.gap).collect();
    let n = mechanism.coordinates.len();
    let slopes: Vec<ExprId> = (0..n)
        .flat_map(|i| graph.differentiate(&gaps, Atom::Coordinate(i)))
        .collect();
    let jacobian = EvaluationTape::new(graph, &slopes);
    let loops = NumericLoops::new(graph, mechanism, &equations.projection.loops.residual);
    let mut poses: Vec<Vec<f64>> = (0..POSES)
        .filter_map(|_| loops.random_pose(REACH, &mut stream))
        .collect();
    // Without a random pose the nominal one has to do.
    if poses.is_empty() {
        poses.push(loops.declared_nominal_pose());
    }
    for q in poses {
        let at = |atom: Atom| match atom {
            Atom::Pi => std::f64::consts::PI,
            Atom::Constant(i) => mechanism.constants[i].value,
            Atom::Coordinate(i) => q[i],
            _ => 0.0,
        };
        // Contribution of every unknown to every component at this pose.
        let found: Option<Vec<Vec<f64>>> = unknowns.iter().map(|of| reach(*of, &at)).collect();
        let (Some(found), Some(slopes)) = (found, jacobian.evaluate(&FloatDomain(at))) else {
            continue;
        };
        // Columns are scaled to the unit of their coordinate, so that lengths and angles compare.
        let mut scaled = DMatrix::from_column_slice(gaps.len(), n, &slopes);
        for (i, mut column) in scaled.column_iter_mut().enumerate() {
            column *= loops.coordinate_unit(i);
        }
        let reaching = DMatrix::from_fn(components.len(), unknowns.len(), |r, c| found[c][r]);
        // A component that changes along a vector of the null space is not determined.
        for null in null_space(&scaled) {
            let moved = &reaching * &null;
            for (r, determined) in determined.iter_mut().enumerate() {
                *determined &= moved[r].abs() <= ZERO_TOLERANCE * reaching.row(r).amax();
            }
        }
    }
    determined
}

/// Unknowns that do no work in any virtual motion, in any geometry.
fn unconstrained_unknowns(cuts: &[CutLoop]) -> Vec<Atom> {
    let mut free = Vec::new();
    for cut in cuts {
        let across = cut.gap.iter().zip(cut.force);
        free.extend(across.filter_map(|(gap, atom)| (*gap == Graph::ZERO).then_some(atom)));
        free.extend(cut.moment.into_iter().flatten());
    }
    free
}

/// Combinations of rows that are zero, each of length 1.
fn null_space(rows: &DMatrix<f64>) -> Vec<nalgebra::DVector<f64>> {
    let (n, m) = rows.shape();
    // With fewer columns than rows the decomposition would leave out a part of the null space.
    let padded = rows.clone().resize(n, m.max(n), 0.0);
    let svd = padded.svd(true, false);
    let Some(u) = svd.u else { return Vec::new() };
    let largest = svd.singular_values.amax();
    (0..n)
        .filter(|k| svd.singular_values[*k] <= ZERO_TOLERANCE * largest)
        .map(|k| u.column(k).into_owned())
        .collect()
}
