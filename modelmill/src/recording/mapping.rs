//! Mapping files: the table `[recording.columns]` of a model file in a file of its own, for logs of one machine that
//! several models read. The header may be omitted.

use std::path::Path;

use toml::{Table, Value};

use crate::error::{Error, Outcome};
use crate::host::Host;

/// Largest mapping file, bytes. By judgement: a line for each of a thousand columns.
const LARGEST_MAPPING: u64 = 1 << 20;

impl Host {
    /// Reads the columns of a mapping file, for [`RecordingOptions::columns`](super::RecordingOptions::columns). It has
    /// the lines of the table `[recording.columns]`, as `recordings --model` prints them, with or without its header.
    ///
    /// Fails when the file cannot be read, is no TOML, or has other content.
    ///
    /// ```no_run
    /// use std::path::Path;
    /// use modelmill::Host;
    /// use modelmill::recording::RecordingOptions;
    ///
    /// let columns = Host::new().column_mapping(Path::new("log.toml"))?;
    /// let options = RecordingOptions { columns, ..RecordingOptions::default() };
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn column_mapping(&self, path: &Path) -> Outcome<Vec<(String, String)>> {
        let name = path.display();
        let text = self.files().read_text(path, LARGEST_MAPPING);
        let text = text.map_err(|error| Error::input(format!("{name} cannot be read: {}", error.fault)))?;
        columns_of_text(&text).map_err(|says| Error::input(format!("{name}: {says}")))
    }
}

/// The pairs of the table, or why there are none.
fn columns_of_text(text: &str) -> Result<Vec<(String, String)>, String> {
    /// What the file must contain.
    const EXPECTED: &str =
        "a mapping file has lines such as q1 = \"pos1 [deg]\", in the table [recording.columns] or alone";
    if let Some(excess) = modelmill_spec::find_toml_excess(text) {
        return Err(format!("{}: {}", excess.fault, excess.limit));
    }
    let table: Table = text.parse().map_err(|fault| format!("it is no valid TOML: {fault}"))?;
    let only = |table: &Table, key: &str| match table.keys().find(|other| *other != key) {
        Some(other) => Err(format!("`{other}` is not read; {EXPECTED}")),
        None => Ok(()),
    };
    let columns = match table.get("recording") {
        None => &table,
        Some(recording) => {
            only(&table, "recording")?;
            let recording = recording.as_table().ok_or(EXPECTED)?;
            only(recording, "columns")?;
            recording.get("columns").and_then(Value::as_table).ok_or(EXPECTED)?
        }
    };
    if columns.is_empty() {
        return Err(EXPECTED.to_owned());
    }
    let pair = |(ours, theirs): (&String, &Value)| match theirs.as_str() {
        Some(theirs) if !theirs.trim().is_empty() => Ok((ours.clone(), theirs.to_owned())),
        _ => Err(format!("`{ours}` is no column in quotes; {EXPECTED}")),
    };
    columns.iter().map(pair).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mapping_file_has_the_table_of_a_model_file() {
        let text = "# Proposed\n[recording.columns]\nt = \"time [ms]\"\n\"q-1\" = \"(b - a)/2\"\n";
        let pairs = columns_of_text(text).unwrap();
        assert_eq!(pairs[1], ("q-1".to_owned(), "(b - a)/2".to_owned()));
        assert_eq!(
            columns_of_text("q1 = \"a\"").unwrap(),
            [("q1".to_owned(), "a".to_owned())]
        );
        for (text, says) in [
            (
                "[recording.columns]\nq1 = \"a\"\n[parameters]\nm = 1",
                "`parameters` is not read",
            ),
            ("[recording.torque]\nm = 2", "`torque` is not read"),
            ("[recording.columns]\nq1 = 3", "`q1` is no column"),
            ("schema = 1", "`schema` is no column"),
            ("[recording.columns\n", "no valid TOML"),
            ("", "a mapping file has lines such as"),
        ] {
            let fault = columns_of_text(text).unwrap_err();
            assert!(fault.contains(says), "{text}: {fault}");
        }
    }
}
