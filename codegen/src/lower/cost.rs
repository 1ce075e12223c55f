//! Estimated cost of a set of expressions per state, in additions: the measure by which forms of equations are
//! compared.

use super::schedule::fixed_nodes;
use crate::expr::{ExprId, Graph, Node, Unary};

/// Cost of a division or square root, in additions.
const DIVISION: usize = 6;
/// Cost of any other function, in additions.
const FUNCTION: usize = 10;

/// Estimated cost in additions. Equal expressions count once, and fixed expressions cost nothing.
pub(crate) fn cost(graph: &Graph, roots: &[ExprId]) -> usize {
    // What is fixed is computed once, outside of the measured program.
    let fixed = fixed_nodes(graph, roots);
    let mut total = 0;
    // Nodes are in topological order, so a node's operands have been classified before it.
    for (i, needed) in graph.reachable(roots).into_iter().enumerate() {
        if !needed || fixed[i] {
            continue;
        }
        let id = ExprId(u32::try_from(i).expect("graph below 4G nodes"));
        total += match graph.node(id) {
            Node::Rational(_) | Node::Atom(_) => 0,
            Node::Sum(terms) => {
                // Fixed terms form one operand. A factor costs a multiplication, unless a fixed factor of the term
                // absorbs it.
                let n_fixed = terms.iter().filter(|(c, _)| fixed[c.index()]).count();
                let scaled = terms.iter().filter(|(c, k)| {
                    let absorbed =
                        matches!(graph.node(*c), Node::Product(f) if f.iter().any(|(x, _)| fixed[x.index()]));
                    !fixed[c.index()] && !k.abs().is_one() && !absorbed
                });
                terms.len() - n_fixed + n_fixed.min(1) - 1 + scaled.count()
            }
            Node::Product(factors) => {
                // Fixed factors form one operand; powers are repeated multiplications, negative ones need a division.
                let n_fixed = factors.iter().filter(|(c, _)| fixed[c.index()]).count();
                let powers: usize = factors
                    .iter()
                    .filter(|(c, _)| !fixed[c.index()])
                    .map(|(_, n)| n.unsigned_abs() as usize - 1 + if *n < 0 { DIVISION } else { 0 })
                    .sum();
                factors.len() - n_fixed + n_fixed.min(1) - 1 + powers
            }
            Node::Unary(Unary::Sqrt, _) => DIVISION,
            Node::Sin(_) | Node::Cos(_) | Node::Unary(..) => FUNCTION,
        };
    }
    total
}
