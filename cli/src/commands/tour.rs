//! `tour`: the main job on bundled recordings, told as a short story with figures.

mod story;

use std::fmt::Write as _;
use std::path::Path;

use crate::along;
use crate::args::TourArgs;
use crate::bundled::{self, PLAIN, Runs, WITH_RODS};
use crate::commands::equations;
use crate::commands::identify::{self, Result as Identified};
use crate::data::{self, Data};
use crate::estimators::EstimatorArgs;
use crate::failure::{Failure, Outcome};
use crate::model::{self, Model};
use crate::output;
use crate::svg;
use crate::table::{count, number, percent};
use crate::terminal;
use story::Story;

/// Tells the story; with `--out`, writes the equations and the figures as files.
pub(crate) fn run(args: &TourArgs) -> Outcome {
    let folder = args.out.as_deref();
    if let Some(folder) = folder {
        std::fs::create_dir_all(folder).map_err(|error| {
            Failure::Input(format!(
                "the folder {} cannot be made: {error}; give another one with --out",
                folder.display()
            ))
        })?;
    }
    let consistent = load("spidermill.toml")?;
    let paper = load("spidermill-paper.toml")?;
    let mut story = Story::new(terminal::style());
    story.mill(&consistent, &paper);

    let chapters = [
        Chapter::new(&consistent, &PLAIN)?,
        Chapter::new(&paper, &PLAIN)?,
        Chapter::new(&consistent, &WITH_RODS)?,
        Chapter::new(&paper, &WITH_RODS)?,
    ];
    let [plain, plain_paper, rods, rods_paper] = &chapters;

    story.heading("2  A robot that is what the model says");
    story.say(&format!(
        "A multibody code of another house simulated the whole robot, 11 groups of bodies, with the masses of Table 1. \
         {} samples of one motion serve to identify, {} of another to check.",
        plain.result.fit.samples,
        plain.check.samples(),
    ));
    story.parameters(plain);
    story.say(&format!(
        "Before any identification the reduced model misses the measured forces by {} (nrms on the check). \
         Nothing was lost by the reduction from 11 groups to {}.",
        percent(plain.before()),
        count(consistent.base.len(), "number", "numbers"),
    ));

    story.heading("3  The same robot under the paper's treatment");
    story.say(
        "The paper lets the platform's mass m4 act at the joint in the balance of forces and at the coupler's centre \
         in the balance of moments. Its model has one base parameter more, and the same robot does not fit it:",
    );
    story.parameters(plain_paper);
    story.forces(plain_paper)?;
    let p4 = &plain_paper.result.fit.parameters[3];
    story.say(&format!(
        "Identification repairs this, {} before and {} after, and says what was wrong: {} = {} falls from {} to {} {}. \
         For a mass that sits in one place it is zero.",
        percent(plain_paper.before()),
        percent(plain_paper.after()),
        p4.name,
        p4.expression,
        p4.nominal.map_or_else(String::new, number),
        number(p4.value),
        p4.unit,
    ));

    story.heading("4  A robot with something that no model knows of");
    story.say(&format!(
        "Now each spindle is a rod of 8 kg. The consistent model misses the check by {}; identified, by {}.",
        percent(rods.before()),
        percent(rods.after()),
    ));
    story.parameters(rods);
    story.forces(rods)?;
    story.regions(rods)?;
    let p4 = &rods_paper.result.fit.parameters[3];
    story.say(&format!(
        "Under the paper's treatment the error falls from {} to {}, but at a price: {} becomes {} {}, where the truth is 0. \
         The parameters took over part of what is missing. A small error alone does not make a model true.",
        percent(rods_paper.before()),
        percent(rods_paper.after()),
        p4.name,
        number(p4.value),
        p4.unit,
    ));

    story.heading("5  All errors on runs that identification did not see");
    story.overview(&chapters);
    if let Some(folder) = folder {
        let files = write_files(folder, &[&consistent, &paper], &chapters)?;
        story.heading("Files");
        for file in files {
            story.line(&format!("  {file}"));
        }
    } else {
        story.say(
            "`modelmill tour --out DIR` writes the equations and these figures as files; \
             `modelmill equations MODEL` and `modelmill identify MODEL --data RUN` do the same for a mechanism of yours.",
        );
    }
    terminal::print(story.text.trim_start())
}

fn load(name: &str) -> Outcome<Model> {
    model::derive_loaded(name, &bundled::model(name)?)
}

/// One model on one pair of runs.
struct Chapter<'a> {
    model: &'a Model,
    runs: &'static Runs,
    check: Data,
    result: Identified,
}

impl<'a> Chapter<'a> {
    fn new(model: &'a Model, runs: &'static Runs) -> Outcome<Self> {
        let fit = data::read_text(model, runs.fit.0, runs.fit.1)?;
        let mut check = vec![data::read_text(model, runs.check.0, runs.check.1)?];
        let result = identify::identify(model, &[fit], &[], &check, &EstimatorArgs::default())?;
        Ok(Self {
            model,
            runs,
            check: check.remove(0),
            result,
        })
    }

    /// nrms on the check with nominal values.
    fn before(&self) -> Option<f64> {
        self.result.nominal_check.as_ref().and_then(|f| f.nrms)
    }

    /// nrms on the check with identified values.
    fn after(&self) -> Option<f64> {
        self.result.fit.check.as_ref().and_then(|f| f.nrms)
    }

    /// Measured forces of the check and errors before and after, `[drive][sample]`.
    fn curves(&self) -> Outcome<[Vec<Vec<f64>>; 3]> {
        let measured = along::measured(&self.check)?;
        let error = |values: &[f64]| -> Outcome<Vec<Vec<f64>>> {
            let model = along::forces(self.model, &self.check, values)?;
            let pairs = measured.iter().zip(&model);
            Ok(pairs
                .map(|(y, m)| y.iter().zip(m).map(|(y, m)| y - m).collect())
                .collect())
        };
        let before = error(&self.model.nominal)?;
        let after = error(&self.result.values())?;
        Ok([measured, before, after])
    }

    fn title(&self) -> String {
        format!("{}, {}", self.model.name, self.runs.name)
    }
}

/// Equations pages and figures; the paths of what was written.
fn write_files(folder: &Path, models: &[&Model], chapters: &[Chapter<'_>]) -> Outcome<Vec<String>> {
    let mut written = Vec::new();
    let mut write = |name: String, text: &str| -> Outcome {
        let path = folder.join(name);
        output::write(&path, text)?;
        written.push(path.display().to_string());
        Ok(())
    };
    for model in models {
        let pages = equations::pages(model);
        write(format!("{}-equations.html", model.name), &pages.html)?;
        write(format!("{}-equations.md", model.name), &pages.markdown)?;
    }
    for chapter in chapters {
        let [measured, before, after] = chapter.curves()?;
        let time = chapter.check.time();
        let mut figure = svg::Figure::new(&format!("{}, check run", chapter.title()), &time);
        for (d, drive) in chapter.model.drives().iter().enumerate() {
            figure.panel(&format!("{drive}, N"), &[("measured", &measured[d])]);
            figure.panel(
                &format!("{drive}, error, N"),
                &[("nominal", &before[d]), ("identified", &after[d])],
            );
        }
        let name = format!(
            "{}-{}",
            chapter.model.name,
            chapter.runs.name.replace(' ', "-")
        );
        write(format!("{name}.svg"), &figure.finish())?;
        let mut fit = String::new();
        let value = chapter.result.json()?;
        let _ = writeln!(fit, "{value:#}");
        write(format!("{name}-fit.json"), &fit)?;
    }
    Ok(written)
}
