//! A folder of recordings to results: every recording is summed up once, robots are looked at one after the other, and then held
//! against each other. Memory holds the summaries of the robots that are looked at just now, and one small summary of each.

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use modelmill::recording::RecordingOptions;
use modelmill_fleet::folder::{self, FleetFile};
use modelmill_fleet::outliers::{RobotSummary, outliers};
use modelmill_fleet::robot::{RobotHistory, robot_history};
use modelmill_fleet::{FleetFault, FleetModel, FleetPlan, FleetSummary};
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::page;
use crate::state::SummaryStore;

/// Robots of which a plan is made.
const REFERENCE: usize = 8;

/// What is asked.
pub struct FleetRequest<'a> {
    /// The model file.
    pub model: &'a Path,
    /// The folder of recordings.
    pub recordings: &'a Path,
    /// Where states, results and page go.
    pub out: &'a Path,
    /// The plan; made from recordings of several robots where there is none.
    pub plan: Option<&'a Path>,
    /// How recordings are read, where no plan says it.
    pub reading: &'a RecordingOptions,
}

/// What was found.
pub(crate) struct FleetResults {
    pub(crate) ground: FleetModel,
    pub(crate) robots: Vec<RobotHistory>,
    pub(crate) ones: Vec<RobotSummary>,
    pub(crate) outliers: modelmill_fleet::outliers::FleetOutliers,
    pub(crate) recordings: usize,
    pub(crate) samples: u64,
}

impl FleetResults {
    pub(crate) fn bad(&self) -> impl Iterator<Item = &modelmill_fleet::BadRecording> {
        self.robots
            .iter()
            .flat_map(|robot| robot.days.iter().flat_map(|day| &day.bad))
    }
}

/// Identifies a fleet; the result is what is said in the end.
///
/// Fails where the folder holds no recordings, the model has no meaning, or results cannot be written.
pub fn identify(asked: &FleetRequest<'_>) -> Result<String, FleetFault> {
    let begin = Instant::now();
    let robots = folder::robots(asked.recordings)?;
    let states = asked.out.join("state");
    fs::create_dir_all(&states).map_err(|error| {
        FleetFault::new(format!(
            "{} cannot be made: {error}; choose another place",
            states.display()
        ))
    })?;
    let plan = plan(
        asked,
        &robots.values().map(Vec::as_slice).collect::<Vec<_>>(),
    )?;
    let ground = plan.derive_model()?;
    let total: usize = robots.values().map(Vec::len).sum();
    let [done, kept_ones] = [AtomicUsize::new(0), AtomicUsize::new(0)];
    let planned = begin.elapsed();
    let looked_at: Vec<RobotHistory> = robots
        .par_iter()
        .map(|(name, files)| {
            let days = daily_summaries(&ground, &states, name, files, &kept_ones)?;
            let robot = robot_history(&ground, name, &days)?;
            let before = done.fetch_add(files.len(), Ordering::Relaxed);
            let now = before + files.len();
            if now * 20 / total != before * 20 / total {
                eprintln!("{now} of {total} recordings");
            }
            Ok(robot)
        })
        .collect::<Result<_, FleetFault>>()?;
    let summed = begin.elapsed();
    let ones: Vec<RobotSummary> = looked_at
        .iter()
        .map(|robot| RobotSummary {
            name: robot.name.clone(),
            summary: robot.before.clone(),
        })
        .collect();
    let outliers = outliers(&ground, &ones)?;
    let samples = looked_at.iter().map(|robot| robot.samples).sum();
    let found = FleetResults {
        ground,
        robots: looked_at,
        ones,
        outliers,
        recordings: total,
        samples,
    };
    folder::write_atomic(
        &asked.out.join("results.json"),
        format!("{}\n", json(&found)).as_bytes(),
    )?;
    folder::write_atomic(&asked.out.join("fleet.html"), page::page(&found).as_bytes())?;
    let kept = kept_ones.into_inner();
    let seconds = summed.saturating_sub(planned).as_secs_f64();
    let rate = found.samples as f64 * (total - kept) as f64 / total as f64 / seconds.max(1e-9);
    Ok(format!(
        "{}\n{} recordings, {} of which were done before; {:.3e} samples; {seconds:.1} s to sum them up{}; {:.1} s in all; \
         at most {} in memory\n{} and {} written\n",
        summary_sentence(&found),
        total,
        kept,
        found.samples as f64,
        if kept < total {
            format!(", {rate:.3e} samples a second")
        } else {
            String::new()
        },
        begin.elapsed().as_secs_f64(),
        most_memory(),
        asked.out.join("results.json").display(),
        asked.out.join("fleet.html").display()
    ))
}

/// In one sentence.
pub(crate) fn summary_sentence(found: &FleetResults) -> String {
    let changed = found
        .robots
        .iter()
        .filter(|robot| !robot.changes.is_empty())
        .count();
    let dead = found
        .robots
        .iter()
        .filter(|robot| !robot.dead.is_empty())
        .count();
    format!(
        "{} robots: {changed} changed on some day, {dead} lost a sensor, {} differ from the others; {} recordings gave no answer",
        found.robots.len(),
        found.outliers.found.len(),
        found.bad().count()
    )
}

/// The most memory that the process has had, in words; Linux says it.
fn most_memory() -> String {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.map_or_else(
        || "an unknown part".to_owned(),
        |most| most.trim().to_owned(),
    )
}

/// The plan of the folder: the one that is given, the one that is there, or a new one.
fn plan(asked: &FleetRequest<'_>, robots: &[&[FleetFile]]) -> Result<FleetPlan, FleetFault> {
    let there = asked.out.join("plan.json");
    let path = asked.plan.unwrap_or(&there);
    if asked.plan.is_some() || path.exists() {
        let text = fs::read_to_string(path).map_err(|error| {
            FleetFault::new(format!(
                "{} cannot be read: {error}; name a plan that is there",
                path.display()
            ))
        })?;
        let plan = FleetPlan::parse(&path.display().to_string(), &text)?;
        let model = fs::read_to_string(asked.model).map_err(|error| {
            FleetFault::new(format!(
                "{} cannot be read: {error}; name the model file",
                asked.model.display()
            ))
        })?;
        if plan.files.first().is_none_or(|(_, text)| *text != model) {
            return Err(FleetFault::new(format!(
                "{} is of another model than {}: what was summed up by it does not fit; choose another folder with `--out`, or \
                 the model as it was",
                path.display(),
                asked.model.display()
            )));
        }
        if asked.plan.is_some() {
            folder::write_atomic(&there, text.as_bytes())?;
        }
        return Ok(plan);
    }
    // Robots from all over the fleet, and their first recordings; those that cannot be read are passed over.
    let every = robots.len().div_ceil(REFERENCE).max(1);
    let reference: Vec<&Path> = robots
        .iter()
        .step_by(every)
        .filter_map(|files| Some(files.first()?.path.as_path()))
        .collect();
    let plan = FleetPlan::from_recordings(asked.model, asked.reading, &reference)?;
    folder::write_atomic(&there, plan.json().as_bytes())?;
    Ok(plan)
}

/// The summaries of a robot's recordings, day by day; those that are not kept are made.
fn daily_summaries(
    ground: &FleetModel,
    states: &Path,
    name: &str,
    files: &[FleetFile],
    kept_ones: &AtomicUsize,
) -> Result<Vec<(String, FleetSummary)>, FleetFault> {
    let (state, mut kept) = SummaryStore::open(states, name, ground.empty_summary().mark)?;
    let done: Vec<Option<FleetSummary>> = files.iter().map(|file| kept.remove(&file.key)).collect();
    kept_ones.fetch_add(done.iter().flatten().count(), Ordering::Relaxed);
    let summaries: Vec<FleetSummary> = files
        .par_iter()
        .zip(done)
        .map(|(file, done)| match done {
            Some(summary) => Ok(summary),
            None => {
                let summary = ground.summarise_file(&file.name, &file.path);
                state.append(&file.key, &summary)?;
                Ok(summary)
            }
        })
        .collect::<Result<_, FleetFault>>()?;
    let mut days: Vec<(String, FleetSummary)> = Vec::new();
    for (file, summary) in files.iter().zip(summaries) {
        match days.last_mut() {
            Some((day, sum)) if *day == file.day => sum.merge(&summary)?,
            _ => days.push((file.day.clone(), summary)),
        }
    }
    Ok(days)
}

/// All that was found.
fn json(found: &FleetResults) -> Value {
    let ground = &found.ground;
    let parameters = ground.parameters();
    let parameters = parameters
        .iter()
        .map(|info| json!({ "name": info.name, "expression": info.expression, "unit": info.unit }));
    json!({
        "version": 1,
        "model": ground.plan().model,
        "recordings": found.recordings,
        "samples": found.samples,
        "bad": found.bad().map(|one| json!({ "recording": one.recording, "says": one.says })).collect::<Vec<_>>(),
        "parameters": parameters.collect::<Vec<_>>(),
        "fleet": found.outliers.json(ground, &found.ones),
        "robots": found.robots.iter().map(|robot| robot.json(ground)).collect::<Vec<_>>(),
    })
}
