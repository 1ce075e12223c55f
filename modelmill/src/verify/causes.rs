//! Causes of failed checks: findings of the diagnosis go in, one message for the drive or parameter comes out.

use modelmill_boundary::message;
use modelmill_boundary::text::Message;
use modelmill_identify::diagnose::Disturbance;

use crate::diagnose::words;
use crate::diagnose::{DiagnosisFindings, EffectEstimate, MissingEffect};
use crate::faults::{RecordingFaultKind, SuspectedFault};
use crate::text::table::{number, significant};

/// Parameters that a cause names at most.
const MOST_PARAMETERS: usize = 3;

/// The cause of an error of a drive along a recording.
pub(super) fn drive_error_cause(findings: &DiagnosisFindings, recording: &str, drive: &str) -> Message {
    let mut causes = fault_causes(findings, Some(recording));
    // Nothing else is known while a fault cannot be corrected.
    if findings.unresolved.is_empty() {
        causes.extend(effect_causes(findings, drive));
        causes.extend(nominal_causes(findings));
        causes.extend(parameter_causes(findings));
        causes.extend(disturbance_causes(findings, recording, drive));
        if causes.is_empty() {
            causes.push(residual_cause(findings, drive));
        }
    }
    Message::join(causes, "; ")
}

/// The cause of a position error along a recording, which each drive may have.
pub(super) fn position_error_cause(findings: &DiagnosisFindings, recording: &str) -> Message {
    let mut causes = fault_causes(findings, Some(recording));
    // Nothing else is known while a fault cannot be corrected.
    if findings.unresolved.is_empty() {
        causes.extend(effect_causes(findings, ""));
        causes.extend(nominal_causes(findings));
        causes.extend(parameter_causes(findings));
        for drive in findings.channels() {
            causes.extend(disturbance_causes(findings, recording, drive));
        }
        if causes.is_empty() {
            let says = "the diagnosis of the forces found no cause; small errors of the forces add up, and the state at the start \
                        has an error of its own";
            causes.push(says.into());
        }
    }
    Message::join(causes, "; ")
}

/// The cause of an estimate that differs from the model.
pub(super) fn parameter_cause(findings: &DiagnosisFindings) -> Message {
    let mut causes = fault_causes(findings, None);
    causes.extend(nominal_causes(findings));
    if causes.is_empty() {
        let says = "the model file has another value than the machine had during these recordings; no effect explains the \
                    difference instead";
        causes.push(says.into());
    }
    Message::join(causes, "; ")
}

/// Values of an effect that was found, its alternatives, and the experiment that decides.
pub(super) fn effect_details(one: &MissingEffect) -> Message {
    let mut says = vec![format!("estimates: {}", estimates_text(&one.estimates))];
    if !one.indistinguishable_from.is_empty() {
        let others = words::effects(&one.indistinguishable_from);
        says.push(format!("the recordings do not distinguish it from {others}"));
    }
    says.extend(one.separating_experiment.clone());
    says.join("; ").into()
}

/// Faults of a recording, or of all, with what to do about them.
fn fault_causes(findings: &DiagnosisFindings, recording: Option<&str>) -> Vec<Message> {
    let all = findings.corrected.iter().chain(&findings.unresolved);
    let has_it = |fault: &&SuspectedFault| recording.is_none_or(|file| fault.recordings.iter().any(|one| one == file));
    all.filter(has_it).map(fault_text).collect()
}

/// A fault with what to do about it. The recording and the model contradict each other; either may be wrong.
pub(super) fn fault_text(fault: &SuspectedFault) -> Message {
    let clause = fault.clause.replace('`', "");
    let other = match fault.kind {
        RecordingFaultKind::WrongSign => ", or the model counts it in the other direction",
        RecordingFaultKind::ExchangedColumns => ", or the model exchanges them",
        _ => "",
    };
    message!("{clause}{other}; {}", fault.advice)
}

/// Missing effects at a drive; if there are none, missing effects at other places.
fn effect_causes(findings: &DiagnosisFindings, drive: &str) -> Vec<Message> {
    let is_here = |one: &&MissingEffect| one.effect.at.iter().any(|place| place == drive);
    let here: Vec<&MissingEffect> = findings.missing.iter().filter(is_here).collect();
    let all: Vec<&MissingEffect> = findings.missing.iter().collect();
    let named = if here.is_empty() { all } else { here };
    let one = |one: &&MissingEffect| {
        let said = words::effect(&one.effect);
        let alternatives = if one.indistinguishable_from.is_empty() {
            String::new()
        } else {
            format!(" or {}", words::effects(&one.indistinguishable_from))
        };
        Message::from(format!(
            "the model lacks {said}{alternatives} ({}; probability {:.2})",
            estimates_text(&one.estimates),
            one.probability
        ))
    };
    named.iter().map(one).collect()
}

/// Effects that explain different parameters instead, with all parameters fixed at the values of the model.
fn nominal_causes(findings: &DiagnosisFindings) -> Vec<Message> {
    let Some(held) = &findings.with_nominal else {
        return Vec::new();
    };
    let known = |effect: &_| findings.missing.iter().any(|one| one.effect == *effect);
    let new = held.missing.iter().filter(|(effect, _)| !known(effect));
    new.map(|(effect, found)| {
        let said = words::effect(effect);
        Message::from(format!(
            "if the parameters of the model are right, {said} ({})",
            estimates_text(found)
        ))
    })
    .collect()
}

/// Parameters whose estimates differ from the model.
fn parameter_causes(findings: &DiagnosisFindings) -> Option<Message> {
    let off = &findings.off_nominal;
    let named = off.iter().take(MOST_PARAMETERS).map(|one| {
        let p = &one.parameter;
        let (value, nominal) = (number(p.value), number(one.nominal));
        format!("{} ({value} {} instead of {nominal})", p.name, p.unit)
    });
    let named: Vec<String> = named.collect();
    let more = match off.len().saturating_sub(named.len()) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    (!named.is_empty()).then(|| {
        let says = "parameters of the machine differ from those of the model";
        format!("{says}: {}{more}", named.join(", ")).into()
    })
}

/// Disturbances of a recording at a drive.
fn disturbance_causes(findings: &DiagnosisFindings, recording: &str, drive: &str) -> Vec<Message> {
    let is_here = |one: &&Disturbance| {
        (one.recordings.is_empty() || one.recordings.iter().any(|file| file == recording))
            && (one.at.is_empty() || one.at.iter().any(|place| place == drive))
    };
    let all: Vec<Disturbance> = (findings.diagnosis.disturbances.iter())
        .filter(is_here)
        .cloned()
        .collect();
    let sentences = words::disturbance_sentences(&all).into_iter();
    sentences
        .map(|says| format!("disturbance of the recording: {}", says.trim_end_matches('.')).into())
        .collect()
}

/// What is known about a residual that nothing explains.
fn residual_cause(findings: &DiagnosisFindings, drive: &str) -> Message {
    let diagnosis = &findings.diagnosis;
    let Some(d) = findings.channels().iter().position(|channel| channel == drive) else {
        return "the diagnosis finds no cause".into();
    };
    let follows_time = diagnosis.time_residuals.iter().find(|one| one.channel == d);
    if diagnosis.unexplained.contains(&d) {
        let share = 100.0 * diagnosis.repeatable_share[d];
        return format!(
            "no known effect explains the residual; {share:.0} % of its square is repeatable, so the model lacks an effect that is \
             in no library"
        )
        .into();
    }
    match follows_time {
        Some(one) => {
            let unit = findings.before.model.force_unit(d);
            words::time_residual(one, drive, unit).into()
        }
        None => "the diagnosis finds no cause: the residual does not repeat with the state".into(),
    }
}

/// Estimates of an effect.
fn estimates_text(estimates: &[EffectEstimate]) -> String {
    let values = estimates.iter().map(|e| {
        let std = e
            .std
            .map_or_else(String::new, |std| format!(" ± {}", significant(std, 2)));
        let unit = if e.unit == "1" { "" } else { &e.unit };
        let said = format!("{} = {}{std} {unit}", e.name, number(e.value));
        said.trim_end().to_owned()
    });
    values.collect::<Vec<String>>().join(", ")
}
