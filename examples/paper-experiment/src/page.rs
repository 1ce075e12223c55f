//! The page: words, tables and figures in the order in which they are told; one file without links to others.

use std::fmt::Write as _;

use crate::Experiment;
use modelmill::text::svg::escape;

/// The page's text.
pub(crate) fn render(experiment: &Experiment) -> String {
    let mut page = Page(String::new());
    page.0.push_str(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>The paper's experiment, reproduced and explained</title>\n<style>\n",
    );
    page.0.push_str(include_str!("page.css"));
    page.0.push_str("</style>\n</head>\n<body>\n<main>\n<h1>The paper's experiment, reproduced and explained</h1>\n");
    page.summary(experiment);
    page.setting(experiment);
    page.table_2(experiment);
    page.placement(experiment);
    page.peaks(experiment);
    page.base_parameters(experiment);
    page.table_1(experiment);
    page.differences(experiment);
    page.coefficients(experiment);
    page.0.push_str("</main>\n</body>\n</html>\n");
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
