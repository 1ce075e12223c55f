//! Options for reading a recording: names, computed columns, bad samples, and the time interval.

/// How samples with NaN, infinite or empty fields are treated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NonFinitePolicy {
    /// A column with such fields is refused when it is used.
    #[default]
    Refuse,
    /// Samples with such a field in any column are left out and counted in the notes. Samples that lack only values
    /// of [`ReadOptions::may_be_missing`] are kept.
    LeaveOut,
}

/// A computed column, an affine sum of columns of the file: `offset + sum of factor * column`.
#[derive(Debug, Clone, PartialEq)]
pub struct ComputedColumn {
    /// Its name in the model.
    pub name: String,
    /// Columns of the file with their factors.
    pub terms: Vec<(String, f64)>,
    /// The constant term, in SI units.
    pub offset: f64,
}

/// Options for reading a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadOptions {
    /// Pairs `(ours, theirs)`: the column `theirs` of the file gets the name `ours`.
    pub renames: Vec<(String, String)>,
    /// Computed columns; each replaces a column of the same name.
    pub computed: Vec<ComputedColumn>,
    /// How NaN, infinite and empty fields are treated.
    pub not_finite: NonFinitePolicy,
    /// Names, after renaming, of the columns that are needed. Others are neither read nor kept. `None` keeps all
    /// columns.
    pub wanted: Option<Vec<String>>,
    /// Names, after renaming, of columns that may lack single values with [`NonFinitePolicy::LeaveOut`]. These are
    /// forces: a sample without a force still has positions.
    pub may_be_missing: Vec<String>,
    /// Only samples with a time `t` in this interval are read, s; the others are counted in a note.
    pub time_interval: Option<(f64, f64)>,
    /// Sampling rate of a recording without times, Hz: sample k gets the time k / rate, and a column of times is not
    /// read. `None` takes the time from the file.
    pub rate: Option<f64>,
    /// Most numbers that are kept, including the line of each sample. A larger recording is refused before memory is
    /// exhausted.
    pub max_numbers: usize,
}

impl ReadOptions {
    /// Options that read a single column under its name in the file.
    pub(crate) fn single_column(name: &str) -> Self {
        Self {
            wanted: Some(vec![name.to_owned()]),
            ..Self::default()
        }
    }

    /// Whether the column that the file calls `theirs` is needed, as itself or for a computed column.
    pub(crate) fn is_column_needed(&self, theirs: &str) -> bool {
        let Some(wanted) = &self.wanted else {
            return true;
        };
        let is_term = |one: &ComputedColumn| one.terms.iter().any(|(name, _)| name == theirs);
        let renamed = self.renames.iter().find(|(_, other)| other == theirs);
        let ours = renamed.map_or(theirs, |(ours, _)| ours);
        // A rate replaces the column of times.
        if self.rate.is_some() && ours == "t" && !self.computed.iter().any(is_term) {
            return false;
        }
        self.computed.iter().any(is_term) || wanted.iter().any(|name| name == ours)
    }
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            renames: Vec::new(),
            computed: Vec::new(),
            not_finite: NonFinitePolicy::default(),
            wanted: None,
            may_be_missing: Vec::new(),
            time_interval: None,
            rate: None,
            max_numbers: 1 << 26,
        }
    }
}
