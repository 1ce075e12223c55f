//! A page as a LaTeX article that needs amsmath and longtable alone.

use std::fmt::Write;

use modelmill_boundary::text::latex as escape;

use super::document::{Block, Document, Equation, Inline, Line, Table, terms};
use crate::expr::print::Formula;

/// Length of the plain text of a line of an equation, beyond which it is broken.
const LINE: usize = 75;

pub(super) fn render(document: &Document) -> String {
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

fn blocks(out: &mut String, blocks: &[Block]) {
    for block in blocks {
        match block {
            Block::Heading(text) => _ = writeln!(out, "\\section*{{{}}}\n", escape(text)),
            Block::Paragraph(line) => _ = writeln!(out, "{}\n", inlines(line)),
            Block::Table(table) => write_table(out, table),
            Block::Equations(equations) => {
                for equation in equations {
                    let tag = format!(" \\tag{{{}}}", equation.tag);
                    _ = writeln!(out, "\\[\n{}\n\\]", aligned(equation, &tag));
                }
                out.push('\n');
            }
            Block::Folded(summary, inner) => {
                _ = writeln!(out, "\\paragraph{{{}.}}\\mbox{{}}\n", escape(summary));
                self::blocks(out, inner);
            }
        }
    }
}

fn write_table(out: &mut String, table: &Table) {
    // The last column of a wide table holds prose and may break.
    let n = table.head.len();
    let wide = table.rows.iter().any(|row| {
        row.last()
            .is_some_and(|cell| super::render_text::plain(cell).len() > 40)
    });
    let mut columns = "l".repeat(n);
    if wide {
        columns.truncate(n - 1);
        columns.push_str("p{75mm}");
    }
    _ = writeln!(out, "\\begin{{longtable}}{{{columns}}}");
    let head: Vec<String> = table.head.iter().map(|h| escape(h).into_owned()).collect();
    _ = writeln!(out, "{} \\\\ \\hline\n\\endhead", head.join(" & "));
    for row in &table.rows {
        let cells: Vec<String> = row.iter().map(inlines).collect();
        _ = writeln!(out, "{} \\\\", cells.join(" & "));
    }
    out.push_str("\\end{longtable}\n\n");
}

/// An equation in display style, long sums broken; `end` stands after its last line.
pub(super) fn aligned(equation: &Equation, end: &str) -> String {
    let unit = equation
        .unit
        .as_ref()
        .map_or_else(String::new, |text| format!(" \\quad [{}]", unit(text)));
    let lines = broken(&equation.right);
    let left = equation.left.latex();
    if let [line] = lines.as_slice() {
        return format!("{left} = {line}{unit}{end}");
    }
    format!(
        "\\begin{{aligned}}\n{left} &= {}{unit}\n\\end{{aligned}}{end}",
        lines.join(" \\\\\n&\\quad ")
    )
}

/// The lines of a sum.
fn broken(formula: &Formula) -> Vec<String> {
    let mut lines: Vec<(usize, Vec<Formula>)> = Vec::new();
    for term in terms(formula) {
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
            let leading = if i > 0 && !line[0].is_negative() {
                "+ "
            } else {
                ""
            };
            // The first term stays first whatever its sign.
            let sum = if line.len() == 1 {
                line[0].latex()
            } else {
                Formula::Sum(line).latex()
            };
            format!("{leading}{sum}")
        })
        .collect()
}

/// A unit in upright letters.
pub(super) fn unit(text: &str) -> String {
    format!("\\mathrm{{{}}}", text.replace(' ', "\\,"))
}

fn inlines(line: &Line) -> String {
    line.iter()
        .map(|inline| match inline {
            Inline::Text(text) => escape(text).into_owned(),
            Inline::Unit(text) => format!("${}$", unit(text)),
            Inline::Code(text) => format!("\\texttt{{{}}}", escape(text)),
            Inline::Math(formula) => format!("${}$", formula.latex()),
        })
        .collect()
}
