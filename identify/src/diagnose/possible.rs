//! Effects of the last set with their alternatives and probabilities, and those that are set aside since they are less
//! likely than not.
//!
//! Decision: an effect is reported as possible if it and its alternatives together have a probability below one half.
//! It stands in no verdict, is added to no model, and the residual that it would explain counts as residual. If one of
//! several indistinguishable effects is present, each of them may be less likely than not; then the group is reported.

use super::aliases::EffectAlias;
use super::bench::{EffectSelector, SelectedEffect};
use super::pool::FitScope;
use super::problem::CandidateNature;
use super::support::EffectSupport;
use super::thresholds::LACKING_LEAST_PROBABILITY;
use super::{IdentifiedEffect, SetResidual};

/// The effects of a set with their alternatives and what supports them, in the same order.
pub(crate) struct AssessedEffects {
    /// The set.
    pub(crate) picks: Vec<SelectedEffect>,
    /// Alternatives of each.
    aliases: Vec<Vec<EffectAlias>>,
    /// Support of each.
    support: Vec<EffectSupport>,
}

impl EffectSelector<'_> {
    /// Alternatives and support of each effect of a set with its residual; sets the weights of the channels.
    pub(crate) fn assess_effects(&mut self, picks: &[SelectedEffect], left: &SetResidual) -> AssessedEffects {
        let aliases = self.find_aliases(picks);
        self.weigh_channels(picks);
        AssessedEffects {
            support: self.support_members(picks, &aliases, left),
            picks: picks.to_vec(),
            aliases,
        }
    }
}

impl AssessedEffects {
    /// Removes the effects that are less likely than not, even together with their alternatives, and returns them.
    /// Disturbances of the recordings stay.
    pub(crate) fn set_aside_unlikely(&mut self, bench: &EffectSelector<'_>) -> Vec<IdentifiedEffect> {
        let all = self.identified_effects(bench);
        let is_unlikely = |pick: &SelectedEffect| {
            let mut found = all.iter().filter(|found| found.candidate == pick.candidate);
            found.any(|found| found.support.group_probability() < LACKING_LEAST_PROBABILITY)
        };
        let keep: Vec<bool> = self.picks.iter().map(|pick| !is_unlikely(pick)).collect();
        let mut kept = keep.iter();
        self.picks.retain(|_| *kept.next().unwrap_or(&true));
        let mut kept = keep.iter();
        self.aliases.retain(|_| *kept.next().unwrap_or(&true));
        let mut kept = keep.iter();
        self.support.retain(|_| *kept.next().unwrap_or(&true));
        let is_set_aside = |found: &IdentifiedEffect| found.support.group_probability() < LACKING_LEAST_PROBABILITY;
        all.into_iter().filter(is_set_aside).collect()
    }

    /// The effects with estimates from the recordings of the fit; disturbances of the recordings are left out.
    pub(crate) fn identified_effects(&self, bench: &EffectSelector<'_>) -> Vec<IdentifiedEffect> {
        let estimates = bench.estimate_parameters(&self.picks, FitScope::Fit);
        let members = self.picks.iter().zip(&self.aliases).zip(&self.support).zip(estimates);
        members
            .filter(|(((pick, _), _), _)| bench.candidate(pick).nature == CandidateNature::Effect)
            .map(|(((pick, aliases), support), estimates)| {
                let (values, deviations) = estimates.into_iter().unzip();
                IdentifiedEffect {
                    effect: bench.candidate(pick).effect.clone(),
                    candidate: pick.candidate,
                    constants: pick.constants.clone(),
                    estimates: values,
                    standard_deviations: deviations,
                    probability: support.probability(),
                    support: *support,
                    indistinguishable_from: aliases.iter().map(|alias| alias.effect.clone()).collect(),
                    shared_with: Vec::new(),
                    is_measured: false,
                }
            })
            .collect()
    }
}
