//! Formulas of the expressions in a graph.
//!
//! The graph shares subexpressions, but a formula is a tree, so shared subexpressions are repeated.

use modelmill_spec::Mechanism;

use super::formula::{FormulaFunction, PrintedFormula};
use super::symbol::FormulaSymbol;
use crate::expr::{Atom, AtomAngleSum, ExprId, Graph, Node, Rational};

/// The name of an atom: as in the model file, `theta1_d` and `theta1_dd` for rate and acceleration.
pub fn atom(mechanism: &Mechanism, atom: Atom) -> FormulaSymbol {
    match atom {
        Atom::Constant(i) => FormulaSymbol::new(&*mechanism.constants[i].name),
        Atom::Parameter(i) => FormulaSymbol::new(&*mechanism.parameters[i].name),
        Atom::Base(k) => FormulaSymbol::new(format!("p{}_min", k + 1)),
        Atom::Coordinate(i) => FormulaSymbol::new(&*mechanism.coordinates[i].name),
        Atom::Rate(i) => FormulaSymbol::time_derivative(&*mechanism.coordinates[i].name, 1),
        Atom::Acceleration(i) => FormulaSymbol::time_derivative(&*mechanism.coordinates[i].name, 2),
        Atom::Pi => FormulaSymbol::new("pi"),
        Atom::Load(d) => FormulaSymbol::new(format!("load_{}", mechanism.drives[d].name)),
        Atom::Shared(k) => FormulaSymbol::new(format!("pose_{}", k + 1)),
    }
}

/// The formula of an expression, written out as a tree. Check [`tree_size`] first where the tree may be large.
pub fn formula(graph: &Graph, mechanism: &Mechanism, id: ExprId) -> PrintedFormula {
    // Formula of an operand.
    let of = |id: ExprId| formula(graph, mechanism, id);
    match graph.node(id) {
        Node::Rational(value) => PrintedFormula::Number(value.clone()),
        Node::Atom(a) => PrintedFormula::Symbol(atom(mechanism, *a)),
        Node::Sin(angle) => PrintedFormula::apply(FormulaFunction::Sin, angle_sum_formula(mechanism, angle)),
        Node::Cos(angle) => PrintedFormula::apply(FormulaFunction::Cos, angle_sum_formula(mechanism, angle)),
        // Every term with its rational factor.
        Node::Sum(terms) => PrintedFormula::sum(
            terms
                .iter()
                .map(|(term, k)| PrintedFormula::product(k.clone(), [of(*term)])),
        ),
        Node::Product(factors) => {
            // Factors are printed in the order that a person would write, not in the order of their ids.
            let mut factors = factors.clone();
            factors.sort_by_key(|(id, _)| factor_rank(graph, *id));
            let product = PrintedFormula::product(Rational::ONE, factors.iter().map(|(base, n)| of(*base).power(*n)));
            order_factors(product)
        }
        Node::Unary(function, inner) => PrintedFormula::apply((*function).into(), of(*inner)),
    }
}

/// Number of nodes of the expression when it is written out as a tree, counted up to `limit`.
pub fn tree_size(graph: &Graph, id: ExprId, limit: usize) -> usize {
    // Nodes that are waiting to be counted; shared nodes are counted as often as they occur.
    let mut size = 0;
    let mut left = vec![id];
    while let Some(next) = left.pop() {
        size += 1;
        if size >= limit {
            return limit;
        }
        graph.for_each_child(next, |child| left.push(child));
    }
    size
}

/// The formula of a sum of angles, without its constant part.
pub(crate) fn angle_sum_formula(mechanism: &Mechanism, angle: &AtomAngleSum) -> PrintedFormula {
    // Each atom with its integer factor.
    PrintedFormula::sum(angle.terms().iter().map(|(a, n)| {
        PrintedFormula::product(
            Rational::integer(i64::from(*n)),
            [PrintedFormula::Symbol(atom(mechanism, *a))],
        )
    }))
}

/// Rank of a factor in a product: constants and parameters first, then variables, then functions and parentheses.
fn factor_rank(graph: &Graph, id: ExprId) -> usize {
    match graph.node(id) {
        Node::Rational(_) => 0,
        Node::Atom(Atom::Constant(_)) => 1,
        Node::Atom(Atom::Parameter(_) | Atom::Base(_)) => 2,
        Node::Atom(_) => 3,
        Node::Unary(..) => 4,
        Node::Sin(_) | Node::Cos(_) => 5,
        Node::Sum(_) | Node::Product(_) => 6,
    }
}

/// Orders the factors that came out of nested products: names, functions, parentheses.
fn order_factors(product: PrintedFormula) -> PrintedFormula {
    // Names come before functions, functions before parentheses.
    fn printed_rank(factor: &PrintedFormula) -> usize {
        match factor {
            PrintedFormula::Apply(..) => 1,
            PrintedFormula::Sum(_) => 2,
            PrintedFormula::Power(base, _) => printed_rank(base),
            _ => 0,
        }
    }
    match product {
        PrintedFormula::Term {
            factor,
            mut above,
            mut below,
        } => {
            above.sort_by_key(printed_rank);
            below.sort_by_key(printed_rank);
            PrintedFormula::Term { factor, above, below }
        }
        other => other,
    }
}
