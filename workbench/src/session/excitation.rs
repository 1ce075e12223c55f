//! The excitation of a session: the limits of the motion, a search with its progress, and the trajectory that it found.

use std::path::Path;
use std::sync::{Arc, MutexGuard, PoisonError};

use modelmill::excite::{ExcitationRequest, Options, TrajectoryLimit, limits};
use modelmill::files::PathKind;
use modelmill::text::table::significant;
use modelmill::{Error, Outcome};
use serde::Deserialize;
use serde_json::{Value, json};

use super::{WorkbenchSession, thin_out};
use crate::options::ExcitationSettings;
use crate::view;
use crate::watch::JobWatch;

/// Largest number of harmonics; more is a typing error.
const MOST_HARMONICS: usize = 50;
/// Largest number of random trajectories, and of starts.
const MOST_TRIED: usize = 1_000_000;
/// Largest number of samples of a file.
const MOST_SAMPLES: f64 = 5e6;

/// A search, or the result of the last one.
#[derive(Default)]
pub(crate) struct ExcitationJob {
    /// Counts the searches of the session.
    number: u64,
    /// The revision of the text for which the search was started.
    revision: u64,
    /// The settings of the search.
    settings: ExcitationSettings,
    /// Progress and start time in s, while it runs.
    running: Option<(Arc<JobWatch>, f64)>,
    /// The trajectory, or why there is none.
    answer: Option<Result<PlannedTrajectory, String>>,
    /// Whether the user cancelled it.
    was_cancelled: bool,
}

impl ExcitationJob {
    /// No search yet; searches are counted from `first`.
    pub(crate) fn new(first: u64) -> Self {
        Self {
            number: first,
            ..Self::default()
        }
    }
}

/// A trajectory that was found.
struct PlannedTrajectory {
    /// JSON for the page.
    view: Value,
    /// One period of the trajectory as CSV.
    csv: String,
}

/// Body of `keep_trajectory`.
#[derive(Debug, Deserialize)]
pub(crate) struct KeepTrajectoryRequest {
    /// Name of the file to write.
    name: String,
}

impl ExcitationSettings {
    /// The same as a request of the library.
    ///
    /// Fails with a sentence if a value is out of its range.
    fn request(&self) -> Result<ExcitationRequest, String> {
        if !(1..=MOST_HARMONICS).contains(&self.harmonics) {
            return Err(format!("harmonics: expected 1 to {MOST_HARMONICS}"));
        }
        for (name, tried) in [("random", self.random), ("starts", self.starts)] {
            if !(1..=MOST_TRIED).contains(&tried) {
                return Err(format!("{name}: expected 1 to {MOST_TRIED}"));
            }
        }
        if !(1e-3..=1e4).contains(&self.period) {
            return Err("period: expected a time in s between 0.001 and 10000".to_owned());
        }
        if !(1.0..=1e5).contains(&self.rate) || self.rate * self.period > MOST_SAMPLES {
            return Err(format!(
                "rate: expected 1 to 100000 samples per second, and at most {MOST_SAMPLES} samples in a period"
            ));
        }
        let limit = |text: &String| TrajectoryLimit::parse(text).map_err(|says| format!("`{text}`: {says}"));
        Ok(ExcitationRequest {
            options: Options {
                harmonics: self.harmonics,
                period: self.period,
                random: self.random,
                starts: self.starts,
                seed: self.seed,
                ..Options::default()
            },
            other_harmonics: Vec::new(),
            rate: self.rate,
            limits: self.limits.iter().map(limit).collect::<Result<_, _>>()?,
            separate: None,
        })
    }
}

impl WorkbenchSession {
    /// The search; a panic of another thread does not lose it.
    fn planning(&self) -> MutexGuard<'_, ExcitationJob> {
        self.planning.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Data for completions in the editor. If the text has faults, kinds of effects are those of the libraries.
    pub(crate) fn completions(&self) -> Result<Value, String> {
        let kinds = match self.state().derived.found.as_ref() {
            Ok(model) => model.loaded.kinds.clone(),
            Err(_) => self.host.kinds().map_err(|error| self.error_text(&error))?,
        };
        Ok(view::completion_data(&kinds))
    }

    /// Limits of the active coordinates in the text, as JSON; `null` where there is none.
    pub(crate) fn limits(&self) -> Result<Value, String> {
        let (model, _) = self.model()?;
        let known = limits::merged_limits(&model, &[]).map_err(|error| self.error_text(&error))?;
        let mechanism = &model.derivation.mechanism;
        let of = |(name, is_angle): &(String, bool)| {
            let mut all = known.coordinates.iter();
            let found = all.find(|(i, _)| mechanism.coordinates[i.0].name == *name);
            let found = found.map(|(_, limits)| *limits).unwrap_or_default();
            json!({
                "name": name,
                "unit": if *is_angle { "rad" } else { "m" },
                "position": found.position,
                "rate": found.rate,
                "acceleration": found.acceleration,
            })
        };
        let limits: Vec<Value> = model.active_coordinate_types().iter().map(of).collect();
        Ok(json!(limits))
    }

    /// Starts a search for a trajectory with the current text.
    ///
    /// Fails with a sentence if a search is running, or a value is out of its range.
    pub(crate) fn excite(self: &Arc<Self>, asked: ExcitationSettings) -> Result<Value, String> {
        self.model()?;
        let request = asked.request()?;
        let watch = Arc::new(JobWatch::new(Arc::clone(&self.surroundings)));
        let (text, revision) = {
            let state = self.state();
            (state.document.text().to_owned(), state.document.revision())
        };
        let number = {
            let mut planning = self.planning();
            if planning.running.is_some() {
                return Err("a search is running; wait until it ends, or cancel it".to_owned());
            }
            *planning = ExcitationJob {
                number: planning.number + 1,
                revision,
                settings: asked,
                running: Some((Arc::clone(&watch), self.surroundings.seconds())),
                ..ExcitationJob::default()
            };
            planning.number
        };
        let session = Arc::clone(self);
        let host = self.host.clone().with_progress(watch as _);
        let work = move || {
            // After a panic the page would wait forever; it gets an error instead.
            let asked = std::panic::AssertUnwindSafe(|| session.plan(&host, &text, &request));
            let found = std::panic::catch_unwind(asked).unwrap_or_else(|_| {
                Err(Error::input(
                    "the search ended with an internal error of the program, not of your input",
                ))
            });
            session.finish_excitation(number, found);
        };
        if let Err(error) = self.surroundings.spawn_work(Box::new(work)) {
            self.planning().running = None;
            return Err(format!("the search cannot be started: {error}"));
        }
        Ok(self.excitation())
    }

    /// Derives the text and searches for the trajectory, on the thread of the job.
    fn plan(&self, host: &modelmill::Host, text: &str, request: &ExcitationRequest) -> Outcome<PlannedTrajectory> {
        let path = &self.options.model;
        let model = host.derive(&self.name(), host.load_text(path, text)?)?;
        let found = model.excite(request, &[])?;
        let mut view_json = found.json();
        view_json["picture"] = json!(found.picture);
        view_json["names"] = json!(found.coordinates);
        view_json["time"] = json!(thin_out(&found.time));
        view_json["q"] = found.motion.q.iter().map(|q| json!(thin_out(q))).collect();
        view_json["samples"] = json!(found.time.len());
        view_json["says"] = json!(format!(
            "The condition number is {}. It was {} for the best of {} random trajectories within the limits.",
            significant(found.found.condition_number, 4),
            significant(found.found.start_condition_number, 4),
            found.found.feasible_starts
        ));
        let notes = found.notes.iter();
        view_json["notes"] = notes.map(|note| note.json(&*self.commands)).collect();
        Ok(PlannedTrajectory {
            view: view_json,
            csv: found.csv(),
        })
    }

    /// Stores the result of search `number`, unless a newer one was started.
    fn finish_excitation(&self, number: u64, found: Outcome<PlannedTrajectory>) {
        let mut planning = self.planning();
        if planning.number != number {
            return;
        }
        planning.running = None;
        match found {
            Ok(planned) => planning.answer = Some(Ok(planned)),
            Err(Error::Cancelled) => planning.was_cancelled = true,
            Err(error) => planning.answer = Some(Err(self.error_text(&error))),
        }
        drop(planning);
        self.notify_pages();
    }

    /// Cancels the running search; returns its view.
    pub(crate) fn stop_excitation(&self) -> Value {
        if let Some((watch, _)) = &self.planning().running {
            watch.cancel();
        }
        self.excitation()
    }

    /// View of the search: its progress, or its result.
    pub(crate) fn excitation(&self) -> Value {
        let revision = self.state().document.revision();
        let planning = self.planning();
        let going = planning.running.as_ref().map(|(watch, since)| {
            let mut view_json = watch.progress_view();
            view_json["seconds"] = json!(self.surroundings.seconds() - since);
            view_json
        });
        let answer = planning.answer.as_ref();
        json!({
            "number": planning.number,
            "going": going,
            "cancelled": planning.was_cancelled,
            "found": answer.and_then(|answer| answer.as_ref().ok()).map(|planned| &planned.view),
            "failed": answer.and_then(|answer| answer.as_ref().err()),
            "command": self.commands.excite_command(&planning.settings),
            "of_this_text": planning.revision == revision,
        })
    }

    /// The trajectory as CSV; fails if there is none.
    pub(crate) fn trajectory(&self) -> Result<Value, String> {
        match &self.planning().answer {
            Some(Ok(planned)) => Ok(json!({ "csv": planned.csv })),
            _ => Err("there is no trajectory; search for one first".to_owned()),
        }
    }

    /// Writes the trajectory to a new file in the model's folder.
    ///
    /// Fails with a sentence if the name is not a plain file name that ends in `.csv`, or the file exists.
    pub(crate) fn keep_trajectory(&self, keeping: &KeepTrajectoryRequest) -> Result<Value, String> {
        let name = keeping.name.trim();
        let is_plain = Path::new(name).file_name().is_some_and(|own| own == name)
            && !name.starts_with('.')
            && !name.contains(['/', '\\', ':'])
            && !name.chars().any(char::is_control);
        if !is_plain || !name.to_ascii_lowercase().ends_with(".csv") {
            return Err(format!(
                "`{name}`: expected the name of a file of the model's folder, such as excitation.csv"
            ));
        }
        let folder = self.options.model.parent().unwrap_or(Path::new(""));
        let path = folder.join(name);
        if self.surroundings.files().kind(&path) != PathKind::Missing {
            return Err(format!("{} is there already; give another name", path.display()));
        }
        let csv = match &self.planning().answer {
            Some(Ok(planned)) => planned.csv.clone(),
            _ => return Err("there is no trajectory; search for one first".to_owned()),
        };
        self.surroundings.write(&path, csv.as_bytes())?;
        Ok(json!({ "path": path.display().to_string() }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_meant_is_refused() {
        let usual = ExcitationSettings::default();
        assert!(usual.request().is_ok());
        for wrong in [
            ExcitationSettings {
                harmonics: 0,
                ..usual.clone()
            },
            ExcitationSettings {
                period: f64::NAN,
                ..usual.clone()
            },
            ExcitationSettings {
                rate: 1e5,
                period: 1e3,
                ..usual.clone()
            },
            ExcitationSettings {
                limits: vec!["theta1=2:1".to_owned()],
                ..usual.clone()
            },
        ] {
            assert!(wrong.request().is_err(), "{wrong:?}");
        }
    }
}
