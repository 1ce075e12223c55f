//! The page: words, tables and figures in the order in which they are told; one file without links to others.

use std::fmt::Write as _;

use crate::Experiment;
use modelmill::report;
use modelmill::text::svg::escape;

/// The page's text.
pub(crate) fn render(experiment: &Experiment) -> String {
    let mut page = Page(report::begin_page(
        "The paper's experiment, reproduced and explained",
    ));
    page.summary(experiment);
    page.setting(experiment);
    page.table_2(experiment);
    page.placement(experiment);
    page.peaks(experiment);
    page.base_parameters(experiment);
    page.table_1(experiment);
    page.differences(experiment);
    page.coefficients(experiment);
    page.0.push_str(&report::end_page(&[]));
    page.0
}

/// The text so far.
pub(crate) struct Page(pub(crate) String);

impl Page {
    pub(crate) fn heading(&mut self, text: &str) {
        let _ = writeln!(self.0, "<h2>{}</h2>", escape(text));
    }

    pub(crate) fn say(&mut self, text: &str) {
        let _ = writeln!(self.0, "<p>{}</p>", escape(text));
    }

    pub(crate) fn figure(&mut self, svg: &str, caption: &str) {
        let _ = writeln!(
            self.0,
            "<figure>\n{svg}<figcaption>{}</figcaption>\n</figure>",
            escape(caption)
        );
    }

    pub(crate) fn table(&mut self, head: &[&str], rows: &[Vec<String>]) {
        let class = |k: usize| match head.get(k) {
            Some(name) if name.starts_with('*') => " class=\"paper\"",
            _ => "",
        };
        self.0.push_str("<div class=\"wide\"><table>\n<thead><tr>");
        for (k, name) in head.iter().enumerate() {
            let _ = write!(
                self.0,
                "<th{}>{}</th>",
                class(k),
                escape(name.trim_start_matches('*'))
            );
        }
        self.0.push_str("</tr></thead>\n<tbody>\n");
        for row in rows {
            self.0.push_str("<tr>");
            for (k, cell) in row.iter().enumerate() {
                let _ = write!(self.0, "<td{}>{}</td>", class(k), escape(cell));
            }
            self.0.push_str("</tr>\n");
        }
        self.0.push_str("</tbody>\n</table></div>\n");
    }
}
