//! Recordings as commands see them: read with the names that the model and the user give, prepared,
//! and evaluated block by block; faults name the time and the line of the recording.

use std::path::{Path, PathBuf};

use modelmill_codegen::{PoseFault, PoseReason, States};
use modelmill_identify::{
    Note, Recording, Run, Severity, decimate_time, name_of_bytes, place_word,
};

use crate::columns::read_options;
use crate::failure::{Failure, Outcome};
use crate::model::Model;
use crate::piped::piped;
use crate::preparation::PreparationArgs;
use crate::progress::watched;
use crate::terminal;
use crate::variances;

/// States that are evaluated at once: progress moves on, and memory stays small.
pub(crate) const BLOCK: usize = 4096;

/// A recording that is ready for the model.
#[derive(Clone)]
pub(crate) struct Data {
    /// The states and forces.
    pub(crate) run: Run,
    /// Variances of the forces, `[drive][sample]`, where the recording has the columns `DRIVE_var`.
    pub(crate) variance: Option<Vec<Vec<f64>>>,
    /// What each equation counts beside the estimator's weights, interleaved per kept sample; all the same if there are
    /// none.
    pub(crate) weights: Option<Vec<f64>>,
    /// What the drives carry, `[drive][sample]`, for effects that depend on it; the measured forces if there are none.
    pub(crate) load: Option<Vec<Vec<f64>>>,
    /// The options that would read all angles in degrees; empty where no file stands behind.
    pub(crate) maps_from_degrees: String,
}

/// Reads and prepares recordings; their warnings go to standard error.
pub(crate) fn read_all(
    model: &Model,
    paths: &[PathBuf],
    args: &PreparationArgs,
) -> Outcome<Vec<Data>> {
    let mut all = Vec::new();
    for path in paths {
        all.extend(read(model, path, args)?);
    }
    Ok(all)
}

/// Reads and prepares one recording: one or, where it is cut at gaps in time, several stretches. Where the model says
/// that forces are read late, each has the states of the moment at which it acted.
pub(crate) fn read(model: &Model, path: &Path, args: &PreparationArgs) -> Outcome<Vec<Data>> {
    read_paired(model, path, args, model.derivation.mechanism.force_delay)
}

/// As [`read`], with states and forces as the recording has them side by side.
pub(crate) fn read_as_recorded(
    model: &Model,
    path: &Path,
    args: &PreparationArgs,
) -> Outcome<Vec<Data>> {
    read_paired(model, path, args, 0.0)
}

fn read_paired(
    model: &Model,
    path: &Path,
    args: &PreparationArgs,
    delay: f64,
) -> Outcome<Vec<Data>> {
    let piped = piped(path)?;
    let name = path.display().to_string();
    let name = piped
        .as_ref()
        .map_or(name.clone(), |bytes| name_of_bytes(&name, bytes));
    let header = match &piped {
        Some(bytes) => Recording::names_in_bytes(bytes, &name)?,
        None => Recording::names_in(path)?,
    };
    let options = read_options(model, args, &header, &name)?;
    let recording = watched(&format!("reading {name}"), 0, |_| match &piped {
        Some(bytes) => Recording::from_bytes(bytes, &name, &options),
        None => Recording::read_with(path, &options),
    })?;
    let mut data = prepare(model, &recording, args, delay)?;
    note_idle_options(&mut data, args);
    for note in data.iter().flat_map(Data::notes) {
        match note.severity {
            Severity::Warning => terminal::warn(&note.says),
            Severity::Info => terminal::note(&note.says),
        }
    }
    Ok(data)
}

/// Gives every force the states of the moment at which it acted, by the model's delay.
fn pair(run: &mut Run, delay: f64) -> Outcome {
    if delay == 0.0 {
        return Ok(());
    }
    let ms = 1e3 * delay;
    let Some((start, end)) = run.pair_with_earlier_states(delay) else {
        return Err(Failure::Input(format!(
            "{}: the model's `time_delay` of {ms} ms leaves fewer than four of {} samples with states to go with; check T, \
             which is in seconds",
            run.file,
            run.time.len()
        )));
    };
    let (side, lost) = if start > 0 {
        ("first", start)
    } else {
        ("last", end)
    };
    let lost = match lost {
        0 => String::new(),
        1 => format!("; the {side} sample has no states to go with and is left out"),
        n => format!("; the {side} {n} samples have no states to go with and are left out"),
    };
    run.notes.push(Note {
        severity: Severity::Info,
        says: format!(
            "Forces of {} are held against the states of {ms} ms before, as the model's `time_delay` says{lost}.",
            run.file
        ),
    });
    Ok(())
}

fn prepare(
    model: &Model,
    recording: &Recording,
    args: &PreparationArgs,
    delay: f64,
) -> Outcome<Vec<Data>> {
    let preparation = args.preparation();
    let mut runs = watched(&format!("preparing {}", recording.file()), 0, |_| {
        recording.runs_with(&model.active(), &model.drives(), &preparation)
    })?;
    if let Some(first) = runs.first_mut() {
        let suspicions = recording.suspicions(&model.motions(), preparation.source);
        first.notes.splice(0..0, suspicions);
        let oddities = recording.oddities(&model.motions(), &model.drives());
        first.notes.splice(0..0, oddities);
    }
    let motions = model.motions();
    let angles = motions.iter().filter(|(_, is_angle)| *is_angle);
    let maps: Vec<String> = angles
        .map(|(name, _)| recording.maps_from_degrees(name))
        .collect();
    let maps_from_degrees = maps.join(" ");
    for run in &mut runs {
        let idle = run.suspicious_forces(&model.drives());
        run.notes.extend(idle);
        pair(run, delay)?;
    }
    let with_variance = runs.into_iter().map(|run| {
        let variance = variances::of(recording, &run, &model.drives())?;
        Ok(Data {
            run,
            variance,
            weights: None,
            load: None,
            maps_from_degrees: maps_from_degrees.clone(),
        })
    });
    with_variance.collect()
}

/// Says that options of the filter do nothing where all derivatives are recorded.
fn note_idle_options(data: &mut [Data], args: &PreparationArgs) {
    let given: Vec<&str> = [
        args.cutoff.map(|_| "--cutoff"),
        args.order.map(|_| "--order"),
    ]
    .into_iter()
    .flatten()
    .collect();
    if given.is_empty() || data.iter().any(|one| one.run.prepared.cutoff_hz.is_some()) {
        return;
    }
    if let Some(one) = data.first_mut() {
        let does = if given.len() == 1 { "does" } else { "do" };
        one.run.notes.push(Note::warning(format!(
            "{} {does} nothing to {}: it holds all rates and accelerations, so none are made from positions; ask for \
             that with `--derivatives positions`.",
            given.join(" and "),
            one.run.file
        )));
    }
}

/// Warns of recordings that are given twice, also as copies: they count twice, or make a check that proves nothing.
pub(crate) fn note_twins(data: &mut [Data], check: &mut [Data]) {
    for k in 1..data.len() {
        let (before, rest) = data.split_at_mut(k);
        if let Some(twin) = before.iter().find(|other| other.is_twin_of(&rest[0])) {
            let says = format!(
                "{} and {} are the same recording: it counts twice, and deviations come out too small; give it once.",
                twin.run.file, rest[0].run.file
            );
            rest[0].warn(says);
        }
    }
    for one in check {
        if let Some(twin) = data.iter().find(|other| other.is_twin_of(one)) {
            let says = format!(
                "{} is used for the fit and {} for the check, but they are the same recording: such a check proves \
                 nothing; check on another motion.",
                twin.run.file, one.run.file
            );
            one.warn(says);
        }
    }
}

impl From<Run> for Data {
    /// A run without variances whose equations count all the same.
    fn from(run: Run) -> Self {
        Self {
            run,
            variance: None,
            weights: None,
            load: None,
            maps_from_degrees: String::new(),
        }
    }
}

impl Data {
    /// Samples before decimation.
    pub(crate) fn samples(&self) -> usize {
        self.run.samples()
    }

    /// Every how many samples one is kept.
    pub(crate) fn decimation(&self) -> usize {
        self.run.prepared.decimate.max(1)
    }

    /// Times of the samples that are kept.
    pub(crate) fn time(&self) -> Vec<f64> {
        decimate_time(&self.run.time, self.decimation())
    }

    /// A remark that goes to standard error and into the JSON.
    pub(crate) fn note(&mut self, note: Note) {
        match note.severity {
            Severity::Warning => terminal::warn(&note.says),
            Severity::Info => terminal::note(&note.says),
        }
        self.run.notes.push(note);
    }

    /// A warning that goes to standard error and into the JSON.
    fn warn(&mut self, says: String) {
        terminal::warn(&says);
        self.run.notes.push(Note::warning(says));
    }

    /// Whether both hold the same numbers.
    fn is_twin_of(&self, other: &Self) -> bool {
        let (a, b) = (&self.run, &other.run);
        a.time == b.time && a.q == b.q && a.qd == b.qd && a.qdd == b.qdd && a.force == b.force
    }

    /// Remarks, for the JSON.
    pub(crate) fn notes(&self) -> &[Note] {
        &self.run.notes
    }

    /// Calls `visit` with one block of states after the other; `visit` may find a pose without answer.
    pub(crate) fn for_each_block<E: From<Failure>>(
        &self,
        model: &Model,
        mut visit: impl FnMut(&States<'_>) -> Result<Result<(), PoseFault>, E>,
    ) -> Result<(), E> {
        self.check_load(model)?;
        let n = self.samples();
        let mut start = 0;
        while start < n {
            let end = (start + BLOCK).min(n);
            let states = self.states(start, end);
            visit(&states)?.map_err(|fault| self.fault(model, fault, start))?;
            start = end;
        }
        Ok(())
    }

    /// Some of the states.
    pub(crate) fn states(&self, start: usize, end: usize) -> States<'_> {
        States {
            q: slices(&self.run.q, start, end),
            qd: slices(&self.run.qd, start, end),
            qdd: slices(&self.run.qdd, start, end),
            load: slices(self.loads(), start, end),
        }
    }

    fn loads(&self) -> &[Vec<f64>] {
        let loads = self.load.as_deref().or(self.run.force.as_deref());
        loads.unwrap_or(&[])
    }

    fn check_load(&self, model: &Model) -> Outcome {
        let effects = model.load_dependent();
        if effects.is_empty() || self.run.force.is_some() {
            return Ok(());
        }
        Err(Failure::Input(format!(
            "{}: {} depends on the load that the drives carry, but the recording lacks the measured force of {}; \
             record it, or name its column with --map",
            self.run.file,
            effects.join(", "),
            self.run.missing_force.join(", ")
        )))
    }

    /// A pose without answer, with its place in the recording.
    pub(crate) fn fault(&self, model: &Model, fault: PoseFault, start: usize) -> Failure {
        let sample = start + fault.sample;
        let time = self.run.time.get(sample).copied().unwrap_or(f64::NAN);
        let line = self.run.lines.get(sample).copied().unwrap_or(0);
        let place = place_word(&self.run.file);
        let pose: Vec<String> = model
            .active()
            .iter()
            .zip(&self.run.q)
            .map(|(name, q)| format!("{name} = {:.6}", q.get(sample).copied().unwrap_or(f64::NAN)))
            .collect();
        let (what, todo) = match fault.reason {
            PoseReason::NotFinite { input } => {
                return Failure::Input(format!(
                    "{}, {place} {line} (t = {time} s): `{input}` is no finite number",
                    self.run.file
                ));
            }
            PoseReason::OutOfReach => (
                "the loops cannot close at this pose",
                "check the units (rad, m) and the signs of the positions, which column is which \
                 coordinate (--map), and the lengths in the model file",
            ),
            PoseReason::Undefined => (
                "a term of the model has no finite value at this state",
                "look at the effects whose expressions hold quotients, roots or exponentials",
            ),
            PoseReason::Singular => (
                "the mechanism is singular at this pose, so that forces are not determined",
                "leave the poses around it out of the recording, and check which column is which coordinate (--map)",
            ),
        };
        Failure::Input(format!(
            "{}, {place} {line} (t = {time} s): {what} ({}); {todo}",
            self.run.file,
            pose.join(", ")
        ))
    }
}

fn slices(columns: &[Vec<f64>], start: usize, end: usize) -> Vec<&[f64]> {
    columns.iter().map(|column| &column[start..end]).collect()
}
