//! The section of effects: a table of their places and of the force that each adds.

use modelmill_spec::{DriveKind, EffectPlace, Mechanism, ModelEffect, ModelSymbol, PlaceQuantity};

use super::document::{InlineSpan, PageDocument, PageTable, TextLine, cell, code, text};
use crate::expr::Rational;
use crate::expr::print::{PrintedFormula, exact_formula_at};

/// Symbols for the coordinate of an effect with several places; the first that the model does not use is taken.
const EACH: [&str; 4] = ["x", "xi", "chi", "place"];
/// Symbols for the coordinate of the other place of an effect that couples two.
const OTHER: [&str; 4] = ["y", "eta", "psi", "other"];

/// Adds the section, if the model has effects.
pub(super) fn effects(page: &mut PageDocument, mechanism: &Mechanism) {
    if mechanism.effects.is_empty() {
        return;
    }
    // A coordinate or constant of the model may have that name.
    let taken = crate::names::reserved_names(mechanism);
    let free = |names: [&str; 4], last: &str| {
        let found = names.into_iter().find(|name| !taken.contains(*name));
        found.unwrap_or(last).to_owned()
    };
    // Fallbacks are long, so that no model uses them by chance.
    let each = free(EACH, "x_of_the_place");
    let other = free(OTHER, "x_of_the_other_place");
    // How the table is read.
    page.heading("Effects");
    page.paragraph(introduction(mechanism, &each));
    // An effect with a fixed `other` names that place in its row; only the others need a symbol for it.
    let is_coupled = |effect: &ModelEffect| {
        let mut terms = effect.terms.iter();
        effect.other.is_none()
            && terms.any(|term| {
                term.expression
                    .mentions(&|symbol| matches!(symbol, ModelSymbol::Place(q) if q.is_other()))
            })
    };
    if mechanism.effects.iter().any(is_coupled) {
        page.paragraph([
            text("If an effect couples two places, "),
            InlineSpan::Math(PrintedFormula::name(&*other)),
            text(" stands for the coordinate of the other one."),
        ]);
    }
    // One row per effect: kind, places, contribution.
    let rows = mechanism
        .effects
        .iter()
        .map(|effect| {
            // Places by their names in the model file.
            let mut places = TextLine::new();
            for (i, place) in effect.places.iter().enumerate() {
                if i > 0 {
                    places.push(text(", "));
                }
                places.push(code(mechanism.place_name(*place)));
            }
            // The second place of a coupling.
            if let Some(other) = effect.other {
                places.push(text(", by "));
                places.push(code(mechanism.place_name(other)));
            }
            vec![
                cell(text(effect.kind.replace('_', " "))),
                places,
                effect_contribution(mechanism, effect, &each, &other),
            ]
        })
        .collect();
    let head = vec!["effect", "at", "adds"];
    page.table("effects", PageTable { head, rows });
}

/// How the table is read. Only symbols that the table contains are explained; `each` is the one for the coordinate of
/// an effect with several places.
fn introduction(mechanism: &Mechanism, each: &str) -> TextLine {
    // Effects with mechanics are described in words, without these symbols.
    let by_expression = || mechanism.effects.iter().filter(|effect| effect.mechanics.is_none());
    let mentions = |effect: &ModelEffect, is_wanted: &dyn Fn(PlaceQuantity) -> bool| {
        let is_place = |symbol: ModelSymbol| matches!(symbol, ModelSymbol::Place(quantity) if is_wanted(quantity));
        effect.terms.iter().any(|term| term.expression.mentions(&is_place))
    };
    let is_motion = |quantity: PlaceQuantity| quantity != PlaceQuantity::Load && !quantity.is_other();
    let mut line = vec![text(
        "Each effect adds its force, or its inertia and weight, at its place.",
    )];
    let mut drives = mechanism.drives.iter();
    if by_expression().next().is_some() && drives.any(|drive| matches!(drive.kind, DriveKind::Linear { .. })) {
        line.push(text(
            " In the expressions below, the name of a linear drive means its length.",
        ));
    }
    if by_expression().any(|effect| mentions(effect, &|quantity| quantity == PlaceQuantity::Load)) {
        line.push(text(" The symbol "));
        line.push(code("load"));
        line.push(text(" stands for the force that the place transmits."));
    }
    if by_expression().any(|effect| effect.places.len() > 1 && mentions(effect, &is_motion)) {
        line.push(text(" If an effect acts at several places, "));
        line.push(InlineSpan::Math(PrintedFormula::name(each)));
        line.push(text(" stands for the coordinate of each of them."));
    }
    let is_at_point = |effect: &ModelEffect| effect.places.iter().any(|place| matches!(place, EffectPlace::Point(_)));
    if by_expression().any(is_at_point) {
        line.push(text(" At a point, the parameter is a mass."));
    }
    line
}

/// The contribution of an effect to the force: a sum of parameter times expression, or a text if it is a piece of
/// mechanics.
fn effect_contribution(mechanism: &Mechanism, effect: &ModelEffect, each: &str, other: &str) -> TextLine {
    // The parameters of the effect, one per term.
    let names: Vec<PrintedFormula> = (effect.terms.iter())
        .map(|term| PrintedFormula::name(&*mechanism.parameters[term.parameter.0].name))
        .collect();
    // Effects without mechanics are expressions of the motion at their place.
    let Some(mechanics) = effect.mechanics else {
        // A joint is named by its coordinate, a linear drive by its length.
        let name = |place: &EffectPlace| match place {
            EffectPlace::Drive(d) => match mechanism.drives[d.0].kind {
                DriveKind::Joint(c) => Some(&*mechanism.coordinates[c.0].name),
                DriveKind::Linear { .. } => Some(&*mechanism.drives[d.0].name),
            },
            EffectPlace::Coordinate(c) => Some(&*mechanism.coordinates[c.0].name),
            _ => None,
        };
        // A single place is named by its own coordinate or length.
        let x = match effect.places.as_slice() {
            [place] => name(place).unwrap_or(each),
            _ => each,
        };
        // The other place by its own name, if it has one.
        let other = effect.other.as_ref().and_then(name).unwrap_or(other);
        // The sum of parameter times expression.
        let terms = effect.terms.iter().zip(&names);
        let sum = PrintedFormula::sum(terms.map(|(term, parameter)| {
            let factor = exact_formula_at(mechanism, &term.expression, [x, other]);
            PrintedFormula::product(Rational::ONE, [parameter.clone(), factor])
        }));
        return cell(InlineSpan::Math(sum));
    };
    // Mechanics is described by its parameters, or by its constants if it has no parameters.
    let listed: Vec<(&str, PrintedFormula)> = if names.is_empty() {
        let constants = effect.constants.iter().map(|(symbol, value)| {
            let value = exact_formula_at(mechanism, value, [each, other]);
            (mechanics.constant_label(symbol), value)
        });
        constants.collect()
    } else {
        names.into_iter().map(|name| ("", name)).collect()
    };
    // The introduction of the mechanics, followed by the list.
    let mut line = vec![text(mechanics.introduction())];
    for (i, (label, formula)) in listed.into_iter().enumerate() {
        // The list is separated by commas.
        let comma = if i == 0 { "" } else { ", " };
        if i > 0 || !label.is_empty() {
            line.push(text(format!("{comma}{label}")));
        }
        line.push(InlineSpan::Math(formula));
    }
    line
}
