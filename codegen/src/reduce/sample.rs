//! Random points of a mechanism's motion in the prime field: poses, drawn again until all their square roots exist, with
//! rates and accelerations from the differentiated loops.
//!
//! Which coordinates are drawn freely does not matter for linear dependence, so those are drawn that make every loop
//! a dyad. It matters that the poses make up one irreducible variety, the one that the nominal pose lies on; see
//! [`crate::loops::branches`].
//!
//! Decision: rows are drawn until two points in a row add nothing, and not in a fixed number. On one irreducible
//! variety a random point either adds a new equation or there is none left, with an error probability of 2^-55.

use modelmill_algebra::eliminate::Echelon;
use modelmill_algebra::field::{Element, Extended, Number, Stream};
use modelmill_spec::Mechanism;

use crate::DeriveError;
use crate::expr::independent::IDLE;
use crate::expr::{Atom, ExprId, FieldPoint, Graph, Node, Tape, Unary};
use crate::loops::branches::{self, Branch};
use crate::loops::field_poses::{FieldPoses, MOST_DRAWS};
use crate::loops::plan::{Unknowns, plan};
use crate::regressor::projection::Projection;

/// The same where signs occur, which take only two values: that two of them agree by chance at all points must be out of
/// the question.
const IDLE_WITH_SIGNS: usize = 80;

/// Draws points.
pub(super) struct Sampler {
    poses: FieldPoses,
    n_drives: usize,
    /// Whether poses or outputs take roots of what moves.
    has_roots: bool,
    active: Vec<usize>,
    passive: Vec<usize>,
    rates: Tape,
    accelerations: Tape,
    outputs: Tape,
}

impl Sampler {
    /// Prepares the evaluation of `outputs` at random points of the mechanism's motion.
    pub(super) fn new(
        graph: &mut Graph,
        mechanism: &Mechanism,
        projection: &Projection,
        outputs: &[ExprId],
    ) -> Result<Self, DeriveError> {
        let loops = || {
            projection
                .loops
                .closures
                .iter()
                .map(|c| c.name.clone())
                .collect()
        };
        let plan = plan(graph, mechanism, &projection.loops, Unknowns::Any)
            .ok_or_else(|| DeriveError::LoopsNotSampled { loops: loops() })?;
        let mut all = outputs.to_vec();
        all.extend(&projection.passive_rates);
        all.extend(&projection.passive_accelerations);
        let poses = FieldPoses::new(graph, mechanism, plan, &all);
        let branches = branches::branches(graph, &poses, &all)?;
        if branches
            .iter()
            .any(|branch| matches!(branch, Branch::Multiple | Branch::Bound))
        {
            return Err(DeriveError::BranchesNotSeparated { loops: loops() });
        }
        Ok(Self {
            poses,
            has_roots: !branches.is_empty(),
            n_drives: mechanism.drives.len(),
            active: projection.loops.active.clone(),
            passive: projection.loops.passive.clone(),
            rates: Tape::new(graph, &projection.passive_rates),
            accelerations: Tape::new(graph, &projection.passive_accelerations),
            outputs: Tape::new(graph, outputs),
        })
    }

    /// Random constants whose functions that do not depend on the motion all exist.
    pub(super) fn constants<const P: u64>(
        &self,
        stream: &mut Stream,
    ) -> Result<FieldPoint<Element<P>>, DeriveError> {
        self.poses.constants(stream)
    }

    /// Values of the outputs at a random point of motion, for the given constants: once, or once for each of the two
    /// parts of numbers of the quadratic extension. Factors that do not depend on the motion lie in the prime field, so
    /// that each part keeps to the same linear relations.
    pub(super) fn draw<const P: u64>(
        &self,
        constants: &FieldPoint<Element<P>>,
        stream: &mut Stream,
    ) -> Result<Vec<Element<P>>, DeriveError> {
        let none = || DeriveError::NoPointFound { draws: MOST_DRAWS };
        if !self.has_roots {
            return (0..MOST_DRAWS)
                .find_map(|_| self.try_draw::<P, Element<P>>(constants, stream))
                .ok_or_else(none);
        }
        let values = (0..MOST_DRAWS)
            .find_map(|_| self.try_draw::<P, Extended<P>>(constants, stream))
            .ok_or_else(none)?;
        let parts: [fn(&Extended<P>) -> Element<P>; 2] = [|x| x.re, |x| x.im];
        let is_split = values.iter().any(|x| x.im != Element::ZERO);
        let shown = &parts[..=usize::from(is_split)];
        Ok(shown
            .iter()
            .flat_map(|part| values.iter().map(part))
            .collect())
    }

    fn try_draw<const P: u64, N: Number + From<Element<P>>>(
        &self,
        constants: &FieldPoint<Element<P>>,
        stream: &mut Stream,
    ) -> Option<Vec<N>> {
        let mut point: FieldPoint<N> = self.poses.open(constants, stream);
        let mut draw = |atom: Atom| point.values.insert(atom, N::draw(stream));
        for a in &self.active {
            draw(Atom::Rate(*a));
            draw(Atom::Acceleration(*a));
        }
        for d in 0..self.n_drives {
            draw(Atom::Load(d));
        }
        let mut point = self.poses.close(point)?;
        for (p, value) in self.passive.iter().zip(self.rates.evaluate(&point)?) {
            point.values.insert(Atom::Rate(*p), value);
        }
        for (p, value) in self
            .passive
            .iter()
            .zip(self.accelerations.evaluate(&point)?)
        {
            point.values.insert(Atom::Acceleration(*p), value);
        }
        self.outputs.evaluate(&point)
    }
}

/// The regressor's effective columns at random points of motion.
pub(super) struct SampledRegressor {
    pub(super) sampler: Sampler,
    pub(super) n_columns: usize,
    /// How many points in a row must show nothing new.
    idle: usize,
}

impl SampledRegressor {
    /// The rows of H at one random point.
    pub(super) fn point<const P: u64>(
        &self,
        constants: &FieldPoint<Element<P>>,
        stream: &mut Stream,
    ) -> Result<Vec<Vec<Element<P>>>, DeriveError> {
        let values = self.sampler.draw(constants, stream)?;
        Ok(values
            .chunks(self.n_columns.max(1))
            .map(<[Element<P>]>::to_vec)
            .collect())
    }

    /// Rows of W for one set of constants, reduced, until they show nothing new or `rank` is reached; and from how many
    /// points they came.
    pub(super) fn echelon<const P: u64>(
        &self,
        constants: &FieldPoint<Element<P>>,
        order: &[usize],
        rank: Option<usize>,
        stream: &mut Stream,
    ) -> Result<(Echelon<P>, usize), DeriveError> {
        let mut echelon = Echelon::new(order);
        let (mut idle, mut n_points) = (0, 0);
        while self.n_columns > 0 && idle < self.idle && Some(echelon.pivots.len()) != rank {
            idle += 1;
            n_points += 1;
            for row in self.point(constants, stream)? {
                if echelon.insert(row) {
                    idle = 0;
                }
            }
        }
        Ok((echelon, n_points))
    }
}

/// Prepares the evaluation of so many columns, drive by drive.
pub(super) fn sampled(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &Projection,
    outputs: &[ExprId],
    n_columns: usize,
) -> Result<SampledRegressor, DeriveError> {
    Ok(SampledRegressor {
        sampler: Sampler::new(graph, mechanism, projection, outputs)?,
        n_columns,
        idle: if has_sign(graph, outputs) {
            IDLE_WITH_SIGNS
        } else {
            IDLE
        },
    })
}

fn has_sign(graph: &Graph, outputs: &[ExprId]) -> bool {
    graph
        .nodes_of(outputs)
        .any(|node| matches!(node, Node::Unary(Unary::Sign | Unary::Abs, _)))
}
