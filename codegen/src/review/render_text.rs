//! A page as plain text for a terminal.

use std::fmt::Write;

use modelmill_boundary::text;

use super::document::{InlineSpan, PageBlock, PageDocument, PageEquation, PageTable, TextLine};

/// Width at which equations and paragraphs are broken.
const WIDTH: usize = 110;

/// The page as plain text.
pub(super) fn render(document: &PageDocument) -> String {
    let mut out = String::new();
    write_underlined(&mut out, &document.title, '=');
    blocks(&mut out, &document.blocks);
    out
}

/// A title with a line of `with` of the same width below.
fn write_underlined(out: &mut String, text: &str, with: char) {
    let text = text::plain(text);
    let line: String = std::iter::repeat_n(with, text.chars().count()).collect();
    _ = writeln!(out, "{text}\n{line}\n");
}

/// Blocks in order; folded ones are shown in full after their summary.
fn blocks(out: &mut String, blocks: &[PageBlock]) {
    for block in blocks {
        match block {
            PageBlock::Heading(text) => write_underlined(out, text, '-'),
            PageBlock::Paragraph(line) => {
                wrap(out, &plain_text(line), 0);
                out.push('\n');
            }
            PageBlock::Table(table) => {
                write_table(out, table);
                out.push('\n');
            }
            PageBlock::Equations(equations) => {
                out.push_str(&equation_lines(equations));
                out.push('\n');
            }
            PageBlock::Folded(summary, inner) => {
                _ = writeln!(out, "{}:\n", text::plain(summary));
                self::blocks(out, inner);
            }
        }
    }
}

/// A line without markup.
pub(super) fn plain_text(line: &TextLine) -> String {
    line.iter()
        .map(|inline| match inline {
            InlineSpan::Text(text) | InlineSpan::Code(text) | InlineSpan::Unit(text) => text::plain(text).into_owned(),
            InlineSpan::Math(formula) => formula.text(),
        })
        .collect()
}

/// Breaks a paragraph at blanks; lines after the first are indented.
fn wrap(out: &mut String, text: &str, indent: usize) {
    let mut column = 0;
    for word in text.split(' ') {
        // Width in characters, which is that of the terminal for the letters used here.
        let width = word.chars().count();
        if column > 0 && column + 1 + width > WIDTH {
            _ = write!(out, "\n{:indent$}", "");
            column = indent;
        } else if column > 0 {
            out.push(' ');
            column += 1;
        }
        out.push_str(word);
        column += width;
    }
    out.push('\n');
}

/// A table with columns as wide as their longest cell, and a rule below the head.
fn write_table(out: &mut String, table: &PageTable) {
    let rows: Vec<Vec<String>> = table
        .rows
        .iter()
        .map(|row| row.iter().map(plain_text).collect())
        .collect();
    let head: Vec<String> = table.head.iter().map(|h| (*h).to_owned()).collect();
    // An empty row marks the place of the rule.
    let rule: Vec<String> = Vec::new();
    // Width of each column, with its head.
    let widths: Vec<usize> = (0..head.len())
        .map(|i| {
            rows.iter()
                .chain([&head])
                .map(|row| row[i].chars().count())
                .max()
                .unwrap_or(0)
        })
        .collect();
    // Head, rule, then the rows.
    for row in [&head, &rule].into_iter().chain(&rows) {
        let mut line = String::new();
        // Cells are padded to the width of their column.
        for (i, width) in widths.iter().enumerate() {
            if row.is_empty() {
                line.extend(std::iter::repeat_n('-', *width));
                line.push_str("  ");
                continue;
            }
            _ = write!(line, "{:width$}  ", row[i]);
        }
        _ = writeln!(out, "  {}", line.trim_end());
    }
}

/// Equations one below the other with right-aligned tags; long ones are broken after a term.
pub(super) fn equation_lines(equations: &[PageEquation]) -> String {
    // Tags are right-aligned, so that the equations begin in one column.
    let widest = equations.iter().map(|e| e.tag.chars().count() + 2).max().unwrap_or(0);
    let mut out = String::new();
    for equation in equations {
        // The tag comes first, so that equations can be found by it.
        let tag = format!("({})", equation.tag);
        // Continued lines begin below the first term.
        let start = format!("  {tag:>widest$}  {} = ", equation.left);
        let indent = start.chars().count();
        // The unit follows the equation in brackets.
        let mut body = equation.right.text();
        if let Some(unit) = &equation.unit {
            _ = write!(body, "   [{unit}]");
        }
        // Terms are not broken: a break may stand only before a sign between blanks.
        out.push_str(&start);
        let mut column = indent;
        for (i, piece) in split_at_signs(&body).into_iter().enumerate() {
            let width = piece.chars().count();
            if i > 0 && column + width > WIDTH {
                // A long left side would leave too little room for continued lines.
                let indent = indent.min(40);
                _ = write!(out, "\n{:indent$}", "");
                column = indent;
            } else if i > 0 {
                out.push(' ');
            }
            out.push_str(piece);
            column += width + 1;
        }
        out.push('\n');
    }
    out
}

/// Splits before every sign between blanks outside parentheses, and inside them only where a piece is too long.
fn split_at_signs(text: &str) -> Vec<&str> {
    split_to_depth(text, 0)
        .into_iter()
        .flat_map(|piece| {
            // A long product of sums is broken inside its parentheses.
            if piece.len() > WIDTH - 40 {
                split_to_depth(piece, usize::MAX)
            } else {
                vec![piece]
            }
        })
        .collect()
}

/// Splits before signs that stand in at most `deepest` nested parentheses.
fn split_to_depth(text: &str, deepest: usize) -> Vec<&str> {
    let mut found = Vec::new();
    // Three bytes at a time: blank, sign, blank.
    let (mut start, mut depth) = (0, 0usize);
    for (i, triple) in text.as_bytes().windows(3).enumerate() {
        match triple[0] {
            b'(' => depth += 1,
            b')' => depth = depth.saturating_sub(1),
            b' ' if triple[2] == b' ' && matches!(triple[1], b'+' | b'-') && depth <= deepest => {
                found.push(&text[start..i]);
                start = i + 1;
            }
            _ => {}
        }
    }
    found.push(&text[start..]);
    found
}
