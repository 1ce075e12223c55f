//! Selects the smoothing that fits a recording, and prepares states with it: columns go in, positions with both
//! derivatives come out.

use crate::motion::cutoff::{DifferentiatedSignal, choose_cutoff};
use crate::motion::derivatives::mean_rate;
use crate::motion::even::{is_even, resample_evenly};
use crate::motion::options::{SmoothingMethod, StatePreparation};
use crate::motion::prepared_as::PreparationRecord;
use crate::motion::run::PreparedRun;
use crate::motion::series::{self, PeriodicSeries};
use crate::motion::smooth::{RecordedCoordinate, SmoothingFilter};
use crate::motion::thresholds::{
    CUTOFF_WITHOUT_MOTION_SHARE, PERIOD_LONGEST_DURATIONS, PERIOD_SHORTEST_STEPS, PLANNED_MOST_HARMONICS, TRIM_ONE_IN,
    TRIMMED_PERIODS,
};
use crate::motion::{local_polynomials, periods};
use crate::recording::{RecordingError, RecordingFault, RecordingNote, SignalRecording};
use crate::signal::{LowPass, float_to_count};
use crate::words::backquoted_list;

impl SignalRecording {
    /// States of all coordinates with the requested smoothing, or with the one that fits them. What was chosen is
    /// added to `prepared` and `notes`.
    ///
    /// Returns positions, rates and accelerations of each coordinate. Fails when there are too few samples, or when
    /// the cut-off
    /// or the period does not fit the recording.
    pub(crate) fn prepare_states(
        &self,
        time: &[f64],
        columns: &[RecordedCoordinate<'_>],
        preparation: &StatePreparation,
        prepared: &mut PreparationRecord,
        notes: &mut Vec<RecordingNote>,
    ) -> Result<Vec<[Vec<f64>; 3]>, RecordingError> {
        // Coordinates with both derivatives need no preparation.
        let incomplete: Vec<&RecordedCoordinate<'_>> = columns.iter().filter(|c| !c.is_complete()).collect();
        if incomplete.is_empty() {
            return Ok(columns.iter().filter_map(RecordedCoordinate::recorded_states).collect());
        }
        prepared.coordinates = incomplete.iter().map(|c| c.name.clone()).collect();
        let order = preparation.order;
        let rate = mean_rate(time);
        // Check the number of samples before anything is designed.
        if time.len() < 3 {
            return Err(self.fault(RecordingFault::TooFewSamples {
                have: time.len(),
                need: SmoothingFilter::Butterworth { order }.min_samples(),
                purpose: "preparing derivatives from positions".into(),
            }));
        }
        // A filter design, with a fault that names the coordinates.
        let design = |cutoff: f64| {
            LowPass::butterworth(order, cutoff, rate).map_err(|error| {
                self.fault(RecordingFault::Filter {
                    column: prepared.coordinates.join(", "),
                    error,
                })
            })
        };
        let need = design(rate / 4.0)?.padding() + 1;
        if time.len() < need {
            return Err(self.fault(RecordingFault::TooFewSamples {
                have: time.len(),
                need,
                purpose: "preparing derivatives from positions".into(),
            }));
        }
        let found = find_motion_series(time, columns, preparation);
        // One cut-off for all coordinates, so that loops stay closed.
        let chosen = || choose_cutoff_for(time, &incomplete, order);
        let cutoff = match &found {
            Some(found) => found.harmonics as f64 / found.period,
            None => preparation
                .cutoff_hz
                .or_else(chosen)
                .unwrap_or(CUTOFF_WITHOUT_MOTION_SHARE * rate),
        };
        design(cutoff)?;
        // With a cut-off period longer than the recording only a trend would remain.
        let lowest = rate / time.len() as f64;
        if cutoff < lowest && found.is_none() {
            return Err(self.fault(RecordingFault::CutoffTooLow {
                cutoff_hz: cutoff,
                lowest_hz: lowest,
                duration: time.len() as f64 / rate,
            }));
        }
        // The smoothing: a series that was found, or the requested one with all of its numbers.
        let way = match (preparation.smoothing, &found) {
            (_, Some(found)) => SmoothingFilter::Series {
                period: found.period,
                harmonics: found.harmonics,
            },
            (SmoothingMethod::Automatic | SmoothingMethod::Butterworth, None) => SmoothingFilter::Butterworth { order },
            (SmoothingMethod::SavitzkyGolay, None) => SmoothingFilter::Polynomials {
                half_width: local_polynomials::half_width(cutoff, rate),
            },
            // A series was requested: its period is given or must be found.
            (SmoothingMethod::Fourier { period }, None) => {
                let positions: Vec<&[f64]> = columns.iter().map(|c| c.q).collect();
                let period = period.or_else(|| periods::find_period(time, &positions));
                let period = period.ok_or_else(|| self.fault(RecordingFault::NoPeriod))?;
                let duration = time[time.len() - 1] - time[0];
                let (shortest, longest) = (PERIOD_SHORTEST_STEPS / rate, PERIOD_LONGEST_DURATIONS * duration);
                if !(shortest..longest).contains(&period) {
                    return Err(self.fault(RecordingFault::Period {
                        period,
                        shortest,
                        longest,
                    }));
                }
                let harmonics = float_to_count(cutoff * period).max(1);
                SmoothingFilter::Series { period, harmonics }
            }
        };
        // Record what was chosen.
        prepared.cutoff_hz = Some(cutoff);
        prepared.butterworth_order = matches!(way, SmoothingFilter::Butterworth { .. }).then_some(order);
        prepared.cutoff_chosen = preparation.cutoff_hz.is_none() || preparation.chosen;
        // A series has no transients at the ends.
        if !matches!(way, SmoothingFilter::Series { .. }) {
            prepared.trimmed = self.transient_samples(rate / cutoff, time.len(), preparation, notes);
        }
        if let SmoothingFilter::Series { period, .. } = way {
            prepared.period = Some(period);
        }
        // The user is informed about the choice.
        if let Some(found) = &found {
            notes.push(RecordingNote::info(self.describe_series(found, &incomplete)));
        } else {
            notes.push(RecordingNote::info(format!(
                "Derivatives of {} in {} are prepared: {}.",
                backquoted_list(&prepared.coordinates),
                self.file(),
                way.describe(cutoff, prepared.cutoff_chosen && !preparation.chosen),
            )));
        }
        let states = self.smooth_columns(time, columns, cutoff, way)?;
        // If forces have chosen the series, they have shown that its residual is not motion.
        if found.is_none() && !preparation.chosen && matches!(way, SmoothingFilter::Series { .. }) {
            self.note_series_residual(columns, &states, notes);
        }
        Ok(states)
    }

    /// All columns smoothed and differentiated with the same filter.
    fn smooth_columns(
        &self,
        time: &[f64],
        columns: &[RecordedCoordinate<'_>],
        cutoff: f64,
        way: SmoothingFilter,
    ) -> Result<Vec<[Vec<f64>; 3]>, RecordingError> {
        columns
            .iter()
            .map(|column| {
                let all = column.prepare(time, cutoff, way).map_err(|error| {
                    self.fault(RecordingFault::Filter {
                        column: column.name.clone(),
                        error,
                    })
                })?;
                all.ok_or_else(|| {
                    self.fault(RecordingFault::TooFewSamples {
                        have: time.len(),
                        need: way.min_samples(),
                        purpose: "smoothing at this cut-off".into(),
                    })
                })
            })
            .collect()
    }

    /// Number of samples that transients affect at the start and at the end; `period` is that of the cut-off in
    /// samples.
    ///
    /// A recording that is too short to drop them all is reported.
    fn transient_samples(
        &self,
        period: f64,
        samples: usize,
        preparation: &StatePreparation,
        notes: &mut Vec<RecordingNote>,
    ) -> (usize, usize) {
        let most = float_to_count(samples as f64 / TRIM_ONE_IN);
        let spoilt = (1..most).find(|count| *count as f64 >= TRIMMED_PERIODS * period);
        if spoilt.is_none() && preparation.trim.is_none() {
            notes.push(RecordingNote::warning(format!(
                "{} is short for its cut-off: the filter's transients reach beyond the samples dropped at the ends; \
                 use a longer recording or a higher cut-off.",
                self.file()
            )));
        }
        let count = spoilt.unwrap_or(most);
        (count, count)
    }
}

/// The cut-off that fits the columns to be differentiated; uneven samples are interpolated to even times first.
fn choose_cutoff_for(time: &[f64], columns: &[&RecordedCoordinate<'_>], order: usize) -> Option<f64> {
    let rate = mean_rate(time);
    let sources: Vec<DifferentiatedSignal<'_>> = columns.iter().map(|c| c.signal_to_differentiate()).collect();
    if is_even(time) {
        return choose_cutoff(&sources, rate, order);
    }
    let even: Vec<Vec<f64>> = sources
        .iter()
        .map(|signal| resample_evenly(time, signal.values))
        .collect();
    let even: Vec<DifferentiatedSignal<'_>> = (sources.iter().zip(&even))
        .map(|(signal, values)| DifferentiatedSignal { values, ..*signal })
        .collect();
    choose_cutoff(&even, rate, order)
}

/// The open choices in the preparation of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct PreparationChoices {
    /// Mean sampling rate, Hz.
    pub rate_hz: f64,
    /// Highest frequency at which forces follow the motion, Hz.
    pub band_hz: f64,
    /// The cut-off that follows from the spectra of the positions only, Hz.
    pub cutoff_hz: f64,
    /// The period of the motion, s, if it is periodic.
    pub period: Option<f64>,
}

impl SignalRecording {
    /// The choices that the preparation leaves open: cut-off, smoothing and decimation. `None` if they are given, if
    /// all derivatives are recorded, if a Fourier series has a residual of noise only, or if nothing moves. Fails as
    /// [`Self::runs_with`] does.
    pub fn find_open_choices(
        &self,
        coordinates: &[String],
        drives: &[String],
        preparation: &StatePreparation,
    ) -> Result<Option<PreparationChoices>, RecordingError> {
        let usual = StatePreparation::default();
        // Any of the three options makes the choice of the user.
        let is_open =
            preparation.cutoff_hz.is_none() && preparation.smoothing == usual.smoothing && preparation.decimate <= 1;
        if !is_open {
            return Ok(None);
        }
        // The requested band for figures is not that of the motion.
        let preparation = StatePreparation {
            band_hz: None,
            ..preparation.clone()
        };
        let runs = self.runs_with(coordinates, drives, &preparation)?;
        // The longest segment represents the recording.
        let longest = runs.iter().max_by_key(|run| run.samples());
        let found = longest.and_then(|run| {
            let prepared = &run.prepared;
            let cutoff = prepared.cutoff_hz.filter(|cutoff| {
                let harmonics = prepared.period.map_or(f64::INFINITY, |period| cutoff * period);
                harmonics > PLANNED_MOST_HARMONICS
            });
            Some((mean_rate(&run.time), prepared.band_hz?, cutoff?))
        });
        // A series is an alternative only if the motion has a period.
        Ok(found.map(|(rate_hz, band_hz, cutoff_hz)| {
            let as_series = StatePreparation {
                smoothing: SmoothingMethod::Fourier { period: None },
                cutoff_hz: Some(cutoff_hz),
                ..preparation
            };
            let runs = self.runs_with(coordinates, drives, &as_series).ok();
            let longest = runs.and_then(|runs| runs.into_iter().max_by_key(PreparedRun::samples));
            PreparationChoices {
                rate_hz,
                band_hz,
                cutoff_hz,
                period: longest.and_then(|run| run.prepared.period),
            }
        }))
    }
}

/// The Fourier series of the motion, if there is one and the preparation leaves the choice open.
pub(crate) fn find_motion_series(
    time: &[f64],
    columns: &[RecordedCoordinate<'_>],
    preparation: &StatePreparation,
) -> Option<PeriodicSeries> {
    let is_open = matches!(
        preparation.smoothing,
        SmoothingMethod::Automatic | SmoothingMethod::Fourier { period: None }
    );
    if !is_open || preparation.cutoff_hz.is_some() {
        return None;
    }
    let incomplete = columns.iter().filter(|column| !column.is_complete());
    let signals: Vec<&[f64]> = incomplete
        .map(|column| column.signal_to_differentiate().values)
        .collect();
    let positions: Vec<&[f64]> = columns.iter().map(|column| column.q).collect();
    series::find_series(time, &signals, &positions)
}
