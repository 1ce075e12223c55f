//! The search for missing effects with all that may repeat it: differences between recordings, wrong constants, and
//! zeros of the model file. A model with its recordings goes in; the best answer comes out.

use std::collections::BTreeSet;

use modelmill_identify::diagnose::{DiagnosisVerdict, Disturbance, IdentifiedEffect};

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::runs::RecordingDifference;
use crate::segment::RecordingSegment;

use super::added_effects;
use super::constants::{CONSTANT_ERROR, ClaimedConstant};
use super::geometry_alternatives::{GeometryAlternative, geometry_alternatives};
use super::model_versions::ModelVersion;
use super::named_zeros::{self, NamedZeros};
use super::problem::{self, DiagnosisQuery, DiagnosisSolution, FixedParameters};
use super::thresholds::{
    CLAIMED_LENGTH_MOST_RESIDUAL, CONSTANT_MOST_RESIDUAL, CONSTANT_SETTLED_SHARE, DIFFERENCE_LEAST_GAIN,
};

/// Most times a search is repeated with the errors of constants that it claims.
const MOST_CONSTANT_ROUNDS: usize = 3;

/// Most differences between recordings of which each is tested by a search without it: the weakest ones. By judgement, for the
/// time that the searches take.
const MOST_DIFFERENCES_TRIED: usize = 12;

/// Disturbances that may stand in place of a difference between recordings: each recording has parameters of its own.
const DRIFTS_AND_STEPS: [&str; 4] = ["offset_drift", "friction_drift", "offset_step", "gain_change"];

/// The search for missing effects, with differences `between` recordings, which are cleared if a search without them
/// explains more. It is repeated with zeros of the model file as candidates where these may be wrong.
///
/// Fails as [`Model::diagnose`] does.
pub(super) fn search_effects(
    model: &Model,
    data: &[Vec<RecordingSegment>; 2],
    fixed: FixedParameters,
    is_clock_in_question: bool,
    between: &mut Vec<RecordingDifference>,
) -> Outcome<EffectSearchAnswer> {
    let search = EffectSearch {
        model,
        data,
        fixed,
        is_clock_in_question,
    };
    // The search with differences between recordings; it is repeated without them if there are any.
    let mut answer = search.find(between, None)?;
    if !between.is_empty() {
        // A missing effect may look like a difference between recordings.
        let without = search.find(&[], None)?;
        let least_gain = match between[..] {
            [_] => search.least_gain(&between[0], &answer),
            _ => DIFFERENCE_LEAST_GAIN,
        };
        if are_differences_needed(model, between, &answer, &without, least_gain) {
            answer = search.drop_needless_differences(between, answer)?;
        } else {
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
        let with_zeros = search.find(between, Some(named))?;
        if named.is_better(&with_zeros, &answer) {
            answer = with_zeros;
        }
    }
    let in_place_of_constants = search.errors_in_place_of_constants(&answer)?;
    Ok(EffectSearchAnswer {
        solution: answer,
        zeros: named,
        in_place_of_constants,
    })
}

/// Whether the search with differences between recordings explains more than that without them, at the drives and in the
/// recordings in which the differences act. `least_gain` is the factor by which the squares must rise without them.
///
/// An effect of the machine that the model lacks may look like a difference, so that differences must explain clearly
/// more. A drift or step in place of a difference has more parameters and must explain clearly more itself.
fn are_differences_needed(
    model: &Model,
    between: &[RecordingDifference],
    with: &DiagnosisSolution,
    without: &DiagnosisSolution,
    least_gain: f64,
) -> bool {
    let drives = model.row_names();
    let is_concerned = |d: usize| between.iter().any(|one| one.acts_on(d));
    let is_new = |one: &&Disturbance| {
        with.diagnosis
            .disturbances
            .iter()
            .all(|known| (&known.kind, &known.at) != (&one.kind, &one.at))
    };
    let is_in_their_place = |one: &Disturbance| {
        let is_at = |d: usize| is_concerned(d) && one.at.contains(&drives[d]);
        DRIFTS_AND_STEPS.contains(&one.kind.as_str()) && (0..drives.len()).any(is_at)
    };
    let mut disturbances = without.diagnosis.disturbances.iter().filter(is_new);
    let is_known = |effect: &IdentifiedEffect| with.diagnosis.effects.iter().any(|one| one.effect == effect.effect);
    let has_further_effects = !without.diagnosis.effects.iter().all(is_known);
    let least_gain = if !has_further_effects && disturbances.any(is_in_their_place) {
        DIFFERENCE_LEAST_GAIN.recip()
    } else {
        least_gain
    };
    // Relative to the same forces in both, in samples that both keep: those that are left out have a residual of 0.
    let samples = acting_samples(between);
    let (mut sum_with, mut sum_without) = (0.0, 0.0);
    for (d, budget) in without.diagnosis.budgets.iter().enumerate() {
        if !is_concerned(d) || budget.force <= 0.0 {
            continue;
        }
        let [of_with, of_without] = [with, without].map(|answer| &answer.diagnosis.residual[d]);
        for i in samples.iter().filter(|i| of_with[**i] != 0.0 && of_without[**i] != 0.0) {
            sum_with += (of_with[*i] / budget.force).powi(2);
            sum_without += (of_without[*i] / budget.force).powi(2);
        }
    }
    sum_without >= least_gain * sum_with
}

/// Indices of the samples in which differences between recordings act.
fn acting_samples(between: &[RecordingDifference]) -> Vec<usize> {
    let columns = || between.iter().flat_map(|one| one.force.0.iter().flatten());
    let samples = columns().map(Vec::len).max().unwrap_or(0);
    let acts = |i: &usize| columns().any(|force| force.get(*i).is_some_and(|force| *force != 0.0));
    (0..samples).filter(acts).collect()
}

/// What all searches for missing effects in the same recordings have in common.
struct EffectSearch<'a> {
    /// The model.
    model: &'a Model,
    /// The fitted recordings, and the validation runs.
    data: &'a [Vec<RecordingSegment>; 2],
    /// Which parameters keep their nominal values.
    fixed: FixedParameters,
    /// Whether the clock of the recordings may be wrong.
    is_clock_in_question: bool,
}

impl EffectSearch<'_> {
    /// Whether the model file has a constant with this name.
    fn is_constant_of_file(&self, name: &str) -> bool {
        let constants = &self.model.derivation.mechanism.constants;
        constants.iter().any(|constant| constant.name == name)
    }

    /// One search with errors of constants that an earlier one claims.
    ///
    /// Fails as [`Model::diagnose`] does.
    fn find_once(
        &self,
        between: &[RecordingDifference],
        zeros: Option<&NamedZeros>,
        claimed: &[ClaimedConstant],
        are_effects_at_claims: bool,
    ) -> Outcome<DiagnosisSolution> {
        let query = DiagnosisQuery {
            fixed: self.fixed,
            in_full: true,
            run_differences: between,
            is_clock_in_question: self.is_clock_in_question,
            claimed,
            are_effects_at_claims,
            zeros,
        };
        problem::find_missing_effects(self.model, &self.data[0], &self.data[1], query)
    }

    /// A search that is repeated until the claimed errors of constants are exact.
    ///
    /// Fails as [`Model::diagnose`] does.
    fn find(&self, between: &[RecordingDifference], zeros: Option<&NamedZeros>) -> Outcome<DiagnosisSolution> {
        let mut answer = self.find_once(between, zeros, &[], false)?;
        let mut claimed = claimed_constants(&answer);
        // Values of a first search are inexact where an error is large.
        for _ in 0..MOST_CONSTANT_ROUNDS {
            if claimed.is_empty() {
                break;
            }
            let again = self.find_once(between, zeros, &claimed, false)?;
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
        // Effects in addition to a wrong length act at the length that is claimed. With wrong claims the loops may not
        // close, and the answer stays as it is.
        for _ in 0..MOST_CONSTANT_ROUNDS {
            let claimed = claimed_constants(&answer);
            let n_others = answer.diagnosis.effects.len() - claimed.len();
            // Zeros of the file are no constants of the candidates' mechanism.
            if n_others == 0 || !claimed.iter().any(|claim| self.is_constant_of_file(&claim.name)) {
                break;
            }
            let Some(again) = ignore_unless_cancelled(self.find_once(between, zeros, &claimed, true))? else {
                break;
            };
            if again.mean_square_residual() > CLAIMED_LENGTH_MOST_RESIDUAL * answer.mean_square_residual() {
                break;
            }
            answer = again;
        }
        Ok(answer)
    }

    /// Removes the differences between recordings that a search without them does not need, one by one, the weakest first,
    /// and returns the answer for those that stay. `answer` is the answer with all of them.
    ///
    /// Fails as [`Model::diagnose`] does.
    fn drop_needless_differences(
        &self,
        between: &mut Vec<RecordingDifference>,
        mut answer: DiagnosisSolution,
    ) -> Outcome<DiagnosisSolution> {
        // A single one was compared with none.
        if between.len() < 2 {
            return Ok(answer);
        }
        let forces: Vec<f64> = answer.diagnosis.budgets.iter().map(|budget| budget.force).collect();
        let powers: Vec<f64> = between.iter().map(|one| one.relative_power(&forces)).collect();
        let mut weakest: Vec<usize> = (0..between.len()).collect();
        weakest.sort_by(|a, b| powers[*a].total_cmp(&powers[*b]));
        weakest.truncate(MOST_DIFFERENCES_TRIED);
        let mut dropped: Vec<usize> = Vec::new();
        for original in weakest {
            // Others stay in their order.
            let k = original - dropped.iter().filter(|other| **other < original).count();
            let one = between.remove(k);
            let without = self.find(between, None)?;
            let least_gain = self.least_gain(&one, &answer);
            if are_differences_needed(self.model, std::slice::from_ref(&one), &answer, &without, least_gain) {
                between.insert(k, one);
            } else {
                answer = without;
                dropped.push(original);
            }
        }
        Ok(answer)
    }

    /// The factor by which the squares must rise without a difference. Where a part stays unexplained in the `answer` with it, the
    /// difference must explain more than that part. A fit without it adapts to it in a fitted recording, and only the
    /// share (1 - 1/n)^2 of its squares stays in one of n recordings.
    fn least_gain(&self, one: &RecordingDifference, answer: &DiagnosisSolution) -> f64 {
        if answer.diagnosis.verdict != DiagnosisVerdict::Unexplained {
            return DIFFERENCE_LEAST_GAIN;
        }
        let fitted: usize = self.data[0].iter().map(|segment| segment.time().len()).sum();
        let is_fitted = acting_samples(std::slice::from_ref(one))
            .first()
            .is_some_and(|i| *i < fitted);
        let n = self.data[0]
            .iter()
            .map(|segment| &segment.run.file)
            .collect::<BTreeSet<_>>()
            .len() as f64;
        let share = if is_fitted { (1.0 - 1.0 / n).powi(2) } else { 1.0 };
        DIFFERENCE_LEAST_GAIN.max(1.0 + share)
    }

    /// The errors of the geometry that explain at least as much as the wrong constants that a search claims in addition
    /// to other effects; `None` if there are none, or if it claims constants alone.
    ///
    /// Fails only when the job is cancelled.
    fn errors_in_place_of_constants(&self, answer: &DiagnosisSolution) -> Outcome<Option<GeometryAlternative>> {
        let claimed = claimed_constants(answer);
        if claimed.is_empty() || claimed.len() == answer.diagnosis.effects.len() {
            return Ok(None);
        }
        // The model with the other effects, where the file can have them.
        let entries = added_effects::entries(self.model, answer);
        let Ok(edited) = added_effects::add_entries(self.model, &entries) else {
            return Ok(None);
        };
        let Some(with_others) = ignore_unless_cancelled(self.model.host().derive(&self.model.path, edited.loaded))?
        else {
            return Ok(None);
        };
        let with_others = with_others.with_values_of(self.model);
        let zeros = NamedZeros::new(&with_others)?;
        let [fit, check] = self.data.clone();
        let Some(version) = ignore_unless_cancelled(ModelVersion::new(with_others, fit, check, self.fixed))? else {
            return Ok(None);
        };
        let names: Vec<&str> = claimed.iter().map(|one| one.name.as_str()).collect();
        let alternatives = geometry_alternatives(&version, zeros.as_ref(), self.fixed, &names, names.len(), 0.0)?;
        Ok(alternatives.into_iter().next())
    }
}

/// The answer of [`search_effects`].
pub(super) struct EffectSearchAnswer {
    /// The best answer.
    pub(super) solution: DiagnosisSolution,
    /// The zeros of the file that were tried.
    pub(super) zeros: Option<NamedZeros>,
    /// Errors of the geometry that explain at least as much as the wrong constants of the answer, in addition to its
    /// other effects.
    pub(super) in_place_of_constants: Option<GeometryAlternative>,
}

/// `None` for an error, apart from that of a cancelled job.
fn ignore_unless_cancelled<T>(result: Outcome<T>) -> Outcome<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(Error::Cancelled) => Err(Error::Cancelled),
        Err(_) => Ok(None),
    }
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
