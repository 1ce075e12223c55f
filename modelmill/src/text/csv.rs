//! Writes columns of numbers as CSV text.

use std::fmt::Write as _;

use modelmill_boundary::text::csv_field;

/// A line of names and one line for each sample. If the text is read as a recording, the names are the same, except
/// that control characters and line breaks are replaced.
///
/// # Panics
/// If a column is shorter than the first.
///
/// ```
/// use modelmill::text::csv::csv;
/// assert_eq!(csv(&[("t", &[0.0, 0.5]), ("a,b", &[1.0, 2.0])]), "t,\"a,b\"\n0,1\n0.5,2\n");
/// ```
pub fn csv(columns: &[(&str, &[f64])]) -> String {
    let names = columns.iter().map(|(name, _)| csv_field(name));
    let mut text = names.collect::<Vec<_>>().join(",");
    text.push('\n');
    // The first column is the time, which all others follow.
    let samples = columns.first().map_or(0, |(_, values)| values.len());
    for i in 0..samples {
        for (k, (_, values)) in columns.iter().enumerate() {
            let _ = write!(text, "{}{}", if k == 0 { "" } else { "," }, values[i]);
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use modelmill_identify::{ReadOptions, SignalRecording};

    use super::*;

    #[test]
    fn names_come_back_as_they_are() {
        let names = [
            "t",
            "=cmd()",
            "+1+1",
            "-q",
            "@sum",
            "'=marked",
            "''@twice",
            "a \"quoted\" name",
            "\"",
            "comma, comma",
            "semi;colon",
            "{}%s",
            "\u{e4}",
        ];
        let values = [1.5, -0.25e-30];
        let columns: Vec<(&str, &[f64])> = names.iter().map(|name| (*name, &values[..])).collect();
        let options = ReadOptions::default();
        let read = SignalRecording::from_bytes(csv(&columns).as_bytes(), "run.csv", &options).unwrap();
        for name in names {
            assert_eq!(read.column(name).unwrap(), values, "{name}");
        }
        // Line breaks and control characters of a terminal are replaced.
        let steering = csv(&[("two\r\nlines\t\u{1b}[2J\u{202e}", &values)]);
        assert_eq!(steering.lines().next(), Some("two lines \u{fffd}[2J\u{fffd}"));
        // A field that begins with such a sign would be a formula in a spreadsheet.
        let header = csv(&columns);
        let header = header.lines().next().unwrap_or_default();
        for sign in ["=", "+", "-", "@"] {
            assert!(!header.contains(&format!(",{sign}")) && !header.contains(&format!(",\"{sign}")));
        }
    }
}
