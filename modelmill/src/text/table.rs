//! Formats tables and numbers.

/// Alignment of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColumnAlignment {
    /// Left, for text.
    Left,
    /// Right, for numbers.
    Right,
}

/// Lays out rows below a header, with two blanks between columns and `indent` blanks in front; without trailing
/// blanks.
///
/// ```
/// use modelmill::text::table::{ColumnAlignment, table};
///
/// let columns = [("a", ColumnAlignment::Left), ("n", ColumnAlignment::Right)];
/// let rows = [vec!["x".to_owned(), "10".to_owned()]];
/// assert_eq!(table(2, &columns, &rows), ["  a   n", "  x  10"]);
/// ```
pub fn table(indent: usize, columns: &[(&str, ColumnAlignment)], rows: &[Vec<String>]) -> Vec<String> {
    let head: Vec<String> = columns.iter().map(|(name, _)| (*name).to_owned()).collect();
    let all: Vec<&Vec<String>> = std::iter::once(&head).chain(rows).collect();
    // A column is as wide as its longest cell, in letters rather than bytes.
    let widths: Vec<usize> = (0..columns.len())
        .map(|j| {
            all.iter()
                .filter_map(|row| row.get(j))
                .map(|cell| cell.chars().count())
                .max()
                .unwrap_or(0)
        })
        .collect();
    all.iter()
        .map(|row| {
            let mut line = " ".repeat(indent);
            for (j, (_, align)) in columns.iter().enumerate() {
                let cell = row.get(j).map_or("", String::as_str);
                let fill = " ".repeat(widths[j] - cell.chars().count());
                let parts = match align {
                    ColumnAlignment::Left => [cell, &fill],
                    ColumnAlignment::Right => [&fill, cell],
                };
                line.extend(parts);
                line.push_str("  ");
            }
            // Blanks at the end of a line would show as changes in quotations.
            line.trim_end().to_owned()
        })
        .collect()
}

/// A number with six significant digits.
pub fn number(value: f64) -> String {
    significant(value, 6)
}

/// A number with all of its digits, for values that are rounded already; very large and very small ones with an exponent.
///
/// ```
/// assert_eq!(modelmill::text::table::all_digits(2.160231), "2.160231");
/// assert_eq!(modelmill::text::table::all_digits(0.0000125), "1.25e-5");
/// ```
pub fn all_digits(value: f64) -> String {
    if value == 0.0 || (1e-4..1e9).contains(&value.abs()) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

/// A value and its standard deviation, both rounded to the second digit of the standard deviation.
///
/// ```
/// assert_eq!(modelmill::text::table::with_std(1.23456, 0.012), ["1.235", "0.012"]);
/// ```
pub fn with_std(value: f64, std: f64) -> [String; 2] {
    // Position of the first digit of the standard deviation.
    let exponent = std.abs().log10().floor();
    let decimals = 1.0 - exponent;
    // Very large and very small standard deviations use significant digits instead.
    if !(value.is_finite() && (0.0..=12.0).contains(&decimals)) {
        return [number(value), number(std)];
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a whole number from 0 to 12"
    )]
    let decimals = decimals as usize;
    [value, std].map(|x| format!("{x:.decimals$}"))
}

/// A number with some significant digits; very large and very small ones with an exponent.
///
/// ```
/// assert_eq!(modelmill::text::table::significant(0.123456, 3), "0.123");
/// ```
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return value.to_string();
    }
    // Formatting rounds first, so that 999999.9 gets the exponent of 1e6.
    let scientific = format!("{value:.*e}", digits.saturating_sub(1));
    let exponent: i32 = scientific
        .split_once('e')
        .and_then(|(_, e)| e.parse().ok())
        .unwrap_or(0);
    // Plain decimals up to this size are easier to read than exponents.
    if !(-4..9).contains(&exponent) {
        return scientific;
    }
    let decimals = usize::try_from(i32::try_from(digits).unwrap_or(6) - 1 - exponent).unwrap_or(0);
    format!("{value:.decimals$}")
}

/// A relative figure in per cent: `11.3 %`, `6.28e-5 %`; `-` without a value.
///
/// ```
/// assert_eq!(modelmill::text::table::percent(Some(0.113)), "11.3 %");
/// ```
pub fn percent(value: Option<f64>) -> String {
    match value {
        None => "-".to_owned(),
        Some(0.0) => "0 %".to_owned(),
        Some(value) => format!("{} %", three_digits(100.0 * value)),
    }
}

/// Three significant digits, with an exponent below a thousandth.
fn three_digits(value: f64) -> String {
    if value.abs() < 1e-3 {
        format!("{value:.2e}")
    } else {
        significant(value, 3)
    }
}

/// A count with its noun, such as `1 loop`, `2 loops`.
///
/// ```
/// assert_eq!(modelmill::text::table::count(2, "loop", "loops"), "2 loops");
/// ```
pub fn count(n: usize, one: &str, many: &str) -> String {
    if n == 1 {
        format!("1 {one}")
    } else {
        format!("{n} {many}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_significant_digits() {
        assert_eq!(number(95.108_912_3), "95.1089");
        assert_eq!(number(-0.001_234_567), "-0.00123457");
        assert_eq!(number(7_290_000.0), "7290000");
        assert_eq!(number(1.5e-9), "1.50000e-9");
        assert_eq!(number(999_999.9), "1000000");
        assert_eq!(percent(Some(0.112_85)), "11.3 %");
        assert_eq!(percent(None), "-");
    }

    #[test]
    fn columns_line_up() {
        let rows = [
            vec!["a".to_owned(), "1".to_owned()],
            vec!["long".to_owned(), "10".to_owned()],
        ];
        let lines = table(
            2,
            &[("name", ColumnAlignment::Left), ("n", ColumnAlignment::Right)],
            &rows,
        );
        assert_eq!(lines, ["  name   n", "  a      1", "  long  10"]);
    }
}
