//! The atlas as one page: a table of all mechanisms, then each with its picture and base parameters.

use std::fmt::Write as _;

use modelmill_draw::page as pages;

use super::page::end;
use super::tables::{Cell, table};
use super::units::pretty;
use crate::atlas::{ABOUT, Entry};
use crate::model::Model;
use crate::text::svg::escape;
use crate::text::table::significant;

/// A mechanism of the page: its counts in the atlas, its model, and its picture as SVG.
pub struct Pictured {
    /// Counts.
    pub entry: Entry,
    /// The model.
    pub model: Model,
    /// SVG that can stand in a page.
    pub picture: String,
}

/// The page's text.
pub fn atlas(mechanisms: &[Pictured]) -> String {
    let mut page = pages::begin("Atlas of mechanisms");
    for paragraph in ABOUT {
        let _ = writeln!(page, "<p>{}</p>", emphasized(paragraph));
    }
    page.push_str(&counts(mechanisms));
    for one in mechanisms {
        page.push_str(&mechanism(one));
    }
    page.push_str(&end());
    page
}

/// HTML of a text in which `*x*` is emphasised and `` `x` `` is code.
fn emphasized(text: &str) -> String {
    let mut html = String::new();
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

/// The table of all mechanisms: numbers of joints, loops, drives and base parameters, operations, and seconds of the derivation.
fn counts(mechanisms: &[Pictured]) -> String {
    let whole = |n: usize| Cell::number(&n.to_string(), n as f64);
    let rows: Vec<Vec<Cell>> = mechanisms
        .iter()
        .map(|Pictured { entry, .. }| {
            let name = escape(&entry.name);
            let operations = |k: usize| entry.operations[k].add + entry.operations[k].mul;
            vec![
                Cell::html(format!("<a href=\"#{name}\">{name}</a>")),
                Cell::text(&entry.joints_in_letters()),
                whole(entry.passive),
                whole(entry.loops),
                whole(entry.drives),
                whole(entry.base[0]),
                whole(entry.base[1]),
                whole(entry.at_values),
                match entry.effects {
                    [0, _] => Cell::text(""),
                    [_, base] => whole(base),
                },
                whole(operations(0)),
                whole(operations(1)),
                match entry.seconds {
                    Some(seconds) => Cell::number(&significant(seconds, 2), seconds),
                    None => Cell::text(""),
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
fn mechanism(one: &Pictured) -> String {
    let Pictured { entry, picture, .. } = one;
    let expressions = if entry.is_imported {
        String::new()
    } else {
        expressions(&one.model)
    };
    format!(
        "<section id=\"{name}\">\n<h2>{name}</h2>\n<p>{}. {}.</p>\n<figure class=\"picture\">{picture}</figure>\n\
         {expressions}</section>\n",
        escape(&entry.title),
        escape(&entry.in_words()),
        name = escape(&entry.name),
    )
}

/// Base parameters with expressions, nominal values and units, folded.
fn expressions(model: &Model) -> String {
    let rows: Vec<Vec<Cell>> = (model.base.iter().zip(&model.nominal).enumerate())
        .map(|(k, (base, value))| {
            let value = if model.has_nominal(k) {
                Cell::number(&significant(*value, 6), *value)
            } else {
                Cell::text("")
            };
            vec![
                Cell::html(format!("<code>{}</code>", escape(&base.name))),
                Cell::html(format!("<code>{}</code>", escape(&base.expression))),
                value,
                Cell::text(&pretty(&base.unit)),
            ]
        })
        .collect();
    format!(
        "<details><summary>Base parameters, eq. (16)</summary>\n{}</details>\n",
        table("", &["p_min", "expression", "#value", "unit"], &rows),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_become_type() {
        assert_eq!(
            emphasized("columns of `H` at *values* of p < q"),
            "columns of <code>H</code> at <em>values</em> of p &lt; q"
        );
    }
}
