//! Random points of a mechanism's motion in the prime field: poses, drawn again until all their square roots exist, with
//! rates and accelerations from the differentiated loops.
//!
//! Which coordinates are drawn freely does not matter for linear dependence, so those are drawn that make every loop
//! a dyad. It matters that the poses make up one irreducible variety, the one that the nominal pose lies on; see
//! [`super::branches`].

use modelmill_spec::Mechanism;

use super::branches::{self, Branch};
use super::plan::{Unknowns, plan};
use super::poses::{MOST_DRAWS, Poses};
use crate::DeriveError;
use crate::expr::{Atom, ExprId, FieldPoint, Graph, Tape};
use crate::field::{Element, Stream};
use crate::projection::Projection;

/// Draws points.
pub(super) struct Sampler {
    poses: Poses,
    n_drives: usize,
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
        let loops = || projection.closures.iter().map(|c| c.name.clone()).collect();
        let plan = plan(graph, mechanism, projection, Unknowns::Any)
            .ok_or_else(|| DeriveError::LoopsNotSampled { loops: loops() })?;
        let mut all = outputs.to_vec();
        all.extend(&projection.passive_rates);
        all.extend(&projection.passive_accelerations);
        let poses = Poses::new(graph, mechanism, plan, &all);
        let branches = branches::of(graph, &poses, &all)?;
        if branches
            .iter()
            .any(|branch| matches!(branch, Branch::Multiple | Branch::Bound))
        {
            return Err(DeriveError::BranchesNotSeparated { loops: loops() });
        }
        Ok(Self {
            poses,
            n_drives: mechanism.drives.len(),
            active: projection.active.clone(),
            passive: projection.passive.clone(),
            rates: Tape::new(graph, &projection.passive_rates),
            accelerations: Tape::new(graph, &projection.passive_accelerations),
            outputs: Tape::new(graph, outputs),
        })
    }

    /// Random constants whose functions that do not depend on the motion all exist.
    pub(super) fn constants<const P: u64>(
        &self,
        stream: &mut Stream,
    ) -> Result<FieldPoint<P>, DeriveError> {
        self.poses.constants(stream)
    }

    /// Values of the outputs at a random point of motion, for the given constants.
    pub(super) fn draw<const P: u64>(
        &self,
        constants: &FieldPoint<P>,
        stream: &mut Stream,
    ) -> Result<Vec<Element<P>>, DeriveError> {
        (0..MOST_DRAWS)
            .find_map(|_| self.try_draw(constants, stream))
            .ok_or(DeriveError::NoPointFound { draws: MOST_DRAWS })
    }

    fn try_draw<const P: u64>(
        &self,
        constants: &FieldPoint<P>,
        stream: &mut Stream,
    ) -> Option<Vec<Element<P>>> {
        let mut point = self.poses.open(constants, stream);
        for a in &self.active {
            point.values.insert(Atom::Rate(*a), stream.element());
            point
                .values
                .insert(Atom::Acceleration(*a), stream.element());
        }
        for d in 0..self.n_drives {
            point.values.insert(Atom::Load(d), stream.element());
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
