//! What is made of reduced rows once least squares has its solution: one list, with a file for each entry.
//!
//! To add one, write its file, put it into [`EstimateRefinement`], [`RefinementResult`] and [`refine`], say what it tells in
//! `print/estimation`, and give the program its option in `args/estimation`.

mod essential;
mod physical;
mod prior;

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::estimate::{DroppedParameter, PhysicalParameters, WeightedEstimate};

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::text::table::count;

/// What is made of the reduced rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum EstimateRefinement {
    /// Nothing: the solution of least squares.
    #[default]
    None,
    /// Nominal values as soft constraints, with this relative standard deviation of each product of parameters.
    Prior(f64),
    /// Only parameters that bodies can have (positive definite pseudo-inertias), nearest to the nominal ones; also gives
    /// every physical parameter.
    Physical,
    /// Base parameters that the recordings do not support are left out, one by one, while none of them is missed.
    Essential,
}

/// What a refinement found beside solution and deviations.
#[derive(Debug, Clone, PartialEq)]
pub enum RefinementResult {
    /// Nothing.
    Nothing,
    /// Parameters were left out; those by position among the unknown ones, and by how much the residual rose.
    Essential(Vec<DroppedParameter>, f64),
    /// Nominal values of this relative standard deviation counted as measurements, as many as said.
    Prior(f64, usize),
    /// Physical parameters that bodies can have, beside the residual norm of the solution without that demand.
    Physical(Box<PhysicalParameters>, Vec<String>, f64),
}

impl RefinementResult {
    /// The parameters that were left out, by position among the unknown ones.
    pub fn removed_parameters(&self) -> impl Iterator<Item = usize> + '_ {
        let dropped = match self {
            Self::Essential(dropped, _) => dropped.as_slice(),
            _ => &[],
        };
        dropped.iter().map(|one| one.parameter)
    }
}

/// Refines what least squares found of the base parameters `unknown`, whose nominal values are given.
pub(crate) fn refine(
    model: &Model,
    found: &mut WeightedEstimate,
    unknown: &[usize],
    nominal: &[f64],
    refinement: EstimateRefinement,
) -> Outcome<RefinementResult> {
    let solution = &found.solution;
    if refinement != EstimateRefinement::None && solution.rows <= solution.rank {
        return Err(Error::input(message!(
            "{} for {}: no degree of freedom is left for the residuals, from which {}, {} \
             and {} learn what the recording is worth; use a longer recording",
            count(solution.rows, "equation", "equations"),
            count(solution.rank, "base parameter", "base parameters"),
            Remedy::option(OptionName::Prior),
            Remedy::option(OptionName::Essential),
            Remedy::option(OptionName::Physical)
        )));
    }
    match refinement {
        EstimateRefinement::None => Ok(RefinementResult::Nothing),
        EstimateRefinement::Prior(sigma) => prior::refine(model, found, unknown, nominal, sigma),
        EstimateRefinement::Essential => essential::refine(found, nominal),
        EstimateRefinement::Physical => physical::refine(model, found, unknown),
    }
}
