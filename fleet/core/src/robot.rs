//! The history of one robot: summaries of its days go in. Parameters over time, permanent changes and dead sensors come
//! out.

use modelmill::runs::{FittedValue, ParameterStep, RunChange};
use modelmill_identify::changes::{NormalEquations, UncertainValue, weighted_mean};
use serde_json::{Value, json};

use crate::onset::clearest_onset;
use crate::sensors::SensorFault;
use crate::{BadRecording, FleetFault, FleetFit, FleetModel, FleetSummary};

/// Smallest step of a parameter that is reported, in standard deviations.
const CHANGE_LIMIT: f64 = 4.0;

/// A day of a robot.
#[derive(Clone, Debug)]
pub struct RobotDay {
    /// Its name, usually a date.
    pub name: String,
    /// Parameters from its recordings; `None` if none could be evaluated.
    pub fit: Option<FleetFit>,
    /// Sensors that were dead in one of its recordings.
    pub sensors: Vec<SensorFault>,
    /// Recordings that could not be evaluated.
    pub bad: Vec<BadRecording>,
}

/// A permanent change of a robot.
#[derive(Clone, Debug)]
pub struct RobotChange {
    /// Index of the first day with the change.
    pub day: usize,
    /// Base parameters that changed, the most significant first: values before and since, with standard deviations.
    pub steps: Vec<ParameterStep>,
    /// Growth per day of the parameter by which the change was detected, in its unit; `None` for a step.
    pub per_day: Option<f64>,
    /// The physical changes that explain it, the most significant first.
    pub changes: Vec<RunChange>,
}

/// A dead sensor, with its first day.
#[derive(Clone, Debug)]
pub struct DeadSensor {
    /// The coordinate or drive.
    pub sensor: String,
    /// Index of the first day.
    pub day: usize,
    /// Number of days on which it was dead.
    pub days: usize,
    /// Its first fault.
    pub first: SensorFault,
}

/// A robot over its days.
#[derive(Clone, Debug)]
pub struct RobotHistory {
    /// Its name.
    pub name: String,
    /// Its days in order of time.
    pub days: Vec<RobotDay>,
    /// Permanent changes, in order of time.
    pub changes: Vec<RobotChange>,
    /// Dead sensors.
    pub dead: Vec<DeadSensor>,
    /// The sum of the recordings before the first change, for the comparison with other robots.
    pub before: FleetSummary,
    /// Number of samples of all its recordings.
    pub samples: u64,
}

/// Evaluates the days of a robot, in order of time, each with the summary of its recordings.
///
/// Fails if summaries belong to another plan.
pub fn robot_history(
    ground: &FleetModel,
    name: &str,
    days: &[(String, FleetSummary)],
) -> Result<RobotHistory, FleetFault> {
    for (_, summary) in days {
        ground.check_plan(summary)?;
    }
    let looked_at: Vec<RobotDay> = days
        .iter()
        .map(|(name, summary)| RobotDay {
            name: name.clone(),
            fit: ground.solve(summary).ok(),
            sensors: summary.sensors.clone(),
            bad: summary.bad.clone(),
        })
        .collect();
    // Days without a usable recording are left out of the search for changes.
    let known: Vec<usize> = (0..days.len()).filter(|k| looked_at[*k].fit.is_some()).collect();
    let runs: Vec<DayRun> = known
        .iter()
        .filter_map(|k| {
            let fit = looked_at[*k].fit.as_ref()?;
            let summary = &days[*k].1;
            Some((fit.parameters.clone(), summary.all_columns.clone(), summary.within))
        })
        .collect();
    let since = robot_changes(ground, &runs, &known);
    let end = since.first().map_or(days.len(), |one| one.day);
    let mut before = ground.empty_summary();
    for (_, summary) in &days[..end] {
        before.merge(summary)?;
    }
    Ok(RobotHistory {
        name: name.to_owned(),
        dead: dead_sensors(&looked_at),
        samples: days.iter().map(|(_, summary)| summary.samples).sum(),
        days: looked_at,
        changes: since,
        before,
    })
}

/// A day as a run: base parameters, normal equations of all columns, and the scatter within its recordings.
type DayRun = (Vec<FittedValue>, NormalEquations, f64);

/// Searches for changes by binary segmentation: each change that is found splits the days, and both sides are searched
/// again. Changes without a physical explanation are not reported; they remain visible in the daily values.
fn robot_changes(ground: &FleetModel, runs: &[DayRun], known: &[usize]) -> Vec<RobotChange> {
    let mut within: Vec<f64> = runs.iter().map(|run| run.2).collect();
    within.sort_by(f64::total_cmp);
    let Some(within) = within.get(within.len() / 2) else {
        return Vec::new();
    };
    let mut all = Vec::new();
    let mut open: Vec<_> = std::iter::once(0..runs.len()).collect();
    while let Some(window) = open.pop() {
        let Some(since) = clearest_change(ground, &runs[window.clone()], *within) else {
            continue;
        };
        let at = window.start + since.day;
        open.push(window.start..at);
        // A ramp continues to the end of its window, so only a step leaves days to search.
        if since.per_day.is_none() {
            open.push(at..window.end);
        }
        all.push(RobotChange {
            day: known[at],
            ..since
        });
    }
    all.sort_by_key(|since| since.day);
    all
}

/// The most significant onset of any parameter, if a physical change explains it.
fn clearest_change(ground: &FleetModel, runs: &[DayRun], within: f64) -> Option<RobotChange> {
    // Values of a parameter over the days; none where it is not determined.
    let series = |k: usize| -> Vec<Option<UncertainValue>> {
        let told = runs.iter().map(|run| {
            let fitted = run.0[k];
            Some((fitted.value, fitted.std.filter(|d| *d > 0.0)?))
        });
        told.collect()
    };
    // The most significant onset of any parameter.
    let parameters = runs.first()?.0.len();
    let onsets = (0..parameters).filter_map(|k| Some((k, clearest_onset(&series(k))?)));
    let (_, found) = onsets.max_by(|a, b| a.1.gain.total_cmp(&b.1.gain))?;
    let sums = |some: &[DayRun]| -> Vec<NormalEquations> { some.iter().map(|run| run.1.clone()).collect() };
    // Physical changes that explain the difference between the days before and since.
    let (before, later) = runs.split_at(found.day);
    let changes = ground.common.changes(&sums(before), &sums(later), within);
    if changes.is_empty() {
        return None;
    }
    // All parameters that differ significantly, by their mean values.
    let mut steps: Vec<ParameterStep> = (0..parameters)
        .filter_map(|parameter| {
            let told = series(parameter);
            let [before, now] = [&told[..found.day], &told[found.day..]].map(|some| {
                let (value, std) = weighted_mean(some)?;
                Some(FittedValue { value, std: Some(std) })
            });
            let step = ParameterStep {
                parameter,
                before: before?,
                now: now?,
            };
            (step_significance(&step) > CHANGE_LIMIT).then_some(step)
        })
        .collect();
    steps.sort_by(|a, b| step_significance(b).total_cmp(&step_significance(a)));
    Some(RobotChange {
        day: found.day,
        steps,
        per_day: found.per_day,
        changes,
    })
}

/// The size of a step in standard deviations of the difference.
fn step_significance(step: &ParameterStep) -> f64 {
    (step.now.value - step.before.value).abs() / step.before.difference_std(step.now)
}

/// Dead sensors, each with its first day and the number of days.
fn dead_sensors(days: &[RobotDay]) -> Vec<DeadSensor> {
    let mut all: Vec<DeadSensor> = Vec::new();
    for (k, day) in days.iter().enumerate() {
        // A sensor counts once per day.
        let mut seen: Vec<&str> = Vec::new();
        for fault in &day.sensors {
            if seen.contains(&fault.of.as_str()) {
                continue;
            }
            seen.push(&fault.of);
            match all.iter_mut().find(|one| one.sensor == fault.of) {
                Some(one) => one.days += 1,
                None => all.push(DeadSensor {
                    sensor: fault.of.clone(),
                    day: k,
                    days: 1,
                    first: fault.clone(),
                }),
            }
        }
    }
    all
}

impl RobotHistory {
    /// Whether it has neither changes nor dead sensors.
    pub fn is_quiet(&self) -> bool {
        self.changes.is_empty() && self.dead.is_empty()
    }

    /// All results as one JSON object: `values` and `std` of each day are in the order of the parameters.
    pub fn json(&self, ground: &FleetModel) -> Value {
        // Parameters by day, changes, and dead sensors.
        let infos = ground.parameters();
        let days = self.days.iter().map(|day| {
            json!({
                "day": day.name,
                "recordings": day.fit.as_ref().map_or(0, |fit| fit.recordings),
                "values": day.fit.as_ref().map(|fit| fit.parameters.iter().map(|one| one.value).collect::<Vec<_>>()),
                "std": day.fit.as_ref().map(|fit| fit.parameters.iter().map(|one| one.std).collect::<Vec<_>>()),
                "left": day.fit.as_ref().map(|fit| fit.residual_shares.clone()),
                "bad": day.bad.iter().map(|one| json!({ "recording": one.recording, "says": one.says })).collect::<Vec<_>>(),
            })
        });
        let since = self.changes.iter().map(|one| {
            let steps = one.steps.iter().map(|step| {
                json!({
                    "parameter": infos[step.parameter].name,
                    "before": step.before.value,
                    "now": step.now.value,
                    "std": step.before.difference_std(step.now),
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
                "sensor": one.sensor,
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

/// A physical change as JSON, with the names of the command `runs`.
pub(crate) fn change_json(change: &RunChange) -> Value {
    let (kind, at, values) = change.change.parts(change.unit);
    let values = values.into_iter().map(
        |(name, estimate, unit)| json!({ "name": name, "value": estimate.value, "std": estimate.std, "unit": unit }),
    );
    json!({
        "kind": kind,
        "at": at,
        "values": values.collect::<Vec<_>>(),
        "says": change.says,
        "not_told_from": change.rivals,
    })
}
