//! `tour`: the main job on bundled recordings, told as a short story with figures.

use std::fmt::Write as _;
use std::path::Path;

use crate::along;
use crate::args::TourArgs;
use crate::bundled::{self, PLAIN, Runs, WITH_RODS};
use crate::commands::equations;
use crate::commands::identify::{self, Result as Identified};
use crate::data::{self, Data};
use crate::failure::{Failure, Outcome};
use crate::model::{self, Model};
use crate::output;
use crate::plot::{Curve, bar, time_axis};
use crate::show;
use crate::svg;
use crate::table::{Align, count, number, percent, table};
use crate::terminal::{self, Style};

/// Tells the story; with `--out`, writes the equations and the figures as files.
pub(crate) fn run(args: &TourArgs) -> Outcome {
    let style = terminal::style();
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
    let mut story = Story {
        text: String::new(),
        style,
    };
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
        let result = identify::identify(model, &[fit], &check)?;
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

/// The text as it grows.
struct Story {
    text: String,
    style: Style,
}

impl Story {
    fn line(&mut self, line: &str) {
        self.text.push_str(line.trim_end());
        self.text.push('\n');
    }

    fn lines(&mut self, lines: &[String]) {
        for line in lines {
            self.line(line);
        }
    }

    fn heading(&mut self, text: &str) {
        let heading = self.style.bold(text);
        self.line("");
        self.line(&heading);
        self.line("");
    }

    /// A paragraph, wrapped.
    fn say(&mut self, text: &str) {
        let mut line = String::new();
        for word in text.split_whitespace() {
            if line.chars().count() + word.chars().count() > 76 {
                self.line(&line);
                line.clear();
            }
            if !line.is_empty() {
                line.push(' ');
            }
            line.push_str(word);
        }
        self.line(&line);
        self.line("");
    }

    /// What the mill makes of the two model files.
    fn mill(&mut self, consistent: &Model, paper: &Model) {
        self.heading("1  From a model file to base parameters");
        let mechanism = &consistent.derivation.mechanism;
        self.say(&format!(
            "spidermill.toml describes a parallel robot: {}, {}, {}. Its forces are linear in {} of dynamic parameters, \
             p_g; many of their columns depend on one another. What remains, exactly and in symbols, is p_min:",
            count(mechanism.parts.len(), "body", "bodies"),
            count(mechanism.loops.len(), "loop", "loops"),
            count(mechanism.drives.len(), "ball screw", "ball screws"),
            count(consistent.derivation.reduction.products.len(), "product", "products"),
        ));
        self.expressions(consistent);
        self.line("");
        self.say(&format!(
            "spidermill-paper.toml is a variant of it that splits the platform's mass as the paper does, with {} in p_g \
             (eq. 5). Its p_min is eq. (16) of the paper:",
            count(paper.derivation.reduction.products.len(), "product", "products"),
        ));
        self.expressions(paper);
    }

    fn expressions(&mut self, model: &Model) {
        self.lines(&show::expressions(2, model));
    }

    fn parameters(&mut self, chapter: &Chapter<'_>) {
        let title = self.style.cyan(&chapter.title());
        self.line(&format!("  {title}: {}", chapter.runs.about));
        self.lines(&show::parameters(&chapter.result.fit.parameters));
        let error = |figures: Option<&modelmill_identify::Figures>, name: &str| -> Vec<String> {
            let mut row = vec![name.to_owned()];
            if let Some(figures) = figures {
                row.push(percent(figures.nrms));
                row.extend(figures.channels.values().map(|c| percent(c.nrms)));
            }
            row
        };
        let result = &chapter.result;
        let rows = [
            error(Some(&result.nominal_fit), "fit, nominal"),
            error(Some(&result.fit.fit), "fit, identified"),
            error(result.nominal_check.as_ref(), "check, nominal"),
            error(result.fit.check.as_ref(), "check, identified"),
        ];
        let drives = chapter.model.drives();
        let mut columns = vec![("error (nrms)", Align::Left), ("all", Align::Right)];
        columns.extend(drives.iter().map(|d| (d.as_str(), Align::Right)));
        self.line("");
        self.lines(&table(2, &columns, &rows));
        self.line("");
    }

    /// Measured force of the first drive, and the errors before and after on one scale.
    fn forces(&mut self, chapter: &Chapter<'_>) -> Outcome {
        let [measured, before, after] = chapter.curves()?;
        let time = chapter.check.time();
        let drive = chapter.model.drives().first().cloned().unwrap_or_default();
        let (Some(measured), Some(before), Some(after)) =
            (measured.first(), before.first(), after.first())
        else {
            return Ok(());
        };
        let largest = before
            .iter()
            .chain(after)
            .fold(0.0_f64, |m, v| m.max(v.abs()));
        let parts = [
            (format!("{drive}, measured, N"), measured, 6, None),
            (
                "error with nominal values, N".to_owned(),
                before,
                4,
                Some(largest),
            ),
            (
                "error with identified values, N".to_owned(),
                after,
                4,
                Some(largest),
            ),
        ];
        for (title, values, height, limit) in parts {
            let title = self.style.dim(&title);
            self.line(&format!("{:>9}  {title}", ""));
            let curve = Curve {
                values,
                height,
                limit,
            };
            self.lines(&curve.lines());
        }
        self.line(&time_axis(&time));
        self.line("");
        Ok(())
    }

    /// Where the error after identification lives.
    fn regions(&mut self, chapter: &Chapter<'_>) -> Outcome {
        let measured = [along::measured(&chapter.check)?];
        let forces = [along::forces(
            chapter.model,
            &chapter.check,
            &chapter.result.values(),
        )?];
        let regions = along::regions(
            chapter.model,
            std::slice::from_ref(&chapter.check),
            &measured,
            &forces,
        )?;
        self.line("Where what is left lives, on the check:");
        self.lines(&show::regions(&regions));
        self.line("");
        Ok(())
    }

    /// All errors on the checks as bars.
    fn overview(&mut self, chapters: &[Chapter<'_>]) {
        let largest = chapters
            .iter()
            .flat_map(|c| [c.before(), c.after()])
            .flatten()
            .fold(0.0, f64::max);
        for chapter in chapters {
            for (when, nrms) in [
                ("nominal", chapter.before()),
                ("identified", chapter.after()),
            ] {
                let name = if when == "nominal" {
                    chapter.title()
                } else {
                    String::new()
                };
                let bar = bar(nrms.unwrap_or(0.0), largest, 24);
                let bar = if when == "nominal" {
                    self.style.red(&bar)
                } else {
                    self.style.green(&bar)
                };
                self.line(&format!(
                    "  {name:<28}{when:<11}{:>11}  {bar}",
                    percent(nrms)
                ));
            }
        }
        self.line("");
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
