//! Contacts and pushes: for an interval of time forces act that no parameters explain. A stretch goes in; its events, told with
//! their times, drives and sizes, come out.
//!
//! The regressor with friction and an offset of every drive is fitted to the forces by Huber's function, so that an event does
//! not pull the fit to itself. A law that the model lacks leaves errors that come again with the motion; an event is rare, lasts,
//! and stands far above all that the rest of the run leaves.

use modelmill_identify::Note;
use nalgebra::{DMatrix, DVector};

use super::with_friction;
use crate::along::drive_rates;
use crate::model::Model;
use crate::stretch::Stretch;
use crate::text::table::significant;

/// Samples that are looked at.
const LOOKED_AT: usize = 4000;
/// Samples whose median counts: single outliers are none.
const TOGETHER: usize = 11;
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
/// Part of its fastest rate below which a drive may turn round.
const SLOW: f64 = 0.1;
/// Huber's bound in standard deviations, and how often rows are reweighted.
const BOUND: f64 = 1.345;
const ROUNDS: usize = 4;

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
        notes.push(Note::warning(format!(
            "From {} to {} s of {} forces differ from all that parameters explain, {}, as in a contact or a push. {}",
            significant(event.from, 5),
            significant(event.to, 5),
            data.run.file,
            drives.join(" and "),
            if leave_out {
                "They are left out of fits and figures (option `leave_out_events`)."
            } else {
                "Option `leave_out_events` leaves them out of fits and figures."
            }
        )));
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
    let drives = forces.len();
    let samples: Vec<usize> = (0..n).step_by((n / LOOKED_AT).max(1)).collect();
    if samples.len() < 40 * TOGETHER {
        return None;
    }
    let regressor = with_friction(model, data, &samples)?;
    let measured = DVector::from_iterator(
        samples.len() * drives,
        (samples.iter()).flat_map(|k| forces.iter().map(move |force| force[*k])),
    );
    let rest = robust_rest(&regressor, &measured, drives)?;
    let rates = drive_rates(model, data).ok()?;
    let mut flagged = vec![false; samples.len()];
    let mut levels = Vec::new();
    for d in 0..drives {
        let size = (0..samples.len())
            .map(|i| measured[i * drives + d].powi(2))
            .sum::<f64>();
        let size = (size / samples.len() as f64).sqrt();
        let reverses = reversing(&rates[d], &samples);
        let together: Vec<f64> = (0..samples.len())
            .map(|i| {
                let start = i.saturating_sub(TOGETHER / 2);
                let end = (start + TOGETHER).min(samples.len());
                if reverses[start..end].contains(&true) {
                    return 0.0;
                }
                quantile(
                    (start..end).map(|k| rest[k * drives + d].abs()).collect(),
                    0.5,
                )
            })
            .collect();
        let usual = quantile(together.clone(), USUAL);
        let bound = (ABOVE * usual).max(LEAST * size);
        for (flag, level) in flagged.iter_mut().zip(&together) {
            *flag |= *level > bound;
        }
        levels.push((together, usual, bound));
    }
    let mut events = Vec::new();
    let mut i = 0;
    let mut lasted = 0;
    while i < flagged.len() {
        let start = i;
        // Short lulls belong to the event about them.
        let mut end = i;
        while i < flagged.len() && (flagged[i] || (end > start && i - end < 2 * TOGETHER)) {
            if flagged[i] {
                end = i + 1;
            }
            i += 1;
        }
        let reach = |k: usize| run.time[samples[k.min(samples.len() - 1)]];
        let [from, to] = [
            reach(start.saturating_sub(TOGETHER / 2)),
            reach(end + TOGETHER / 2),
        ];
        if end > start && to - from >= SHORTEST {
            let concerned =
                levels
                    .iter()
                    .enumerate()
                    .filter_map(|(d, (together, usual, bound))| {
                        let largest = together[start..end].iter().copied().fold(0.0, f64::max);
                        (largest > *bound).then_some((d, largest, *usual))
                    });
            events.push(Event {
                from,
                to,
                drives: concerned.collect(),
            });
            lasted += end - start;
        }
        i = i.max(start + 1);
    }
    let is_rare = events.len() <= MOST && (lasted as f64) < LONGEST * flagged.len() as f64;
    is_rare.then_some(events)
}

/// Samples at which a drive turns round or stands: friction takes values there that no law of the model may say.
fn reversing(rate: &[f64], samples: &[usize]) -> Vec<bool> {
    let fastest = rate.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    samples
        .iter()
        .map(|k| rate[*k].abs() < SLOW * fastest)
        .collect()
}

/// What Huber's function leaves of the forces, each drive by its own scale.
fn robust_rest(
    regressor: &DMatrix<f64>,
    measured: &DVector<f64>,
    drives: usize,
) -> Option<DVector<f64>> {
    let mut weights = DVector::from_element(measured.len(), 1.0);
    let mut rest = measured.clone();
    for _ in 0..ROUNDS {
        for d in 0..drives {
            let sizes = (d..rest.len()).step_by(drives).map(|i| rest[i].abs());
            let scale = (1.4826 * quantile(sizes.collect(), 0.5)).max(f64::MIN_POSITIVE.sqrt());
            for i in (d..rest.len()).step_by(drives) {
                let inside = (BOUND * scale / rest[i].abs().max(f64::MIN_POSITIVE)).min(1.0);
                weights[i] = inside.sqrt() / scale;
            }
        }
        let mut weighted = regressor.clone();
        for (mut row, weight) in weighted.row_iter_mut().zip(weights.iter()) {
            row *= *weight;
        }
        let mut normal = weighted.tr_mul(&weighted);
        let right = weighted.tr_mul(&measured.component_mul(&weights));
        let scale = normal
            .diagonal()
            .map(|x| if x > 0.0 { x.sqrt().recip() } else { 0.0 });
        for i in 0..scale.len() {
            for j in 0..scale.len() {
                normal[(i, j)] *= scale[i] * scale[j];
            }
            normal[(i, i)] += 1e-9;
        }
        let values = normal.cholesky()?.solve(&right.component_mul(&scale));
        rest = measured - regressor * values.component_mul(&scale);
    }
    rest.iter().all(|x| x.is_finite()).then_some(rest)
}

/// The value that this part of all stays below.
fn quantile(mut values: Vec<f64>, part: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let last = values.len() - 1;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a part of a count is a count"
    )]
    let at = (part * last as f64) as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}
