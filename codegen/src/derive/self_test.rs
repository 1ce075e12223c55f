//! The range of states around the nominal pose that an emitted self-test draws from.

use crate::Derivation;
use crate::loops::magnitude;

/// Range of every independent coordinate, rad or m: large for open chains, small enough for loops to stay closed
/// otherwise.
pub(crate) fn self_test_reach(derivation: &Derivation) -> Vec<f64> {
    let mechanism = &derivation.mechanism;
    let residual = &derivation.equations.projection.loops.residual;
    let mut graph = derivation.graph.clone();
    // Size of the loops, m.
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
