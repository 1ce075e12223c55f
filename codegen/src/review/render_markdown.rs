//! A page as Markdown with formulas in LaTeX between dollar signs.

use std::fmt::Write;

use modelmill_boundary::text::{code_in_markdown, html, markdown as escape};

use super::document::{InlineSpan, PageBlock, PageDocument, PageEquation, TextLine};
use super::render_latex;
use super::render_text;

/// Lists of equations beyond this length are shown as text, which a reader can scan and copy.
const MOST_DISPLAYED: usize = 24;

/// The page as Markdown.
pub(super) fn render(document: &PageDocument) -> String {
    let mut out = format!("# {}\n\n", escape(&document.title));
    blocks(&mut out, &document.blocks);
    out
}

/// Blocks in order; folded ones become `details`, which common Markdown viewers show.
fn blocks(out: &mut String, blocks: &[PageBlock]) {
    for block in blocks {
        match block {
            PageBlock::Heading(text) => _ = writeln!(out, "## {}\n", escape(text)),
            PageBlock::Paragraph(line) => _ = writeln!(out, "{}\n", inlines(line)),
            PageBlock::Table(table) => {
                _ = writeln!(out, "| {} |", table.head.join(" | "));
                _ = writeln!(out, "|{}", " --- |".repeat(table.head.len()));
                for row in &table.rows {
                    let cells: Vec<String> = row.iter().map(inlines).collect();
                    _ = writeln!(out, "| {} |", cells.join(" | "));
                }
                out.push('\n');
            }
            PageBlock::Equations(equations) => write_equations(out, equations),
            // Markdown allows HTML for this.
            PageBlock::Folded(summary, inner) => {
                _ = writeln!(out, "<details><summary>{}</summary>\n", html(summary));
                self::blocks(out, inner);
                out.push_str("</details>\n\n");
            }
        }
    }
}

/// Equations in display style, or as one block of text if they are many.
fn write_equations(out: &mut String, equations: &[PageEquation]) {
    // Many formulas are slow to display, and hard to copy.
    if equations.len() > MOST_DISPLAYED {
        _ = writeln!(out, "```text\n{}```\n", render_text::equation_lines(equations));
        return;
    }
    for equation in equations {
        _ = writeln!(
            out,
            "$$\n{}\n$$\n",
            render_latex::align_equation(equation, &format!(" \\qquad ({})", equation.tag))
        );
    }
}

/// Spans of a line with Markdown escapes. A bar inside a formula would end a table cell, so it is written as a command.
fn inlines(line: &TextLine) -> String {
    line.iter()
        .map(|inline| match inline {
            InlineSpan::Text(text) => escape(text).into_owned(),
            InlineSpan::Unit(unit) => format!("${}$", render_latex::unit(unit)),
            InlineSpan::Code(text) => code_in_markdown(text),
            InlineSpan::Math(formula) => format!("${}$", formula.latex().replace('|', "\\vert ")),
        })
        .collect()
}
