//! A page before it takes a notation: headings, paragraphs, tables and equations, in order.

use crate::expr::print::{Formula, Symbol};

/// A stretch of a line.
#[derive(Clone, Debug)]
pub(super) enum Inline {
    Text(String),
    Code(String),
    Math(Formula),
    /// A unit such as `kg m^2`.
    Unit(String),
}

/// A line of text.
pub(super) type Line = Vec<Inline>;

/// `left = right`, with a tag in parentheses and perhaps a unit.
#[derive(Clone, Debug)]
pub(super) struct Equation {
    pub(super) left: Formula,
    pub(super) right: Formula,
    pub(super) tag: String,
    pub(super) unit: Option<String>,
}

/// A table; every row has as many cells as the head.
#[derive(Clone, Debug)]
pub(super) struct Table {
    pub(super) head: Vec<&'static str>,
    pub(super) rows: Vec<Vec<Line>>,
}

/// A part of a page.
#[derive(Clone, Debug)]
pub(super) enum Block {
    Heading(String),
    Paragraph(Line),
    Table(Table),
    Equations(Vec<Equation>),
    /// Long matter that a reader may skip.
    Folded(String, Vec<Block>),
}

/// A page.
#[derive(Clone, Debug)]
pub(super) struct Document {
    pub(super) title: String,
    pub(super) blocks: Vec<Block>,
}

/// Tables and lists of equations that are longer are folded away.
const LONG: usize = 24;

impl Document {
    pub(super) fn heading(&mut self, text: &str) {
        self.blocks.push(Block::Heading(text.to_owned()));
    }

    pub(super) fn paragraph(&mut self, line: impl IntoIterator<Item = Inline>) {
        self.blocks
            .push(Block::Paragraph(line.into_iter().collect()));
    }

    /// A table, folded if it is long; nothing if it has no rows.
    pub(super) fn table(&mut self, what: &str, table: Table) {
        match table.rows.len() {
            0 => {}
            n if n > LONG => {
                let summary = format!("{n} {what}");
                self.blocks
                    .push(Block::Folded(summary, vec![Block::Table(table)]));
            }
            _ => self.blocks.push(Block::Table(table)),
        }
    }

    /// Equations, folded if they are many.
    pub(super) fn equations(&mut self, what: &str, equations: Vec<Equation>) {
        match equations.len() {
            0 => {}
            n if n > LONG => {
                let summary = format!("{n} {what}");
                self.blocks
                    .push(Block::Folded(summary, vec![Block::Equations(equations)]));
            }
            _ => self.blocks.push(Block::Equations(equations)),
        }
    }
}

pub(super) fn text(text: impl Into<String>) -> Inline {
    Inline::Text(text.into())
}

pub(super) fn code(text: impl Into<String>) -> Inline {
    Inline::Code(text.into())
}

pub(super) fn name(name: &str) -> Inline {
    Inline::Math(Formula::Symbol(Symbol::new(name)))
}

pub(super) fn unit(unit: impl Into<String>) -> Inline {
    Inline::Unit(unit.into())
}

/// `tau = H(q, q', q'') p`
pub(super) fn linear_model(matrix: &str, parameters: &str) -> Vec<Inline> {
    let motion = |order| Inline::Math(Formula::Symbol(Symbol::derived("q", order)));
    vec![
        name("tau"),
        text(" = "),
        name(matrix),
        text("("),
        motion(0),
        text(", "),
        motion(1),
        text(", "),
        motion(2),
        text(") "),
        name(parameters),
    ]
}

/// A cell of one stretch.
pub(super) fn cell(inline: Inline) -> Line {
    vec![inline]
}

/// A number as Rust prints it, the shortest text that reads back as the same number.
pub(super) fn number(value: f64) -> String {
    let magnitude = value.abs();
    if value != 0.0 && !(1e-4..1e7).contains(&magnitude) {
        format!("{value:e}")
    } else {
        format!("{value}")
    }
}

/// The stretches of an equation's right side that may stand on lines of their own: sign and magnitude of each term.
pub(super) fn terms(formula: &Formula) -> Vec<Formula> {
    match formula {
        Formula::Sum(terms) => terms.clone(),
        other => vec![other.clone()],
    }
}
