//! Recordings as commands see them: read with the names that the model and the user give, prepared,
//! and evaluated block by block; faults name the time and the line of the recording.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use modelmill_codegen::{PoseFault, PoseReason, States};
use modelmill_identify::filters::decimate_time;
use modelmill_identify::{NotFinite, Note, ReadOptions, Recording, Run, Severity};

use crate::failure::{Failure, Outcome};
use crate::model::Model;
use crate::preparation::PreparationArgs;
use crate::progress::watched;
use crate::terminal;

/// States that are evaluated at once: progress moves on, and memory stays small.
pub(crate) const BLOCK: usize = 4096;

/// A recording that is ready for the model.
pub(crate) struct Data {
    /// The states and forces.
    pub(crate) run: Run,
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

/// Reads and prepares one recording: one or, where it is cut at gaps in time, several stretches.
pub(crate) fn read(model: &Model, path: &Path, args: &PreparationArgs) -> Outcome<Vec<Data>> {
    let options = options(model, args, &header(path))?;
    let recording = watched(&format!("reading {}", path.display()), 0, |_| {
        Recording::read_with(path, &options)
    })?;
    let data = prepare(model, &recording, args)?;
    for note in data.iter().flat_map(Data::notes) {
        match note.severity {
            Severity::Warning => terminal::warn(&note.says),
            Severity::Info => terminal::note(&note.says),
        }
    }
    Ok(data)
}

/// Reads a recording that ships with the program.
pub(crate) fn read_text(model: &Model, name: &str, text: &str) -> Outcome<Data> {
    let recording = Recording::from_reader(text.as_bytes(), name, &ReadOptions::default())?;
    let preparation = PreparationArgs::none().preparation();
    let run = recording.states_with(&model.active(), &model.drives(), &preparation)?;
    Ok(Data { run })
}

fn prepare(model: &Model, recording: &Recording, args: &PreparationArgs) -> Outcome<Vec<Data>> {
    let preparation = args.preparation();
    let mut runs = watched(&format!("preparing {}", recording.file()), 0, |_| {
        recording.runs_with(&model.active(), &model.drives(), &preparation)
    })?;
    if let Some(first) = runs.first_mut() {
        let suspicions = recording.suspicions(&model.motions(), preparation.source);
        first.notes.splice(0..0, suspicions);
    }
    Ok(runs.into_iter().map(|run| Data { run }).collect())
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

/// Names of the columns, roughly: enough to see whether the model's own mapping applies.
fn header(path: &Path) -> Vec<String> {
    let Ok(file) = std::fs::File::open(path) else {
        return Vec::new();
    };
    let mut line = Vec::new();
    let mut reader = BufReader::new(file).take(1 << 20);
    if reader.read_until(b'\n', &mut line).is_err() {
        return Vec::new();
    }
    let text = String::from_utf8_lossy(&line);
    text.split([',', ';', '\t'])
        .map(|name| name.trim_matches(|c: char| c.is_whitespace() || c == '"' || c == '\u{feff}'))
        .map(str::to_owned)
        .collect()
}

/// Renamings: the user's, then those of the model file for columns that the recording has.
fn options(model: &Model, args: &PreparationArgs, header: &[String]) -> Outcome<ReadOptions> {
    let mut known = vec!["t".to_owned()];
    for name in model.active() {
        known.extend([format!("{name}_d"), format!("{name}_dd"), name]);
    }
    known.extend(model.drives());
    for (ours, _) in &args.map {
        if known.contains(ours) {
            continue;
        }
        let why = if model.passive().contains(ours) {
            "is passive: it is computed from the loops and not read"
        } else {
            "is no name of this model"
        };
        return Err(Failure::Usage(format!(
            "--map {ours}=...: `{ours}` {why}; expected one of {}",
            known.join(", ")
        )));
    }
    let mut renames = args.map.clone();
    for (ours, theirs) in &model.derivation.mechanism.recording.columns {
        let free = |name: &String| {
            args.map
                .iter()
                .all(|(mine, other)| mine != ours && other != name)
        };
        if free(theirs) && header.contains(theirs) {
            renames.push((ours.clone(), theirs.clone()));
        }
    }
    Ok(ReadOptions {
        renames,
        not_finite: if args.skip_bad_samples {
            NotFinite::LeaveOut
        } else {
            NotFinite::Refuse
        },
    })
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
            let states = States {
                q: slices(&self.run.q, start, end),
                qd: slices(&self.run.qd, start, end),
                qdd: slices(&self.run.qdd, start, end),
                load: slices(self.run.force.as_deref().unwrap_or(&[]), start, end),
            };
            visit(&states)?.map_err(|fault| self.fault(model, fault, start))?;
            start = end;
        }
        Ok(())
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
    fn fault(&self, model: &Model, fault: PoseFault, start: usize) -> Failure {
        let sample = start + fault.sample;
        let time = self.run.time.get(sample).copied().unwrap_or(f64::NAN);
        let line = self.run.lines.get(sample).copied().unwrap_or(0);
        let pose: Vec<String> = model
            .active()
            .iter()
            .zip(&self.run.q)
            .map(|(name, q)| format!("{name} = {:.6}", q.get(sample).copied().unwrap_or(f64::NAN)))
            .collect();
        let (what, todo) = match fault.reason {
            PoseReason::NotFinite { input } => {
                return Failure::Input(format!(
                    "{}, line {line} (t = {time} s): `{input}` is no finite number",
                    self.run.file
                ));
            }
            PoseReason::OutOfReach => (
                "the loops cannot close at this pose",
                "check the units (rad, m) and the signs of the positions, which column is which \
                 coordinate (--map), and the lengths in the model file",
            ),
            PoseReason::Singular => (
                "the mechanism is singular at this pose, so that forces are not determined",
                "leave the poses around it out of the recording, and check which column is which coordinate (--map)",
            ),
        };
        Failure::Input(format!(
            "{}, line {line} (t = {time} s): {what} ({}); {todo}",
            self.run.file,
            pose.join(", ")
        ))
    }
}

fn slices(columns: &[Vec<f64>], start: usize, end: usize) -> Vec<&[f64]> {
    columns.iter().map(|column| &column[start..end]).collect()
}
