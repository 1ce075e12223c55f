//! The atlas as one page: a table of all mechanisms, then each with its picture and base parameters.

use std::fmt::Write as _;

use modelmill_draw::page as pages;

use super::page::end;
use super::tables::{TableCell, table};
use super::units::typographic_unit;
use crate::atlas::{ABOUT, AtlasEntry};
use crate::model::Model;
use crate::text::svg::escape;
use crate::text::table::significant;

/// A mechanism of the page: its counts in the atlas, its model, and its picture as SVG.
pub struct AtlasMechanism {
    /// Counts of the mechanism.
    pub entry: AtlasEntry,
    /// The model.
    pub model: Model,
    /// The picture as SVG for a page.
    pub picture: String,
}

/// The page as HTML.
pub fn atlas(mechanisms: &[AtlasMechanism]) -> String {
    let mut page = pages::begin("Atlas of mechanisms");
    // The explanation comes first, then the table, then one section for each mechanism.
    for paragraph in ABOUT {
        let _ = writeln!(page, "<p>{}</p>", emphasis_html(paragraph));
    }
    page.push_str(&counts(mechanisms));
    for one in mechanisms {
        page.push_str(&mechanism(one));
    }
    page.push_str(&end());
    page
}

/// HTML of a text in which `*x*` is emphasised and `` `x` `` is code.
fn emphasis_html(text: &str) -> String {
    let mut html = String::new();
    // Code is replaced after emphasis, in the result of the first pass.
    for (mark, tag) in [('*', "em"), ('`', "code")] {
        let source = if html.is_empty() {
            escape(text)
        } else {
            std::mem::take(&mut html)
        };
        for (k, piece) in source.split(mark).enumerate() {
            let _ = match k % 2 {
                0 => write!(html, "{piece}"),
                _ => write!(html, "<{tag}>{piece}</{tag}>"),
            };
        }
    }
    html
}

/// The table of all mechanisms: numbers of joints, loops, drives and base parameters, operations, and seconds
/// of the derivation.
fn counts(mechanisms: &[AtlasMechanism]) -> String {
    // Numbers are sorted by value.
    let whole = |n: usize| TableCell::number(&n.to_string(), n as f64);
    let rows: Vec<Vec<TableCell>> = mechanisms
        .iter()
        .map(|AtlasMechanism { entry, .. }| {
            let name = escape(&entry.name);
            // Additions and multiplications are added up, so that columns can be sorted.
            let operations = |k: usize| entry.operations[k].add + entry.operations[k].mul;
            vec![
                TableCell::html(format!("<a href=\"#{name}\">{name}</a>")),
                TableCell::text(&entry.joints_in_letters()),
                whole(entry.passive),
                whole(entry.loops),
                whole(entry.drives),
                whole(entry.base[0]),
                whole(entry.base[1]),
                whole(entry.at_values),
                match entry.effects {
                    [0, _] => TableCell::text(""),
                    [_, base] => whole(base),
                },
                whole(operations(0)),
                whole(operations(1)),
                match entry.seconds {
                    Some(seconds) => TableCell::number(&significant(seconds, 2), seconds),
                    None => TableCell::text(""),
                },
            ]
        })
        .collect();
    let head = [
        "mechanism",
        "joints",
        "#passive",
        "#loops",
        "#drives",
        "#general",
        "#weightless",
        "#at values",
        "#with effects",
        "#regressor",
        "#inverse dynamics",
        "#s",
    ];
    table("sortable", &head, &rows)
}

/// The section of one mechanism: title, picture and base parameters.
fn mechanism(one: &AtlasMechanism) -> String {
    let AtlasMechanism { entry, picture, .. } = one;
    // Imported mechanisms have no table of expressions.
    let expressions = if entry.is_imported {
        String::new()
    } else {
        expressions(&one.model)
    };
    format!(
        "<section id=\"{name}\">\n<h2>{name}</h2>\n<p>{}. {}.</p>\n<figure class=\"picture\">{picture}</figure>\n\
         {expressions}</section>\n",
        escape(&entry.title),
        escape(&entry.summary_text()),
        name = escape(&entry.name),
    )
}

/// Base parameters with expressions, nominal values and units, folded.
fn expressions(model: &Model) -> String {
    let rows: Vec<Vec<TableCell>> = (model.base.iter().zip(&model.values).enumerate())
        .map(|(k, (base, value))| {
            let value = if model.has_values(k) {
                TableCell::number(&significant(*value, 6), *value)
            } else {
                TableCell::text("")
            };
            vec![
                TableCell::html(format!("<code>{}</code>", escape(&base.name))),
                TableCell::html(format!("<code>{}</code>", escape(&base.expression))),
                value,
                TableCell::text(&typographic_unit(&base.unit)),
            ]
        })
        .collect();
    format!(
        "<details><summary>Base parameters</summary>\n{}</details>\n",
        table("", &["p_min", "expression", "#value", "unit"], &rows),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_become_type() {
        assert_eq!(
            emphasis_html("columns of `H` at *values* of p < q"),
            "columns of <code>H</code> at <em>values</em> of p &lt; q"
        );
    }
}
