//! A proposal for `[recording.columns]`: a recording and a model go in, the column of each name of the model comes out.
//!
//! Columns are paired by what their names and units say, by which one is the rate of another, and by how much of a force
//! the model can explain. Each pair states its evidence; a name without a column is listed as missing.

mod fit;
mod pairing;
mod signals;
mod thresholds;
pub(super) mod words;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use modelmill_identify::{ReadOptions, RecordingFile, RecordingFiles};

use crate::error::Outcome;
use crate::model::Model;
use pairing::ColumnPairing;
use signals::FileSignal;

/// Most columns that are compared with the model's names; longer lists are those of trajectories and images.
const MOST_COLUMNS: usize = 500;

/// A column of a recording that is proposed for a name of the model.
#[derive(Clone, Debug, PartialEq)]
pub struct ProposedColumn {
    /// The name in the model.
    pub name: String,
    /// The column of the recording, with sign and unit if they are needed, such as `-tau1 [N mm]`.
    pub column: String,
    /// Why it is proposed.
    pub reason: String,
    /// Whether the evidence is weak, so that the pair must be checked.
    pub is_guess: bool,
}

/// The columns of a recording for the names of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnProposal {
    /// Name of the model.
    pub model: String,
    /// The pairs, in the order of the model's names.
    pub columns: Vec<ProposedColumn>,
    /// Names that need a column, but have none.
    pub missing: Vec<String>,
    /// Remarks on the proposal.
    pub remarks: Vec<String>,
}

impl Model {
    /// Proposes columns of a recording for the names of the model. Several files are those of one run.
    ///
    /// Fails when a file cannot be read.
    pub fn propose_columns(&self, paths: &[&Path]) -> Outcome<ColumnProposal> {
        let files = RecordingFiles::open(self.host().files(), paths)?;
        let says = format!("pairing the columns of {}", files.name());
        self.host().run_job(&says, 0, |_| {
            let (signals, remarks) = read_signals(self, paths, &files)?;
            let mut pairing = ColumnPairing::new(self, signals);
            pairing.remarks = remarks;
            pairing.pair_all()?;
            Ok(pairing.into_proposal())
        })?
    }
}

/// Columns of numbers with as many of them as can be read together, and remarks on those that cannot.
fn read_signals(model: &Model, paths: &[&Path], files: &RecordingFiles) -> Outcome<(Vec<FileSignal>, Vec<String>)> {
    // Topics of a log have times of their own; only those with signals of a model are joined.
    let mut names = Vec::new();
    for path in paths {
        let file = RecordingFile::open(model.host().files(), path)?;
        for table in file.tables()? {
            let columns = table.columns.iter();
            let columns = columns.filter(|column| column.kind != "text" && column.kind != "no number");
            let columns: Vec<String> = columns.map(|column| column.name.clone()).collect();
            if table.name.is_empty() || pairing::has_signals(&columns) {
                names.extend(columns);
            }
        }
    }
    let all: BTreeSet<String> = files.names()?.into_iter().collect();
    // Logs have a time that is in no table.
    if all.contains("t") && !names.iter().any(|name| name == "t") {
        names.insert(0, "t".to_owned());
    }
    // A name in several files is unique with the name of its file.
    let mut counts: BTreeMap<&String, usize> = BTreeMap::new();
    for name in &names {
        *counts.entry(name).or_insert(0) += 1;
    }
    let shared: Vec<String> = (counts.iter())
        .filter(|(name, count)| **count > 1 && **name != "t")
        .map(|(name, _)| format!(".{name}"))
        .collect();
    let is_qualified = |name: &String| shared.iter().any(|ending| name.ends_with(ending));
    let is_clear = |name: &&String| all.contains(*name) && (counts[*name] == 1 || *name == "t");
    let mut seen = BTreeSet::new();
    let names: Vec<String> = (names.iter().filter(is_clear))
        .chain(all.iter().filter(|name| is_qualified(name)))
        .filter(|name| seen.insert((*name).clone()))
        .take(MOST_COLUMNS)
        .cloned()
        .collect();
    let options = ReadOptions {
        renames: (names.iter().filter(|name| is_qualified(name)))
            .map(|name| (name.clone(), name.clone()))
            .collect(),
        wanted: Some(names.clone()),
        ..ReadOptions::default()
    };
    let (recording, remarks) = match files.read(&options) {
        Ok(recording) => (Some(recording), Vec::new()),
        Err(error) => (
            None,
            vec![format!(
                "The columns are paired by their names only, because they cannot be read together: {error}"
            )],
        ),
    };
    let values = |name: &str| {
        let column = recording.as_ref().and_then(|recording| recording.column(name).ok());
        column.map(<[f64]>::to_vec)
    };
    let signals = names.into_iter().map(|name| {
        let values = values(&name).unwrap_or_default();
        FileSignal::new(name, values)
    });
    Ok((signals.collect(), remarks))
}
