//! Common parts of all HTML pages: their head, their style, and scripts that zoom pictures, copy numbers and print
//! folded parts. A page can be read without its scripts.
//!
//! Decision: style and scripts of all pages lie here, because equations, reports and the workbench all depend on
//! this crate. A test opens every kind of page in a browser and measures it: nothing is wider than a phone, cut,
//! folded on paper, without a name, or of less contrast than WCAG requires.

use std::fmt::Write as _;

use modelmill_boundary::text::html as escape;

/// The style of all pages, light and dark, for wide and narrow screens and for paper.
pub const STYLE: &str = include_str!("page.css");

/// Scripts of all pages, to run after a page is complete. If parts of a page are inserted into another one later, call
/// `enlivenPictures(element)` and `enlivenTables(element)` on them.
pub const SCRIPTS: [&str; 3] = [
    include_str!("zoom.js"),
    include_str!("tables.js"),
    include_str!("paper.js"),
];

/// The beginning of a page, including its heading.
pub fn begin(title: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>{0}</title>\n<link rel=\"icon\" href=\"data:,\">\n<style>\n{STYLE}</style>\n</head>\n\
         <body>\n<main>\n<h1>{0}</h1>\n",
        escape(title),
    )
}

/// The end of a page, with the scripts of all pages and additional ones in `more`.
pub fn end(more: &[&str]) -> String {
    let mut text = String::from("</main>\n");
    for script in SCRIPTS.iter().chain(more) {
        _ = write!(text, "<script>\n{script}</script>\n");
    }
    text.push_str("</body>\n</html>\n");
    text
}
