//! What was identified: values that take the place of nominal ones.
//!
//! Decision: a fit stands beside the nominal values that it replaces. The table `[identified]` holds base
//! parameters by their expressions, or parameters by their names. Nothing else of the file is rewritten, and
//! deleting the table removes the fit. Code that needs nominal base values gets them from one place, the
//! derivation.

use crate::build::symbols::Symbols;
use crate::diagnostic::{Diagnostic, Log};
use crate::schema::ModelEntry;
use crate::suggest;

/// Gives parameters their identified values; what comes back are those of base parameters, by their expressions.
pub(super) fn identified(
    model: &ModelEntry,
    symbols: &mut Symbols,
    log: &mut Log,
) -> Vec<(String, f64)> {
    let Some(entry) = &model.identified else {
        return Vec::new();
    };
    for (key, number) in entry.parameters.iter().flat_map(|table| &table.entries) {
        let mut parameters = symbols.parameters.iter_mut();
        if let Some(parameter) = parameters.find(|one| one.name == key.name) {
            parameter.nominal = number.value;
            continue;
        }
        let known = symbols.parameters.iter().map(|one| one.name.as_str());
        log.push(
            Diagnostic::error(key.span, format!("unknown parameter `{}`", key.name))
                .label("expected a parameter of this file")
                .help(suggest::advice(&key.name, "parameters", known)),
        );
    }
    let base = entry.base.iter().flat_map(|list| &list.entries);
    let values = base.filter_map(|one| {
        let (expression, value) = (one.expression.as_ref()?, one.value.as_ref()?);
        Some((expression.text.clone(), value.value))
    });
    values.collect()
}
