//! A choice of coordinates for which connected loops can be solved one unknown at a time. Only which coordinates occur
//! in which equations is used, before any expression is derived.

use modelmill_spec::Mechanism;
use nalgebra::DMatrix;

use crate::expr::{Atom, ExprId, Graph, coordinates_of};
use crate::loops::numeric_poses::NumericLoops;

/// Sets of `size` of the `free` coordinates that determine the loops at the nominal pose and for which these can
/// probably be solved together by [`crate::loops::spatial::solve`], judged by which coordinates occur in which
/// equations. Sets that leave the coordinates of most equations given come first.
pub(crate) fn promising_sets(
    graph: &mut Graph,
    mechanism: &Mechanism,
    equations: &[ExprId],
    residual: &[ExprId],
    free: &[usize],
    size: usize,
) -> Vec<Vec<usize>> {
    /// With more coordinates than this no sets are tried: they must fit into 64 bits.
    const MOST_COORDINATES: usize = 60;
    /// Largest number of sets that are tried.
    const MOST_SETS: usize = 20_000;
    /// Largest number of sets that are returned.
    const MOST_FOUND: usize = 12;
    if free.len() > MOST_COORDINATES || size > free.len() {
        return Vec::new();
    }
    // Sets of coordinates are bit masks.
    let bit = |c: &usize| free.iter().position(|f| f == c).map_or(0, |k| 1_u64 << k);
    let mask = |all: &[usize]| all.iter().map(bit).fold(0, |a, b| a | b);
    // For every equation its coordinates, and the prismatic coordinates that are linear in it with those of their
    // factors.
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
    // Coordinates of most equations stand first, so the first sets leave them given.
    let mut order: Vec<usize> = free.to_vec();
    let occurs = |c: usize| known.iter().filter(|(all, _)| all & bit(&c) != 0).count();
    order.sort_by_key(|c| std::cmp::Reverse(occurs(*c)));
    let Some(jacobian) = nominal_jacobian(graph, mechanism, residual, &order) else {
        return Vec::new();
    };
    // A set determines the loops where its derivatives have full rank.
    let settles = |unknown: &[usize]| {
        let values = jacobian.select_columns(unknown).svd(false, false).singular_values;
        values.len() == size && values.min() > 1e-6 * values.max()
    };
    let mut found = Vec::new();
    // Sets of given coordinates, in order; the others are the unknowns.
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

/// Derivatives of residuals by coordinates at the nominal pose, for lengths in units of the size of the loops.
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

/// Turns a set of increasing positions below `n` into the next one in lexicographic order; false after the last.
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

/// Simulates [`crate::loops::spatial::solve`] with the coordinates of the equations alone. Each equation is given as
/// the mask of its coordinates, and for each of its linear prismatic coordinates the masks of that one and of its
/// factor.
fn is_probably_solvable(mut equations: Vec<(u64, Vec<(u64, u64)>)>, unknown: u64) -> bool {
    let mut left = unknown;
    while left != 0 {
        // An equation with one unknown determines it.
        let single = equations
            .iter()
            .map(|(all, _)| all & left)
            .find(|all| all.is_power_of_two());
        if let Some(single) = single {
            left &= !single;
            continue;
        }
        // Otherwise a linear prismatic coordinate with a known factor is eliminated, from the equation with the fewest
        // unknowns.
        let mut order: Vec<usize> = (0..equations.len()).filter(|i| equations[*i].0 & left != 0).collect();
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
        // The equation is used up, and its coordinates enter every equation with that prismatic coordinate.
        let (all, _) = equations.swap_remove(i);
        for (other, slides) in &mut equations {
            if *other & slide != 0 {
                *other |= all;
                // The factors of the other coordinates after the elimination are not known; they may be unchanged.
                slides.retain(|(own, _)| *own != slide);
            }
        }
    }
    true
}
