//! Refinement: nominal values as a prior.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::estimate::{WeightedEstimate, solve_with_prior};

use super::RefinementResult;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::text::table::percent;

/// Adds nominal values as measurements with the relative standard deviation `sigma`, and solves again.
///
/// Fails when no base parameter has a nominal value other than 0.
pub(super) fn refine(
    model: &Model,
    found: &mut WeightedEstimate,
    unknown: &[usize],
    nominal: &[f64],
    sigma: f64,
) -> Outcome<RefinementResult> {
    let priors = model.parameter_priors(unknown, sigma);
    if priors.is_empty() {
        let parameters = &model.derivation.mechanism.parameters;
        let prior = Remedy::option(OptionName::Prior);
        return Err(Error::input(message!(
            "{}: {} uses {} of each nominal value as its uncertainty, but the nominal values of {} are 0 or not \
             given, so that no uncertainty follows; set them in [parameters] (`nominal = ...`), or omit {}",
            model.path,
            prior,
            percent(Some(sigma)),
            match parameters.as_slice() {
                [one] => format!("the only parameter `{}`", one.name),
                all => format!("all {} parameters", all.len()),
            },
            prior
        )));
    }
    (found.solution, found.uncertainty) =
        solve_with_prior(&found.r_factor, &found.solution, &found.uncertainty, nominal, &priors)?;
    Ok(RefinementResult::Prior(sigma, priors.len()))
}
