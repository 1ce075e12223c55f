//! A plan with its derived model. Recordings go in and summaries come out; summaries go in and parameters come out.

use std::path::Path;

use modelmill::recording::PreparedRecording;
use modelmill::runs::{FittedValue, ReferenceFit};
use modelmill_identify::ParameterInfo;
use serde_json::{Value, json};

use crate::sensors::{self, SensorFault};
use crate::summary::{BadRecording, FleetSummary};
use crate::{FleetFault, FleetPlan};

/// A plan with its derived model. Threads may share it.
#[derive(Clone)]
pub struct FleetModel {
    /// The plan.
    plan: FleetPlan,
    /// Checksum of the plan, see [`FleetPlan::mark`].
    mark: u64,
    /// The derived model with the columns of all possible changes.
    pub(crate) common: ReferenceFit,
    /// For each coordinate and drive: name, whether it is a drive, and the share of a reference recording with a
    /// constant reading.
    still: Vec<(String, bool, f64)>,
}

/// Parameters that were solved from a summary.
#[derive(Clone, Debug, PartialEq)]
pub struct FleetFit {
    /// Base parameters in the order of the model.
    pub parameters: Vec<FittedValue>,
    /// For each drive the residual of its force relative to the force, rms, with the parameters of each recording.
    pub residual_shares: Vec<f64>,
    /// Number of recordings that were evaluated.
    pub recordings: u64,
    /// Number of recordings that could not be evaluated.
    pub bad: usize,
}

impl FleetModel {
    /// The plan with its derived model.
    pub(crate) fn new(plan: FleetPlan, common: ReferenceFit) -> Self {
        let drives = common.model().row_names();
        let usual = plan.reference.still.iter();
        let still = usual.map(|(name, still)| (name.clone(), drives.contains(name), *still));
        Self {
            mark: plan.mark(),
            still: still.collect(),
            plan,
            common,
        }
    }

    /// The plan.
    pub fn plan(&self) -> &FleetPlan {
        &self.plan
    }

    /// The checksum of the plan, [`FleetPlan::mark`].
    pub fn mark(&self) -> u64 {
        self.mark
    }

    /// The base parameters, in the order in which fits have them.
    pub fn parameters(&self) -> Vec<ParameterInfo> {
        self.common.model().parameter_infos()
    }

    /// Names of the columns that a recording must have: time, coordinates, then drives.
    pub fn columns(&self) -> Vec<String> {
        let model = self.common.model();
        let time = std::iter::once("t".to_owned());
        time.chain(model.active_coordinates())
            .chain(model.row_names())
            .collect()
    }

    /// Names of the drives.
    pub fn drives(&self) -> Vec<String> {
        self.common.model().row_names()
    }

    /// The summary of no recordings.
    pub fn empty_summary(&self) -> FleetSummary {
        FleetSummary::empty(self.mark, self.common.n_columns(), self.drives().len())
    }

    /// Summarises one recording from named columns in memory, in SI units. The rows may be in any order; they are
    /// sorted by column `t`. If the recording cannot be evaluated, the summary has the reason.
    pub fn summarise(&self, name: &str, columns: Vec<(String, Vec<f64>)>) -> FleetSummary {
        let read = sort_by_time(columns).and_then(|columns| {
            let model = self.common.model();
            Ok(model.recording_of_table(name, columns, &self.plan.reading())?)
        });
        self.summary_or_bad(name, read)
    }

    /// Summarises one recording from a file, under a name that may differ from its path.
    pub fn summarise_file(&self, name: &str, path: &Path) -> FleetSummary {
        let model = self.common.model();
        let read = model.recording(path, &self.plan.reading());
        self.summary_or_bad(name, read.map_err(FleetFault::from))
    }

    /// As [`FleetModel::summarise_file`], from the bytes of a file, such as an object of a store. The ending of the
    /// name determines the format.
    pub fn summarise_bytes(&self, name: &str, bytes: Vec<u8>) -> FleetSummary {
        let model = self.common.model();
        let read = model.recording_of_bytes(name, bytes, &self.plan.reading());
        self.summary_or_bad(name, read.map_err(FleetFault::from))
    }

    /// The summary of a recording, or a summary that lists it as bad.
    fn summary_or_bad(&self, name: &str, recording: Result<PreparedRecording, FleetFault>) -> FleetSummary {
        recording
            .and_then(|recording| self.sum_recording(name, recording))
            .unwrap_or_else(|fault| FleetSummary {
                bad: vec![BadRecording {
                    recording: name.to_owned(),
                    says: fault.to_string(),
                }],
                ..self.empty_summary()
            })
    }

    /// Checks the sensors of a recording and sums it up.
    fn sum_recording(&self, name: &str, mut recording: PreparedRecording) -> Result<FleetSummary, FleetFault> {
        // Dead sensors are recognised in the raw readings.
        let time = recording.raw_column("t").unwrap_or_default();
        let columns: Vec<(&str, bool, &[f64], f64)> = self
            .still
            .iter()
            .filter_map(|(of, is_force, usual)| Some((of.as_str(), *is_force, recording.raw_column(of)?, *usual)))
            .collect();
        let sensors = sensors::sensor_faults(name, time, &columns);
        // Size of the recording.
        let samples = time.len() as u64;
        let seconds = match time {
            [first, .., last] => last - first,
            _ => 0.0,
        };
        let drives = self.drives();
        if let Some(encoder) = sensors.iter().find(|one| !one.is_force) {
            // States computed from a dead encoder are wrong, so the recording is not used; the fault is reported.
            let says = format!(
                "the reading of {} is constant for {:.0} % of the recording while others change",
                encoder.of,
                100.0 * encoder.still
            );
            return Ok(FleetSummary {
                bad: vec![BadRecording {
                    recording: name.to_owned(),
                    says,
                }],
                sensors,
                ..self.empty_summary()
            });
        }
        exclude_dead_sensors(&mut recording, &drives, &sensors);
        // Forces of dead sensors are excluded above; their drives have no residual either.
        let sums = self.common.sums(&recording)?;
        let is_dead = |drive: &String| sensors.iter().any(|one| one.of == *drive);
        let left = drives.iter().zip(&sums.residual_ratios).map(|(drive, left)| {
            if is_dead(drive) {
                0.0
            } else {
                left * left * samples as f64
            }
        });
        // Sums over all rows, from which parameters and changes are computed.
        Ok(FleetSummary {
            mark: self.mark,
            recordings: 1,
            samples,
            seconds,
            base: Some(sums.base),
            all_columns: sums.total,
            within: sums.within,
            residual_squares: left.collect(),
            remarks: (sums.events.iter())
                .map(|event| (name.to_owned(), event.says.clone()))
                .collect(),
            sensors,
            bad: Vec::new(),
        })
    }

    /// Solves for the base parameters with standard deviations; parameters that the recordings do not determine have
    /// none.
    ///
    /// Fails if the summary belongs to another plan, or no recording was usable.
    pub fn solve(&self, summary: &FleetSummary) -> Result<FleetFit, FleetFault> {
        self.check_plan(summary)?;
        let Some(base) = &summary.base else {
            // The first bad recording is given as an example.
            let why = match summary.bad.as_slice() {
                [] => "it contains none".to_owned(),
                [first, ..] => format!(
                    "{} could not be evaluated, for example {}: {}",
                    summary.bad.len(),
                    first.recording,
                    first.says
                ),
            };
            return Err(FleetFault::new(format!("this summary has no usable recording: {why}")));
        };
        Ok(FleetFit {
            parameters: self.common.fit_parameters(base)?,
            residual_shares: (0..summary.residual_squares.len())
                .map(|d| summary.residual_share(d))
                .collect(),
            recordings: summary.recordings,
            bad: summary.bad.len(),
        })
    }

    /// Fails if a summary belongs to another plan.
    pub fn check_plan(&self, summary: &FleetSummary) -> Result<(), FleetFault> {
        if summary.mark == self.mark {
            Ok(())
        } else {
            Err(FleetFault::new(
                "this summary was made with another plan; summarise its recordings with this plan, or use the other plan",
            ))
        }
    }

    /// A fit as JSON: `parameters` with `name`, `expression`, `value`, `std` (null where not determined) and `unit`.
    pub fn json(&self, fit: &FleetFit) -> Value {
        let parameters = self.parameters();
        let parameters = parameters.iter().zip(&fit.parameters).map(|(info, fitted)| {
            json!({
                "name": info.name,
                "expression": info.expression,
                "value": fitted.value,
                "std": fitted.std,
                "unit": info.unit,
            })
        });
        json!({
            "parameters": parameters.collect::<Vec<_>>(),
            "left": self.drives().into_iter().zip(fit.residual_shares.iter().map(|x| json!(x))).collect::<serde_json::Map<_, _>>(),
            "recordings": fit.recordings,
            "bad": fit.bad,
        })
    }
}

/// Leaves the forces of dead sensors out of all equations.
fn exclude_dead_sensors(recording: &mut PreparedRecording, drives: &[String], sensors: &[SensorFault]) {
    // Drives with a dead force sensor.
    let is_dead: Vec<bool> = (drives.iter())
        .map(|drive| sensors.iter().any(|one| one.is_force && one.of == *drive))
        .collect();
    if !is_dead.contains(&true) {
        return;
    }
    for segment in &mut recording.segments {
        let run = &mut segment.run;
        // No sample is left out so far.
        if run.left_out.is_empty() {
            run.left_out = vec![vec![false; run.time.len()]; drives.len()];
        }
        for (out, _) in run.left_out.iter_mut().zip(&is_dead).filter(|(_, dead)| **dead) {
            out.fill(true);
        }
    }
}

/// Sorts columns by time. Rows of equal time keep their order, and are refused later.
///
/// Fails if columns have different lengths.
fn sort_by_time(mut columns: Vec<(String, Vec<f64>)>) -> Result<Vec<(String, Vec<f64>)>, FleetFault> {
    let Some((_, time)) = columns.iter().find(|(name, _)| name == "t") else {
        // The reader of recordings reports missing columns, and knows the mapping of the plan for time.
        return Ok(columns);
    };
    // Most recordings are sorted already.
    if time.windows(2).all(|two| two[0] <= two[1]) {
        return Ok(columns);
    }
    let n = time.len();
    if let Some((name, other)) = columns.iter().find(|(_, values)| values.len() != n) {
        return Err(FleetFault::new(format!(
            "column `t` has {n} numbers and column `{name}` has {}; all columns need one number per sample",
            other.len()
        )));
    }
    // The sort is stable, so that rows of equal time keep their order.
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| time[*a].total_cmp(&time[*b]));
    for (_, values) in &mut columns {
        *values = order.iter().map(|i| values[*i]).collect();
    }
    Ok(columns)
}
