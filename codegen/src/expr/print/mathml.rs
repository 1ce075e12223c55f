//! Formulas as presentation MathML, readable by any browser without scripts.

use std::fmt::Write;

use modelmill_boundary::text::html as escape;

use super::formula::{Formula, Function, digits};
use super::symbol::{Glyphs, Symbol, typeset};

impl Formula {
    /// As the content of a `math` element.
    pub fn mathml(&self) -> String {
        let mut out = Out::default();
        write(&mut out, self, false);
        format!("<mrow>{}</mrow>", out.text)
    }

    /// As the contents of `math` elements, one after the other, between which a line may end: before each sign of a sum, those
    /// in parentheses too. What cannot be parted otherwise, a long fraction or root, is written on the line.
    pub fn mathml_stretches(&self) -> Vec<String> {
        let mut out = Out {
            may_part: true,
            ..Out::default()
        };
        write(&mut out, self, false);
        out.part();
        let stretches = out.done.into_iter();
        stretches
            .map(|stretch| format!("<mrow>{stretch}</mrow>"))
            .collect()
    }
}

/// Letters of text beyond which a fraction or a root is written on the line where lines may end.
const LONG: usize = 32;

/// MathML as it grows.
#[derive(Default)]
struct Out {
    /// Stretches that ended.
    done: Vec<String>,
    text: String,
    /// Whether a line may end here.
    may_part: bool,
}

impl Out {
    fn push_str(&mut self, text: &str) {
        self.text.push_str(text);
    }

    /// A line may end here.
    fn part(&mut self) {
        if self.may_part && !self.text.is_empty() {
            self.done.push(std::mem::take(&mut self.text));
        }
    }

    /// Writes what must stay together.
    fn whole(&mut self, write: impl FnOnce(&mut Self)) {
        let may_part = std::mem::replace(&mut self.may_part, false);
        write(self);
        self.may_part = may_part;
    }

    /// Whether something is to be written on the line, since it would be too wide in one piece.
    fn is_too_wide(&self, formula: &Formula) -> bool {
        self.may_part && formula.text().chars().count() > LONG
    }
}

impl Write for Out {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.text.push_str(text);
        Ok(())
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

fn fenced(out: &mut Out, open: &str, close: &str, body: impl FnOnce(&mut Out)) {
    fenced_and_raised(out, open, close, None, body);
}

fn fenced_and_raised(
    out: &mut Out,
    open: &str,
    close: &str,
    exponent: Option<u32>,
    body: impl FnOnce(&mut Out),
) {
    if out.may_part {
        // Both parentheses may come into stretches of their own.
        _ = write!(out, "<mo form=\"prefix\" stretchy=\"false\">{open}</mo>");
        body(out);
        let close = format!("<mo form=\"postfix\" stretchy=\"false\">{close}</mo>");
        match exponent {
            Some(n) => _ = write!(out, "<msup>{close}<mn>{n}</mn></msup>"),
            None => out.push_str(&close),
        }
        return;
    }
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

fn write(out: &mut Out, formula: &Formula, tight: bool) {
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
                if i > 0 {
                    out.part();
                }
                // What begins a line keeps its distance from its sign.
                let sides = match i {
                    0 => " form=\"prefix\"",
                    _ if out.may_part => " form=\"infix\" lspace=\"0\" rspace=\"0.22em\"",
                    _ => "",
                };
                match (i, term.is_negative()) {
                    (_, true) => _ = write!(out, "<mo{sides}>&#x2212;</mo>"),
                    (0, false) => {}
                    (_, false) => _ = write!(out, "<mo{sides}>+</mo>"),
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

fn power(out: &mut Out, base: &Formula, n: u32) {
    match base {
        Formula::Apply(f @ (Function::Sin | Function::Cos | Function::Tanh), operands) => {
            apply(out, *f, Some(n), operands);
        }
        Formula::Symbol(symbol) => out.push_str(&symbol.mathml_raised(Some(n))),
        Formula::Indexed(..) | Formula::Apply(Function::Abs, _) => out.whole(|out| {
            out.push_str("<msup><mrow>");
            write(out, base, true);
            _ = write!(out, "</mrow><mn>{n}</mn></msup>");
        }),
        other => fenced_and_raised(out, "(", ")", Some(n), |out| write(out, other, false)),
    }
}

fn apply(out: &mut Out, function: Function, exponent: Option<u32>, operands: &[Formula]) {
    let arguments = |out: &mut Out| {
        for (i, operand) in operands.iter().enumerate() {
            if i > 0 {
                out.push_str("<mo>,</mo>");
            }
            write(out, operand, false);
        }
    };
    match function {
        Function::Sqrt if operands.iter().any(|one| out.is_too_wide(one)) => {
            out.push_str("<mo form=\"prefix\" stretchy=\"false\">&#x221A;</mo>");
            fenced(out, "(", ")", arguments);
            return;
        }
        Function::Sqrt => {
            out.whole(|out| {
                out.push_str("<msqrt><mrow>");
                arguments(out);
                out.push_str("</mrow></msqrt>");
            });
            return;
        }
        Function::Abs => {
            fenced(out, "|", "|", arguments);
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
            out.push_str("<mo lspace=\"0\" rspace=\"0.17em\">&#x2061;</mo>");
            arguments(out);
        }
        _ => {
            out.push_str("<mo>&#x2061;</mo>");
            fenced(out, "(", ")", arguments);
        }
    }
}

fn magnitude(out: &mut Out, formula: &Formula) {
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
            } else if out.is_too_wide(formula) {
                line(out, &n, above, true);
                out.part();
                out.push_str("<mo form=\"infix\" stretchy=\"false\">/</mo>");
                let d = d.as_deref().unwrap_or("1");
                let is_one = below.len() + usize::from(d != "1") == 1;
                if is_one {
                    line(out, d, below, true);
                } else {
                    fenced(out, "(", ")", |out| line(out, d, below, true));
                }
            } else {
                out.whole(|out| {
                    out.push_str("<mfrac><mrow>");
                    line(out, &n, above, false);
                    out.push_str("</mrow><mrow>");
                    line(out, d.as_deref().unwrap_or("1"), below, false);
                    out.push_str("</mrow></mfrac>");
                });
            }
        }
        other => write(out, other, false),
    }
}

/// A product on one line; a fraction's line encloses what stands alone on it, other products are `tight`.
fn line(out: &mut Out, number: &str, factors: &[Formula], tight: bool) {
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
