//! Magnitudes of loop residuals, coordinates and determinants. Newton's method compares residuals and steps with them,
//! and singular poses are detected by them, so that neither depends on the unit of length.
//!
//! Decision: a determinant counts as zero below 1e-9 of the magnitude of its terms (in `f32`: ten roundings). That
//! magnitude is an expression in the constants alone, computed once per geometry: sine and cosine count as 1,
//! prismatic coordinates as at the nominal pose. If the expression has fractions of the state, its nominal value is
//! scaled by the power with which it grows with the size of the loops. So a machine may be built a thousand times
//! smaller than its file states.

use std::collections::{BTreeMap, HashMap, HashSet};

use modelmill_spec::Mechanism;
use num_rational::BigRational;
use num_traits::One;

use crate::expr::{Atom, EvaluationTape, ExprId, FloatDomain, Graph, Node, Unary, nominal_of, nominal_value};

/// The sum of the magnitudes of all terms of some expressions at the nominal pose: the size of a mechanism's loops, m.
/// It is 1 if there is no such expression; couplings of angles have no length and are skipped.
pub(crate) fn nominal_magnitude(graph: &mut Graph, mechanism: &Mechanism, roots: &[ExprId]) -> f64 {
    let mut known = HashMap::new();
    let mut lengths = roots.to_vec();
    lengths.retain(|root| !has_angle_term(graph, mechanism, *root));
    let terms: Vec<ExprId> = lengths
        .into_iter()
        .map(|root| expression_magnitude(graph, mechanism, &mut known, root))
        .collect();
    let total = graph.add_all(&terms);
    nominal_value(graph, mechanism, total)
        .filter(|size| size.is_normal())
        .unwrap_or(1.0)
}

/// Magnitude of a value at the nominal pose divided by the change that rounding may cause, in units of the last digit;
/// `None` where it has no value.
///
/// For a sum this is its share of the magnitudes of its terms. For a product, the relative errors of its factors add
/// up: it is as exact as its worst factor, however many there are. The magnitudes of all its terms, multiplied out,
/// would count the errors of every factor.
pub(crate) fn significant_digits(graph: &Graph, mechanism: &Mechanism, root: ExprId) -> Option<f64> {
    // Values of all nodes, then a bound of the rounding error of each node, operands first.
    let order = operands_first(graph, root);
    let values = EvaluationTape::new(graph, &order).evaluate(&FloatDomain(|atom| nominal_of(mechanism, atom)))?;
    let mut known: HashMap<ExprId, (f64, f64)> = HashMap::new();
    for (id, value) in order.iter().zip(values) {
        let of = |id: &ExprId| known[id];
        // Error bounds in units of the last digit, by first-order propagation.
        let changes = match graph.node(*id) {
            Node::Sin(_) | Node::Cos(_) | Node::Unary(Unary::Sign | Unary::Tanh | Unary::Sin | Unary::Cos, _) => 1.0,
            Node::Atom(Atom::Coordinate(i)) if !mechanism.coordinates[*i].motion.is_length() => 1.0,
            Node::Rational(_) | Node::Atom(_) | Node::Unary(Unary::Exp, _) => value.abs(),
            Node::Unary(Unary::Abs, inner) => of(inner).1,
            Node::Unary(Unary::Sqrt, inner) => of(inner).1 / (2.0 * value) + value,
            Node::Sum(terms) => terms
                .iter()
                .map(|(term, factor)| factor.to_f64().abs() * of(term).1)
                .sum(),
            Node::Product(factors) => {
                let shares = factors.iter().map(|(base, n)| {
                    let (value, changes) = of(base);
                    f64::from(*n).abs() * changes / value.abs()
                });
                value.abs() * shares.sum::<f64>()
            }
        };
        known.insert(*id, (value, changes));
    }
    let (value, changes) = known[&root];
    let left = value.abs() / changes;
    left.is_finite().then_some(left)
}

/// All nodes that an expression consists of, operands first, itself last.
fn operands_first(graph: &Graph, root: ExprId) -> Vec<ExprId> {
    let mut order = Vec::new();
    let mut seen = HashSet::new();
    // A node is entered once to visit its operands, and left once they are in the list.
    let mut waiting = vec![(root, false)];
    while let Some((id, is_left)) = waiting.pop() {
        if is_left {
            order.push(id);
            continue;
        }
        if !seen.insert(id) {
            continue;
        }
        waiting.push((id, true));
        match graph.node(id) {
            Node::Sum(terms) => waiting.extend(terms.iter().map(|(term, _)| (*term, false))),
            Node::Product(factors) => {
                waiting.extend(factors.iter().map(|(base, _)| (*base, false)));
            }
            Node::Unary(_, inner) => waiting.push((*inner, false)),
            Node::Rational(_) | Node::Atom(_) | Node::Sin(_) | Node::Cos(_) => {}
        }
    }
    order
}

/// Whether an angle itself, not its sine or cosine, is a term of the expression.
fn has_angle_term(graph: &Graph, mechanism: &Mechanism, root: ExprId) -> bool {
    let is_angle = |id: ExprId| {
        matches!(graph.node(id), Node::Atom(Atom::Coordinate(i))
            if mechanism.coordinates[*i].motion.is_angle())
    };
    match graph.node(root) {
        Node::Sum(terms) => terms.iter().any(|(term, _)| is_angle(*term)),
        _ => is_angle(root),
    }
}

/// The size of a mechanism's loops: the sum of the magnitudes of all constant lengths in them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoopSize {
    /// A sum of magnitudes of constants, m; zero if there is none.
    pub(crate) total: ExprId,
    /// Its value for the mechanism's constants, m.
    pub(crate) nominal: f64,
}

impl LoopSize {
    /// The size by the residuals of the loops; prismatic coordinates count as zero.
    pub(crate) fn from_residual(graph: &mut Graph, mechanism: &Mechanism, residual: &[ExprId]) -> Self {
        let mut known = HashMap::new();
        let terms: Vec<ExprId> = residual
            .iter()
            .map(|r| expression_magnitude(graph, mechanism, &mut known, *r))
            .collect();
        let still = nominal_lengths(graph, mechanism, |_, _| Graph::ZERO);
        let mut terms = graph.substitute(&terms, &still);
        // Couplings have no size of their own.
        terms.retain(|term| graph.atoms(&[*term]).into_iter().all(Atom::is_fixed));
        let total = graph.add_all(&terms);
        let nominal = nominal_value(graph, mechanism, total).filter(|size| size.is_normal());
        match nominal {
            Some(nominal) => Self { total, nominal },
            None => Self {
                total: Graph::ZERO,
                nominal: 0.0,
            },
        }
    }

    /// The size of these loops divided by that of the mechanism's own constants; 1 for those.
    pub(crate) fn relative_scale(&self, graph: &mut Graph) -> ExprId {
        self.scale_length(graph, 1.0)
    }

    /// A length of the mechanism, m, multiplied by the ratio of the size of these loops to the nominal one.
    fn scale_length(&self, graph: &mut Graph, length: f64) -> ExprId {
        if self.nominal == 0.0 {
            return rounded_number(graph, length);
        }
        let share = rounded_number(graph, length / self.nominal);
        graph.mul(share, self.total)
    }

    /// The sum of the magnitudes of all terms of an expression that depends on the pose. Sines and cosines count as 1,
    /// and prismatic coordinates as at the nominal pose. Fractions have the values of the nominal pose and are scaled
    /// with the size of the loops.
    pub(crate) fn term_magnitude(&self, graph: &mut Graph, mechanism: &Mechanism, id: ExprId) -> ExprId {
        let found = expression_magnitude(graph, mechanism, &mut HashMap::new(), id);
        let out = nominal_lengths(graph, mechanism, |graph, nominal| self.scale_length(graph, nominal));
        // Prismatic coordinates are replaced by their nominal values, scaled with the loops.
        let at_any_pose = graph.substitute(&[found], &out)[0];
        let is_known = graph.atoms(&[at_any_pose]).into_iter().all(Atom::is_fixed);
        let is_there = nominal_value(graph, mechanism, at_any_pose).is_some_and(f64::is_normal);
        if is_known && is_there {
            return at_any_pose;
        }
        // Fractions of the state remain: the nominal value is scaled by a power of the size.
        let nominal = nominal_magnitude(graph, mechanism, &[id]);
        let nominal = rounded_number(graph, nominal);
        // Its own lengths define its size, since drives between points have lengths without a loop.
        let lengths: Vec<Atom> = graph.atoms(&[found]).into_iter().collect();
        let is_metre = |atom: &Atom| matches!(atom, Atom::Constant(i) if mechanism.constants[*i].unit == "m");
        let lengths: Vec<Atom> = lengths.into_iter().filter(is_metre).collect();
        let degree = length_degree(graph, mechanism, found, &lengths);
        let own = Self::from_constants(graph, mechanism, &lengths).unwrap_or(*self);
        match degree {
            Some(degree) => {
                let scale = own.relative_scale(graph);
                let grown = graph.pow(scale, degree);
                graph.mul(nominal, grown)
            }
            None => nominal,
        }
    }

    /// What a determinant is compared with: the sum of the magnitudes of its terms, as by [`LoopSize::term_magnitude`].
    /// If the nominal pose itself would nearly count as singular by that, because the terms cancel in every factor and
    /// at every pose, the rounding error counts instead, scaled with the loops. A value below `singular` of the result
    /// counts as zero.
    pub(crate) fn determinant_magnitude(
        &self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        id: ExprId,
        singular: f64,
    ) -> ExprId {
        /// The nominal value must exceed the limit by this factor, since determinants vary from pose to pose.
        const ROOM: f64 = 1e3;
        let terms = self.term_magnitude(graph, mechanism, id);
        let at_nominal = |graph: &Graph, id| nominal_value(graph, mechanism, id).map(f64::abs);
        let (Some(value), Some(size)) = (at_nominal(graph, id), at_nominal(graph, terms)) else {
            return terms;
        };
        if value > ROOM * singular * size {
            return terms;
        }
        // Cancellation at every pose: the share of rounding replaces the share of terms.
        match significant_digits(graph, mechanism, id) {
            Some(left) if left > value / size => {
                let share = rounded_number(graph, value / left / size);
                graph.mul(share, terms)
            }
            _ => terms,
        }
    }

    /// The size that is the sum of the magnitudes of some constants; `None` if that is zero or not finite.
    fn from_constants(graph: &mut Graph, mechanism: &Mechanism, constants: &[Atom]) -> Option<Self> {
        let terms: Vec<ExprId> = constants
            .iter()
            .map(|constant| {
                let constant = graph.atom(*constant);
                graph.unary(Unary::Abs, constant)
            })
            .collect();
        let total = graph.add_all(&terms);
        let nominal = nominal_value(graph, mechanism, total).filter(|size| size.is_normal())?;
        Some(Self { total, nominal })
    }
}

/// The power of the unit of length with which an expression scales, if it scales with one. `lengths` are its constants
/// that are lengths; prismatic coordinates are lengths as well.
fn length_degree(graph: &Graph, mechanism: &Mechanism, id: ExprId, lengths: &[Atom]) -> Option<i32> {
    // Binary logarithm of the magnitude with all lengths multiplied by `unit`.
    let value = |unit: f64| {
        let atom = |atom: Atom| {
            let moves = matches!(atom, Atom::Coordinate(i)
                if mechanism.coordinates[i].motion.is_length());
            let is_length = moves || lengths.contains(&atom);
            nominal_of(mechanism, atom) * if is_length { unit } else { 1.0 }
        };
        let values = EvaluationTape::new(graph, &[id]).evaluate(&FloatDomain(atom))?;
        Some(values[0].abs().log2()).filter(|size| size.is_finite())
    };
    // A power gives equal integer steps for each factor of two.
    let [one, two, four] = [value(1.0)?, value(2.0)?, value(4.0)?];
    let degree = (two - one).round();
    let is_power = [two - one, four - two].iter().all(|d| (d - degree).abs() < 1e-6);
    #[allow(clippy::cast_possible_truncation, reason = "it is small, as just seen")]
    (is_power && degree.abs() < 100.0).then_some(degree as i32)
}

/// Replacements of every prismatic coordinate, by a function of its nominal value in m.
fn nominal_lengths(
    graph: &mut Graph,
    mechanism: &Mechanism,
    of: impl Fn(&mut Graph, f64) -> ExprId,
) -> BTreeMap<ExprId, ExprId> {
    let coordinates = mechanism.coordinates.iter().enumerate();
    let slides = coordinates.filter(|(_, c)| c.motion.is_length());
    slides
        .map(|(i, c)| (graph.atom(Atom::Coordinate(i)), of(graph, c.nominal)))
        .collect()
}

/// A double as an exact rational number; 1 if it is not finite.
fn rounded_number(graph: &mut Graph, value: f64) -> ExprId {
    let value = BigRational::from_float(value).unwrap_or_else(BigRational::one);
    graph.rational(value.into())
}

/// An expression in which every term is replaced by its magnitude; `known` stores results by node.
pub(crate) fn expression_magnitude(
    graph: &mut Graph,
    mechanism: &Mechanism,
    known: &mut HashMap<ExprId, ExprId>,
    id: ExprId,
) -> ExprId {
    if let Some(found) = known.get(&id) {
        return *found;
    }
    let found = match graph.node(id).clone() {
        Node::Rational(value) => graph.rational(value.abs()),
        Node::Sin(_) | Node::Cos(_) | Node::Unary(Unary::Sign | Unary::Tanh | Unary::Sin | Unary::Cos, _) => Graph::ONE,
        // Angles count as 1, since Newton's method works with their sines and cosines; so do components of unit
        // quaternions.
        Node::Atom(Atom::Coordinate(i)) if !mechanism.coordinates[i].motion.is_length() => Graph::ONE,
        Node::Atom(_) | Node::Unary(Unary::Exp, _) => graph.unary(Unary::Abs, id),
        Node::Unary(Unary::Abs, inner) => expression_magnitude(graph, mechanism, known, inner),
        Node::Unary(Unary::Sqrt, inner) => {
            let inner = expression_magnitude(graph, mechanism, known, inner);
            graph.unary(Unary::Sqrt, inner)
        }
        Node::Sum(terms) => {
            let terms: Vec<_> = terms
                .into_iter()
                .map(|(term, factor)| (expression_magnitude(graph, mechanism, known, term), factor.abs()))
                .collect();
            graph.sum(&terms)
        }
        Node::Product(factors) => {
            let factors: Vec<_> = factors
                .into_iter()
                // A divisor keeps its own magnitude: a sum of magnitudes would make the quotient too small.
                .map(|(base, n)| {
                    let base = if n > 0 {
                        expression_magnitude(graph, mechanism, known, base)
                    } else {
                        graph.unary(Unary::Abs, base)
                    };
                    (base, n)
                })
                .collect();
            graph.product(&factors)
        }
    };
    known.insert(id, found);
    found
}
