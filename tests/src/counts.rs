//! Operations of the bundled models as the page of benchmarks prints them, so that page, benchmark and test agree.

use std::collections::BTreeMap;

use modelmill_codegen::{Derivation, OperationCount, ProgramStage, StraightLineProgram};

use crate::fixtures::model_file;

/// Lowest counts of others, for inverse dynamics with base parameters and for the base regressor: OpenSYMORO, SymPyBotics,
/// wrenfold, sympy, and a plain unrolled recursion in which equal expressions are computed once.
pub const BEST_KNOWN: [(&str, [Option<usize>; 2]); 5] = [
    ("two_link", [Some(38), Some(26)]),
    ("puma560", [Some(539), Some(909)]),
    ("rx90", [Some(521), Some(887)]),
    ("panda", [Some(648), Some(1256)]),
    ("five_bar-tied-tool", [None, Some(130)]),
];

/// The best known counts of a model.
pub fn best_known(name: &str) -> [Option<usize>; 2] {
    let found = BEST_KNOWN.iter().find(|(known, _)| *known == name);
    found.map_or([None, None], |(_, counts)| *counts)
}

/// Names of the bundled models' files, in order.
pub fn bundled() -> Vec<String> {
    let folder = model_file("panda");
    let folder = folder.parent().expect("a file is in a folder");
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            let is_model = path.extension().is_some_and(|e| e == "toml");
            is_model.then(|| path.file_stem()?.to_str().map(str::to_owned))?
        })
        .collect();
    names.sort();
    names
}

/// Additions with subtractions and multiplications; in brackets divisions with roots, and pairs of sine and cosine.
pub fn text(count: &OperationCount) -> String {
    format!(
        "{} ({} / {} sc)",
        count.add + count.mul,
        count.div + count.sqrt,
        count.sincos
    )
}

/// A row of the page's table of models.
pub fn row(name: &str, derivation: &Derivation) -> Vec<String> {
    let (mechanism, reduction) = (&derivation.mechanism, &derivation.reduction);
    let passive = mechanism.coordinates.iter().filter(|c| c.passive).count();
    let of = |program: &StraightLineProgram| text(&program.count_operations(ProgramStage::State));
    let known = best_known(name).map(|n| n.map_or_else(|| "-".to_owned(), |n| n.to_string()));
    let [known_forces, known_columns] = known;
    let programs = &derivation.programs;
    vec![
        name.to_owned(),
        (mechanism.coordinates.len() - passive).to_string(),
        passive.to_string(),
        mechanism.parameters.len().to_string(),
        reduction.retained.len().to_string(),
        of(&programs.inverse_dynamics),
        known_forces,
        of(&programs.regressor),
        known_columns,
    ]
}

/// Headings of [`row`].
pub const HEADINGS: [&str; 9] = [
    "model",
    "active",
    "passive",
    "parameters",
    "base",
    "inverse dynamics",
    "best known",
    "base regressor",
    "best known",
];

/// The rows of a page's table that has these headings, by their first cells.
pub fn read(page: &str, headings: &[&str]) -> BTreeMap<String, Vec<String>> {
    let cells = |line: &str| -> Option<Vec<String>> {
        let inner = line.trim().strip_prefix('|')?.strip_suffix('|')?;
        Some(inner.split('|').map(|c| c.trim().to_owned()).collect())
    };
    let mut lines = page.lines();
    let found = lines.find(|line| cells(line).is_some_and(|c| c == headings));
    if found.is_none() {
        return BTreeMap::new();
    }
    lines
        .skip(1)
        .map_while(cells)
        .filter_map(|row| Some((row.first()?.clone(), row)))
        .collect()
}
