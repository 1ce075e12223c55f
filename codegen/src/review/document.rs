//! A page before it takes a notation: headings, paragraphs, tables and equations, in order.

use crate::expr::print::{FormulaSymbol, PrintedFormula};

/// A part of a line in one notation.
#[derive(Clone, Debug)]
pub(super) enum InlineSpan {
    /// Prose, escaped by the printers.
    Text(String),
    /// A name from the model file, in a fixed-width font.
    Code(String),
    /// A formula, printed in the notation of the format.
    Math(PrintedFormula),
    /// A unit such as `kg m^2`.
    Unit(String),
}

/// A line of text, as spans in order.
pub(super) type TextLine = Vec<InlineSpan>;

/// `left = right`, with a tag in parentheses and perhaps a unit.
#[derive(Clone, Debug)]
pub(super) struct PageEquation {
    /// The formula left of the equals sign: a symbol or 0.
    pub(super) left: PrintedFormula,
    /// The formula right of the equals sign.
    pub(super) right: PrintedFormula,
    /// Tag without parentheses, such as `16.3`; unique on the page.
    pub(super) tag: String,
    /// Unit of both sides, where one is shown.
    pub(super) unit: Option<String>,
}

/// A table; every row has as many cells as the head.
#[derive(Clone, Debug)]
pub(super) struct PageTable {
    /// Headings of the columns; an empty text is a column without heading.
    pub(super) head: Vec<&'static str>,
    /// Cells by row and column.
    pub(super) rows: Vec<Vec<TextLine>>,
}

/// A block of a page: the printers handle one kind after the other.
#[derive(Clone, Debug)]
pub(super) enum PageBlock {
    /// Title of a section; its text also makes the anchor in HTML.
    Heading(String),
    /// Prose.
    Paragraph(TextLine),
    /// A table, shown in full.
    Table(PageTable),
    /// Equations, one below the other.
    Equations(Vec<PageEquation>),
    /// A summary line and blocks that open on demand, for long tables and listings.
    Folded(String, Vec<PageBlock>),
}

/// A page, independent of its notation.
#[derive(Clone, Debug)]
pub(super) struct PageDocument {
    /// Title of the model, or its name if it has none.
    pub(super) title: String,
    /// Sections in order, each opened by a heading.
    pub(super) blocks: Vec<PageBlock>,
}

/// More rows or equations than this are folded.
const LONG: usize = 24;

impl PageDocument {
    /// Opens a section.
    pub(super) fn heading(&mut self, text: &str) {
        self.blocks.push(PageBlock::Heading(text.to_owned()));
    }

    /// Adds a paragraph of spans.
    pub(super) fn paragraph(&mut self, line: impl IntoIterator<Item = InlineSpan>) {
        self.blocks.push(PageBlock::Paragraph(line.into_iter().collect()));
    }

    /// Adds a table. A long one is folded under its count and the noun `what`; one without rows is left out.
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

    /// Adds equations. Many are folded under their count and the noun `what`; an empty list is left out.
    pub(super) fn equations(&mut self, what: &str, equations: Vec<PageEquation>) {
        match equations.len() {
            0 => {}
            n if n > LONG => {
                let summary = format!("{n} {what}");
                self.blocks
                    .push(PageBlock::Folded(summary, vec![PageBlock::Equations(equations)]));
            }
            _ => self.blocks.push(PageBlock::Equations(equations)),
        }
    }
}

/// A span of prose.
pub(super) fn text(text: impl Into<String>) -> InlineSpan {
    InlineSpan::Text(text.into())
}

/// A span for a name from the model file.
pub(super) fn code(text: impl Into<String>) -> InlineSpan {
    InlineSpan::Code(text.into())
}

/// A symbol by its name; an underscore begins an index.
pub(super) fn name(name: &str) -> InlineSpan {
    InlineSpan::Math(PrintedFormula::Symbol(FormulaSymbol::new(name)))
}

/// A unit in the notation of the model file, such as `kg m^2`.
pub(super) fn unit(unit: impl Into<String>) -> InlineSpan {
    InlineSpan::Unit(unit.into())
}

/// The spans of `tau = H(q, q', q'') p` with the given names of matrix and parameters.
pub(super) fn linear_model(matrix: &str, parameters: &str) -> Vec<InlineSpan> {
    // q and its derivatives.
    let motion = |order| InlineSpan::Math(PrintedFormula::Symbol(FormulaSymbol::time_derivative("q", order)));
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

/// A cell of one span.
pub(super) fn cell(inline: InlineSpan) -> TextLine {
    vec![inline]
}

/// A number in the shortest text that reads back as the same number, with an exponent outside 1e-4 to 1e7.
pub(super) fn number(value: f64) -> String {
    // Very small and very large numbers have an exponent.
    let magnitude = value.abs();
    if value != 0.0 && !(1e-4..1e7).contains(&magnitude) {
        format!("{value:e}")
    } else {
        format!("{value}")
    }
}

/// The parts of an equation's right side between which a line may be broken: the terms of a sum.
pub(super) fn line_terms(formula: &PrintedFormula) -> Vec<PrintedFormula> {
    match formula {
        PrintedFormula::Sum(terms) => terms.clone(),
        other => vec![other.clone()],
    }
}
