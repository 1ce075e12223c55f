//! The programs as equations with named intermediate values, and what they cost.

use std::collections::BTreeSet;

use modelmill_spec::{Drive, DriveKind};

use super::document::{Block, Document, Equation, Line, Table, cell, name, text};
use super::listing::{self, Listing};
use crate::expr::print::{Formula, Symbol};
use crate::lower::{OperationCount, Program, Stage};
use crate::names::{Meaning, Meanings, reserved};
use crate::reduce::base::name as base_name;
use crate::{Derivation, PassivePosition};

/// Operation counts, then the programs.
pub(super) fn programs(page: &mut Document, derivation: &Derivation) {
    let programs = &derivation.programs;
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
        ("p_min from parameters", &programs.base_parameters),
    ] {
        if program.outputs.is_empty() {
            continue;
        }
        for (stage, when) in [(Stage::State, "state"), (Stage::Fixed, "geometry")] {
            let count = program.count(stage);
            // A program that does nothing at a state, or nothing beforehand, needs no line for it.
            if count == OperationCount::default()
                && (stage == Stage::Fixed || program.count(Stage::Fixed) != count)
            {
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
    let listings = listings(derivation);
    page.paragraph([text(
        "The programs step by step. What is used once is put in place; what is shared has a name.",
    )]);
    legend(page, &listings);
    for (title, _, _, listing) in listings {
        fold(page, &title, listing);
    }
}

/// A title, the names of the outputs, the program, and its equations.
pub(super) type Listed<'a> = (String, Vec<Symbol>, &'a Program, Listing);

/// The programs that are shown.
pub(super) fn listings(derivation: &Derivation) -> Vec<Listed<'_>> {
    let Derivation {
        mechanism,
        programs,
        reduction,
        ..
    } = derivation;
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
    let mut listings = Vec::new();
    let (active, passive) = derivation.coordinates();
    if !passive.is_empty() && matches!(programs.passive_position, PassivePosition::Closed) {
        let outputs: Vec<Symbol> = (0..3)
            .flat_map(|order| {
                passive
                    .iter()
                    .map(move |p| Symbol::derived(&*mechanism.coordinates[*p].name, order))
            })
            .collect();
        listings.push((
            "Passive coordinates, their rates and accelerations",
            outputs,
            &programs.passive,
            "P",
        ));
    }
    let is_linear = |d: &Drive| matches!(d.kind, DriveKind::Linear { .. });
    if mechanism.drives.iter().any(is_linear) {
        let mut outputs: Vec<Symbol> = Vec::new();
        for order in 0..2 {
            let lengths = mechanism
                .drives
                .iter()
                .map(|d| Symbol::derived(format!("l_{}", d.name), order));
            outputs.extend(lengths);
        }
        for d in &mechanism.drives {
            let row = active
                .iter()
                .map(|a| Symbol::new(format!("J_{}_{}", d.name, mechanism.coordinates[*a].name)));
            outputs.extend(row);
        }
        listings.push(("Drives and their Jacobian", outputs, &programs.drives, "D"));
    }
    let rank = reduction.retained.len();
    let outputs: Vec<Symbol> = (0..mechanism.drives.len())
        .flat_map(|d| (0..rank).map(move |k| Symbol::new(format!("H_{}_{}", d + 1, k + 1))))
        .collect();
    let rows: Vec<&str> = mechanism.drives.iter().map(|d| &*d.name).collect();
    let columns = match rank {
        0 => "none".to_owned(),
        1 => base_name(0),
        n => format!("{} to {}", base_name(0), base_name(n - 1)),
    };
    let regressor = format!(
        "Regressor H_min: rows by drive ({}), columns by base parameter ({columns})",
        rows.join(", ")
    );
    listings.push((&*regressor, outputs, &programs.regressor, "H"));
    listings
        .into_iter()
        .map(|(title, outputs, program, prefix)| {
            let listing = list(program, &outputs, prefix);
            (title.to_owned(), outputs, program, listing)
        })
        .collect()
}

/// What the letters stand for; the first column is how their names begin.
const LETTERS: [(&[&str], &str); 10] = [
    (&["c", "s"], "cosine and sine of the angle in the index"),
    (
        &["omega"],
        "angular velocity of a frame along its own axes, and with a dot its angular acceleration",
    ),
    (
        &["a"],
        "acceleration of the origin of a frame, gravity taken off, along its own axes or those of the frame named second",
    ),
    (
        &["U"],
        "matrix that takes a place in a frame to its acceleration relative to the origin",
    ),
    (
        &["r"],
        "place of a point or a frame's origin; with two names, the way from the first to the second; along the base frame's axes",
    ),
    (&["e", "l"], "vector along a linear drive, and its length"),
    (&["J"], "derivative of a drive's length by a coordinate"),
    (
        &["Delta"],
        "determinant of a small linear system, and its inverse",
    ),
    (&["k"], "computed once for a geometry"),
    (&["x"], "any other intermediate value"),
];

/// Explains the letters that the listings use.
fn legend(page: &mut Document, listings: &[Listed<'_>]) {
    let mut used = BTreeSet::new();
    for (_, _, _, listing) in listings {
        for equation in listing.fixed.iter().chain(&listing.state) {
            if let Formula::Symbol(symbol) = &equation.left {
                let head = symbol.name.split('_').next().unwrap_or_default();
                used.insert(head.trim_end_matches(|c: char| c.is_ascii_digit()));
            }
        }
    }
    let rows = LETTERS
        .iter()
        .filter_map(|(letters, says)| {
            let mut line = Line::new();
            for letter in letters.iter().filter(|l| used.contains(**l)) {
                if !line.is_empty() {
                    line.push(text(", "));
                }
                line.push(name(letter));
            }
            (!line.is_empty()).then(|| vec![line, cell(text(*says))])
        })
        .collect();
    let head = vec!["letter", "meaning"];
    page.table("letters", Table { head, rows });
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
