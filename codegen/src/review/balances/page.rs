//! The page of the balances: the body, the balances with vectors, by components, and the meaning of all symbols.

use super::equations::BalanceEquations;
use super::vectors::VectorComponents;
use crate::Derivation;
use crate::review::document::{InlineSpan, PageDocument, PageTable, TextLine, cell, code, name, text, unit};

/// Composes the page.
pub(super) fn compose(derivation: &Derivation, equations: &BalanceEquations<'_>) -> PageDocument {
    let mechanism = &derivation.mechanism;
    let title = mechanism.title.clone().unwrap_or_else(|| mechanism.name.clone());
    let mut page = PageDocument {
        title: format!("{title}: balances of {}", equations.geometry.part),
        blocks: Vec::new(),
    };
    describe_body(&mut page, derivation, equations);
    page.heading("Balances");
    page.paragraph([
        text("Left: rates of momentum and of angular momentum about O. Right: what acts on the body. "),
        text("cross(a, b) is the cross product of two vectors. "),
        text("They have the form of eq. (2) and (3) of the paper that "),
        code("modelmill experiment"),
        text(" reproduces."),
    ]);
    page.equations("balances", equations.with_vectors.clone());
    page.heading("Components");
    page.paragraph(match equations.geometry.normal {
        Some(_) => vec![text(
            "All motion is in one plane, so that three equations describe the body. \
             The other three concern forces across that plane alone.",
        )],
        None => vec![
            text("The same by components along the axes of "),
            code(equations.geometry.axes_name()),
            text("."),
        ],
    });
    page.equations("components", equations.by_components.clone());
    describe_vectors(&mut page, equations);
    if !equations.definitions.is_empty() {
        page.heading("Known components");
        page.paragraph([text(
            "Lever arms, accelerations and other known components as functions of coordinates, rates and \
             accelerations. Those of passive coordinates follow from the loops.",
        )]);
        page.equations("components", equations.definitions.clone());
    }
    page
}

/// The section that describes the body.
fn describe_body(page: &mut PageDocument, derivation: &Derivation, equations: &BalanceEquations<'_>) {
    let mechanism = &derivation.mechanism;
    let geometry = &equations.geometry;
    page.heading("Body");
    let mut line: TextLine = vec![text("The body that is cut free consists of frame ")];
    for (i, frame) in geometry.frames().into_iter().enumerate() {
        if i > 0 {
            line.push(text(", "));
        }
        line.push(code(&*mechanism.frames[frame].name));
    }
    line.push(text(
        ". All moments are about O, the origin of the body behind the joint of ",
    ));
    line.push(code(&*geometry.names[geometry.root]));
    line.push(text(". All components are along the axes of "));
    line.push(code(geometry.axes_name()));
    line.push(text("."));
    page.paragraph(line);
    if equations.has_two_points {
        page.paragraph([text(
            "Note: a mass is at different points in the balance of forces and in the balance of moments. \
             This is not a rigid body; the model file states it so.",
        )]);
    }
    if !mechanism.shared_drives.is_empty() {
        page.paragraph([text(
            "Note: the model has more drives than degrees of freedom. \
             Their forces are part of the moments and forces of the joints here.",
        )]);
    }
}

/// The tables of unknown and known vectors.
fn describe_vectors(page: &mut PageDocument, equations: &BalanceEquations<'_>) {
    let rows = |is_known: bool| -> Vec<Vec<TextLine>> {
        let vectors = equations.vectors.vectors.iter();
        let vectors = vectors.filter(|v| matches!(v.components, VectorComponents::Known(_)) == is_known);
        vectors
            .map(|v| vec![cell(name(&v.symbol)), cell(unit(v.unit)), cell(text(&*v.meaning))])
            .collect()
    };
    page.heading("Symbols");
    page.paragraph([
        text("Forces and moments between bodies. A symbol with an axis behind it, such as "),
        axis_example(equations),
        text(", is a component."),
    ]);
    let scalars = equations.scalars.iter();
    let mut unknown = rows(false);
    unknown.extend(scalars.map(|scalar| {
        vec![
            cell(name(&scalar.symbol)),
            cell(unit("N")),
            cell(text(&*scalar.meaning)),
        ]
    }));
    let head = vec!["symbol", "unit", "meaning"];
    page.table(
        "unknown forces and moments",
        PageTable {
            head: head.clone(),
            rows: unknown,
        },
    );
    page.paragraph([text("Known quantities.")]);
    let mut known = rows(true);
    let described = equations.described().into_iter();
    known.extend(described.map(|(symbol, of, meaning)| vec![cell(name(symbol)), cell(unit(of)), cell(text(meaning))]));
    page.table("known quantities", PageTable { head, rows: known });
}

/// The first component of the first force, as an example.
fn axis_example(equations: &BalanceEquations<'_>) -> InlineSpan {
    let vectors = &equations.vectors.vectors;
    let unknown = vectors
        .iter()
        .find(|v| matches!(v.components, VectorComponents::Unknown(_)));
    let axis = super::vectors::AXES[equations.geometry.force_axes()[0]];
    name(&format!("{}_{axis}", unknown.map_or("f", |v| v.symbol.as_str())))
}
