//! Where models, variants and reference tables are, and how tables are read.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use modelmill_codegen::Derivation;
use modelmill_spec::Mechanism;

/// The folder of fixtures.
pub fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures")
}

/// The model file `name` of the models that ship with the program, or else of those that tests add.
pub fn model_file(name: &str) -> PathBuf {
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/models");
    let file = format!("{name}.toml");
    [shipped, fixtures().join("emitted"), fixtures().join("variants")]
        .map(|folder| folder.join(&file))
        .into_iter()
        .find(|path| path.exists())
        .unwrap_or_else(|| panic!("there is no model file {file}"))
}

/// Loads a model or a variant by the name of its file.
pub fn model(name: &str) -> Mechanism {
    match modelmill_spec::load_file(&model_file(name)) {
        Ok(loaded) => loaded.mechanism,
        Err(failure) => panic!("{name}: {}", failure.render(false)),
    }
}

/// Loads and derives a model or a variant.
pub fn derived(name: &str) -> Derivation {
    derive(&model(name))
}

/// Derives a mechanism that must have a derivation.
pub fn derive(mechanism: &Mechanism) -> Derivation {
    modelmill_codegen::derive(mechanism).unwrap_or_else(|error| panic!("{}: {error}", mechanism.name))
}

/// A table of numbers with named columns.
#[derive(Clone, Debug)]
pub struct Table {
    columns: BTreeMap<String, Vec<f64>>,
    names: Vec<String>,
    n_rows: usize,
}

impl Table {
    /// Reads `fixtures/reference/<name>.csv`.
    pub fn reference(name: &str) -> Self {
        let path = fixtures().join("reference").join(format!("{name}.csv"));
        let mut reader = csv::Reader::from_path(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let names: Vec<String> = reader.headers().expect("a header").iter().map(str::to_owned).collect();
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); names.len()];
        let mut n_rows = 0;
        for record in reader.records() {
            let record = record.unwrap_or_else(|error| panic!("{name}: {error}"));
            for (column, field) in columns.iter_mut().zip(&record) {
                column.push(
                    field
                        .parse()
                        .unwrap_or_else(|_| panic!("{name}: '{field}' is no number")),
                );
            }
            n_rows += 1;
        }
        Self {
            columns: names.iter().cloned().zip(columns).collect(),
            names,
            n_rows,
        }
    }

    /// Names of the columns in the order of the file.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Number of rows.
    pub fn n_rows(&self) -> usize {
        self.n_rows
    }

    /// A column by its name.
    pub fn column(&self, name: &str) -> &[f64] {
        self.columns
            .get(name)
            .unwrap_or_else(|| panic!("the table has no column '{name}'"))
    }
}
