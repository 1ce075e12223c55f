//! From p_g to p_min: products, dependencies and base parameters, eq. (5), (6) and (16).

use modelmill_spec::Mechanism;

use super::document::{
    self, InlineSpan, PageDocument, PageEquation, PageTable, TextLine, cell, linear_model, name,
    number, text,
};
use super::rank::NumericRank;
use crate::Derivation;
use crate::expr::Rational;
use crate::expr::print::{FormulaSymbol, PrintedFormula};
use crate::reduce::base::{
    base_parameter_name as base_name, dependent_sums, expanded_formula, lumped_formulas,
    product_formula as product, product_unit,
};
use crate::reduce::{RationalFunction, ReductionMethod};
use crate::tree::expressions::ParameterMonomial;

/// Base parameter `k` written out term by term: what a script reads.
pub fn base_expression(derivation: &Derivation, k: usize) -> PrintedFormula {
    expanded_formula(&derivation.mechanism, &derivation.reduction, k)
}

/// Base parameter `k` with common factors collected: `m1*dc1 + d1*(m2 + m3)`.
pub fn factored_base_expression(derivation: &Derivation, k: usize) -> PrintedFormula {
    let Derivation {
        mechanism,
        reduction,
        ..
    } = derivation;
    let mut terms = vec![product(
        mechanism,
        &reduction.products[reduction.retained[k]],
    )];
    let mut groups: Vec<(RationalFunction, Vec<(Rational, PrintedFormula)>)> = Vec::new();
    for (at, line) in reduction.dependencies.iter().enumerate() {
        let what =
            PrintedFormula::product(Rational::ONE, lumped_formulas(mechanism, reduction, at));
        for (_, factor) in line.equals.iter().filter(|(at, _)| *at == k) {
            let (number, function) = factor.split_number();
            let member = (number, what.clone());
            match groups.iter_mut().find(|(f, _)| *f == function) {
                Some((_, members)) => members.push(member),
                None => groups.push((function, vec![member])),
            }
        }
    }
    for (function, mut members) in groups {
        let factor = function.formula(mechanism);
        let mut number = members
            .iter()
            .fold(Rational::ZERO, |c, (k, _)| c.content_with(k));
        if members[0].0.is_negative() {
            number = -&number;
        }
        let inverse = number.recip();
        for (k, _) in &mut members {
            *k = &*k * &inverse;
        }
        let sum = members
            .into_iter()
            .map(|(k, what)| PrintedFormula::product(k, [what]));
        let term = PrintedFormula::product(number, [factor, PrintedFormula::sum(sum)]);
        terms.push(term);
    }
    PrintedFormula::sum(terms)
}

/// What a product of p_g, by its position, brings into base parameter `k`: `d1*m2`, with its factor of eq. (6). A product that
/// goes by others, as in long chains, stands alone, since its factor is longer than what it would tell; so does the retained one.
pub fn base_summand(derivation: &Derivation, k: usize, product_idx: usize) -> PrintedFormula {
    let Derivation {
        mechanism,
        reduction,
        ..
    } = derivation;
    let what = product(mechanism, &reduction.products[product_idx]);
    let mut lines = reduction.dependencies.iter();
    let line = lines.find(|line| line.product == product_idx && line.via.is_empty());
    let factor = line.and_then(|line| line.equals.iter().find(|(at, _)| *at == k));
    match factor {
        Some((_, factor)) => {
            PrintedFormula::product(Rational::ONE, [factor.formula(mechanism), what])
        }
        None => what,
    }
}

/// A factor of eq. (6) as expanded text.
pub(super) fn factor_text(mechanism: &Mechanism, factor: &RationalFunction) -> String {
    factor.expanded_formula(mechanism).text()
}

/// The column of a product: `h` with the product as its index.
fn column_symbol(mechanism: &Mechanism, of: &ParameterMonomial) -> PrintedFormula {
    PrintedFormula::Indexed(FormulaSymbol::new("h"), Box::new(product(mechanism, of)))
}

/// p_g with units, and what has no effect.
pub(super) fn products(page: &mut PageDocument, derivation: &Derivation) {
    let Derivation {
        mechanism,
        reduction,
        ..
    } = derivation;
    page.heading("Products of dynamic parameters");
    let mut line = vec![text(
        "The forces of the drives are linear in products of dynamic parameters, eq. (5): ",
    )];
    line.extend(linear_model("H", "p_g"));
    line.push(text(". Each column "));
    line.push(name("h"));
    line.push(text(" of "));
    line.push(name("H"));
    line.push(text(" belongs to one product."));
    page.paragraph(line);
    let parameters: Vec<f64> = mechanism.parameters.iter().map(|p| p.nominal).collect();
    let rows = reduction
        .products
        .iter()
        .enumerate()
        .map(|(k, m)| {
            let fate = match reduction.retained.iter().position(|r| *r == k) {
                Some(at) => vec![
                    text("retained, "),
                    InlineSpan::Math(PrintedFormula::name(base_name(at))),
                ],
                None => cell(text("follows from retained columns")),
            };
            vec![
                cell(text((k + 1).to_string())),
                cell(InlineSpan::Math(product(mechanism, m))),
                cell(document::unit(product_unit(mechanism, m))),
                cell(text(RoundedNumber(m.value(&parameters)).to_string())),
                fate,
            ]
        })
        .collect();
    page.table(
        "products",
        PageTable {
            head: vec!["", "product", "unit", "nominal", "column"],
            rows,
        },
    );
    if !reduction.without_effect.is_empty() {
        let mut line: TextLine = vec![text("Without any effect on the drives, and so left out: ")];
        for (i, m) in reduction.without_effect.iter().enumerate() {
            if i > 0 {
                line.push(text(", "));
            }
            line.push(InlineSpan::Math(product(mechanism, m)));
        }
        line.push(text("."));
        page.paragraph(line);
    }
}

/// Eq. (6).
pub(super) fn dependencies(page: &mut PageDocument, derivation: &Derivation) {
    let Derivation {
        mechanism,
        reduction,
        ..
    } = derivation;
    page.heading("Dependent columns");
    if reduction.dependencies.is_empty() {
        let mut says =
            "All columns are linearly independent; nothing needs to be regrouped.".to_owned();
        if let Some(caution) = reduction.method.caution() {
            says = format!("{says} Beware: {caution}.");
        }
        page.paragraph([text(says)]);
        return;
    }
    page.paragraph([text(match &reduction.method {
        ReductionMethod::Exact { confirmed_at, .. } => format!(
            "Columns that are constant combinations of retained ones at every state, eq. (6). \
             They were found in exact arithmetic and confirmed at {confirmed_at} further states with other values of the constants."
        ),
        ReductionMethod::Unreduced => "Columns are not reduced.".to_owned(),
        ReductionMethod::Numeric { least_kept, most_dropped, residual, because } => format!(
            "Columns that are constant combinations of retained ones, eq. (6), found numerically on the values of this file: \
             {because}. The factors are rounded, and base and factors hold for these values alone. \
             Of every retained column the others leave at least {least_kept:.1e}, of every dependent one at most {most_dropped:.1e}; \
             at further states the factors leave at most {residual:.1e} of a column."
        ),
    })]);
    let lines = reduction
        .dependencies
        .iter()
        .enumerate()
        .map(|(i, line)| PageEquation {
            left: column_symbol(mechanism, &reduction.products[line.product]),
            right: {
                let retained = line.equals.iter();
                let retained = retained.map(|(k, factor)| (reduction.retained[*k], factor));
                let via = line.via.iter().map(|(product, factor)| (*product, factor));
                PrintedFormula::sum(retained.chain(via).map(|(product, factor)| {
                    let column = column_symbol(mechanism, &reduction.products[product]);
                    PrintedFormula::product(Rational::ONE, [factor.formula(mechanism), column])
                }))
            },
            tag: format!("6.{}", i + 1),
            unit: None,
        })
        .collect();
    page.equations("dependent columns", lines);
}

/// Eq. (16).
pub(super) fn base_parameters(
    page: &mut PageDocument,
    derivation: &Derivation,
    numeric: Option<&NumericRank>,
) {
    let Derivation {
        mechanism,
        reduction,
        ..
    } = derivation;
    page.heading("Base parameters");
    let rank = reduction.retained.len();
    let mut line = vec![text(format!(
        "With eq. (6) the {} products regroup to {rank} base parameters, eq. (16): ",
        reduction.products.len()
    ))];
    line.extend(linear_model("H_min", "p_min"));
    line.push(text("."));
    if let Some(n) = numeric {
        let verdict = if n.rank == rank {
            ", the same"
        } else {
            ": this geometry is special, and some base parameters cannot be told apart"
        };
        line.push(text(format!(
            " On the file's values the numeric rank of eq. (9) over {} states is {}{verdict}.",
            n.samples, n.rank
        )));
        if let Some(condition) = n.condition {
            line.push(text(format!(" The condition number is {condition:.3}.")));
        }
    }
    page.paragraph(line);
    let equation = |k: usize, right: PrintedFormula| PageEquation {
        left: PrintedFormula::name(base_name(k)),
        right,
        tag: format!("16.{}", k + 1),
        unit: Some(product_unit(
            mechanism,
            &reduction.products[reduction.retained[k]],
        )),
    };
    let sums = dependent_sums(mechanism, reduction);
    if !sums.is_empty() {
        page.paragraph([text(
            "Products that others go by stand with these, link by link (Gautier and Khalil 1990):",
        )]);
        let sums = sums
            .into_iter()
            .enumerate()
            .map(|(i, (name, right))| PageEquation {
                left: PrintedFormula::name(name),
                right,
                tag: format!("7.{}", i + 1),
                unit: None,
            });
        page.equations("sums", sums.collect());
    }
    let grouped = (0..rank)
        .map(|k| equation(k, factored_base_expression(derivation, k)))
        .collect();
    page.equations("base parameters", grouped);
    let values = derivation.nominal_base_values();
    let rows = (0..rank)
        .map(|k| {
            let retained = &reduction.products[reduction.retained[k]];
            vec![
                cell(InlineSpan::Math(PrintedFormula::name(base_name(k)))),
                cell(InlineSpan::Math(product(mechanism, retained))),
                cell(text(RoundedNumber(values[k]).to_string())),
                cell(document::unit(product_unit(mechanism, retained))),
            ]
        })
        .collect();
    page.table(
        "values",
        PageTable {
            head: vec![
                "base parameter",
                "retained product",
                "nominal value",
                "unit",
            ],
            rows,
        },
    );
}

/// A number with six significant digits.
struct RoundedNumber(f64);

impl std::fmt::Display for RoundedNumber {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let rounded: f64 = format!("{:.5e}", self.0).parse().unwrap_or(self.0);
        f.write_str(&number(rounded))
    }
}
