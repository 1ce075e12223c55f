//! What a set of expressions costs per state: one per addition and multiplication, more for the slow operations.

use super::schedule::fixed_nodes;
use crate::expr::{ExprId, Graph, Node, Unary};

/// Cost of division, root and other functions, in additions.
const DIVISION: usize = 6;
const FUNCTION: usize = 10;

/// Estimated cost; equal expressions count once, what is fixed counts nothing.
pub(crate) fn cost(graph: &Graph, roots: &[ExprId]) -> usize {
    let fixed = fixed_nodes(graph, roots);
    let mut total = 0;
    for (i, needed) in graph.reachable(roots).into_iter().enumerate() {
        if !needed || fixed[i] {
            continue;
        }
        let id = ExprId(u32::try_from(i).expect("graph below 4G nodes"));
        total += match graph.node(id) {
            Node::Rational(_) | Node::Atom(_) => 0,
            Node::Sum(terms) => {
                let n_fixed = terms.iter().filter(|(c, _)| fixed[c.index()]).count();
                let scaled = terms.iter().filter(|(c, k)| {
                    let absorbed = matches!(graph.node(*c), Node::Product(f) if f.iter().any(|(x, _)| fixed[x.index()]));
                    !fixed[c.index()] && !k.abs().is_one() && !absorbed
                });
                terms.len() - n_fixed + n_fixed.min(1) - 1 + scaled.count()
            }
            Node::Product(factors) => {
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
