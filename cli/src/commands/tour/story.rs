//! Text of the tour: paragraphs, tables and figures in the order in which they are printed.

use modelmill::Model;
use modelmill::diagnose::{DiagnosisFindings, words};
use modelmill::print::tables;
use modelmill::text::TerminalStyle;
use modelmill::text::table::{ColumnAlignment, count, percent, table};
use modelmill::text::wrap::wrap_words;

use super::{EDITED, PAPER_PAGE, PLAIN, RODS_PAGE, TourComparison, TourFolder, WITH_RODS, verdict};
use crate::terminal::plot::{TerminalCurve, bar, time_axis};

/// Width of a paragraph, letters.
const WIDTH: usize = 76;
/// Width of the longest bar, letters.
const BAR: usize = 30;
/// Rejected candidates that are listed after those that were found.
const OTHERS: usize = 5;

/// The text as it grows.
pub(super) struct TourText {
    /// All that was printed so far.
    pub(super) text: String,
    /// Colours, or none if the output is no terminal.
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

    /// A line without trailing blanks.
    fn line(&mut self, line: &str) {
        self.text.push_str(line.trim_end());
        self.text.push('\n');
    }

    /// Several lines.
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
        self.lines(&wrap_words(text, WIDTH));
        self.line("");
    }

    /// The command that does the same.
    fn command(&mut self, command: &str) {
        let line = self.style.cyan(&format!("  $ modelmill {command}"));
        self.line(&line);
        self.line("");
    }

    /// The derivation: from a model file to base parameters.
    pub(super) fn derive(&mut self, name: &str, model: &Model) {
        self.heading("1  Derive: which parameters can be identified?");
        let mechanism = &model.derivation.mechanism;
        let reduction = &model.derivation.reduction;
        self.paragraph(&format!(
            "In this planar parallel robot two cranks, each driven by a ball screw, carry a platform through two couplers. Its \
             model file has {} (two cranks and two couplers), {} and {}. The elbows and the platform are point masses. The screws \
             are the drives spindle_left and spindle_right. The angles of the cranks are theta1 and theta2; those of the couplers, \
             relative to the cranks, are gamma1 and gamma2. The lengths of crank (d1) and coupler (d3) are known; of the masses, inertias and distances of the \
             centres of mass (dc1, dc3), the file has nominal values, which are not known exactly. The forces of the screws are linear \
             in {} of these parameters, such as m1*dc1. Many of these products always act together. Measurements can determine only {} combinations of them, the \
             base parameters. modelmill finds these symbolically, in exact arithmetic:",
            count(mechanism.parts.len(), "body", "bodies"),
            count(mechanism.loops.len(), "loop", "loops"),
            count(mechanism.drives.len(), "drive", "drives"),
            count(reduction.products.len(), "product", "products"),
            model.base.len(),
        ));
        self.lines(&tables::expressions(2, model));
        self.line("");
        self.paragraph(
            "The left and the right side of the robot have the same parameters. A crank has mass m1, length d1, centre of mass at \
             distance dc1 from its base joint, and moment of inertia Ic12 about this centre. A coupler has m3, d3, dc3 (from its \
             elbow) and Ic32. Point masses: m2 at each elbow (points R2m and R4m), and half of the platform's mass m4 at the end of \
             each coupler (points R3m and R3m_right).",
        );
        self.command(&format!("equations {name}"));
    }

    /// The error of the model with nominal values, and where it is largest.
    pub(super) fn compare(&mut self, place: &TourFolder, model: &Model, seen: &TourComparison) {
        self.heading("2  Compare: where is the error large?");
        self.paragraph(&format!(
            "This step compares the forces of the model with those of a recording. The recording is not from a real machine: a third-party \
             multibody program simulated the robot with one effect that the model file lacks. With the nominal values of the parameters, \
             the error of the model is {} of the force (nrms: rms of the error divided by rms of the measured force). The upper curve is the force of one ball \
             screw, the lower curve its error. Each curve has its own scale:",
            percent(seen.compared.figures.nrms)
        ));
        // The curves of the first drive are an example; the table below lists where all errors are largest.
        let drive = model.row_names().first().cloned().unwrap_or_default();
        if let (Some(measured), Some(error)) = (seen.measured.first(), seen.errors.first()) {
            // Measured force and error have separate scales, because the error is much smaller.
            for (title, values, height) in [
                (format!("{drive}, measured, N"), measured, 5),
                (format!("{drive}, measured minus model, N"), error, 5),
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
        self.line("Where the error is largest:");
        self.lines(&tables::places(&seen.compared.error_locations));
        self.line("");
        self.paragraph("This shows where the error is large, not its cause.");
        self.command(&format!(
            "compare {} --data {}",
            place.name("spidermill.toml"),
            place.name(super::file_name(WITH_RODS.check.0))
        ));
    }

    /// The missing effect, and the best rejected candidates. `seen` has the error with nominal parameters.
    pub(super) fn diagnose(&mut self, place: &TourFolder, seen: &TourComparison, findings: &DiagnosisFindings) {
        self.heading("3  Diagnose: which effect is missing?");
        let all = &findings.diagnosis.candidates;
        self.paragraph(&format!(
            "modelmill tries every effect of its library (`modelmill effects` lists them) at every place of this mechanism: \
             friction of many kinds, springs, force offsets, inertia of drive rods and others. It also tries errors that are not \
             in the library: wrong lengths, and faults of signals, such as a drift, a wrong gain or a wrong zero of an encoder. \
             These are {} in all. modelmill fits sets of candidates, together with the base parameters, to one recording. An \
             effect is accepted only if it also reduces the error on a second recording, which is not fitted (the validation \
             run). Step 2 used this validation run: with nominal parameters, the error was {}. With estimated base parameters, it \
             is {} before any effect is added.",
            count(all.len(), "candidate", "candidates"),
            percent(seen.compared.figures.nrms),
            percent(findings.diagnosis.steps.first().map(|step| step.check))
        ));
        self.paragraph(&verdict(findings));
        // Effects that were found come first, then the best of the rejected ones.
        let shown = all.iter().filter(|c| c.rejection_reason.is_none());
        let others = all.iter().filter(|c| c.rejection_reason.is_some()).take(OTHERS);
        let has_findings = findings.diagnosis.steps.len() > 1;
        let rows: Vec<Vec<String>> = shown
            .chain(others)
            .map(|c| {
                vec![
                    words::effect(&c.effect),
                    percent(Some(c.explained)),
                    c.rejection_reason
                        .map_or("found", |why| words::refusal(why, has_findings))
                        .to_owned(),
                ]
            })
            .collect();
        let columns = [
            ("candidate", ColumnAlignment::Left),
            ("explained alone", ColumnAlignment::Right),
            ("result", ColumnAlignment::Left),
        ];
        self.line(
            "The candidates that explain most of the squared error if added alone, and the result of the search:",
        );
        self.lines(&table(2, &columns, &rows));
        self.line("");
        // Each effect is described in the words of its kind, with the effects that explain the data equally well.
        for found in &findings.diagnosis.effects {
            let kinds = &findings.before.model.loaded.kinds;
            if let Some(kind) = kinds.iter().find(|k| k.name == found.effect.kind) {
                self.paragraph(&format!("{}: {}", words::effect(&found.effect), kind.says));
            }
            if !found.indistinguishable_from.is_empty() {
                self.paragraph(&format!(
                    "With this recording it is not distinguishable from {}.",
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

    /// The change of the model file.
    pub(super) fn add(&mut self, place: &TourFolder, edited: Option<&(Vec<String>, String)>) {
        self.heading("4  Add: write the effect into the model file");
        let Some((commands, difference)) = edited else {
            self.paragraph("No effect was found, so nothing is added.");
            return;
        };
        self.paragraph(&format!(
            "A few lines in the model file describe the effect. They give the estimates of its parameters as nominal values. Jr \
             and Sr are the moment of inertia and the first moment of mass of a rod about its pivot. One pair of values holds \
             for both screws, because the effect names both drives. Comments and layout of the file do not change. The tour writes the result to {}, as the command below does:",
            place.name(EDITED)
        ));
        let lines: Vec<String> = difference.lines().map(|line| format!("  {line}")).collect();
        self.lines(&lines);
        self.line("");
        // The commands that write the same lines.
        for command in commands {
            let line = self.style.cyan(&format!("  $ {command}"));
            self.line(&line);
        }
        self.line("");
    }

    /// Errors after each step, and the identified parameters.
    pub(super) fn steps(&mut self, findings: &DiagnosisFindings) {
        self.heading("5  Identify again: the error falls");
        self.bars(findings);
        if let Some(after) = findings.after.version()
            && let Some(result) = &after.identified
        {
            self.line("Base parameters of the completed model, identified from the first recording:");
            self.lines(&tables::expressions(2, &after.model));
            self.line("");
            self.lines(&tables::parameters(&result.fit.parameters));
            self.line("");
        }
        self.paragraph(
            "The simulation contained this effect: each screw is a uniform rod (mass 8 kg, length 0.9 m) that rotates about its \
             base pivot. About this pivot its moment of inertia is 8 * 0.9^2 / 3 = 2.16 kg m^2, and its first moment of mass is \
             8 * 0.9 / 2 = 3.6 kg m. The estimates of Jr and Sr agree with these values.",
        );
    }

    /// Errors on the validation run as logarithmic bars, down to the noise floor.
    fn bars(&mut self, findings: &DiagnosisFindings) {
        let is_fitted = findings.before.identified.is_some();
        let (steps, noise) = (&findings.diagnosis.steps, findings.diagnosis.noise_floor);
        let channels = findings.channels();
        let largest = steps.iter().map(|step| step.check).fold(noise, f64::max);
        // The axis includes the noise floor, if it is above zero.
        let least = steps.iter().map(|step| step.check);
        let least = least.chain([noise]).filter(|e| *e > 0.0);
        // The axis begins below the smallest error, so that its bar has a length.
        let least = least.fold(f64::INFINITY, f64::min) / 3.0;
        // Length of a bar on the logarithmic axis, between 0 and 1.
        let share = |error: f64| {
            if error > 0.0 && largest > least {
                (error / least).ln() / (largest / least).ln()
            } else {
                0.0
            }
        };
        let name = words::floor_label(noise).to_owned();
        let named = steps
            .iter()
            .map(|step| (words::step_text(step, &findings.diagnosis, channels), step.check));
        for (name, error) in named.chain([(name, noise)]) {
            let bar = bar(share(error), 1.0, BAR);
            // Green: within 30 % of the noise floor, so nothing is left to explain.
            let bar = if error > noise * 1.3 {
                self.style.red(&bar)
            } else {
                self.style.green(&bar)
            };
            let lines = wrap_words(&name, 34);
            for (k, line) in lines.iter().enumerate() {
                // Only the last line of a long name has the figure and the bar.
                if k + 1 < lines.len() {
                    self.line(&format!("  {line}"));
                } else {
                    self.line(&format!("  {line:<35}{:>11}  {bar}", percent(Some(error))));
                }
            }
        }
        self.line("");
        self.paragraph(&format!(
            "Error on the validation run, relative to the force (nrms), on a logarithmic scale. The last line is the error \
             that {} alone causes, computed from both recordings; no model has clearly less.{}",
            words::floor_label(noise),
            if is_fitted {
                " Base parameters are estimated in all lines, also for the given model."
            } else {
                ""
            }
        ));
    }

    /// The diagnosis of the model as published.
    pub(super) fn paper(&mut self, place: &TourFolder, findings: &DiagnosisFindings) {
        self.heading("6  Diagnose a published model");
        self.paragraph(
            "In the paper on this robot, the forces of the model differ from those of a simulation. modelmill finds a cause that the paper \
             does not name. Each coupler carries half of the platform's mass m4 as a point mass, but the equations of the paper use two different \
             points for it. In the balance of forces it is at the end of the coupler (R3m or R3m_right). In the balance of moments it is at the \
             coupler's centre of mass. The page docs/experiment.html in the repository of modelmill examines this cause, and also those that the paper suggests. The \
             recordings are other simulations of this robot, with massless screws. As in step 2, the base parameters are \
             not identified but keep their nominal values (option `--held`):",
        );
        self.paragraph(&verdict(findings));
        let diagnosis = &findings.diagnosis;
        self.bars(findings);
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

    /// The files of the pages, and the command for a mechanism of the user.
    pub(super) fn pages(&mut self, place: &TourFolder) {
        self.heading("7  Open the reports");
        self.paragraph(
            "Two pages contain all results: curves that can be zoomed, error maps, all candidates, parameters and equations. They \
             need no network. Open them in a browser:",
        );
        for page in [RODS_PAGE, PAPER_PAGE] {
            self.line(&format!("  {}", place.name(page)));
        }
        self.line("");
        self.paragraph("For your own mechanism:");
        self.command("report MODEL --data RUN --check OTHER_RUN --out DIR");
    }
}
