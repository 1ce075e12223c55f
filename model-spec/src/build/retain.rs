//! The products of parameters that should stay in the base parameters.
//!
//! The list `retain` goes in; powers of parameters come out, one list per product.

use std::collections::BTreeMap;

use crate::build::symbols::SymbolTable;
use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::exact::{ExactExpression, ModelSymbol, ParameterIdx};
use crate::formula::{FormulaAst, FormulaAstKind};
use crate::schema::ModelEntry;
use crate::scope::SymbolSort;

/// Reads the products to retain: for each, its parameters with positive exponents, in the order of the file.
///
/// Their order is that of preference: the most wanted product comes first.
pub(super) fn retain(
    model: &ModelEntry,
    symbols: &SymbolTable,
    log: &mut DiagnosticLog,
) -> Vec<Vec<(ParameterIdx, u32)>> {
    let mut products = Vec::new();
    for formula in model.retain.iter().flat_map(|list| &list.entries) {
        let mut powers: BTreeMap<ParameterIdx, u32> = BTreeMap::new();
        if product(&formula.ast, 1, symbols, &mut powers, log) {
            products.push(powers.into_iter().collect());
        }
    }
    products
}

/// Adds the powers of a product to `powers`, all multiplied by `exponent`; false after a fault.
///
/// Only names of parameters, products of them, and positive powers are allowed.
fn product(
    ast: &FormulaAst,
    exponent: u32,
    symbols: &SymbolTable,
    powers: &mut BTreeMap<ParameterIdx, u32>,
    log: &mut DiagnosticLog,
) -> bool {
    match &ast.kind {
        // A name must be that of a parameter.
        FormulaAstKind::Name(name) => {
            // An entry of `retain` does not count as a use of the parameter, so the mark is restored.
            let was_used = symbols.scope.get(name).is_some_and(|meaning| meaning.used.get());
            let Some(meaning) = symbols.scope.look_up(name, ast.span, &[SymbolSort::Parameter], log) else {
                return false;
            };
            meaning.used.set(was_used);
            if let ExactExpression::Symbol(ModelSymbol::Parameter(idx)) = meaning.exact {
                *powers.entry(idx).or_default() += exponent;
            }
            true
        }
        // All factors are read, so that each fault is reported.
        FormulaAstKind::Product(factors) => {
            let mut fine = true;
            for factor in factors {
                fine &= product(factor, exponent, symbols, powers, log);
            }
            fine
        }
        // Nested powers multiply their exponents.
        FormulaAstKind::Power(base, power) if *power > 0 => product(
            base,
            exponent.saturating_mul(power.unsigned_abs()),
            symbols,
            powers,
            log,
        ),
        _ => {
            log.push(
                Diagnostic::error(ast.span, "only a product of parameters can be retained")
                    .label("expected for example `m1*dc1^2`"),
            );
            false
        }
    }
}
