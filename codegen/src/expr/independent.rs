//! Which functions are linearly independent: elimination on their values at random points of a prime field.

use modelmill_algebra::eliminate::RowEchelonForm;
use modelmill_algebra::field::{FieldElement, RandomStream};

use super::{Atom, EvaluationTape, ExprId, FieldPoint, Graph};
use crate::DeriveError;

/// Seed of all random draws: the same model gives the same text on every machine.
pub(crate) const SEED: u64 = 0x6D6F_6465_6C6D_696C;

/// How many points in a row must add no new row. A random point misses a missing direction with a probability of about
/// 2^-55, so one point would be enough.
pub(crate) const IDLE: usize = 2;

/// Indices of functions that are linearly independent over the constants, where all other atoms are variables.
/// Of several dependent functions the first ones are kept.
///
/// # Errors
/// [`DeriveError::NoPointFound`] if the functions have no values at nearly all random points.
pub(crate) fn independent_functions(graph: &Graph, roots: &[ExprId]) -> Result<Vec<usize>, DeriveError> {
    if roots.is_empty() {
        return Ok(Vec::new());
    }
    let tape = EvaluationTape::new(graph, roots);
    let atoms = graph.atoms(roots);
    let mut stream = RandomStream::new(SEED);
    let mut constants = FieldPoint::<FieldElement> {
        seed: stream.next_bits(),
        root_seed: stream.next_bits(),
        ..FieldPoint::default()
    };
    // Draws values for the constants, or for all other atoms.
    let mut draw = |point: &mut FieldPoint, fixed: bool| {
        for atom in &atoms {
            if matches!(atom, Atom::Constant(_) | Atom::Pi) == fixed {
                point.values.insert(*atom, stream.next_element());
                point.angles.insert(*atom, stream.next_circle_point());
            }
        }
    };
    draw(&mut constants, true);
    // Columns are tried in their own order, so that the first of dependent functions is kept.
    let order: Vec<usize> = (0..roots.len()).collect();
    let mut echelon = RowEchelonForm::new(&order);
    let mut idle = 0;
    for _ in 0..50 * roots.len() {
        // The constants stay the same at all points, since dependences may have them as factors.
        let mut point = constants.clone();
        draw(&mut point, false);
        if let Some(row) = tape.evaluate(&point) {
            idle = if echelon.insert(row) { 0 } else { idle + 1 };
        } else {
            // Roots of constants that are not in the field: others may be.
            draw(&mut constants, true);
        }
        if idle >= IDLE {
            let mut kept = echelon.pivots;
            kept.sort_unstable();
            return Ok(kept);
        }
    }
    Err(DeriveError::NoPointFound {
        draws: 50 * roots.len(),
    })
}
