//! The programs as equations with named intermediate values, and what they cost.

use std::collections::BTreeSet;

use modelmill_spec::{DriveKind, ModelDrive};

use super::document::{
    PageBlock, PageDocument, PageEquation, PageTable, TextLine, cell, name, text,
};
use super::listing::{self, ProgramListing};
use crate::expr::print::{FormulaSymbol, PrintedFormula};
use crate::lower::{OperationCount, ProgramStage, StraightLineProgram};
use crate::names::{NamedQuantities, QuantityName, reserved_names};
use crate::reduce::base::base_parameter_name as base_name;
use crate::{Derivation, PassivePosition};

/// Operation counts, then the programs.
pub(super) fn programs(page: &mut PageDocument, derivation: &Derivation) {
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
        for (stage, when) in [
            (ProgramStage::State, "state"),
            (ProgramStage::Fixed, "geometry"),
        ] {
            let count = program.count_operations(stage);
            // A program that does nothing at a state, or nothing beforehand, needs no line for it.
            if count == OperationCount::default()
                && (stage == ProgramStage::Fixed
                    || program.count_operations(ProgramStage::Fixed) != count)
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
    page.blocks.push(PageBlock::Table(PageTable { head, rows }));

    page.heading("Programs");
    let listings = listings(derivation);
    page.paragraph([text(
        "The programs step by step. What is used once is put in place; what is shared has a name.",
    )]);
    add_legend(page, &listings);
    for (title, _, _, listing) in listings {
        add_folded_listing(page, &title, listing);
    }
}

/// A title, the names of the outputs, the program, and its equations.
pub(super) type ListedProgram<'a> = (
    String,
    Vec<FormulaSymbol>,
    &'a StraightLineProgram,
    ProgramListing,
);

/// The programs that are shown.
pub(super) fn listings(derivation: &Derivation) -> Vec<ListedProgram<'_>> {
    let Derivation {
        mechanism,
        programs,
        reduction,
        ..
    } = derivation;
    let meanings = NamedQuantities::new(derivation);
    let taken = reserved_names(mechanism);
    let list = |program: &StraightLineProgram, outputs: &[FormulaSymbol], prefix: &str| {
        let mut names = meanings.name_values(program);
        names.retain(|_, meaning| !outputs.contains(&meaning.symbol));
        for (value, symbol) in program.outputs.iter().zip(outputs) {
            // An output with a meaning is called by it from the start.
            if is_motion(derivation, symbol) && !is_trivial(program, value.index()) {
                let meaning = QuantityName {
                    symbol: symbol.clone(),
                    negative: false,
                };
                names.insert(value.index(), meaning);
            }
        }
        listing::list_program(program, mechanism, &names, &taken, outputs, prefix)
    };
    let mut listings = Vec::new();
    let (active, passive) = derivation.coordinates();
    if !passive.is_empty() && matches!(programs.passive_position, PassivePosition::Closed) {
        let outputs: Vec<FormulaSymbol> = (0..3)
            .flat_map(|order| {
                passive.iter().map(move |p| {
                    FormulaSymbol::time_derivative(&*mechanism.coordinates[*p].name, order)
                })
            })
            .collect();
        listings.push((
            "Passive coordinates, their rates and accelerations",
            outputs,
            &programs.passive,
            "P",
        ));
    }
    let is_linear = |d: &ModelDrive| matches!(d.kind, DriveKind::Linear { .. });
    if mechanism.drives.iter().any(is_linear) {
        let mut outputs: Vec<FormulaSymbol> = Vec::new();
        for order in 0..2 {
            let lengths = mechanism
                .drives
                .iter()
                .map(|d| FormulaSymbol::time_derivative(format!("l_{}", d.name), order));
            outputs.extend(lengths);
        }
        for d in &mechanism.drives {
            let row = active.iter().map(|a| {
                FormulaSymbol::new(format!("J_{}_{}", d.name, mechanism.coordinates[*a].name))
            });
            outputs.extend(row);
        }
        listings.push(("Drives and their Jacobian", outputs, &programs.drives, "D"));
    }
    let rank = reduction.retained.len();
    let outputs: Vec<FormulaSymbol> = (0..mechanism.drives.len())
        .flat_map(|d| (0..rank).map(move |k| FormulaSymbol::new(format!("H_{}_{}", d + 1, k + 1))))
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
fn add_legend(page: &mut PageDocument, listings: &[ListedProgram<'_>]) {
    let mut used = BTreeSet::new();
    for (_, _, _, listing) in listings {
        for equation in listing.fixed.iter().chain(&listing.state) {
            if let PrintedFormula::Symbol(symbol) = &equation.left {
                let head = symbol.name.split('_').next().unwrap_or_default();
                used.insert(head.trim_end_matches(|c: char| c.is_ascii_digit()));
            }
        }
    }
    let rows = LETTERS
        .iter()
        .filter_map(|(letters, says)| {
            let mut line = TextLine::new();
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
    page.table("letters", PageTable { head, rows });
}

/// Whether a name is that of a coordinate's or drive's motion rather than of an entry of H_min.
fn is_motion(derivation: &Derivation, symbol: &FormulaSymbol) -> bool {
    derivation
        .mechanism
        .coordinates
        .iter()
        .any(|c| c.name == symbol.name)
        || symbol.name.starts_with("l_")
        || symbol.name.starts_with("J_")
}

fn is_trivial(program: &StraightLineProgram, i: usize) -> bool {
    use crate::lower::ProgramOp;
    matches!(
        program.ops[i],
        ProgramOp::Number(_) | ProgramOp::Input(_) | ProgramOp::Neg(_)
    )
}

fn add_folded_listing(page: &mut PageDocument, title: &str, listing: ProgramListing) {
    let ProgramListing { fixed, state } = listing;
    let mut blocks: Vec<PageBlock> = Vec::new();
    let mut part = |says: &str, equations: Vec<PageEquation>| {
        if !equations.is_empty() {
            blocks.push(PageBlock::Paragraph(vec![text(says)]));
            blocks.push(PageBlock::Equations(equations));
        }
    };
    part("Once per geometry:", fixed);
    part("At every state:", state);
    page.blocks
        .push(PageBlock::Folded(title.to_owned(), blocks));
}
