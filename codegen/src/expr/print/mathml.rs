//! Formulas as presentation MathML, readable by any browser without scripts.

use std::fmt::Write;

use modelmill_boundary::text::html as escape;

use super::formula::{Formula, Function, digits};
use super::symbol::{Glyphs, Symbol, typeset};

impl Formula {
    /// As the content of a `math` element.
    pub fn mathml(&self) -> String {
        let mut out = String::from("<mrow>");
        write(&mut out, self, false);
        out.push_str("</mrow>");
        out
    }
}

/// Space between factors; the sign of the product stays invisible.
const TIMES: &str = "<mo lspace=\"0\" rspace=\"0.12em\">&#x2062;</mo>";

impl Symbol {
    /// As a MathML element.
    pub fn mathml(&self) -> String {
        self.mathml_raised(None)
    }

    /// With an exponent above the index.
    fn mathml_raised(&self, exponent: Option<u32>) -> String {
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
        if set.index.is_empty() {
            return match exponent {
                Some(n) => format!("<msup>{base}<mn>{n}</mn></msup>"),
                None => base,
            };
        }
        let parts: Vec<String> = set
            .index
            .iter()
            .map(|part| part.iter().map(glyphs).collect::<String>())
            .collect();
        let index = parts.join("<mo lspace=\"0\" rspace=\"0\">,</mo>");
        match exponent {
            Some(n) => format!("<msubsup>{base}<mrow>{index}</mrow><mn>{n}</mn></msubsup>"),
            None => format!("<msub>{base}<mrow>{index}</mrow></msub>"),
        }
    }
}

fn glyphs(one: &Glyphs) -> String {
    match one {
        Glyphs::Greek(_, letter) => format!("<mi>{letter}</mi>"),
        Glyphs::Italic(text) if text.bytes().all(|b| b.is_ascii_digit()) => {
            format!("<mn>{text}</mn>")
        }
        Glyphs::Italic(text) if text.chars().count() == 1 => format!("<mi>{}</mi>", escape(text)),
        // Several letters stand upright by themselves.
        Glyphs::Italic(text) | Glyphs::Word(text) => format!("<mi>{}</mi>", escape(text)),
    }
}

fn fenced(out: &mut String, open: &str, close: &str, body: impl FnOnce(&mut String)) {
    _ = write!(out, "<mrow><mo>{open}</mo>");
    body(out);
    _ = write!(out, "<mo>{close}</mo></mrow>");
}

fn write(out: &mut String, formula: &Formula, tight: bool) {
    let enclosed = tight
        && match formula {
            Formula::Sum(_) => true,
            Formula::Number(n) => n.is_negative(),
            Formula::Term { factor, .. } => factor.is_negative(),
            _ => false,
        };
    if enclosed {
        fenced(out, "(", ")", |out| write(out, formula, false));
        return;
    }
    match formula {
        Formula::Symbol(symbol) => out.push_str(&symbol.mathml()),
        Formula::Indexed(symbol, index) => {
            _ = write!(out, "<msub>{}{}</msub>", symbol.mathml(), index.mathml());
        }
        Formula::Sum(terms) => {
            for (i, term) in terms.iter().enumerate() {
                match (i, term.is_negative()) {
                    (0, true) => out.push_str("<mo form=\"prefix\">&#x2212;</mo>"),
                    (0, false) => {}
                    (_, true) => out.push_str("<mo>&#x2212;</mo>"),
                    (_, false) => out.push_str("<mo>+</mo>"),
                }
                magnitude(out, term);
            }
        }
        Formula::Number(_) | Formula::Term { .. } => {
            if formula.is_negative() {
                out.push_str("<mo form=\"prefix\">&#x2212;</mo>");
            }
            magnitude(out, formula);
        }
        Formula::Power(base, n) => power(out, base, *n),
        Formula::Apply(function, operands) => apply(out, *function, None, operands),
    }
}

fn power(out: &mut String, base: &Formula, n: u32) {
    match base {
        Formula::Apply(f @ (Function::Sin | Function::Cos | Function::Tanh), operands) => {
            apply(out, *f, Some(n), operands);
        }
        Formula::Symbol(symbol) => out.push_str(&symbol.mathml_raised(Some(n))),
        Formula::Indexed(..) | Formula::Apply(Function::Abs, _) => {
            out.push_str("<msup>");
            out.push_str("<mrow>");
            write(out, base, true);
            _ = write!(out, "</mrow><mn>{n}</mn></msup>");
        }
        other => {
            out.push_str("<msup>");
            fenced(out, "(", ")", |out| write(out, other, false));
            _ = write!(out, "<mn>{n}</mn></msup>");
        }
    }
}

fn apply(out: &mut String, function: Function, exponent: Option<u32>, operands: &[Formula]) {
    let mut arguments = String::new();
    for (i, operand) in operands.iter().enumerate() {
        if i > 0 {
            arguments.push_str("<mo>,</mo>");
        }
        write(&mut arguments, operand, false);
    }
    match function {
        Function::Sqrt => {
            _ = write!(out, "<msqrt><mrow>{arguments}</mrow></msqrt>");
            return;
        }
        Function::Abs => {
            fenced(out, "|", "|", |out| out.push_str(&arguments));
            return;
        }
        _ => {}
    }
    let name = format!("<mi>{}</mi>", function.name());
    match exponent {
        Some(n) => _ = write!(out, "<msup>{name}<mn>{n}</mn></msup>"),
        None => out.push_str(&name),
    }
    match operands {
        [Formula::Symbol(_)] if matches!(function, Function::Sin | Function::Cos) => {
            _ = write!(
                out,
                "<mo lspace=\"0\" rspace=\"0.17em\">&#x2061;</mo>{arguments}"
            );
        }
        _ => {
            out.push_str("<mo>&#x2061;</mo>");
            fenced(out, "(", ")", |out| out.push_str(&arguments));
        }
    }
}

fn magnitude(out: &mut String, formula: &Formula) {
    match formula {
        Formula::Number(n) => match digits(n) {
            (n, Some(d)) => _ = write!(out, "<mfrac><mn>{n}</mn><mn>{d}</mn></mfrac>"),
            (n, None) => _ = write!(out, "<mn>{n}</mn>"),
        },
        Formula::Term {
            factor,
            above,
            below,
        } => {
            let (n, d) = digits(factor);
            if d.is_none() && below.is_empty() {
                line(out, &n, above, true);
            } else {
                out.push_str("<mfrac><mrow>");
                line(out, &n, above, false);
                out.push_str("</mrow><mrow>");
                line(out, d.as_deref().unwrap_or("1"), below, false);
                out.push_str("</mrow></mfrac>");
            }
        }
        other => write(out, other, false),
    }
}

/// A product on one line; a fraction's line encloses what stands alone on it, other products are `tight`.
fn line(out: &mut String, number: &str, factors: &[Formula], tight: bool) {
    let with_number = number != "1" || factors.is_empty();
    if with_number {
        _ = write!(out, "<mn>{number}</mn>");
    }
    let alone = !tight && !with_number && factors.len() == 1;
    for (i, factor) in factors.iter().enumerate() {
        if i > 0 || with_number {
            out.push_str(TIMES);
        }
        write(out, factor, !alone);
    }
}
