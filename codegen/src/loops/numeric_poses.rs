//! Poses in floating point: loops closed by Newton's method from the nominal pose.
//!
//! Decision: what the prime field states about loops is checked in floating point on the branch of the nominal
//! pose, because machines live on that branch only. `nalgebra` is a dependency of this crate for the linear solver
//! with pivoting in these Newton steps.

use modelmill_algebra::field::RandomStream;
use modelmill_spec::Mechanism;
use nalgebra::{DMatrix, DVector};

use crate::expr::{Atom, EvaluationTape, ExprId, FloatDomain, Graph};
use crate::loops::magnitude;

/// Residuals of loops with their derivatives by the coordinates that close them, evaluated in double precision.
pub(crate) struct NumericLoops<'a> {
    /// Values of constants and nominal coordinates come from here.
    mechanism: &'a Mechanism,
    /// Coordinates that the loops are solved for.
    unknown: Vec<usize>,
    /// Coordinates that are moved, with the value that counts as one for each: 1 rad or the size of the loops in m.
    moved: Vec<(usize, f64)>,
    /// How far each moved coordinate goes for a reach of one: 1 rad, or the size of the largest loop equation in m. The
    /// size of all loops is a sum over their equations; so far a slide may leave the workspace.
    spans: Vec<f64>,
    /// Number of residuals, which come before the derivatives on the tape.
    n_residuals: usize,
    /// The value that counts as one for each unknown: 1 rad, or the size of the loops in m.
    scales: Vec<f64>,
    /// Residuals, then their derivatives by each unknown.
    tape: EvaluationTape,
}

impl<'a> NumericLoops<'a> {
    /// All loops of a mechanism, solved for its passive coordinates.
    pub(crate) fn new(graph: &mut Graph, mechanism: &'a Mechanism, residual: &[ExprId]) -> Self {
        let (unknown, moved): (Vec<usize>, Vec<usize>) =
            (0..mechanism.coordinates.len()).partition(|i| mechanism.coordinates[*i].passive);
        Self::for_unknowns(graph, mechanism, residual, unknown, &moved)
    }

    /// Some loops, solved for `unknown` while the coordinates `moved` are given.
    pub(crate) fn for_unknowns(
        graph: &mut Graph,
        mechanism: &'a Mechanism,
        residual: &[ExprId],
        unknown: Vec<usize>,
        moved: &[usize],
    ) -> Self {
        let size = magnitude::nominal_magnitude(graph, mechanism, residual);
        let one = |i: usize| {
            if mechanism.coordinates[i].motion.is_angle() {
                1.0
            } else {
                size
            }
        };
        let sizes: Vec<f64> = (residual.iter())
            .map(|equation| magnitude::nominal_magnitude(graph, mechanism, &[*equation]))
            .collect();
        // An equation between angles has no size, and counts as 1.
        let largest = sizes
            .into_iter()
            .filter(|equation| *equation <= size)
            .fold(0.0, f64::max);
        let span = |i: usize| {
            let has_size = !mechanism.coordinates[i].motion.is_angle() && largest > 0.0;
            if has_size { largest } else { one(i) }
        };
        let mut roots = residual.to_vec();
        for p in &unknown {
            roots.extend(graph.differentiate(residual, Atom::Coordinate(*p)));
        }
        Self {
            mechanism,
            scales: unknown.iter().map(|i| one(*i)).collect(),
            unknown,
            spans: moved.iter().map(|i| span(*i)).collect(),
            moved: moved.iter().map(|i| (*i, one(*i))).collect(),
            n_residuals: residual.len(),
            tape: EvaluationTape::new(graph, &roots),
        }
    }

    /// Coordinates of the nominal pose with the loops closed up to rounding; `None` if Newton's method fails.
    pub(crate) fn closed_nominal_pose(&self) -> Option<Vec<f64>> {
        let mut q = self.declared_nominal_pose();
        self.close_loops(&mut q)?;
        Some(q)
    }

    /// Coordinates of the nominal pose as stated in the model file, with loops closed by its reader, rad or m.
    pub(crate) fn declared_nominal_pose(&self) -> Vec<f64> {
        let coordinates = self.mechanism.coordinates.iter();
        coordinates.map(|c| c.nominal).collect()
    }

    /// The value that counts as one for each coordinate: 1 rad, the size of the loops in m, or 1 m where no loop
    /// defines a size.
    pub(crate) fn coordinate_unit(&self, coordinate: usize) -> f64 {
        let moved = self.moved.iter().copied();
        let unknown = self.unknown.iter().copied().zip(self.scales.iter().copied());
        moved
            .chain(unknown)
            .find_map(|(i, one)| (i == coordinate).then_some(one))
            .unwrap_or(1.0)
    }

    /// A random pose whose moved coordinates lie within `reach` of the nominal one (rad, or relative to the largest loop
    /// equation), reached in small steps; `None` if the loops cannot be followed so far.
    pub(crate) fn random_pose(&self, reach: f64, stream: &mut RandomStream) -> Option<Vec<f64>> {
        let direction = self.random_direction(stream);
        self.followed_pose(&direction, reach)
    }

    /// As [`Self::random_pose`], but nearer to the nominal pose where the loops cannot be followed so far: the distance
    /// is halved up to `halvings` times.
    pub(crate) fn random_pose_within(&self, reach: f64, halvings: i32, stream: &mut RandomStream) -> Option<Vec<f64>> {
        let direction = self.random_direction(stream);
        (0..=halvings).find_map(|n| self.followed_pose(&direction, reach * 0.5_f64.powi(n)))
    }

    /// How far each moved coordinate goes for a reach of one, at random.
    fn random_direction(&self, stream: &mut RandomStream) -> Vec<f64> {
        let spans = self.spans.iter();
        spans.map(|span| span * uniform_symmetric(stream)).collect()
    }

    /// The pose at `reach` times the direction from the nominal pose, which is reached in small steps.
    fn followed_pose(&self, direction: &[f64], reach: f64) -> Option<Vec<f64>> {
        // Number of small steps, each of which is closed again.
        const STEPS: u32 = 8;
        let mut q = self.declared_nominal_pose();
        for _ in 0..STEPS {
            for ((i, _), dx) in self.moved.iter().zip(direction) {
                q[*i] += dx * reach / f64::from(STEPS);
            }
            self.close_loops(&mut q)?;
        }
        Some(q)
    }

    /// Residuals, and their derivatives by the unknown coordinates, one column each; `None` if any value is not finite.
    pub(crate) fn linearise(&self, q: &[f64]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let value = |atom: Atom| match atom {
            Atom::Constant(i) => self.mechanism.constants[i].value,
            Atom::Coordinate(i) => q[i],
            Atom::Pi => std::f64::consts::PI,
            _ => 0.0,
        };
        let values = self.tape.evaluate(&FloatDomain(value))?;
        // A singular value decomposition of values that are not finite does not end.
        if !values.iter().all(|x| x.is_finite()) {
            return None;
        }
        let (residual, jacobian) = values.split_at(self.n_residuals);
        Some((
            DVector::from_column_slice(residual),
            DMatrix::from_column_slice(self.n_residuals, self.unknown.len(), jacobian),
        ))
    }

    /// Whether the loops determine the unknown coordinates at a pose: full rank of the scaled derivatives.
    pub(crate) fn is_regular(&self, q: &[f64]) -> bool {
        // Least singular value relative to the largest.
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

    /// Closes the loops by moving the unknown coordinates with Newton's method; `None` if it does not converge.
    fn close_loops(&self, q: &mut [f64]) -> Option<()> {
        if self.unknown.is_empty() {
            return Some(());
        }
        for _ in 0..30 {
            let (residual, mut jacobian) = self.linearise(q)?;
            for (mut column, one) in jacobian.column_iter_mut().zip(&self.scales) {
                column *= *one;
            }
            // Least squares with the smallest step, since equations may depend on each other.
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

/// A uniformly distributed number from -1 to 1.
pub(crate) fn uniform_symmetric(stream: &mut RandomStream) -> f64 {
    2.0 * (stream.next_bits() as f64 / u64::MAX as f64) - 1.0
}
