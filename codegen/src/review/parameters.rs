//! The first sections of the page: a summary, and the tables of constants, parameters and coordinates.

use modelmill_spec::Mechanism;

use super::document::{InlineSpan, PageDocument, PageTable, cell, code, name, number, text, unit};
use crate::Derivation;
use crate::expr::print::{PrintedFormula, exact_formula};

/// The first paragraph: counts of bodies, coordinates, loops, drives, effects, products and base parameters.
pub(super) fn summary(page: &mut PageDocument, derivation: &Derivation) {
    let mechanism = &derivation.mechanism;
    let reduction = &derivation.reduction;
    // Counts with their noun in singular or plural.
    let count = |n: usize, one: &str, many: &str| match n {
        0 => format!("no {many}"),
        1 => format!("1 {one}"),
        n => format!("{n} {many}"),
    };
    // The number of passive coordinates is shown in parentheses.
    let passive = mechanism.coordinates.iter().filter(|c| c.passive).count();
    page.paragraph([
        text("Model "),
        code(&*mechanism.name),
        text(format!(
            ": {}, {} ({} passive), {}, {}, {}. {} of dynamic parameters act on the drives and regroup to {}.",
            count(
                mechanism.parts.len() + mechanism.lumped_masses.len(),
                "body or lumped mass",
                "bodies and lumped masses"
            ),
            count(mechanism.coordinates.len(), "coordinate", "coordinates"),
            passive,
            count(mechanism.loops.len(), "loop", "loops"),
            count(mechanism.drives.len(), "drive", "drives"),
            count(mechanism.effects.len(), "effect", "effects"),
            count(reduction.products.len(), "product", "products"),
            count(reduction.retained.len(), "base parameter", "base parameters"),
        )),
    ]);
}

/// The sections of constants with gravity, dynamic parameters and coordinates.
pub(super) fn quantities(page: &mut PageDocument, mechanism: &Mechanism) {
    if !mechanism.constants.is_empty() {
        page.heading("Constants");
    }
    // Notes of the model file explain the symbols.
    let remark = |note: &Option<String>| cell(text(note.clone().unwrap_or_default()));
    let rows = mechanism
        .constants
        .iter()
        .map(|c| {
            vec![
                cell(name(&c.name)),
                cell(text(number(c.value))),
                cell(unit(&*c.unit)),
                remark(&c.note),
            ]
        })
        .collect();
    // A model without constants has no table.
    let head = vec!["symbol", "value", "unit", "meaning"];
    page.table("constants", PageTable { head, rows });
    // Gravity is a vector of expressions in the model's constants.
    let gravity = mechanism.gravity.each_ref().map(|g| exact_formula(mechanism, g));
    // A model without gravity states so.
    if gravity.iter().all(PrintedFormula::is_zero) {
        page.paragraph([text("Gravity does not act.")]);
    } else {
        // The vector in the axes of the base.
        let [x, y, z] = gravity.map(InlineSpan::Math);
        page.paragraph([
            text("Gravity in the base frame: ("),
            x,
            text(", "),
            y,
            text(", "),
            z,
            text(") "),
            unit("m/s^2"),
            text("."),
        ]);
    }
    // Nominal values as in the model file.
    page.heading("Dynamic parameters");
    let rows = mechanism
        .parameters
        .iter()
        .map(|p| {
            vec![
                cell(name(&p.name)),
                cell(text(number(p.nominal))),
                cell(unit(&*p.unit)),
                remark(&p.note),
            ]
        })
        .collect();
    let head = vec!["symbol", "nominal", "unit", "meaning"];
    page.table("parameters", PageTable { head, rows });
    // The role states which coordinates are inputs of the programs.
    page.heading("Coordinates");
    // A coordinate with a coupling is a given function of others.
    let follows = |i: usize| {
        let mut couplings = mechanism.couplings.iter();
        couplings.any(|coupling| coupling.coordinate.0 == i)
    };
    let rows = mechanism
        .coordinates
        .iter()
        .enumerate()
        .map(|(i, c)| {
            let in_unit = c.motion.unit();
            // Angles are in rad, lengths in m.
            let kind = if c.motion.is_angle() { "angle" } else { "length" };
            // Coupled and passive coordinates are computed. All others, the active ones, are independent inputs.
            let role = if follows(i) {
                "passive, coupled to others"
            } else if c.passive {
                "passive, determined by loop closure"
            } else {
                "independent"
            };
            vec![
                cell(name(&c.name)),
                cell(text(kind)),
                // Six decimals without trailing zeros.
                cell(text(
                    format!("{:.6}", c.nominal).trim_end_matches('0').trim_end_matches('.'),
                )),
                cell(unit(in_unit)),
                cell(text(role)),
            ]
        })
        .collect();
    let head = vec!["symbol", "kind", "nominal", "unit", "role"];
    page.table("coordinates", PageTable { head, rows });
}
