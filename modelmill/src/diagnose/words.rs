//! Sentences for people: verdict, effects with their places, disturbances, and reasons of rejection. Input are
//! values of a diagnosis, output is English text without line breaks.

use modelmill_identify::diagnose::{
    DiagnosisVerdict, Disturbance, FORCE_ROUNDING, IdentifiedEffect, LACKING_LEAST_PROBABILITY, LocatedEffect,
    ModelDiagnosis, RejectionReason, ResidualCharacter, SelectionStep, TimeResidual,
};

use crate::faults::{SuspectedFault, is_suspicion};
use crate::text::names::joined_by_and;
use crate::text::table::{percent, significant};

pub(crate) use super::alternative_words::geometry_error_text;
pub(super) use super::alternative_words::{elastic_alternative_text, geometry_alternative_text};
pub(crate) use super::disturbance_words::is_brief_force;
use super::disturbance_words::what_changes;
pub use super::disturbance_words::{disturbance, disturbance_sentences};
use super::thresholds::{HARDLY_LOWER, NOISE_FREE_ROUNDINGS};

/// Kinds of changes during a recording.
const CHANGES_IN_TIME: [&str; 3] = ["payload_change", "gain_change", "offset_step"];
/// Intervals that a sentence lists at most.
const MOST_INTERVALS: usize = 4;
/// Places from which on a kind is named once with all of them.
const GROUP_FEWEST_PLACES: usize = 3;

/// The data on which errors are evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValidationMethod {
    /// Validation runs: recordings that were not fitted.
    Check,
    /// Cross-validation: blocks of the fitted recordings, each left out of the fit in turn.
    CrossValidation,
}

impl ValidationMethod {
    /// For a sentence: `on ...`.
    pub fn phrase(self) -> &'static str {
        match self {
            Self::Check => "on the validation run",
            Self::CrossValidation => "in cross-validation",
        }
    }

    /// The same as a label for the head of a table column.
    pub fn label(self) -> &'static str {
        match self {
            Self::Check => "validation",
            Self::CrossValidation => "cross-validation",
        }
    }
}

/// The name of a kind in words: `coulomb friction` for `coulomb_friction`. Some names need a description.
pub fn kind(name: &str) -> String {
    match name {
        "constant_error" => "wrong length or angle".to_owned(),
        // Candidates of this kind are searched only if the friction of the model is fixed.
        "different_runs" => "friction that differs from the fixed values".to_owned(),
        "lumped_mass_placement" => "consistent placement of a lumped mass".to_owned(),
        "periodic_in_time" => "sinusoidal disturbance".to_owned(),
        "two_point_element" => "spring or damper between two points".to_owned(),
        "untied_part" => "separate parameters instead of shared ones".to_owned(),
        _ => name.replace('_', " "),
    }
}

/// The kind of a disturbance in words.
fn disturbance_kind(one: &Disturbance) -> String {
    // A difference names its recordings; different friction of all recordings does not.
    if one.kind == "different_runs" && !one.recordings.is_empty() {
        "difference between recordings".to_owned()
    } else {
        kind(&one.kind)
    }
}

/// A kind with its places: `coulomb friction (a, b)`.
pub fn effect(effect: &LocatedEffect) -> String {
    format!("{} ({})", kind(&effect.kind), effect.at.join(", "))
}

/// Effects as a list for a sentence: `x, y and z`.
pub fn effects(effects: &[LocatedEffect]) -> String {
    joined_by_and(&effects.iter().map(effect).collect::<Vec<_>>())
}

/// The sentence for an effect that the model has already, with one value for several places: one place needs a value of
/// its own.
pub fn shared_value(effect: &LocatedEffect, sharing: &[String]) -> String {
    let at = joined_by_and(&effect.at);
    let all: Vec<String> = effect.at.iter().chain(sharing).cloned().collect();
    format!(
        "The model uses one value for {}. {at} differs from it by the figure above and needs a value of its own.",
        joined_by_and(&all)
    )
}

/// Effects that were found, as a list for a sentence. One that is less likely than not is named with its alternatives,
/// and one that the model has with a shared value as a separate one.
fn found_effects(found: &[IdentifiedEffect], channels: &[String]) -> String {
    let (sharing, found): (Vec<&IdentifiedEffect>, Vec<&IdentifiedEffect>) =
        found.iter().partition(|one| !one.shared_with.is_empty());
    let is_ambiguous =
        |one: &&IdentifiedEffect| one.probability < LACKING_LEAST_PROBABILITY && !one.indistinguishable_from.is_empty();
    let (ambiguous, clear): (Vec<&IdentifiedEffect>, Vec<&IdentifiedEffect>) =
        found.into_iter().partition(is_ambiguous);
    let located =
        |some: &[&IdentifiedEffect]| -> Vec<LocatedEffect> { some.iter().map(|one| one.effect.clone()).collect() };
    let mut names = grouped_effects(&located(&clear), channels);
    let separate = grouped_effects(&located(&sharing), channels);
    names.extend(separate.iter().map(|name| format!("separate values of {name}")));
    names.extend(ambiguous.iter().map(|one| {
        let all: Vec<String> = [&one.effect]
            .into_iter()
            .chain(&one.indistinguishable_from)
            .map(effect)
            .collect();
        let (last, first) = all.split_last().unwrap_or((&all[0], &[]));
        format!(
            "one of {} or {last}, which the recordings do not distinguish",
            first.join(", ")
        )
    }));
    joined_by_and(&names)
}

/// Names of effects for a sentence or a table; a kind at several drives is named once, with all of them. `channels` are
/// the names of the drives.
fn grouped_effects(effects: &[LocatedEffect], channels: &[String]) -> Vec<String> {
    let mut groups: Vec<(&str, Vec<&str>)> = Vec::new();
    let mut names = Vec::new();
    for one in effects {
        let of_kind = || {
            effects
                .iter()
                .filter(|other| other.kind == one.kind && other.at.len() == 1)
        };
        let [place] = one.at.as_slice() else {
            names.push(effect(one));
            continue;
        };
        if of_kind().count() < GROUP_FEWEST_PLACES {
            names.push(effect(one));
        } else if let Some((_, places)) = groups.iter_mut().find(|(kind, _)| *kind == one.kind) {
            places.push(place);
        } else {
            groups.push((&one.kind, vec![place]));
        }
    }
    // Kinds at the same places share them.
    let mut shared: Vec<(Vec<String>, Vec<&str>)> = Vec::new();
    for (name, places) in groups {
        match shared.iter_mut().find(|(_, others)| *others == places) {
            Some((kinds, _)) => kinds.push(kind(name)),
            None => shared.push((vec![kind(name)], places)),
        }
    }
    let shared = shared
        .into_iter()
        .map(|(kinds, places)| format!("{} {}", joined_by_and(&kinds), place_list(&places, channels)));
    shared.chain(names).collect()
}

/// Places in brackets, or that these are all drives.
fn place_list(places: &[&str], channels: &[String]) -> String {
    let are_all_drives = places.len() >= GROUP_FEWEST_PLACES
        && places.len() == channels.len()
        && channels.iter().all(|channel| places.contains(&channel.as_str()));
    if are_all_drives {
        format!("(all {} drives)", channels.len())
    } else {
        format!("({})", places.join(", "))
    }
}

/// The effects that a step of the selection added and dropped; `channels` are the names of the drives.
pub fn step_text(step: &SelectionStep, diagnosis: &ModelDiagnosis, channels: &[String]) -> String {
    // The first step is the model of the file.
    if step.added.is_empty() && step.dropped.is_empty() {
        return "the given model".to_owned();
    }
    // A change that only refines another one at the same time is listed nowhere else under its own name.
    let refines = |one: &&LocatedEffect| {
        let is_listed = |kind: &str, at: &[String]| (kind, at) == (one.kind.as_str(), &one.at);
        let mut listed = diagnosis.disturbances.iter();
        let mut dropped = diagnosis.steps.iter().flat_map(|other| &other.dropped);
        CHANGES_IN_TIME.contains(&one.kind.as_str())
            && !listed.any(|other| is_listed(&other.kind, &other.at))
            && !dropped.any(|other| other == *one)
    };
    let (refining, added): (Vec<LocatedEffect>, Vec<LocatedEffect>) =
        step.added.iter().cloned().partition(|one| refines(&one));
    // Signs show what was added and what became unnecessary.
    let mut says = Vec::new();
    let named = |effects: &[LocatedEffect]| grouped_effects(effects, channels);
    says.extend(named(&added).iter().map(|name| format!("+ {name}")));
    says.extend(
        refining
            .iter()
            .map(|one| format!("+ refinement of the change in time ({})", one.at.join(", "))),
    );
    // An effect that an earlier step added is removed for one of these reasons.
    let is_possible = |one: &LocatedEffect| diagnosis.possible_effects.iter().any(|found| found.effect == *one);
    let is_unlikely = |one: &LocatedEffect| step.added.is_empty() && is_possible(one);
    let (unlikely, unnecessary): (Vec<LocatedEffect>, Vec<LocatedEffect>) =
        step.dropped.iter().cloned().partition(is_unlikely);
    let why = if step.added.is_empty() {
        "not clearly needed"
    } else {
        "replaced"
    };
    says.extend(
        named(&unlikely)
            .iter()
            .map(|name| format!("− {name}: less likely than not")),
    );
    says.extend(named(&unnecessary).iter().map(|name| format!("− {name}: {why}")));
    says.join(" ")
}

/// Whether a noise floor, relative to the force, is no more than the rounding of the recorded numbers.
fn is_rounding(noise_floor: f64) -> bool {
    noise_floor <= NOISE_FREE_ROUNDINGS * FORCE_ROUNDING
}

/// The noise floor as a sentence; errors are compared with it. It is the rms value over all recordings of the
/// part of the residual that is noise.
pub fn noise_floor_text(diagnosis: &ModelDiagnosis) -> String {
    // Errors are compared with this figure.
    let floor = percent(Some(diagnosis.noise_floor));
    if is_rounding(diagnosis.noise_floor) {
        format!("The forces contain no noise; their rounding alone causes errors of about {floor}.")
    } else {
        // Only then a reader asks how an error can be smaller.
        let last = diagnosis.steps.last();
        let is_below = last.is_some_and(|last| last.check < diagnosis.noise_floor);
        let of_all = if is_below {
            " (all recordings together; one recording may have less)"
        } else {
            ""
        };
        format!("The noise is {floor} of the force{of_all}.")
    }
}

/// The noise floor as a label: `noise in the forces`, or `rounding` if the forces are noise-free. `noise_floor`
/// is relative to the force.
pub fn floor_label(noise_floor: f64) -> &'static str {
    if is_rounding(noise_floor) {
        "rounding"
    } else {
        "noise in the forces"
    }
}

/// Why a candidate was rejected, as a sentence for people; `has_findings` states whether the diagnosis
/// found anything.
pub fn refusal(reason: RejectionReason, has_findings: bool) -> &'static str {
    match reason {
        RejectionReason::WrongSign => "a parameter would have an impossible sign",
        RejectionReason::CancelsAnother => "it would only cancel another effect at its place",
        RejectionReason::ImplausibleValue => {
            "its value would be implausible for the size and the forces of this machine"
        }
        RejectionReason::LessLikelyThanNot => "possible, but less likely than not",
        RejectionReason::ExplainedBetter if has_findings => {
            "would lower the residual further, but the search did not select it"
        }
        RejectionReason::ExplainedBetter => "it would lower the error, but the search did not select it",
        RejectionReason::NotConfirmedEverywhere => {
            "not confirmed in all parts of the data (near and far from reversals, both halves)"
        }
        RejectionReason::ExplainsNothing if has_findings => "with the effects found, it explains almost nothing",
        RejectionReason::ExplainsNothing => "explains almost none of the error",
        RejectionReason::OnlyNoiseRemains if has_findings => {
            "with the effects found, it would only fit noise or rounding"
        }
        RejectionReason::OnlyNoiseRemains => "the residual is only noise or rounding",
        RejectionReason::NotConfirmedByValidation => "not confirmed on the validation run",
        RejectionReason::NotConfirmedByFolds => "not confirmed by cross-validation",
        RejectionReason::GainTooSmall => "the gain is too small to matter",
        RejectionReason::TooManyParameters => "the gain is too small for its number of parameters",
        RejectionReason::LinearlyDependent if has_findings => {
            "linearly dependent on the columns of the model with the effects found"
        }
        RejectionReason::LinearlyDependent => "linearly dependent on the columns of the model",
        RejectionReason::NotFinite => "its formula has no finite value at some samples",
    }
}

/// The verdict with figures. The order of the sentences: what may be wrong with the recording or the model,
/// which effects were found and how the error falls, which part of the residual stays unexplained, disturbances
/// in the recordings.
///
/// `channels` are the names of the drives. `judged` states the data on which errors are evaluated.
pub fn verdict(diagnosis: &ModelDiagnosis, channels: &[String], judged: ValidationMethod) -> String {
    let steps = &diagnosis.steps;
    // Without steps there is no verdict.
    let (Some(first), Some(last)) = (steps.first(), steps.last()) else {
        return String::new();
    };
    let noise = noise_floor_text(diagnosis);
    let found = &diagnosis.effects;
    // The first step is the model as it is, the last one has all effects.
    let falls = error_reduction_text(first, last, channels, judged);
    // Each verdict states the error and compares it with the noise.
    let says = match diagnosis.verdict {
        DiagnosisVerdict::Unexplained if is_only_hidden_by_noise(diagnosis) => {
            format!(
                "{} Smaller effects are hidden by the noise: record larger and faster motions, or a better signal of the force.",
                explained_text(
                    "These recordings cannot show whether the model is adequate",
                    diagnosis,
                    last.check,
                    judged
                )
            )
        }
        // After a correction nothing is left to explain, but the recordings as they are stay unexplained.
        DiagnosisVerdict::Unexplained if found.is_empty() && is_all_explained(diagnosis) => format!(
            "{} The recordings as they are count as unexplained: repeat the diagnosis once the fault is corrected.",
            explained_text("The model explains the recordings", diagnosis, last.check, judged)
        ),
        DiagnosisVerdict::Adequate => explained_text("The model is adequate", diagnosis, last.check, judged),
        DiagnosisVerdict::MissingEffect if found.iter().all(|one| one.is_measured) => format!(
            "The model lacks {}, which the positions show. The forces hardly depend on it: the error {} is {} of the \
             force. {noise}",
            found_effects(found, channels),
            judged.phrase(),
            percent(Some(last.check))
        ),
        DiagnosisVerdict::MissingEffect => lacking_text(found, channels, &falls, &noise),
        DiagnosisVerdict::Unexplained => unexplained_verdict(diagnosis, channels, judged, found, &falls),
    };
    // Suspicions come first, since they may make the verdict wrong.
    let all = [first_checks(diagnosis), Some(says), disturbances(diagnosis, channels)];
    all.into_iter().flatten().collect::<Vec<_>>().join(" ")
}

/// What the model lacks, and how the error falls (`falls`) with it.
fn lacking_text(found: &[IdentifiedEffect], channels: &[String], falls: &str, noise: &str) -> String {
    let them = if found.len() == 1 { "it" } else { "them" };
    format!(
        "The model lacks {}. With {them} {falls}. {noise}",
        found_effects(found, channels)
    )
}

/// The verdict where something stays unexplained: effects that were found and how the error falls (`falls`), then what
/// repeats with the state, what changes during a recording, and what follows the time.
fn unexplained_verdict(
    diagnosis: &ModelDiagnosis,
    channels: &[String],
    judged: ValidationMethod,
    found: &[IdentifiedEffect],
    falls: &str,
) -> String {
    let noise = noise_floor_text(diagnosis);
    // Drives with a residual that a model could explain.
    let shares = diagnosis.unexplained.iter().enumerate().map(|(i, d)| {
        let what = if i == 0 {
            " of the squared residual is repeatable"
        } else {
            ""
        };
        format!(
            "{} ({:.0} %{what})",
            channels[*d],
            100.0 * diagnosis.repeatable_share[*d]
        )
    });
    let shares: Vec<String> = shares.collect();
    let sits = if shares.is_empty() {
        String::new()
    } else {
        joined_by_and(&shares)
    };
    let error = diagnosis
        .steps
        .last()
        .map(|last| percent(Some(last.check)))
        .unwrap_or_default();
    // Effects that are less likely than not are listed as possible.
    let (clearly, explains) = if diagnosis.possible_effects.is_empty() {
        ("", "explains")
    } else {
        ("clearly ", "clearly explains")
    };
    let mut says = match (found, sits.is_empty()) {
        ([], true) if has_change_in_time(diagnosis) => vec![format!(
            "No single set of parameters explains a complete recording: the error {} is {} of the force. With changes during the \
             recordings, it is {error}. {noise}",
            judged.phrase(),
            percent(diagnosis.steps.first().map(|first| first.check))
        )],
        ([], true) => vec![format!(
            "The model does not explain all of the recordings: the error {} is {error} of the force. {noise}",
            judged.phrase()
        )],
        ([], false) => vec![format!(
            "The model lacks something that no effect of the library {explains}, on {sits}. The error {} is {error} of the force. \
             {noise}",
            judged.phrase()
        )],
        (found, _) => vec![lacking_text(found, channels, falls, &noise)],
    };
    if !found.is_empty() && !sits.is_empty() {
        says.push(format!(
            "A part of the residual is not {clearly}explained by any effect of the library, on {sits}."
        ));
    }
    // Changes in time are listed with their sizes among the disturbances; here only what follows for the model.
    let changes = changes_in_time(diagnosis);
    if !changes.is_empty() {
        says.push(format!(
            "Something changes during a recording: {}. No single model is valid before and after such a change: split \
             the recording at that time, and identify the parts separately.",
            changes.join("; ")
        ));
    }
    // Drives with the same kind of residual share one sentence.
    let in_time = diagnosis
        .time_residuals
        .iter()
        .map(|one| channels[one.channel].as_str());
    let in_time: Vec<&str> = in_time.collect();
    if !in_time.is_empty() {
        says.push(format!(
            "A part of the residual of {} occurs at certain times only: it does not recur when the state recurs, and it is larger \
             than the noise.",
            in_time.join(", ")
        ));
    }
    says.join(" ")
}

/// A residual that follows the time, as a sentence without the last full stop.
pub(crate) fn time_residual(one: &TimeResidual, channel: &str, unit: &str) -> String {
    let size = format!("{} {unit} rms", significant(one.rms, 3));
    let noise = format!("the noise is {} {unit}", significant(one.noise, 2));
    match one.character {
        ResidualCharacter::Intervals => {
            let mut times: Vec<String> = (one.intervals.iter().take(MOST_INTERVALS))
                .map(|time| {
                    let [from, to] = time.interval.map(|t| significant(t, 4));
                    format!("from {from} to {to} s of {}", time.recording)
                })
                .collect();
            if one.intervals.len() > MOST_INTERVALS {
                times.push(format!(
                    "and further intervals ({})",
                    one.intervals.len() - MOST_INTERVALS
                ));
            }
            format!(
                "{channel} has an unexplained force of {size} in some intervals only ({noise}): {}. Look for contacts, stuck \
                 signals and commands at these times",
                times.join(", ")
            )
        }
        ResidualCharacter::Resonance => format!(
            "{channel} oscillates at about {} Hz with {size} ({noise}), as an elastic drive or a loose joint does. The model has \
             rigid bodies only",
            significant(one.frequency.unwrap_or_default(), 3)
        ),
        ResidualCharacter::Large => format!(
            "{channel} has an unexplained force of {size} ({noise}) that does not repeat when the machine passes the same state. \
             Repeat the motion to see what is noise"
        ),
    }
}

/// Whether the noise is the only reason why a model is not called adequate.
pub(crate) fn is_only_hidden_by_noise(diagnosis: &ModelDiagnosis) -> bool {
    diagnosis.effects.is_empty() && is_all_explained(diagnosis) && diagnosis.is_hidden_by_noise()
}

/// Whether the residual is noise everywhere, and nothing changes within a recording.
fn is_all_explained(diagnosis: &ModelDiagnosis) -> bool {
    diagnosis.unexplained.is_empty() && diagnosis.time_residuals.is_empty() && !has_change_in_time(diagnosis)
}

/// What changes within recordings, as clauses: each kind and place once, with its times.
fn changes_in_time(diagnosis: &ModelDiagnosis) -> Vec<String> {
    let changes = || diagnosis.disturbances.iter().filter(|one| is_change_in_time(one));
    let mut clauses = Vec::new();
    for (k, one) in changes().enumerate() {
        let is_same = |other: &&Disturbance| (&other.kind, &other.at) == (&one.kind, &one.at);
        if changes().take(k).any(|other| is_same(&other)) {
            continue;
        }
        let times = changes().filter(is_same).map(|other| {
            let from = significant(other.interval.unwrap_or_default()[0], 4);
            format!("at t = {from} s of {}", other.recordings.join(", "))
        });
        let times: Vec<String> = times.collect();
        clauses.push(format!("{} {}", what_changes(one), joined_by_and(&times)));
    }
    clauses
}

/// Whether something changes within a recording.
pub(crate) fn has_change_in_time(diagnosis: &ModelDiagnosis) -> bool {
    diagnosis.disturbances.iter().any(is_change_in_time)
}

/// Whether changes within recordings explain the complete error: no effect is missing, and nothing else is unexplained.
pub(crate) fn has_only_changes_in_time(diagnosis: &ModelDiagnosis) -> bool {
    diagnosis.effects.is_empty()
        && diagnosis.unexplained.is_empty()
        && diagnosis.time_residuals.is_empty()
        && has_change_in_time(diagnosis)
}

/// Whether a disturbance is a change within a recording.
fn is_change_in_time(one: &Disturbance) -> bool {
    one.interval.is_some() && CHANGES_IN_TIME.contains(&one.kind.as_str())
}

/// The sentences of a model that lacks nothing; `claim` is the first clause.
fn explained_text(claim: &str, diagnosis: &ModelDiagnosis, error: f64, judged: ValidationMethod) -> String {
    let lowers = if diagnosis.possible_effects.is_empty() {
        "No effect of the library lowers this error."
    } else {
        "No effect of the library clearly lowers this error."
    };
    // Errors are those of the forces without the disturbances that were found.
    let subtracted = if diagnosis.budgets.iter().any(|budget| budget.subtracted > 0.0) {
        "with the disturbances subtracted, "
    } else {
        ""
    };
    format!(
        "{claim}: {subtracted}its error {} is {} of the force. {} {lowers}",
        judged.phrase(),
        percent(Some(error)),
        noise_floor_text(diagnosis)
    )
}

/// How the error falls: of all drives, or, if that hardly changes, of the drive whose error falls most. A small
/// drive would otherwise be hidden by the others.
fn error_reduction_text(
    first: &SelectionStep,
    last: &SelectionStep,
    channels: &[String],
    judged: ValidationMethod,
) -> String {
    let pairs = first.check_by_channel.iter().zip(&last.check_by_channel);
    // The drive whose error falls most, relative to its error before.
    let most = (channels.iter().zip(pairs)).min_by(|(_, a), (_, b)| {
        let share = |(before, after): &(&f64, &f64)| **after / before.max(f64::MIN_POSITIVE);
        share(a).total_cmp(&share(b))
    });
    // The total is used unless it hides the drive.
    let (of, before, after) = match most {
        Some((channel, (before, after))) if last.check > HARDLY_LOWER * first.check && after < before => {
            (format!(" of {channel}"), *before, *after)
        }
        _ => (String::new(), first.check, last.check),
    };
    format!(
        "the error{of} {} falls from {} to {}",
        judged.phrase(),
        percent(Some(before)),
        percent(Some(after))
    )
}

/// Suspicions about the recording or the model, which must be checked before any effect is believed; `None`
/// without any.
fn first_checks(diagnosis: &ModelDiagnosis) -> Option<String> {
    let suspicions = (diagnosis.disturbances.iter()).filter(|one| is_suspicion(one));
    let says: Vec<&str> = suspicions.filter_map(|one| one.description.as_deref()).collect();
    (!says.is_empty()).then(|| {
        format!(
            "Check the recording and the model first: {}.",
            says.join("; ").replace('`', "")
        )
    })
}

/// The faults for which a trial correction was made, as sentences; the verdict on the corrected recordings follows.
pub(crate) fn corrected_text(corrected: &[SuspectedFault]) -> String {
    let with = if corrected.len() == 1 {
        "With it corrected"
    } else {
        "With these corrected"
    };
    format!("{} {with}, ", fault_sentences(corrected))
}

/// The verdict if faults remain that cannot be corrected.
pub(crate) fn unresolved_text(unresolved: &[SuspectedFault]) -> String {
    format!(
        "Check the recording and the model first. {} Until this is clear, nothing can be stated about the model.",
        fault_sentences(unresolved)
    )
}

/// Faults of recordings as sentences.
fn fault_sentences(faults: &[SuspectedFault]) -> String {
    let sentence = |fault: &SuspectedFault| {
        let clause = fault.clause.replace('`', "");
        format!("In {} {clause}.", joined_by_and(&fault.recordings))
    };
    faults.iter().map(sentence).collect::<Vec<_>>().join(" ")
}

/// Whether the recording or the model is in doubt. Until that is checked, no effect is worth adding.
pub(crate) fn has_suspicion(diagnosis: &ModelDiagnosis) -> bool {
    diagnosis.disturbances.iter().any(is_suspicion)
}

/// Disturbances of the recordings by name, each kind once with all its places; `None` without any.
fn disturbances(diagnosis: &ModelDiagnosis, channels: &[String]) -> Option<String> {
    // Kinds in the order of their first disturbance.
    let mut kinds: Vec<(String, Vec<&str>)> = Vec::new();
    for one in diagnosis.disturbances.iter().filter(|d| !is_suspicion(d)) {
        let places = one.at.iter().map(String::as_str);
        let name = disturbance_kind(one);
        match kinds.iter_mut().find(|(kind, _)| *kind == name) {
            Some((_, at)) => at.extend(places.filter(|p| *p != "t")),
            None => kinds.push((name, places.filter(|p| *p != "t").collect())),
        }
    }
    let named: Vec<String> = kinds
        .into_iter()
        .map(|(name, mut at)| {
            // Places keep their order.
            let mut seen = std::collections::HashSet::new();
            // A drive may have the same disturbance in several recordings.
            at.retain(|place| seen.insert(*place));
            match at.as_slice() {
                [] => name,
                at => format!("{name} {}", place_list(at, channels)),
            }
        })
        .collect();
    let is_none = named.is_empty();
    (!is_none).then(|| {
        format!(
            "Disturbances found in the recordings: {}. They are not model errors.",
            named.join(", ")
        )
    })
}

/// The meaning of a kind of effect that is in no library, as a sentence; `None` for other kinds.
pub(crate) fn meaning(kind: &str) -> Option<&'static str> {
    Some(match kind {
        "backlash" => "Play between the motor and the joint.",
        "constant_error" => "A length or an angle of the model file has a wrong value.",
        "dahl_friction" => "Dry friction that builds up over a distance after each reversal.",
        "drive_compliance" => "A drive that deflects elastically between the motor and the joint.",
        "drive_gain" => "The measured force is 1 + gain times the true force, during the whole recording.",
        "encoder_eccentricity" => "An error of the measured position that repeats with every turn.",
        "encoder_zero" => "A wrong zero of a measured position.",
        "force_lag" => "The measured force is the true one after a first-order low-pass with time constant tau.",
        "friction_drift" => "Viscous and dry friction that change slowly during a recording, as by heat.",
        "gain_change" => "The scale of the measured force changes at some time of a recording.",
        "offset_drift" => "The zero of the measured force changes slowly during a recording.",
        "offset_step" => "The zero of the measured force changes at some time of a recording.",
        "payload" => "A load at the end of the mechanism.",
        "payload_change" => "A load that is picked up or put down at some time of a recording.",
        _ => return None,
    })
}
