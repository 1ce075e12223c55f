//! Formulas as presentation MathML, readable by any browser without scripts.
//!
//! A [`PrintedFormula`] goes in. The content of one `math` element comes out, or of several between which lines may
//! end.

use std::fmt::Write;

use modelmill_boundary::text::html as escape;

use super::formula::{FormulaFunction, PrintedFormula, digits};
use super::symbol::{FormulaSymbol, GlyphRun, typeset};

impl PrintedFormula {
    /// As the content of a `math` element.
    pub fn mathml(&self) -> String {
        let mut out = MathmlWriter::default();
        write(&mut out, self, false);
        format!("<mrow>{}</mrow>", out.text)
    }

    /// As the contents of consecutive `math` elements. A line may end between them: before each sign of a sum, also of
    /// sums in parentheses. A long fraction or root, which cannot be split otherwise, is written on the line.
    pub fn mathml_segments(&self) -> Vec<String> {
        let mut out = MathmlWriter {
            may_part: true,
            ..MathmlWriter::default()
        };
        write(&mut out, self, false);
        out.end_segment();
        let segments = out.done.into_iter();
        segments.map(|segment| format!("<mrow>{segment}</mrow>")).collect()
    }
}

/// Letters of text above which a fraction or a root is written on the line, where lines may end.
const LONG: usize = 32;

/// MathML that is being written, in segments between which a line may end.
#[derive(Default)]
struct MathmlWriter {
    /// Complete segments.
    done: Vec<String>,
    /// The current segment.
    text: String,
    /// Whether a line may end here.
    may_part: bool,
}

impl MathmlWriter {
    /// Appends to the current segment.
    fn push_str(&mut self, text: &str) {
        self.text.push_str(text);
    }

    /// Ends the current segment, if lines may end here.
    fn end_segment(&mut self) {
        if self.may_part && !self.text.is_empty() {
            self.done.push(std::mem::take(&mut self.text));
        }
    }

    /// Writes a part in which no line may end.
    fn write_unbroken(&mut self, write: impl FnOnce(&mut Self)) {
        // The permission to end lines is restored afterwards.
        let may_part = std::mem::replace(&mut self.may_part, false);
        write(self);
        self.may_part = may_part;
    }

    /// Whether a formula is written on the line because it would be too wide in one piece.
    fn is_too_wide(&self, formula: &PrintedFormula) -> bool {
        self.may_part && formula.text().chars().count() > LONG
    }
}

impl Write for MathmlWriter {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.text.push_str(text);
        Ok(())
    }
}

/// Invisible multiplication sign with a space before the next factor.
const TIMES: &str = "<mo lspace=\"0\" rspace=\"0.12em\">&#x2062;</mo>";

impl FormulaSymbol {
    /// As a MathML element.
    pub fn mathml(&self) -> String {
        self.mathml_power(None)
    }

    /// As a MathML element with an exponent above the index.
    fn mathml_power(&self, exponent: Option<u32>) -> String {
        let set = typeset(&self.name);
        let mut base = glyphs(&set.base);
        // As accents the dots would touch letters without ascenders.
        if let Some(dots) = match self.order {
            0 => None,
            1 => Some("&#x2D9;"),
            _ => Some("&#xA8;"),
        } {
            base = format!("<mover>{base}<mo scriptlevel=\"0\">{dots}</mo></mover>");
        }
        // Without an index the exponent belongs to the letter.
        if set.index.is_empty() {
            return match exponent {
                Some(n) => format!("<msup>{base}<mn>{n}</mn></msup>"),
                None => base,
            };
        }
        // Parts of the index are separated by commas.
        let parts: Vec<String> = set
            .index
            .iter()
            .map(|part| part.iter().map(glyphs).collect::<String>())
            .collect();
        let index = parts.join("<mo lspace=\"0\" rspace=\"0\">,</mo>");
        // With an index, the exponent stands above it.
        match exponent {
            Some(n) => format!("<msubsup>{base}<mrow>{index}</mrow><mn>{n}</mn></msubsup>"),
            None => format!("<msub>{base}<mrow>{index}</mrow></msub>"),
        }
    }
}

/// A glyph run as a MathML element: digits as a number, letters as identifiers.
fn glyphs(one: &GlyphRun) -> String {
    match one {
        GlyphRun::Greek(_, letter) => format!("<mi>{letter}</mi>"),
        GlyphRun::Italic(text) if text.bytes().all(|b| b.is_ascii_digit()) => {
            format!("<mn>{text}</mn>")
        }
        GlyphRun::Italic(text) if text.chars().count() == 1 => format!("<mi>{}</mi>", escape(text)),
        // MathML draws identifiers of several letters upright.
        GlyphRun::Italic(text) | GlyphRun::Word(text) => format!("<mi>{}</mi>", escape(text)),
    }
}

/// Writes a body between two fences, such as parentheses.
fn write_fenced(out: &mut MathmlWriter, open: &str, close: &str, body: impl FnOnce(&mut MathmlWriter)) {
    write_fenced_power(out, open, close, None, body);
}

/// Writes a body between two fences, with an exponent behind the closing one.
fn write_fenced_power(
    out: &mut MathmlWriter,
    open: &str,
    close: &str,
    exponent: Option<u32>,
    body: impl FnOnce(&mut MathmlWriter),
) {
    if out.may_part {
        // Both parentheses may get into different segments, so they must not stretch.
        _ = write!(out, "<mo form=\"prefix\" stretchy=\"false\">{open}</mo>");
        body(out);
        let close = format!("<mo form=\"postfix\" stretchy=\"false\">{close}</mo>");
        match exponent {
            Some(n) => _ = write!(out, "<msup>{close}<mn>{n}</mn></msup>"),
            None => out.push_str(&close),
        }
        return;
    }
    // In one piece the exponent applies to the complete parenthesis.
    if exponent.is_some() {
        out.push_str("<msup>");
    }
    _ = write!(out, "<mrow><mo>{open}</mo>");
    body(out);
    _ = write!(out, "<mo>{close}</mo></mrow>");
    if let Some(n) = exponent {
        _ = write!(out, "<mn>{n}</mn></msup>");
    }
}

/// Writes a formula. With `tight`, sums and negative numbers or terms are put into parentheses.
fn write(out: &mut MathmlWriter, formula: &PrintedFormula, tight: bool) {
    // Only sums and signs need parentheses in a product.
    let enclosed = tight
        && match formula {
            PrintedFormula::Sum(_) => true,
            PrintedFormula::Number(n) => n.is_negative(),
            PrintedFormula::Term { factor, .. } => factor.is_negative(),
            _ => false,
        };
    if enclosed {
        write_fenced(out, "(", ")", |out| write(out, formula, false));
        return;
    }
    match formula {
        PrintedFormula::Symbol(symbol) => out.push_str(&symbol.mathml()),
        PrintedFormula::Indexed(symbol, index) => {
            _ = write!(out, "<msub>{}{}</msub>", symbol.mathml(), index.mathml());
        }
        PrintedFormula::Sum(terms) => {
            for (i, term) in terms.iter().enumerate() {
                // A line may end before every sign but the first.
                if i > 0 {
                    out.end_segment();
                }
                // The sign at the beginning of a line keeps its distance from the term.
                let sides = match i {
                    0 => " form=\"prefix\"",
                    _ if out.may_part => " form=\"infix\" lspace=\"0\" rspace=\"0.22em\"",
                    _ => "",
                };
                // Each term's sign is written here, so only its magnitude follows.
                match (i, term.is_negative()) {
                    (_, true) => _ = write!(out, "<mo{sides}>&#x2212;</mo>"),
                    (0, false) => {}
                    (_, false) => _ = write!(out, "<mo{sides}>+</mo>"),
                }
                magnitude(out, term);
            }
        }
        PrintedFormula::Number(_) | PrintedFormula::Term { .. } => {
            if formula.is_negative() {
                out.push_str("<mo form=\"prefix\">&#x2212;</mo>");
            }
            magnitude(out, formula);
        }
        PrintedFormula::Power(base, n) => power(out, base, *n),
        PrintedFormula::Apply(function, operands) => apply(out, *function, None, operands),
    }
}

/// Writes a power: the exponent stands behind the name of sine, cosine and tanh, and behind the base otherwise.
fn power(out: &mut MathmlWriter, base: &PrintedFormula, n: u32) {
    match base {
        PrintedFormula::Apply(f @ (FormulaFunction::Sin | FormulaFunction::Cos | FormulaFunction::Tanh), operands) => {
            apply(out, *f, Some(n), operands);
        }
        PrintedFormula::Symbol(symbol) => out.push_str(&symbol.mathml_power(Some(n))),
        // Indices and bars stay in one piece with their exponent.
        PrintedFormula::Indexed(..) | PrintedFormula::Apply(FormulaFunction::Abs, _) => out.write_unbroken(|out| {
            out.push_str("<msup><mrow>");
            write(out, base, true);
            _ = write!(out, "</mrow><mn>{n}</mn></msup>");
        }),
        other => write_fenced_power(out, "(", ")", Some(n), |out| write(out, other, false)),
    }
}

/// Writes a function with its operands; an exponent stands behind the function's name.
fn apply(out: &mut MathmlWriter, function: FormulaFunction, exponent: Option<u32>, operands: &[PrintedFormula]) {
    // Operands are separated by commas.
    let arguments = |out: &mut MathmlWriter| {
        for (i, operand) in operands.iter().enumerate() {
            if i > 0 {
                out.push_str("<mo>,</mo>");
            }
            write(out, operand, false);
        }
    };
    match function {
        // A wide root is written as a root sign before parentheses, in which a line may end.
        FormulaFunction::Sqrt if operands.iter().any(|one| out.is_too_wide(one)) => {
            out.push_str("<mo form=\"prefix\" stretchy=\"false\">&#x221A;</mo>");
            write_fenced(out, "(", ")", arguments);
            return;
        }
        FormulaFunction::Sqrt => {
            out.write_unbroken(|out| {
                out.push_str("<msqrt><mrow>");
                arguments(out);
                out.push_str("</mrow></msqrt>");
            });
            return;
        }
        // Bars enclose the operand of an absolute value.
        FormulaFunction::Abs => {
            write_fenced(out, "|", "|", arguments);
            return;
        }
        // The sign of a cross product stands between its operands; the second one is enclosed unless it is a name.
        FormulaFunction::Cross => {
            if let [a, b] = operands {
                write(out, a, true);
                out.push_str("<mo form=\"infix\">&#xD7;</mo>");
                if matches!(b, PrintedFormula::Symbol(_)) {
                    write(out, b, true);
                } else {
                    write_fenced(out, "(", ")", |out| write(out, b, false));
                }
            }
            return;
        }
        _ => {}
    }
    let name = format!("<mi>{}</mi>", function.name());
    // The exponent belongs to the function's name, as in sin^2.
    match exponent {
        Some(n) => _ = write!(out, "<msup>{name}<mn>{n}</mn></msup>"),
        None => out.push_str(&name),
    }
    // A sine or cosine of one name needs no parentheses.
    match operands {
        [PrintedFormula::Symbol(_)] if matches!(function, FormulaFunction::Sin | FormulaFunction::Cos) => {
            out.push_str("<mo lspace=\"0\" rspace=\"0.17em\">&#x2061;</mo>");
            arguments(out);
        }
        _ => {
            out.push_str("<mo>&#x2061;</mo>");
            write_fenced(out, "(", ")", arguments);
        }
    }
}

/// Writes a number or a term without its sign, as a fraction where it has a denominator.
fn magnitude(out: &mut MathmlWriter, formula: &PrintedFormula) {
    match formula {
        // Fractions of numbers stand above each other.
        PrintedFormula::Number(n) => match digits(n) {
            (n, Some(d)) => _ = write!(out, "<mfrac><mn>{n}</mn><mn>{d}</mn></mfrac>"),
            (n, None) => _ = write!(out, "<mn>{n}</mn>"),
        },
        PrintedFormula::Term { factor, above, below } => {
            let (n, d) = digits(factor);
            // Without a denominator no fraction is needed.
            if d.is_none() && below.is_empty() {
                write_product_line(out, &n, above, true);
            } else if out.is_too_wide(formula) {
                // A wide fraction is written on the line with a slash.
                write_product_line(out, &n, above, true);
                out.end_segment();
                out.push_str("<mo form=\"infix\" stretchy=\"false\">/</mo>");
                let d = d.as_deref().unwrap_or("1");
                // Several factors below the line need parentheses.
                let is_one = below.len() + usize::from(d != "1") == 1;
                if is_one {
                    write_product_line(out, d, below, true);
                } else {
                    write_fenced(out, "(", ")", |out| write_product_line(out, d, below, true));
                }
            } else {
                // A narrow fraction has a line between numerator and denominator.
                out.write_unbroken(|out| {
                    out.push_str("<mfrac><mrow>");
                    write_product_line(out, &n, above, false);
                    out.push_str("</mrow><mrow>");
                    write_product_line(out, d.as_deref().unwrap_or("1"), below, false);
                    out.push_str("</mrow></mfrac>");
                });
            }
        }
        other => write(out, other, false),
    }
}

/// A product on one line. `tight` encloses sums; on the line of a fraction a single factor needs no parentheses.
fn write_product_line(out: &mut MathmlWriter, number: &str, factors: &[PrintedFormula], tight: bool) {
    // The number 1 is written only if nothing else is on the line.
    let with_number = number != "1" || factors.is_empty();
    if with_number {
        _ = write!(out, "<mn>{number}</mn>");
    }
    // A single factor on the line of a fraction needs no parentheses.
    let alone = !tight && !with_number && factors.len() == 1;
    for (i, factor) in factors.iter().enumerate() {
        if i > 0 || with_number {
            out.push_str(TIMES);
        }
        write(out, factor, !alone);
    }
}
