//! Corrections of a recording as it was read: columns are scaled, exchanged, unwrapped, or left out for some time. A
//! recording and the names of its columns go in; it is prepared afterwards, as if the file had the corrected values.

use std::f64::consts::PI;

use super::column::{ColumnScaling, SignalColumn};
use super::thresholds::{WRAP_LEAST_STEPS, WRAP_RANGE_MARGIN, WRAP_STEP_TOLERANCE};
use super::{RecordingNote, SignalRecording, sample_place_word};
use crate::signal::median;
use crate::words::{count_of, with_digits};

/// Full turns of an angle: in rad and in degrees, with the name of the turn.
const TURNS: [(f64, &str); 2] = [(2.0 * PI, "2 pi"), (360.0, "360")];

/// A turn with its name, and each first sample behind a jump by it with the direction of the jump.
type FullTurns = (f64, &'static str, Vec<(usize, f64)>);

/// Jumps of an angle by a full turn that were removed.
#[derive(Debug, Clone, PartialEq)]
pub struct UnwrappedAngle {
    /// Name of the coordinate.
    pub coordinate: String,
    /// Number of the jumps.
    pub jumps: usize,
}

impl SignalRecording {
    /// Multiplies a column by a factor, together with its values before any repair. A missing column stays missing.
    pub fn scale_column(&mut self, name: &str, factor: f64) {
        if let Some(column) = self.columns.get_mut(name) {
            column.scale(ColumnScaling { factor, offset: 0.0 });
            // The file is taken to have other values, so that the offset is scaled too.
            if let Some(scaling) = &mut column.scaling {
                scaling.offset *= factor;
            }
        }
    }

    /// The constant that is added to a column of the file, in the unit of the model; 0 for other columns.
    pub fn column_offset(&self, name: &str) -> f64 {
        let scaling = self.columns.get(name).and_then(|column| column.scaling);
        scaling.map_or(0.0, |scaling| scaling.offset)
    }

    /// The scaling that turns the values of one column into those of another name that is read from the same column of the
    /// file, such as the torque of another motor with another ratio. Nothing changes if one of both is missing or is no
    /// multiple of one column of the file.
    pub fn conversion(&self, from: &str, to: &str) -> ColumnScaling {
        let scaling = |name: &str| self.columns.get(name)?.scaling;
        let pair = scaling(from).zip(scaling(to));
        pair.map_or_else(ColumnScaling::default, |(from, to)| from.conversion_to(to))
    }

    /// Exchanges the contents of two columns; `conversions` turn the contents of the first into those of the second, and back.
    /// A column that is missing is missing under the other name afterwards.
    pub fn exchange_columns(&mut self, one: &str, other: &str, conversions: [ColumnScaling; 2]) {
        let places = [one, other].map(|name| self.columns.get_index_of(name));
        match places {
            [Some(a), Some(b)] => {
                // The names keep their places and their scalings, only the contents change.
                self.columns[a].scale(conversions[0]);
                self.columns[b].scale(conversions[1]);
                let scalings = [a, b].map(|place| self.columns[place].scaling);
                let content = std::mem::take(&mut self.columns[a]);
                self.columns[a] = std::mem::replace(&mut self.columns[b], content);
                self.columns[a].scaling = scalings[0];
                self.columns[b].scaling = scalings[1];
            }
            [Some(a), None] => self.rename_column(a, other),
            [None, Some(b)] => self.rename_column(b, one),
            [None, None] => {}
        }
    }

    /// Gives the column at a place another name.
    fn rename_column(&mut self, place: usize, name: &str) {
        if let Some((_, column)) = self.columns.shift_remove_index(place) {
            self.columns.insert(name.to_owned(), column);
        }
    }

    /// Leaves the values of a column out at the samples that `is_out` selects by their time: they are interpolated, and
    /// count in no fit and in no figure. A missing column stays missing.
    pub fn leave_out_samples(&mut self, name: &str, is_out: &dyn Fn(f64) -> bool) {
        let Some(out) = self.columns.get("t").map(|time| time.values.iter().map(|t| is_out(*t))) else {
            return;
        };
        let out: Vec<bool> = out.collect();
        let Some(column) = self.columns.get_mut(name) else {
            return;
        };
        if column.interpolated.is_empty() {
            column.interpolated = vec![false; out.len()];
        }
        for (lost, out) in column.interpolated.iter_mut().zip(out) {
            *lost |= out;
        }
        column.interpolate_lost();
    }

    /// Removes jumps by a full turn from angles, so that they continue, and notes what was done. `coordinates` are
    /// `(name, whether it is an angle)`.
    pub fn unwrap_angles(&mut self, coordinates: &[(String, bool)]) {
        let place = sample_place_word(&self.file);
        for (name, _) in coordinates.iter().filter(|(_, is_angle)| *is_angle) {
            let Some(column) = self.columns.get_mut(name) else {
                continue;
            };
            let Some((turn, turn_name, jumps)) = find_full_turns(column) else {
                continue;
            };
            let (first, before) = (jumps[0].0, column.values[jumps[0].0 - 1]);
            let after = column.values[first];
            // Every later sample gets the sum of all turns before it.
            let (mut turns, mut next) = (0.0, 0);
            for i in 0..column.values.len() {
                while next < jumps.len() && jumps[next].0 == i {
                    turns -= jumps[next].1;
                    next += 1;
                }
                column.values[i] += turns * turn;
            }
            self.notes.push(RecordingNote::info(format!(
                "`{name}` in {} is wrapped: it jumps by {turn_name} {}, first from {} to {} in {place} {}. The full turns are \
                 added, so that the angle continues. Nothing is to be done if the joint turns further there.",
                self.file,
                count_of(jumps.len(), "time", "times"),
                with_digits(before, 5),
                with_digits(after, 5),
                self.lines[first],
            )));
            self.unwrapped.push(UnwrappedAngle {
                coordinate: name.clone(),
                jumps: jumps.len(),
            });
        }
    }

    /// The angles from which full turns were removed.
    pub fn unwrapped_angles(&self) -> &[UnwrappedAngle] {
        &self.unwrapped
    }
}

/// The steps of an angle by about a full turn: the turn with its name, and each first sample behind a step with the
/// direction of the step. `None` without any, or if the angle is not within one turn, as a wrapped angle is.
fn find_full_turns(column: &SignalColumn) -> Option<FullTurns> {
    if column.text.is_some() || column.not_finite.is_some() || column.values.len() < 2 {
        return None;
    }
    let q = &column.values;
    let steps: Vec<f64> = q.windows(2).map(|w| w[1] - w[0]).collect();
    let usual = median(steps.iter().map(|step| step.abs()).collect());
    let [low, high] = [f64::min as fn(f64, f64) -> f64, f64::max].map(|fold| q.iter().copied().fold(q[0], fold));
    TURNS.into_iter().find_map(|(turn, name)| {
        if high - low > (1.0 + WRAP_RANGE_MARGIN) * turn {
            return None;
        }
        // A jump is about a full turn and far larger than a usual step.
        let is_turn =
            |step: f64| (step.abs() - turn).abs() < WRAP_STEP_TOLERANCE * turn && step.abs() > WRAP_LEAST_STEPS * usual;
        let jumps: Vec<(usize, f64)> = (steps.iter().enumerate())
            .filter(|(_, step)| is_turn(**step))
            .map(|(i, step)| (i + 1, step.signum()))
            .collect();
        (!jumps.is_empty()).then_some((turn, name, jumps))
    })
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;
    use crate::{ComputedColumn, ReadOptions};

    /// A recording of an angle that turns on, with its force.
    fn recording(angle: impl Fn(f64) -> f64) -> SignalRecording {
        let mut text = "t,q,motor\n".to_owned();
        for i in 0..2000 {
            let t = f64::from(i) * 0.005;
            writeln!(text, "{t},{},{}", angle(t), t.sin()).unwrap();
        }
        SignalRecording::from_bytes(text.as_bytes(), "run.csv", &ReadOptions::default()).unwrap()
    }

    /// Two names that are read from each other's columns keep their own factors and offsets, as motors with different
    /// ratios do, and a second exchange undoes the first.
    #[test]
    fn exchanged_columns_keep_the_factors_of_their_names() {
        let read = |columns: [&str; 2]| {
            let computed = |name: &str, column: &str, factor: f64, offset: f64| ComputedColumn {
                name: name.to_owned(),
                terms: vec![(column.to_owned(), factor)],
                offset,
            };
            let options = ReadOptions {
                computed: vec![
                    computed("one", columns[0], 250.0, 1.0),
                    computed("other", columns[1], -150.0, 0.5),
                ],
                ..ReadOptions::default()
            };
            let text = "t,a,b\n0,1,2\n0.1,3,5\n0.2,-4,7\n";
            SignalRecording::from_bytes(text.as_bytes(), "run.csv", &options).unwrap()
        };
        let [true_order, mut exchanged] = [read(["a", "b"]), read(["b", "a"])];
        let wrong = exchanged.clone();
        let is_close = |left: &SignalRecording, right: &SignalRecording| {
            ["one", "other"].iter().all(|name| {
                let [left, right] = [left, right].map(|read| read.column(name).unwrap());
                left.iter().zip(right).all(|(a, b)| (a - b).abs() < 1e-9)
            })
        };
        assert!(!is_close(&exchanged, &true_order));
        let exchange = |read: &mut SignalRecording| {
            let conversions = [read.conversion("one", "other"), read.conversion("other", "one")];
            read.exchange_columns("one", "other", conversions);
        };
        exchange(&mut exchanged);
        assert!(is_close(&exchanged, &true_order));
        exchange(&mut exchanged);
        assert!(is_close(&exchanged, &wrong));
        // A column that was scaled keeps its offset in proportion.
        exchanged.scale_column("one", -2.0);
        let scaled = exchanged.clone();
        exchange(&mut exchanged);
        exchange(&mut exchanged);
        assert!(is_close(&exchanged, &scaled));
    }

    /// Whatever the range of a wrapped angle, the unwrapped one differs from the true one by a constant.
    #[test]
    fn full_turns_are_removed_in_both_directions() {
        let truth = |t: f64| 4.0 * (0.9 * t).sin() + 0.6 * t;
        for (turn, lowest) in [(2.0 * PI, -PI), (2.0 * PI, 0.0), (360.0, -180.0), (360.0, 0.0)] {
            let angle = |t: f64| (truth(t) * turn / (2.0 * PI) - lowest).rem_euclid(turn) + lowest;
            let mut read = recording(angle);
            read.unwrap_angles(&[("q".to_owned(), true)]);
            let q = read.column("q").unwrap();
            let off = |i: usize| q[i] - truth(f64::from(u32::try_from(i).unwrap()) * 0.005) * turn / (2.0 * PI);
            assert!(
                (0..2000).all(|i| (off(i) - off(0)).abs() < 1e-9 * turn),
                "{turn} {lowest}"
            );
            assert_eq!(read.unwrapped_angles().len(), 1);
            assert_eq!(read.notes().len(), 1);
        }
        // Angles that never jump and lengths stay as they are.
        let mut read = recording(truth);
        let before = read.clone();
        read.unwrap_angles(&[("q".to_owned(), true)]);
        assert_eq!(read, before);
        let mut read = recording(|t| truth(t).rem_euclid(2.0 * PI));
        let before = read.clone();
        read.unwrap_angles(&[("q".to_owned(), false)]);
        assert_eq!(read, before);
    }

    /// A single wrong sample is no full turn, unless it is off by one: that one continues the angle.
    #[test]
    fn single_samples_change_only_by_full_turns() {
        let truth = |t: f64| 1.9 + 1.1 * (0.9 * t).sin();
        // A full turn less stays within the range of one turn only at the largest angle.
        let is_wrong = |t: f64| (t - 8.725).abs() < 1e-6;
        let mut read = recording(|t| truth(t) + if is_wrong(t) { 3.0 } else { 0.0 });
        let before = read.clone();
        read.unwrap_angles(&[("q".to_owned(), true)]);
        assert_eq!(read, before);
        let mut read = recording(|t| truth(t) - if is_wrong(t) { 2.0 * PI } else { 0.0 });
        read.unwrap_angles(&[("q".to_owned(), true)]);
        let q = read.column("q").unwrap();
        let is_true = |(i, q): (u32, &f64)| (q - truth(f64::from(i) * 0.005)).abs() < 1e-9;
        assert!((0..).zip(q).all(is_true));
        assert_eq!(read.unwrapped_angles()[0].jumps, 2);
    }

    #[test]
    fn corrections_undo_what_was_spoilt() {
        let intact = recording(f64::sin);
        let mut read = intact.clone();
        read.scale_column("q", -4.0);
        read.exchange_columns("q", "motor", [ColumnScaling::default(); 2]);
        let [moved, before] = [read.column("motor").unwrap()[7], intact.column("q").unwrap()[7]];
        assert!((moved + 4.0 * before).abs() < 1e-12);
        read.exchange_columns("motor", "q", [ColumnScaling::default(); 2]);
        read.scale_column("q", -0.25);
        assert_eq!(read, intact);
        read.leave_out_samples("motor", &|t| (1.0..2.0).contains(&t));
        let lost = read.lost_samples("motor").unwrap();
        assert_eq!(lost.iter().filter(|lost| **lost).count(), 200);
        assert!(lost[200] && !lost[199] && !lost[400]);
    }
}
