//! What was found, in sentences.

use modelmill_identify::diagnose::{
    DiagnosisVerdict, Disturbance, LocatedEffect, ModelDiagnosis, SelectionStep,
};

use crate::audit::SUSPICIONS;
use crate::text::table::{number, percent, significant};
use modelmill_identify::diagnose::ROUNDING;

/// Where more than this part of the error stays, figures of all drives say little.
const HARDLY: f64 = 0.99;

/// Where errors are judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ValidationMethod {
    /// On recordings that were kept for it.
    Check,
    /// On blocks of the fit that take turns.
    CrossValidation,
}

impl ValidationMethod {
    /// For a sentence: `on ...`.
    pub fn phrase(self) -> &'static str {
        match self {
            Self::Check => "on the check run",
            Self::CrossValidation => "in cross-validation",
        }
    }

    /// For a column.
    pub fn label(self) -> &'static str {
        match self {
            Self::Check => "check",
            Self::CrossValidation => "cross",
        }
    }
}

/// The name of a kind in words.
pub fn kind(name: &str) -> String {
    name.replace('_', " ")
}

/// A kind with its places.
pub fn effect(effect: &LocatedEffect) -> String {
    format!("{} ({})", kind(&effect.kind), effect.at.join(", "))
}

/// Effects in a row.
pub fn effects(effects: &[LocatedEffect]) -> String {
    let all: Vec<String> = effects.iter().map(effect).collect();
    match all.as_slice() {
        [] => "nothing".to_owned(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// What a step of the ladder did.
pub fn rung(rung: &SelectionStep) -> String {
    if rung.added.is_empty() && rung.dropped.is_empty() {
        return "the model as it is".to_owned();
    }
    let mut says = Vec::new();
    says.extend(rung.added.iter().map(|one| format!("+ {}", effect(one))));
    says.extend(rung.dropped.iter().map(|one| format!("− {}", effect(one))));
    says.join(" ")
}

/// What the errors are held against: the noise in the forces, or rounding where there is none.
pub fn noise_floor_text(diagnosis: &ModelDiagnosis) -> String {
    let floor = percent(Some(diagnosis.noise_floor));
    if diagnosis.noise_floor <= 2.0 * ROUNDING {
        format!("there is no noise in the forces, and what is below {floor} is rounding")
    } else {
        format!("the noise in the forces is {floor}")
    }
}

/// The verdict with figures, what may be wrong with the input first of all, then success first: what was found, what is left and of which kind, what the recordings have besides.
pub fn verdict(
    diagnosis: &ModelDiagnosis,
    channels: &[String],
    judged: ValidationMethod,
) -> String {
    let ladder = &diagnosis.steps;
    let (Some(first), Some(last)) = (ladder.first(), ladder.last()) else {
        return String::new();
    };
    let noise = noise_floor_text(diagnosis);
    let found: Vec<LocatedEffect> = diagnosis.effects.iter().map(|f| f.effect.clone()).collect();
    let falls = error_reduction_text(first, last, channels, judged);
    let them = if found.len() == 1 { "it" } else { "them" };
    let says = match diagnosis.verdict {
        DiagnosisVerdict::Adequate => format!(
            "The model is adequate: it misses the forces by {} {}; {noise}. No effect of the library would lower that where it \
             was not fitted.",
            percent(Some(last.check)),
            judged.phrase()
        ),
        DiagnosisVerdict::MissingEffect => format!(
            "The model lacks {}. With {them} {falls}; {noise}.",
            effects(&found)
        ),
        DiagnosisVerdict::Unexplained => {
            let of = |d: &usize| 100.0 * diagnosis.repeatable_share[*d];
            let sits: Vec<String> = (diagnosis.unexplained.iter())
                .map(|d| {
                    format!(
                        "{} ({:.0} % of what is left there comes again with the state)",
                        channels[*d],
                        of(d)
                    )
                })
                .collect();
            let sits = sits.join(" and ");
            if found.is_empty() {
                format!(
                    "Something is missing that no effect of the library explains, in {sits}. The model misses the forces by {} \
                     {}; {noise}.",
                    percent(Some(last.check)),
                    judged.phrase()
                )
            } else {
                format!(
                    "The model lacks {}: with {them} {falls}; {noise}. Something is left that no effect of the library \
                     explains, in {sits}.",
                    effects(&found)
                )
            }
        }
    };
    let all = [
        suspicion_text(diagnosis),
        Some(says),
        disturbances_text(diagnosis),
    ];
    all.into_iter().flatten().collect::<Vec<_>>().join(" ")
}

/// How the error falls: of all drives, or where that hardly does, of the drive whose error falls most, since the others hide it.
fn error_reduction_text(
    first: &SelectionStep,
    last: &SelectionStep,
    channels: &[String],
    judged: ValidationMethod,
) -> String {
    let pairs = first.check_by_channel.iter().zip(&last.check_by_channel);
    let most = (channels.iter().zip(pairs)).min_by(|(_, a), (_, b)| {
        let share = |(before, after): &(&f64, &f64)| **after / before.max(f64::MIN_POSITIVE);
        share(a).total_cmp(&share(b))
    });
    let (of, before, after) = match most {
        Some((channel, (before, after))) if last.check > HARDLY * first.check && after < before => {
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

/// What is to be cleared up before anything else is believed.
fn suspicion_text(diagnosis: &ModelDiagnosis) -> Option<String> {
    let suspicions = (diagnosis.disturbances.iter()).filter(|one| is_suspicion(one));
    let says: Vec<&str> = suspicions
        .filter_map(|one| one.description.as_deref())
        .collect();
    (!says.is_empty()).then(|| {
        format!(
            "Look first at what may be wrong with the recording or the model: {}.",
            says.join("; ").replace('`', "")
        )
    })
}

/// Whether something is: until then no effect is worth adding.
pub(crate) fn has_suspicion(diagnosis: &ModelDiagnosis) -> bool {
    diagnosis.disturbances.iter().any(is_suspicion)
}

fn is_suspicion(one: &Disturbance) -> bool {
    SUSPICIONS.contains(&one.kind.as_str())
}

/// What the recordings have besides, by name.
fn disturbances_text(diagnosis: &ModelDiagnosis) -> Option<String> {
    let mut kinds: Vec<(&str, Vec<&str>)> = Vec::new();
    for one in diagnosis.disturbances.iter().filter(|d| !is_suspicion(d)) {
        let places = one.at.iter().map(String::as_str);
        match kinds.iter_mut().find(|(kind, _)| *kind == one.kind) {
            Some((_, at)) => at.extend(places.filter(|p| *p != "t")),
            None => kinds.push((&one.kind, places.filter(|p| *p != "t").collect())),
        }
    }
    let named: Vec<String> = kinds
        .into_iter()
        .map(|(name, mut at)| {
            let mut seen = std::collections::HashSet::new();
            at.retain(|place| seen.insert(*place));
            match at.as_slice() {
                [] => kind(name),
                at => format!("{} ({})", kind(name), at.join(", ")),
            }
        })
        .collect();
    let is_none = named.is_empty();
    (!is_none).then(|| {
        format!(
            "The recordings have besides, and the model does not lack: {}.",
            named.join(", ")
        )
    })
}

/// What a disturbance is, in a sentence.
pub fn disturbance(one: &Disturbance) -> String {
    let at = one.at.join(", ");
    let value = |name: &str| {
        let found = one.estimates.iter().find(|value| value.name == name);
        found.map_or_else(String::new, |q| {
            format!("{} {}", significant(q.value, 3), q.unit)
                .trim_end()
                .to_owned()
        })
    };
    let all: Vec<String> = (one.estimates.iter())
        .map(|q| {
            let deviation = q.standard_deviation;
            let deviation =
                deviation.map_or_else(String::new, |std| format!(" ± {}", significant(std, 2)));
            let said = format!("{} {}{deviation} {}", q.name, number(q.value), q.unit);
            said.trim_end().to_owned()
        })
        .collect();
    let all = all.join(", ");
    match one.kind.as_str() {
        "coloured_noise" => format!(
            "the noise of {at} is {} and coloured, mostly below about {}; it does not come again with the state",
            value("noise"),
            value("corner")
        ),
        "quantised_force" => format!("the force of {at} is read in steps of {}", value("step")),
        "outliers" => {
            let share = one.estimates.iter().find(|value| value.name == "share");
            format!(
                "outliers in {at}: {} of the samples, off by {} in the mean square; they count no more",
                percent(share.map(|share| share.value)),
                value("size")
            )
        }
        "periodic_in_time" => {
            let frequencies = one
                .estimates
                .iter()
                .filter(|value| value.name == "frequency");
            let frequencies: Vec<String> = frequencies
                .map(|value| format!("{} Hz", significant(value.value, 4)))
                .collect();
            format!(
                "a hum of {} on {at} at {}: periodic in time, not in the state",
                value("amplitude"),
                frequencies.join(" and ")
            )
        }
        "offset_drift" => format!("the zero of the force of {at} drifts in time: {all}"),
        "friction_drift" => {
            format!(
                "the friction of {at} changes in the course of a recording, as it does in time when it warms up: {all}"
            )
        }
        "encoder_eccentricity" => format!(
            "the encoder of {at} errs as an eccentric one does, {} times per turn: {all}",
            value("times_per_turn")
        ),
        "different_runs" => {
            format!("the friction of {at} differs from that of the values that are held: {all}")
        }
        "encoder_zero" => format!(
            "the encoder of {at} reads too much throughout, as one with another zero than the model does: {all}"
        ),
        "contact_event" => {
            let [from, to] = one.interval.unwrap_or_default();
            format!(
                "a contact or push from {} to {} s of {}, on {at}: {all}; this time is left out",
                significant(from, 4),
                significant(to, 4),
                one.recordings.join(", ")
            )
        }
        other => format!("{} ({at}): {all}", kind(other)),
    }
}

/// Text in lines of some letters at most, broken between words.
pub fn lines(text: &str, letters: usize) -> Vec<String> {
    let mut lines: Vec<String> = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.len() - 1;
        let line = &mut lines[line];
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > letters {
            lines.push(word.to_owned());
        } else {
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
    }
    lines
}

/// What a kind of effect does that no library holds, in a sentence.
pub(crate) fn meaning(kind: &str) -> Option<&'static str> {
    Some(match kind {
        "drive_gain" => "The force is read 1 + gain times as large as it is.",
        "force_lag" => {
            "The force is read through a low-pass of first order with the time constant tau."
        }
        "dahl_friction" => "Dry friction that grows to its size over a length after each reversal.",
        _ => return None,
    })
}
