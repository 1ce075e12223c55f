//! Derivatives of expressions: by an atom, by time, or along any direction.

use std::collections::BTreeMap;

use super::{Atom, ExprId, Graph, Node, Rational, Unary};

impl Graph {
    /// Partial derivative of each root by `atom`. The sign function counts as constant.
    pub fn differentiate(&mut self, roots: &[ExprId], atom: Atom) -> Vec<ExprId> {
        self.directional(roots, |_, a| if a == atom { Graph::ONE } else { Graph::ZERO })
    }

    /// Time derivative of each root: coordinates become rates, rates become accelerations, and all other atoms are
    /// constant.
    pub fn time_derivative(&mut self, roots: &[ExprId]) -> Vec<ExprId> {
        self.directional(roots, |graph, atom| match atom {
            Atom::Coordinate(i) => graph.atom(Atom::Rate(i)),
            Atom::Rate(i) => graph.atom(Atom::Acceleration(i)),
            _ => Graph::ZERO,
        })
    }

    /// Derivative of each root along a direction: `speed` returns the derivative of every atom.
    pub fn directional(&mut self, roots: &[ExprId], mut speed: impl FnMut(&mut Graph, Atom) -> ExprId) -> Vec<ExprId> {
        // Forward differentiation: operands come before the nodes that use them.
        let needed = self.reachable(roots);
        // Derivative of every node so far.
        let mut derivative: BTreeMap<ExprId, ExprId> = BTreeMap::new();
        for (i, needed) in needed.into_iter().enumerate() {
            if !needed {
                continue;
            }
            let id = ExprId(u32::try_from(i).expect("graph below 4G nodes"));
            let value = match self.node(id).clone() {
                Node::Rational(_) => Self::ZERO,
                Node::Atom(atom) => speed(self, atom),
                // Chain rule with the sum of the atoms' speeds as the inner derivative.
                Node::Sin(angle) | Node::Cos(angle) => {
                    // (sin u)' = cos u u', (cos u)' = -sin u u'
                    let is_sine = matches!(self.node(id), Node::Sin(_));
                    let mut terms = Vec::new();
                    for (atom, n) in angle.terms() {
                        terms.push((speed(self, *atom), Rational::integer(i64::from(*n))));
                    }
                    let rate = self.sum(&terms);
                    let (c, s) = self.cos_sin(&angle, 0);
                    let outer = if is_sine { c } else { self.neg(s) };
                    self.mul(outer, rate)
                }
                // A sum keeps its factors.
                Node::Sum(terms) => {
                    let terms: Vec<_> = terms.into_iter().map(|(child, k)| (derivative[&child], k)).collect();
                    self.sum(&terms)
                }
                // Product rule; factors that are constant along the direction contribute nothing.
                Node::Product(factors) => {
                    let mut terms = Vec::new();
                    for (k, (base, n)) in factors.iter().enumerate() {
                        let inner = derivative[base];
                        if inner == Self::ZERO {
                            continue;
                        }
                        // The exponent is reduced by one, and the derivative of the base is a further factor.
                        let mut rest = factors.clone();
                        rest[k].1 -= 1;
                        rest.push((inner, 1));
                        let term = self.product(&rest);
                        terms.push((term, Rational::integer(i64::from(*n))));
                    }
                    self.sum(&terms)
                }
                Node::Unary(function, child) => {
                    let inner = derivative[&child];
                    if inner == Self::ZERO {
                        Self::ZERO
                    } else {
                        let outer = self.unary_derivative(function, child, id);
                        self.mul(outer, inner)
                    }
                }
            };
            derivative.insert(id, value);
        }
        roots.iter().map(|root| derivative[root]).collect()
    }

    /// Derivative of a function by its argument; `value` is the function's own node.
    fn unary_derivative(&mut self, function: Unary, argument: ExprId, value: ExprId) -> ExprId {
        match function {
            // 1/(2 sqrt(x))
            Unary::Sqrt => {
                let inverse = self.pow(value, -1);
                self.scale(inverse, &Rational::new(1, 2))
            }
            Unary::Sign => Self::ZERO,
            Unary::Abs => self.unary(Unary::Sign, argument),
            // 1 - tanh(x)^2
            Unary::Tanh => {
                let square = self.pow(value, 2);
                self.sub(Self::ONE, square)
            }
            Unary::Exp => value,
            Unary::Sin => self.unary(Unary::Cos, argument),
            Unary::Cos => {
                let sine = self.unary(Unary::Sin, argument);
                self.neg(sine)
            }
        }
    }
}
