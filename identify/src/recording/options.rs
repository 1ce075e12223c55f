//! How a recording is read: names, computed columns, bad samples, the time that is looked at.

/// What becomes of samples with NaN, infinite or empty fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NonFinitePolicy {
    /// A column that holds such fields is refused when it is asked for.
    #[default]
    Refuse,
    /// Samples where any column holds such a field are left out, counted and said in the notes; those that lack only values
    /// of [`ReadOptions::may_lack`] stay.
    LeaveOut,
}

/// A column of ours that is an affine sum of the file's: `offset + sum of factor * column`.
#[derive(Debug, Clone, PartialEq)]
pub struct ComputedColumn {
    /// Our name.
    pub name: String,
    /// The file's columns with their factors.
    pub terms: Vec<(String, f64)>,
    /// What is added.
    pub offset: f64,
}

/// How a recording is read.
#[derive(Debug, Clone, PartialEq)]
pub struct ReadOptions {
    /// `(ours, theirs)`: the column that the file calls `theirs` is known as `ours`.
    pub renames: Vec<(String, String)>,
    /// Columns that are computed from the file's; each replaces one of its name.
    pub computed: Vec<ComputedColumn>,
    /// What becomes of NaN, infinite and empty fields.
    pub not_finite: NonFinitePolicy,
    /// Our names of the columns that are needed; the others are neither looked at nor kept.
    /// All are kept if there is no such list.
    pub wanted: Option<Vec<String>>,
    /// Our names of columns of which single values may be missing where [`NotFinite::LeaveOut`] is asked for: forces, whose
    /// samples still hold positions.
    pub may_be_missing: Vec<String>,
    /// Only samples whose time `t` lies between these two, s; the others are passed over, counted and said.
    pub time_interval: Option<(f64, f64)>,
    /// Most numbers that are kept, the line of each sample among them; a recording that holds more is refused before memory runs out.
    pub max_numbers: usize,
}

impl ReadOptions {
    /// A single column under the name that the file gives it.
    pub(crate) fn single_column(name: &str) -> Self {
        Self {
            wanted: Some(vec![name.to_owned()]),
            ..Self::default()
        }
    }

    /// Whether a column that the file calls `theirs` is needed.
    pub(crate) fn is_column_needed(&self, theirs: &str) -> bool {
        let Some(wanted) = &self.wanted else {
            return true;
        };
        let is_term = |one: &ComputedColumn| one.terms.iter().any(|(name, _)| name == theirs);
        let renamed = self.renames.iter().find(|(_, other)| other == theirs);
        let ours = renamed.map_or(theirs, |(ours, _)| ours);
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
            max_numbers: 1 << 26,
        }
    }
}
