//! The words of the tour: paragraphs, tables and figures in the order in which they are told.

use modelmill::Model;
use modelmill::diagnose::{DiagnosisFindings, SelectionStep, words};
use modelmill::print::tables;
use modelmill::text::TerminalStyle;
use modelmill::text::table::{ColumnAlignment, count, percent, table};

use super::{EDITED, PAPER_PAGE, PLAIN, RODS_PAGE, TourComparison, TourFolder, WITH_RODS, verdict};
use crate::terminal::plot::{TerminalCurve, bar, time_axis};

/// Width of a paragraph.
const WIDTH: usize = 76;
/// Width of the longest bar.
const BAR: usize = 30;
/// Candidates that are named beside those that were found.
const OTHERS: usize = 5;

/// The text as it grows.
pub(super) struct TourText {
    pub(super) text: String,
    style: TerminalStyle,
}

impl TourText {
    /// An empty story.
    pub(super) fn new(style: TerminalStyle) -> Self {
        Self {
            text: String::new(),
            style,
        }
    }

    fn line(&mut self, line: &str) {
        self.text.push_str(line.trim_end());
        self.text.push('\n');
    }

    fn lines(&mut self, lines: &[String]) {
        for line in lines {
            self.line(line);
        }
    }

    /// A heading between blank lines.
    fn heading(&mut self, text: &str) {
        let heading = self.style.bold(text);
        self.line("");
        self.line(&heading);
        self.line("");
    }

    /// A paragraph, wrapped.
    fn paragraph(&mut self, text: &str) {
        self.lines(&words::lines(text, WIDTH));
        self.line("");
    }

    /// The command that does the same.
    fn command(&mut self, command: &str) {
        let line = self.style.cyan(&format!("  $ modelmill {command}"));
        self.line(&line);
        self.line("");
    }

    /// What the mill makes of the model file.
    pub(super) fn derive(&mut self, name: &str, model: &Model) {
        self.heading("1  Derive: from a model file to what can be known");
        let mechanism = &model.derivation.mechanism;
        let reduction = &model.derivation.reduction;
        self.paragraph(&format!(
            "A parallel robot carries a platform on two cranks, each pushed by a ball screw. Its model file has {}, {} and {}. \
             The forces of the screws are linear in {} of masses, lengths and inertias, but many say the same thing. These {} are \
             all that any measurement can tell, found exactly and in symbols:",
            count(mechanism.parts.len(), "body", "bodies"),
            count(mechanism.loops.len(), "loop", "loops"),
            count(mechanism.drives.len(), "drive", "drives"),
            count(reduction.products.len(), "product", "products"),
            model.base.len(),
        ));
        self.lines(&tables::expressions(2, model));
        self.line("");
        self.command(&format!("equations {name}"));
    }

    /// How far the model is off, and where.
    pub(super) fn compare(&mut self, place: &TourFolder, model: &Model, seen: &TourComparison) {
        self.heading("2  Compare: where does the model fail?");
        self.paragraph(&format!(
            "Another house's multibody code simulated the whole robot, eleven groups of bodies, and something besides that the \
             model file does not know of. Held against that recording, with the masses of the drawings, the model misses the \
             forces by {}. First the force of one screw, then what the model misses:",
            percent(seen.compared.figures.nrms)
        ));
        let drive = model.drives().first().cloned().unwrap_or_default();
        if let (Some(measured), Some(error)) = (seen.measured.first(), seen.errors.first()) {
            for (title, values, height) in [
                (format!("{drive}, measured, N"), measured, 5),
                (format!("{drive}, measured less model, N"), error, 5),
            ] {
                let title = self.style.dim(&title);
                self.line(&format!("{:>9}  {title}", ""));
                let curve = TerminalCurve {
                    values,
                    height,
                    limit: None,
                };
                self.lines(&curve.lines());
            }
            self.line(&time_axis(&seen.time));
            self.line("");
        }
        self.line("Where the error lives:");
        self.lines(&tables::places(&seen.compared.places));
        self.line("");
        self.paragraph("True, but it does not say what is missing. This is as far as other tools go; the thinking is left to you.");
        self.command(&format!(
            "compare {} --data {}",
            place.name("spidermill.toml"),
            place.name(super::file_name(WITH_RODS.check.0))
        ));
    }

    /// What is missing, and what else was tried.
    pub(super) fn diagnose(&mut self, place: &TourFolder, findings: &DiagnosisFindings) {
        self.heading("3  Diagnose: what is missing?");
        let all = &findings.diagnosis.candidates;
        self.paragraph(&format!(
            "modelmill writes down every effect of its library at every place of this mechanism, {} in all: friction of many \
             kinds, springs, inertias, offsets, delays, rods. It fits them beside the model on one run, and believes only what \
             also lowers the error on another, which it did not fit.",
            count(all.len(), "candidate", "candidates")
        ));
        self.paragraph(&verdict(findings));
        let shown = all.iter().filter(|c| c.rejection_reason.is_none());
        let others = all
            .iter()
            .filter(|c| c.rejection_reason.is_some())
            .take(OTHERS);
        let rows: Vec<Vec<String>> = shown
            .chain(others)
            .map(|c| {
                vec![
                    words::effect(&c.effect),
                    format!("{:.0} %", 100.0 * c.explained),
                    c.rejection_reason
                        .clone()
                        .unwrap_or_else(|| "found".to_owned()),
                ]
            })
            .collect();
        let columns = [
            ("candidate", ColumnAlignment::Left),
            ("explains alone", ColumnAlignment::Right),
            ("verdict", ColumnAlignment::Left),
        ];
        self.lines(&table(2, &columns, &rows));
        self.line("");
        for found in &findings.diagnosis.effects {
            let kinds = &findings.before.model.loaded.kinds;
            if let Some(kind) = kinds.iter().find(|k| k.name == found.effect.kind) {
                self.paragraph(&format!("{}: {}", words::effect(&found.effect), kind.says));
            }
            if !found.indistinguishable_from.is_empty() {
                self.paragraph(&format!(
                    "This recording cannot tell it from {}.",
                    words::effects(&found.indistinguishable_from)
                ));
            }
        }
        self.command(&format!(
            "diagnose {} {}",
            place.name("spidermill.toml"),
            place.recordings(&WITH_RODS)
        ));
    }

    /// What changes in the model file.
    pub(super) fn add(&mut self, place: &TourFolder, edited: Option<&(Vec<String>, String)>) {
        self.heading("4  Add: the model file learns it");
        let Some((commands, difference)) = edited else {
            self.paragraph("Nothing was found that could be added.");
            return;
        };
        self.paragraph(&format!(
            "An effect is some lines of the model file, with the estimates for nominal values. Comments and layout stay. Here \
             the result is written to {}:",
            place.name(EDITED)
        ));
        let lines: Vec<String> = difference.lines().map(|line| format!("  {line}")).collect();
        self.lines(&lines);
        self.line("");
        for command in commands {
            let line = self.style.cyan(&format!("  $ {command}"));
            self.line(&line);
        }
        self.line("");
    }

    /// Errors step by step, and the parameters in the end.
    pub(super) fn ladder(&mut self, findings: &DiagnosisFindings) {
        self.heading("5  Identify again, and watch the error fall");
        let diagnosis = &findings.diagnosis;
        self.bars(&diagnosis.steps, diagnosis.noise_floor);
        if let Ok(after) = &findings.after
            && let Some(result) = &after.identified
        {
            self.line("The parameters of the completed model, from the data alone:");
            self.lines(&tables::expressions(2, &after.model));
            self.line("");
            self.lines(&tables::parameters(&result.fit.parameters));
            self.line("");
        }
        self.paragraph(
            "What was hidden: each screw is a rod of 8 kg and 0.9 m that swings about its base. Its moment of inertia is \
             8 * 0.9^2 / 3 = 2.16 kg m^2, its first moment 8 * 0.9 / 2 = 3.6 kg m. Compare with Jr and Sr above.",
        );
    }

    /// Errors on the check as bars over decades, down to the noise.
    fn bars(&mut self, ladder: &[SelectionStep], noise: f64) {
        let largest = ladder.iter().map(|rung| rung.check).fold(noise, f64::max);
        let least = ladder.iter().map(|rung| rung.check);
        let least = least.chain([noise]).filter(|e| *e > 0.0);
        let least = least.fold(f64::INFINITY, f64::min) / 3.0;
        let share = |error: f64| {
            if error > 0.0 && largest > least {
                (error / least).ln() / (largest / least).ln()
            } else {
                0.0
            }
        };
        let name = "the noise in the forces".to_owned();
        let rungs = ladder.iter().map(|rung| (words::rung(rung), rung.check));
        for (name, error) in rungs.chain([(name, noise)]) {
            let bar = bar(share(error), 1.0, BAR);
            let bar = if error > noise * 1.3 {
                self.style.red(&bar)
            } else {
                self.style.green(&bar)
            };
            let lines = words::lines(&name, 34);
            for (k, line) in lines.iter().enumerate() {
                if k + 1 < lines.len() {
                    self.line(&format!("  {line}"));
                } else {
                    self.line(&format!("  {line:<35}{:>11}  {bar}", percent(Some(error))));
                }
            }
        }
        self.line("");
        self.paragraph(
            "Error relative to the force on the check run, which was not fitted; bars are decades.",
        );
    }

    /// The treatment of the paper.
    pub(super) fn paper(&mut self, place: &TourFolder, findings: &DiagnosisFindings) {
        self.heading("6  The same question to a published model");
        self.paragraph(
            "The paper that describes this robot lets the platform's mass m4 act at the joint in the balance of forces, and at \
             the middle of the coupler in the balance of moments. Its parameters come from drawings, and its authors saw an \
             error that they could not name. On a simulation of the robot exactly as the paper has it, with all parameters held:",
        );
        self.paragraph(&verdict(findings));
        let diagnosis = &findings.diagnosis;
        self.bars(&diagnosis.steps, diagnosis.noise_floor);
        for found in &diagnosis.effects {
            let kinds = &findings.before.model.loaded.kinds;
            if let Some(kind) = kinds.iter().find(|k| k.name == found.effect.kind) {
                self.paragraph(&format!("{}: {}", words::effect(&found.effect), kind.says));
            }
        }
        self.command(&format!(
            "diagnose {} {} --held",
            place.name("spidermill-paper.toml"),
            place.recordings(&PLAIN)
        ));
    }

    /// Where to look on.
    pub(super) fn pages(&mut self, place: &TourFolder) {
        self.heading("7  The pages");
        self.paragraph(
            "All of this, with curves that can be zoomed, error maps, every candidate, parameters and equations, is on two pages \
             that need no network. Open them in a browser:",
        );
        for page in [RODS_PAGE, PAPER_PAGE] {
            self.line(&format!("  {}", place.name(page)));
        }
        self.line("");
        self.paragraph("For a mechanism of yours:");
        self.command("report MODEL --data RUN --check OTHER_RUN --out DIR");
    }
}
