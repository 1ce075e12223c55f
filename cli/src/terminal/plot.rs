//! Figures in the terminal: curves in Braille dots (two by four to a character) and bars.

/// One curve with a scale on its left.
pub(crate) struct TerminalCurve<'a> {
    /// Values over the common axis.
    pub(crate) values: &'a [f64],
    /// Height in lines of text.
    pub(crate) height: usize,
    /// Largest magnitude on the scale; that of the values if absent.
    pub(crate) limit: Option<f64>,
}

/// Width of a curve in characters.
pub(crate) const WIDTH: usize = 66;
/// Width of the scale at the left.
const SCALE: usize = 9;

/// The two columns of dots in a Braille character, from the top.
const DOTS: [[u8; 4]; 2] = [[0x01, 0x02, 0x04, 0x40], [0x08, 0x10, 0x20, 0x80]];

impl TerminalCurve<'_> {
    /// The curve with its scale, line by line. Each column of dots spans the least and the largest of its values.
    pub(crate) fn lines(&self) -> Vec<String> {
        // The scale is symmetric about zero; the limit avoids a division by zero for a curve of zeros.
        let own = self.values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let limit = self.limit.unwrap_or(own).max(f64::MIN_POSITIVE);
        let (dots_x, dots_y) = (2 * WIDTH, 4 * self.height);
        // One byte per character: a bit for each of its eight dots.
        let mut cells = vec![vec![0_u8; WIDTH]; self.height];
        let n = self.values.len();
        // Zero has a separate row of dots, so that a curve around zero does not jump between two rows.
        let half = (dots_y / 2).max(1);
        let row_of = |value: f64| {
            let share = 1.0 - (value / limit).clamp(-1.0, 1.0);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a row of dots between 0 and the height"
            )]
            let row = 1 + (share * (half - 1) as f64).round() as usize;
            row.min(dots_y - 1)
        };
        // Mark the dots between the least and the largest value of each column.
        for x in 0..dots_x {
            let (from, to) = (x * n / dots_x, (x + 1) * n / dots_x);
            // One more value on the left connects a steep curve to the column before.
            let Some(span) = self.values.get(from.saturating_sub(1)..to.max(from + 1).min(n)) else {
                continue;
            };
            let low = span.iter().copied().fold(f64::INFINITY, f64::min);
            let high = span.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            if span.is_empty() || !low.is_finite() || !high.is_finite() {
                continue;
            }
            for y in row_of(high)..=row_of(low) {
                cells[y / 4][x / 2] |= DOTS[x % 2][y % 4];
            }
        }
        // Labels at the top, at zero and at the bottom.
        let middle = self.height / 2;
        cells
            .iter()
            .enumerate()
            .map(|(y, row)| {
                let scale = match y {
                    0 => format!("{limit:.3}"),
                    y if y + 1 == self.height => format!("{:.3}", -limit),
                    y if y == middle => "0".to_owned(),
                    _ => String::new(),
                };
                // Long numbers are written in exponential notation.
                let scale = if scale.len() > SCALE {
                    format!("{:.2e}", if y == 0 { limit } else { -limit })
                } else {
                    scale
                };
                let dots: String = row
                    .iter()
                    .map(|bits| char::from_u32(0x2800 + u32::from(*bits)).unwrap_or(' '))
                    .collect();
                format!("{scale:>SCALE$} |{}", dots.trim_end_matches('\u{2800}'))
            })
            .collect()
    }
}

/// The time axis below curves, with the first and the last time in s.
pub(crate) fn time_axis(time: &[f64]) -> String {
    let first = format!("{:.1} s", time.first().copied().unwrap_or(0.0));
    let last = format!("{:.1} s", time.last().copied().unwrap_or(0.0));
    let gap = WIDTH.saturating_sub(first.len() + last.len() + 4);
    format!("{:>SCALE$} +- {first} {} {last}", "", "-".repeat(gap))
}

/// A horizontal bar: `value` of `limit` over some characters, in eighths of a character.
pub(crate) fn bar(value: f64, limit: f64, width: usize) -> String {
    const PARTS: [char; 8] = [' ', '▏', '▎', '▍', '▌', '▋', '▊', '▉'];
    let share = if limit > 0.0 {
        (value / limit).clamp(0.0, 1.0)
    } else {
        0.0
    };
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "eighths between 0 and eight times the width"
    )]
    let eighths = (share * (8 * width) as f64).round() as usize;
    let mut text = "█".repeat(eighths / 8);
    if !eighths.is_multiple_of(8) {
        text.push(PARTS[eighths % 8]);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_goes_from_bottom_left_to_top_right() {
        let values: Vec<f64> = (0..1000).map(|i| f64::from(i) / 499.5 - 1.0).collect();
        let curve = TerminalCurve {
            values: &values,
            height: 4,
            limit: None,
        };
        let lines = curve.lines();
        assert_eq!(lines.len(), 4);
        let dots = |line: &str| line.split_once('|').unwrap().1.chars().collect::<Vec<_>>();
        let first_dot = |line: &str| dots(line).iter().position(|c| *c != '\u{2800}').unwrap();
        assert!(first_dot(&lines[0]) > 40 && first_dot(&lines[3]) == 0, "{lines:?}");
        assert_eq!(dots(&lines[0]).len(), WIDTH);
    }

    #[test]
    fn odd_values_do_no_harm() {
        for values in [vec![], vec![0.0], vec![f64::NAN; 9], vec![1e300, -1e300]] {
            let curve = TerminalCurve {
                values: &values,
                height: 3,
                limit: None,
            };
            assert_eq!(curve.lines().len(), 3);
        }
        assert_eq!(bar(1.0, 2.0, 4), "██");
        assert_eq!(bar(1.0, 0.0, 4), "");
    }
}
