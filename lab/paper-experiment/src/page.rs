//! The page: text, tables and figures in their order, as one file without links to other files.

use std::fmt::Write as _;

use crate::PaperExperiment;
use modelmill::report;
use modelmill::text::svg::escape;

/// The HTML of the page.
pub(crate) fn render(experiment: &PaperExperiment) -> String {
    let mut page = ExperimentPage(report::begin_page("The paper's experiment, reproduced and explained"));
    page.summary(experiment);
    page.method(experiment);
    page.table_2(experiment);
    page.placement(experiment);
    page.causes(experiment);
    page.peaks(experiment);
    page.base_parameters(experiment);
    page.table_1(experiment);
    page.differences(experiment);
    page.conditions(experiment);
    page.replica(experiment);
    page.statements();
    page.coefficients(experiment);
    page.0.push_str(&report::end_page(&[]));
    page.0
}

/// A text as HTML. What stands between two backticks is code.
fn with_code(text: &str) -> String {
    let mut html = String::new();
    for (k, part) in text.split('`').enumerate() {
        let part = escape(part);
        if k % 2 == 1 {
            let _ = write!(html, "<code>{part}</code>");
        } else {
            html.push_str(&part);
        }
    }
    html
}

/// The HTML written so far.
pub(crate) struct ExperimentPage(pub(crate) String);

impl ExperimentPage {
    /// Appends a heading of a chapter.
    pub(crate) fn heading(&mut self, text: &str) {
        let _ = writeln!(self.0, "<h2>{}</h2>", escape(text));
    }

    /// Appends a paragraph.
    pub(crate) fn paragraph(&mut self, text: &str) {
        let _ = writeln!(self.0, "<p>{}</p>", with_code(text));
    }

    /// Appends a figure with its caption.
    pub(crate) fn figure(&mut self, svg: &str, caption: &str) {
        let _ = writeln!(
            self.0,
            "<figure>\n{svg}<figcaption>{}</figcaption>\n</figure>",
            escape(caption)
        );
    }

    /// Appends a table. Columns whose heading starts with `*` have the paper's own numbers.
    pub(crate) fn table(&mut self, head: &[&str], rows: &[Vec<String>]) {
        let is_number = |cell: &String| cell.starts_with(|c: char| c.is_ascii_digit() || c == '-');
        let class = |k: usize, cell: Option<&String>| {
            let mut classes = Vec::new();
            if head.get(k).is_some_and(|name| name.starts_with('*')) {
                classes.push("paper");
            }
            if k > 0 && cell.is_some_and(is_number) {
                classes.push("number");
            }
            match classes.as_slice() {
                [] => String::new(),
                classes => format!(" class=\"{}\"", classes.join(" ")),
            }
        };
        // The first row decides whether a column has numbers.
        let first = |k: usize| rows.first().and_then(|row| row.get(k));
        self.0.push_str("<div class=\"wide\"><table>\n<thead><tr>");
        for (k, name) in head.iter().enumerate() {
            let _ = write!(
                self.0,
                "<th scope=\"col\"{}>{}</th>",
                class(k, first(k)),
                escape(name.trim_start_matches('*'))
            );
        }
        self.0.push_str("</tr></thead>\n<tbody>\n");
        for row in rows {
            self.0.push_str("<tr>");
            for (k, cell) in row.iter().enumerate() {
                let _ = write!(self.0, "<td{}>{}</td>", class(k, Some(cell)), with_code(cell));
            }
            self.0.push_str("</tr>\n");
        }
        self.0.push_str("</tbody>\n</table></div>\n");
    }
}
