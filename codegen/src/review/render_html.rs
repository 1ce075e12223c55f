//! A page as one self-contained HTML file in the style of all pages: MathML for the formulas, in segments so that lines
//! can break.
//!
//! Decision: a browser breaks no line inside a formula. So each segment up to the next sign of a sum is a formula
//! of its own, also inside parentheses, and fractions and roots that are too wide are written on the line. No math
//! font is required; the style states how deep indices hang.

use std::fmt::Write;

use modelmill_boundary::text::html as escape;
use modelmill_draw::page;

use super::document::{InlineSpan, PageBlock, PageDocument, PageEquation, TextLine};
use crate::expr::print::PrintedFormula;

/// The page as HTML. `picture` is an SVG of the mechanism.
pub(super) fn render(document: &PageDocument, picture: &str) -> String {
    // The frame of the page is the same for all pages.
    let mut out = page::begin(&document.title);
    // Links to all sections come first.
    let headings: Vec<&String> = document
        .blocks
        .iter()
        .filter_map(|block| match block {
            PageBlock::Heading(text) => Some(text),
            _ => None,
        })
        .collect();
    out.push_str("<nav>");
    for text in headings {
        _ = write!(out, "<a href=\"#{}\">{}</a> ", anchor(text), escape(text));
    }
    _ = writeln!(out, "</nav>\n<figure class=\"picture\">{picture}</figure>");
    blocks(&mut out, &document.blocks);
    out.push_str(&page::end(&[]));
    out
}

/// The anchor of a heading: letters and digits in lower case, `-` for all others.
fn anchor(text: &str) -> String {
    text.chars()
        .map(|c| {
            if c.is_ascii_alphanumeric() {
                c.to_ascii_lowercase()
            } else {
                '-'
            }
        })
        .collect()
}

/// Blocks in order; folded ones recursively.
fn blocks(out: &mut String, blocks: &[PageBlock]) {
    for block in blocks {
        match block {
            PageBlock::Heading(text) => {
                _ = writeln!(out, "<h2 id=\"{}\">{}</h2>", anchor(text), escape(text));
            }
            PageBlock::Paragraph(line) => _ = writeln!(out, "<p>{}</p>", inlines(line)),
            PageBlock::Table(table) => {
                // The wrapper scrolls if the table is wider than the page.
                out.push_str("<div class=\"wide\"><table>\n<thead><tr>");
                // Headings of the columns.
                for head in &table.head {
                    _ = write!(out, "<th scope=\"col\">{}</th>", escape(head));
                }
                out.push_str("</tr></thead>\n<tbody>\n");
                for row in &table.rows {
                    out.push_str("<tr>");
                    for cell in row {
                        _ = write!(out, "<td>{}</td>", inlines(cell));
                    }
                    out.push_str("</tr>\n");
                }
                out.push_str("</tbody>\n</table></div>\n");
            }
            // Equations are a grid: left side, right side, tag.
            PageBlock::Equations(equations) => {
                out.push_str("<div class=\"equations\">\n");
                for equation in equations {
                    write_equation(out, equation);
                }
                out.push_str("</div>\n");
            }
            PageBlock::Folded(summary, inner) => {
                _ = writeln!(out, "<details>\n<summary>{}</summary>", escape(summary));
                self::blocks(out, inner);
                out.push_str("</details>\n");
            }
        }
    }
}

/// One equation: left side, right side in segments, unit and tag.
fn write_equation(out: &mut String, equation: &PageEquation) {
    _ = write!(
        out,
        "<div class=\"equation\"><span class=\"left\">{}</span> <span class=\"right\">{}",
        math(&format!("{}<mo>=</mo>", equation.left.mathml())),
        mathml_segments(&equation.right)
    );
    // The unit stands in a span of its own.
    if let Some(text) = &equation.unit {
        _ = write!(out, " <span class=\"unit\">{}</span>", unit(text));
    }
    _ = writeln!(
        out,
        "</span><span class=\"tag\">({})</span></div>",
        escape(&equation.tag)
    );
}

/// A unit with raised exponents; `^` ends at the first character that is no digit or minus.
fn unit(text: &str) -> String {
    let mut out = String::new();
    // Whether an exponent is open.
    let mut raised = false;
    for c in text.chars() {
        // The exponent begins after the caret.
        if c == '^' {
            out.push_str("<sup>");
            raised = true;
            continue;
        }
        if raised && !(c.is_ascii_digit() || c == '-') {
            out.push_str("</sup>");
            raised = false;
        }
        match c {
            // A narrow blank that does not break.
            ' ' => out.push_str("&#x202F;"),
            c => out.push_str(&escape(c.encode_utf8(&mut [0; 4]))),
        }
    }
    if raised {
        out.push_str("</sup>");
    }
    out
}

/// Content as a formula of its own.
fn math(content: &str) -> String {
    format!("<math>{content}</math>")
}

/// Each segment of a formula is a formula of its own, so that the browser can break a long sum between them.
fn mathml_segments(formula: &PrintedFormula) -> String {
    let segments = formula.mathml_segments();
    let segments: Vec<String> = segments.iter().map(|one| math(one)).collect();
    segments.join(" ")
}

/// Spans of a line; plain numbers are prose with a minus sign, not formulas.
fn inlines(line: &TextLine) -> String {
    line.iter()
        .map(|inline| match inline {
            InlineSpan::Text(text) => escape(text).into_owned(),
            InlineSpan::Unit(text) => unit(text),
            InlineSpan::Code(text) => format!("<code>{}</code>", escape(text)),
            // U+2212 is the minus sign.
            InlineSpan::Math(PrintedFormula::Number(n)) => n.to_string().replace('-', "\u{2212}"),
            InlineSpan::Math(formula) => mathml_segments(formula),
        })
        .collect()
}
