//! For which coordinates loops that hang together may be solved one unknown at a time: a choice among all sets, made from
//! which coordinates occur in which equations before anything is derived.

use modelmill_spec::Mechanism;
use nalgebra::DMatrix;

use crate::expr::{Atom, ExprId, Graph, coordinates_of};
use crate::loops::numeric_poses::NumericLoops;

/// Sets of `size` of the `free` coordinates that settle the loops at the nominal pose and for which these look as if they
/// could be solved together as [`crate::loops::spatial::solve`] does, seen from which coordinates occur in which equations. Sets that leave the
/// coordinates of most equations given come first.
pub(crate) fn promising_sets(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &[ExprId],
    residual: &[ExprId],
    free: &[usize],
    size: usize,
) -> Vec<Vec<usize>> {
    /// More coordinates than this are not tried in all sets.
    const MOST_COORDINATES: usize = 60;
    /// Most sets that are looked at, and most that are handed out.
    const MOST_SETS: usize = 20_000;
    const MOST_FOUND: usize = 12;
    if free.len() > MOST_COORDINATES || size > free.len() {
        return Vec::new();
    }
    let bit = |c: &usize| free.iter().position(|f| f == c).map_or(0, |k| 1_u64 << k);
    let mask = |all: &[usize]| all.iter().map(bit).fold(0, |a, b| a | b);
    // For every equation its coordinates, and the slides that are linear in it with the coordinates of their factors.
    let known: Vec<(u64, Vec<(u64, u64)>)> = equations
        .iter()
        .map(|e| {
            let all = coordinates_of(graph, &[*e]);
            let slides: Vec<(u64, u64)> = all
                .iter()
                .filter(|c| mechanism.coordinates[**c].motion.is_length())
                .map(|c| {
                    let slope = graph.differentiate(&[*e], Atom::Coordinate(*c));
                    (bit(c), mask(&coordinates_of(graph, &slope)))
                })
                .collect();
            (mask(&all), slides)
        })
        .collect();
    let mut order: Vec<usize> = free.to_vec();
    let occurs = |c: usize| known.iter().filter(|(all, _)| all & bit(&c) != 0).count();
    order.sort_by_key(|c| std::cmp::Reverse(occurs(*c)));
    let Some(jacobian) = nominal_jacobian(graph, mechanism, residual, &order) else {
        return Vec::new();
    };
    let settles = |unknown: &[usize]| {
        let values = jacobian
            .select_columns(unknown)
            .svd(false, false)
            .singular_values;
        values.len() == size && values.min() > 1e-6 * values.max()
    };
    let mut found = Vec::new();
    let mut given: Vec<usize> = (0..order.len() - size).collect();
    for _ in 0..MOST_SETS {
        let positions: Vec<usize> = (0..order.len()).filter(|k| !given.contains(k)).collect();
        let unknown: Vec<usize> = positions.iter().map(|k| order[*k]).collect();
        if is_probably_solvable(known.clone(), mask(&unknown)) && settles(&positions) {
            found.push(unknown);
            if found.len() == MOST_FOUND {
                break;
            }
        }
        if !next_set(&mut given, order.len()) {
            break;
        }
    }
    found
}

/// Derivatives of residuals by coordinates at the nominal pose, lengths relative to the size of the loops.
fn nominal_jacobian(
    graph: &mut Graph,
    mechanism: &Mechanism,
    residual: &[ExprId],
    coordinates: &[usize],
) -> Option<DMatrix<f64>> {
    let loops = NumericLoops::for_unknowns(graph, mechanism, residual, coordinates.to_vec(), &[]);
    let (_, mut jacobian) = loops.linearise(&loops.declared_nominal_pose())?;
    for (mut column, i) in jacobian.column_iter_mut().zip(coordinates) {
        column *= loops.coordinate_unit(*i);
    }
    Some(jacobian)
}

/// Turns a set of positions below `n`, in order, into the next one; false after the last.
fn next_set(set: &mut [usize], n: usize) -> bool {
    let k = set.len();
    let Some(i) = (0..k).rev().find(|i| set[*i] < n - k + i) else {
        return false;
    };
    set[i] += 1;
    for j in i + 1..k {
        set[j] = set[j - 1] + 1;
    }
    true
}

/// Plays [`crate::loops::spatial::solve`] with the coordinates of the equations alone.
fn is_probably_solvable(mut equations: Vec<(u64, Vec<(u64, u64)>)>, unknown: u64) -> bool {
    let mut left = unknown;
    while left != 0 {
        let single = equations
            .iter()
            .map(|(all, _)| all & left)
            .find(|all| all.is_power_of_two());
        if let Some(single) = single {
            left &= !single;
            continue;
        }
        let mut order: Vec<usize> = (0..equations.len())
            .filter(|i| equations[*i].0 & left != 0)
            .collect();
        order.sort_by_key(|i| (equations[*i].0 & left).count_ones());
        let chosen = order.into_iter().find_map(|i| {
            let (_, slides) = &equations[i];
            let slide = slides
                .iter()
                .find(|(slide, factor)| slide & left != 0 && factor & left == 0)?;
            Some((i, slide.0))
        });
        let Some((i, slide)) = chosen else {
            return false;
        };
        left &= !slide;
        let (all, _) = equations.swap_remove(i);
        for (other, slides) in &mut equations {
            if *other & slide != 0 {
                *other |= all;
                // What the others' factors are afterwards is not known; they may stay as they are.
                slides.retain(|(own, _)| *own != slide);
            }
        }
    }
    true
}
