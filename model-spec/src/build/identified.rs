//! Identified values, which replace nominal ones.
//!
//! Decision: a fit is stored in addition to the nominal values that it replaces. The table `[identified]` contains
//! base parameters by their expressions, or parameters by their names. Nothing else of the file is rewritten, and
//! deleting the table removes the fit. Code that needs nominal base values gets them from one place, the derivation.

use crate::build::symbols::SymbolTable;
use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::schema::ModelEntry;
use crate::suggest;

/// Sets parameters to their identified values, and returns those of base parameters with their expressions.
pub(super) fn read_identified(
    model: &ModelEntry,
    symbols: &mut SymbolTable,
    log: &mut DiagnosticLog,
) -> Vec<(String, f64)> {
    let Some(entry) = &model.identified else {
        return Vec::new();
    };
    for (key, number) in entry.parameters.iter().flat_map(|table| &table.entries) {
        let mut parameters = symbols.parameters.iter_mut();
        if let Some(parameter) = parameters.find(|one| one.name == key.name) {
            parameter.nominal = number.value;
            parameter.has_nominal = true;
            continue;
        }
        let known = symbols.parameters.iter().map(|one| one.name.as_str());
        log.push(
            Diagnostic::error(key.span, format!("unknown parameter `{}`", key.name))
                .label("expected a parameter of this file")
                .help(suggest::advice(&key.name, "parameters", known)),
        );
    }
    // Expressions are compared with those of the derivation later, when the base parameters are known.
    let base = entry.base.iter().flat_map(|list| &list.entries);
    let values = base.filter_map(|one| {
        let (expression, value) = (one.expression.as_ref()?, one.value.as_ref()?);
        Some((expression.text.clone(), value.value))
    });
    values.collect()
}
