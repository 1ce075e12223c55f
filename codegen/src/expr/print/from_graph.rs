//! Formulas of the expressions in a graph.

use modelmill_spec::Mechanism;

use super::formula::{Formula, Function};
use super::symbol::Symbol;
use crate::expr::{AngleSum, Atom, ExprId, Graph, Node, Rational};

/// The name of an atom: as in the model file, `theta1_d` and `theta1_dd` for rate and acceleration.
pub fn atom(mechanism: &Mechanism, atom: Atom) -> Symbol {
    match atom {
        Atom::Constant(i) => Symbol::new(&*mechanism.constants[i].name),
        Atom::Parameter(i) => Symbol::new(&*mechanism.parameters[i].name),
        Atom::Base(k) => Symbol::new(format!("p{}_min", k + 1)),
        Atom::Coordinate(i) => Symbol::new(&*mechanism.coordinates[i].name),
        Atom::Rate(i) => Symbol::derived(&*mechanism.coordinates[i].name, 1),
        Atom::Acceleration(i) => Symbol::derived(&*mechanism.coordinates[i].name, 2),
        Atom::Pi => Symbol::new("pi"),
        Atom::Load(d) => Symbol::new(format!("load_{}", mechanism.drives[d].name)),
        Atom::Shared(k) => Symbol::new(format!("pose_{}", k + 1)),
    }
}

/// The formula of an expression, written out as a tree: ask [`tree_size`] first where it may be large.
pub fn formula(graph: &Graph, mechanism: &Mechanism, id: ExprId) -> Formula {
    let of = |id: ExprId| formula(graph, mechanism, id);
    match graph.node(id) {
        Node::Rational(value) => Formula::Number(value.clone()),
        Node::Atom(a) => Formula::Symbol(atom(mechanism, *a)),
        Node::Sin(angle) => Formula::apply(Function::Sin, angle_sum(mechanism, angle)),
        Node::Cos(angle) => Formula::apply(Function::Cos, angle_sum(mechanism, angle)),
        Node::Sum(terms) => Formula::sum(
            terms
                .iter()
                .map(|(term, k)| Formula::product(k.clone(), [of(*term)])),
        ),
        Node::Product(factors) => {
            let mut factors = factors.clone();
            factors.sort_by_key(|(id, _)| rank(graph, *id));
            let product = Formula::product(
                Rational::ONE,
                factors.iter().map(|(base, n)| of(*base).power(*n)),
            );
            in_order(product)
        }
        Node::Unary(function, inner) => Formula::apply((*function).into(), of(*inner)),
    }
}

/// How many nodes the expression has when it is written out, counted no further than `limit`.
pub fn tree_size(graph: &Graph, id: ExprId, limit: usize) -> usize {
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

/// A sum of angles.
pub(crate) fn angle_sum(mechanism: &Mechanism, angle: &AngleSum) -> Formula {
    Formula::sum(angle.terms().iter().map(|(a, n)| {
        Formula::product(
            Rational::integer(i64::from(*n)),
            [Formula::Symbol(atom(mechanism, *a))],
        )
    }))
}

/// Place of a factor in a product: known quantities first, then what moves, then functions and parentheses.
fn rank(graph: &Graph, id: ExprId) -> usize {
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
fn in_order(product: Formula) -> Formula {
    fn rank(factor: &Formula) -> usize {
        match factor {
            Formula::Apply(..) => 1,
            Formula::Sum(_) => 2,
            Formula::Power(base, _) => rank(base),
            _ => 0,
        }
    }
    match product {
        Formula::Term {
            factor,
            mut above,
            mut below,
        } => {
            above.sort_by_key(rank);
            below.sort_by_key(rank);
            Formula::Term {
                factor,
                above,
                below,
            }
        }
        other => other,
    }
}
