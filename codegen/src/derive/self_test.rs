//! How far from the nominal pose an emitted self-test looks.

use modelmill_spec::Motion;

use crate::Derivation;
use crate::loops::magnitude;

/// Reach of every independent coordinate, rad or m: everywhere for open chains, where loops stay closed for others.
pub(crate) fn reaches(derivation: &Derivation) -> Vec<f64> {
    let mechanism = &derivation.mechanism;
    let residual = &derivation.equations.projection.loops.residual;
    let mut graph = derivation.graph.clone();
    let size = magnitude::at_nominal(&mut graph, mechanism, residual);
    let (active, _) = derivation.coordinates();
    let reach = |i: &usize| match (mechanism.coordinates[*i].motion, residual.is_empty()) {
        (Motion::Revolute, true) => 3.0,
        (Motion::Prismatic, true) => 0.5,
        (Motion::Revolute, false) => 0.25,
        (Motion::Prismatic, false) => 0.05 * size,
    };
    active.iter().map(reach).collect()
}
