//! Evaluates a folder of recordings: each recording is summarised once, each robot is evaluated over its days, and then
//! robots are compared with each other. In memory are the summaries of the robots that are being evaluated, and one
//! small summary of each other.

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

/// Number of robots whose recordings are used for a new plan.
const REFERENCE: usize = 8;

/// Files and options of a run.
pub struct FleetRequest<'a> {
    /// The model file.
    pub model: &'a Path,
    /// The folder of recordings.
    pub recordings: &'a Path,
    /// Folder for summaries, results and page.
    pub out: &'a Path,
    /// The plan; if not given, one is made from recordings of several robots.
    pub plan: Option<&'a Path>,
    /// How recordings are read, if there is no plan.
    pub reading: &'a RecordingOptions,
}

/// Results of a fleet.
pub(crate) struct FleetResults {
    /// The plan with its derived model.
    pub(crate) ground: FleetModel,
    /// The robots over their days.
    pub(crate) robots: Vec<RobotHistory>,
    /// The robots before their first change, in the same order.
    pub(crate) ones: Vec<RobotSummary>,
    /// Usual values and robots that differ.
    pub(crate) outliers: modelmill_fleet::outliers::FleetOutliers,
    /// Number of recordings in the folder.
    pub(crate) recordings: usize,
    /// Number of samples of all recordings that were evaluated.
    pub(crate) samples: u64,
}

impl FleetResults {
    /// Recordings that could not be evaluated, of all robots.
    pub(crate) fn bad(&self) -> impl Iterator<Item = &modelmill_fleet::BadRecording> {
        self.robots
            .iter()
            .flat_map(|robot| robot.days.iter().flat_map(|day| &day.bad))
    }
}

/// Evaluates a fleet, writes `results.json` and `fleet.html`, and returns a text for the terminal.
///
/// Fails if the folder has no recordings, the model has faults, or results cannot be written.
pub fn identify(asked: &FleetRequest<'_>) -> Result<String, FleetFault> {
    let begin = Instant::now();
    // Files by robot, and the folder for stored summaries.
    let robots = folder::robots(asked.recordings)?;
    let states = asked.out.join("state");
    fs::create_dir_all(&states).map_err(|error| {
        FleetFault::new(format!(
            "{} cannot be created: {error}; choose another folder with `--out`",
            states.display()
        ))
    })?;
    let plan = plan(asked, &robots.values().map(Vec::as_slice).collect::<Vec<_>>())?;
    let ground = plan.derive_model()?;
    let total: usize = robots.values().map(Vec::len).sum();
    // Counters for the progress and for the summaries that were stored by an earlier run.
    let [done, kept_ones] = [AtomicUsize::new(0), AtomicUsize::new(0)];
    let planned = begin.elapsed();
    let looked_at: Vec<RobotHistory> = robots
        .par_iter()
        .map(|(name, files)| {
            // One robot after the other on each thread, so that few summaries are in memory.
            let days = daily_summaries(&ground, &states, name, files, &kept_ones)?;
            let robot = robot_history(&ground, name, &days)?;
            let before = done.fetch_add(files.len(), Ordering::Relaxed);
            let now = before + files.len();
            // A line of progress at every twentieth.
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
    // Compare the robots with each other.
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
    // Write the results.
    folder::write_atomic(
        &asked.out.join("results.json"),
        format!("{}\n", json(&found)).as_bytes(),
    )?;
    folder::write_atomic(&asked.out.join("fleet.html"), page::page(&found).as_bytes())?;
    let kept = kept_ones.into_inner();
    let seconds = summed.saturating_sub(planned).as_secs_f64();
    // Samples per second without the recordings whose summaries were stored.
    let rate = found.samples as f64 * (total - kept) as f64 / total as f64 / seconds.max(1e-9);
    Ok(format!(
        "{}\n{} recordings, {} of which were done before; {:.3e} samples; {seconds:.1} s to summarise them{}; {:.1} s in total; \
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

/// The results in one sentence.
pub(crate) fn summary_sentence(found: &FleetResults) -> String {
    let changed = found.robots.iter().filter(|robot| !robot.changes.is_empty()).count();
    let dead = found.robots.iter().filter(|robot| !robot.dead.is_empty()).count();
    format!(
        "{} robots: {changed} changed on some day, {dead} lost a sensor, {} differ from the others; {} recordings gave no result",
        found.robots.len(),
        found.outliers.found.len(),
        found.bad().count()
    )
}

/// The largest memory of the process so far, as text (from `/proc`, on Linux only).
fn most_memory() -> String {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.map_or_else(|| "an unknown part".to_owned(), |most| most.trim().to_owned())
}

/// The plan: the one that is given, the one in the folder, or a new one, which is written there.
fn plan(asked: &FleetRequest<'_>, robots: &[&[FleetFile]]) -> Result<FleetPlan, FleetFault> {
    let there = asked.out.join("plan.json");
    let path = asked.plan.unwrap_or(&there);
    if asked.plan.is_some() || path.exists() {
        let text = fs::read_to_string(path).map_err(|error| {
            FleetFault::new(format!(
                "{} cannot be read: {error}; give an existing plan with `--plan`",
                path.display()
            ))
        })?;
        let plan = FleetPlan::parse(&path.display().to_string(), &text)?;
        let model = fs::read_to_string(asked.model).map_err(|error| {
            FleetFault::new(format!(
                "{} cannot be read: {error}; give the model file",
                asked.model.display()
            ))
        })?;
        // A plan belongs to one model; its first file is the model file.
        if plan.files.first().is_none_or(|(_, text)| *text != model) {
            return Err(FleetFault::new(format!(
                "{} was made with another model than {}, so its summaries cannot be used; choose another folder with `--out`, or \
                 use the model of the plan",
                path.display(),
                asked.model.display()
            )));
        }
        // Keep the plan with the summaries that are made with it.
        if asked.plan.is_some() {
            folder::write_atomic(&there, text.as_bytes())?;
        }
        return Ok(plan);
    }
    // The first recordings of robots evenly distributed over the fleet; unreadable ones are left out of the plan.
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

/// The summaries of a robot by day. Recordings without a stored summary are summarised, and the summary is stored.
fn daily_summaries(
    ground: &FleetModel,
    states: &Path,
    name: &str,
    files: &[FleetFile],
    kept_ones: &AtomicUsize,
) -> Result<Vec<(String, FleetSummary)>, FleetFault> {
    // Summaries of an earlier run.
    let (state, mut kept) = SummaryStore::open(states, name, ground.empty_summary().mark)?;
    let done: Vec<Option<FleetSummary>> = files.iter().map(|file| kept.remove(&file.key)).collect();
    kept_ones.fetch_add(done.iter().flatten().count(), Ordering::Relaxed);
    let summaries: Vec<FleetSummary> = files
        .par_iter()
        .zip(done)
        .map(|(file, done)| match done {
            Some(summary) => Ok(summary),
            None => {
                // A new summary is stored at once, so that an interrupted job loses little.
                let summary = ground.summarise_file(&file.name, &file.path);
                state.append(&file.key, &summary)?;
                Ok(summary)
            }
        })
        .collect::<Result<_, FleetFault>>()?;
    // Files are sorted by day, so that each day is a sequence of files.
    let mut days: Vec<(String, FleetSummary)> = Vec::new();
    for (file, summary) in files.iter().zip(summaries) {
        match days.last_mut() {
            Some((day, sum)) if *day == file.day => sum.merge(&summary)?,
            _ => days.push((file.day.clone(), summary)),
        }
    }
    Ok(days)
}

/// All results as JSON.
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
