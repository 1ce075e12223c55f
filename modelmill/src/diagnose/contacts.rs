//! Contacts and pushes in a diagnosis: those that the audit of the recordings found are left out of the search, and a
//! second look at the residual of the last set of effects finds those that a missing effect had hidden.

use modelmill_identify::changes::NormalEquations;
use modelmill_identify::diagnose::{DiagnosisProblem, Disturbance, TimeResidual};

use super::thresholds::{
    CONTACT_GAP_S, CONTACT_LEAST_KNOWN_SHARE, CONTACT_LEAST_RESIDUAL_RATIO, CONTACT_LEAST_REST_SHARE,
    CONTACTS_MOST_SHARE, REPEATED_PLACE_FEWEST_SAMPLES, REPEATED_PLACE_LEAST_SHARE, REPEATED_PLACE_MOST_RESIDUAL,
};
use crate::audit::events::{
    ResidualTrace, event_disturbance, find_events, left_out_interval, motion_of_drives, slowest_rate, standing_states,
};
use crate::model::Model;
use crate::regressors::SegmentList;

/// Time over which decimated forces spread a switch of friction, in samples.
const SMEAR_SAMPLES: f64 = 2.0;

/// Leaves out the contacts and pushes that the audit found, unless their force is a function of a position: an end
/// stop acts at every visit of its place, a push only once.
pub(super) fn leave_out_known_contacts(problem: &mut DiagnosisProblem, all: &SegmentList<'_>) {
    let faults = all.iter().flat_map(|(one, _)| &one.faults);
    let contacts = faults.filter(|one| is_contact(one)).cloned();
    leave_out_contacts(problem, all, merge_contacts(contacts.collect()));
}

/// Whether a disturbance is a contact or a push.
pub(super) fn is_contact(one: &Disturbance) -> bool {
    one.kind == "contact_event"
}

/// Contacts that stay although a search found changes in time, if some are doubtful; `None` if none is. A contact, found
/// without knowledge of changes, may be a change that acts on its drives. Contacts that last for a large part of a recording
/// leave little that could show a change: then none of them stays. `all` are the recordings.
pub(super) fn contacts_beside_changes(disturbances: &[Disturbance], all: &SegmentList<'_>) -> Option<Vec<Disturbance>> {
    let total = |file: &str| -> f64 {
        let segments = all.iter().filter(|(one, _)| one.run.file == file);
        let span = |time: &[f64]| Some(time.last()? - time.first()?);
        segments.filter_map(|(one, _)| span(&one.run.time)).sum()
    };
    let lasts_long = |file: &String| {
        let contacts = disturbances
            .iter()
            .filter(|one| is_contact(one) && one.recordings.contains(file));
        let intervals = contacts.filter_map(|one| one.interval);
        let sum: f64 = intervals.map(|[from, to]| to - from).sum();
        sum > CONTACTS_MOST_SHARE * total(file)
    };
    let contacts: Vec<&Disturbance> = disturbances.iter().filter(|one| is_contact(one)).collect();
    let is_sure = |one: &&Disturbance| !is_beside_change(one, disturbances) && !one.recordings.iter().any(lasts_long);
    let sure: Vec<Disturbance> = contacts.iter().copied().filter(is_sure).cloned().collect();
    (sure.len() < contacts.len()).then_some(sure)
}

/// Whether the recording of a contact has a change in time that acts on one of its drives, as a load does on all.
fn is_beside_change(contact: &Disturbance, disturbances: &[Disturbance]) -> bool {
    let is_change = |one: &&Disturbance| one.interval.is_some() && !is_contact(one);
    let acts_on_it = |one: &Disturbance| {
        let is_of_signal = ["offset_step", "gain_change"].contains(&one.kind.as_str());
        !is_of_signal || one.at.iter().any(|place| contact.at.contains(place))
    };
    disturbances
        .iter()
        .filter(is_change)
        .any(|one| one.recordings.iter().any(|file| contact.recordings.contains(file)) && acts_on_it(one))
}

/// The contacts of a problem that the residual of a search still has, `[drive][sample]`: the audit fits each recording by
/// itself and without the effects, delays and clocks that the search finds, so that their forces may look like contacts.
/// `None` if all are still there. `other_samples` marks samples that are left out for another reason, `[drive][sample]`;
/// contacts that lie there for the most part stay.
pub(super) fn contacts_in_residual(
    problem: &DiagnosisProblem,
    all: &SegmentList<'_>,
    residual: &[Vec<f64>],
    other_samples: &[Vec<bool>],
) -> Option<Vec<Disturbance>> {
    let contacts: Vec<Disturbance> = problem
        .disturbances
        .iter()
        .filter(|one| is_contact(one))
        .cloned()
        .collect();
    if contacts.is_empty() {
        return None;
    }
    let samples = ContactSamples::new(all);
    let is_there = |contact: &Disturbance| {
        let inside = samples.mask(contact.interval, contact);
        let forces = contact.at.iter().zip(&contact.estimates);
        let mut shares = forces
            .filter_map(|(name, force)| {
                let d = problem.layout.channels.iter().position(|one| one == name)?;
                let unknown = [other_samples.get(d), problem.layout.left_out.get(d)];
                let is_known = |i: usize| !unknown.iter().flatten().any(|out| out[i]);
                let within = (0..inside.len()).filter(|i| inside[*i]);
                let rest: Vec<Option<f64>> = within.map(|i| is_known(i).then_some(residual[d][i])).collect();
                share_in_residual(force.value, &rest)
            })
            .peekable();
        // Without samples nothing speaks against a contact.
        shares.peek().is_none() || shares.any(|share| share > CONTACT_LEAST_REST_SHARE)
    };
    let kept: Vec<Disturbance> = contacts.iter().filter(|one| is_there(one)).cloned().collect();
    (kept.len() < contacts.len()).then_some(kept)
}

/// The share of a contact's force that a residual has: the largest magnitude of the medians of three neighbours, or of its
/// values if there are fewer than three. `rest` is the residual during the contact, `None` where it is not known, as at
/// standstill. `None` if too little is known.
fn share_in_residual(force: f64, rest: &[Option<f64>]) -> Option<f64> {
    let known: Vec<f64> = rest.iter().copied().flatten().collect();
    if (known.len() as f64) < CONTACT_LEAST_KNOWN_SHARE * rest.len() as f64 {
        return None;
    }
    if known.len() < 3 {
        let largest = known.iter().map(|value| value.abs()).max_by(f64::total_cmp)?;
        return Some(largest / force.abs());
    }
    let medians = known.windows(3).map(|three| {
        let mut three = [three[0], three[1], three[2]];
        three.sort_by(f64::total_cmp);
        three[1].abs()
    });
    Some(medians.max_by(f64::total_cmp)? / force.abs())
}

/// Leaves out only some contacts, of those that a problem has; `other_samples` are left out for another reason,
/// `[drive][sample]`.
pub(super) fn keep_contacts(
    problem: &mut DiagnosisProblem,
    all: &SegmentList<'_>,
    kept: Vec<Disturbance>,
    other_samples: &[Vec<bool>],
) {
    problem.left_out = other_samples.to_vec();
    problem.disturbances.retain(|one| !is_contact(one));
    leave_out_contacts(problem, all, kept);
}

/// Leaves out the contacts and pushes in the residual of a search, `[drive][sample]`. Returns whether there are any.
pub(super) fn leave_out_late_contacts(
    problem: &mut DiagnosisProblem,
    model: &Model,
    all: &SegmentList<'_>,
    residual: &[Vec<f64>],
) -> bool {
    let mut contacts = Vec::new();
    let mut start = 0;
    for (one, _) in all {
        let n = one.time().len();
        let trace = residual_trace(problem, model, one, residual, start..start + n);
        let events = trace.map_or_else(Vec::new, |trace| find_events(&trace));
        let confirmed = events.iter().filter(|event| event.is_confirmed);
        contacts.extend(confirmed.map(|event| event_disturbance(model, &one.run.file, event)));
        start += n;
    }
    let before = problem.disturbances.len();
    leave_out_contacts(problem, all, merge_contacts(contacts));
    problem.disturbances.len() > before
}

/// Drops the contacts whose forces a residual that follows the time reaches at other times, too, such as the ringing of
/// an elastic joint: then nothing shows that they are contacts. `channels` are the names of the channels.
pub(super) fn drop_doubtful_contacts(
    disturbances: &mut Vec<Disturbance>,
    residuals: &[TimeResidual],
    channels: &[String],
) {
    let largest_residual = |name: &String| {
        let here = residuals.iter().filter(|one| channels.get(one.channel) == Some(name));
        here.map(|one| one.rms).max_by(f64::total_cmp)
    };
    disturbances.retain(|one| {
        // A drive without such a residual shows nothing: it may only feel what another drive does.
        let forces = one.at.iter().zip(&one.estimates);
        let mut judged = forces
            .filter_map(|(name, force)| {
                Some(force.value.abs() > CONTACT_LEAST_RESIDUAL_RATIO * largest_residual(name)?)
            })
            .peekable();
        !is_contact(one) || judged.peek().is_none() || judged.any(|stands_out| stands_out)
    });
}

/// The part of a residual that belongs to one segment; `None` if a pose has no solution or the segment is short.
fn residual_trace(
    problem: &DiagnosisProblem,
    model: &Model,
    one: &crate::segment::RecordingSegment,
    residual: &[Vec<f64>],
    part: std::ops::Range<usize>,
) -> Option<ResidualTrace> {
    let time = one.time();
    if time.len() < super::thresholds::FEWEST_SAMPLES {
        return None;
    }
    let drives = model.row_names().len();
    let samples: Vec<usize> = (0..one.run.time.len()).step_by(one.decimation()).collect();
    let motion = motion_of_drives(model, &standing_states(model, &one.run, &samples, &time), &time)?;
    // A row without drive has no force and no residual.
    let of_segment = |values: Option<&Vec<f64>>| -> Vec<f64> {
        let values = values.and_then(|values| values.get(part.clone()));
        values.map_or_else(|| vec![0.0; part.len()], <[f64]>::to_vec)
    };
    let residual = (0..drives).map(|d| of_segment(residual.get(d))).collect();
    // The forces as the search saw them: without what was subtracted.
    let measured = problem
        .measured
        .0
        .iter()
        .map(|force| of_segment(force.as_ref()))
        .collect();
    let is_left_out = |d: usize, i: usize| problem.left_out.get(d).is_some_and(|out| out[part.start + i]);
    let step = (time[time.len() - 1] - time[0]) / (time.len() - 1) as f64;
    let is_measured = (0..drives)
        .map(|d| {
            (0..time.len())
                .map(|i| !is_left_out(d, i) && !one.has_excluded_input(d, i))
                .collect()
        })
        .collect();
    Some(ResidualTrace {
        motion,
        measured,
        residual,
        is_measured,
        slowest: (0..drives).map(|d| slowest_rate(model, d)).collect(),
        smear: SMEAR_SAMPLES * step,
        time,
    })
}

/// Excludes contacts and pushes for all drives, since a push acts through the mechanism. Samples of a drive that are
/// excluded for another reason, such as its standstill, stay excluded for this drive only.
fn leave_out_contacts(problem: &mut DiagnosisProblem, all: &SegmentList<'_>, contacts: Vec<Disturbance>) {
    let samples = ContactSamples::new(all);
    let about = |contacts: &[Disturbance]| -> Vec<bool> {
        let mut about = vec![false; samples.time.len()];
        for contact in contacts {
            for (out, is) in about
                .iter_mut()
                .zip(samples.mask(contact.interval.map(left_out_interval), contact))
            {
                *out |= is;
            }
        }
        about
    };
    let all_about = about(&contacts);
    let mut kept = contacts;
    kept.retain(|contact| !samples.is_explained_by_place(problem, contact, &all_about));
    if kept.is_empty() {
        return;
    }
    let about = about(&kept);
    let channels = problem.layout.channels.len();
    problem.left_out.resize(channels, vec![false; about.len()]);
    for left_out in &mut problem.left_out {
        for (out, is) in left_out.iter_mut().zip(&about) {
            *out |= is;
        }
    }
    problem.disturbances.extend(kept);
}

/// Times, files and positions of all decimated samples, in the order of the problem.
struct ContactSamples<'a> {
    /// Time of each sample, s.
    time: Vec<f64>,
    /// File of each sample.
    file: Vec<&'a str>,
    /// Positions of the coordinates, `[sample][coordinate]`, rad or m.
    positions: Vec<Vec<f64>>,
}

impl<'a> ContactSamples<'a> {
    /// The samples of all segments.
    fn new(all: &SegmentList<'a>) -> Self {
        let (mut time, mut file, mut positions) = (Vec::new(), Vec::new(), Vec::new());
        for (one, _) in all {
            for (i, t) in one.time().into_iter().enumerate() {
                let at = i * one.decimation();
                time.push(t);
                file.push(one.run.file.as_str());
                positions.push(one.run.q.iter().map(|q| q[at]).collect());
            }
        }
        Self { time, file, positions }
    }

    /// The samples of the recordings of a contact within an interval, s.
    fn mask(&self, interval: Option<[f64; 2]>, contact: &Disturbance) -> Vec<bool> {
        let Some([from, to]) = interval else {
            return vec![false; self.time.len()];
        };
        let samples = self.time.iter().zip(&self.file);
        samples
            .map(|(time, file)| {
                let is_within = (from..=to).contains(time);
                is_within && contact.recordings.iter().any(|one| one == file)
            })
            .collect()
    }

    /// Whether the force of a contact is that of an end stop, which the position of one coordinate explains.
    fn is_explained_by_place(&self, problem: &DiagnosisProblem, contact: &Disturbance, about: &[bool]) -> bool {
        let inside = self.mask(contact.interval, contact);
        // The drive with the largest force decides.
        let largest = contact.estimates.iter().map(|one| one.value);
        let strongest = contact.at.iter().zip(largest).max_by(|a, b| a.1.total_cmp(&b.1));
        let channel = strongest.and_then(|(name, _)| problem.layout.channels.iter().position(|one| one == name));
        let Some(channel) = channel else {
            return false;
        };
        // Each coordinate is tested in both directions, since a stop may be at either end.
        let coordinates = self.positions.first().map_or(0, Vec::len);
        (0..coordinates).any(|i| {
            [1.0, -1.0].into_iter().any(|sign| {
                let along: Vec<f64> = self.positions.iter().map(|q| sign * q[i]).collect();
                let within = along.iter().zip(&inside).filter(|(_, inside)| **inside);
                let mut within: Vec<f64> = within.map(|(x, _)| *x).collect();
                within.sort_by(f64::total_cmp);
                // The place where the event begins: its tenth percentile, which single wrong samples hardly change.
                let Some(place) = within.get(within.len() / 10) else {
                    return false;
                };
                // How far each sample is beyond the place.
                let depths: Vec<f64> = along.iter().map(|x| x - place).collect();
                is_force_beyond_place(problem, channel, &depths, &inside, about)
            })
        })
    }
}

/// Whether the force of an event is that of a stop: the line over the depth, fitted during the event, also predicts the
/// force beyond the place at other times. Without other times nothing shows a stop.
///
/// The force is what the model leaves that is fitted before the place. Beyond it this model may be far off by itself: one
/// that is fitted to all other times must also leave a force beyond the place.
fn is_force_beyond_place(
    problem: &DiagnosisProblem,
    channel: usize,
    depths: &[f64],
    inside: &[bool],
    about: &[bool],
) -> bool {
    // A drive without force shows nothing.
    let Some(measured) = problem.measured.0[channel].as_ref() else {
        return false;
    };
    // Without other samples beyond the place nothing shows that the force acts there at other times.
    let is_otherwise = |i: usize| depths[i] >= 0.0 && !about[i];
    let is_during = |i: usize| depths[i] >= 0.0 && inside[i];
    if (0..depths.len()).filter(|i| is_otherwise(*i)).count() < REPEATED_PLACE_FEWEST_SAMPLES {
        return false;
    }
    let of_all = residual_of_model(problem, channel, measured, |i| !about[i]);
    let mean_square = |is_one: &dyn Fn(usize) -> bool| {
        let chosen: Vec<f64> = (0..of_all.len()).filter(|i| is_one(*i)).map(|i| of_all[i]).collect();
        chosen.iter().map(|x| x * x).sum::<f64>() / chosen.len().max(1) as f64
    };
    if mean_square(&is_otherwise) < REPEATED_PLACE_LEAST_SHARE.powi(2) * mean_square(&is_during) {
        return false;
    }
    let of_before = residual_of_model(problem, channel, measured, |i| !about[i] && depths[i] < 0.0);
    let beyond = |is_one: &dyn Fn(usize) -> bool| -> Vec<(f64, f64)> {
        let chosen = (0..measured.len()).filter(|i| is_one(*i));
        chosen.map(|i| (depths[i], of_before[i])).collect()
    };
    let (during, otherwise) = (beyond(&is_during), beyond(&is_otherwise));
    let Some(line) = fit_line(&during) else {
        return false;
    };
    // The line must explain most of the force at other times.
    let left: f64 = otherwise.iter().map(|(x, y)| (y - line(*x)).powi(2)).sum();
    let whole: f64 = otherwise.iter().map(|(_, y)| y * y).sum();
    left < REPEATED_PLACE_MOST_RESIDUAL * whole
}

/// The force of a channel without that of the model and of friction, both fitted to some samples, `[sample]`: bodies alone
/// would leave the friction.
fn residual_of_model(
    problem: &DiagnosisProblem,
    channel: usize,
    measured: &[f64],
    is_fitted: impl Fn(usize) -> bool,
) -> Vec<f64> {
    let friction = problem.friction.get(3 * channel..3 * channel + 3);
    let columns: Vec<Option<&[f64]>> = (problem.base.iter())
        .chain(friction.unwrap_or_default())
        .map(|column| column.0[channel].as_deref())
        .collect();
    let fitted: Vec<usize> = (0..measured.len()).filter(|i| is_fitted(*i)).collect();
    let some = |values: &[f64]| -> Vec<f64> { fitted.iter().map(|i| values[*i]).collect() };
    let picked: Vec<Option<Vec<f64>>> = columns.iter().map(|column| column.map(some)).collect();
    let picked: Vec<Option<&[f64]>> = picked.iter().map(Option::as_deref).collect();
    // Normal equations are enough, since only predictions are needed.
    let mut moments = NormalEquations::new(columns.len());
    moments.add_rows(&picked, &some(measured));
    let factors = moments.solve().values;
    let rest = |i: usize| {
        let predicted = columns.iter().zip(factors.iter());
        let predicted = predicted.map(|(column, factor)| column.map_or(0.0, |values| factor * values[i]));
        measured[i] - predicted.sum::<f64>()
    };
    (0..measured.len()).map(rest).collect()
}

/// The straight line through some points by least squares.
fn fit_line(points: &[(f64, f64)]) -> Option<impl Fn(f64) -> f64 + use<>> {
    // Means, slope and intercept.
    let n = points.len() as f64;
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    let spread = mean(&|p| (p.0 - x).powi(2));
    let slope = mean(&|p| (p.0 - x) * (p.1 - y)) / spread;
    (spread > 0.0).then_some(move |at: f64| y + slope * (at - x))
}

/// Contacts in the order of the recordings: close ones are joined.
fn merge_contacts(contacts: Vec<Disturbance>) -> Vec<Disturbance> {
    let mut merged: Vec<Disturbance> = Vec::new();
    for contact in contacts {
        // Contacts of one recording are in the order of time.
        let [from, to] = contact.interval.unwrap_or_default();
        if let Some(last) = merged.last_mut()
            && last.recordings == contact.recordings
            && let Some(before) = &mut last.interval
            && from - before[1] < CONTACT_GAP_S
        {
            before[1] = before[1].max(to);
            // The joined contact has the places of both, each with its force.
            for (place, estimate) in contact.at.iter().zip(&contact.estimates) {
                if !last.at.contains(place) {
                    last.at.push(place.clone());
                    last.estimates.push(estimate.clone());
                }
            }
            continue;
        }
        merged.push(contact);
    }
    merged
}

#[cfg(test)]
mod tests {
    use modelmill_identify::diagnose::{EstimatedQuantity, ResidualCharacter};

    use super::*;

    /// A contact is stated only if its force is clearly larger than a residual that follows the time at other times; a
    /// drive without such a residual does not save it.
    #[test]
    fn contacts_in_a_residual_as_large_are_dropped() {
        let channels = ["one".to_owned(), "two".to_owned()];
        let on_both = |forces: &[(&str, f64)]| Disturbance {
            kind: "contact_event".to_owned(),
            at: forces.iter().map(|(at, _)| (*at).to_owned()).collect(),
            estimates: (forces.iter())
                .map(|(_, force)| EstimatedQuantity::new("force", *force, "N m"))
                .collect(),
            recordings: Vec::new(),
            interval: None,
            description: None,
        };
        let contact = |at: &str, force: f64| on_both(&[(at, force)]);
        let all = [
            contact("one", 3.2),
            on_both(&[("one", 3.2), ("two", 0.4)]),
            contact("one", -40.0),
            contact("two", 3.2),
            on_both(&[("one", -40.0), ("two", 0.4)]),
        ];
        let ringing = TimeResidual {
            channel: 0,
            character: ResidualCharacter::Large,
            rms: 2.0,
            noise: 0.05,
            intervals: Vec::new(),
            frequency: None,
        };
        let mut kept = all.to_vec();
        drop_doubtful_contacts(&mut kept, &[ringing], &channels);
        assert_eq!(kept, all[2..]);
    }

    /// A residual has a contact that is in it, but not single wrong samples or noise; where the drive stands for the most
    /// part, nothing is known.
    #[test]
    fn residuals_show_what_is_left_of_a_contact() {
        let push = |size: f64| (0..20).map(move |k| size * (f64::from(k) * std::f64::consts::PI / 19.0).sin());
        let known = |values: Vec<f64>| values.into_iter().map(Some).collect::<Vec<_>>();
        let there = share_in_residual(-2.0, &known(push(-1.9).collect())).expect("known");
        assert!((0.8..1.0).contains(&there), "{there}");
        let mut noise: Vec<f64> = (0..20).map(|k| if k % 2 == 0 { 0.1 } else { -0.1 }).collect();
        noise[7] = 5.0;
        let gone = share_in_residual(2.0, &known(noise)).expect("known");
        assert!(gone < CONTACT_LEAST_REST_SHARE, "{gone}");
        let standing: Vec<Option<f64>> = push(1.9).enumerate().map(|(k, x)| (k > 12).then_some(x)).collect();
        assert_eq!(share_in_residual(2.0, &standing), None);
        // Decimation leaves one or two samples of a short contact.
        assert_eq!(share_in_residual(2.0, &known(vec![0.1, -0.2])), Some(0.1));
        assert_eq!(share_in_residual(2.0, &[]), None);
    }

    /// A contact beside a change of the same recording is doubtful if the change acts on its drive; one of another
    /// recording is not.
    #[test]
    fn contacts_of_changed_recordings_are_doubtful() {
        let at = |kind: &str, place: &str, file: &str| Disturbance {
            kind: kind.to_owned(),
            at: vec![place.to_owned()],
            estimates: Vec::new(),
            recordings: vec![file.to_owned()],
            interval: Some([1.0, 1.5]),
            description: None,
        };
        let contact = at("contact_event", "one", "a.csv");
        for (kind, place, file, is_doubtful) in [
            ("payload_change", "tool", "a.csv", true),
            ("payload_change", "tool", "b.csv", false),
            ("offset_step", "one", "a.csv", true),
            ("offset_step", "two", "a.csv", false),
        ] {
            let change = at(kind, place, file);
            assert_eq!(
                is_beside_change(&contact, &[contact.clone(), change]),
                is_doubtful,
                "{kind} {place} {file}"
            );
        }
    }
}
