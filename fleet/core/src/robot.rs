//! The days of one robot: parameters over time, when something changed and stayed changed, and which sensors died.

use modelmill::runs::{ChangePoint, Changed};
use modelmill_identify::changes::Moments;
use serde_json::{Value, json};

use crate::onset::onset;
use crate::sensors::SensorFault;
use crate::{Bad, Fault, Fit, Ground, Summary};

/// An onset is looked for so many days around the change.
const NEAR: usize = 2;

/// A day of a robot.
#[derive(Clone, Debug)]
pub struct Day {
    /// What it is called.
    pub name: String,
    /// What its recordings say; `None` where none gave an answer.
    pub fit: Option<Fit>,
    /// Sensors that died in one of its recordings.
    pub sensors: Vec<SensorFault>,
    /// Recordings that gave no answer.
    pub bad: Vec<Bad>,
}

/// A day from which on something was different and stayed so.
#[derive(Clone, Debug)]
pub struct Since {
    /// The day, by place.
    pub day: usize,
    /// Base parameters that changed, by place, the clearest first: value before and since, with deviations.
    pub steps: Vec<modelmill::runs::Step>,
    /// By how much the clearest of them grows each day, in its unit, where it grows rather than stepped.
    pub per_day: Option<f64>,
    /// What it is in physics, the clearest first; none where no single change explains it.
    pub changes: Vec<Changed>,
}

/// A sensor that died, and from which day on.
#[derive(Clone, Debug)]
pub struct Dead {
    /// The coordinate or drive.
    pub of: String,
    /// The first day.
    pub day: usize,
    /// On how many of the days since then.
    pub days: usize,
    /// Its first fault.
    pub first: SensorFault,
}

/// A robot over its days.
#[derive(Clone, Debug)]
pub struct Robot {
    /// What it is called.
    pub name: String,
    /// Its days in order.
    pub days: Vec<Day>,
    /// When something changed.
    pub since: Vec<Since>,
    /// Sensors that died.
    pub dead: Vec<Dead>,
    /// The recordings before the first change: what it is held against others by.
    pub before: Summary,
    /// Samples of all its recordings.
    pub samples: u64,
}

/// Looks at the days of a robot, which are in order of time, each with the summary of its recordings.
///
/// Fails where summaries are of another plan.
pub fn robot(ground: &Ground, name: &str, days: Vec<(String, Summary)>) -> Result<Robot, Fault> {
    for (_, summary) in &days {
        ground.check(summary)?;
    }
    let looked_at: Vec<Day> = days
        .iter()
        .map(|(name, summary)| Day {
            name: name.clone(),
            fit: ground.solve(summary).ok(),
            sensors: summary.sensors.clone(),
            bad: summary.bad.clone(),
        })
        .collect();
    // Days without an answer have no place among the runs.
    let known: Vec<usize> = (0..days.len()).filter(|k| looked_at[*k].fit.is_some()).collect();
    let runs: Vec<(Vec<modelmill::runs::Fitted>, Moments, f64)> = known
        .iter()
        .filter_map(|k| {
            let fit = looked_at[*k].fit.as_ref()?;
            let summary = &days[*k].1;
            Some((fit.parameters.clone(), summary.whole.clone(), summary.within))
        })
        .collect();
    let points = match runs.len() {
        0 | 1 => Vec::new(),
        _ => ground.common.points(&runs),
    };
    let since = sinces(ground, &runs, &known, points);
    let end = since.first().map_or(days.len(), |one| one.day);
    let mut before = ground.empty();
    for (_, summary) in &days[..end] {
        before.merge(summary)?;
    }
    Ok(Robot {
        name: name.to_owned(),
        dead: dead(&looked_at),
        samples: days.iter().map(|(_, summary)| summary.samples).sum(),
        days: looked_at,
        since,
        before,
    })
}

/// Change points as days, each with its onset. Growth is seen as several steps of one parameter in one direction, which are one.
fn sinces(
    ground: &Ground,
    runs: &[(Vec<modelmill::runs::Fitted>, Moments, f64)],
    known: &[usize],
    points: Vec<ChangePoint>,
) -> Vec<Since> {
    let mut within: Vec<f64> = runs.iter().map(|run| run.2).collect();
    within.sort_by(f64::total_cmp);
    let sums = |some: std::ops::Range<usize>| -> Vec<Moments> {
        runs[some].iter().map(|run| run.1.clone()).collect()
    };
    let mut all: Vec<Since> = Vec::new();
    let mut points = points.into_iter().peekable();
    let mut from = 0;
    while let Some(point) = points.next() {
        let Some(first) = point.steps.first().copied() else {
            continue;
        };
        let by = first.now.value - first.before.value;
        let goes_on = |next: &ChangePoint| {
            let mut steps = next.steps.iter();
            steps.any(|step| {
                step.parameter == first.parameter && (step.now.value - step.before.value) * by > 0.0
            })
        };
        let mut is_several = false;
        while points.next_if(|next| goes_on(next)).is_some() {
            is_several = true;
        }
        let end = points.peek().map_or(runs.len(), |next| next.run);
        let told: Vec<Option<(f64, f64)>> = runs[from..end]
            .iter()
            .map(|run| {
                let fitted = run.0[first.parameter];
                Some((fitted.value, fitted.deviation.filter(|d| *d > 0.0)?))
            })
            .collect();
        let found = onset(&told, point.run - from, NEAR);
        let at = (from + found.day).clamp(from + 1, end - 1);
        let per_day = found.per_day.filter(|slope| slope * by > 0.0);
        let changes = if is_several || per_day.is_some() || at != point.run {
            // What grew is held against what was before at its mean.
            ground.common.changes(&sums(from..at), &sums(at..end), within[within.len() / 2])
        } else {
            point.changes
        };
        all.push(Since {
            day: known[at],
            steps: point.steps,
            per_day,
            changes,
        });
        from = at;
    }
    all
}

/// Sensors that died, each with its first day.
fn dead(days: &[Day]) -> Vec<Dead> {
    let mut all: Vec<Dead> = Vec::new();
    for (k, day) in days.iter().enumerate() {
        let mut seen: Vec<&str> = Vec::new();
        for fault in &day.sensors {
            if seen.contains(&fault.of.as_str()) {
                continue;
            }
            seen.push(&fault.of);
            match all.iter_mut().find(|one| one.of == fault.of) {
                Some(one) => one.days += 1,
                None => all.push(Dead {
                    of: fault.of.clone(),
                    day: k,
                    days: 1,
                    first: fault.clone(),
                }),
            }
        }
    }
    all
}

impl Robot {
    /// Whether nothing is told of it.
    pub fn is_quiet(&self) -> bool {
        self.since.is_empty() && self.dead.is_empty()
    }

    /// All that was found as one JSON object: `values` and `std` of each day are in the order of the parameters.
    pub fn json(&self, ground: &Ground) -> Value {
        let infos = ground.parameters();
        let days = self.days.iter().map(|day| {
            json!({
                "day": day.name,
                "recordings": day.fit.as_ref().map_or(0, |fit| fit.recordings),
                "values": day.fit.as_ref().map(|fit| fit.parameters.iter().map(|one| one.value).collect::<Vec<_>>()),
                "std": day.fit.as_ref().map(|fit| fit.parameters.iter().map(|one| one.deviation).collect::<Vec<_>>()),
                "left": day.fit.as_ref().map(|fit| fit.left.clone()),
                "bad": day.bad.iter().map(|one| json!({ "recording": one.recording, "says": one.says })).collect::<Vec<_>>(),
            })
        });
        let since = self.since.iter().map(|one| {
            let steps = one.steps.iter().map(|step| {
                json!({
                    "parameter": infos[step.parameter].name,
                    "before": step.before.value,
                    "now": step.now.value,
                    "std": step.before.beside(step.now),
                    "unit": infos[step.parameter].unit,
                })
            });
            json!({
                "day": self.days[one.day].name,
                "per_day": one.per_day,
                "parameters": steps.collect::<Vec<_>>(),
                "changes": one.changes.iter().map(change_json).collect::<Vec<_>>(),
            })
        });
        let dead = self.dead.iter().map(|one| {
            json!({
                "sensor": one.of,
                "is_force": one.first.is_force,
                "day": self.days[one.day].name,
                "days": one.days,
                "recording": one.first.recording,
                "still": one.first.still,
                "since": one.first.since,
            })
        });
        json!({
            "robot": self.name,
            "days": days.collect::<Vec<_>>(),
            "since": since.collect::<Vec<_>>(),
            "dead_sensors": dead.collect::<Vec<_>>(),
        })
    }
}

/// A change in physics as JSON, named as `runs` names it.
pub(crate) fn change_json(change: &Changed) -> Value {
    let (kind, at, values) = change.what.parts(change.unit);
    let values = values.into_iter().map(|(name, estimate, unit)| {
        json!({ "name": name, "value": estimate.value, "std": estimate.deviation, "unit": unit })
    });
    json!({
        "kind": kind,
        "at": at,
        "values": values.collect::<Vec<_>>(),
        "says": change.says,
        "not_told_from": change.rivals,
    })
}
