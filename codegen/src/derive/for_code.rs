//! Facts that the emission of code needs in addition to the programs: numbers of equations of loops and drives on the
//! page of equations, the range of a self-test, and base parameters as formulas.

use crate::Derivation;
use crate::expr::print::PrintedFormula;
use crate::expr::{Graph, coordinates_of};
use crate::loops::magnitude;
use crate::reduce::base::{self, BaseDenominator};

/// Base parameters as formulas over the parameters and constants of the model file, eq. (16).
#[derive(Clone, Debug)]
pub struct BaseFormulas {
    /// Sums that the others refer to, with their names, each after those that it needs.
    pub sums: Vec<(String, PrintedFormula)>,
    /// The base parameters in the order of p_min.
    pub values: Vec<PrintedFormula>,
    /// What must not vanish.
    pub denominators: Vec<BaseDenominator>,
}

impl Derivation {
    /// Reach of every independent coordinate from the nominal pose in an emitted self-test, rad or m: everywhere for open chains,
    /// where loops stay closed for others.
    pub fn self_test_reaches(&self) -> Vec<f64> {
        let mechanism = &self.mechanism;
        let residual = &self.equations.projection.loops.residual;
        let mut graph = self.graph.clone();
        let size = magnitude::nominal_magnitude(&mut graph, mechanism, residual);
        let (active, _) = self.coordinates();
        let is_open = residual.is_empty();
        let reach = |i: &usize| match (mechanism.coordinates[*i].motion.is_angle(), is_open) {
            (true, true) => 3.0,
            (false, true) => 0.5,
            (true, false) => 0.25,
            (false, false) => 0.05 * size,
        };
        active.iter().map(reach).collect()
    }

    /// Coordinates that stand in the equations of the loops.
    pub fn coordinates_in_loops(&self) -> Vec<usize> {
        coordinates_of(&self.graph, &self.equations.projection.loops.residual)
    }

    /// How many gaps close the loops, couplings aside: eqs. (L1) to (Ln) of the page.
    pub fn loop_gap_count(&self) -> usize {
        self.equations.projection.loops.n_gap_equations(&self.mechanism)
    }

    /// How many determinants of the loops are divided by; their equations follow those of the gaps.
    pub fn loop_determinant_count(&self) -> usize {
        self.equations.projection.determinants.len()
    }

    /// The active coordinates that move a drive: for each of them its Jacobian has an equation on the page.
    pub fn coordinates_that_move(&self, drive: usize) -> Vec<usize> {
        let projection = &self.equations.projection;
        let slopes = projection.drive_jacobian[drive].iter();
        let with_slopes = projection.loops.active.iter().zip(slopes);
        let moving = with_slopes.filter(|(_, slope)| **slope != Graph::ZERO);
        moving.map(|(coordinate, _)| *coordinate).collect()
    }

    /// Base parameters as formulas.
    pub fn base_formulas(&self) -> BaseFormulas {
        let (mechanism, reduction) = (&self.mechanism, &self.reduction);
        let values = 0..reduction.retained.len();
        BaseFormulas {
            sums: base::dependent_sums(mechanism, reduction),
            values: values
                .map(|k| base::expanded_formula(mechanism, reduction, k))
                .collect(),
            denominators: base::denominators(mechanism, reduction),
        }
    }
}
