//! A page before it takes a notation: headings, paragraphs, tables and equations, in order.

use crate::expr::print::{FormulaSymbol, PrintedFormula};

/// A stretch of a line.
#[derive(Clone, Debug)]
pub(super) enum InlineSpan {
    Text(String),
    Code(String),
    Math(PrintedFormula),
    /// A unit such as `kg m^2`.
    Unit(String),
}

/// A line of text.
pub(super) type TextLine = Vec<InlineSpan>;

/// `left = right`, with a tag in parentheses and perhaps a unit.
#[derive(Clone, Debug)]
pub(super) struct PageEquation {
    pub(super) left: PrintedFormula,
    pub(super) right: PrintedFormula,
    pub(super) tag: String,
    pub(super) unit: Option<String>,
}

/// A table; every row has as many cells as the head.
#[derive(Clone, Debug)]
pub(super) struct PageTable {
    pub(super) head: Vec<&'static str>,
    pub(super) rows: Vec<Vec<TextLine>>,
}

/// A part of a page.
#[derive(Clone, Debug)]
pub(super) enum PageBlock {
    Heading(String),
    Paragraph(TextLine),
    Table(PageTable),
    Equations(Vec<PageEquation>),
    /// Long matter that a reader may skip.
    Folded(String, Vec<PageBlock>),
}

/// A page.
#[derive(Clone, Debug)]
pub(super) struct PageDocument {
    pub(super) title: String,
    pub(super) blocks: Vec<PageBlock>,
}

/// Tables and lists of equations that are longer are folded away.
const LONG: usize = 24;

impl PageDocument {
    pub(super) fn heading(&mut self, text: &str) {
        self.blocks.push(PageBlock::Heading(text.to_owned()));
    }

    pub(super) fn paragraph(&mut self, line: impl IntoIterator<Item = InlineSpan>) {
        self.blocks
            .push(PageBlock::Paragraph(line.into_iter().collect()));
    }

    /// A table, folded if it is long; nothing if it has no rows.
    pub(super) fn table(&mut self, what: &str, table: PageTable) {
        match table.rows.len() {
            0 => {}
            n if n > LONG => {
                let summary = format!("{n} {what}");
                self.blocks
                    .push(PageBlock::Folded(summary, vec![PageBlock::Table(table)]));
            }
            _ => self.blocks.push(PageBlock::Table(table)),
        }
    }

    /// Equations, folded if they are many.
    pub(super) fn equations(&mut self, what: &str, equations: Vec<PageEquation>) {
        match equations.len() {
            0 => {}
            n if n > LONG => {
                let summary = format!("{n} {what}");
                self.blocks.push(PageBlock::Folded(
                    summary,
                    vec![PageBlock::Equations(equations)],
                ));
            }
            _ => self.blocks.push(PageBlock::Equations(equations)),
        }
    }
}

pub(super) fn text(text: impl Into<String>) -> InlineSpan {
    InlineSpan::Text(text.into())
}

pub(super) fn code(text: impl Into<String>) -> InlineSpan {
    InlineSpan::Code(text.into())
}

pub(super) fn name(name: &str) -> InlineSpan {
    InlineSpan::Math(PrintedFormula::Symbol(FormulaSymbol::new(name)))
}

pub(super) fn unit(unit: impl Into<String>) -> InlineSpan {
    InlineSpan::Unit(unit.into())
}

/// `tau = H(q, q', q'') p`
pub(super) fn linear_model(matrix: &str, parameters: &str) -> Vec<InlineSpan> {
    let motion = |order| {
        InlineSpan::Math(PrintedFormula::Symbol(FormulaSymbol::time_derivative(
            "q", order,
        )))
    };
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
pub(super) fn cell(inline: InlineSpan) -> TextLine {
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
pub(super) fn line_terms(formula: &PrintedFormula) -> Vec<PrintedFormula> {
    match formula {
        PrintedFormula::Sum(terms) => terms.clone(),
        other => vec![other.clone()],
    }
}
