//! Formulas as LaTeX, for amsmath.
//!
//! A [`PrintedFormula`] goes in; text for a math environment comes out.

use std::fmt::Write;

use super::formula::{FormulaFunction, PrintedFormula, digits};
use super::symbol::{FormulaSymbol, GlyphRun, typeset};
use crate::expr::Rational;

impl PrintedFormula {
    /// As LaTeX: `m_{1} d_{c1} + \frac{d_{1} m_{4} d_{c3}}{2 d_{3}}`.
    pub fn latex(&self) -> String {
        let mut out = String::new();
        write(&mut out, self, false);
        out
    }
}

impl FormulaSymbol {
    /// As LaTeX: `\dot{\theta}_{1}`.
    pub fn latex(&self) -> String {
        // The name is split into its letter or word and the parts of its index.
        let set = typeset(&self.name);
        let mut base = glyphs(&set.base);
        // A word stands upright, with the dots above it.
        if matches!(set.base, GlyphRun::Word(_)) {
            base = format!("\\mathrm{{{}}}", inner(&set.base));
        }
        // Time derivatives are dots above the letter.
        match self.order {
            0 => {}
            1 => base = format!("\\dot{{{base}}}"),
            _ => base = format!("\\ddot{{{base}}}"),
        }
        // Parts of the index are separated by commas.
        let parts: Vec<String> = set
            .index
            .iter()
            .map(|part| part.iter().map(glyphs).collect::<Vec<_>>().join(" "))
            .collect();
        if parts.is_empty() {
            base
        } else {
            format!("{base}_{{{}}}", parts.join(","))
        }
    }
}

/// The text of a glyph run in math mode, without a font command.
fn inner(glyphs: &GlyphRun) -> String {
    match glyphs {
        GlyphRun::Greek(command, _) => format!("\\{command}"),
        GlyphRun::Italic(text) | GlyphRun::Word(text) => text.clone(),
    }
}

/// A glyph run in its font: words upright, all else in math italics.
fn glyphs(one: &GlyphRun) -> String {
    match one {
        GlyphRun::Word(text) => format!("\\mathrm{{{text}}}"),
        other => inner(other),
    }
}

/// Writes a formula. With `tight`, sums and negative numbers or terms are put into parentheses.
fn write(out: &mut String, formula: &PrintedFormula, tight: bool) {
    // Only sums and signs need parentheses in a product; fractions and roots enclose themselves.
    let enclosed = tight
        && match formula {
            PrintedFormula::Sum(_) => true,
            PrintedFormula::Number(n) => n.is_negative(),
            PrintedFormula::Term { factor, .. } => factor.is_negative(),
            _ => false,
        };
    if enclosed {
        out.push_str("\\left(");
    }
    match formula {
        PrintedFormula::Number(n) => {
            if n.is_negative() {
                out.push('-');
            }
            magnitude(out, formula);
        }
        PrintedFormula::Symbol(symbol) => out.push_str(&symbol.latex()),
        PrintedFormula::Indexed(symbol, index) => {
            _ = write!(out, "{}_{{{}}}", symbol.latex(), index.latex());
        }
        PrintedFormula::Sum(terms) => {
            // Each term's sign is written here, so only its magnitude follows.
            for (i, term) in terms.iter().enumerate() {
                match (i, term.is_negative()) {
                    (0, true) => out.push('-'),
                    (0, false) => {}
                    (_, true) => out.push_str(" - "),
                    (_, false) => out.push_str(" + "),
                }
                magnitude(out, term);
            }
        }
        PrintedFormula::Term { .. } => {
            if formula.is_negative() {
                out.push('-');
            }
            magnitude(out, formula);
        }
        PrintedFormula::Power(base, n) => power(out, base, *n),
        PrintedFormula::Apply(function, operands) => apply(out, *function, None, operands),
    }
    if enclosed {
        out.push_str("\\right)");
    }
}

/// Writes a power: the exponent stands behind the name of sine, cosine and tanh, and behind the base otherwise.
fn power(out: &mut String, base: &PrintedFormula, n: u32) {
    // Where the exponent stands depends on the base.
    match base {
        PrintedFormula::Apply(f @ (FormulaFunction::Sin | FormulaFunction::Cos | FormulaFunction::Tanh), operands) => {
            apply(out, *f, Some(n), operands);
        }
        PrintedFormula::Symbol(_) | PrintedFormula::Indexed(..) => {
            write(out, base, true);
            _ = write!(out, "^{{{n}}}");
        }
        // Braces keep the exponent outside the root or the bars.
        PrintedFormula::Apply(FormulaFunction::Sqrt | FormulaFunction::Abs, _) => {
            out.push('{');
            write(out, base, true);
            _ = write!(out, "}}^{{{n}}}");
        }
        // All other bases get parentheses.
        other => {
            _ = write!(out, "\\left({}\\right)^{{{n}}}", other.latex());
        }
    }
}

/// Writes a function with its operands; an exponent stands behind the function's name.
fn apply(out: &mut String, function: FormulaFunction, exponent: Option<u32>, operands: &[PrintedFormula]) {
    // The sign of a cross product stands between its operands.
    if let (FormulaFunction::Cross, [a, b]) = (function, operands) {
        write(out, a, true);
        out.push_str(" \\times ");
        write_cross_operand(out, b);
        return;
    }
    // Operands are separated by commas.
    let arguments: Vec<String> = operands.iter().map(PrintedFormula::latex).collect();
    let arguments = arguments.join(", ");
    // Roots and absolute values enclose their operand; all others have a command before it.
    let command = match function {
        FormulaFunction::Sqrt => {
            _ = write!(out, "\\sqrt{{{arguments}}}");
            return;
        }
        FormulaFunction::Abs => {
            _ = write!(out, "\\left|{arguments}\\right|");
            return;
        }
        FormulaFunction::Sin => "\\sin",
        FormulaFunction::Cos => "\\cos",
        FormulaFunction::Tanh => "\\tanh",
        FormulaFunction::Exp => "\\exp",
        FormulaFunction::Sign => "\\operatorname{sign}",
        FormulaFunction::Atan2 => "\\operatorname{atan2}",
        FormulaFunction::Cross => "\\operatorname{cross}",
    };
    // The exponent belongs to the function's name, as in sin^2.
    out.push_str(command);
    if let Some(n) = exponent {
        _ = write!(out, "^{{{n}}}");
    }
    // A sine or cosine of one name needs no parentheses.
    match operands {
        [PrintedFormula::Symbol(_)] if matches!(function, FormulaFunction::Sin | FormulaFunction::Cos) => {
            _ = write!(out, "{{{arguments}}}");
        }
        _ => _ = write!(out, "\\left({arguments}\\right)"),
    }
}

/// Writes the second operand of a cross product, which is enclosed unless it is a name.
fn write_cross_operand(out: &mut String, operand: &PrintedFormula) {
    if matches!(operand, PrintedFormula::Symbol(_)) {
        write(out, operand, true);
    } else {
        _ = write!(out, "\\left({}\\right)", operand.latex());
    }
}

/// Writes a number or a term without its sign.
fn magnitude(out: &mut String, formula: &PrintedFormula) {
    match formula {
        // Fractions of numbers stand above each other.
        PrintedFormula::Number(n) => match digits(n) {
            (n, Some(d)) => _ = write!(out, "\\frac{{{n}}}{{{d}}}"),
            (n, None) => out.push_str(&n),
        },
        PrintedFormula::Term { factor, above, below } => {
            let (n, d) = digits(factor);
            // Without a denominator no fraction is needed.
            if d.is_none() && below.is_empty() {
                out.push_str(&product_line(&n, above, true));
            // The sign is written by the caller; numbers go into the numerator and the denominator.
            } else {
                let one = Rational::ONE.to_string();
                let d = d.unwrap_or(one);
                _ = write!(
                    out,
                    "\\frac{{{}}}{{{}}}",
                    product_line(&n, above, false),
                    product_line(&d, below, false)
                );
            }
        }
        other => write(out, other, false),
    }
}

/// A product on one line. `tight` encloses sums; on the line of a fraction a single factor needs no parentheses.
fn product_line(number: &str, factors: &[PrintedFormula], tight: bool) -> String {
    // The number 1 is written only if nothing else is on the line.
    let mut parts = Vec::new();
    if number != "1" || factors.is_empty() {
        parts.push(number.to_owned());
    }
    // A single factor on the line of a fraction needs no parentheses.
    let alone = !tight && parts.is_empty() && factors.len() == 1;
    for factor in factors {
        let mut text = String::new();
        write(&mut text, factor, !alone);
        parts.push(text);
    }
    // Thin spaces separate the factors.
    parts.join(" \\, ")
}
