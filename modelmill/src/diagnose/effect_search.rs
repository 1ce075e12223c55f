//! The search for missing effects with all that may repeat it: differences between recordings, wrong constants, and
//! zeros of the model file. A model with its recordings goes in; the best answer comes out.

use modelmill_identify::diagnose::DiagnosisVerdict;

use crate::error::Outcome;
use crate::model::Model;
use crate::runs::RecordingDifference;
use crate::segment::RecordingSegment;

use super::constants::{CONSTANT_ERROR, ClaimedConstant};
use super::named_zeros::{self, NamedZeros};
use super::problem::{self, DiagnosisQuery, DiagnosisSolution, FixedParameters};
use super::thresholds::{CONSTANT_MOST_RESIDUAL, CONSTANT_SETTLED_SHARE, DIFFERENCE_LEAST_GAIN};

/// Most times a search is repeated with the errors of constants that it claims.
const MOST_CONSTANT_ROUNDS: usize = 3;

/// The search for missing effects, with differences `between` recordings, which are cleared if a search without them
/// explains more. It is repeated with zeros of the model file as candidates where these may be wrong; these zeros are
/// returned as well.
///
/// Fails as [`Model::diagnose`] does.
pub(super) fn search_effects(
    model: &Model,
    data: &[Vec<RecordingSegment>; 2],
    held: FixedParameters,
    is_clock_in_question: bool,
    between: &mut Vec<RecordingDifference>,
) -> Outcome<(DiagnosisSolution, Option<NamedZeros>)> {
    let find_once = |between: &[RecordingDifference], zeros: Option<&NamedZeros>, claimed: &[ClaimedConstant]| {
        let asked = DiagnosisQuery {
            fixed: held,
            in_full: true,
            run_differences: between,
            is_clock_in_question,
            claimed,
            zeros,
        };
        problem::find_missing_effects(model, &data[0], &data[1], asked)
    };
    let find = |between: &[RecordingDifference], zeros: Option<&NamedZeros>| -> Outcome<DiagnosisSolution> {
        let mut answer = find_once(between, zeros, &[])?;
        let mut claimed = claimed_constants(&answer);
        // Values of a first search are inexact where an error is large.
        for _ in 0..MOST_CONSTANT_ROUNDS {
            if claimed.is_empty() {
                break;
            }
            let again = find_once(between, zeros, &claimed)?;
            // Far from its value a constant may have no polynomial.
            if again.mean_square_residual() > CONSTANT_MOST_RESIDUAL * answer.mean_square_residual() {
                break;
            }
            let found = claimed_constants(&again);
            let is_settled = have_settled(&claimed, &found);
            // The constants of an earlier round stay exact where they are no longer claimed.
            claimed.retain(|one| found.iter().all(|other| other.name != one.name));
            claimed.extend(found);
            answer = again;
            if is_settled {
                break;
            }
        }
        Ok(answer)
    };
    // The search with differences between recordings; it is repeated without them if there are any.
    let mut answer = find(between, None)?;
    if !between.is_empty() {
        // A missing effect may look like a difference between recordings.
        let without = find(&[], None)?;
        if without.mean_square_residual() < DIFFERENCE_LEAST_GAIN * answer.mean_square_residual() {
            answer = without;
            between.clear();
        }
    }
    // Zeros of the file may be wrong as well. They have no names, so they are tried only where something was found.
    let is_explained = answer.diagnosis.verdict == DiagnosisVerdict::Adequate;
    let named = if is_explained { None } else { NamedZeros::new(model)? };
    if let Some(named) = &named
        && named_zeros::needs_search(&answer)
    {
        let with_zeros = find(between, Some(named))?;
        if named.is_better(&with_zeros, &answer) {
            answer = with_zeros;
        }
    }
    Ok((answer, named))
}

/// The errors of constants that a search claims.
fn claimed_constants(answer: &DiagnosisSolution) -> Vec<ClaimedConstant> {
    let effects = answer
        .diagnosis
        .effects
        .iter()
        .filter(|one| one.effect.kind == CONSTANT_ERROR);
    let claims = effects.filter_map(|one| {
        let (name, value) = one.effect.at.first().zip(one.estimates.first())?;
        Some(ClaimedConstant {
            name: name.clone(),
            value: *value,
        })
    });
    claims.collect()
}

/// Whether a search found the errors of constants that the search before had found, apart from a small change.
fn have_settled(before: &[ClaimedConstant], found: &[ClaimedConstant]) -> bool {
    let is_same = |one: &ClaimedConstant, other: &ClaimedConstant| {
        one.name == other.name && (one.value - other.value).abs() <= CONSTANT_SETTLED_SHARE * one.value.abs()
    };
    found.iter().all(|one| before.iter().any(|other| is_same(other, one)))
}
