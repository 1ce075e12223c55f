//! What a model says of a recording before anything is believed: delays between force and motion, columns that are
//! exchanged or turned round, angles in degrees. Everything goes into the notes.

pub(crate) mod events;
mod nominal_forces;

use modelmill_codegen::{Evaluator, States};
use modelmill_identify::{ForceAudit, ForceDelay, Note, Suspect, differentiate};
use nalgebra::{DMatrix, DVector};

use crate::along::drive_rates;
use crate::model::Model;
use crate::stretch::Stretch;
use crate::text::table::percent;

/// Samples that are looked at, spread over the recording.
const LOOKED_AT: usize = 1500;
/// Largest delay that is looked for, in samples.
const LONGEST_DELAY: usize = 25;
/// Part of a drive's fastest rate below which its friction may be about to reverse.
const SLOW: f64 = 0.1;
/// Standard deviations within which 99 of 100 values lie.
const SURE: f64 = 2.58;
/// Relative errors below this one raise no suspicion of exchanged columns.
const BEARABLE: f64 = 0.3;
/// An exchange must lower the error to this part.
const BETTER: f64 = 0.5;

/// Looks at every recording that has forces, and adds what it finds to their notes; the forces of contacts and pushes count no
/// more where `leave_out_events`.
pub fn examine(model: &Model, data: &mut [Stretch], leave_out_events: bool) {
    for one in data {
        for note in findings(model, one) {
            one.note(model, note);
        }
        for note in events::found(model, one, leave_out_events) {
            one.note(model, note);
        }
    }
}

fn findings(model: &Model, data: &Stretch) -> Vec<Note> {
    let run = &data.run;
    let n = data.samples();
    let Some(forces) = run.force.as_deref().filter(|_| n > 4 * LONGEST_DELAY) else {
        return Vec::new();
    };
    let step = (n / LOOKED_AT).max(1);
    let samples: Vec<usize> = (LONGEST_DELAY..n - LONGEST_DELAY).step_by(step).collect();
    let n_drives = forces.len();
    let explained = |change: &Change<'_>| {
        let regressor = regressor(model, data, &samples, change)?;
        ForceAudit::new(regressor, n_drives)
    };
    // Poses without answer are reported with their place when the whole recording is evaluated.
    let Some(as_it_is) = explained(&|_| {}) else {
        return suspects_of_motion(model, data, &samples, None, &explained);
    };
    let rows = samples
        .iter()
        .flat_map(|k| forces.iter().map(move |force| force[*k]));
    let measured = DVector::from_iterator(samples.len() * n_drives, rows);
    let Some(error) = as_it_is.error(&measured) else {
        return Vec::new();
    };
    let beside = beside_nominal(model, data, &samples);
    let mut notes = Vec::new();
    if error > BEARABLE {
        let drives = model.drives();
        if let Some((suspect, [before, after])) = as_it_is.suspect(&measured)
            && after < BETTER * before
            // Nominal values know which drive it is.
            && (beside.is_empty() || !matches!(suspect, Suspect::Turned(_)))
        {
            let what = match suspect {
                Suspect::Swapped(a, b) => {
                    format!(
                        "The forces of `{}` and `{}` in {} seem to be exchanged",
                        drives[a], drives[b], run.file
                    )
                }
                Suspect::Turned(_) if drives.len() == 2 => format!(
                    "One of the forces of `{}` and `{}` in {} seems to have the wrong sign",
                    drives[0], drives[1], run.file
                ),
                Suspect::Turned(a) => format!(
                    "The force of `{}` in {} seems to have the wrong sign",
                    drives[a], run.file
                ),
            };
            notes.push(Note::warning(format!(
                "{what}: the best fit of the model is off by {} as the columns are, and by {} then. Check which column is \
                 which (option `columns`).",
                percent(Some(before)),
                percent(Some(after))
            )));
        }
        if notes.is_empty() {
            notes = suspects_of_motion(model, data, &samples, Some((error, &measured)), &explained);
        }
    }
    if notes.is_empty() {
        notes = beside;
    }
    if notes.is_empty() {
        notes.extend(delay(model, data, &samples));
    }
    notes
}

/// What the forces come later or earlier than the motion by, all drives together and each by itself.
fn delay(model: &Model, data: &Stretch, samples: &[usize]) -> Option<Note> {
    let run = &data.run;
    let forces = run.force.as_deref()?;
    let n = run.time.len();
    let rates = drive_rates(model, data).ok()?;
    let drives = forces.len();
    // Friction that reverses has its own way of coming late.
    let fastest: Vec<f64> = rates
        .iter()
        .map(|rate| rate.iter().fold(0.0_f64, |most, v| most.max(v.abs())))
        .collect();
    let moves = |row: usize, d: usize| {
        rates[d][samples[row]].abs() > SLOW * fastest[d] && run.counts(d, samples[row])
    };
    let regressor = with_friction(model, data, samples)?;
    let found = |wanted: &dyn Fn(usize) -> bool| {
        let mut rows = regressor.clone();
        for i in 0..samples.len() {
            for d in 0..drives {
                if !(wanted(d) && moves(i, d)) {
                    rows.row_mut(i * drives + d).fill(0.0);
                }
            }
        }
        let counts = |row: usize, d: usize| wanted(d) && moves(row, d);
        ForceAudit::new(rows, drives)?.delay_counted(samples, forces, LONGEST_DELAY, counts)
    };
    let all = found(&|_| true)?;
    let [before, after] = all.error;
    let seconds = (run.time[n - 1] - run.time[0]) / (n - 1) as f64;
    let gain = 1.0 - after / before.max(f64::MIN_POSITIVE);
    if gain <= 0.003 || all.samples.abs() < 0.3_f64.max(SURE * all.std) {
        return None;
    }
    let alone: Vec<Option<ForceDelay>> = if drives > 1 {
        (0..drives).map(|d| found(&|other| other == d)).collect()
    } else {
        Vec::new()
    };
    // A clock delays all forces alike; where drives differ, it is a law that the model lacks.
    let agree = alone.iter().flatten().all(|one| {
        let apart = (one.samples - all.samples).abs();
        apart < SURE * one.std.hypot(all.std) + 0.1
    });
    let needs_more = if drives > 1 { 0.003 } else { 0.03 };
    if gain <= needs_more || !agree {
        return None;
    }
    let (which, behind) = if all.samples > 0.0 {
        ("come later than", "behind")
    } else {
        ("come earlier than", "before")
    };
    let each = if alone.is_empty() {
        String::new()
    } else {
        let each = model.drives().into_iter().zip(&alone).map(|(name, one)| {
            one.map_or_else(
                || format!("`{name}` does not tell"),
                |one| format!("`{name}` {:.1} +- {:.1}", one.samples, SURE * one.std),
            )
        });
        format!(
            " Each drive by itself, in samples: {}.",
            each.collect::<Vec<_>>().join(", ")
        )
    };
    let says = format!(
        "The forces in {} {which} the motion that the model explains them by: {:.1} samples or {:.3} ms {behind} it (+- {:.3} ms, \
         99 %). Without this shift the best fit would be off by {} rather than {}.{each}",
        run.file,
        all.samples.abs(),
        1e3 * seconds * all.samples.abs(),
        1e3 * seconds * SURE * all.std,
        percent(Some(after)),
        percent(Some(before))
    );
    Some(if gain > 0.1 {
        Note::warning(says)
    } else {
        Note::info(says)
    })
}

/// Signs and units of the forces, held against those that the nominal values give.
fn beside_nominal(model: &Model, data: &Stretch, samples: &[usize]) -> Vec<Note> {
    let Some(regressor) = regressor(model, data, samples, &|_| {}) else {
        return Vec::new();
    };
    let forces = data.run.force.as_deref().unwrap_or(&[]);
    let expected = regressor * DVector::from_column_slice(&model.nominal);
    let n = forces.len();
    let expected: Vec<Vec<f64>> = (0..n)
        .map(|d| expected.iter().skip(d).step_by(n).copied().collect())
        .collect();
    let measured: Vec<Vec<f64>> = forces
        .iter()
        .map(|force| samples.iter().map(|k| force[*k]).collect())
        .collect();
    let mechanism = &model.derivation.mechanism;
    nominal_forces::oddities(mechanism, &measured, &expected, &data.run.file)
        .into_iter()
        .map(Note::warning)
        .collect()
}

/// The regressor with friction, inertia and an offset at every drive besides: where a model lacks these, their force
/// would pass for a delay.
fn with_friction(model: &Model, data: &Stretch, samples: &[usize]) -> Option<DMatrix<f64>> {
    let regressor = regressor(model, data, samples, &|_| {})?;
    let rates = drive_rates(model, data).ok()?;
    let n = rates.len();
    let width = regressor.ncols();
    let mut more = regressor.resize_horizontally(width + 4 * n, 0.0);
    let accelerations: Vec<Vec<f64>> = rates
        .iter()
        .map(|rate| differentiate(&data.run.time, rate))
        .collect();
    for (i, sample) in samples.iter().enumerate() {
        for (d, rate) in rates.iter().enumerate() {
            let rate = *rate.get(*sample)?;
            let acceleration = accelerations[d][*sample];
            let sign = if rate == 0.0 { 0.0 } else { rate.signum() };
            for (k, value) in [rate, sign, acceleration, 1.0].into_iter().enumerate() {
                more[(i * n + d, width + 4 * d + k)] = value;
            }
        }
    }
    Some(more)
}

/// Positions, rates and accelerations, `[order][coordinate][sample]`.
type Motion = [Vec<Vec<f64>>; 3];
/// What could be done to a recording's motion to make sense of it.
type Change<'a> = dyn Fn(&mut Motion) + 'a;
/// How well the model explains the forces once the motion is changed.
type Explain<'a> = dyn Fn(&Change<'_>) -> Option<ForceAudit> + 'a;

/// Coordinates that are exchanged, or angles in degrees; `now` is the error as the columns are, if there is one.
fn suspects_of_motion(
    model: &Model,
    data: &Stretch,
    samples: &[usize],
    now: Option<(f64, &DVector<f64>)>,
    explained: &Explain<'_>,
) -> Vec<Note> {
    let Some(forces) = data.run.force.as_deref() else {
        return Vec::new();
    };
    let rows = samples
        .iter()
        .flat_map(|k| forces.iter().map(move |force| force[*k]));
    let measured = DVector::from_iterator(samples.len() * forces.len(), rows);
    let file = &data.run.file;
    let motions = model.motions();
    let mut hypotheses: Vec<(String, Box<Change<'static>>)> = Vec::new();
    let angles: Vec<usize> = (0..motions.len()).filter(|i| motions[*i].1).collect();
    if !angles.is_empty() {
        let angles = angles.clone();
        hypotheses.push((
            format!(
                "The angles in {file} seem to be in degrees; they must be in rad: say {}",
                data.maps_from_degrees
            ),
            Box::new(move |states| {
                for order in states.iter_mut() {
                    for i in &angles {
                        for value in &mut order[*i] {
                            *value = value.to_radians();
                        }
                    }
                }
            }),
        ));
    }
    for a in 0..motions.len() {
        for b in a + 1..motions.len() {
            if motions[a].1 == motions[b].1 {
                hypotheses.push((
                    format!(
                        "The coordinates `{}` and `{}` in {file} seem to be exchanged: check which column is which (option `columns`)",
                        motions[a].0, motions[b].0
                    ),
                    Box::new(move |states| {
                        for order in states.iter_mut() {
                            order.swap(a, b);
                        }
                    }),
                ));
            }
        }
    }
    let limit = now.map_or(BEARABLE, |(error, _)| BETTER * error);
    let best = hypotheses
        .iter()
        .filter_map(|(says, change)| Some((says, explained(change.as_ref())?.error(&measured)?)))
        .filter(|(_, error)| *error < limit)
        .min_by(|a, b| a.1.total_cmp(&b.1));
    let Some((says, error)) = best else {
        return Vec::new();
    };
    let as_it_is = match now {
        Some((now, _)) => format!("is off by {}", percent(Some(now))),
        None => "does not exist, for the mechanism cannot reach such poses".to_owned(),
    };
    vec![Note::warning(format!(
        "{says}. The best fit of the model {as_it_is} as the columns are, and would be off by {} then.",
        percent(Some(error))
    ))]
}

/// The regressor at some samples, with the states changed.
fn regressor(
    model: &Model,
    data: &Stretch,
    samples: &[usize],
    change: &Change<'_>,
) -> Option<DMatrix<f64>> {
    let pick = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let pick = |column: &Vec<f64>| samples.iter().map(|k| column[*k]).collect();
        columns.iter().map(pick).collect()
    };
    let run = &data.run;
    let mut states = [&run.q, &run.qd, &run.qdd].map(|columns| pick(columns));
    change(&mut states);
    let load = pick(run.force.as_deref().unwrap_or(&[]));
    let states = States {
        q: states[0].iter().map(Vec::as_slice).collect(),
        qd: states[1].iter().map(Vec::as_slice).collect(),
        qdd: states[2].iter().map(Vec::as_slice).collect(),
        load: load.iter().map(Vec::as_slice).collect(),
    };
    Evaluator::new(&model.derivation).regressor(&states).ok()
}
