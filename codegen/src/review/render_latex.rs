//! A page as a LaTeX article that needs amsmath and longtable alone.

use std::fmt::Write;

use modelmill_boundary::text::latex as escape;

use super::document::{InlineSpan, PageBlock, PageDocument, PageEquation, PageTable, TextLine, line_terms};
use crate::expr::print::PrintedFormula;

/// Length of the plain text of a line of an equation, beyond which it is broken.
const LINE: usize = 75;

/// The page as a LaTeX document.
pub(super) fn render(document: &PageDocument) -> String {
    // The preamble needs only common packages.
    let mut out = String::from(
        "\\documentclass[a4paper,10pt]{article}\n\
         \\usepackage[utf8]{inputenc}\n\
         \\usepackage[T1]{fontenc}\n\
         \\usepackage{amsmath}\n\
         \\usepackage{longtable}\n\
         \\usepackage[margin=20mm]{geometry}\n\
         \\allowdisplaybreaks\n\
         \\setlength{\\parindent}{0pt}\n\
         \\setlength{\\parskip}{4pt}\n\
         \\begin{document}\n",
    );
    _ = writeln!(
        out,
        "\\begin{{center}}\\Large {}\\end{{center}}\n",
        escape(&document.title)
    );
    blocks(&mut out, &document.blocks);
    out.push_str("\\end{document}\n");
    out
}

/// Blocks in order; a folded one becomes a paragraph with a title, because paper cannot fold.
fn blocks(out: &mut String, blocks: &[PageBlock]) {
    for block in blocks {
        match block {
            PageBlock::Heading(text) => _ = writeln!(out, "\\section*{{{}}}\n", escape(text)),
            PageBlock::Paragraph(line) => _ = writeln!(out, "{}\n", inlines(line)),
            PageBlock::Table(table) => write_table(out, table),
            PageBlock::Equations(equations) => {
                for equation in equations {
                    // The tag is that of the page, not a number of LaTeX.
                    let tag = format!(" \\tag{{{}}}", equation.tag);
                    _ = writeln!(out, "\\[\n{}\n\\]", align_equation(equation, &tag));
                }
                out.push('\n');
            }
            PageBlock::Folded(summary, inner) => {
                _ = writeln!(out, "\\paragraph{{{}.}}\\mbox{{}}\n", escape(summary));
                self::blocks(out, inner);
            }
        }
    }
}

/// A table that may break across pages, with its head repeated.
fn write_table(out: &mut String, table: &PageTable) {
    // The last column of a wide table has prose and may break.
    let n = table.head.len();
    let wide = table.rows.iter().any(|row| {
        row.last()
            .is_some_and(|cell| super::render_text::plain_text(cell).len() > 40)
    });
    let mut columns = "l".repeat(n);
    // A column of fixed width, in which lines are broken.
    if wide {
        columns.truncate(n - 1);
        columns.push_str("p{75mm}");
    }
    _ = writeln!(out, "\\begin{{longtable}}{{{columns}}}");
    // The head is repeated on every page.
    let head: Vec<String> = table.head.iter().map(|h| escape(h).into_owned()).collect();
    _ = writeln!(out, "{} \\\\ \\hline\n\\endhead", head.join(" & "));
    for row in &table.rows {
        let cells: Vec<String> = row.iter().map(inlines).collect();
        _ = writeln!(out, "{} \\\\", cells.join(" & "));
    }
    out.push_str("\\end{longtable}\n\n");
}

/// An equation in display style, long sums in several lines; `end` follows its last line.
pub(super) fn align_equation(equation: &PageEquation, end: &str) -> String {
    // The unit follows the equation in brackets.
    let unit = equation
        .unit
        .as_ref()
        .map_or_else(String::new, |text| format!(" \\quad [{}]", unit(text)));
    // A sum of one line needs no alignment.
    let lines = break_sum(&equation.right);
    let left = equation.left.latex();
    if let [line] = lines.as_slice() {
        return format!("{left} = {line}{unit}{end}");
    }
    format!(
        "\\begin{{aligned}}\n{left} &= {}{unit}\n\\end{{aligned}}{end}",
        lines.join(" \\\\\n&\\quad ")
    )
}

/// The terms of a sum in LaTeX, grouped into lines of similar length.
fn break_sum(formula: &PrintedFormula) -> Vec<String> {
    let mut lines: Vec<(usize, Vec<PrintedFormula>)> = Vec::new();
    for term in line_terms(formula) {
        // The width of the plain text is a good estimate of that of the formula.
        let width = term.text().len() + 3;
        match lines.last_mut() {
            Some((used, line)) if *used + width <= LINE => {
                *used += width;
                line.push(term);
            }
            _ => lines.push((width, vec![term])),
        }
    }
    lines
        .into_iter()
        .enumerate()
        .map(|(i, (_, line))| {
            // A continued line begins with the sign of its first term.
            let leading = if i > 0 && !line[0].is_negative() { "+ " } else { "" };
            // The first term stays first even if it is negative.
            let sum = if line.len() == 1 {
                line[0].latex()
            } else {
                PrintedFormula::Sum(line).latex()
            };
            format!("{leading}{sum}")
        })
        .collect()
}

/// A unit in upright letters.
pub(super) fn unit(text: &str) -> String {
    format!("\\mathrm{{{}}}", text.replace(' ', "\\,"))
}

/// Spans of a line with LaTeX escapes.
fn inlines(line: &TextLine) -> String {
    line.iter()
        .map(|inline| match inline {
            InlineSpan::Text(text) => escape(text).into_owned(),
            InlineSpan::Unit(text) => format!("${}$", unit(text)),
            InlineSpan::Code(text) => format!("\\texttt{{{}}}", escape(text)),
            InlineSpan::Math(formula) => format!("${}$", formula.latex()),
        })
        .collect()
}
