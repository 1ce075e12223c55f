//! Contents of a recording (tables, columns, sample rates), as JSON for scripts and as text for people.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use modelmill_identify::{ColumnInfo, TableInfo};
use serde_json::{Value, json};

use crate::recording::RecordingContents;
use crate::text::TerminalStyle;
use crate::text::table::{ColumnAlignment, count, number, significant, table};

/// Least number of elements of a list that share a line. By judgement.
const LEAST_SHARED: usize = 4;
/// Most lines of a table. By judgement.
const MOST_ROWS: usize = 200;

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

    /// As [`RecordingContents::json`], with the JSON of a proposal under the key `proposal`.
    pub fn json_with_proposal(&self, proposal: &Value) -> Value {
        let mut object = self.json();
        object["proposal"] = proposal.clone();
        object
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
            let mut rows = column_rows(&one.columns);
            let hidden = rows.len().saturating_sub(MOST_ROWS);
            rows.truncate(MOST_ROWS);
            if hidden > 0 {
                rows.push(vec![
                    format!("and {hidden} more (JSON output lists all)"),
                    String::new(),
                ]);
            }
            if !rows.is_empty() {
                let head = [("column", ColumnAlignment::Left), ("type", ColumnAlignment::Left)];
                lines.extend(table(4, &head, &rows));
            }
        }
        lines.join("\n")
    }
}

/// Name of an element of a list, and its place in each list of the name.
type ListElement<'a> = (&'a str, Vec<usize>);

/// Rows of a table of columns: name and type. Elements of a list share a row with the first and the last of them.
fn column_rows(columns: &[ColumnInfo]) -> Vec<Vec<String>> {
    // Lists in the order of their first elements.
    let mut lists: Vec<(&str, Vec<ListElement<'_>>)> = Vec::new();
    let mut known: BTreeMap<(String, &str), usize> = BTreeMap::new();
    for column in columns {
        let (pattern, places) = split_places(&column.name);
        let list = *known.entry((pattern, &column.kind)).or_insert_with(|| {
            lists.push((&column.kind, Vec::new()));
            lists.len() - 1
        });
        lists[list].1.push((&column.name, places));
    }
    let mut rows = Vec::new();
    for (kind, elements) in lists {
        if elements.len() >= LEAST_SHARED && is_complete_grid(&elements) {
            let (first, last) = (elements[0].0, elements[elements.len() - 1].0);
            rows.push(vec![
                format!("{first} to {last} ({} columns)", elements.len()),
                kind.to_owned(),
            ]);
        } else {
            rows.extend(
                elements
                    .iter()
                    .map(|(name, _)| vec![(*name).to_owned(), kind.to_owned()]),
            );
        }
    }
    rows
}

/// A name with `*` for the place of each list in it, and these places: `points_3.q_1` is `points_*.q_*` with 3 and 1.
fn split_places(name: &str) -> (String, Vec<usize>) {
    let mut places = Vec::new();
    let parts = name.split('.').map(|part| {
        let place = part.rsplit_once('_').and_then(|(base, place)| {
            let is_number = !place.is_empty() && place.bytes().all(|byte| byte.is_ascii_digit());
            Some((base, is_number.then(|| place.parse().ok())??))
        });
        match place {
            Some((base, place)) => {
                places.push(place);
                format!("{base}_*")
            }
            None => part.to_owned(),
        }
    });
    let pattern = parts.collect::<Vec<_>>().join(".");
    (pattern, places)
}

/// Whether all places between those of the first and the last element occur, so that these two name all of them.
fn is_complete_grid(elements: &[ListElement<'_>]) -> bool {
    let (first, last) = (&elements[0].1, &elements[elements.len() - 1].1);
    let sides = first.iter().zip(last).map(|(from, to)| (to + 1).saturating_sub(*from));
    let is_within = |places: &Vec<usize>| {
        let mut all = places.iter().zip(first.iter().zip(last));
        all.all(|(place, (from, to))| from <= place && place <= to)
    };
    // Names differ, so that as many elements as places in the grid are all of them.
    !first.is_empty()
        && sides.product::<usize>() == elements.len()
        && elements.iter().all(|(_, places)| is_within(places))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows_of(names: &[String]) -> Vec<String> {
        let columns = names.iter().map(|name| ColumnInfo {
            name: name.clone(),
            kind: "float64".to_owned(),
        });
        let rows = column_rows(&columns.collect::<Vec<_>>());
        rows.into_iter().map(|mut row| row.remove(0)).collect()
    }

    /// The lists of a trajectory share two lines, whatever their length.
    #[test]
    fn lists_share_lines() {
        let point =
            |i: usize| (1..=6).flat_map(move |j| ["positions", "effort"].map(|f| format!("t.points_{i}.{f}_{j}")));
        let names: Vec<String> = (1..=300).flat_map(point).collect();
        assert_eq!(
            rows_of(&names),
            [
                "t.points_1.positions_1 to t.points_300.positions_6 (1800 columns)",
                "t.points_1.effort_1 to t.points_300.effort_6 (1800 columns)",
            ]
        );
    }

    /// Lists with holes, short lists and other names are not abbreviated, because the ends would not say what is between.
    #[test]
    fn other_names_have_lines_of_their_own() {
        let names = [
            "t", "q_1", "q_2", "q_3", "a_1", "a_2", "a_4", "a_5", "x1", "x2", "x3", "x4",
        ]
        .map(str::to_owned);
        assert_eq!(rows_of(&names).len(), names.len());
    }
}
