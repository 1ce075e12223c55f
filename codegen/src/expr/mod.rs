//! Expressions as a hash-consed graph: equal [`ExprId`]s mean equal structure.
//!
//! Nodes are made only by the smart constructors of [`Graph`], which order operands, merge like terms, move rational
//! factors and signs outwards, and know the exact sines and cosines of multiples of pi/12.
//! Sums of sums and products of products are left nested on purpose: the recursion's shared values stay shared.
//! Coefficients are exact rationals; no floating-point number occurs before evaluation or emission.

mod angle;
mod construct;
mod coordinates;
mod differentiate;
mod evaluate;
pub(crate) mod independent;
pub(crate) mod linear;
mod many_digits;
mod nominal;
pub mod print;
mod substitute;
#[cfg(test)]
mod tests;
pub(crate) mod vector;

use std::collections::BTreeSet;

use indexmap::IndexSet;
use rustc_hash::FxBuildHasher;

pub use angle::AtomAngleSum;
pub(crate) use coordinates::coordinates_of;
pub use evaluate::{EvaluationDomain, EvaluationTape, FieldPoint, FloatDomain, RationalPoint};
pub(crate) use many_digits::BigFloatPoint;
pub use modelmill_algebra::Rational;
pub(crate) use nominal::{nominal_of, nominal_value};

/// Index of an expression in its [`Graph`]. Children have smaller indices than their parents.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ExprId(pub(crate) u32);

impl ExprId {
    /// Position in the graph's arena.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A quantity that an expression does not look into.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Atom {
    /// The ratio of a circle's circumference to its diameter, where it stands outside an angle.
    Pi,
    /// A constant of the model file.
    Constant(usize),
    /// A dynamic parameter.
    Parameter(usize),
    /// A base parameter, by its position in `p_min`.
    Base(usize),
    /// A joint coordinate, rad or m.
    Coordinate(usize),
    /// Its first time derivative.
    Rate(usize),
    /// Its second time derivative.
    Acceleration(usize),
    /// The force or torque that a drive carries, effects aside.
    Load(usize),
    /// A value of the pose that several emitted programs share, by its place.
    Shared(usize),
}

impl Atom {
    /// Whether it is known once the geometry and the parameters are.
    pub(crate) fn is_fixed(self) -> bool {
        matches!(self, Self::Pi | Self::Constant(_) | Self::Parameter(_) | Self::Base(_))
    }
}

/// Functions of one argument that are kept as nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Unary {
    /// Square root.
    Sqrt,
    /// Sign: -1, 0 or 1.
    Sign,
    /// Absolute value.
    Abs,
    /// Hyperbolic tangent.
    Tanh,
    /// Exponential.
    Exp,
    /// Sine of an argument that is no sum of angles, such as `2*pi*x/pitch`.
    Sin,
    /// Cosine of such an argument.
    Cos,
}

/// One node of the graph.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Node {
    /// A rational number.
    Rational(Rational),
    /// An opaque quantity.
    Atom(Atom),
    /// Sine of a sum of atoms with integer factors (canonical: the first factor is positive).
    Sin(AtomAngleSum),
    /// Cosine of such a sum.
    Cos(AtomAngleSum),
    /// Linear combination; a rational term stands as a multiple of [`Graph::ONE`].
    ///
    /// Either one term whose factor is not 1, or several of which the first has a positive factor; if all factors have
    /// the same magnitude, it is 1.
    Sum(Vec<(ExprId, Rational)>),
    /// Product of integer powers, never with a rational factor; a negative exponent divides.
    Product(Vec<(ExprId, i32)>),
    /// A function of one argument.
    Unary(Unary, ExprId),
}

impl Node {
    /// Whether it is a sum or a product.
    pub(crate) fn is_open(&self) -> bool {
        matches!(self, Self::Sum(_) | Self::Product(_))
    }
}

/// The arena of expressions.
#[derive(Clone, Debug)]
pub struct Graph {
    /// Nodes by index, each once; operands stand before the nodes that use them.
    nodes: IndexSet<Node, FxBuildHasher>,
}

impl Default for Graph {
    fn default() -> Self {
        Self::new()
    }
}

impl Graph {
    /// The number 0.
    pub const ZERO: ExprId = ExprId(0);
    /// The number 1.
    pub const ONE: ExprId = ExprId(1);

    /// A graph that contains only the numbers 0 and 1.
    pub fn new() -> Self {
        let mut graph = Self {
            nodes: IndexSet::default(),
        };
        let zero = graph.intern(Node::Rational(Rational::ZERO));
        let one = graph.intern(Node::Rational(Rational::ONE));
        assert!(zero == Self::ZERO && one == Self::ONE);
        graph
    }

    /// The node behind an id.
    pub fn node(&self, id: ExprId) -> &Node {
        &self.nodes[id.index()]
    }

    /// Number of nodes, including those that no root needs.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Always false: every graph contains the numbers 0 and 1.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Marks every node that `roots` are made of; `result[i]` belongs to the node of index `i`.
    pub fn reachable(&self, roots: &[ExprId]) -> Vec<bool> {
        let mut seen = vec![false; self.nodes.len()];
        for root in roots {
            seen[root.index()] = true;
        }
        // Parents have larger indices than their operands, so one backward pass reaches everything.
        for i in (0..self.nodes.len()).rev() {
            if seen[i] {
                self.for_each_child(ExprId(u32::try_from(i).expect("graph below 4G nodes")), |child| {
                    seen[child.index()] = true;
                });
            }
        }
        seen
    }

    /// Calls `visit` for every operand of `id`.
    pub fn for_each_child(&self, id: ExprId, mut visit: impl FnMut(ExprId)) {
        // Sines and cosines contain atoms, but no nodes.
        match self.node(id) {
            Node::Rational(_) | Node::Atom(_) | Node::Sin(_) | Node::Cos(_) => {}
            Node::Sum(terms) => terms.iter().for_each(|(child, _)| visit(*child)),
            Node::Product(factors) => factors.iter().for_each(|(child, _)| visit(*child)),
            Node::Unary(_, child) => visit(*child),
        }
    }

    /// The nodes that `roots` are made of, children first.
    pub fn nodes_of(&self, roots: &[ExprId]) -> impl Iterator<Item = &Node> {
        self.nodes
            .iter()
            .zip(self.reachable(roots))
            .filter(|(_, seen)| *seen)
            .map(|(node, _)| node)
    }

    /// The atoms on which `roots` depend, also inside sines and cosines.
    pub fn atoms(&self, roots: &[ExprId]) -> BTreeSet<Atom> {
        let mut atoms = BTreeSet::new();
        for node in self.nodes_of(roots) {
            match node {
                Node::Atom(atom) => _ = atoms.insert(*atom),
                Node::Sin(angle) | Node::Cos(angle) => atoms.extend(angle.atoms()),
                _ => {}
            }
        }
        atoms
    }

    /// A graph with only the nodes that `roots` need, in the same order, and the ids of the roots in it.
    pub(crate) fn compacted(&self, roots: &[ExprId]) -> (Self, Vec<ExprId>) {
        let mut compact = Self::new();
        // New id of each old node; zero and one keep their places.
        let mut new = vec![Self::ZERO; self.nodes.len()];
        new[Self::ONE.index()] = Self::ONE;
        // The first two nodes are 0 and 1 in every graph.
        for (i, needed) in self.reachable(roots).into_iter().enumerate().skip(2) {
            if needed {
                // The same node with the new ids of its operands.
                let node = match self.nodes[i].clone() {
                    Node::Sum(terms) => Node::Sum(terms.into_iter().map(|(c, k)| (new[c.index()], k)).collect()),
                    Node::Product(factors) => {
                        Node::Product(factors.into_iter().map(|(c, n)| (new[c.index()], n)).collect())
                    }
                    Node::Unary(function, c) => Node::Unary(function, new[c.index()]),
                    leaf => leaf,
                };
                new[i] = compact.intern(node);
            }
        }
        let roots = roots.iter().map(|root| new[root.index()]).collect();
        (compact, roots)
    }

    /// The id of a node: that of the equal node that is stored already, or a new one.
    fn intern(&mut self, node: Node) -> ExprId {
        let (index, _) = self.nodes.insert_full(node);
        ExprId(u32::try_from(index).expect("graph below 4G nodes"))
    }
}
