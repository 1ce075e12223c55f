//! Faults of recordings that are known before the search: contacts, coarse quantisation, and differences
//! between recordings of the machine. All are reported and subtracted or left out, so that none is mistaken for
//! an effect.

use modelmill_identify::changes::NormalEquations;
use modelmill_identify::diagnose::{DiagnosisProblem, Disturbance, EstimatedQuantity, quantisation_step};

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::runs::{PhysicalChange, RecordingDifference, differences};

use super::thresholds::{
    CONTACT_GAP_S, CONTACT_MARGIN_S, CONTACT_SHORTEST_S, REPEATED_PLACE_FEWEST_SAMPLES, REPEATED_PLACE_MOST_RESIDUAL,
};
use crate::regressors::SegmentList;

/// Differences of later recordings from the first one; none if they cannot be compared.
///
/// Fails when the job is cancelled.
pub(crate) fn run_differences(model: &Model, recordings: &[&PreparedRecording]) -> Outcome<Vec<RecordingDifference>> {
    // A single recording has nothing to compare.
    if recordings.len() < 2 {
        return Ok(Vec::new());
    }
    match differences(model, recordings) {
        Err(Error::Cancelled) => Err(Error::Cancelled),
        compared => Ok(compared.unwrap_or_default()),
    }
}

/// Subtracts known faults from the measured forces of a problem, and adds them to its disturbances.
///
/// Fails when a recording has no forces.
pub(crate) fn subtract_known(
    problem: &mut DiagnosisProblem,
    model: &Model,
    all: &SegmentList<'_>,
    between: &[RecordingDifference],
) -> Outcome<()> {
    problem.removed.resize(model.drives().len(), 0.0);
    // Powers are means over all samples.
    let samples = problem.layout.samples().max(1) as f64;
    // Differences between recordings are subtracted, and their power is counted as removed.
    for one in between {
        for (d, force) in one.force.0.iter().enumerate() {
            let (Some(force), Some(measured)) = (force, &mut problem.measured.0[d]) else {
                continue;
            };
            // Another decimation would give other samples.
            if force.len() != measured.len() {
                continue;
            }
            for (y, f) in measured.iter_mut().zip(force) {
                *y -= f;
            }
            problem.removed[d] += force.iter().map(|f| f * f).sum::<f64>() / samples;
        }
        problem.disturbances.push(difference(one));
    }
    // Noise of quantisation and events come from the signals themselves.
    add_quantisation_noise(problem, model, all)?;
    remove_contact_events(problem, all);
    // Faults from the preparation are listed once, with all of their recordings.
    for one in all.iter().flat_map(|(one, _)| &one.faults) {
        if one.kind == "contact_event" {
            continue;
        }
        // The same fault in several recordings becomes one entry.
        let is_same = |told: &&mut Disturbance| {
            told.description.is_some() && (&told.kind, &told.description) == (&one.kind, &one.description)
        };
        match problem.disturbances.iter_mut().find(is_same) {
            // Only files that are not listed yet.
            Some(told) => {
                let files = one.recordings.iter().filter(|file| !told.recordings.contains(file));
                let new: Vec<String> = files.cloned().collect();
                told.recordings.extend(new);
            }
            None => problem.disturbances.push(one.clone()),
        }
    }
    Ok(())
}

/// A difference of two recordings as a disturbance.
fn difference(one: &RecordingDifference) -> Disturbance {
    // Changes of load and clock have kinds of their own, all others share one.
    let (_, at, values) = one.changed.change.parts(one.changed.unit);
    let kind = match one.changed.change {
        PhysicalChange::Payload { .. } => "payload_change",
        PhysicalChange::Clock { .. } => "time_base",
        _ => "different_runs",
    };
    // Sizes of the change with standard deviations.
    let estimates = values.into_iter().map(|(name, value, unit)| EstimatedQuantity {
        name: name.to_owned(),
        value: value.value,
        standard_deviation: Some(value.deviation),
        unit: unit.to_owned(),
    });
    Disturbance {
        kind: kind.to_owned(),
        at: at.into_iter().map(str::to_owned).collect(),
        estimates: estimates.collect(),
        recordings: vec![one.first.clone(), one.later.clone()],
        interval: None,
        description: Some(format!(
            "{} differs between the recordings, {} compared with {}: {}",
            match one.changed.change {
                PhysicalChange::Payload { .. } => "the payload",
                PhysicalChange::Friction { .. } => "the friction",
                PhysicalChange::Offset { .. } => "a constant force",
                PhysicalChange::Scale { .. } => "the scale of a force",
                PhysicalChange::Clock { .. } => "the clock",
                PhysicalChange::EncoderZero { .. } => "the zero of an encoder",
                PhysicalChange::ContactEvent { .. } => "a push",
            },
            one.later,
            one.first,
            one.changed.says
        )),
    }
}

/// Forces with a quantisation step coarser than their noise. Uniform rounding then gives the noise, step / sqrt(12).
///
/// Fails when a recording has no forces.
fn add_quantisation_noise(problem: &mut DiagnosisProblem, model: &Model, all: &SegmentList<'_>) -> Outcome<()> {
    for (d, drive) in model.drives().iter().enumerate() {
        // Steps are found in the recorded values, before any filter.
        let mut recorded = Vec::new();
        for (one, _) in all {
            recorded.extend_from_slice(&one.run.measured_forces()?[d]);
        }
        // A low-pass removes the steps, so that decimated forces show none.
        let is_decimated = all.iter().any(|(one, _)| one.decimation() > 1);
        let Some(step) = quantisation_step(&recorded, problem.noise[d]).filter(|_| !is_decimated) else {
            continue;
        };
        // Standard deviation of a uniform distribution over one step.
        problem.noise[d] = problem.noise[d].max(step / 12.0_f64.sqrt());
        problem.disturbances.push(Disturbance {
            kind: "quantised_force".to_owned(),
            at: vec![drive.clone()],
            estimates: vec![EstimatedQuantity::new("step", step, model.force_unit(d))],
            recordings: Vec::new(),
            interval: None,
            description: None,
        });
    }
    Ok(())
}

/// Leaves out contacts and pushes: events that are not a function of a position. An end stop acts at every
/// visit of its place, a push only once.
fn remove_contact_events(problem: &mut DiagnosisProblem, all: &SegmentList<'_>) {
    let events: Vec<Disturbance> = merge_events(all);
    if events.is_empty() {
        return;
    }
    // Stage 1: which samples belong to an event, with and without a margin, and the positions there.
    let (mut inside, mut about, mut positions) = (Vec::new(), Vec::new(), Vec::new());
    for (one, _) in all {
        // An event belongs to its recordings only.
        let is_in = |event: &Disturbance, time: f64, margin: f64| {
            let [from, to] = event.interval.unwrap_or_default();
            event.recordings.contains(&one.run.file) && time >= from - margin && time <= to + margin
        };
        for (i, time) in one.time().into_iter().enumerate() {
            inside.push(events.iter().any(|event| is_in(event, time, 0.0)));
            about.push(events.iter().any(|event| is_in(event, time, CONTACT_MARGIN_S)));
            let at = i * one.decimation();
            positions.push(one.run.q.iter().map(|q| q[at]).collect::<Vec<f64>>());
        }
    }
    // Stage 2: an end stop would explain the force by the position of one coordinate.
    let channels = problem.layout.channels.iter().enumerate();
    let concerned: Vec<usize> = channels
        .filter(|(_, name)| events.iter().any(|event| event.at.contains(name)))
        .map(|(d, _)| d)
        .collect();
    // Each coordinate is tested in both directions, since a stop may be at either end.
    let coordinates = positions.first().map_or(0, Vec::len);
    let explains = |i: usize, sign: f64| {
        let along: Vec<f64> = positions.iter().map(|q| sign * q[i]).collect();
        let mut of_event = along.iter().zip(&inside).filter(|(_, inside)| **inside);
        let mut of_event: Vec<f64> = of_event.by_ref().map(|(x, _)| *x).collect();
        of_event.sort_by(f64::total_cmp);
        // The place where the event begins: its tenth percentile, which single wrong samples hardly change.
        let Some(place) = of_event.get(of_event.len() / 10) else {
            return false;
        };
        // How far each sample is beyond the place.
        let depths: Vec<f64> = along.iter().map(|x| x - place).collect();
        concerned
            .iter()
            .any(|d| is_force_beyond_place(problem, *d, &depths, &inside, &about))
    };
    if (0..coordinates).any(|i| explains(i, 1.0) || explains(i, -1.0)) {
        return;
    }
    // Stage 3: a push is excluded for all drives, since it acts through the mechanism.
    problem.left_out = vec![about; problem.layout.channels.len()];
    problem.disturbances.extend(events);
}

/// Whether the force of an event is that of a stop: the line over the depth, fitted during the event, also
/// predicts the force beyond the place at other times. Without other times the event is not believed. The model
/// is fitted to the samples before the place.
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
    // The friction of the drive is part of the model here, since bodies alone would leave it in the residual.
    let friction = problem.friction.get(3 * channel..3 * channel + 3);
    let columns: Vec<Option<&[f64]>> = (problem.base.iter())
        .chain(friction.unwrap_or_default())
        .map(|column| column.0[channel].as_deref())
        .collect();
    // The model is fitted to samples before the place and away from the event.
    let is_elsewhere = |i: usize| !about[i] && depths[i] < 0.0;
    let elsewhere: Vec<usize> = (0..measured.len()).filter(|i| is_elsewhere(*i)).collect();
    let some = |values: &[f64]| -> Vec<f64> { elsewhere.iter().map(|i| values[*i]).collect() };
    let picked: Vec<Option<Vec<f64>>> = columns.iter().map(|column| column.map(some)).collect();
    let picked: Vec<Option<&[f64]>> = picked.iter().map(Option::as_deref).collect();
    // Normal equations are enough, since only predictions are needed.
    let mut moments = NormalEquations::new(columns.len());
    moments.add_rows(&picked, &some(measured));
    let factors = moments.solve().values;
    // The residual of the model at any sample.
    let rest = |i: usize| {
        let said = columns.iter().zip(factors.iter());
        let said = said.map(|(column, factor)| column.map_or(0.0, |values| factor * values[i]));
        measured[i] - said.sum::<f64>()
    };
    let beyond = |is_event: bool| -> Vec<(f64, f64)> {
        (0..measured.len())
            .filter(|i| depths[*i] >= 0.0 && if is_event { inside[*i] } else { !about[*i] })
            .map(|i| (depths[i], rest(i)))
            .collect()
    };
    // Samples beyond the place, in the event and at other times.
    let (during, otherwise) = (beyond(true), beyond(false));
    if otherwise.len() < REPEATED_PLACE_FEWEST_SAMPLES {
        return true;
    }
    let Some(line) = fit_line(&during) else {
        return false;
    };
    // The line must explain most of the force at other times.
    let left: f64 = otherwise.iter().map(|(x, y)| (y - line(*x)).powi(2)).sum();
    let whole: f64 = otherwise.iter().map(|(_, y)| y * y).sum();
    left < REPEATED_PLACE_MOST_RESIDUAL * whole
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

/// Contact events of all recordings: close ones are joined, short ones are dropped.
fn merge_events(all: &SegmentList<'_>) -> Vec<Disturbance> {
    let mut events: Vec<Disturbance> = Vec::new();
    let faults = all.iter().flat_map(|(one, _)| &one.faults);
    for event in faults.filter(|one| one.kind == "contact_event") {
        // Events of one recording are in the order of time.
        let [from, to] = event.interval.unwrap_or_default();
        if let Some(last) = events.last_mut()
            && last.recordings == event.recordings
            && let Some(before) = &mut last.interval
            && from - before[1] < CONTACT_GAP_S
        {
            before[1] = to;
            // The joined event has the places of both.
            for place in &event.at {
                if !last.at.contains(place) {
                    last.at.push(place.clone());
                }
            }
            continue;
        }
        events.push(event.clone());
    }
    // Events that are too short for a contact or push are dropped.
    events.retain(|event| event.interval.is_some_and(|[from, to]| to - from >= CONTACT_SHORTEST_S));
    events
}
