//! Which components of reactions equations of motion determine.
//!
//! Forces at the cuts that no virtual motion feels, the null space of the transposed Jacobian of all closing equations,
//! may have any size. A component is determined if none of them reaches it.
//!
//! Decision: all unknowns of a cut are carried as symbols first. The pin of a planar loop may carry moments that
//! the point in the model cannot; they count as unknown too. The null space is that of the file's geometry, but
//! lengths across the plane of a loop are drawn at random, so that a length of zero hides nothing.

use modelmill_algebra::field::Stream;
use modelmill_spec::Mechanism;
use nalgebra::DMatrix;

use super::loads::Cut;
use crate::expr::{Atom, ExprId, F64, Graph, Tape};
use crate::loops::numeric_poses::{NumericLoops, symmetric};
use crate::regressor::Equations;

/// Poses that are looked at, and how far they reach, in rad or relative to the size of the loops.
const POSES: usize = 4;
const REACH: f64 = 0.05;
/// What counts as nothing beside the largest of its kind.
const NOTHING: f64 = 1e-7;

/// For every component whether it is determined.
///
/// The null space is that of the file's geometry at poses around the nominal one. Forces across the plane of a planar loop
/// belong to it in every geometry, and so do moments that a pin there could transmit; what these reach is found with
/// lengths drawn at random, so that no length that happens to be zero hides it.
pub(super) fn determined(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &Equations,
    cuts: &[Cut],
    components: &[ExprId],
) -> Vec<bool> {
    let mut determined = vec![true; components.len()];
    let unknowns: Vec<Atom> = cuts.iter().flat_map(|cut| cut.force).collect();
    if unknowns.is_empty() {
        return determined;
    }
    let tape = Tape::new(graph, components);
    // What a unit of one unknown number adds to each component: without inertia there is nothing else.
    let reach = |of: Atom, value: &dyn Fn(Atom) -> f64| {
        let atom = |atom: Atom| match atom {
            Atom::Base(_) => f64::from(u8::from(atom == of)),
            Atom::Parameter(_) | Atom::Rate(_) | Atom::Acceleration(_) | Atom::Load(_) => 0.0,
            other => value(other),
        };
        tape.evaluate(&F64(atom))
    };
    let mut stream = Stream::new(17);
    for free in free_anywhere(cuts) {
        for _ in 0..POSES {
            let seed = stream.bits();
            let drawn = |atom: Atom| match atom {
                Atom::Pi => std::f64::consts::PI,
                Atom::Constant(i) => 0.5 + symmetric(&mut Stream::new(seed ^ (2 * i as u64 + 1))),
                Atom::Coordinate(i) => 0.5 + symmetric(&mut Stream::new(seed ^ (2 * i as u64 + 2))),
                _ => 0.0,
            };
            let Some(found) = reach(free, &drawn) else {
                continue;
            };
            for (determined, x) in determined.iter_mut().zip(found) {
                *determined &= x.abs() <= NOTHING;
            }
        }
    }

    let gaps: Vec<ExprId> = cuts.iter().flat_map(|cut| cut.gap).collect();
    let n = mechanism.coordinates.len();
    let slopes: Vec<ExprId> = (0..n)
        .flat_map(|i| graph.differentiate(&gaps, Atom::Coordinate(i)))
        .collect();
    let jacobian = Tape::new(graph, &slopes);
    let loops = NumericLoops::new(graph, mechanism, &equations.projection.loops.residual);
    let mut poses: Vec<Vec<f64>> = (0..POSES)
        .filter_map(|_| loops.random(REACH, &mut stream))
        .collect();
    if poses.is_empty() {
        poses.push(loops.as_written());
    }
    for q in poses {
        let at = |atom: Atom| match atom {
            Atom::Pi => std::f64::consts::PI,
            Atom::Constant(i) => mechanism.constants[i].value,
            Atom::Coordinate(i) => q[i],
            _ => 0.0,
        };
        let found: Option<Vec<Vec<f64>>> = unknowns.iter().map(|of| reach(*of, &at)).collect();
        let (Some(found), Some(slopes)) = (found, jacobian.evaluate(&F64(at))) else {
            continue;
        };
        let mut scaled = DMatrix::from_column_slice(gaps.len(), n, &slopes);
        for (i, mut column) in scaled.column_iter_mut().enumerate() {
            column *= loops.unit(i);
        }
        let reaching = DMatrix::from_fn(components.len(), unknowns.len(), |r, c| found[c][r]);
        for null in null_space(&scaled) {
            let moved = &reaching * &null;
            for (r, determined) in determined.iter_mut().enumerate() {
                *determined &= moved[r].abs() <= NOTHING * reaching.row(r).amax();
            }
        }
    }
    determined
}

/// Unknown numbers that no virtual motion feels in any geometry.
fn free_anywhere(cuts: &[Cut]) -> Vec<Atom> {
    let mut free = Vec::new();
    for cut in cuts {
        let across = cut.gap.iter().zip(cut.force);
        free.extend(across.filter_map(|(gap, atom)| (*gap == Graph::ZERO).then_some(atom)));
        free.extend(cut.moment.into_iter().flatten());
    }
    free
}

/// Combinations of rows that vanish, each of length 1.
fn null_space(rows: &DMatrix<f64>) -> Vec<nalgebra::DVector<f64>> {
    let (n, m) = rows.shape();
    // As many columns as rows at least, or the decomposition would leave out a part of the space.
    let padded = rows.clone().resize(n, m.max(n), 0.0);
    let svd = padded.svd(true, false);
    let Some(u) = svd.u else { return Vec::new() };
    let largest = svd.singular_values.amax();
    (0..n)
        .filter(|k| svd.singular_values[*k] <= NOTHING * largest)
        .map(|k| u.column(k).into_owned())
        .collect()
}
