//! `tour`: the whole story on bundled recordings: derive, compare, see where it fails, learn what is missing, add it, watch
//! the error fall; then the same for the paper's own treatment. Everything it uses and makes goes into one folder, so that
//! each command can be repeated by hand.

mod story;

use std::path::{Path, PathBuf};

use crate::along;
use crate::args::TourArgs;
use crate::bundled::{self, PLAIN, Runs, WITH_RODS};
use crate::commands::add;
use crate::data::{self, Data};
use crate::diagnosis::Held;
use crate::failure::{Failure, Outcome};
use crate::model::{self, Model};
use crate::output;
use crate::preparation::PreparationArgs;
use crate::report::{Question, Study, added, render, study, words};
use crate::terminal;
use story::Story;

/// The page of the robot with rods.
const RODS_PAGE: &str = "report.html";
/// The page of the paper's treatment.
const PAPER_PAGE: &str = "report-paper.html";
/// The model with what was found.
const EDITED: &str = "spidermill-completed.toml";

/// Tells the story and writes its files.
pub(crate) fn run(args: &TourArgs) -> Outcome {
    let folder = args
        .out
        .clone()
        .unwrap_or_else(|| std::env::temp_dir().join("modelmill-tour"));
    output::make_folder(&folder)?;
    let place = Place::unpack(&folder)?;
    let mut story = Story::new(terminal::style());

    let (path, model) = place.model("spidermill.toml")?;
    let [_, check] = place.read(&model, &WITH_RODS)?;
    story.derive(&place.name("spidermill.toml"), &model);
    let seen = Seen::new(&model, &check)?;
    story.compare(&place, &model, &seen);

    let rods = place.study(&path, model, &WITH_RODS, Held::Known)?;
    story.diagnose(&place, &rods);
    let edited = place.add(&path, &rods)?;
    story.add(&place, edited.as_ref());
    story.ladder(&rods);
    place.write(RODS_PAGE, &render(&rods))?;

    let (path, model) = place.model("spidermill-paper.toml")?;
    let paper = place.study(&path, model, &PLAIN, Held::All)?;
    story.paper(&place, &paper);
    place.write(PAPER_PAGE, &render(&paper))?;

    story.pages(&place);
    terminal::print(story.text.trim_start())
}

/// The folder of the tour.
struct Place {
    folder: PathBuf,
}

impl Place {
    /// Writes models and recordings of the program into a folder.
    fn unpack(folder: &Path) -> Outcome<Self> {
        let place = Self {
            folder: folder.to_owned(),
        };
        for (name, text) in bundled::MODELS {
            place.write(name, text)?;
        }
        for runs in [&PLAIN, &WITH_RODS] {
            for (name, text) in [runs.fit, runs.check] {
                place.write(file_name(name), text)?;
            }
        }
        Ok(place)
    }

    fn write(&self, name: &str, text: &str) -> Outcome {
        output::write(&self.folder.join(name), text)
    }

    /// A file of the folder as a command has it.
    fn name(&self, file: &str) -> String {
        added::quoted(&self.folder.join(file).display().to_string())
    }

    /// Recordings as a command has them.
    fn recordings(&self, runs: &Runs) -> String {
        format!(
            "--data {} --check {}",
            self.name(file_name(runs.fit.0)),
            self.name(file_name(runs.check.0))
        )
    }

    fn model(&self, name: &str) -> Outcome<(PathBuf, Model)> {
        let path = self.folder.join(name);
        let model = model::derive(&path)?;
        Ok((path, model))
    }

    fn read(&self, model: &Model, runs: &Runs) -> Outcome<[Vec<Data>; 2]> {
        let read = |name: &str| {
            let path = self.folder.join(file_name(name));
            data::read(model, &path, &PreparationArgs::none())
        };
        Ok([read(runs.fit.0)?, read(runs.check.0)?])
    }

    fn study(&self, path: &Path, model: Model, runs: &Runs, held: Held) -> Outcome<Study> {
        let loaded = model::load(path)?;
        let again = |model: &Model| self.read(model, runs);
        let [fit, check] = again(&model)?;
        study(Question {
            path,
            loaded: &loaded,
            libraries: &[],
            model,
            fit,
            check,
            held,
            again: &again,
            recordings: self.recordings(runs),
        })
    }

    /// Writes the model with what was found beside the one it came from; the commands for it, and the difference.
    fn add(&self, path: &Path, study: &Study) -> Outcome<Option<(Vec<String>, String)>> {
        let Some(edited) = &study.edited else {
            return Ok(None);
        };
        let before = std::fs::read_to_string(path)
            .map_err(|error| Failure::Input(format!("{}: {error}", path.display())))?;
        self.write(EDITED, &edited.text)?;
        let name = path.display().to_string();
        let commands = study.entries.iter();
        let commands = commands.map(|entry| added::command(&name, entry)).collect();
        let difference = add::difference(&before, &edited.text, ["spidermill.toml", EDITED]);
        Ok(Some((commands, add::coloured(&difference))))
    }
}

/// The last part of a bundled recording's name.
fn file_name(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

/// The model with nominal parameters held against a recording.
struct Seen {
    figures: modelmill_identify::Figures,
    places: along::Places,
    time: Vec<f64>,
    measured: Vec<Vec<f64>>,
    errors: Vec<Vec<f64>>,
}

impl Seen {
    fn new(model: &Model, data: &[Data]) -> Outcome<Self> {
        let one = data
            .first()
            .ok_or_else(|| Failure::Input("the bundled recording has no sample".to_owned()))?;
        let measured = along::measured(one)?;
        let forces = along::forces(model, one, &model.nominal)?;
        let errors = measured
            .iter()
            .zip(&forces)
            .map(|(y, m)| y.iter().zip(m).map(|(y, m)| y - m).collect())
            .collect();
        let figures = along::figures(&model.drives(), [(&measured[..], &forces[..])])?;
        let all = [measured];
        let places = along::places(model, std::slice::from_ref(one), &all, &[forces])?;
        let [measured] = all;
        Ok(Self {
            figures,
            places,
            time: one.time(),
            measured,
            errors,
        })
    }
}

/// The verdict of a study in words.
fn verdict(study: &Study) -> String {
    let drives = study.before.model.drives();
    words::verdict(&study.answer.diagnosis, &drives, study.judged)
}
