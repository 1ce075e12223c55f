//! On which coordinates expressions depend.

use super::{Atom, ExprId, Graph};

/// Indices of the coordinates on which some expressions depend, in increasing order.
pub(crate) fn coordinates_of(graph: &Graph, roots: &[ExprId]) -> Vec<usize> {
    let atoms = graph.atoms(roots);
    atoms
        .into_iter()
        .filter_map(|atom| if let Atom::Coordinate(i) = atom { Some(i) } else { None })
        .collect()
}
