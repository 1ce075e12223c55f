//! Poses in floating point: loops closed by Newton's method from the nominal pose.
//!
//! Decision: what the prime field states about loops is checked in floating point on the branch of the nominal
//! pose, because machines live on that branch only. `nalgebra` is a dependency of this crate for the linear solver
//! with pivoting in these Newton steps.

use modelmill_algebra::field::Stream;
use modelmill_spec::Mechanism;
use nalgebra::{DMatrix, DVector};

use crate::expr::{Atom, ExprId, F64, Graph, Tape};
use crate::loops::magnitude;

/// Residuals of loops with their derivatives by the coordinates that close them.
pub(crate) struct NumericLoops<'a> {
    mechanism: &'a Mechanism,
    /// Coordinates that the loops are solved for.
    unknown: Vec<usize>,
    /// Coordinates that are moved, with the length in m or the angle in rad that counts as one there.
    moved: Vec<(usize, f64)>,
    n_residuals: usize,
    /// What one is for each unknown: 1 rad, or the size of the loops in m.
    scales: Vec<f64>,
    tape: Tape,
}

impl<'a> NumericLoops<'a> {
    /// All loops of a mechanism, solved for its passive coordinates.
    pub(crate) fn new(graph: &mut Graph, mechanism: &'a Mechanism, residual: &[ExprId]) -> Self {
        let (unknown, moved): (Vec<usize>, Vec<usize>) =
            (0..mechanism.coordinates.len()).partition(|i| mechanism.coordinates[*i].passive);
        Self::solved_for(graph, mechanism, residual, unknown, &moved)
    }

    /// Some loops, solved for `unknown` while the coordinates `moved` are given.
    pub(crate) fn solved_for(
        graph: &mut Graph,
        mechanism: &'a Mechanism,
        residual: &[ExprId],
        unknown: Vec<usize>,
        moved: &[usize],
    ) -> Self {
        let size = magnitude::at_nominal(graph, mechanism, residual);
        let one = |i: usize| {
            if mechanism.coordinates[i].motion.is_angle() {
                1.0
            } else {
                size
            }
        };
        let mut roots = residual.to_vec();
        for p in &unknown {
            roots.extend(graph.differentiate(residual, Atom::Coordinate(*p)));
        }
        Self {
            mechanism,
            scales: unknown.iter().map(|i| one(*i)).collect(),
            unknown,
            moved: moved.iter().map(|i| (*i, one(*i))).collect(),
            n_residuals: residual.len(),
            tape: Tape::new(graph, &roots),
        }
    }

    /// Coordinates of the nominal pose with the loops closed to rounding.
    pub(crate) fn nominal(&self) -> Option<Vec<f64>> {
        let mut q = self.as_written();
        self.close(&mut q)?;
        Some(q)
    }

    /// Coordinates of the nominal pose as the model file has them, loops closed by its reader.
    pub(crate) fn as_written(&self) -> Vec<f64> {
        let coordinates = self.mechanism.coordinates.iter();
        coordinates.map(|c| c.nominal).collect()
    }

    /// What counts as one for each coordinate: 1 rad, the size of the loops in m, or 1 m where no loop sets a size.
    pub(crate) fn unit(&self, coordinate: usize) -> f64 {
        let moved = self.moved.iter().copied();
        let unknown = self
            .unknown
            .iter()
            .copied()
            .zip(self.scales.iter().copied());
        moved
            .chain(unknown)
            .find_map(|(i, one)| (i == coordinate).then_some(one))
            .unwrap_or(1.0)
    }

    /// A pose whose moved coordinates lie within `reach` (angles in rad, lengths relative to the size of the loops) of
    /// the nominal one, followed from there; `None` if the loops cannot be followed so far.
    pub(crate) fn random(&self, reach: f64, stream: &mut Stream) -> Option<Vec<f64>> {
        const STEPS: u32 = 8;
        let mut q = self.as_written();
        let moves: Vec<(usize, f64)> = self
            .moved
            .iter()
            .map(|(i, one)| (*i, one * reach * symmetric(stream) / f64::from(STEPS)))
            .collect();
        for _ in 0..STEPS {
            for (i, dx) in &moves {
                q[*i] += dx;
            }
            self.close(&mut q)?;
        }
        Some(q)
    }

    /// Residuals, and their derivatives by the unknown coordinates, one column each.
    pub(crate) fn linearise(&self, q: &[f64]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let value = |atom: Atom| match atom {
            Atom::Constant(i) => self.mechanism.constants[i].value,
            Atom::Coordinate(i) => q[i],
            Atom::Pi => std::f64::consts::PI,
            _ => 0.0,
        };
        let values = self.tape.evaluate(&F64(value))?;
        // A singular value decomposition of what are no numbers comes to no end.
        if !values.iter().all(|x| x.is_finite()) {
            return None;
        }
        let (residual, jacobian) = values.split_at(self.n_residuals);
        Some((
            DVector::from_column_slice(residual),
            DMatrix::from_column_slice(self.n_residuals, self.unknown.len(), jacobian),
        ))
    }

    /// Whether the loops determine the unknown coordinates at a pose.
    pub(crate) fn is_regular(&self, q: &[f64]) -> bool {
        const SINGULAR: f64 = 1e-9;
        let Some((_, mut jacobian)) = self.linearise(q) else {
            return false;
        };
        for (mut column, one) in jacobian.column_iter_mut().zip(&self.scales) {
            column *= *one;
        }
        let values = jacobian.svd(false, false).singular_values;
        values.len() == self.unknown.len() && values.min() > SINGULAR * values.max()
    }

    /// Closes the loops by moving the unknown coordinates.
    fn close(&self, q: &mut [f64]) -> Option<()> {
        if self.unknown.is_empty() {
            return Some(());
        }
        for _ in 0..30 {
            let (residual, mut jacobian) = self.linearise(q)?;
            for (mut column, one) in jacobian.column_iter_mut().zip(&self.scales) {
                column *= *one;
            }
            let svd = jacobian.svd(true, true);
            let smallest = 1e-12 * svd.singular_values.amax();
            let step = svd.solve(&residual, smallest).ok()?;
            for ((p, one), dx) in self.unknown.iter().zip(&self.scales).zip(step.iter()) {
                q[*p] -= one * dx;
            }
            if step.amax() < 1e-13 {
                return Some(());
            }
        }
        None
    }
}

/// A number between -1 and 1.
pub(crate) fn symmetric(stream: &mut Stream) -> f64 {
    2.0 * (stream.bits() as f64 / u64::MAX as f64) - 1.0
}
