//! Refinements of the least-squares solution: one list, with a file for each entry.
//!
//! To add one, write its file, put it into [`EstimateRefinement`], [`RefinementResult`] and [`refine`], print its
//! result in `print/estimation`, and add its option in `args/estimation` of the program.

mod essential;
mod physical;
mod prior;

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::estimate::{DroppedParameter, PhysicalParameters, WeightedEstimate};

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::text::table::count;

/// A refinement of the least-squares solution.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum EstimateRefinement {
    /// None: the least-squares solution.
    #[default]
    None,
    /// Nominal values as a prior, with this relative standard deviation of each product of parameters.
    Prior(f64),
    /// Physically consistent parameters: the pseudo-inertia of every body is positive definite. Where the recordings do
    /// not determine the parameters, the nominal values do. The result also contains all physical parameters.
    Physical,
    /// Base parameters that the recordings do not support are removed one by one, as long as the residual does not rise
    /// significantly.
    Essential,
}

/// The result of a refinement in addition to solution and uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub enum RefinementResult {
    /// No refinement.
    Nothing,
    /// Removed parameters, by index among the unknown ones, and the relative increase of the residual norm (0.01 for 1
    /// per cent).
    Essential(Vec<DroppedParameter>, f64),
    /// Relative standard deviation of the prior, and the number of base parameters with a prior.
    Prior(f64, usize),
    /// Physically consistent parameters, the names of the bodies, and the residual norm without this constraint.
    Physical(Box<PhysicalParameters>, Vec<String>, f64),
}

impl RefinementResult {
    /// The removed parameters, by index among the unknown ones.
    pub fn removed_parameters(&self) -> impl Iterator<Item = usize> + '_ {
        let dropped = match self {
            Self::Essential(dropped, _) => dropped.as_slice(),
            _ => &[],
        };
        dropped.iter().map(|one| one.parameter)
    }
}

/// Refines the least-squares estimate of the base parameters `unknown`, with their nominal values.
///
/// Fails without degrees of freedom, and as the refinement does.
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
            "{} for {}: the residuals have no degree of freedom, but {}, {} \
             and {} need them to judge the recording; use a longer recording",
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
