//! How far from the nominal pose an emitted self-test looks.

use crate::Derivation;
use crate::loops::magnitude;

/// Reach of every independent coordinate, rad or m: everywhere for open chains, where loops stay closed for others.
pub(crate) fn self_test_reach(derivation: &Derivation) -> Vec<f64> {
    let mechanism = &derivation.mechanism;
    let residual = &derivation.equations.projection.loops.residual;
    let mut graph = derivation.graph.clone();
    let size = magnitude::nominal_magnitude(&mut graph, mechanism, residual);
    let (active, _) = derivation.coordinates();
    let is_open = residual.is_empty();
    let reach = |i: &usize| match (mechanism.coordinates[*i].motion.is_angle(), is_open) {
        (true, true) => 3.0,
        (false, true) => 0.5,
        (true, false) => 0.25,
        (false, false) => 0.05 * size,
    };
    active.iter().map(reach).collect()
}
