//! Random points of a mechanism's motion in the prime field. Poses are drawn until all their square roots exist. Rates
//! and accelerations are those of the differentiated loops.
//!
//! For linear dependence it does not matter which coordinates are drawn and which are solved for. So coordinates are
//! chosen such that every loop is a dyad. The poses must make up one irreducible variety, the one that contains the
//! nominal pose; see [`crate::loops::branches`].
//!
//! Decision: rows are drawn until two points in a row add nothing, instead of in a fixed number. On one irreducible
//! variety a random point either adds a new equation or there is none, with an error probability of 2^-55.

use modelmill_algebra::eliminate::RowEchelonForm;
use modelmill_algebra::field::{ExtensionElement, FieldElement, FieldNumber, RandomStream};
use modelmill_spec::Mechanism;

use crate::DeriveError;
use crate::expr::independent::IDLE;
use crate::expr::{Atom, EvaluationTape, ExprId, FieldPoint, Graph, Node, Unary};
use crate::loops::branches::{self, RootBranch};
use crate::loops::field_poses::{FieldPoseSampler, MOST_DRAWS};
use crate::loops::plan::{SolvableCoordinates, plan};
use crate::regressor::projection::LoopProjection;

/// The same as [`IDLE`] where signs occur. A sign has only two values, so two of them agree by chance at single points,
/// but not at all of these.
const IDLE_WITH_SIGNS: usize = 80;

/// Evaluates outputs at random points of the motion.
pub(super) struct MotionSampler {
    /// Poses with closed loops.
    poses: FieldPoseSampler,
    /// Number of drives, whose loads are drawn as well.
    n_drives: usize,
    /// Whether poses or outputs contain square roots of coordinates.
    has_roots: bool,
    /// Indices of the active coordinates, whose rates and accelerations are drawn.
    active: Vec<usize>,
    /// Indices of the passive coordinates.
    passive: Vec<usize>,
    /// Rates of the passive coordinates.
    rates: EvaluationTape,
    /// Accelerations of the passive coordinates.
    accelerations: EvaluationTape,
    /// The expressions that are evaluated.
    outputs: EvaluationTape,
}

impl MotionSampler {
    /// Prepares the evaluation of `outputs` at random points of the mechanism's motion.
    ///
    /// # Errors
    /// [`DeriveError::LoopsNotSampled`] if there is no plan for the loops, [`DeriveError::BranchesNotSeparated`] if a
    /// root's sign is determined by the motion.
    pub(super) fn new(
        graph: &mut Graph,
        mechanism: &Mechanism,
        projection: &LoopProjection,
        outputs: &[ExprId],
    ) -> Result<Self, DeriveError> {
        let loops = || projection.loops.closures.iter().map(|c| c.name.clone()).collect();
        let plan = plan(graph, mechanism, &projection.loops, SolvableCoordinates::Any)
            .ok_or_else(|| DeriveError::LoopsNotSampled { loops: loops() })?;
        // Passive rates and accelerations are needed at every point, so their roots must exist too.
        let mut all = outputs.to_vec();
        all.extend(&projection.passive_rates);
        all.extend(&projection.passive_accelerations);
        let poses = FieldPoseSampler::new(graph, mechanism, plan, &all);
        // Every root must have a free sign, or equal an earlier root.
        let branches = branches::root_branches(graph, &poses, &all)?;
        if branches
            .iter()
            .any(|branch| matches!(branch, RootBranch::Multiple | RootBranch::Bound))
        {
            return Err(DeriveError::BranchesNotSeparated { loops: loops() });
        }
        Ok(Self {
            poses,
            has_roots: !branches.is_empty(),
            n_drives: mechanism.drives.len(),
            active: projection.loops.active.clone(),
            passive: projection.loops.passive.clone(),
            rates: EvaluationTape::new(graph, &projection.passive_rates),
            accelerations: EvaluationTape::new(graph, &projection.passive_accelerations),
            outputs: EvaluationTape::new(graph, outputs),
        })
    }

    /// Random constants at which all functions of constants exist.
    pub(super) fn constants<const P: u64>(
        &self,
        stream: &mut RandomStream,
    ) -> Result<FieldPoint<FieldElement<P>>, DeriveError> {
        self.poses.draw_constants(stream)
    }

    /// Values of the outputs at a random point of motion, for the given constants. If they lie in the quadratic
    /// extension, both parts of the numbers are returned, one after the other. Factors that do not depend on the motion
    /// lie in the prime field, so each part satisfies the same linear relations.
    pub(super) fn draw<const P: u64>(
        &self,
        constants: &FieldPoint<FieldElement<P>>,
        stream: &mut RandomStream,
    ) -> Result<Vec<FieldElement<P>>, DeriveError> {
        self.draw_of(&self.outputs, constants, stream)
    }

    /// The same for a part of the outputs.
    fn draw_of<const P: u64>(
        &self,
        outputs: &EvaluationTape,
        constants: &FieldPoint<FieldElement<P>>,
        stream: &mut RandomStream,
    ) -> Result<Vec<FieldElement<P>>, DeriveError> {
        let none = || DeriveError::NoPointFound { draws: MOST_DRAWS };
        // Without roots all values lie in the prime field.
        if !self.has_roots {
            return (0..MOST_DRAWS)
                .find_map(|_| self.try_draw::<P, FieldElement<P>>(outputs, constants, stream))
                .ok_or_else(none);
        }
        let values = (0..MOST_DRAWS)
            .find_map(|_| self.try_draw::<P, ExtensionElement<P>>(outputs, constants, stream))
            .ok_or_else(none)?;
        // The imaginary parts are returned only if one of them is not zero.
        let parts: [fn(&ExtensionElement<P>) -> FieldElement<P>; 2] = [|x| x.re, |x| x.im];
        let is_split = values.iter().any(|x| x.im != FieldElement::ZERO);
        let shown = &parts[..=usize::from(is_split)];
        Ok(shown.iter().flat_map(|part| values.iter().map(part)).collect())
    }

    /// Values of the outputs at one draw; `None` if a root or a quotient does not exist there.
    fn try_draw<const P: u64, N: FieldNumber + From<FieldElement<P>>>(
        &self,
        outputs: &EvaluationTape,
        constants: &FieldPoint<FieldElement<P>>,
        stream: &mut RandomStream,
    ) -> Option<Vec<N>> {
        let mut point: FieldPoint<N> = self.poses.draw_open_point(constants, stream);
        // Rates, accelerations and loads are independent of each other.
        let mut draw = |atom: Atom| point.values.insert(atom, N::draw(stream));
        for a in &self.active {
            draw(Atom::Rate(*a));
            draw(Atom::Acceleration(*a));
        }
        for d in 0..self.n_drives {
            draw(Atom::Load(d));
        }
        // The loops determine the passive coordinates, then their rates, then their accelerations.
        let mut point = self.poses.close_loops(point)?;
        for (p, value) in self.passive.iter().zip(self.rates.evaluate(&point)?) {
            point.values.insert(Atom::Rate(*p), value);
        }
        for (p, value) in self.passive.iter().zip(self.accelerations.evaluate(&point)?) {
            point.values.insert(Atom::Acceleration(*p), value);
        }
        outputs.evaluate(&point)
    }
}

/// The regressor's effective columns at random points of motion.
pub(super) struct SampledRegressor {
    /// Evaluates the columns, drive by drive.
    pub(super) sampler: MotionSampler,
    /// Number of columns.
    pub(super) n_columns: usize,
    /// Number of points in a row that must add no new row before sampling ends.
    idle: usize,
}

impl SampledRegressor {
    /// What evaluates some columns only.
    pub(super) fn evaluation_of(&self, columns: &[usize]) -> ColumnEvaluation {
        let drives = 0..self.sampler.n_drives;
        let outputs: Vec<usize> = drives
            .flat_map(|drive| columns.iter().map(move |column| drive * self.n_columns + column))
            .collect();
        ColumnEvaluation {
            tape: self.sampler.outputs.restricted_to(&outputs),
            n_columns: columns.len(),
        }
    }

    /// Rows of H at one random point, with some columns only.
    pub(super) fn draw_rows_of<const P: u64>(
        &self,
        evaluation: &ColumnEvaluation,
        constants: &FieldPoint<FieldElement<P>>,
        stream: &mut RandomStream,
    ) -> Result<Vec<Vec<FieldElement<P>>>, DeriveError> {
        let values = self.sampler.draw_of(&evaluation.tape, constants, stream)?;
        let rows = values.chunks(evaluation.n_columns.max(1));
        Ok(rows.map(<[FieldElement<P>]>::to_vec).collect())
    }

    /// The rows of H at one random point, one per drive and part of the numbers.
    pub(super) fn draw_rows<const P: u64>(
        &self,
        constants: &FieldPoint<FieldElement<P>>,
        stream: &mut RandomStream,
    ) -> Result<Vec<Vec<FieldElement<P>>>, DeriveError> {
        let values = self.sampler.draw(constants, stream)?;
        Ok(values
            .chunks(self.n_columns.max(1))
            .map(<[FieldElement<P>]>::to_vec)
            .collect())
    }

    /// Rows of W for one set of constants in echelon form, until points add nothing new or `rank` is reached, and the
    /// number of points that they come from. Columns are tried as pivots in `order`.
    pub(super) fn reduced_rows<const P: u64>(
        &self,
        constants: &FieldPoint<FieldElement<P>>,
        order: &[usize],
        rank: Option<usize>,
        stream: &mut RandomStream,
    ) -> Result<(RowEchelonForm<P>, usize), DeriveError> {
        let mut echelon = RowEchelonForm::new(order);
        let (mut idle, mut n_points) = (0, 0);
        while self.n_columns > 0 && idle < self.idle && Some(echelon.pivots.len()) != rank {
            idle += 1;
            n_points += 1;
            for row in self.draw_rows(constants, stream)? {
                if echelon.insert(row) {
                    idle = 0;
                }
            }
        }
        Ok((echelon, n_points))
    }
}

/// Evaluates some of a regressor's columns, drive by drive.
pub(super) struct ColumnEvaluation {
    /// What the columns need.
    tape: EvaluationTape,
    /// Number of these columns.
    n_columns: usize,
}

/// Prepares the evaluation of `n_columns` columns, given drive by drive.
pub(super) fn sample_regressor(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &LoopProjection,
    outputs: &[ExprId],
    n_columns: usize,
) -> Result<SampledRegressor, DeriveError> {
    Ok(SampledRegressor {
        sampler: MotionSampler::new(graph, mechanism, projection, outputs)?,
        n_columns,
        idle: if has_sign(graph, outputs) {
            IDLE_WITH_SIGNS
        } else {
            IDLE
        },
    })
}

/// Whether outputs contain signs or absolute values.
fn has_sign(graph: &Graph, outputs: &[ExprId]) -> bool {
    graph
        .nodes_of(outputs)
        .any(|node| matches!(node, Node::Unary(Unary::Sign | Unary::Abs, _)))
}
