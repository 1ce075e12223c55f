//! Contacts and pushes: for an interval of time forces act that no parameters explain. A stretch goes in; its events, told with
//! their times, drives and sizes, come out.
//!
//! The regressor with friction and an offset of every drive is fitted to the forces by Huber's function, so that an event does
//! not pull the fit to itself. A law that the model lacks leaves errors that come again with the motion; an event is rare, lasts,
//! and stands far above all that the rest of the run leaves.
//!
//! Decision: an event must not repeat where position, rate, acceleration and force of its drive are alike. If it
//! repeats, it is a law that the model lacks.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::diagnose::{Disturbance, Quantity};
use modelmill_identify::{Note, robust_fit};
use nalgebra::DVector;

use super::rows::Rows;
use crate::model::Model;
use crate::stretch::Stretch;
use crate::text::table::significant;

/// Samples that are looked at.
const LOOKED_AT: usize = 4000;
/// Samples per second that are looked at in a long run.
const FINE: f64 = 25.0;
/// Samples whose median counts: single outliers are none.
const FEWEST_TOGETHER: usize = 5;
const MOST_TOGETHER: usize = 11;
/// An event stands so many times above what four fifths of the run stay below.
const ABOVE: f64 = 5.0;
const USUAL: f64 = 0.8;
/// And it is at least this part of the drive's force.
const LEAST: f64 = 0.02;
/// What happens more often, or for longer, is how the machine is.
const MOST: usize = 4;
const LONGEST: f64 = 0.15;
/// An event lasts at least so long, s.
const SHORTEST: f64 = 0.1;
/// So many samples of an event are held against the nearest of the rest of the run: none further than so many deviations of the
/// states, with less than this part of what is left.
const COMPARED: usize = 40;
const NEIGHBOURS: usize = 5;
const NEAR: f64 = 1.0;
const ALIKE: f64 = 0.4;
/// Part of its fastest rate below which a drive may turn round.
const SLOW: f64 = 0.1;

/// An interval in which forces act that no parameters explain.
#[derive(Clone, Debug)]
pub(crate) struct Event {
    /// When it begins and ends, s.
    pub(crate) from: f64,
    pub(crate) to: f64,
    /// The drives on which it shows, each with the largest force that is not explained and with what is usual.
    pub(crate) drives: Vec<(usize, f64, f64)>,
}

/// Remarks on the events of a stretch; their forces count no more where they are to be left out.
pub(super) fn found(model: &Model, data: &mut Stretch, leave_out: bool) -> Vec<Note> {
    let events = events(model, data).unwrap_or_default();
    let names = model.drives();
    let mut notes = Vec::new();
    for event in &events {
        let drives: Vec<String> = event
            .drives
            .iter()
            .map(|(d, largest, usual)| {
                format!(
                    "`{}` by up to {} {} where {} is usual",
                    names[*d],
                    significant(*largest, 3),
                    model.force_unit(*d),
                    significant(*usual, 2)
                )
            })
            .collect();
        let option = Remedy::option(OptionName::LeaveOutEvents);
        notes.push(Note::warning(message!(
            "From {} to {} s of {} forces differ from all that parameters explain, {}, as in a contact or a push{}",
            significant(event.from, 5),
            significant(event.to, 5),
            data.run.file,
            drives.join(" and "),
            if leave_out {
                message!(". They are left out of fits and figures ({}).", option)
            } else {
                message!("; {} leaves them out of fits and figures.", option)
            }
        )));
    }
    for event in &events {
        let drives = event.drives.iter();
        data.faults.push(Disturbance {
            kind: "contact_event".to_owned(),
            at: drives.clone().map(|(d, _, _)| names[*d].clone()).collect(),
            estimates: drives
                .map(|(d, largest, _)| Quantity::new("largest", *largest, model.force_unit(*d)))
                .collect(),
            recordings: vec![data.run.file.clone()],
            interval: Some([event.from, event.to]),
            says: None,
        });
    }
    if leave_out {
        leave_out_events(data, &events);
    }
    notes
}

/// Forces within events count no more.
pub(crate) fn leave_out_events(data: &mut Stretch, events: &[Event]) {
    if events.is_empty() {
        return;
    }
    let run = &mut data.run;
    if run.left_out.is_empty() {
        let drives = run.force.as_ref().map_or(0, Vec::len);
        run.left_out = vec![vec![false; run.time.len()]; drives];
    }
    for (i, time) in run.time.iter().enumerate() {
        let is_in = |event: &Event| (event.from..=event.to).contains(time);
        if events.iter().any(is_in) {
            run.left_out.iter_mut().for_each(|out| out[i] = true);
        }
    }
}

/// The events of a stretch; `None` where too little is there to tell.
pub(crate) fn events(model: &Model, data: &Stretch) -> Option<Vec<Event>> {
    let run = &data.run;
    let forces = run.force.as_deref()?;
    let n = run.time.len();
    let duration = run.time.last()? - run.time.first()?;
    let wanted = LOOKED_AT.max(whole(FINE * duration));
    let samples: Vec<usize> = (0..n).step_by((n / wanted).max(1)).collect();
    let rate = samples.len() as f64 / duration;
    let together = whole(SHORTEST * rate).clamp(FEWEST_TOGETHER, MOST_TOGETHER);
    if samples.len() < 40 * MOST_TOGETHER {
        return None;
    }
    let rest = Unexplained::of(model, data, forces, &samples)?;
    let levels: Vec<Level> = (0..forces.len()).map(|d| rest.level(d, together)).collect();
    let flagged: Vec<bool> = (0..samples.len())
        .map(|i| levels.iter().any(|level| level.values[i] > level.bound))
        .collect();
    let is_idle = |i: usize| (levels.iter()).all(|level| level.reverses[i]);
    let mut events = Vec::new();
    let mut lasted = 0;
    let mut i = 0;
    while i < flagged.len() {
        let start = i;
        // Short lulls belong to the event about them, and so does a reversal.
        let mut end = i;
        let mut lull = 0;
        while i < flagged.len() && (flagged[i] || (end > start && lull < 2 * together)) {
            if flagged[i] {
                end = i + 1;
                lull = 0;
            } else if !is_idle(i) {
                lull += 1;
            }
            i += 1;
        }
        let reach = |k: usize| run.time[samples[k.min(samples.len() - 1)]];
        let [from, to] = [
            reach(start.saturating_sub(together / 2)),
            reach(end + together / 2),
        ];
        let lasts = |end: usize| reach(end - 1) - reach(start) >= SHORTEST;
        if end > start && lasts(end) {
            let around = start.saturating_sub(together)..end + together;
            let concerned = levels.iter().enumerate().filter_map(|(d, level)| {
                let is_in = |i: &usize| level.values[*i] > level.bound;
                let within: Vec<usize> = (start..end).filter(is_in).collect();
                let largest = within.iter().map(|i| level.values[*i]).reduce(f64::max)?;
                let comes_again = rest.comes_again(d, &within, &around, &level.reverses);
                (!comes_again).then_some((d, largest, level.usual))
            });
            let drives: Vec<(usize, f64, f64)> = concerned.collect();
            lasted += end - start;
            if !drives.is_empty() {
                events.push(Event { from, to, drives });
            }
        }
        i = i.max(start + 1);
    }
    let is_rare = events.len() <= MOST && (lasted as f64) < LONGEST * flagged.len() as f64;
    is_rare.then_some(events)
}

/// What no parameters explain of the forces.
struct Unexplained {
    drives: usize,
    rest: DVector<f64>,
    measured: DVector<f64>,
    rows: Rows,
    counts: Vec<bool>,
}

/// What is left of a drive's force along a run: medians of neighbours, what is usual of them, and what is too much.
struct Level {
    values: Vec<f64>,
    reverses: Vec<bool>,
    usual: f64,
    bound: f64,
}

impl Unexplained {
    fn of(model: &Model, data: &Stretch, forces: &[Vec<f64>], samples: &[usize]) -> Option<Self> {
        let drives = forces.len();
        let rows = Rows::new(model, data, samples)?;
        let of_samples = samples
            .iter()
            .flat_map(|k| forces.iter().map(move |force| force[*k]));
        let measured = DVector::from_iterator(samples.len() * drives, of_samples);
        let counts: Vec<bool> = (samples.iter())
            .flat_map(|k| (0..drives).map(move |d| data.run.counts(d, *k)))
            .collect();
        // A long run is fitted on a part of its samples.
        let every = (samples.len() / LOOKED_AT).max(1);
        let some: Vec<usize> = (0..samples.len())
            .step_by(every)
            .flat_map(|i| i * drives..(i + 1) * drives)
            .collect();
        let some_count: Vec<bool> = some.iter().map(|row| counts[*row]).collect();
        let some_measured = measured.select_rows(&some);
        let fit = robust_fit(&rows.regressor.every(every), &some_measured, &some_count)?;
        let mut rest = &measured - rows.regressor.times(fit.values.as_slice());
        for (rest, _) in rest.iter_mut().zip(&counts).filter(|(_, counts)| !**counts) {
            *rest = 0.0;
        }
        Some(Self {
            drives,
            rest,
            measured,
            rows,
            counts,
        })
    }

    fn samples(&self) -> usize {
        self.counts.len() / self.drives
    }

    fn level(&self, d: usize, together: usize) -> Level {
        let n = self.samples();
        let at = |i: usize| i * self.drives + d;
        let size = (0..n).map(|i| self.measured[at(i)].powi(2)).sum::<f64>();
        let size = (size / n as f64).sqrt();
        let reverses = reversing(&self.rows.motion[1][d]);
        let values: Vec<f64> = (0..n)
            .map(|i| {
                let start = i.saturating_sub(together / 2);
                let end = (start + together).min(n);
                if reverses[start..end].contains(&true) {
                    return 0.0;
                }
                quantile((start..end).map(|k| self.rest[at(k)].abs()).collect(), 0.5)
            })
            .collect();
        let usual = quantile(values.clone(), USUAL);
        Level {
            bound: (ABOVE * usual).max(LEAST * size),
            values,
            reverses,
            usual,
        }
    }

    /// Whether what is left of a drive's force at some samples comes again where its position, rate, acceleration and force are
    /// alike, outside of a range: then it is a law that the model lacks. So it is taken to be where they are nowhere alike.
    fn comes_again(
        &self,
        d: usize,
        within: &[usize],
        around: &std::ops::Range<usize>,
        reverses: &[bool],
    ) -> bool {
        let n = self.samples();
        let at = |i: usize| i * self.drives + d;
        let explained: Vec<f64> = (0..n)
            .map(|i| self.measured[at(i)] - self.rest[at(i)])
            .collect();
        let states = [
            &self.rows.motion[0][d],
            &self.rows.motion[1][d],
            &self.rows.motion[2][d],
            &explained,
        ];
        let scales = states.map(|values| {
            let mean = values.iter().sum::<f64>() / n as f64;
            let sum: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
            (n as f64 / sum.max(f64::MIN_POSITIVE)).sqrt()
        });
        let others: Vec<usize> = (0..n)
            .filter(|i| !around.contains(i) && !reverses[*i] && self.counts[at(*i)])
            .collect();
        let some = within
            .iter()
            .step_by(within.len().div_ceil(COMPARED).max(1));
        let (mut alone, mut asked) = (0, 0);
        for i in some {
            let mut near: Vec<(f64, usize)> = others
                .iter()
                .map(|k| {
                    let apart = states
                        .iter()
                        .zip(scales)
                        .map(|(x, s)| (s * (x[*i] - x[*k])).powi(2));
                    (apart.sum::<f64>(), *k)
                })
                .collect();
            asked += 1;
            if near.len() < NEIGHBOURS {
                continue;
            }
            near.select_nth_unstable_by(NEIGHBOURS - 1, |a, b| a.0.total_cmp(&b.0));
            let near = &near[..NEIGHBOURS];
            let is_near = near.iter().all(|(apart, _)| *apart < NEAR * NEAR);
            let theirs =
                near.iter().map(|(_, k)| self.rest[at(*k)]).sum::<f64>() / NEIGHBOURS as f64;
            let own = self.rest[at(*i)];
            alone += usize::from(is_near && theirs * own.signum() < ALIKE * own.abs());
        }
        2 * alone < asked
    }
}

/// Samples at which a drive turns round or stands: friction takes values there that no law of the model may say.
fn reversing(rate: &[f64]) -> Vec<bool> {
    let fastest = rate.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    rate.iter().map(|v| v.abs() < SLOW * fastest).collect()
}

/// The value that this part of all stays below.
fn quantile(mut values: Vec<f64>, part: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let last = values.len() - 1;
    let at = whole(part * last as f64);
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

/// A count that was computed, rounded down.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a float becomes the nearest count there is"
)]
fn whole(value: f64) -> usize {
    value as usize
}
