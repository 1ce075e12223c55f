//! A proposal of columns, as JSON for scripts and as a table of a model file for people.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::recording::{ColumnProposal, ProposedColumn};

impl ColumnProposal {
    /// One JSON object: the model, `columns` with the column of each name, the evidence, names without a column, and
    /// remarks.
    pub fn json(&self) -> Value {
        let pairs = self
            .columns
            .iter()
            .map(|one| json!({ "name": one.name, "column": one.column, "reason": one.reason, "guess": one.is_guess }));
        json!({
            "model": self.model,
            "columns": pairs.collect::<Vec<_>>(),
            "missing": self.missing,
            "remarks": self.remarks,
        })
    }

    /// The table `[recording.columns]` with the evidence of each line as a comment, ready for a model file.
    pub fn text(&self) -> String {
        let mut text = format!(
            "# Proposed for {}: check each line, and add the table to the model file.\n",
            self.model
        );
        for remark in &self.remarks {
            let _ = writeln!(text, "# {}", remark.replace('\n', " "));
        }
        text.push_str("[recording.columns]\n");
        let lines: Vec<(String, &ProposedColumn)> = (self.columns.iter())
            .map(|one| (format!("{} = {}", toml_key(&one.name), toml_text(&one.column)), one))
            .collect();
        let width = lines.iter().map(|(line, _)| line.chars().count()).max().unwrap_or(0);
        for (line, one) in &lines {
            let doubt = if one.is_guess { "uncertain: " } else { "" };
            let _ = writeln!(text, "{line:width$}  # {doubt}{}", one.reason);
        }
        for name in &self.missing {
            let _ = writeln!(text, "# {} = \"...\"  # no column was found", toml_key(name));
        }
        text.pop();
        text
    }
}

/// A key of TOML, in quotes if it has other characters than a bare key.
fn toml_key(name: &str) -> String {
    let is_bare = !name.is_empty()
        && name
            .bytes()
            .all(|byte| byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-');
    if is_bare { name.to_owned() } else { toml_text(name) }
}

/// A text of TOML in quotes.
fn toml_text(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}
