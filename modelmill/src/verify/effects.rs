//! Checks of missing effects: findings of a diagnosis go in, a check for each effect that is too probable comes out,
//! or one check that passes.

use std::fmt::Write as _;

use crate::diagnose::{DiagnosisFindings, LocatedEffect, MissingEffect, words};
use crate::text::table::percent;

use super::causes::effect_details;
use super::checks::{CheckScope, CheckState, VerificationCheck};
use super::limits::VerificationLimits;
use super::thresholds::DEFAULT_PROBABILITY;

/// The checks of effects; the reason why there is no diagnosis as error.
pub(super) fn check_effects(
    limits: &VerificationLimits,
    findings: Result<&DiagnosisFindings, &str>,
) -> Vec<VerificationCheck> {
    let most = limits.most_probability.unwrap_or(DEFAULT_PROBABILITY);
    let blank = VerificationCheck {
        scope: CheckScope::Effect,
        recording: None,
        at: "model".to_owned(),
        quantity: "probability",
        state: CheckState::NotEvaluated,
        value: None,
        std: None,
        limit: [None, Some(most)],
        unit: String::new(),
        is_default: limits.most_probability.is_none(),
        says: String::new(),
        cause: None,
    };
    let not_evaluated = |reason: &str| {
        let says = format!("missing effects were not searched: {reason}");
        vec![VerificationCheck { says, ..blank.clone() }]
    };
    let findings = match findings {
        Err(reason) => return not_evaluated(reason),
        Ok(findings) if !findings.unresolved.is_empty() => {
            return not_evaluated("a fault of the recordings must be corrected first");
        }
        Ok(findings) => findings,
    };
    let all = findings.missing.iter().chain(&findings.possible);
    let (accepted, new): (Vec<&MissingEffect>, Vec<&MissingEffect>) =
        all.partition(|one| is_accepted(limits, &one.effect));
    let (probable, improbable): (Vec<&MissingEffect>, Vec<&MissingEffect>) =
        new.into_iter().partition(|one| one.probability > most);
    if probable.is_empty() {
        let largest = improbable.iter().map(|one| one.probability).fold(0.0, f64::max);
        return vec![VerificationCheck {
            state: CheckState::Pass,
            value: Some(largest),
            says: pass_text(findings, most, &accepted),
            ..blank
        }];
    }
    let failed = |one: &MissingEffect| VerificationCheck {
        // Scripts compare this name, so it is that of the library.
        at: format!("{} ({})", one.effect.kind.replace('_', " "), one.effect.at.join(", ")),
        state: CheckState::Fail,
        value: Some(one.probability),
        says: format!(
            "the model lacks {} with a probability of {:.2}, the limit is {most}",
            words::effect(&one.effect),
            one.probability
        ),
        cause: Some(effect_details(one)),
        ..blank.clone()
    };
    probable.into_iter().map(failed).collect()
}

/// Whether a user accepts an effect: by its kind, or by kind and place.
fn is_accepted(limits: &VerificationLimits, effect: &LocatedEffect) -> bool {
    limits.accepted_effects.iter().any(|one| match one.split_once('@') {
        None => *one == effect.kind,
        Some((kind, places)) => {
            let mut places = places.split(',').map(str::trim);
            kind == effect.kind
                && places.clone().count() == effect.at.len()
                && places.all(|p| effect.at.iter().any(|at| at == p))
        }
    })
}

/// The sentence of a check that passes, with what remains unexplained and what was accepted.
fn pass_text(findings: &DiagnosisFindings, most: f64, accepted: &[&MissingEffect]) -> String {
    let mut says = format!("no new effect has a probability above {most}");
    if !accepted.is_empty() {
        let named: Vec<LocatedEffect> = accepted.iter().map(|one| one.effect.clone()).collect();
        let _ = write!(says, "; found and accepted: {}", words::effects(&named));
    }
    let channels = findings.channels();
    for d in &findings.diagnosis.unexplained {
        let budget = &findings.diagnosis.budgets[*d];
        let part = (budget.force > 0.0).then(|| budget.model / budget.force);
        let _ = write!(
            says,
            "; a repeatable residual of {} ({} of its rms force) stays unexplained",
            channels[*d],
            percent(part)
        );
    }
    says
}
