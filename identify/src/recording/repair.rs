//! Repairs sensor faults that need no model to be recognised: missing forces, spikes of forces, jumps of positions. A
//! recording goes in. The same recording with interpolated values comes out, and each fault has a note with its
//! number, place and size.

use crate::recording::column::SignalColumn;
use crate::recording::read::sample_place_word;
use crate::recording::thresholds::{
    JUMP_FEWEST_NEIGHBOURS, JUMP_GAP_STEPS, JUMP_LONGEST_STEP, JUMPS_LEAST_ALLOWED, JUMPS_MOST_SHARE, MIN_JUMP_RATIO,
    REPAIR_NEIGHBOURHOODS, SPIKE_MOST_SAMPLES, SPIKE_NOISE_SIGMAS, SPIKE_RANGE_SHARE, SPIKES_MOST_SHARE,
    TURN_TOLERANCE, ZERO_SHIFT_SHARE,
};
use crate::recording::{RecordingNote, SignalRecording};
use crate::signal::{median, white_noise};
use crate::words::{count_of, with_digits};

/// Samples on each side that a value is compared with.
const NEIGHBOURS: usize = 5;

impl SignalRecording {
    /// Replaces missing values of forces, if `is_lacking_allowed`, and values of failed sensors by interpolation.
    /// Such samples of forces are marked and no longer count. `is_made` states for a drive and a sample whether the
    /// mechanism itself may cause a spike there, as near a singular pose. Notes state what was done.
    pub fn repair(
        &mut self,
        coordinates: &[String],
        drives: &[String],
        is_lacking_allowed: bool,
        is_made: &dyn Fn(usize, usize) -> bool,
    ) {
        let place = sample_place_word(&self.file);
        let mut notes = Vec::new();
        // Forces first: missing values, then spikes.
        for (drive, name) in drives.iter().enumerate() {
            let Some(column) = self.columns.get_mut(name).filter(|c| c.text.is_none()) else {
                continue;
            };
            if column.not_finite.is_some() {
                if !is_lacking_allowed {
                    continue;
                }
                // Samples without a force are marked and interpolated.
                let lost: Vec<bool> = column.values.iter().map(|v| !v.is_finite()).collect();
                let n = lost.iter().filter(|lost| **lost).count();
                if n == lost.len() {
                    continue;
                }
                column.not_finite = None;
                // The note that the column cannot be used is no longer true.
                let prefix = format!("Column `{name}` of {} contains NaN", self.file);
                self.notes
                    .retain(|note| !note.says.in_library_words().starts_with(&prefix));
                let first = lost.iter().position(|lost| *lost).unwrap_or(0);
                notes.push(RecordingNote::warning(format!(
                    "{n} of {} samples of {} lack the force of `{name}`, the first in {place} {}: positions there are kept, \
                     and the force of this drive is left out of all equations and error figures there.",
                    lost.len(),
                    self.file,
                    self.lines[first]
                )));
                column.interpolated = lost;
                column.interpolate_lost();
            }
            if let Some((spikes, share)) = find_spikes(&column.values, &|i| is_made(drive, i)) {
                let n = spikes.iter().filter(|spike| **spike).count();
                // Positions of the spikes, the first and the largest of which are reported.
                let at: Vec<usize> = (0..spikes.len()).filter(|i| spikes[*i]).collect();
                let largest = at
                    .iter()
                    .map(|i| column.values[*i])
                    .max_by(|a, b| a.abs().total_cmp(&b.abs()));
                notes.push(RecordingNote::warning(format!(
                    "The force of `{name}` in {} has {} that no drive can cause, up to {} and first in {place} {}: {} of the sum \
                     of all squared forces. {} left out of the fit and of all figures.",
                    self.file,
                    count_of(n, "spike", "spikes"),
                    with_digits(largest.unwrap_or(0.0), 4),
                    self.lines[at[0]],
                    percent(share),
                    if n == 1 { "It is" } else { "They are" },
                )));
                // The values before the repair are kept, so that it can be undone.
                column.as_recorded = Some((column.values.clone(), column.interpolated.clone()));
                if column.interpolated.is_empty() {
                    column.interpolated = vec![false; spikes.len()];
                }
                for (lost, spike) in column.interpolated.iter_mut().zip(&spikes) {
                    *lost |= spike;
                }
                column.interpolate_lost();
            }
        }
        // Positions next: jumps are removed.
        notes.extend(self.remove_jumps(coordinates));
        self.notes.extend(notes);
    }

    /// The recording before the repair of sensor faults; `None` if there were none. Missing values stay interpolated.
    pub fn restore_sensor_faults(&self) -> Option<Self> {
        let is_mended = |column: &SignalColumn| column.as_recorded.is_some();
        if !self.columns.values().any(is_mended) {
            return None;
        }
        let mut recording = self.clone();
        for column in recording.columns.values_mut() {
            if let Some(recorded) = column.as_recorded.take() {
                (column.values, column.interpolated) = recorded;
            }
        }
        Some(recording)
    }

    /// Removes jumps from positions and returns a note for each coordinate with jumps.
    fn remove_jumps(&mut self, coordinates: &[String]) -> Vec<RecordingNote> {
        let place = sample_place_word(&self.file);
        let mut notes = Vec::new();
        let time = self.columns.get("t").map(|t| t.values.clone());
        for name in coordinates {
            let Some(column) = self.columns.get_mut(name) else {
                continue;
            };
            // Columns with defects, and recordings without a time, are not checked.
            let is_sound = column.text.is_none() && column.not_finite.is_none();
            let Some(time) = time.as_deref().filter(|_| is_sound) else {
                continue;
            };
            let jumps = find_jumps(time, &column.values);
            if jumps.is_empty() {
                continue;
            }
            column.as_recorded = Some((column.values.clone(), column.interpolated.clone()));
            // Subtract the sum of all jumps so far from every later sample.
            let mut off = 0.0;
            let mut next = 0;
            for i in 0..column.values.len() {
                while next < jumps.len() && jumps[next].0 == i {
                    off += jumps[next].1;
                    next += 1;
                }
                column.values[i] -= off;
            }
            let largest = jumps
                .iter()
                .map(|(_, size)| *size)
                .max_by(|a, b| a.abs().total_cmp(&b.abs()));
            notes.push(RecordingNote::warning(format!(
                "`{name}` in {} jumps {}, by up to {} and first in {place} {}, which is not physical: {} removed, so that \
                 later positions continue those before{}. Otherwise a jump would count as an acceleration {} times as \
                 large as any other.",
                self.file,
                match jumps.len() {
                    1 => "once".to_owned(),
                    n => format!("{n} times"),
                },
                with_digits(largest.unwrap_or(0.0), 3),
                self.lines[jumps[0].0],
                if jumps.len() == 1 { "it is" } else { "they are" },
                if off.abs() > ZERO_SHIFT_SHARE * largest.unwrap_or(0.0).abs() {
                    "; only the zero position of the machine shows which of the two is true"
                } else {
                    ""
                },
                with_digits(jump_excess(&column.values, largest.unwrap_or(0.0)), 2),
            )));
        }
        notes
    }
}

impl SignalColumn {
    /// Replaces samples that are marked by linear interpolation between their measured neighbours.
    ///
    /// Before the first and behind the last measured sample the nearest value is used.
    pub(super) fn interpolate_lost(&mut self) {
        let intact: Vec<usize> = (0..self.values.len()).filter(|i| !self.interpolated[*i]).collect();
        let (Some(first), Some(last)) = (intact.first().copied(), intact.last().copied()) else {
            return;
        };
        for i in 0..self.values.len() {
            if !self.interpolated[i] {
                continue;
            }
            let after = intact.partition_point(|k| *k < i);
            self.values[i] = if i < first {
                self.values[first]
            } else if i > last {
                self.values[last]
            } else {
                let (a, b) = (intact[after - 1], intact[after]);
                let part = (i - a) as f64 / (b - a) as f64;
                self.values[a] + part * (self.values[b] - self.values[a])
            };
        }
    }
}

/// Marks the spikes of a force that the mechanism does not cause, and gives their share of the sum of squares; `None`
/// if there are none.
fn find_spikes(force: &[f64], is_made: &dyn Fn(usize) -> bool) -> Option<(Vec<bool>, f64)> {
    let n = force.len();
    // Short recordings have too few samples for a noise estimate.
    if n < REPAIR_NEIGHBOURHOODS * NEIGHBOURS {
        return None;
    }
    // Deviation of each sample from the median of its neighbours.
    let off: Vec<f64> = (0..n).map(|i| force[i] - neighbour_median(force, i)).collect();
    // 1.4826 times the median absolute deviation is the standard deviation of normal noise.
    let noise = 1.4826 * median(off.iter().map(|x| x.abs()).collect());
    // The range of the force without the outer percent on each side.
    let mut sorted = force.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let range = sorted[n - 1 - n / 100] - sorted[n / 100];
    let bound = (SPIKE_NOISE_SIGMAS * noise.max(white_noise(force))).max(SPIKE_RANGE_SHARE * range);
    // A spike must exceed the bound relative to all its neighbours, and relative to each side.
    let mut spikes: Vec<bool> = (0..n)
        .map(|i| bound > 0.0 && off[i].abs() > bound && excess_over_neighbours(force, i) > bound)
        .collect();
    // Longer runs are not spikes.
    let mut i = 0;
    while i < n {
        let end = (i..n).find(|k| !spikes[*k]).unwrap_or(n);
        if end - i > SPIKE_MOST_SAMPLES {
            spikes[i..end].fill(false);
        }
        i = end.max(i + 1);
    }
    // A frequent deviation is a property of the signal and not a fault.
    if spikes.iter().filter(|spike| **spike).count() as f64 > SPIKES_MOST_SHARE * n as f64 {
        return None;
    }
    // Spikes that the mechanism may cause are kept.
    for (i, spike) in spikes.iter_mut().enumerate() {
        *spike = *spike && !is_made(i);
    }
    if !spikes.contains(&true) {
        return None;
    }
    // Sum of squares of the spikes, or of all samples.
    let squares = |wanted: bool| -> f64 {
        let pairs = force.iter().zip(&spikes);
        pairs
            .map(|(f, spike)| if *spike || !wanted { f * f } else { 0.0 })
            .sum()
    };
    let share = squares(true) / squares(false);
    Some((spikes, share))
}

/// The median of the samples on both sides of one, without the sample itself.
fn neighbour_median(values: &[f64], i: usize) -> f64 {
    let start = i.saturating_sub(NEIGHBOURS);
    let end = (i + NEIGHBOURS + 1).min(values.len());
    let around = (start..end).filter(|k| *k != i);
    median(around.map(|k| values[k]).collect())
}

/// The smaller deviation of a sample from the medians of the two sides. Where a force steps, as at a reversal of
/// friction, the sample is near one of them.
fn excess_over_neighbours(values: &[f64], i: usize) -> f64 {
    let before = &values[i.saturating_sub(NEIGHBOURS)..i];
    let behind = &values[i + 1..(i + 1 + NEIGHBOURS).min(values.len())];
    // A side with few samples at an end of the recording may consist of spikes only, so it is ignored.
    let sides = [before, behind].into_iter().filter(|side| side.len() == NEIGHBOURS);
    let off = sides.map(|side| (values[i] - median(side.to_vec())).abs());
    off.fold(f64::INFINITY, f64::min)
}

/// The range of neighbours of one of `n` rates, given the rates that are steps over gaps in time. Next to a gap both
/// sides have the same number, since one side alone would be biased by the acceleration. `None` if there are too few.
fn rate_neighbours(gaps: &[usize], k: usize, n: usize) -> Option<(usize, usize)> {
    // The nearest gaps before and behind limit the range.
    let next = gaps.partition_point(|gap| *gap < k);
    if gaps.get(next) == Some(&k) {
        return None;
    }
    let before = next.checked_sub(1).map_or(NEIGHBOURS, |at| k - gaps[at] - 1);
    let behind = gaps.get(next).map_or(NEIGHBOURS, |gap| gap - k - 1);
    let reach = before.min(behind).min(NEIGHBOURS);
    (reach >= JUMP_FEWEST_NEIGHBOURS).then(|| (k.saturating_sub(reach), (k + reach + 1).min(n)))
}

/// Steps of a position that do not fit their neighbours, as pairs of the first sample behind and the size.
///
/// Full turns in rad or degrees are not jumps, because they are unwrapped elsewhere.
fn find_jumps(time: &[f64], q: &[f64]) -> Vec<(usize, f64)> {
    let n = q.len();
    if n < REPAIR_NEIGHBOURHOODS * NEIGHBOURS || time.len() != n {
        return Vec::new();
    }
    // Rates of all steps, the median step of time, and the steps that are gaps.
    let usual = median(time.windows(2).map(|w| w[1] - w[0]).collect());
    let rates: Vec<f64> = (1..n).map(|i| (q[i] - q[i - 1]) / (time[i] - time[i - 1])).collect();
    let is_short = |i: usize| time[i] - time[i - 1] < JUMP_LONGEST_STEP * usual;
    let cuts: Vec<usize> = (1..n)
        .filter(|i| time[*i] - time[i - 1] > JUMP_GAP_STEPS * usual)
        .map(|i| i - 1)
        .collect();
    // Deviation of each step from the one that the median rate of its neighbours predicts.
    let off: Vec<f64> = (0..n - 1)
        .map(|k| {
            let around = rate_neighbours(&cuts, k, n - 1);
            around.map_or(0.0, |(start, end)| {
                let others = rates[start..k].iter().chain(&rates[k + 1..end]);
                (rates[k] - median(others.copied().collect())) * (time[k + 1] - time[k])
            })
        })
        .collect();
    let mut sizes: Vec<f64> = off.iter().map(|x| x.abs()).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    // The largest ordinary deviation: all but the rare ones, because the medians of their neighbours may be affected
    // as well.
    let rare = crate::signal::float_to_count(JUMPS_MOST_SHARE * n as f64).max(JUMPS_LEAST_ALLOWED);
    let Some(largest) = sizes.len().checked_sub(rare + 1).map(|at| sizes[at]) else {
        return Vec::new();
    };
    // The resolution of the encoder is not a jump.
    let step = sizes.iter().copied().find(|size| *size > 0.0).unwrap_or(0.0);
    let bound = MIN_JUMP_RATIO * largest.max(step);
    // A wrapped angle steps by one turn, in rad or degrees.
    let turns = [std::f64::consts::TAU, 360.0];
    let is_turn = |size: f64| {
        turns
            .iter()
            .any(|turn| (size.abs() / turn - 1.0).abs() < TURN_TOLERANCE)
    };
    let is_jump: Vec<bool> = (1..n)
        .map(|i| {
            let size = off[i - 1];
            is_short(i) && size.abs() > bound && bound > 0.0 && !is_turn(size)
        })
        .collect();
    // The size of a jump is its deviation from the rates of ordinary steps around it.
    let at = (0..n - 1).filter(|k| is_jump[*k]);
    at.map(|k| {
        // Rate at the step, interpolated between the nearest ordinary steps on both sides.
        let before = (0..k).rev().find(|j| !is_jump[*j]);
        let behind = (k + 1..n - 1).find(|j| !is_jump[*j]);
        let likely = match (before, behind) {
            (Some(a), Some(b)) => rates[a] + (rates[b] - rates[a]) * (k - a) as f64 / (b - a) as f64,
            (one, other) => one.or(other).map_or(0.0, |j| rates[j]),
        };
        (k + 1, (rates[k] - likely) * (time[k + 1] - time[k]))
    })
    .collect()
}

/// The jump as a multiple of the largest second difference of the positions.
fn jump_excess(q: &[f64], jump: f64) -> f64 {
    let second = |i: usize| (q[i + 1] - 2.0 * q[i] + q[i - 1]).abs();
    let largest = (1..q.len() - 1).map(second).fold(0.0, f64::max);
    if largest > 0.0 {
        jump.abs() / largest
    } else {
        f64::INFINITY
    }
}

/// A share in percent with three digits.
fn percent(part: f64) -> String {
    format!("{} %", with_digits(100.0 * part, 3))
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;
    use crate::{NonFinitePolicy, ReadOptions};

    fn recording(q: impl Fn(u32) -> f64, force: impl Fn(u32) -> String) -> SignalRecording {
        let mut text = "t,q,motor\n".to_owned();
        for i in 0..1000 {
            let _ = writeln!(text, "{},{},{}", f64::from(i) * 0.002, q(i), force(i));
        }
        let options = ReadOptions {
            not_finite: NonFinitePolicy::LeaveOut,
            may_be_missing: vec!["motor".to_owned()],
            ..ReadOptions::default()
        };
        let read = SignalRecording::from_reader(text.as_bytes(), "run.csv", &options);
        let mut recording = read.unwrap();
        let (coordinates, drives) = (["q".to_owned()], ["motor".to_owned()]);
        recording.repair(&coordinates, &drives, true, &|_, _| false);
        recording
    }

    fn q(i: u32) -> f64 {
        (3.0 * f64::from(i) * 0.002).sin()
    }

    fn force(i: u32) -> f64 {
        20.0 * (7.0 * f64::from(i) * 0.002).cos() + 4.0 * (3.0 * f64::from(i) * 0.002).cos().signum()
    }

    #[test]
    fn sound_signals_stay_as_they_are() {
        let intact = recording(q, |i| force(i).to_string());
        assert_eq!(intact.notes(), []);
        assert_eq!(intact.lost_samples("motor"), None);
        assert_eq!(intact.restore_sensor_faults(), None);
        // A coarse encoder makes steps all the time.
        let coarse = recording(|i| (q(i) * 200.0).round() / 200.0, |i| force(i).to_string());
        assert_eq!(coarse.notes(), []);
    }

    /// A joint that carries friction alone: all of its force turns over where it reverses.
    #[test]
    fn friction_that_reverses_makes_no_spikes() {
        let steps = recording(q, |i| {
            let rate = (3.0 * f64::from(i) * 0.002).cos();
            (0.25 * rate.signum() + 0.01 * rate).to_string()
        });
        assert_eq!(steps.notes(), []);
        assert_eq!(steps.lost_samples("motor"), None);
    }

    /// A slow motion that goes on while nothing is recorded: fine encoders make steps beside which the rates behind the gap are
    /// far off those before it.
    #[test]
    fn lost_samples_are_no_jumps() {
        let mut text = "t,q,motor\n".to_owned();
        for i in (0..400).chain(900..1400).chain(1403..2000) {
            let t = f64::from(i) * 0.002;
            let _ = writeln!(text, "{t},{},{}", (3.0 * t).sin(), (7.0 * t).cos());
        }
        let read = SignalRecording::from_reader(text.as_bytes(), "run.csv", &ReadOptions::default());
        let mut recording = read.unwrap();
        let before = recording.column("q").unwrap().to_vec();
        let (coordinates, drives) = (["q".to_owned()], ["motor".to_owned()]);
        recording.repair(&coordinates, &drives, true, &|_, _| false);
        assert_eq!(recording.column("q").unwrap(), before);
        assert_eq!(recording.restore_sensor_faults(), None);
    }

    #[test]
    fn missing_forces_and_spikes_are_left_out_and_named() {
        let found = recording(q, |i| match i {
            300 | 301 => "nan".to_owned(),
            700 => "1e6".to_owned(),
            _ => force(i).to_string(),
        });
        assert_eq!(found.samples(), 1000);
        let lost = found.lost_samples("motor").unwrap();
        let at: Vec<usize> = (0..1000).filter(|i| lost[*i]).collect();
        assert_eq!(at, [300, 301, 700]);
        assert!((found.column("motor").unwrap()[700] - force(700)).abs() < 0.5);
        let faulty = found.restore_sensor_faults().unwrap();
        assert!((faulty.column("motor").unwrap()[700] - 1e6).abs() < 1e-9);
        let lost = faulty.lost_samples("motor").unwrap();
        assert!(lost[300] && lost[301] && !lost[700]);
        let says = found.notes().iter().map(|n| n.says.in_library_words());
        let says: Vec<String> = says.collect();
        assert_eq!(says.len(), 2, "{says:?}");
        assert!(says[0].contains("2 of 1000 samples") && says[0].contains("line 302"));
        assert!(says[1].contains("1 spike") && says[1].contains("1000000"), "{says:?}");
    }

    /// A logger that starts with garbage: its first sample has nothing before it, its second has only the first.
    #[test]
    fn spikes_at_the_ends_are_left_out() {
        let found = recording(q, |i| match i {
            0 | 1 | 998 | 999 => "1e6".to_owned(),
            _ => force(i).to_string(),
        });
        let lost = found.lost_samples("motor").unwrap();
        let at: Vec<usize> = (0..1000).filter(|i| lost[*i]).collect();
        assert_eq!(at, [0, 1, 998, 999]);
        assert!(found.column("motor").unwrap().iter().all(|f| f.abs() < 30.0));
    }

    #[test]
    fn jumps_are_taken_out_and_named() {
        let found = recording(
            |i| q(i) + if i >= 400 { 0.02 } else { 0.0 } + if i == 800 { -0.01 } else { 0.0 },
            |i| force(i).to_string(),
        );
        let values = found.column("q").unwrap();
        for (i, value) in (0..1000).zip(values) {
            assert!((value - q(i)).abs() < 1e-4, "{i}");
        }
        assert!(
            found.notes()[0]
                .says
                .in_library_words()
                .contains("jumps 3 times, by up to 0.02")
        );
    }
}
