//! The words of the tour: paragraphs, tables and figures in the order in which they are told.

use modelmill_identify::Figures;

use super::Chapter;
use crate::along;
use crate::failure::Outcome;
use crate::model::Model;
use crate::plot::{Curve, bar, time_axis};
use crate::show;
use crate::table::{Align, count, percent, table};
use crate::terminal::Style;

/// The text as it grows.
pub(super) struct Story {
    pub(super) text: String,
    style: Style,
}

impl Story {
    /// An empty story.
    pub(super) fn new(style: Style) -> Self {
        Self {
            text: String::new(),
            style,
        }
    }

    /// A line as it is.
    pub(super) fn line(&mut self, line: &str) {
        self.text.push_str(line.trim_end());
        self.text.push('\n');
    }

    fn lines(&mut self, lines: &[String]) {
        for line in lines {
            self.line(line);
        }
    }

    /// A heading between blank lines.
    pub(super) fn heading(&mut self, text: &str) {
        let heading = self.style.bold(text);
        self.line("");
        self.line(&heading);
        self.line("");
    }

    /// A paragraph, wrapped.
    pub(super) fn say(&mut self, text: &str) {
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
    pub(super) fn mill(&mut self, consistent: &Model, paper: &Model) {
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

    /// Identified values beside nominal ones, and the errors of both.
    pub(super) fn parameters(&mut self, chapter: &Chapter<'_>) {
        let title = self.style.cyan(&chapter.title());
        self.line(&format!("  {title}: {}", chapter.runs.about));
        self.lines(&show::parameters(&chapter.result.fit.parameters));
        let error = |figures: Option<&Figures>, name: &str| -> Vec<String> {
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
    pub(super) fn forces(&mut self, chapter: &Chapter<'_>) -> Outcome {
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
    pub(super) fn regions(&mut self, chapter: &Chapter<'_>) -> Outcome {
        let measured = [along::measured(&chapter.check)?];
        let forces = [along::forces(
            chapter.model,
            &chapter.check,
            &chapter.result.values(),
        )?];
        let places = along::places(
            chapter.model,
            std::slice::from_ref(&chapter.check),
            &measured,
            &forces,
        )?;
        self.line("Where what is left lives, on the check:");
        self.lines(&show::places(&places));
        self.line("");
        Ok(())
    }

    /// All errors on the checks as bars.
    pub(super) fn overview(&mut self, chapters: &[Chapter<'_>]) {
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
