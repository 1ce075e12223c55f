//! Contents of a recording (tables, columns, sample rates), as JSON for scripts and as text for people.

use std::fmt::Write as _;

use modelmill_identify::TableInfo;
use serde_json::{Value, json};

use crate::recording::RecordingContents;
use crate::text::TerminalStyle;
use crate::text::table::{ColumnAlignment, count, number, significant, table};

impl RecordingContents {
    /// The tables as one JSON object: names, types, number of samples, rate (Hz), start and end (s), and columns.
    pub fn json(&self) -> Value {
        // Units are Hz and s; a table without time has neither rate nor limits.
        let of_table = |table: &TableInfo| {
            let columns = table.columns.iter();
            let columns = columns.map(|column| json!({ "name": column.name, "type": column.kind }));
            json!({
                "name": table.name,
                "type": table.kind,
                "samples": table.samples,
                "rate": table.rate(),
                "start": table.time.map(|(start, _)| start),
                "end": table.time.map(|(_, end)| end),
                "remark": table.remark,
                "columns": columns.collect::<Vec<_>>(),
            })
        };
        json!({ "file": self.file, "tables": self.tables.iter().map(of_table).collect::<Vec<_>>() })
    }

    /// The tables as text: for each a line with its size and time, and a list of its columns.
    pub fn text(&self, style: TerminalStyle) -> String {
        let mut lines = vec![style.bold(&self.file)];
        for one in &self.tables {
            let mut head = String::new();
            // Files with a single table, such as CSV, have no name for it.
            if !one.name.is_empty() {
                head = format!("{} ({}): ", one.name, one.kind);
            }
            head.push_str(&count(one.samples, "sample", "samples"));
            if let Some((start, end)) = one.time {
                let _ = write!(head, " from {} to {} s", number(start), number(end));
            }
            if let Some(rate) = one.rate() {
                let _ = write!(head, ", {} Hz", significant(rate, 4));
            }
            lines.push(String::new());
            lines.push(format!("  {head}"));
            // A remark of the reader, such as on what was not read.
            if let Some(remark) = &one.remark {
                lines.push(format!("  {remark}"));
            }
            let rows = one.columns.iter();
            let rows: Vec<Vec<String>> = rows
                .map(|column| vec![column.name.clone(), column.kind.clone()])
                .collect();
            if !rows.is_empty() {
                let head = [("column", ColumnAlignment::Left), ("type", ColumnAlignment::Left)];
                lines.extend(table(4, &head, &rows));
            }
        }
        lines.join("\n")
    }
}
