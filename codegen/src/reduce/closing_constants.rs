//! Constants with which loops close to all digits that have more equations than needed.
//!
//! Such a loop, for example a Bennett linkage, moves only if its lengths and angles satisfy equations of their own. A
//! file states them rounded, so the equations contradict each other in the last digits. In rates, accelerations and
//! columns this contradiction is enlarged, and looks like further independent columns. The least change of the
//! constants that removes it at many poses is found by Gauss-Newton steps of minimum norm.
//!
//! Decision: two limits for enlarged rounding were tried before. One dropped columns of geared bodies, the other refused
//! a walking robot. With changed constants no such limit is needed: dependent columns leave 1e-115.

use modelmill_algebra::digits::BigFloat;
use modelmill_spec::Mechanism;
use nalgebra::{DMatrix, DVector};

use crate::expr::{Atom, EvaluationTape, ExprId, FloatDomain, Graph};

/// Residuals relative to the size of a loop below which it is closed to all digits. Numbers have some 130.
pub(super) const CLOSED_TO_ALL_DIGITS: f64 = 1e-105;
/// Number of significant digits from which a constant counts as rounded. Lengths on drawings have fewer. By judgement.
const ROUNDED_DIGITS: usize = 6;
/// Largest change of a constant, relative to its size or in rad, that counts as rounding. By judgement: the largest gap
/// that counts as nearly closed is 1e-7 of a loop.
const LARGEST_CHANGE: f64 = 1e-6;
/// Residuals below which contradictions have no effect on the count: columns are dependent below 1e-13, and nearly
/// singular poses enlarge residuals by up to some 1e6.
pub(super) const NO_CONTRADICTION: f64 = 1e-22;
/// Singular values of the contradictions by the constants, relative to the largest, that count as zero: changes of
/// constants that keep the loop closed, up to rounding in double precision. The second value is used where the first
/// leaves a contradiction, for conditions that a short part of the motion hardly shows.
pub(super) const SINGULAR: [f64; 2] = [1e-9, 1e-12];

/// Derivatives of the equations of all loops by the constants in them.
pub(super) struct ConstantSensitivity {
    /// Constants that may be changed, with the value that counts as one for each: 1 rad, or its own size.
    constants: Vec<(usize, f64)>,
    /// Derivatives of all equations by each of these constants, then by each passive coordinate.
    derivatives: EvaluationTape,
    /// Number of equations.
    n_equations: usize,
}

/// Contradictions of equations at a pose, to first order: `projector * (residual + by_constants * change)` vanishes
/// where passive coordinates exist that close all loops.
pub(super) struct PoseContradiction {
    /// Projection of residuals onto the part that no passive coordinate changes.
    pub(super) projector: DMatrix<f64>,
    /// The projected derivatives by the constants, in units of their sizes.
    by_constants: DMatrix<f64>,
}

impl ConstantSensitivity {
    /// The equations of all loops, whose unknowns are the passive coordinates.
    pub(super) fn new(graph: &mut Graph, mechanism: &Mechanism, equations: &[ExprId], passive: &[usize]) -> Self {
        let atoms = graph.atoms(equations);
        let constants = (mechanism.constants.iter().enumerate())
            .filter(|(i, c)| c.value != 0.0 && atoms.contains(&Atom::Constant(*i)))
            .map(|(i, c)| (i, if c.is_angle { 1.0 } else { c.value.abs() }));
        let constants: Vec<(usize, f64)> = constants.collect();
        let mut roots = Vec::new();
        for (i, _) in &constants {
            roots.extend(graph.differentiate(equations, Atom::Constant(*i)));
        }
        for p in passive {
            roots.extend(graph.differentiate(equations, Atom::Coordinate(*p)));
        }
        Self {
            constants,
            derivatives: EvaluationTape::new(graph, &roots),
            n_equations: equations.len(),
        }
    }

    /// Selections of constants to change, as positions among those of the loops: first those that look rounded, then all.
    pub(super) fn selections(&self, mechanism: &Mechanism, is_stated_exactly: &dyn Fn(f64) -> bool) -> Vec<Vec<usize>> {
        let is_rounded = |at: &usize| {
            let constant = &mechanism.constants[self.constants[*at].0];
            let is_exact = constant.is_angle && is_stated_exactly(constant.value);
            !is_exact && n_significant_digits(constant.value) >= ROUNDED_DIGITS
        };
        let all: Vec<usize> = (0..self.constants.len()).collect();
        let rounded: Vec<usize> = all.iter().copied().filter(is_rounded).collect();
        let mut selections = vec![rounded, all];
        selections.dedup();
        selections.retain(|selection| !selection.is_empty());
        selections
    }

    /// Index of a constant of a selection, and the value that counts as one for it.
    pub(super) fn constant(&self, at: usize) -> (usize, f64) {
        self.constants[at]
    }

    /// The contradictions at a pose, linearised in double precision. `sizes` are what residuals are relative to, and
    /// `units` what counts as one for each passive coordinate. `None` if a value is not finite.
    pub(super) fn contradiction(
        &self,
        mechanism: &Mechanism,
        q: &[f64],
        sizes: &[f64],
        units: &[f64],
        selection: &[usize],
    ) -> Option<PoseContradiction> {
        let value = |atom: Atom| match atom {
            Atom::Constant(i) => mechanism.constants[i].value,
            Atom::Coordinate(i) => q[i],
            Atom::Pi => std::f64::consts::PI,
            _ => 0.0,
        };
        let values = self.derivatives.evaluate(&FloatDomain(value))?;
        if !values.iter().all(|x| x.is_finite()) {
            return None;
        }
        let (n, columns) = (self.n_equations, self.constants.len());
        let (by_constants, by_passive) = values.split_at(n * columns);
        let mut by_constants = DMatrix::from_column_slice(n, columns, by_constants);
        let mut by_passive = DMatrix::from_column_slice(n, units.len(), by_passive);
        for (i, size) in sizes.iter().enumerate() {
            by_constants.row_mut(i).scale_mut(size.recip());
            by_passive.row_mut(i).scale_mut(size.recip());
        }
        for (mut column, (_, one)) in by_constants.column_iter_mut().zip(&self.constants) {
            column *= *one;
        }
        for (mut column, one) in by_passive.column_iter_mut().zip(units) {
            column *= *one;
        }
        // Directions that passive coordinates reach; all are independent where the walk returns a pose.
        let reached = by_passive.svd(true, false).u?;
        let projector = DMatrix::identity(n, n) - &reached * reached.transpose();
        Some(PoseContradiction {
            by_constants: &projector * by_constants.select_columns(selection),
            projector,
        })
    }
}

/// The pseudoinverse of the contradictions at several poses by the selected constants: from projected residuals to the
/// least change, in units of the constants. Singular values below the share `singular` of the largest count as zero.
pub(super) fn least_change(contradictions: &[PoseContradiction], singular: f64) -> Option<DMatrix<f64>> {
    let rows: Vec<_> = (contradictions.iter())
        .flat_map(|at| at.by_constants.row_iter())
        .collect();
    if rows.is_empty() {
        return None;
    }
    let svd = DMatrix::from_rows(&rows).svd(true, true);
    let least = singular * svd.singular_values.amax();
    svd.pseudo_inverse(least).ok()
}

/// The changed value of a constant; `None` if it is changed by more than rounding.
pub(super) fn changed_value(before: &BigFloat, stated: f64, one: f64, step: f64) -> Option<BigFloat> {
    let changed = before - &BigFloat::from_f64(step * one)?;
    ((changed.to_f64() - stated).abs() <= LARGEST_CHANGE * one).then_some(changed)
}

/// Projected residuals of several poses, one after the other.
pub(super) fn project_residuals(contradictions: &[PoseContradiction], residuals: &[Vec<f64>]) -> DVector<f64> {
    let parts = contradictions.iter().zip(residuals);
    let parts: Vec<f64> = parts
        .flat_map(|(at, residual)| {
            let projected = &at.projector * DVector::from_column_slice(residual);
            projected.iter().copied().collect::<Vec<f64>>()
        })
        .collect();
    DVector::from_vec(parts)
}

/// Number of significant digits of the shortest decimal that is read as `value`.
fn n_significant_digits(value: f64) -> usize {
    let text = format!("{value:e}");
    let mantissa = text.split_once('e').map_or(text.as_str(), |(mantissa, _)| mantissa);
    mantissa.chars().filter(char::is_ascii_digit).count()
}
