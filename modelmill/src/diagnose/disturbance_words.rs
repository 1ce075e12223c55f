//! Sentences about disturbances of recordings. Input are disturbances of a diagnosis, output is English text without line
//! breaks.

use modelmill_identify::diagnose::{Disturbance, EstimatedQuantity};

use crate::text::names::joined_by_and;
use crate::text::table::{all_digits, number, percent, significant};

use super::thresholds::BRIEF_MOST_S;
use super::words::kind;

/// Disturbances as sentences; noise and outliers of several drives share one.
pub fn disturbance_sentences(all: &[Disturbance]) -> Vec<String> {
    let mut sentences = Vec::new();
    for (k, one) in all.iter().enumerate() {
        let alike: Vec<&Disturbance> = all.iter().filter(|other| other.kind == one.kind).collect();
        let common = match one.kind.as_str() {
            "coloured_noise" => {
                "have coloured noise. It does not repeat when the machine passes the same state, so no model can explain it"
            }
            "outliers" => "have outliers. The fit ignores them",
            _ => "",
        };
        if alike.len() < 2 || common.is_empty() {
            sentences.push(format!("{}.", one.description.as_deref().unwrap_or_default()));
        } else if all[..k].iter().all(|earlier| earlier.kind != one.kind) {
            let sizes: Vec<String> = alike.iter().map(|one| sized_place(one)).collect();
            sentences.push(format!("{} {common}.", joined_by_and(&sizes)));
        }
    }
    sentences
}

/// The place of noise or outliers with their size in brackets.
fn sized_place(one: &Disturbance) -> String {
    let at = one.at.join(", ");
    match one.kind.as_str() {
        "outliers" => format!(
            "{at} ({} of the samples, {} rms)",
            share_of_samples(one),
            estimate(one, "size")
        ),
        _ => format!("{at} ({} below {})", estimate(one, "noise"), estimate(one, "corner")),
    }
}

/// The estimate of a disturbance with its unit, rounded for a sentence; empty if there is none.
fn estimate(one: &Disturbance, name: &str) -> String {
    let found = one.estimates.iter().find(|value| value.name == name);
    found.map_or_else(String::new, |q| {
        format!("{} {}", significant(q.value, 3), q.unit).trim_end().to_owned()
    })
}

/// The share of the samples that are outliers.
fn share_of_samples(one: &Disturbance) -> String {
    let share = one.estimates.iter().find(|value| value.name == "share");
    percent(share.map(|share| share.value))
}

/// All estimates with standard deviations and units; `words` writes the name of an estimate.
fn values_text(one: &Disturbance, words: impl Fn(&str) -> String) -> String {
    values_of(one.estimates.iter(), words)
}

/// Some estimates with standard deviations and units; `words` writes the name of an estimate.
fn values_of<'a>(estimates: impl Iterator<Item = &'a EstimatedQuantity>, words: impl Fn(&str) -> String) -> String {
    let values: Vec<String> = estimates
        .map(|q| {
            let deviation = q.standard_deviation;
            let deviation = deviation.map_or_else(String::new, |std| format!(" ± {}", significant(std, 2)));
            let unit = if q.unit == "1" { "" } else { &q.unit };
            let value = match q.standard_deviation {
                Some(_) => all_digits(q.value),
                None => number(q.value),
            };
            let quantity_text = format!("{} {value}{deviation} {unit}", words(&q.name));
            quantity_text.trim_end().to_owned()
        })
        .collect();
    values.join(", ")
}

/// A drifting zero of a force as a clause. Values within twice their uncertainty are left out, unless all are.
fn offset_drift(one: &Disturbance, at: &str) -> String {
    let is_clear = |q: &&EstimatedQuantity| q.value.abs() > 2.0 * q.standard_deviation.unwrap_or(0.0);
    let is_change = |q: &&EstimatedQuantity| q.name.starts_with(OFFSET_CHANGE);
    let clear = || one.estimates.iter().filter(is_clear);
    if clear().any(|q| is_change(&q)) {
        let all = values_of(clear(), offset_name);
        format!("the zero of the measured force of {at} drifts with time: {all}")
    } else if clear().next().is_some() && one.estimates.iter().filter(is_change).count() > 1 {
        let all = values_of(clear(), |name| name.strip_prefix("F0 ").unwrap_or(name).to_owned());
        format!("the zero of the measured force of {at} differs between the recordings: {all}")
    } else {
        let all = values_text(one, offset_name);
        format!("the zero of the measured force of {at} drifts with time: {all}")
    }
}

/// How the name of a change of an offset starts; the recording follows.
const OFFSET_CHANGE: &str = "change of F0 in ";

/// The estimate of an offset drift in words, by its name.
fn offset_name(name: &str) -> String {
    if let Some(recording) = name.strip_prefix(OFFSET_CHANGE) {
        format!("change from start to end of {recording}")
    } else if let Some(recording) = name.strip_prefix("F0 in ") {
        format!("offset in the middle of {recording}")
    } else {
        name.to_owned()
    }
}

/// A disturbance as a sentence without the last full stop; sizes have units.
pub fn disturbance(one: &Disturbance) -> String {
    let at = one.at.join(", ");
    let value = |name: &str| estimate(one, name);
    let all = values_text(one, str::to_owned);
    match one.kind.as_str() {
        // Each kind says what it is and what follows for the model.
        "coloured_noise" => format!(
            "{at} has coloured noise of {}, mostly below about {}. It does not repeat when the machine passes the same state, so no model \
             can explain it",
            value("noise"),
            value("corner")
        ),
        "quantised_force" => format!("the measured force of {at} is quantised in steps of {}", value("step")),
        "outliers" => format!(
            "{at} has outliers: {} of the samples, {} rms. The fit ignores them",
            share_of_samples(one),
            value("size")
        ),
        "periodic_in_time" => {
            // A hum may have several frequencies.
            let frequencies = one.estimates.iter().filter(|value| value.name == "frequency");
            let frequencies: Vec<String> = frequencies
                .map(|value| format!("{} Hz", significant(value.value, 4)))
                .collect();
            format!(
                "{at} has a sinusoidal disturbance (hum) of {} at {}: it is periodic in time and not a function of the state",
                value("amplitude"),
                frequencies.join(" and ")
            )
        }
        "offset_drift" => offset_drift(one, &at),
        "friction_drift" => {
            format!("the friction of {at} changes during a recording, as it does when a joint warms up: {all}")
        }
        "encoder_eccentricity" => format!(
            "the encoder of {at} has the error of an eccentric disc, {} times per turn: {all}",
            value("times_per_turn")
        ),
        "different_runs" => {
            format!("the friction of {at} differs from the fixed values of the model: {all}")
        }
        "time_base" if one.estimates.iter().any(|value| value.name == "share") => {
            let share = one.estimates.iter().find(|value| value.name == "share");
            let (percent, deviation) = share.map_or((0.0, None), |e| {
                (100.0 * e.value, e.standard_deviation.map(|std| 100.0 * std))
            });
            let deviation = deviation.map_or_else(String::new, |std| format!(" ± {}", significant(std, 2)));
            let is = if percent > 0.0 { "longer" } else { "shorter" };
            format!(
                "recorded times are {}{deviation} % {is} than true ones, as with a clock or a sampling rate that is not the \
                 stated one. The recordings cannot distinguish this from lengths of the model that are all {} % too {}",
                significant(percent.abs(), 3),
                significant(2.0 * percent.abs(), 2),
                if percent > 0.0 { "short" } else { "long" }
            )
        }
        "encoder_zero" => {
            format!("the encoder of {at} has a constant offset, since its zero differs from that of the model: {all}")
        }
        "signal_delay" => format!(
            "the signal of {at} has another delay than the model file gives: the force acts later by {all}. Correct `delay` in \
             its [[actuator]]"
        ),
        "contact_event" => {
            let [from, to] = one.interval.unwrap_or_default();
            format!(
                "a contact or push from {} to {} s of {}, on {at}: {all}. The fit ignores this time",
                significant(from, 4),
                significant(to, 4),
                one.recordings.join(", ")
            )
        }
        "gain_change" | "offset_step" | "payload_change" if one.interval.is_some() => {
            let [from, to] = one.interval.unwrap_or_default().map(|t| significant(t, 4));
            let runs = one.recordings.join(", ");
            let when = if is_brief_force(one) {
                format!("from {from} to {to} s")
            } else {
                format!("at t = {from} s and keeps the new value until {to} s")
            };
            format!("{} {when} ({runs}): {all}", what_changes(one))
        }
        other => format!("{} ({at}): {all}", kind(other)),
    }
}

/// Whether a disturbance is a force that acts only briefly: an offset that returns so soon may be a contact or a push.
pub(crate) fn is_brief_force(one: &Disturbance) -> bool {
    let lasts = one.interval.map(|[from, to]| to - from);
    one.kind == "offset_step" && lasts.is_some_and(|time| time < BRIEF_MOST_S)
}

/// What a change within a recording changes, as a clause.
pub(super) fn what_changes(one: &Disturbance) -> String {
    let at = one.at.join(", ");
    match one.kind.as_str() {
        "gain_change" => format!("the scale of the measured force of {at} changes"),
        "offset_step" if is_brief_force(one) => {
            format!("a contact or push acts on {at}, or the zero of its measured force jumps,")
        }
        "offset_step" => format!("the zero of the measured force of {at} jumps"),
        _ => format!("the load on {at} changes"),
    }
}
