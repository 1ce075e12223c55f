//! Formulas as LaTeX, for amsmath.

use std::fmt::Write;

use super::formula::{Formula, Function, digits};
use super::symbol::{Glyphs, Symbol, typeset};
use crate::expr::Rational;

impl Formula {
    /// As LaTeX: `m_{1} d_{c1} + \frac{d_{1} m_{4} d_{c3}}{2 d_{3}}`.
    pub fn latex(&self) -> String {
        let mut out = String::new();
        write(&mut out, self, false);
        out
    }
}

impl Symbol {
    /// As LaTeX: `\dot{\theta}_{1}`.
    pub fn latex(&self) -> String {
        let set = typeset(&self.name);
        let mut base = glyphs(&set.base);
        if matches!(set.base, Glyphs::Word(_)) {
            base = format!("\\mathrm{{{}}}", inner(&set.base));
        }
        match self.order {
            0 => {}
            1 => base = format!("\\dot{{{base}}}"),
            _ => base = format!("\\ddot{{{base}}}"),
        }
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

fn inner(glyphs: &Glyphs) -> String {
    match glyphs {
        Glyphs::Greek(command, _) => format!("\\{command}"),
        Glyphs::Italic(text) | Glyphs::Word(text) => text.clone(),
    }
}

fn glyphs(one: &Glyphs) -> String {
    match one {
        Glyphs::Word(text) => format!("\\mathrm{{{text}}}"),
        other => inner(other),
    }
}

/// Writes a formula; `tight` asks for parentheses around what is not a single factor.
fn write(out: &mut String, formula: &Formula, tight: bool) {
    let enclosed = tight
        && match formula {
            Formula::Sum(_) => true,
            Formula::Number(n) => n.is_negative(),
            Formula::Term { factor, .. } => factor.is_negative(),
            _ => false,
        };
    if enclosed {
        out.push_str("\\left(");
    }
    match formula {
        Formula::Number(n) => {
            if n.is_negative() {
                out.push('-');
            }
            magnitude(out, formula);
        }
        Formula::Symbol(symbol) => out.push_str(&symbol.latex()),
        Formula::Indexed(symbol, index) => {
            _ = write!(out, "{}_{{{}}}", symbol.latex(), index.latex());
        }
        Formula::Sum(terms) => {
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
        Formula::Term { .. } => {
            if formula.is_negative() {
                out.push('-');
            }
            magnitude(out, formula);
        }
        Formula::Power(base, n) => power(out, base, *n),
        Formula::Apply(function, operands) => apply(out, *function, None, operands),
    }
    if enclosed {
        out.push_str("\\right)");
    }
}

fn power(out: &mut String, base: &Formula, n: u32) {
    match base {
        Formula::Apply(f @ (Function::Sin | Function::Cos | Function::Tanh), operands) => {
            apply(out, *f, Some(n), operands);
        }
        Formula::Symbol(_) | Formula::Indexed(..) => {
            write(out, base, true);
            _ = write!(out, "^{{{n}}}");
        }
        Formula::Apply(Function::Sqrt | Function::Abs, _) => {
            out.push('{');
            write(out, base, true);
            _ = write!(out, "}}^{{{n}}}");
        }
        other => {
            _ = write!(out, "\\left({}\\right)^{{{n}}}", other.latex());
        }
    }
}

fn apply(out: &mut String, function: Function, exponent: Option<u32>, operands: &[Formula]) {
    let arguments: Vec<String> = operands.iter().map(Formula::latex).collect();
    let arguments = arguments.join(", ");
    let command = match function {
        Function::Sqrt => {
            _ = write!(out, "\\sqrt{{{arguments}}}");
            return;
        }
        Function::Abs => {
            _ = write!(out, "\\left|{arguments}\\right|");
            return;
        }
        Function::Sin => "\\sin",
        Function::Cos => "\\cos",
        Function::Tanh => "\\tanh",
        Function::Exp => "\\exp",
        Function::Sign => "\\operatorname{sign}",
        Function::Atan2 => "\\operatorname{atan2}",
    };
    out.push_str(command);
    if let Some(n) = exponent {
        _ = write!(out, "^{{{n}}}");
    }
    match operands {
        [Formula::Symbol(_)] if matches!(function, Function::Sin | Function::Cos) => {
            _ = write!(out, "{{{arguments}}}");
        }
        _ => _ = write!(out, "\\left({arguments}\\right)"),
    }
}

fn magnitude(out: &mut String, formula: &Formula) {
    match formula {
        Formula::Number(n) => match digits(n) {
            (n, Some(d)) => _ = write!(out, "\\frac{{{n}}}{{{d}}}"),
            (n, None) => out.push_str(&n),
        },
        Formula::Term {
            factor,
            above,
            below,
        } => {
            let (n, d) = digits(factor);
            if d.is_none() && below.is_empty() {
                out.push_str(&line(&n, above, true));
            } else {
                let one = Rational::ONE.to_string();
                let d = d.unwrap_or(one);
                _ = write!(
                    out,
                    "\\frac{{{}}}{{{}}}",
                    line(&n, above, false),
                    line(&d, below, false)
                );
            }
        }
        other => write(out, other, false),
    }
}

/// A product on one line; a fraction's line encloses what stands alone on it, other products are `tight`.
fn line(number: &str, factors: &[Formula], tight: bool) -> String {
    let mut parts = Vec::new();
    if number != "1" || factors.is_empty() {
        parts.push(number.to_owned());
    }
    let alone = !tight && parts.is_empty() && factors.len() == 1;
    for factor in factors {
        let mut text = String::new();
        write(&mut text, factor, !alone);
        parts.push(text);
    }
    parts.join(" \\, ")
}
