//! From p_g to p_min: products, dependencies and base parameters, eq. (5), (6) and (16).
//! A derivation goes in; the page gets the tables and equations of its last three sections.

use modelmill_spec::Mechanism;

use super::document::{
    self, InlineSpan, PageDocument, PageEquation, PageTable, TextLine, cell, linear_model, name, number, text,
};
use super::rank::NumericRank;
use crate::Derivation;
use crate::expr::Rational;
use crate::expr::print::{FormulaSymbol, PrintedFormula};
use crate::reduce::base::{
    base_parameter_name as base_name, dependent_sums, expanded_formula, lumped_formulas, product_formula as product,
    product_unit,
};
use crate::reduce::{RationalFunction, ReductionMethod, constant_change_text, n_verified_digits};
use crate::tree::expressions::ParameterMonomial;

/// Base parameter `k` expanded term by term, without parentheses: the form that a script reads.
pub fn base_expression(derivation: &Derivation, k: usize) -> PrintedFormula {
    expanded_formula(&derivation.mechanism, &derivation.reduction, k)
}

/// Base parameter `k` with common factors collected: `m1*dc1 + d1*(m2 + m3)`.
pub fn factored_base_expression(derivation: &Derivation, k: usize) -> PrintedFormula {
    let Derivation {
        mechanism, reduction, ..
    } = derivation;
    // The retained product has the factor 1 and comes first.
    let mut terms = vec![product(mechanism, &reduction.products[reduction.retained[k]])];
    // Lumped products grouped by their common function of the constants: per function pairs of a number and a product.
    let mut groups: Vec<(RationalFunction, Vec<(Rational, PrintedFormula)>)> = Vec::new();
    for (at, line) in reduction.dependencies.iter().enumerate() {
        let what = PrintedFormula::product(Rational::ONE, lumped_formulas(mechanism, reduction, at));
        // The numeric content of a factor is split off, so that factors that differ by a number only share a group.
        for (_, factor) in line.equals.iter().filter(|(at, _)| *at == k) {
            // Equal functions are found by comparison, since there are few.
            let (number, function) = factor.split_number();
            let member = (number, what.clone());
            match groups.iter_mut().find(|(f, _)| *f == function) {
                Some((_, members)) => members.push(member),
                None => groups.push((function, vec![member])),
            }
        }
    }
    // One term per group: number * function * (sum of products).
    for (function, members) in groups {
        let factor = function.formula(mechanism);
        // The greatest common content of the numbers stands in front; the first term in parentheses is positive.
        let mut number = members.iter().fold(Rational::ZERO, |c, (k, _)| c.content_with(k));
        if members[0].0.is_negative() {
            number = -&number;
        }
        let inverse = number.recip();
        // Rounded decimals have no content that is worth reading: each term keeps its own number.
        if !members.iter().all(|(k, _)| is_small_multiple(&(k * &inverse))) {
            terms.extend((members.into_iter()).map(|(k, what)| PrintedFormula::product(k, [factor.clone(), what])));
            continue;
        }
        // number * function * sum, with the number in front or in the terms, whichever is shorter:
        // `0.5*(m2 + m3)`, but `I2 + 3.61*mb` instead of `0.01*(100*I2 + 361*mb)`.
        let with_number = |number: &Rational| {
            let inverse = number.recip();
            let sum = (members.iter()).map(|(k, what)| PrintedFormula::product(k * &inverse, [what.clone()]));
            PrintedFormula::product(number.clone(), [factor.clone(), PrintedFormula::sum(sum)])
        };
        let (in_front, in_terms) = (with_number(&number), with_number(&Rational::ONE));
        let is_shorter = in_terms.text().len() < in_front.text().len();
        terms.push(if is_shorter { in_terms } else { in_front });
    }
    PrintedFormula::sum(terms)
}

/// Whether a number in parentheses is easier to read than its product with the number in front of them.
fn is_small_multiple(number: &Rational) -> bool {
    /// Largest such integer. By judgement.
    const LARGEST: i64 = 10_000;
    number.as_small().is_some_and(|(n, _)| n.abs() <= LARGEST)
}

/// The summand of base parameter `k` that belongs to the product of p_g at `product_idx`: `d1*m2`, with its factor of
/// eq. (6).
/// Without factor are the retained product and, in long chains, products that depend on other dependent ones,
/// whose factors are too long to read.
pub fn base_summand(derivation: &Derivation, k: usize, product_idx: usize) -> PrintedFormula {
    let Derivation {
        mechanism, reduction, ..
    } = derivation;
    let what = product(mechanism, &reduction.products[product_idx]);
    let mut lines = reduction.dependencies.iter();
    // A line without `via` gives the factor directly.
    let line = lines.find(|line| line.product == product_idx && line.via.is_empty());
    let factor = line.and_then(|line| line.equals.iter().find(|(at, _)| *at == k));
    match factor {
        Some((_, factor)) => PrintedFormula::product(Rational::ONE, [factor.formula(mechanism), what]),
        None => what,
    }
}

/// A factor of eq. (6) as expanded infix text.
pub(super) fn factor_text(mechanism: &Mechanism, factor: &RationalFunction) -> String {
    factor.expanded_formula(mechanism).text()
}

/// The column of a product: `h` with the product as its index.
fn column_symbol(mechanism: &Mechanism, of: &ParameterMonomial) -> PrintedFormula {
    PrintedFormula::Indexed(FormulaSymbol::new("h"), Box::new(product(mechanism, of)))
}

/// The section of p_g: a table of the products with unit and nominal value, and a list of products without effect.
pub(super) fn products(page: &mut PageDocument, derivation: &Derivation) {
    let Derivation {
        mechanism, reduction, ..
    } = derivation;
    // The model that the table belongs to comes first.
    page.heading("Products of dynamic parameters");
    let mut line = vec![text(
        "The forces of the drives are linear in products of dynamic parameters, eq. (5): ",
    )];
    line.extend(linear_model("H", "p_g"));
    line.push(text(". Each column "));
    line.push(name("h"));
    line.push(text(" of "));
    line.push(name("H"));
    // Pages of all mechanisms use the numbers of the paper with which the project started.
    line.push(text(
        " belongs to one product. Numbers of equations, such as (5), are those of the paper Dynamic Modeling and \
         Identification of a Complex-structured Parallel Robot, about the robot SpiderMill.",
    ));
    page.paragraph(line);
    // Nominal values of single parameters; the value of a product follows from them.
    let parameters: Vec<f64> = mechanism.parameters.iter().map(|p| p.nominal).collect();
    // One row per product of p_g.
    let rows = reduction
        .products
        .iter()
        .enumerate()
        // The last cell names the base parameter of a retained product.
        .map(|(k, m)| {
            let fate = match reduction.retained.iter().position(|r| *r == k) {
                Some(at) => vec![
                    text("retained, "),
                    InlineSpan::Math(PrintedFormula::name(base_name(at))),
                ],
                None => cell(text("depends on retained columns")),
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
    // Products without effect are listed, so that a reader does not look for them in the table.
    if !reduction.without_effect.is_empty() {
        let mut line: TextLine = vec![text("These products do not affect the drives and are left out: ")];
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

/// The section of eq. (6): the columns that are combinations of retained ones, and how they were found.
pub(super) fn dependencies(page: &mut PageDocument, derivation: &Derivation) {
    let Derivation {
        mechanism, reduction, ..
    } = derivation;
    // Without dependencies one sentence is enough.
    page.heading("Dependent columns");
    if reduction.dependencies.is_empty() {
        let mut says = "All columns are linearly independent; nothing needs to be regrouped.".to_owned();
        if let Some(caution) = reduction.method.caution() {
            says = format!("{says} Caution: {caution}.");
        }
        page.paragraph([text(says)]);
        return;
    }
    // How the dependencies were found decides for which values of the constants they are valid.
    page.paragraph([text(match &reduction.method {
        ReductionMethod::Exact { confirmed_at, .. } => format!(
            "At every state, the following columns are linear combinations of retained columns with constant factors, eq. (6). \
             They were found in exact arithmetic; a check at {confirmed_at} other states, with other values of the constants, confirmed them."
        ),
        ReductionMethod::Unreduced => "Columns are not reduced.".to_owned(),
        ReductionMethod::Numeric { least_kept, most_dropped, residual, constant_change, because } => format!(
            "The following columns are linear combinations of retained columns with constant factors, eq. (6). \
             They were found numerically with the values of this file: {because}. \
             The factors are rounded; base and factors are valid for these values only. \
             In the span of the other columns, every retained column has a residual of at least {least_kept:.1e} of its size, \
             every dependent one of at most {most_dropped:.1e}. \
             At further states the residual of eq. (6) is at most {residual:.1e} of a column. \
             So the dependencies were verified to {} digits and not proved{}.",
            n_verified_digits(*most_dropped),
            constant_change.map_or_else(String::new, |change| format!("; {}", constant_change_text(change))),
        ),
    })]);
    // One equation per dependent column: factors times retained columns, or times dependent ones with lines of their
    // own.
    let lines = reduction
        .dependencies
        .iter()
        .enumerate()
        .map(|(i, line)| PageEquation {
            // The dependent column.
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

/// The section of eq. (16): the base parameters as formulas and their nominal values.
/// `numeric` is the rank on the file's values, which is compared with the exact one.
pub(super) fn base_parameters(page: &mut PageDocument, derivation: &Derivation, numeric: Option<&NumericRank>) {
    let Derivation {
        mechanism, reduction, ..
    } = derivation;
    // A sentence with the rank, then the equations, then the values.
    page.heading("Base parameters");
    let rank = reduction.retained.len();
    let mut line = vec![text(format!(
        "With eq. (6) the {} products regroup to {rank} base parameters, eq. (16): ",
        reduction.products.len()
    ))];
    line.extend(linear_model("H_min", "p_min"));
    line.push(text("."));
    // The numeric check, if the caller has made it.
    if let Some(n) = numeric {
        // A smaller numeric rank means a special geometry.
        let verdict = if n.rank == rank {
            ", as derived"
        } else {
            "; this geometry is special, and some base parameters are indistinguishable"
        };
        line.push(text(format!(
            " Numeric check of the number of base parameters: H at {} random states, with the file's values, has rank {}{verdict}.",
            n.samples, n.rank
        )));
        if let Some(condition) = n.condition {
            line.push(text(format!(
                " The condition number over these states is {condition:.3}; along a recording it is different."
            )));
        }
    }
    page.paragraph(line);
    // The unit of a base parameter is that of its retained product.
    let equation = |k: usize, right: PrintedFormula| PageEquation {
        left: PrintedFormula::name(base_name(k)),
        right,
        tag: format!("16.{}", k + 1),
        unit: Some(product_unit(mechanism, &reduction.products[reduction.retained[k]])),
    };
    // Long chains have named sums, because base parameters without them would be too long to read.
    let sums = dependent_sums(mechanism, reduction);
    if !sums.is_empty() {
        page.paragraph([text(
            "Named sums: a dependent product together with the products that are expressed by it, link by link (Gautier and Khalil 1990):",
        )]);
        let sums = sums.into_iter().enumerate().map(|(i, (name, right))| PageEquation {
            left: PrintedFormula::name(name),
            right,
            tag: format!("7.{}", i + 1),
            unit: None,
        });
        page.equations("sums", sums.collect());
    }
    // Factored forms, which are shorter than the expanded ones that scripts read.
    let grouped = (0..rank)
        .map(|k| equation(k, factored_base_expression(derivation, k)))
        .collect();
    page.equations("base parameters", grouped);
    // Identified values where the file has them, nominal ones otherwise.
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
            head: vec!["base parameter", "retained product", "nominal value", "unit"],
            rows,
        },
    );
}

/// A number with six significant digits.
/// Printed with at most six digits; rounding is done in decimal, so that the text has no trailing digits.
struct RoundedNumber(f64);

impl std::fmt::Display for RoundedNumber {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let rounded: f64 = format!("{:.5e}", self.0).parse().unwrap_or(self.0);
        f.write_str(&number(rounded))
    }
}
