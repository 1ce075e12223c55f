//! Faults of sensors that are plain before any physics: missing forces, spikes of forces, jumps of positions. A recording goes
//! in; what joins its neighbours instead, each fault named with its count, place and size, comes out.

use crate::recording::column::SignalColumn;
use crate::recording::read::sample_place_word;
use crate::recording::{RecordingNote, SignalRecording};
use crate::signal::{median, white_noise};
use crate::words::{count_of, with_digits};

/// A spike stands so many times as far off its neighbours as the noise does.
const ABOVE_NOISE: f64 = 20.0;
/// And by this part of what the force reaches otherwise: friction that reverses stays below it.
const MIN_RANGE_SHARE: f64 = 0.5;
/// Samples of a spike at most; what lasts longer may be a contact.
const LONGEST: usize = 3;
/// Samples to either side that a value is held against.
const NEIGHBOURS: usize = 5;
/// A jump of a position is so many times as far as any other step is off its neighbours.
const MIN_JUMP_RATIO: f64 = 8.0;
/// Jumps of a position at most, as a part of its samples: what happens often is how the sensor is.
const RARE: f64 = 0.002;
/// Rates before and behind a step of so many usual ones are no neighbours: the motion has gone on meanwhile.
const GAP: f64 = 3.5;
/// Neighbours to either side of a rate at least, where a gap cuts them off.
const FEWEST: usize = 2;

impl SignalRecording {
    /// Puts in place what stands for values that were not measured, where `is_lacking_allowed`, and for those of sensors that
    /// failed; forces there count no more. `is_made` says of a drive and a sample whether the mechanism itself may make a
    /// spike there, as close to a singular pose. What is done goes into the notes.
    pub fn repair(
        &mut self,
        coordinates: &[String],
        drives: &[String],
        is_lacking_allowed: bool,
        is_made: &dyn Fn(usize, usize) -> bool,
    ) {
        let place = sample_place_word(&self.file);
        let mut notes = Vec::new();
        for (drive, name) in drives.iter().enumerate() {
            let Some(column) = self.columns.get_mut(name).filter(|c| c.text.is_none()) else {
                continue;
            };
            if column.not_finite.is_some() {
                if !is_lacking_allowed {
                    continue;
                }
                let lost: Vec<bool> = column.values.iter().map(|v| !v.is_finite()).collect();
                let n = lost.iter().filter(|lost| **lost).count();
                if n == lost.len() {
                    continue;
                }
                column.not_finite = None;
                let prefix = format!("Column `{name}` of {} holds NaN", self.file);
                self.notes
                    .retain(|note| !note.says.in_library_words().starts_with(&prefix));
                let first = lost.iter().position(|lost| *lost).unwrap_or(0);
                notes.push(RecordingNote::warning(format!(
                    "{n} of {} samples of {} lack the force of `{name}`, the first in {place} {}: positions there are kept, \
                     and the force of this drive counts in no equation and no figure.",
                    lost.len(),
                    self.file,
                    self.lines[first]
                )));
                column.interpolated = lost;
                column.interpolate_lost();
            }
            if let Some((spikes, share)) = find_spikes(&column.values, &|i| is_made(drive, i)) {
                let n = spikes.iter().filter(|spike| **spike).count();
                let at: Vec<usize> = (0..spikes.len()).filter(|i| spikes[*i]).collect();
                let largest = at
                    .iter()
                    .map(|i| column.values[*i])
                    .max_by(|a, b| a.abs().total_cmp(&b.abs()));
                notes.push(RecordingNote::warning(format!(
                    "The force of `{name}` in {} has {} that no drive makes, up to {} and first in {place} {}: {} of the sum \
                     of all squared forces. {} left out of the fit and of all figures.",
                    self.file,
                    count_of(n, "spike", "spikes"),
                    with_digits(largest.unwrap_or(0.0), 4),
                    self.lines[at[0]],
                    percent(share),
                    if n == 1 { "It is" } else { "They are" },
                )));
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
        notes.extend(self.remove_jumps(coordinates));
        self.notes.extend(notes);
    }

    /// The recording with the faults of its sensors left in; `None` if none were taken out. What was not measured stays lost.
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

    /// Takes jumps out of positions, and says which.
    fn remove_jumps(&mut self, coordinates: &[String]) -> Vec<RecordingNote> {
        let place = sample_place_word(&self.file);
        let mut notes = Vec::new();
        let time = self.columns.get("t").map(|t| t.values.clone());
        for name in coordinates {
            let Some(column) = self.columns.get_mut(name) else {
                continue;
            };
            let is_sound = column.text.is_none() && column.not_finite.is_none();
            let Some(time) = time.as_deref().filter(|_| is_sound) else {
                continue;
            };
            let jumps = find_jumps(time, &column.values);
            if jumps.is_empty() {
                continue;
            }
            column.as_recorded = Some((column.values.clone(), column.interpolated.clone()));
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
                "`{name}` in {} jumps {}, by up to {} and first in {place} {}, which no mechanism does: {} taken out, so that \
                 positions behind keep step with those before{}. Left in, a jump counts as an acceleration {} times as \
                 large as any other.",
                self.file,
                match jumps.len() {
                    1 => "once".to_owned(),
                    n => format!("{n} times"),
                },
                with_digits(largest.unwrap_or(0.0), 3),
                self.lines[jumps[0].0],
                if jumps.len() == 1 { "it is" } else { "they are" },
                if off.abs() > 0.5 * largest.unwrap_or(0.0).abs() {
                    "; which of both is true only the machine's zero can tell"
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
    /// Puts straight lines between the nearest values that were measured in place of those that were not.
    fn interpolate_lost(&mut self) {
        let sound: Vec<usize> = (0..self.values.len())
            .filter(|i| !self.interpolated[*i])
            .collect();
        let (Some(first), Some(last)) = (sound.first().copied(), sound.last().copied()) else {
            return;
        };
        for i in 0..self.values.len() {
            if !self.interpolated[i] {
                continue;
            }
            let after = sound.partition_point(|k| *k < i);
            self.values[i] = if i < first {
                self.values[first]
            } else if i > last {
                self.values[last]
            } else {
                let (a, b) = (sound[after - 1], sound[after]);
                let part = (i - a) as f64 / (b - a) as f64;
                self.values[a] + part * (self.values[b] - self.values[a])
            };
        }
    }
}

/// Which samples of a force are spikes that the mechanism does not make, and their part of the squared force; `None` if there
/// are none.
fn find_spikes(force: &[f64], is_made: &dyn Fn(usize) -> bool) -> Option<(Vec<bool>, f64)> {
    let n = force.len();
    if n < 8 * NEIGHBOURS {
        return None;
    }
    let off: Vec<f64> = (0..n)
        .map(|i| force[i] - neighbour_median(force, i))
        .collect();
    let noise = 1.4826 * median(off.iter().map(|x| x.abs()).collect());
    let mut sorted = force.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let range = sorted[n - 1 - n / 100] - sorted[n / 100];
    let bound = (ABOVE_NOISE * noise.max(white_noise(force))).max(MIN_RANGE_SHARE * range);
    let mut spikes: Vec<bool> = (0..n)
        .map(|i| bound > 0.0 && off[i].abs() > bound && excess_over_neighbours(force, i) > bound)
        .collect();
    let mut i = 0;
    while i < n {
        let end = (i..n).find(|k| !spikes[*k]).unwrap_or(n);
        if end - i > LONGEST {
            spikes[i..end].fill(false);
        }
        i = end.max(i + 1);
    }
    // What comes often is how this force is.
    if spikes.iter().filter(|spike| **spike).count() as f64 > 0.01 * n as f64 {
        return None;
    }
    for (i, spike) in spikes.iter_mut().enumerate() {
        *spike = *spike && !is_made(i);
    }
    if !spikes.contains(&true) {
        return None;
    }
    let squares = |wanted: bool| -> f64 {
        let pairs = force.iter().zip(&spikes);
        pairs
            .map(|(f, spike)| if *spike || !wanted { f * f } else { 0.0 })
            .sum()
    };
    let share = squares(true) / squares(false);
    Some((spikes, share))
}

/// The median of the samples around one.
fn neighbour_median(values: &[f64], i: usize) -> f64 {
    let start = i.saturating_sub(NEIGHBOURS);
    let end = (i + NEIGHBOURS + 1).min(values.len());
    let around = (start..end).filter(|k| *k != i);
    median(around.map(|k| values[k]).collect())
}

/// How far a sample lies beyond what the samples before and those behind reach: where a force steps, as where friction reverses,
/// it is near those of one side.
fn excess_over_neighbours(values: &[f64], i: usize) -> f64 {
    let before = &values[i.saturating_sub(NEIGHBOURS)..i];
    let behind = &values[i + 1..(i + 1 + NEIGHBOURS).min(values.len())];
    // A few samples at an end of the recording may all be spikes.
    let sides = [before, behind]
        .into_iter()
        .filter(|side| side.len() == NEIGHBOURS);
    let off = sides.map(|side| (values[i] - median(side.to_vec())).abs());
    off.fold(f64::INFINITY, f64::min)
}

/// The neighbours of one of `n` rates, of which some are steps over gaps in time: from where to where. Beside a gap there are as
/// many before as behind, since rates on one side alone say what an acceleration adds; `None` where these are too few.
fn rate_neighbours(gaps: &[usize], k: usize, n: usize) -> Option<(usize, usize)> {
    let next = gaps.partition_point(|gap| *gap < k);
    if gaps.get(next) == Some(&k) {
        return None;
    }
    let before = next
        .checked_sub(1)
        .map_or(NEIGHBOURS, |at| k - gaps[at] - 1);
    let behind = gaps.get(next).map_or(NEIGHBOURS, |gap| gap - k - 1);
    let reach = before.min(behind).min(NEIGHBOURS);
    (reach >= FEWEST).then(|| (k.saturating_sub(reach), (k + reach + 1).min(n)))
}

/// Steps of a position that no neighbour makes likely, `(first sample behind, size)`.
fn find_jumps(time: &[f64], q: &[f64]) -> Vec<(usize, f64)> {
    let n = q.len();
    if n < 8 * NEIGHBOURS || time.len() != n {
        return Vec::new();
    }
    let usual = median(time.windows(2).map(|w| w[1] - w[0]).collect());
    let rates: Vec<f64> = (1..n)
        .map(|i| (q[i] - q[i - 1]) / (time[i] - time[i - 1]))
        .collect();
    let is_short = |i: usize| time[i] - time[i - 1] < 1.5 * usual;
    let cuts: Vec<usize> = (1..n)
        .filter(|i| time[*i] - time[i - 1] > GAP * usual)
        .map(|i| i - 1)
        .collect();
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
    // The largest that are no jumps: all but the rare ones, whose neighbours' medians may bear them too.
    let rare = crate::signal::float_to_count(RARE * n as f64).max(4);
    let Some(largest) = sizes.len().checked_sub(rare + 1).map(|at| sizes[at]) else {
        return Vec::new();
    };
    // A step of the encoder is none.
    let step = sizes
        .iter()
        .copied()
        .find(|size| *size > 0.0)
        .unwrap_or(0.0);
    let bound = MIN_JUMP_RATIO * largest.max(step);
    let turns = [std::f64::consts::TAU, 360.0];
    let is_turn = |size: f64| {
        turns
            .iter()
            .any(|turn| (size.abs() / turn - 1.0).abs() < 0.08)
    };
    let is_jump: Vec<bool> = (1..n)
        .map(|i| {
            let size = off[i - 1];
            is_short(i) && size.abs() > bound && bound > 0.0 && !is_turn(size)
        })
        .collect();
    let at = (0..n - 1).filter(|k| is_jump[*k]);
    at.map(|k| {
        // The rate between its neighbours that are none; the nearer one says more.
        let before = (0..k).rev().find(|j| !is_jump[*j]);
        let behind = (k + 1..n - 1).find(|j| !is_jump[*j]);
        let likely = match (before, behind) {
            (Some(a), Some(b)) => {
                rates[a] + (rates[b] - rates[a]) * (k - a) as f64 / (b - a) as f64
            }
            (one, other) => one.or(other).map_or(0.0, |j| rates[j]),
        };
        (k + 1, (rates[k] - likely) * (time[k + 1] - time[k]))
    })
    .collect()
}

/// How many times as large as any acceleration of the motion the one is that a jump would be.
fn jump_excess(q: &[f64], jump: f64) -> f64 {
    let second = |i: usize| (q[i + 1] - 2.0 * q[i] + q[i - 1]).abs();
    let largest = (1..q.len() - 1).map(second).fold(0.0, f64::max);
    if largest > 0.0 {
        jump.abs() / largest
    } else {
        f64::INFINITY
    }
}

/// A part as people read it.
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
        20.0 * (7.0 * f64::from(i) * 0.002).cos()
            + 4.0 * (3.0 * f64::from(i) * 0.002).cos().signum()
    }

    #[test]
    fn sound_signals_stay_as_they_are() {
        let sound = recording(q, |i| force(i).to_string());
        assert_eq!(sound.notes(), []);
        assert_eq!(sound.lost_samples("motor"), None);
        assert_eq!(sound.restore_sensor_faults(), None);
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
        let read =
            SignalRecording::from_reader(text.as_bytes(), "run.csv", &ReadOptions::default());
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
        assert!(
            says[1].contains("1 spike") && says[1].contains("1000000"),
            "{says:?}"
        );
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
        assert!(
            found
                .column("motor")
                .unwrap()
                .iter()
                .all(|f| f.abs() < 30.0)
        );
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
