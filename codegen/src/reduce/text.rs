//! Reductions as lines of text.

use modelmill_spec::Mechanism;

use super::{Dependency, Polynomial, RationalFunction, Reduction, Variable};
use crate::expr::Rational;

impl Reduction {
    /// Base parameter `k` as an expression: eq. (16).
    pub fn base_text(&self, mechanism: &Mechanism, k: usize) -> String {
        let mut text = self.products[self.retained[k]].text(mechanism);
        for line in &self.dependencies {
            for (_, factor) in line.equals.iter().filter(|(i, _)| *i == k) {
                push_term(&mut text, &factor_times(factor, mechanism, &self.products[line.product].text(mechanism)));
            }
        }
        text
    }
}

impl Dependency {
    /// One line of eq. (6).
    pub fn text(&self, mechanism: &Mechanism, reduction: &Reduction) -> String {
        let mut right = String::new();
        for (k, factor) in &self.equals {
            let column = format!("h[{}]", reduction.products[reduction.retained[*k]].text(mechanism));
            push_term(&mut right, &factor_times(factor, mechanism, &column));
        }
        format!("h[{}] = {right}", reduction.products[self.product].text(mechanism))
    }
}

fn push_term(text: &mut String, term: &str) {
    match (text.is_empty(), term.strip_prefix('-')) {
        (true, _) => text.push_str(term),
        (false, Some(rest)) => text.push_str(&format!(" - {rest}")),
        (false, None) => text.push_str(&format!(" + {term}")),
    }
}

fn factor_times(factor: &RationalFunction, mechanism: &Mechanism, what: &str) -> String {
    match factor.as_constant() {
        Some(k) if k.is_one() => return what.to_owned(),
        Some(k) if k == Rational::MINUS_ONE => return format!("-{what}"),
        _ => {}
    }
    let bracket = |p: &Polynomial| {
        let text = polynomial(p, mechanism);
        if p.len() > 1 { format!("({text})") } else { text }
    };
    let numerator = bracket(&factor.numerator);
    let above = match (numerator.as_str(), factor.denominator.len()) {
        ("1", _) => what.to_owned(),
        ("-1", _) => format!("-{what}"),
        _ => format!("{numerator}*{what}"),
    };
    let below = polynomial(&factor.denominator, mechanism);
    match below.as_str() {
        "1" => above,
        _ if below.contains(['*', '+', '-', ' ']) => format!("{above}/({below})"),
        _ => format!("{above}/{below}"),
    }
}

fn polynomial(p: &Polynomial, mechanism: &Mechanism) -> String {
    let mut text = String::new();
    for (powers, k) in p.iter().rev() {
        let mut factors: Vec<String> = powers
            .iter()
            .map(|(v, n)| {
                let name = match v {
                    Variable::Constant(i) => mechanism.constants[*i].name.clone(),
                    Variable::Cos(i) => format!("cos({})", mechanism.constants[*i].name),
                    Variable::Sin(i) => format!("sin({})", mechanism.constants[*i].name),
                    Variable::Root(r) => format!("sqrt({r})"),
                };
                if *n == 1 { name } else { format!("{name}^{n}") }
            })
            .collect();
        let negative = k.is_negative();
        if !k.abs().is_one() || factors.is_empty() {
            factors.insert(0, k.abs().to_string());
        }
        push_term(&mut text, &format!("{}{}", if negative { "-" } else { "" }, factors.join("*")));
    }
    if text.is_empty() { "0".to_owned() } else { text }
}
