//! Struts: passive elements along the line between two points, and the generalised forces of one that pulls its points
//! together.
//!
//! With the points `a` and `b`, `d = b - a` and `l = |d|`, the pull `F0 + k l + Fv l'` contributes `(F0 + k l + Fv l')
//! dl/dq` by virtual power, where `l dl/dq = d . dd/dq` and `l l' = d . d'`.

use modelmill_spec::{EffectPlace, Mechanism, ModelEffect, PointIdx};

use crate::DeriveError;
use crate::expr::vector::SymbolicVector;
use crate::expr::{Atom, ExprId, Graph, Unary};
use crate::loops::segment::position_in_base;
use crate::tree::KinematicTree;

/// The line between the points of an effect.
struct StrutLine {
    /// The two points.
    ends: [PointIdx; 2],
    /// Vector from the first point to the second, in the axes of the base, m.
    across: SymbolicVector,
    /// Its length, m.
    length: ExprId,
}

/// The line of an effect. The model file is checked for two points; a mechanism built by a program may have none, and
/// then has no element.
fn strut_line(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &KinematicTree,
    effect: &ModelEffect,
) -> Result<Option<StrutLine>, DeriveError> {
    let [EffectPlace::Point(from), EffectPlace::Point(to)] = effect.places[..] else {
        return Ok(None);
    };
    let a = position_in_base(graph, mechanism, tree, from.0)?;
    let b = position_in_base(graph, mechanism, tree, to.0)?;
    let across = graph.sub_vectors(&b, &a);
    // The length as a root.
    let square = graph.dot(&across, &across);
    let length = graph.unary(Unary::Sqrt, square);
    Ok(Some(StrutLine {
        ends: [from, to],
        across,
        length,
    }))
}

/// Symbols of the parameters.
const SYMBOLS: [&str; 3] = ["F0", "k", "Fv"];

/// Generalised forces `[0][t][c]` for each of `F0`, `k` and `Fv` that the effect has, of one, on every coordinate c.
pub(super) fn generalised_forces(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &KinematicTree,
    effect: &ModelEffect,
) -> Result<Vec<Vec<Vec<ExprId>>>, DeriveError> {
    let Some(line) = strut_line(graph, mechanism, tree, effect)? else {
        return Ok(Vec::new());
    };
    let per_length = graph.pow(line.length, -1);
    let rate = distance_rate(graph, &line);
    let per_rate = graph.mul(rate, per_length);
    let mut forces = vec![Vec::new(); 3];
    for coordinate in 0..mechanism.coordinates.len() {
        let slopes = graph.differentiate(&line.across, Atom::Coordinate(coordinate));
        // l dl/dq
        let stretched = graph.dot(&[slopes[0], slopes[1], slopes[2]], &line.across);
        forces[0].push(graph.mul(stretched, per_length));
        forces[1].push(stretched);
        forces[2].push(graph.mul(stretched, per_rate));
    }
    // An effect may lack some of its parameters.
    let has = |symbol: &str| effect.terms.iter().any(|term| term.symbol == symbol);
    let all = SYMBOLS.into_iter().zip(forces);
    Ok(vec![
        all.filter(|(symbol, _)| has(symbol))
            .map(|(_, forces)| forces)
            .collect(),
    ])
}

/// Forces at both ends that balance an element with given parameters, N.
pub(super) fn point_forces(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &KinematicTree,
    effect: &ModelEffect,
    values: &[ExprId],
) -> Result<Vec<(PointIdx, SymbolicVector)>, DeriveError> {
    let Some(line) = strut_line(graph, mechanism, tree, effect)? else {
        return Ok(Vec::new());
    };
    let [constant, stiffness, damping] = SYMBOLS.map(|symbol| {
        let mut terms = effect.terms.iter().zip(values);
        terms
            .find(|(term, _)| term.symbol == symbol)
            .map_or(Graph::ZERO, |(_, value)| *value)
    });
    let rate = distance_rate(graph, &line);
    let by_distance = graph.mul(stiffness, line.length);
    let by_rate = graph.mul(damping, rate);
    // F0 + k l + Fv l'
    let pull = graph.add(constant, by_distance);
    let pull = graph.add(pull, by_rate);
    let per_length = graph.pow(line.length, -1);
    let pull = graph.mul(pull, per_length);
    let at_second = graph.scale_vector(pull, &line.across);
    let at_first = graph.sub_vectors(&[Graph::ZERO; 3], &at_second);
    Ok(line.ends.into_iter().zip([at_first, at_second]).collect())
}

/// The rate of the distance, m/s.
fn distance_rate(graph: &mut Graph, line: &StrutLine) -> ExprId {
    let across = graph.time_derivative(&line.across);
    let along = graph.dot(&line.across, &[across[0], across[1], across[2]]);
    let per_length = graph.pow(line.length, -1);
    graph.mul(along, per_length)
}
