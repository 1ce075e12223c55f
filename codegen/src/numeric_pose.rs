//! Poses in floating point: loops closed by Newton's method from the nominal pose.

use modelmill_spec::Mechanism;
use nalgebra::{DMatrix, DVector};

use crate::expr::{Atom, ExprId, F64, Graph, Tape};
use crate::field::Stream;

/// Residuals of loops with their derivatives by the passive coordinates.
pub(crate) struct Loops<'a> {
    mechanism: &'a Mechanism,
    passive: Vec<usize>,
    n_residuals: usize,
    tape: Tape,
}

impl<'a> Loops<'a> {
    pub(crate) fn new(graph: &mut Graph, mechanism: &'a Mechanism, residual: &[ExprId]) -> Self {
        let passive: Vec<usize> = (0..mechanism.coordinates.len())
            .filter(|i| mechanism.coordinates[*i].passive)
            .collect();
        let mut roots = residual.to_vec();
        for p in &passive {
            roots.extend(graph.differentiate(residual, Atom::Coordinate(*p)));
        }
        Self {
            mechanism,
            passive,
            n_residuals: residual.len(),
            tape: Tape::new(graph, &roots),
        }
    }

    /// Coordinates of the nominal pose.
    pub(crate) fn nominal(&self) -> Vec<f64> {
        self.mechanism
            .coordinates
            .iter()
            .map(|c| c.nominal)
            .collect()
    }

    /// A pose whose active coordinates lie within `reach` of the nominal one, followed from there; `None` if the loops
    /// cannot be followed so far.
    pub(crate) fn random(&self, reach: f64, stream: &mut Stream) -> Option<Vec<f64>> {
        const STEPS: u32 = 8;
        let mut q = self.nominal();
        let moves: Vec<f64> = (0..q.len())
            .map(|i| {
                if self.passive.contains(&i) {
                    0.0
                } else {
                    reach * symmetric(stream) / f64::from(STEPS)
                }
            })
            .collect();
        for _ in 0..STEPS {
            for (x, dx) in q.iter_mut().zip(&moves) {
                *x += dx;
            }
            self.close(&mut q)?;
        }
        Some(q)
    }

    /// Closes the loops by moving the passive coordinates.
    fn close(&self, q: &mut [f64]) -> Option<()> {
        if self.passive.is_empty() {
            return Some(());
        }
        for _ in 0..30 {
            let values = {
                let value = |atom: Atom| match atom {
                    Atom::Constant(i) => self.mechanism.constants[i].value,
                    Atom::Coordinate(i) => q[i],
                    Atom::Pi => std::f64::consts::PI,
                    _ => 0.0,
                };
                self.tape.evaluate(&F64(value))?
            };
            let (residual, jacobian) = values.split_at(self.n_residuals);
            let jacobian =
                DMatrix::from_column_slice(self.n_residuals, self.passive.len(), jacobian);
            let step = jacobian
                .svd(true, true)
                .solve(&DVector::from_column_slice(residual), 1e-12)
                .ok()?;
            for (p, dx) in self.passive.iter().zip(step.iter()) {
                q[*p] -= dx;
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
