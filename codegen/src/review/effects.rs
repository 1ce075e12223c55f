//! Effects with what they add.

use modelmill_spec::{DriveKind, EffectPlace, Mechanism, ModelEffect};

use super::document::{InlineSpan, PageDocument, PageTable, TextLine, cell, code, text};
use crate::expr::Rational;
use crate::expr::print::{PrintedFormula, exact_formula_at};

/// Stands for the coordinate of each of several places.
const EACH: [&str; 4] = ["x", "xi", "chi", "place"];
/// Stands for the coordinate of the other of two places.
const OTHER: [&str; 4] = ["y", "eta", "psi", "other"];

/// Effects with their expressions.
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
    let each = free(EACH, "x_of_the_place");
    let other = free(OTHER, "x_of_the_other_place");
    page.heading("Effects");
    page.paragraph([
        text("Each adds to the force of its place; a linear drive's name stands for its length, "),
        code("load"),
        text(" for the force that the place carries. Where an effect acts at several places, "),
        InlineSpan::Math(PrintedFormula::name(&*each)),
        text(" stands for the coordinate of each of them. At a point the parameter is a mass."),
    ]);
    let is_coupled = |effect: &ModelEffect| {
        let mut terms = effect.terms.iter();
        effect.other.is_none()
            && terms.any(|term| {
                term.expression.mentions(
                &|symbol| matches!(symbol, modelmill_spec::ModelSymbol::Place(q) if q.is_other()),
            )
            })
    };
    if mechanism.effects.iter().any(is_coupled) {
        page.paragraph([
            text("Where an effect couples two places, "),
            InlineSpan::Math(PrintedFormula::name(&*other)),
            text(" stands for the coordinate of the other one."),
        ]);
    }
    let rows = mechanism
        .effects
        .iter()
        .map(|effect| {
            let mut places = TextLine::new();
            for (i, place) in effect.places.iter().enumerate() {
                if i > 0 {
                    places.push(text(", "));
                }
                places.push(code(mechanism.place_name(*place)));
            }
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

/// What an effect adds, as a formula where it is one, else in words.
fn effect_contribution(
    mechanism: &Mechanism,
    effect: &ModelEffect,
    each: &str,
    other: &str,
) -> TextLine {
    let names: Vec<PrintedFormula> = (effect.terms.iter())
        .map(|term| PrintedFormula::name(&*mechanism.parameters[term.parameter.0].name))
        .collect();
    let Some(mechanics) = effect.mechanics else {
        let name = |place: &EffectPlace| match place {
            EffectPlace::Drive(d) => match mechanism.drives[d.0].kind {
                DriveKind::Joint(c) => Some(&*mechanism.coordinates[c.0].name),
                DriveKind::Linear { .. } => Some(&*mechanism.drives[d.0].name),
            },
            EffectPlace::Coordinate(c) => Some(&*mechanism.coordinates[c.0].name),
            _ => None,
        };
        let x = match effect.places.as_slice() {
            [place] => name(place).unwrap_or(each),
            _ => each,
        };
        let other = effect.other.as_ref().and_then(name).unwrap_or(other);
        let terms = effect.terms.iter().zip(&names);
        let sum = PrintedFormula::sum(terms.map(|(term, parameter)| {
            let factor = exact_formula_at(mechanism, &term.expression, [x, other]);
            PrintedFormula::product(Rational::ONE, [parameter.clone(), factor])
        }));
        return cell(InlineSpan::Math(sum));
    };
    let listed: Vec<(&str, PrintedFormula)> = if names.is_empty() {
        let constants = effect.constants.iter().map(|(symbol, value)| {
            let value = exact_formula_at(mechanism, value, [each, other]);
            (mechanics.constant_label(symbol), value)
        });
        constants.collect()
    } else {
        names.into_iter().map(|name| ("", name)).collect()
    };
    let mut line = vec![text(mechanics.introduction())];
    for (i, (label, formula)) in listed.into_iter().enumerate() {
        let comma = if i == 0 { "" } else { ", " };
        if i > 0 || !label.is_empty() {
            line.push(text(format!("{comma}{label}")));
        }
        line.push(InlineSpan::Math(formula));
    }
    line
}
