//! Magnitudes of loop residuals, coordinates and determinants: what Newton's method holds residuals and steps against, and
//! what singular poses are told by, so that neither depends on the unit of length.
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

use crate::expr::{
    Atom, EvaluationTape, ExprId, FloatDomain, Graph, Node, Unary, nominal_of, nominal_value,
};

/// The sum of the magnitudes of all terms of some expressions at the nominal pose: the size of a mechanism's loops in m.
/// It is 1 where there is none; what couples angles has no length.
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

/// How large a value is at the nominal pose beside what rounding may change it by, in units of the last digit; `None` where
/// it has no value.
///
/// For a sum that is its share of the magnitudes of its terms. A product has lost as many digits as its factors together
/// have relative to their own sizes: it is as good as its worst factor, however many there are, while the magnitudes of all
/// its terms, multiplied out, would count the digits of every factor.
pub(crate) fn significant_digits(
    graph: &Graph,
    mechanism: &Mechanism,
    root: ExprId,
) -> Option<f64> {
    let order = operands_first(graph, root);
    let values = EvaluationTape::new(graph, &order)
        .evaluate(&FloatDomain(|atom| nominal_of(mechanism, atom)))?;
    let mut known: HashMap<ExprId, (f64, f64)> = HashMap::new();
    for (id, value) in order.iter().zip(values) {
        let of = |id: &ExprId| known[id];
        let changes = match graph.node(*id) {
            Node::Sin(_)
            | Node::Cos(_)
            | Node::Unary(Unary::Sign | Unary::Tanh | Unary::Sin | Unary::Cos, _) => 1.0,
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

/// Everything that an expression is made of, itself last.
fn operands_first(graph: &Graph, root: ExprId) -> Vec<ExprId> {
    let mut order = Vec::new();
    let mut seen = HashSet::new();
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

/// Whether an angle itself, not its sine or cosine, is a term of a sum.
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

/// The size of a mechanism's loops: the magnitudes of all lengths in them, without those that move.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoopSize {
    /// A sum of magnitudes of constants, in m; 0 where there is none.
    pub(crate) total: ExprId,
    /// Its value for the mechanism's constants.
    pub(crate) nominal: f64,
}

impl LoopSize {
    pub(crate) fn from_residual(
        graph: &mut Graph,
        mechanism: &Mechanism,
        residual: &[ExprId],
    ) -> Self {
        let mut known = HashMap::new();
        let terms: Vec<ExprId> = residual
            .iter()
            .map(|r| expression_magnitude(graph, mechanism, &mut known, *r))
            .collect();
        let still = nominal_lengths(graph, mechanism, |_, _| Graph::ZERO);
        let mut terms = graph.substitute(&terms, &still);
        // What couples coordinates has no size of its own.
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

    /// How large these loops are beside those of the mechanism's constants; 1 for those.
    pub(crate) fn relative_scale(&self, graph: &mut Graph) -> ExprId {
        self.scale_length(graph, 1.0)
    }

    /// A length of the mechanism, longer by as much as the loops are larger.
    fn scale_length(&self, graph: &mut Graph, length: f64) -> ExprId {
        if self.nominal == 0.0 {
            return rounded_number(graph, length);
        }
        let share = rounded_number(graph, length / self.nominal);
        graph.mul(share, self.total)
    }

    /// The sum of the magnitudes of all terms of an expression that depends on the pose: for any lengths, with sines and
    /// cosines of 1 and slides as far out as at the nominal pose. Fractions have the values of the nominal pose, and grow
    /// with the loops.
    pub(crate) fn term_magnitude(
        &self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        id: ExprId,
    ) -> ExprId {
        let found = expression_magnitude(graph, mechanism, &mut HashMap::new(), id);
        let out = nominal_lengths(graph, mechanism, |graph, nominal| {
            self.scale_length(graph, nominal)
        });
        let at_any_pose = graph.substitute(&[found], &out)[0];
        let is_known = graph.atoms(&[at_any_pose]).into_iter().all(Atom::is_fixed);
        let is_there = nominal_value(graph, mechanism, at_any_pose).is_some_and(f64::is_normal);
        if is_known && is_there {
            return at_any_pose;
        }
        let nominal = nominal_magnitude(graph, mechanism, &[id]);
        let nominal = rounded_number(graph, nominal);
        // Its own lengths say how large it is: drives between points have some without a loop.
        let lengths: Vec<Atom> = graph.atoms(&[found]).into_iter().collect();
        let is_metre =
            |atom: &Atom| matches!(atom, Atom::Constant(i) if mechanism.constants[*i].unit == "m");
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

    /// What a determinant is held against: the sum of the magnitudes of its terms, as [`LoopSize::term_magnitude`] has it. Where the
    /// nominal pose itself would all but count as singular by that, since the terms cancel in every factor and at every pose,
    /// it is what rounding says that counts, which grows with the loops. What is below `singular` of its size counts as zero.
    pub(crate) fn determinant_magnitude(
        &self,
        graph: &mut Graph,
        mechanism: &Mechanism,
        id: ExprId,
        singular: f64,
    ) -> ExprId {
        /// Determinants become smaller by this from pose to pose before they are singular.
        const ROOM: f64 = 1e3;
        let terms = self.term_magnitude(graph, mechanism, id);
        let at_nominal = |graph: &Graph, id| nominal_value(graph, mechanism, id).map(f64::abs);
        let (Some(value), Some(size)) = (at_nominal(graph, id), at_nominal(graph, terms)) else {
            return terms;
        };
        if value > ROOM * singular * size {
            return terms;
        }
        match significant_digits(graph, mechanism, id) {
            Some(left) if left > value / size => {
                let share = rounded_number(graph, value / left / size);
                graph.mul(share, terms)
            }
            _ => terms,
        }
    }

    /// The size that some constants make up, if they do.
    fn from_constants(
        graph: &mut Graph,
        mechanism: &Mechanism,
        constants: &[Atom],
    ) -> Option<Self> {
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

/// The power of the unit of length with which an expression grows, if it does so with one: `lengths` are those of its
/// constants that are in it, besides the coordinates that slide.
fn length_degree(
    graph: &Graph,
    mechanism: &Mechanism,
    id: ExprId,
    lengths: &[Atom],
) -> Option<i32> {
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
    let [one, two, four] = [value(1.0)?, value(2.0)?, value(4.0)?];
    let degree = (two - one).round();
    let is_power = [two - one, four - two]
        .iter()
        .all(|d| (d - degree).abs() < 1e-6);
    #[allow(clippy::cast_possible_truncation, reason = "it is small, as just seen")]
    (is_power && degree.abs() < 100.0).then_some(degree as i32)
}

/// What stands for each coordinate that is a length, by its nominal value in m.
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

/// A number that is exact to rounding.
fn rounded_number(graph: &mut Graph, value: f64) -> ExprId {
    let value = BigRational::from_float(value).unwrap_or_else(BigRational::one);
    graph.rational(value.into())
}

/// An expression with every term taken by its magnitude.
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
        Node::Sin(_)
        | Node::Cos(_)
        | Node::Unary(Unary::Sign | Unary::Tanh | Unary::Sin | Unary::Cos, _) => Graph::ONE,
        // An angle that stands for itself; its turns are known to Newton's method. Or a component of a unit quaternion.
        Node::Atom(Atom::Coordinate(i)) if !mechanism.coordinates[i].motion.is_length() => {
            Graph::ONE
        }
        Node::Atom(_) | Node::Unary(Unary::Exp, _) => graph.unary(Unary::Abs, id),
        Node::Unary(Unary::Abs, inner) => expression_magnitude(graph, mechanism, known, inner),
        Node::Unary(Unary::Sqrt, inner) => {
            let inner = expression_magnitude(graph, mechanism, known, inner);
            graph.unary(Unary::Sqrt, inner)
        }
        Node::Sum(terms) => {
            let terms: Vec<_> = terms
                .into_iter()
                .map(|(term, factor)| {
                    (
                        expression_magnitude(graph, mechanism, known, term),
                        factor.abs(),
                    )
                })
                .collect();
            graph.sum(&terms)
        }
        Node::Product(factors) => {
            let factors: Vec<_> = factors
                .into_iter()
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
