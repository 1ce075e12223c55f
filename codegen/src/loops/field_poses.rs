//! Random poses of a mechanism in the prime field: angles are rational points of the circle, and loops are solved by
//! square roots in the field.

use modelmill_algebra::field::{FieldElement, FieldNumber, RandomStream};
use modelmill_spec::Mechanism;

use super::solve_step::{FieldSolveStep, LoopPlan};
use crate::DeriveError;
use crate::expr::{Atom, EvaluationDomain, EvaluationTape, ExprId, FieldPoint, Graph, Node, Rational, Unary};

/// Largest number of draws until all square roots exist.
pub(crate) const MOST_DRAWS: usize = 4000;

/// Draws random poses and closes their loops by the steps of a plan.
pub(crate) struct FieldPoseSampler {
    /// Index of every coordinate, and whether it is an angle.
    coordinates: Vec<(usize, bool)>,
    /// Number of constants of the mechanism.
    n_constants: usize,
    /// Functions of constants that do not exist for all constants of the field, such as square roots and quotients.
    of_constants: EvaluationTape,
    /// The steps that close the loops.
    pub(crate) steps: Vec<FieldSolveStep>,
    /// Angles that are drawn in parts, with the number of parts.
    divided: Vec<(usize, i64)>,
}

impl FieldPoseSampler {
    /// Makes a plan evaluable, for constants at which `outputs` exist as well.
    pub(crate) fn new(graph: &mut Graph, mechanism: &Mechanism, plan: LoopPlan, outputs: &[ExprId]) -> Self {
        let mut all = outputs.to_vec();
        let steps = plan
            .steps
            .into_iter()
            .map(|step| FieldSolveStep::new(graph, step, &mut all))
            .collect();
        let coordinates = mechanism.coordinates.iter().enumerate();
        Self {
            coordinates: coordinates.map(|(i, c)| (i, c.motion.is_angle())).collect(),
            n_constants: mechanism.constants.len(),
            of_constants: partial_constant_functions(graph, &all),
            steps,
            divided: plan.divided,
        }
    }

    /// Random constants at which all functions of constants exist.
    ///
    /// # Errors
    /// [`DeriveError::NoPointFound`] after [`MOST_DRAWS`] draws.
    pub(crate) fn draw_constants<const P: u64>(
        &self,
        stream: &mut RandomStream,
    ) -> Result<FieldPoint<FieldElement<P>>, DeriveError> {
        (0..MOST_DRAWS)
            .find_map(|_| {
                let mut point = FieldPoint {
                    seed: stream.next_bits(),
                    root_seed: stream.next_bits(),
                    ..FieldPoint::default()
                };
                point.values.insert(Atom::Pi, stream.next_element());
                for i in 0..self.n_constants {
                    let atom = Atom::Constant(i);
                    point.values.insert(atom, stream.next_element());
                    point.angles.insert(atom, stream.next_circle_point());
                }
                self.of_constants.evaluate(&point).map(|_| point)
            })
            .ok_or(DeriveError::NoPointFound { draws: MOST_DRAWS })
    }

    /// Random values of all coordinates; the loops are still open. The values lie in the prime field, whichever field
    /// the loops are closed in.
    pub(crate) fn draw_open_point<const P: u64, N: FieldNumber + From<FieldElement<P>>>(
        &self,
        constants: &FieldPoint<FieldElement<P>>,
        stream: &mut RandomStream,
    ) -> FieldPoint<N> {
        let mut point = constants.over_field();
        for (i, is_angle) in &self.coordinates {
            if *is_angle {
                let angle = N::draw_circle(stream);
                point.angles.insert(Atom::Coordinate(*i), angle);
            }
            point.values.insert(Atom::Coordinate(*i), N::draw(stream));
        }
        // Divided angles are multiples of an opaque part, so that other angles can be fractions of them.
        for (i, n) in &self.divided {
            if let Some(turn) = divided_angle(&point, *i, *n) {
                point.angles.insert(Atom::Coordinate(*i), turn);
            }
        }
        point
    }

    /// Closes the loops of a point; `None` if they cannot close for its independent coordinates.
    pub(crate) fn close_loops<N: FieldNumber>(&self, mut point: FieldPoint<N>) -> Option<FieldPoint<N>> {
        for step in &self.steps {
            step.solve(&mut point)?;
        }
        Some(point)
    }
}

/// Cosine and sine of a coordinate as `n` times the opaque angle that is its `n`-th part.
fn divided_angle<N: FieldNumber>(point: &FieldPoint<N>, coordinate: usize, n: i64) -> Option<(N, N)> {
    let value = point.atom(Atom::Coordinate(coordinate))?;
    let part = value * point.rational(&Rational::new(1, n))?;
    let mut power = (point.unary(Unary::Cos, &part)?, point.unary(Unary::Sin, &part)?);
    // Addition theorem of two angles.
    let turned = |(a, b): (N, N), (c, s): (N, N)| (a * c - b * s, a * s + b * c);
    // Repeated squaring over the binary digits of n.
    let (mut total, mut left) = ((N::ONE, N::ZERO), n);
    while left > 0 {
        if left % 2 == 1 {
            total = turned(total, power);
        }
        power = turned(power, power);
        left /= 2;
    }
    Some(total)
}

/// Functions in `roots` that depend on constants alone and do not exist for all constants of the field.
fn partial_constant_functions(graph: &Graph, roots: &[ExprId]) -> EvaluationTape {
    // Per node whether it depends on anything but constants.
    let mut moves = vec![false; graph.len()];
    let mut found = Vec::new();
    for (i, needed) in graph.reachable(roots).into_iter().enumerate() {
        if !needed {
            continue;
        }
        let id = ExprId(u32::try_from(i).expect("graph below 4G nodes"));
        let is_fixed = |atom: Atom| matches!(atom, Atom::Constant(_) | Atom::Pi);
        let mut moving = match graph.node(id) {
            Node::Atom(atom) => !is_fixed(*atom),
            Node::Sin(angle) | Node::Cos(angle) => !angle.atoms().all(is_fixed),
            _ => false,
        };
        graph.for_each_child(id, |child| moving |= moves[child.index()]);
        moves[i] = moving;
        // Square roots and divisions need not exist.
        let partial = match graph.node(id) {
            Node::Unary(function, _) => *function == Unary::Sqrt,
            Node::Product(factors) => factors.iter().any(|(_, n)| *n < 0),
            _ => false,
        };
        if partial && !moving {
            found.push(id);
        }
    }
    EvaluationTape::new(graph, &found)
}
