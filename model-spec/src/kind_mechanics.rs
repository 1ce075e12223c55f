//! Checks kinds with mechanics in place of an expression: their places, symbols and dimensions.

use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::document::TomlKey;
use crate::kinds::{ActsOn, PlaceLoad, can_carry};
use crate::mechanics::MechanicsSymbols;
use crate::schema::EffectKindEntry;
use crate::values::UnitByPlace;

/// Checks what a kind adds: an expression at places that allow one, or mechanics with their own symbols and places.
/// False if it has mechanics or is faulty, so that there is no expression to check.
pub(crate) fn check_expression_or_mechanics(entry: &EffectKindEntry, log: &mut DiagnosticLog) -> bool {
    // Messages point to the name of the kind, or to its table if it has none.
    let name_span = entry.name.as_ref().map_or(entry.span, |name| name.span);
    let mut places = entry.on.iter().flat_map(|on| &on.entries);
    // First case: no mechanics, so an expression is required, at places that have a force or a mass.
    let Some(way) = entry.mechanics else {
        let Some(expression) = &entry.expression else {
            if !entry.faulty && !log.syntax_broken {
                log.push(
                    Diagnostic::error(name_span, "a kind of effect lacks `expression`")
                        .label("expected what it adds")
                        .help("for example `expression = \"Fv*rate\"`"),
                );
            }
            return false;
        };
        // Parts, the base and the measured forces have no force that an expression could be added to.
        let elsewhere = places.find(|on| matches!(on, ActsOn::Part | ActsOn::Base | ActsOn::Force));
        if let (Some(found), Some(on)) = (elsewhere, &entry.on) {
            log.push(
                Diagnostic::error(on.span, "an expression cannot act here")
                    .label(format!("on {} there is nothing to add to", found.description()))
                    .help("expressions act on a drive, a coordinate or a point"),
            );
            return false;
        }
        // Without parameters there is nothing that a fit could estimate.
        if entry.parameters.is_none() && !entry.faulty && !log.syntax_broken {
            log.push(
                Diagnostic::error(expression.ast.span, "this expression has no parameters")
                    .label("expected `parameters` that can be identified")
                    .help("for example `parameters = { Fv = { unit = \"N s/m\" } }`"),
            );
        }
        return true;
    };
    // Second case: mechanics, which replace the expression and fix places and symbols.
    if let Some(expression) = &entry.expression {
        log.push(
            Diagnostic::error(expression.ast.span, "this kind defines its effect twice")
                .label("expected either `expression` or `mechanics`"),
        );
    }
    let way = way.entry();
    let on = way.acts_on();
    if let Some(found) = &entry.on
        && places.any(|place| *place != on)
    {
        log.push(
            Diagnostic::error(found.span, "these mechanics act elsewhere")
                .label(format!("expected only {}", on.description())),
        );
    }
    // The symbols of the file must be exactly those of the mechanics.
    check_symbols(entry, "parameters", way.parameters(), name_span, log);
    check_symbols(entry, "constants", way.constants(), name_span, log);
    false
}

/// Compares the symbols of a kind with mechanics with those that the mechanics require.
///
/// `what` is `parameters` or `constants`, and `expected` gives names with dimensions.
fn check_symbols(
    entry: &EffectKindEntry,
    what: &str,
    expected: MechanicsSymbols,
    name_span: SourceSpan,
    log: &mut DiagnosticLog,
) {
    // Both tables have the same form but different entry types.
    let found: Vec<(&TomlKey, Option<&UnitByPlace>)> = if what == "parameters" {
        let entries = entry.parameters.iter().flat_map(|table| &table.entries);
        entries.map(|(key, one)| (key, one.unit.as_ref())).collect()
    } else {
        let entries = entry.constants.iter().flat_map(|table| &table.entries);
        entries.map(|(key, one)| (key, one.unit.as_ref())).collect()
    };
    // Each symbol of the file must be known, with the right dimension.
    let names: Vec<&str> = expected.iter().map(|(name, _)| *name).collect();
    for (key, units) in &found {
        let Some((_, dimension)) = expected.iter().find(|(name, _)| *name == key.name) else {
            log.push(
                Diagnostic::error(key.span, format!("these mechanics have no `{}`", key.name)).label(
                    if names.is_empty() {
                        format!("they have no {what}")
                    } else {
                        format!("expected {}", names.join(", "))
                    },
                ),
            );
            continue;
        };
        // The unit of the first load that the kind can have is compared.
        let unit = units.and_then(|units| {
            PlaceLoad::ALL
                .into_iter()
                .filter(|carries| can_carry(entry, *carries))
                .find_map(|carries| carries.unit(units))
        });
        if unit.is_none_or(|unit| unit.dimension != *dimension) {
            log.push(
                Diagnostic::error(key.span, format!("the unit of `{}` does not fit", key.name))
                    .label(format!("expected {}", dimension.describe()))
                    .help(format!("write `unit = \"{dimension}\"`")),
            );
        }
    }
    // A faulty entry may contain the missing names, so nothing is reported as missing then.
    let lacking: Vec<&str> = names
        .into_iter()
        .filter(|name| !found.iter().any(|(key, _)| key.name == *name))
        .collect();
    if !lacking.is_empty() && !entry.faulty {
        log.push(
            Diagnostic::error(name_span, format!("these mechanics lack {what}"))
                .label(format!("expected {}", lacking.join(", "))),
        );
    }
}
