//! `excite`: the periodic trajectory that tells the base parameters apart best, eq. (14), (15) and (17), or that tells an
//! effect from what it may be taken for.

mod told;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use modelmill_identify::excite::{
    Criterion, Excitation, Motion, Options, Plant, excite, scaled_condition_number, steps,
};
use serde_json::{Map, Value, json};

use crate::args::{CriterionArg, ExciteArgs};
use crate::failure::{Failure, Outcome};
use crate::limits;
use crate::model::{self, Model};
use crate::output::Target;
use crate::plant::{ModelPlant, used};
use crate::progress::watched;
use crate::svg::Figure;
use crate::table::{Align, count, number, significant, table};
use crate::terminal;

use told::Told;

/// Searches, and writes the trajectory and its picture.
pub(crate) fn run(args: &ExciteArgs) -> Outcome {
    let loaded = model::load(&args.model)?;
    let model = model::derive_loaded(&args.model.display().to_string(), &loaded)?;
    let inputs = || model.files.iter().map(AsRef::<Path>::as_ref);
    let target = Target::new(&args.out, inputs())?;
    let figure = Target::new(&figure_path(args), inputs())?;
    if figure.path() == target.path() {
        return Err(Failure::Usage(
            "--out and --figure name the same file; the trajectory is CSV, the picture SVG"
                .to_owned(),
        ));
    }
    let all_limits = limits::limits(&model, &args.limits)?;
    let coordinates = limits::of_active(&model, &all_limits)?;
    let mut options = args.options();
    let plant = ModelPlant::new(&model, &all_limits);
    let asked = told::ask(
        &args.model,
        &loaded,
        &model,
        &plant,
        &coordinates,
        &options,
        &args.separate,
    )?;
    let separating = asked.as_ref().map(|asked| asked.plant(&plant, &model));
    if separating.is_some() {
        options.criterion = Criterion::Separation;
    } else if !plant.has_unknowns() {
        return Err(Failure::Input(format!(
            "{}: no base parameter is unknown, so there is nothing to excite",
            model.path
        )));
    }
    let searched: &dyn Plant = match &separating {
        Some(separating) => separating,
        None => &plant,
    };
    let found = watched("searching for a trajectory", steps(&options), |done| {
        excite(searched, &coordinates, &options, &|more| done.add(more))
    })
    .map_err(|error| Failure::Input(format!("{}: {error}", model.path)))?;
    let samples = samples(args);
    let motion = Motion::sample(&found.series, samples);
    let time: Vec<f64> = (0..samples)
        // Picoseconds are enough, and 7.288 reads better than 7.287999999999999.
        .map(|i| (1e12 * i as f64 * args.period / samples as f64).round() / 1e12)
        .collect();
    let told = match (&asked, &separating) {
        (Some(asked), Some(separating)) => Some(Told {
            apart: separating
                .along(&motion, &separating.which)
                .ok_or_else(|| {
                    Failure::Input(format!(
                        "{}: nothing is left of the difference at {} samples per second; \
                     give a higher --rate",
                        model.path, args.rate
                    ))
                })?,
            random: (-found.first).exp(),
            before: asked.before(&model)?,
            unit: told::unit(&model),
            drives: model.drives().len(),
            samples,
            asked,
        }),
        _ => None,
    };
    let title = match &told {
        Some(told) => format!("{}: tells {}", model.name, told.asked.words()),
        None => format!(
            "{}: excitation with condition number {}",
            model.name,
            significant(found.condition_number, 4)
        ),
    };
    target.write(&csv(&model, &time, &motion))?;
    figure.write(&picture(&model, &plant, &found, &title, &time, &motion))?;
    let answer = Answer {
        model: &model,
        found: &found,
        options: &options,
        told,
        scaled: plant
            .regressor(&motion)
            .filter(|w| w.ncols() > 0)
            .map(|w| scaled_condition_number(&w))
            .filter(|c| c.is_finite()),
    };
    if args.json {
        terminal::print_json(&answer.json())?;
    } else {
        terminal::print(&answer.text())?;
    }
    terminal::note(&format!(
        "{}: one period, {}; {} shows it",
        target.path().display(),
        count(samples, "sample", "samples"),
        figure.path().display()
    ));
    Ok(())
}

/// Where the picture goes: beside the trajectory if nothing is said.
fn figure_path(args: &ExciteArgs) -> PathBuf {
    args.figure
        .clone()
        .unwrap_or_else(|| args.out.with_extension("svg"))
}

/// Samples over one period.
fn samples(args: &ExciteArgs) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "rates and periods are bounded when they are read"
    )]
    let samples = (args.rate * args.period).round() as usize;
    samples.max(1)
}

impl ExciteArgs {
    fn options(&self) -> Options {
        Options {
            harmonics: self.harmonics,
            period: self.period,
            criterion: match self.criterion {
                CriterionArg::Condition => Criterion::Condition,
                CriterionArg::LogDet => Criterion::LogDet,
            },
            random: self.random,
            starts: self.starts,
            seed: self.seed,
            ..Options::default()
        }
    }
}

/// The trajectory as a recording without forces.
fn csv(model: &Model, time: &[f64], motion: &Motion) -> String {
    let names = model.active();
    let mut text = "t".to_owned();
    for suffix in ["", "_d", "_dd"] {
        for name in &names {
            let _ = write!(text, ",{name}{suffix}");
        }
    }
    text.push('\n');
    for (i, t) in time.iter().enumerate() {
        let _ = write!(text, "{t}");
        for columns in [&motion.q, &motion.qd, &motion.qdd] {
            for column in columns {
                let _ = write!(text, ",{}", column[i]);
            }
        }
        text.push('\n');
    }
    text
}

/// Positions around their means, rates, accelerations and the nominal model's forces.
fn picture(
    model: &Model,
    plant: &ModelPlant<'_>,
    found: &Excitation,
    title: &str,
    time: &[f64],
    motion: &Motion,
) -> String {
    let names = model.active();
    let mut figure = Figure::new(title, time);
    let around: Vec<Vec<f64>> = motion
        .q
        .iter()
        .zip(&found.series)
        .map(|(q, series)| q.iter().map(|q| q - series.offset).collect())
        .collect();
    let means: Vec<String> = names
        .iter()
        .zip(&found.series)
        .map(|(name, series)| format!("{name} {}", significant(series.offset, 4)))
        .collect();
    let mut panel = |title: &str, columns: &[Vec<f64>], names: &[String]| {
        let curves: Vec<(&str, &[f64])> = names
            .iter()
            .map(String::as_str)
            .zip(columns.iter().map(Vec::as_slice))
            .collect();
        figure.panel(title, &curves);
    };
    let motions = model.motions();
    let unit = match motions.iter().filter(|(_, is_angle)| *is_angle).count() {
        0 => "m",
        angles if angles == motions.len() => "rad",
        _ => "rad or m",
    };
    let title = format!("position around the mean ({}), {unit}", means.join(", "));
    panel(&title, &around, &names);
    let per = |seconds: &str| {
        unit.replace("rad", &format!("rad/{seconds}"))
            .replace('m', &format!("m/{seconds}"))
    };
    panel(&format!("rate, {}", per("s")), &motion.qd, &names);
    panel(
        &format!("acceleration, {}", per("s^2")),
        &motion.qdd,
        &names,
    );
    if let Some(forces) = plant.forces(motion) {
        panel(
            "force of the nominal model, N or N m",
            &forces,
            &model.drives(),
        );
    }
    figure.finish()
}

/// What is printed.
struct Answer<'a> {
    model: &'a Model,
    found: &'a Excitation,
    options: &'a Options,
    told: Option<Told<'a>>,
    scaled: Option<f64>,
}

impl Answer<'_> {
    fn violations(&self) -> usize {
        let margins = self.found.margins.iter();
        margins.filter(|margin| margin.excess > 0.0).count()
    }

    fn json(&self) -> Value {
        let found = self.found;
        let names = self.model.active();
        let coefficients = names.into_iter().zip(&found.series).map(|(name, series)| {
            let one = json!({ "offset": series.offset, "mu": series.mu, "nu": series.nu });
            (name, one)
        });
        let limits = found.margins.iter().map(|margin| {
            json!({
                "name": margin.name,
                "excess": margin.excess,
                "used": Some(used(margin)).filter(|used| used.is_finite()),
                "proven": margin.proven,
            })
        });
        // The search takes the logarithm of the condition number; people do not.
        let criterion = |value: f64| match self.options.criterion {
            Criterion::Condition => value.exp(),
            Criterion::LogDet => value,
            Criterion::Separation => (-value).exp(),
        };
        json!({
            "model": self.model.name,
            "condition_number": found.condition_number,
            "start": found.start,
            "random": found.random,
            "scaled_condition_number": self.scaled,
            "criterion": match self.options.criterion {
                Criterion::Condition => "condition",
                Criterion::LogDet => "log_det",
                Criterion::Separation => "separation",
            },
            "separation": self.told.as_ref().map(Told::json),
            "value": criterion(found.value),
            "ends": found.ends.iter().map(|end| criterion(*end)).collect::<Vec<_>>(),
            "evaluations": found.evaluations,
            "violations": self.violations(),
            "limits": limits.collect::<Vec<_>>(),
            "period": self.options.period,
            "harmonics": self.options.harmonics,
            "seed": self.options.seed,
            "coefficients": Value::Object(coefficients.collect::<Map<_, _>>()),
        })
    }

    fn text(&self) -> String {
        let style = terminal::style();
        let found = self.found;
        let mut lines = vec![style.bold(&format!(
            "{}: {} of {} s",
            self.model.name,
            count(self.options.harmonics, "harmonic", "harmonics"),
            self.options.period
        ))];
        if let Some(told) = &self.told {
            lines.extend(told.text(found.evaluations, found.random));
        } else {
            lines.extend(self.conditions());
        }
        lines.push(String::new());
        lines.extend(self.limits());
        lines.join("\n")
    }

    /// What the trajectory is worth for the base parameters.
    fn conditions(&self) -> Vec<String> {
        let found = self.found;
        let mut lines = vec![format!(
            "  condition number {}, against {} of the best of {} ({} times better)",
            number(found.condition_number),
            number(found.start),
            count(
                found.random,
                "random trajectory within the limits",
                "random trajectories within the limits"
            ),
            significant(found.start / found.condition_number, 3),
        )];
        if let Some(scaled) = self.scaled {
            lines.push(format!(
                "  {} with columns of equal norm; the regressor was evaluated for {}",
                number(scaled),
                count(found.evaluations, "trajectory", "trajectories")
            ));
        }
        lines
    }

    /// How close the trajectory comes to its limits.
    fn limits(&self) -> Vec<String> {
        let found = self.found;
        let rows: Vec<Vec<String>> = found
            .margins
            .iter()
            .map(|margin| {
                vec![
                    margin.name.clone(),
                    format!("{} %", significant(100.0 * used(margin), 4)),
                    if margin.excess > 0.0 {
                        "exceeded".to_owned()
                    } else {
                        String::new()
                    },
                    if margin.proven {
                        "at all times".to_owned()
                    } else {
                        "by fine sampling".to_owned()
                    },
                ]
            })
            .collect();
        table(
            2,
            &[
                ("limit", Align::Left),
                ("used", Align::Right),
                ("", Align::Left),
                ("checked", Align::Left),
            ],
            &rows,
        )
    }
}
