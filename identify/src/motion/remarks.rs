//! Notes on a prepared run: its period and the spread of its forces, encoder steps, and standstill.
//!
//! Columns and the run go in; notes for the user come out.

use std::f64::consts::TAU;

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, Remedy};

use crate::motion::derivatives::mean_rate;
use crate::motion::periods;
use crate::motion::run::PreparedRun;
use crate::motion::series::PeriodicSeries;
use crate::motion::smooth::RecordedCoordinate;
use crate::motion::thresholds::{
    ENCODER_EQUAL_ONE_IN, ENCODER_NOISE_SHARE, ENCODER_ON_GRID_SHARE, ENCODER_STEP_TOLERANCE, MAX_SERIES_RESIDUAL,
    STANDSTILL_ONE_IN, STANDSTILL_RATE_SHARE,
};
use crate::recording::{RecordingNote, SignalRecording};
use crate::words::{backquoted_list, count_of, seven_digits, with_digits};

/// The step of an encoder. `None` unless neighbouring positions are often equal and all others differ by integer
/// multiples.
fn encoder_step(q: &[f64]) -> Option<f64> {
    let steps: Vec<f64> = q.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    let largest = steps.iter().copied().fold(0.0, f64::max);
    let is_same = |step: &&f64| **step <= 1e-9 * largest;
    let same = steps.iter().filter(is_same).count();
    // Without equal neighbours the signal is not quantised visibly.
    if ENCODER_EQUAL_ONE_IN * same < steps.len() {
        return None;
    }
    // The smallest difference is the step.
    let step = steps
        .iter()
        .copied()
        .filter(|step| *step > 1e-9 * largest)
        .reduce(f64::min)?;
    let is_whole = |size: &&f64| {
        let multiple = **size / step;
        (multiple - multiple.round()).abs() < ENCODER_STEP_TOLERANCE
    };
    let whole = steps.iter().filter(is_whole).count();
    (whole as f64 >= ENCODER_ON_GRID_SHARE * steps.len() as f64).then_some(step)
}

impl SignalRecording {
    /// Looks for a period, unless the series has one, and adds the spread of the forces over the periods to the run.
    pub(crate) fn note_repeatability(
        &self,
        columns: &[RecordedCoordinate<'_>],
        drives: &[String],
        run: &mut PreparedRun,
    ) {
        let positions: Vec<&[f64]> = columns.iter().map(|column| column.q).collect();
        let Some(forces) = &run.force else { return };
        let known = run.prepared.period;
        let period = known.or_else(|| periods::find_period(&run.time, &positions));
        let Some(period) = period else { return };
        run.repeatability = periods::measure_repeatability(&run.time, period, drives, forces);
        if let Some(repeats) = &run.repeatability {
            run.notes.push(RecordingNote::info(format!(
                "The motion in {} repeats itself every {} s, {} times in all. From period to period the forces differ by \
                 {:.3} % of their rms value. This part is non-repeatable (noise, drift): no function of the state explains it.",
                self.file(),
                seven_digits(period),
                repeats.periods,
                100.0 * repeats.noise_floor
            )));
        }
    }

    /// The note on a series that was chosen automatically, with its residual for each coordinate.
    pub(crate) fn describe_series(&self, found: &PeriodicSeries, columns: &[&RecordedCoordinate<'_>]) -> Message {
        let names: Vec<String> = columns.iter().map(|column| column.name.clone()).collect();
        // Residuals of rates are marked, because these were fitted if they are recorded.
        let left = columns.iter().zip(&found.noise).map(|(column, noise)| {
            let derivative = if column.qd.is_some() { "_d" } else { "" };
            format!("`{}{derivative}` {noise:.2e}", column.name)
        });
        message!(
            "Derivatives of {} in {} are those of a Fourier series of period {} s with {}, because its residual is \
             white noise (rms, in SI units: {}). Use {} to filter instead.",
            backquoted_list(&names),
            self.file(),
            seven_digits(found.period),
            count_of(found.harmonics, "harmonic", "harmonics"),
            left.collect::<Vec<_>>().join(", "),
            Remedy::option(OptionName::Smoothing).with_value("butterworth")
        )
    }

    /// Warns if the residual of a requested series is a large part of the motion.
    pub(crate) fn note_series_residual(
        &self,
        columns: &[RecordedCoordinate<'_>],
        states: &[[Vec<f64>; 3]],
        notes: &mut Vec<RecordingNote>,
    ) {
        for (column, [q, ..]) in columns.iter().zip(states) {
            // Squares of the motion around its mean, and of the residual.
            let mean = column.q.iter().sum::<f64>() / column.q.len() as f64;
            let size: f64 = column.q.iter().map(|v| (v - mean).powi(2)).sum();
            let left: f64 = column.q.iter().zip(q).map(|(a, b)| (a - b).powi(2)).sum();
            if left > MAX_SERIES_RESIDUAL.powi(2) * size {
                notes.push(RecordingNote::warning(format!(
                    "The residual of the Fourier series is {:.1} % of the motion of `{}` in {} (RMS). The motion has another period, \
                     or none: choose another smoothing.",
                    100.0 * (left / size).sqrt(),
                    column.name,
                    self.file()
                )));
            }
        }
    }

    /// Warns of encoders whose steps cause noise in the accelerations.
    pub(crate) fn note_encoder_steps(&self, columns: &[RecordedCoordinate<'_>], run: &mut PreparedRun) {
        let Some(cutoff) = run.prepared.cutoff_hz else {
            return;
        };
        // Noise above the band of the forces is removed by the filter on their rows.
        let band = run.prepared.band_hz.unwrap_or(cutoff);
        let cutoff = cutoff.min(band);
        let rate = mean_rate(&run.time);
        let mut found = Vec::new();
        for (column, qdd) in columns.iter().zip(&run.qdd) {
            if column.qd.is_some() {
                continue;
            }
            let Some(step) = encoder_step(column.q) else {
                continue;
            };
            // White noise with variance step^2/12 below the cut-off, differentiated twice.
            let noise = step / 12.0_f64.sqrt() * (2.0 / rate * TAU.powi(4) * cutoff.powi(5) / 5.0).sqrt();
            let size = (qdd.iter().map(|a| a * a).sum::<f64>() / qdd.len() as f64).sqrt();
            if noise > ENCODER_NOISE_SHARE * size && size > 0.0 {
                found.push(format!(
                    "`{}` of {} ({:.1} %)",
                    column.name,
                    with_digits(step, 3),
                    100.0 * noise / size
                ));
            }
        }
        if !found.is_empty() {
            run.notes.push(RecordingNote::warning(format!(
                "Positions in {} are quantised in steps of the encoder: {}. The number in brackets is their noise as a share of the \
                 accelerations. It makes inertias too small and hides weak effects; record a periodic motion, or use a finer encoder.",
                self.file(),
                found.join(", ")
            )));
        }
    }

    /// Reports coordinates that do not move, and those with standstill for more than a tenth of the samples.
    pub(crate) fn note_standstill(&self, coordinates: &[String], run: &mut PreparedRun) {
        // Coordinates without any motion.
        for (name, q) in coordinates.iter().zip(&run.q) {
            let (low, high) = q
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
            if q.len() > 1 && high <= low {
                run.notes.push(RecordingNote::warning(format!(
                    "`{name}` does not move in {}: parameters that depend on its motion cannot be identified.",
                    self.file()
                )));
            }
        }
        // Coordinates that are slow for a part of the time.
        let mut resting = Vec::new();
        for (name, qd) in coordinates.iter().zip(&run.qd) {
            let fastest = qd.iter().map(|rate| rate.abs()).fold(0.0, f64::max);
            let slow = qd
                .iter()
                .filter(|rate| rate.abs() <= STANDSTILL_RATE_SHARE * fastest)
                .count();
            // A motion that reverses sometimes is slow for one or two percent of its time.
            if fastest > 0.0 && STANDSTILL_ONE_IN * slow > qd.len() {
                resting.push(format!("`{name}` for {} %", 100 * slow / qd.len()));
            }
        }
        if !resting.is_empty() {
            run.notes.push(RecordingNote::info(message!(
                "In {} there is standstill, a rate below a hundredth of the fastest: {} of the samples. Friction takes any \
                 value there; {} leaves such equations out of a fit.",
                self.file(),
                resting.join(", "),
                Remedy::option(OptionName::Standstill).with_value("0.01")
            )));
        }
    }
}
