//! The excitation of a sitting: limits that planned motion keeps, a search with its progress, and the trajectory that it found.

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
use crate::told;
use crate::watch::JobWatch;

/// Harmonics, random trajectories and starts, samples of a file: more of them is a slip of the hand.
const MOST_HARMONICS: usize = 50;
const MOST_TRIED: usize = 1_000_000;
const MOST_SAMPLES: f64 = 5e6;

/// A search, and what came of the last one.
#[derive(Default)]
pub(crate) struct ExcitationJob {
    /// Counts the searches of the sitting.
    number: u64,
    /// The text that is asked about.
    revision: u64,
    settings: ExcitationSettings,
    running: Option<(Arc<JobWatch>, f64)>,
    answer: Option<Result<PlannedTrajectory, String>>,
    was_cancelled: bool,
}

impl ExcitationJob {
    /// Nothing was asked for yet; searches are counted from `first` on.
    pub(crate) fn new(first: u64) -> Self {
        Self {
            number: first,
            ..Self::default()
        }
    }
}

/// A trajectory that was found.
struct PlannedTrajectory {
    view: Value,
    csv: String,
}

/// The name under which a trajectory is to be kept.
#[derive(Debug, Deserialize)]
pub(crate) struct KeepTrajectoryRequest {
    name: String,
}

impl ExcitationSettings {
    /// As the library is asked.
    ///
    /// Fails with a sentence where a value cannot be meant.
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
                "rate: expected 1 to 100000 samples per second, and no more than {MOST_SAMPLES} of them in a period"
            ));
        }
        let limit = |text: &String| {
            TrajectoryLimit::parse(text).map_err(|says| format!("`{text}`: {says}"))
        };
        Ok(ExcitationRequest {
            options: Options {
                harmonics: self.harmonics,
                period: self.period,
                random: self.random,
                starts: self.starts,
                seed: self.seed,
                ..Options::default()
            },
            rate: self.rate,
            limits: self.limits.iter().map(limit).collect::<Result<_, _>>()?,
            separate: None,
        })
    }
}

impl WorkbenchSession {
    fn planning(&self) -> MutexGuard<'_, ExcitationJob> {
        self.planning.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What an editor offers while one types.
    pub(crate) fn completions(&self) -> Result<Value, String> {
        let kinds = match self.state().derived.found.as_ref() {
            Ok(model) => model.loaded.kinds.clone(),
            Err(_) => self.host.kinds().map_err(|error| self.error_text(&error))?,
        };
        Ok(told::completion_data(&kinds))
    }

    /// Limits of the active coordinates as the text has them; what has none is `null`.
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
        Ok(json!(model.motions().iter().map(of).collect::<Vec<_>>()))
    }

    /// Begins to search for a trajectory for the text as it stands.
    ///
    /// Fails with a sentence when a search goes on, or a value cannot be meant.
    pub(crate) fn excite(self: &Arc<Self>, asked: ExcitationSettings) -> Result<Value, String> {
        self.model()?;
        let request = asked.request()?;
        let watch = Arc::new(JobWatch::new(Arc::clone(&self.surroundings)));
        let (text, revision) = {
            let state = self.state();
            (state.draft.text().to_owned(), state.draft.revision())
        };
        let number = {
            let mut planning = self.planning();
            if planning.running.is_some() {
                return Err("a search goes on; wait for it, or cancel it".to_owned());
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
        let sitting = Arc::clone(self);
        let host = self.host.clone().with_progress(watch as _);
        let work = move || {
            // A panic must not leave the page waiting for ever.
            let asked = std::panic::AssertUnwindSafe(|| sitting.plan(&host, &text, &request));
            let found = std::panic::catch_unwind(asked).unwrap_or_else(|_| {
                Err(Error::input(
                    "the search ended by a fault of the program, which is none of yours",
                ))
            });
            sitting.finish_excitation(number, found);
        };
        if let Err(error) = self.surroundings.spawn_work(Box::new(work)) {
            self.planning().running = None;
            return Err(format!("the search cannot begin: {error}"));
        }
        Ok(self.excitation())
    }

    fn plan(
        &self,
        host: &modelmill::Host,
        text: &str,
        request: &ExcitationRequest,
    ) -> Outcome<PlannedTrajectory> {
        let path = &self.options.model;
        let model = host.derive(&self.name(), host.load_text(path, text)?)?;
        let found = model.excite(request, &[])?;
        let mut told = found.json();
        told["picture"] = json!(found.picture);
        told["names"] = json!(found.coordinates);
        told["time"] = json!(thin_out(&found.time));
        told["q"] = found.motion.q.iter().map(|q| json!(thin_out(q))).collect();
        told["samples"] = json!(found.time.len());
        told["says"] = json!(format!(
            "Condition number {}, {} for the best of {} random trajectories that keep the limits.",
            significant(found.found.condition_number, 4),
            significant(found.found.start_condition_number, 4),
            found.found.feasible_starts
        ));
        let notes = found.notes.iter();
        told["notes"] = notes.map(|note| note.json(&*self.commands)).collect();
        Ok(PlannedTrajectory {
            view: told,
            csv: found.csv(),
        })
    }

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

    /// Asks the search that goes on to stop.
    pub(crate) fn stop_excitation(&self) -> Value {
        if let Some((watch, _)) = &self.planning().running {
            watch.cancel();
        }
        self.excitation()
    }

    /// How far the search is, or what it found.
    pub(crate) fn excitation(&self) -> Value {
        let revision = self.state().draft.revision();
        let planning = self.planning();
        let going = planning.running.as_ref().map(|(watch, since)| {
            let mut told = watch.progress_view();
            told["seconds"] = json!(self.surroundings.seconds() - since);
            told
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

    /// The trajectory as a file (CSV).
    pub(crate) fn trajectory(&self) -> Result<Value, String> {
        match &self.planning().answer {
            Some(Ok(planned)) => Ok(json!({ "csv": planned.csv })),
            _ => Err("there is no trajectory; search for one first".to_owned()),
        }
    }

    /// Writes the trajectory to a file of the model's folder that is not there yet.
    ///
    /// Fails with a sentence when the name is none of such a file.
    pub(crate) fn keep_trajectory(&self, keeping: &KeepTrajectoryRequest) -> Result<Value, String> {
        let name = keeping.name.trim();
        let is_plain = Path::new(name).file_name().is_some_and(|own| own == name)
            && !name.starts_with('.')
            && !name.contains(['/', '\\', ':'])
            && !name.chars().any(char::is_control);
        if !is_plain || !name.to_ascii_lowercase().ends_with(".csv") {
            return Err(format!(
                "`{name}`: the name of a file of the model's folder is expected, such as excitation.csv"
            ));
        }
        let folder = self.options.model.parent().unwrap_or(Path::new(""));
        let path = folder.join(name);
        if self.surroundings.files().kind(&path) != PathKind::Missing {
            return Err(format!(
                "{} is there already; give another name",
                path.display()
            ));
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
