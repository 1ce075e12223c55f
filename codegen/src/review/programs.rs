//! The programs as equations with named intermediate values, and what they cost.

use super::document::{Block, Document, Equation, Table, cell, code, text};
use super::equations::base_name;
use super::listing::{self, Listing};
use super::names::{Meaning, Meanings, reserved};
use crate::expr::print::Symbol;
use crate::lower::{OperationCount, Program, Stage};
use crate::{Derivation, PassivePosition};

/// Operation counts, then the programs.
pub(super) fn programs(page: &mut Document, derivation: &Derivation) {
    let Derivation {
        mechanism,
        programs,
        reduction,
        ..
    } = derivation;
    page.heading("Operations");
    page.paragraph([text(
        "Operations of the programs per state, and those that are done once for a geometry and its parameters. \
         Changes of sign are free.",
    )]);
    let mut rows = Vec::new();
    for (what, program) in [
        ("passive coordinates", &programs.passive),
        ("drives and their Jacobian", &programs.drives),
        ("H_min", &programs.regressor),
        ("inverse dynamics with p_min", &programs.inverse_dynamics),
        ("H, all products", &programs.full_regressor),
    ] {
        if program.outputs.is_empty() {
            continue;
        }
        for (stage, when) in [(Stage::State, "state"), (Stage::Fixed, "geometry")] {
            let count = program.count(stage);
            if stage == Stage::Fixed && count == OperationCount::default() {
                continue;
            }
            let mut row = vec![cell(text(what)), cell(text(when))];
            row.extend(
                [
                    count.add,
                    count.mul,
                    count.div,
                    count.sqrt,
                    count.sincos,
                    count.other,
                ]
                .map(|n| cell(text(n.to_string()))),
            );
            rows.push(row);
        }
    }
    let head = vec![
        "program", "per", "+ -", "*", "/", "sqrt", "sin cos", "other",
    ];
    page.blocks.push(Block::Table(Table { head, rows }));

    page.heading("Programs");
    page.paragraph([
        text("The programs step by step. "),
        code("s_"),
        text(" and "),
        code("c_"),
        text(
            " are sine and cosine; omega, its derivative and a are angular velocity, angular acceleration and acceleration \
             of the origin (gravity taken off) of a frame along its own axes, or along those of the frame named second; U takes a place in the frame to its \
             acceleration; r is the place of a point in the base frame, or its distance from the origin of a frame along the base frame's axes, \
             e leads along a linear drive; k is computed once per geometry, x is any other intermediate value.",
        ),
    ]);
    let meanings = Meanings::new(derivation);
    let taken = reserved(mechanism);
    let list = |program: &Program, outputs: &[Symbol], prefix: &str| {
        let mut names = meanings.of(program);
        names.retain(|_, meaning| !outputs.contains(&meaning.symbol));
        for (value, symbol) in program.outputs.iter().zip(outputs) {
            // An output with a meaning is called by it from the start.
            if is_motion(derivation, symbol) && !is_trivial(program, value.index()) {
                let meaning = Meaning {
                    symbol: symbol.clone(),
                    negative: false,
                };
                names.insert(value.index(), meaning);
            }
        }
        listing::list(program, mechanism, &names, &taken, outputs, prefix)
    };
    let (active, passive) = derivation.coordinates();
    if !passive.is_empty() && matches!(programs.passive_position, PassivePosition::Closed) {
        let outputs: Vec<Symbol> = (0..3)
            .flat_map(|order| {
                passive
                    .iter()
                    .map(move |p| Symbol::derived(&*mechanism.coordinates[*p].name, order))
            })
            .collect();
        fold(
            page,
            "Passive coordinates, their rates and accelerations",
            list(&programs.passive, &outputs, "P"),
        );
    }
    let drive = |d: &str| format!("l_{d}");
    let mut outputs: Vec<Symbol> = Vec::new();
    for order in 0..2 {
        outputs.extend(
            mechanism
                .drives
                .iter()
                .map(|d| Symbol::derived(drive(&d.name), order)),
        );
    }
    for d in &mechanism.drives {
        outputs.extend(
            active
                .iter()
                .map(|a| Symbol::new(format!("J_{}_{}", d.name, mechanism.coordinates[*a].name))),
        );
    }
    fold(
        page,
        "Drives and their Jacobian",
        list(&programs.drives, &outputs, "D"),
    );
    let rank = reduction.retained.len();
    let outputs: Vec<Symbol> = (0..mechanism.drives.len())
        .flat_map(|d| (0..rank).map(move |k| Symbol::new(format!("H_{}_{}", d + 1, k + 1))))
        .collect();
    let title = format!(
        "Regressor H_min: row by drive ({}), column by base parameter ({})",
        mechanism
            .drives
            .iter()
            .map(|d| &*d.name)
            .collect::<Vec<_>>()
            .join(", "),
        if rank == 1 {
            base_name(0)
        } else {
            format!("{} to {}", base_name(0), base_name(rank.max(1) - 1))
        },
    );
    fold(page, &title, list(&programs.regressor, &outputs, "H"));
}

/// Whether a name is that of a coordinate's or drive's motion rather than of an entry of H_min.
fn is_motion(derivation: &Derivation, symbol: &Symbol) -> bool {
    derivation
        .mechanism
        .coordinates
        .iter()
        .any(|c| c.name == symbol.name)
        || symbol.name.starts_with("l_")
        || symbol.name.starts_with("J_")
}

fn is_trivial(program: &Program, i: usize) -> bool {
    use crate::lower::Op;
    matches!(program.ops[i], Op::Number(_) | Op::Input(_) | Op::Neg(_))
}

fn fold(page: &mut Document, title: &str, listing: Listing) {
    let Listing { fixed, state } = listing;
    let mut blocks: Vec<Block> = Vec::new();
    let mut part = |says: &str, equations: Vec<Equation>| {
        if !equations.is_empty() {
            blocks.push(Block::Paragraph(vec![text(says)]));
            blocks.push(Block::Equations(equations));
        }
    };
    part("Once per geometry:", fixed);
    part("At every state:", state);
    page.blocks.push(Block::Folded(title.to_owned(), blocks));
}
