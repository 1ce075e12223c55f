//! The sections of operation counts and of the programs as equations with named intermediate values.

use std::collections::BTreeSet;

use modelmill_spec::{DriveKind, ModelDrive};

use super::document::{PageBlock, PageDocument, PageEquation, PageTable, TextLine, cell, name, text};
use super::listing::{self, ProgramListing};
use crate::expr::print::{FormulaSymbol, PrintedFormula};
use crate::lower::{OperationCount, ProgramStage, StraightLineProgram};
use crate::names::{NamedQuantities, QuantityName, reserved_names};
use crate::reduce::base::base_parameter_name as base_name;
use crate::{Derivation, PassivePosition};

/// Adds the table of operation counts, then a folded listing per program.
pub(super) fn programs(page: &mut PageDocument, derivation: &Derivation) {
    let programs = &derivation.programs;
    page.heading("Operations");
    page.paragraph([text(
        "Arithmetic operations of each calculation: per state, and per change of constants or parameters (geometry). Sign changes are not \
         counted.",
    )]);
    // Two rows per program: per state, and once per geometry.
    let mut rows = Vec::new();
    for (what, program) in [
        ("passive coordinates", &programs.passive),
        ("drives and their Jacobian", &programs.drives),
        ("H_min", &programs.regressor),
        ("inverse dynamics with p_min", &programs.inverse_dynamics),
        ("H, all products", &programs.full_regressor),
        ("p_min from parameters", &programs.base_parameters),
    ] {
        // A model without loops has no program for passive coordinates.
        if program.outputs.is_empty() {
            continue;
        }
        for (stage, when) in [(ProgramStage::State, "state"), (ProgramStage::Fixed, "geometry")] {
            // Operations by kind.
            let count = program.count_operations(stage);
            // A program that does nothing at a state, or nothing beforehand, needs no line for it.
            if count == OperationCount::default()
                && (stage == ProgramStage::Fixed || program.count_operations(ProgramStage::Fixed) != count)
            {
                continue;
            }
            let mut row = vec![cell(text(what)), cell(text(when))];
            // One column per kind of operation.
            row.extend(
                [count.add, count.mul, count.div, count.sqrt, count.sincos, count.other]
                    .map(|n| cell(text(n.to_string()))),
            );
            rows.push(row);
        }
    }
    let head = vec!["program", "per", "+ -", "*", "/", "sqrt", "sin cos", "other"];
    page.blocks.push(PageBlock::Table(PageTable { head, rows }));

    // The legend comes first, then one folded listing per program.
    page.heading("Programs");
    let listings = listings(derivation);
    page.paragraph([text(
        "The programs step by step. Intermediate results used more than once have names; the others are written inline.",
    )]);
    add_legend(page, &listings);
    for (title, _, _, listing) in listings {
        add_folded_listing(page, &title, listing);
    }
}

/// A listing with its title, the symbols of the outputs and the program that it shows.
pub(super) type ListedProgram<'a> = (String, Vec<FormulaSymbol>, &'a StraightLineProgram, ProgramListing);

/// The programs that the page lists: passive coordinates, drives, regressor. Those that the model does not need are
/// left out.
pub(super) fn listings(derivation: &Derivation) -> Vec<ListedProgram<'_>> {
    let Derivation {
        mechanism,
        programs,
        reduction,
        ..
    } = derivation;
    // Known quantities are recognised by their values at a random state.
    let meanings = NamedQuantities::new(derivation);
    let taken = reserved_names(mechanism);
    // Names of quantities apply within a program; symbols of outputs take precedence.
    let list = |program: &StraightLineProgram, outputs: &[FormulaSymbol], prefix: &str| {
        let mut names = meanings.name_values(program);
        // An output keeps its own symbol.
        names.retain(|_, meaning| !outputs.contains(&meaning.symbol));
        // Outputs that are motions of coordinates or drives get their symbol where they are computed.
        for (value, symbol) in program.outputs.iter().zip(outputs) {
            // Later equations of the program then refer to the output by its symbol.
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
    // Passive coordinates with rates and accelerations exist as a program only if loops close in closed form.
    let (active, passive) = derivation.coordinates();
    if !passive.is_empty() && matches!(programs.passive_position, PassivePosition::Closed) {
        let outputs: Vec<FormulaSymbol> = (0..3)
            .flat_map(|order| {
                passive
                    .iter()
                    .map(move |p| FormulaSymbol::time_derivative(&*mechanism.coordinates[*p].name, order))
            })
            .collect();
        listings.push((
            "Passive coordinates, their rates and accelerations",
            outputs,
            &programs.passive,
            "Q",
        ));
    }
    // Lengths and their rates, then the Jacobian row by row.
    let is_linear = |d: &ModelDrive| matches!(d.kind, DriveKind::Linear { .. });
    if mechanism.drives.iter().any(is_linear) {
        // Outputs in the order of the program.
        let mut outputs: Vec<FormulaSymbol> = Vec::new();
        // Lengths, then their rates.
        for order in 0..2 {
            let lengths = mechanism
                .drives
                .iter()
                .map(|d| FormulaSymbol::time_derivative(format!("l_{}", d.name), order));
            outputs.extend(lengths);
        }
        for d in &mechanism.drives {
            // One entry of the Jacobian per active coordinate.
            let row = active
                .iter()
                .map(|a| FormulaSymbol::new(format!("J_{}_{}", d.name, mechanism.coordinates[*a].name)));
            outputs.extend(row);
        }
        listings.push(("Drives and their Jacobian", outputs, &programs.drives, "J"));
    }
    // The regressor, row by row.
    let rank = reduction.retained.len();
    let outputs: Vec<FormulaSymbol> = (0..mechanism.drives.len())
        .flat_map(|d| (0..rank).map(move |k| FormulaSymbol::new(format!("H_{}_{}", d + 1, k + 1))))
        .collect();
    let rows: Vec<&str> = mechanism.drives.iter().map(|d| &*d.name).collect();
    // The title names the first and the last column.
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

/// Legend of symbols; the first field lists the beginnings of names that a text explains.
const LETTERS: [(&[&str], &str); 10] = [
    (&["c", "s"], "cosine and sine of the angle in the index"),
    (
        &["omega"],
        "angular velocity of a frame in its own axes; with a dot, its angular acceleration",
    ),
    (
        &["a"],
        "acceleration of the frame's origin minus gravity, in its own axes (or, with two indices, in the axes of the second frame)",
    ),
    (
        &["U"],
        "matrix that maps a point of a frame to its acceleration relative to the frame's origin",
    ),
    (
        &["r"],
        "position of a point or a frame's origin, in the base frame's axes; with two names, the vector from the first to the second",
    ),
    (&["e", "l"], "vector along a linear drive, and its length"),
    (&["J"], "derivative of a drive's length with respect to a coordinate"),
    (
        &["Delta"],
        "determinant of a small linear system; with the index inv, its reciprocal",
    ),
    (&["k"], "value computed once per geometry"),
    (&["x"], "any other intermediate value"),
];

/// Adds a legend of the symbols that the listings use.
fn add_legend(page: &mut PageDocument, listings: &[ListedProgram<'_>]) {
    // The beginning of a name: the part before the first underscore, without digits.
    let mut used = BTreeSet::new();
    // Symbols on the left of all equations.
    for (_, _, _, listing) in listings {
        for equation in listing.fixed.iter().chain(&listing.state) {
            if let PrintedFormula::Symbol(symbol) = &equation.left {
                // Names such as `omega_S3_z` begin with the letter.
                let head = symbol.name.split('_').next().unwrap_or_default();
                used.insert(head.trim_end_matches(|c: char| c.is_ascii_digit()));
            }
        }
    }
    let rows = LETTERS
        .iter()
        .filter_map(|(letters, says)| {
            // Symbols that share a meaning are listed together.
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

/// Whether a symbol is a coordinate, drive length or Jacobian entry, and not an entry of H_min.
fn is_motion(derivation: &Derivation, symbol: &FormulaSymbol) -> bool {
    derivation.mechanism.coordinates.iter().any(|c| c.name == symbol.name)
        || symbol.name.starts_with("l_")
        || symbol.name.starts_with("J_")
}

/// Whether a value is a number, an input or a change of sign, which needs no equation.
fn is_trivial(program: &StraightLineProgram, i: usize) -> bool {
    use crate::lower::ProgramOp;
    matches!(
        program.ops[i],
        ProgramOp::Number(_) | ProgramOp::Input(_) | ProgramOp::Neg(_)
    )
}

/// Adds a folded block with the equations of both stages.
fn add_folded_listing(page: &mut PageDocument, title: &str, listing: ProgramListing) {
    // Fixed equations first, because those of a state refer to them.
    let ProgramListing { fixed, state } = listing;
    let mut blocks: Vec<PageBlock> = Vec::new();
    // A stage without equations has no heading.
    let mut part = |says: &str, equations: Vec<PageEquation>| {
        if !equations.is_empty() {
            blocks.push(PageBlock::Paragraph(vec![text(says)]));
            blocks.push(PageBlock::Equations(equations));
        }
    };
    part("Once per geometry:", fixed);
    part("At every state:", state);
    page.blocks.push(PageBlock::Folded(title.to_owned(), blocks));
}
