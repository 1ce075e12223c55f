//! What a prepared run tells of itself: periods and the spread of its forces over them, and standstill.

use crate::motion::periods;
use crate::motion::run::Run;
use crate::motion::series::Periodic;
use crate::motion::smooth::Recorded;
use crate::recording::{Note, Recording};
use crate::words::{count_of, list, seven_digits};

/// A series that leaves more of a motion than this part is not its series.
const LEFT_OVER: f64 = 1e-2;

impl Recording {
    /// Looks for a period, unless that of the motion's series is known; the spread of the forces over it is the noise floor.
    pub(crate) fn note_repeats(&self, columns: &[Recorded<'_>], drives: &[String], run: &mut Run) {
        let positions: Vec<&[f64]> = columns.iter().map(|column| column.q).collect();
        let Some(forces) = &run.force else { return };
        let known = run.prepared.period;
        let period = known.or_else(|| periods::find_period(&run.time, &positions));
        let Some(period) = period else { return };
        run.repeats = periods::repeats(&run.time, period, drives, forces);
        if let Some(repeats) = &run.repeats {
            run.notes.push(Note::info(format!(
                "The motion in {} repeats itself every {} s, {} times in all; over these periods the forces spread \
                 by {:.3} % of their size, the noise floor.",
                self.file(),
                seven_digits(period),
                repeats.periods,
                100.0 * repeats.noise_floor
            )));
        }
    }

    /// Says that the motion is taken for a series, and what that leaves of it.
    pub(crate) fn describe_series(&self, found: &Periodic, columns: &[&Recorded<'_>]) -> String {
        let names: Vec<String> = columns.iter().map(|column| column.name.clone()).collect();
        let left = columns.iter().zip(&found.noise).map(|(column, noise)| {
            let derivative = if column.qd.is_some() { "_d" } else { "" };
            format!("{noise:.2e} of `{}{derivative}`", column.name)
        });
        format!(
            "Derivatives of {} in {} are those of a Fourier series of period {} s with {}, since it leaves nothing but \
             white noise: {} (RMS); option `smoothing` = `butterworth` filters instead.",
            list(&names),
            self.file(),
            seven_digits(found.period),
            count_of(found.harmonics, "harmonic", "harmonics"),
            left.collect::<Vec<_>>().join(", ")
        )
    }

    /// Says what a series that was asked for leaves of the motion, where that is too much.
    pub(crate) fn note_left_over(
        &self,
        columns: &[Recorded<'_>],
        states: &[[Vec<f64>; 3]],
        notes: &mut Vec<Note>,
    ) {
        for (column, [q, ..]) in columns.iter().zip(states) {
            let mean = column.q.iter().sum::<f64>() / column.q.len() as f64;
            let size: f64 = column.q.iter().map(|v| (v - mean).powi(2)).sum();
            let left: f64 = column.q.iter().zip(q).map(|(a, b)| (a - b).powi(2)).sum();
            if left > LEFT_OVER.powi(2) * size {
                notes.push(Note::warning(format!(
                    "The Fourier series leaves {:.1} % of the motion of `{}` in {} (RMS): it has another period, or none; \
                     take another smoothing.",
                    100.0 * (left / size).sqrt(),
                    column.name,
                    self.file()
                )));
            }
        }
    }

    /// Says which coordinates stand still, for how much of the time.
    pub(crate) fn note_standstill(&self, coordinates: &[String], run: &mut Run) {
        for (name, q) in coordinates.iter().zip(&run.q) {
            let (low, high) = q
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
                    (l.min(*v), h.max(*v))
                });
            if q.len() > 1 && high <= low {
                run.notes.push(Note::warning(format!(
                    "`{name}` does not move in {}: what depends on its motion cannot be identified.",
                    self.file()
                )));
            }
        }
        let mut resting = Vec::new();
        for (name, qd) in coordinates.iter().zip(&run.qd) {
            let fastest = qd.iter().map(|rate| rate.abs()).fold(0.0, f64::max);
            let slow = qd
                .iter()
                .filter(|rate| rate.abs() <= 0.01 * fastest)
                .count();
            // A motion that reverses now and then is slow for a per cent or two of its time.
            if fastest > 0.0 && 10 * slow > qd.len() {
                resting.push(format!("`{name}` for {} %", 100 * slow / qd.len()));
            }
        }
        if !resting.is_empty() {
            run.notes.push(Note::info(format!(
                "In {} there is standstill, a rate below a hundredth of the fastest: {} of the samples. Friction takes any \
                 value there; option `standstill` = `0.01` leaves such equations out of a fit.",
                self.file(),
                resting.join(", ")
            )));
        }
    }
}
