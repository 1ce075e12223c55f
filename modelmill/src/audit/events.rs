//! Contacts and pushes: intervals of time in which forces act that no parameters explain. A segment goes in, its
//! events with times, drives and sizes come out.
//!
//! The regressor, with friction and an offset of every drive added, is fitted to the forces with Huber's function, so
//! that an event does not bias the fit. A law that the model lacks leaves errors that repeat with the motion. An
//! event is rare, lasts for some time, and is far larger than the residual of the rest of the run.
//!
//! Decision: an event must not repeat where position, rate, acceleration and force of its drive are similar. If it
//! repeats, it is a law that the model lacks.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::diagnose::{Disturbance, EstimatedQuantity};
use modelmill_identify::{RecordingNote, robust_fit};
use nalgebra::DVector;

use super::rows::AuditRows;
use super::thresholds::{
    EVENT_FEWEST_FILTER_WIDTHS, EVENT_LEAST_FORCE_SHARE, EVENT_LULL_FILTER_WIDTHS, EVENT_RESIDUAL_FACTOR,
    EVENT_REVERSAL_RATE_SHARE, EVENTS_MOST_DURATION_SHARE, MOST_EVENTS, NEIGHBOUR_MOST_DISTANCE_SIGMAS,
    REPEATED_LEAST_RESIDUAL_SHARE, SHORTEST_EVENT_S, USUAL_RESIDUAL_SHARE,
};
use crate::model::Model;
use crate::segment::RecordingSegment;
use crate::text::table::significant;

/// Number of samples that are evaluated in a short run.
const LOOKED_AT: usize = 4000;
/// Samples per second that are evaluated in a long run.
const FINE: f64 = 25.0;
/// Smallest width of the median filter, in samples, which removes single outliers.
const FEWEST_TOGETHER: usize = 5;
/// Largest width of the median filter, in samples.
const MOST_TOGETHER: usize = 11;
/// Number of samples of an event that are compared with the rest of the run.
const COMPARED: usize = 40;
/// Number of nearest samples of the rest for each of them.
const NEIGHBOURS: usize = 5;

/// An interval of time in which forces act that no parameters explain.
#[derive(Clone, Debug)]
pub(crate) struct ContactEvent {
    /// Start of the interval, s.
    pub(crate) from: f64,
    /// End of the interval, s.
    pub(crate) to: f64,
    /// The drives on which it acts, each with the largest unexplained force and the usual one, N or N m.
    pub(crate) drives: Vec<(usize, f64, f64)>,
}

/// Notes on the events of a segment. With `leave_out`, their forces are excluded.
pub(super) fn event_notes(model: &Model, data: &mut RecordingSegment, leave_out: bool) -> Vec<RecordingNote> {
    let events = events(model, data).unwrap_or_default();
    let names = model.drives();
    let mut notes = Vec::new();
    // Each event becomes a note for the user and a disturbance for the diagnosis.
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
        notes.push(RecordingNote::warning(message!(
            "From {} to {} s of {} there are forces that no parameters explain, {}, as in a contact or a push{}",
            significant(event.from, 5),
            significant(event.to, 5),
            data.run.file,
            drives.join(" and "),
            if leave_out {
                message!(". They are left out of fits and error figures ({}).", option)
            } else {
                message!("; {} leaves them out of fits and error figures.", option)
            }
        )));
    }
    for event in &events {
        let drives = event.drives.iter();
        data.faults.push(Disturbance {
            kind: "contact_event".to_owned(),
            at: drives.clone().map(|(d, _, _)| names[*d].clone()).collect(),
            estimates: drives
                .map(|(d, largest, _)| EstimatedQuantity::new("largest", *largest, model.force_unit(*d)))
                .collect(),
            recordings: vec![data.run.file.clone()],
            interval: Some([event.from, event.to]),
            description: None,
        });
    }
    if leave_out {
        leave_out_events(data, &events);
    }
    notes
}

/// Excludes the forces of all drives during events.
pub(crate) fn leave_out_events(data: &mut RecordingSegment, events: &[ContactEvent]) {
    if events.is_empty() {
        return;
    }
    let run = &mut data.run;
    if run.left_out.is_empty() {
        let drives = run.force.as_ref().map_or(0, Vec::len);
        run.left_out = vec![vec![false; run.time.len()]; drives];
    }
    for (i, time) in run.time.iter().enumerate() {
        let is_in = |event: &ContactEvent| (event.from..=event.to).contains(time);
        if events.iter().any(is_in) {
            run.left_out.iter_mut().for_each(|out| out[i] = true);
        }
    }
}

/// The events of a segment; `None` if there are too few samples, or if events are so many that they are no exception.
pub(crate) fn events(model: &Model, data: &RecordingSegment) -> Option<Vec<ContactEvent>> {
    let run = &data.run;
    let forces = run.force.as_deref()?;
    let n = run.time.len();
    let duration = run.time.last()? - run.time.first()?;
    let wanted = LOOKED_AT.max(floor_to_count(FINE * duration));
    let samples: Vec<usize> = (0..n).step_by((n / wanted).max(1)).collect();
    let rate = samples.len() as f64 / duration;
    let together = floor_to_count(SHORTEST_EVENT_S * rate).clamp(FEWEST_TOGETHER, MOST_TOGETHER);
    if samples.len() < EVENT_FEWEST_FILTER_WIDTHS * MOST_TOGETHER {
        return None;
    }
    // The residual of a robust fit is compared with its own usual level, drive by drive.
    let rest = UnexplainedForces::new(model, data, forces, &samples)?;
    let mut levels: Vec<ResidualLevel> = (0..forces.len()).map(|d| rest.level(d, together)).collect();
    // A reading with a dead band jumps whenever it leaves the band, which is no contact.
    for one in run.dead_bands() {
        levels[one.drive].bound = f64::INFINITY;
    }
    let flagged: Vec<bool> = (0..samples.len())
        .map(|i| levels.iter().any(|level| level.values[i] > level.bound))
        .collect();
    // Samples at reversals neither start nor end an event.
    let is_idle = |i: usize| (levels.iter()).all(|level| level.reverses[i]);
    let mut events = Vec::new();
    let mut lasted = 0;
    let mut i = 0;
    while i < flagged.len() {
        let start = i;
        // Short lulls belong to the event about them, and so does a reversal.
        let mut end = i;
        let mut lull = 0;
        while i < flagged.len() && (flagged[i] || (end > start && lull < EVENT_LULL_FILTER_WIDTHS * together)) {
            if flagged[i] {
                end = i + 1;
                lull = 0;
            } else if !is_idle(i) {
                lull += 1;
            }
            i += 1;
        }
        // The interval is widened by half the filter, which smears its ends.
        let reach = |k: usize| run.time[samples[k.min(samples.len() - 1)]];
        let [from, to] = [reach(start.saturating_sub(together / 2)), reach(end + together / 2)];
        let lasts = |end: usize| reach(end - 1) - reach(start) >= SHORTEST_EVENT_S;
        if end > start && lasts(end) {
            // A drive belongs to the event unless its residual repeats elsewhere.
            let around = start.saturating_sub(together)..end + together;
            let concerned = levels.iter().enumerate().filter_map(|(d, level)| {
                let is_in = |i: &usize| level.values[*i] > level.bound;
                let within: Vec<usize> = (start..end).filter(is_in).collect();
                let largest = within.iter().map(|i| level.values[*i]).reduce(f64::max)?;
                let comes_again = rest.is_repeatable(d, &within, &around, &level.reverses);
                (!comes_again).then_some((d, largest, level.usual))
            });
            let drives: Vec<(usize, f64, f64)> = concerned.collect();
            lasted += end - start;
            if !drives.is_empty() {
                events.push(ContactEvent { from, to, drives });
            }
        }
        i = i.max(start + 1);
    }
    // What happens often or for long is no event.
    let is_rare = events.len() <= MOST_EVENTS && (lasted as f64) < EVENTS_MOST_DURATION_SHARE * flagged.len() as f64;
    is_rare.then_some(events)
}

/// Forces that no parameters explain, as the residual of a robust fit.
struct UnexplainedForces {
    /// Number of drives.
    drives: usize,
    /// Residual, interleaved per sample; zero where the force does not count.
    rest: DVector<f64>,
    /// Measured forces, interleaved.
    measured: DVector<f64>,
    /// Regressor and motion of the samples.
    rows: AuditRows,
    /// Whether each force was measured, interleaved.
    counts: Vec<bool>,
}

/// The residual of a drive along a run.
struct ResidualLevel {
    /// Median of the magnitude over neighbouring samples, N or N m; zero at reversals.
    values: Vec<f64>,
    /// Whether the drive reverses or is at standstill, for each sample.
    reverses: Vec<bool>,
    /// Usual size of the values.
    usual: f64,
    /// Size above which a value belongs to an event.
    bound: f64,
}

impl UnexplainedForces {
    /// Fits the model at the given samples; `None` if a pose has no solution or the fit fails.
    fn new(model: &Model, data: &RecordingSegment, forces: &[Vec<f64>], samples: &[usize]) -> Option<Self> {
        let drives = forces.len();
        let rows = AuditRows::new(model, data, samples)?;
        let of_samples = samples.iter().flat_map(|k| forces.iter().map(move |force| force[*k]));
        let measured = DVector::from_iterator(samples.len() * drives, of_samples);
        let counts: Vec<bool> = (samples.iter())
            .flat_map(|k| (0..drives).map(move |d| data.run.is_force_measured(d, *k)))
            .collect();
        // A long run is fitted on some of its samples, but all residuals are computed.
        let every = (samples.len() / LOOKED_AT).max(1);
        let some: Vec<usize> = (0..samples.len())
            .step_by(every)
            .flat_map(|i| i * drives..(i + 1) * drives)
            .collect();
        let some_count: Vec<bool> = some.iter().map(|row| counts[*row]).collect();
        let some_measured = measured.select_rows(&some);
        let fit = robust_fit(&rows.regressor.subsample(every), &some_measured, &some_count)?;
        let mut rest = &measured - rows.regressor.multiply(fit.values.as_slice());
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

    /// Number of samples.
    fn samples(&self) -> usize {
        self.counts.len() / self.drives
    }

    /// The residual level of drive `d`, with a median over `together` samples.
    fn level(&self, d: usize, together: usize) -> ResidualLevel {
        let n = self.samples();
        let at = |i: usize| i * self.drives + d;
        let size = (0..n).map(|i| self.measured[at(i)].powi(2)).sum::<f64>();
        let size = (size / n as f64).sqrt();
        let reverses = reversal_mask(&self.rows.motion[1][d]);
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
        let usual = quantile(values.clone(), USUAL_RESIDUAL_SHARE);
        ResidualLevel {
            bound: (EVENT_RESIDUAL_FACTOR * usual).max(EVENT_LEAST_FORCE_SHARE * size),
            values,
            reverses,
            usual,
        }
    }

    /// Whether the residual of a drive at some samples repeats outside of a range, where its position, rate,
    /// acceleration and force are similar. Then it is a law that the model lacks. This is also assumed if there are
    /// no similar states.
    fn is_repeatable(&self, d: usize, within: &[usize], around: &std::ops::Range<usize>, reverses: &[bool]) -> bool {
        let n = self.samples();
        let at = |i: usize| i * self.drives + d;
        let explained: Vec<f64> = (0..n).map(|i| self.measured[at(i)] - self.rest[at(i)]).collect();
        let states = [
            &self.rows.motion[0][d],
            &self.rows.motion[1][d],
            &self.rows.motion[2][d],
            &explained,
        ];
        // States are scaled by their standard deviations.
        let scales = states.map(|values| {
            let mean = values.iter().sum::<f64>() / n as f64;
            let sum: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
            (n as f64 / sum.max(f64::MIN_POSITIVE)).sqrt()
        });
        // Only measured samples away from reversals can be neighbours.
        let others: Vec<usize> = (0..n)
            .filter(|i| !around.contains(i) && !reverses[*i] && self.counts[at(*i)])
            .collect();
        let some = within.iter().step_by(within.len().div_ceil(COMPARED).max(1));
        let (mut alone, mut asked) = (0, 0);
        for i in some {
            let mut near: Vec<(f64, usize)> = others
                .iter()
                .map(|k| {
                    let apart = states.iter().zip(scales).map(|(x, s)| (s * (x[*i] - x[*k])).powi(2));
                    (apart.sum::<f64>(), *k)
                })
                .collect();
            asked += 1;
            if near.len() < NEIGHBOURS {
                continue;
            }
            near.select_nth_unstable_by(NEIGHBOURS - 1, |a, b| a.0.total_cmp(&b.0));
            let near = &near[..NEIGHBOURS];
            let is_near = near
                .iter()
                .all(|(apart, _)| *apart < NEIGHBOUR_MOST_DISTANCE_SIGMAS * NEIGHBOUR_MOST_DISTANCE_SIGMAS);
            // The mean residual of the neighbours is compared with that of the event.
            let theirs = near.iter().map(|(_, k)| self.rest[at(*k)]).sum::<f64>() / NEIGHBOURS as f64;
            let own = self.rest[at(*i)];
            alone += usize::from(is_near && theirs * own.signum() < REPEATED_LEAST_RESIDUAL_SHARE * own.abs());
        }
        2 * alone < asked
    }
}

/// Samples at which a drive reverses or stands still: there friction takes values that no law of the model gives.
fn reversal_mask(rate: &[f64]) -> Vec<bool> {
    let fastest = rate.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    rate.iter()
        .map(|v| v.abs() < EVENT_REVERSAL_RATE_SHARE * fastest)
        .collect()
}

/// The quantile of some values; 0 without values.
fn quantile(mut values: Vec<f64>, part: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let last = values.len() - 1;
    let at = floor_to_count(part * last as f64);
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

/// A count that was computed, rounded down.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a float becomes the nearest count there is"
)]
fn floor_to_count(value: f64) -> usize {
    value as usize
}
