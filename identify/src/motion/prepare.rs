//! Which way of smoothing suits a recording, and states by it: columns go in, positions with both derivatives come out.

use crate::motion::cutoff::{LONGEST_TRIM, Signal, TRIMMED_PERIODS, choose_cutoff};
use crate::motion::derivatives::mean_rate;
use crate::motion::even::{is_even, on_even_times};
use crate::motion::options::{Preparation, Smoothing};
use crate::motion::prepared_as::PreparedAs;
use crate::motion::run::Run;
use crate::motion::series::{self, Periodic};
use crate::motion::smooth::{Recorded, Way};
use crate::motion::{local_polynomials, periods};
use crate::recording::{Fault, Note, Recording, RecordingError};
use crate::signal::{LowPass, count};
use crate::words::list;

impl Recording {
    /// States of all coordinates by the way of smoothing that the preparation asks for, or that suits them; what was
    /// chosen goes into `prepared` and `notes`.
    pub(crate) fn prepare_states(
        &self,
        time: &[f64],
        columns: &[Recorded<'_>],
        preparation: &Preparation,
        prepared: &mut PreparedAs,
        notes: &mut Vec<Note>,
    ) -> Result<Vec<[Vec<f64>; 3]>, RecordingError> {
        let incomplete: Vec<&Recorded<'_>> = columns.iter().filter(|c| !c.is_complete()).collect();
        if incomplete.is_empty() {
            return Ok(columns.iter().filter_map(Recorded::complete).collect());
        }
        prepared.coordinates = incomplete.iter().map(|c| c.name.clone()).collect();
        let order = preparation.order;
        let rate = mean_rate(time);
        if time.len() < 3 {
            return Err(self.fault(Fault::TooFewSamples {
                have: time.len(),
                need: Way::Butterworth { order }.need(),
                purpose: "preparing derivatives from positions".into(),
            }));
        }
        let design = |cutoff: f64| {
            LowPass::butterworth(order, cutoff, rate).map_err(|error| {
                self.fault(Fault::Filter {
                    column: prepared.coordinates.join(", "),
                    error,
                })
            })
        };
        let need = design(rate / 4.0)?.padding() + 1;
        if time.len() < need {
            return Err(self.fault(Fault::TooFewSamples {
                have: time.len(),
                need,
                purpose: "preparing derivatives from positions".into(),
            }));
        }
        let found = series_of(time, columns, preparation);
        // One cut-off for all coordinates keeps loops consistent.
        let chosen = || cutoff_of(time, &incomplete, order);
        let cutoff = match &found {
            Some(found) => found.harmonics as f64 / found.period,
            None => preparation.cutoff_hz.or_else(chosen).unwrap_or(0.1 * rate),
        };
        design(cutoff)?;
        // A cut-off whose period is longer than the recording leaves nothing of it but a trend.
        let lowest = rate / time.len() as f64;
        if cutoff < lowest && found.is_none() {
            return Err(self.fault(Fault::CutoffTooLow {
                cutoff_hz: cutoff,
                lowest_hz: lowest,
                duration: time.len() as f64 / rate,
            }));
        }
        let way = match (preparation.smoothing, &found) {
            (_, Some(found)) => Way::Series {
                period: found.period,
                harmonics: found.harmonics,
            },
            (Smoothing::Automatic | Smoothing::Butterworth, None) => Way::Butterworth { order },
            (Smoothing::SavitzkyGolay, None) => Way::Polynomials {
                half_width: local_polynomials::half_width(cutoff, rate),
            },
            (Smoothing::Fourier { period }, None) => {
                let positions: Vec<&[f64]> = columns.iter().map(|c| c.q).collect();
                let period = period.or_else(|| periods::find_period(time, &positions));
                let period = period.ok_or_else(|| self.fault(Fault::NoPeriod))?;
                let duration = time[time.len() - 1] - time[0];
                let (shortest, longest) = (4.0 / rate, 1.5 * duration);
                if !(shortest..longest).contains(&period) {
                    return Err(self.fault(Fault::Period {
                        period,
                        shortest,
                        longest,
                    }));
                }
                let harmonics = count(cutoff * period).max(1);
                Way::Series { period, harmonics }
            }
        };
        prepared.cutoff_hz = Some(cutoff);
        prepared.cutoff_chosen = preparation.cutoff_hz.is_none() || preparation.chosen;
        // A series has no transients at its ends.
        if !matches!(way, Way::Series { .. }) {
            prepared.trimmed = self.transients(rate / cutoff, time.len(), preparation, notes);
        }
        if let Way::Series { period, .. } = way {
            prepared.period = Some(period);
        }
        if let Some(found) = &found {
            notes.push(Note::info(self.describe_series(found, &incomplete)));
        } else {
            notes.push(Note::info(format!(
                "Derivatives of {} in {} are prepared: {}.",
                list(&prepared.coordinates),
                self.file(),
                way.describe(cutoff, prepared.cutoff_chosen && !preparation.chosen),
            )));
        }
        let states = self.smoothed(time, columns, cutoff, way)?;
        // Where forces have chosen a series, they have told that what it leaves is no motion.
        if found.is_none() && !preparation.chosen && matches!(way, Way::Series { .. }) {
            self.note_left_over(columns, &states, notes);
        }
        Ok(states)
    }

    /// All columns smoothed and differentiated in one way.
    fn smoothed(
        &self,
        time: &[f64],
        columns: &[Recorded<'_>],
        cutoff: f64,
        way: Way,
    ) -> Result<Vec<[Vec<f64>; 3]>, RecordingError> {
        columns
            .iter()
            .map(|column| {
                let all = column.prepare(time, cutoff, way).map_err(|error| {
                    self.fault(Fault::Filter {
                        column: column.name.clone(),
                        error,
                    })
                })?;
                all.ok_or_else(|| {
                    self.fault(Fault::TooFewSamples {
                        have: time.len(),
                        need: way.need(),
                        purpose: "smoothing at this cut-off".into(),
                    })
                })
            })
            .collect()
    }

    /// Samples that the filter's transients spoil at both ends, `period` being that of the cut-off
    /// in samples.
    fn transients(
        &self,
        period: f64,
        samples: usize,
        preparation: &Preparation,
        notes: &mut Vec<Note>,
    ) -> (usize, usize) {
        let most = count(samples as f64 / LONGEST_TRIM);
        let spoilt = (1..most).find(|count| *count as f64 >= TRIMMED_PERIODS * period);
        if spoilt.is_none() && preparation.trim.is_none() {
            notes.push(Note::warning(format!(
                "{} is short for its cut-off: the filter's transients reach beyond the samples dropped at the ends; \
                 use a longer recording or a higher cut-off.",
                self.file()
            )));
        }
        let count = spoilt.unwrap_or(most);
        (count, count)
    }
}

/// The cut-off that suits what is to be differentiated, on even times.
fn cutoff_of(time: &[f64], columns: &[&Recorded<'_>], order: usize) -> Option<f64> {
    let rate = mean_rate(time);
    let sources: Vec<Signal<'_>> = columns.iter().map(|c| c.source()).collect();
    if is_even(time) {
        return choose_cutoff(&sources, rate, order);
    }
    let even: Vec<Vec<f64>> = sources
        .iter()
        .map(|signal| on_even_times(time, signal.values))
        .collect();
    let even: Vec<Signal<'_>> = (sources.iter().zip(&even))
        .map(|(signal, values)| Signal { values, ..*signal })
        .collect();
    choose_cutoff(&even, rate, order)
}

/// A series of more harmonics is no plan of a motion, but takes up whatever is there; forces must tell.
const MANY_HARMONICS: f64 = 25.5;

/// What is open in the preparation of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Open {
    /// Mean sampling rate, Hz.
    pub rate_hz: f64,
    /// Up to where forces follow the motion, Hz.
    pub band_hz: f64,
    /// The cut-off that the spectra of the positions alone propose, Hz.
    pub cutoff_hz: f64,
    /// The period after which the motion repeats itself, s, where it does.
    pub period: Option<f64>,
}

impl Recording {
    /// What there is to choose where the preparation leaves cut-off, smoothing and decimation open; `None` where it does not,
    /// where all derivatives are recorded, where a Fourier series leaves nothing but noise, and where nothing moves.
    /// Fails as [`Recording::runs_with`] does.
    pub fn open(
        &self,
        coordinates: &[String],
        drives: &[String],
        preparation: &Preparation,
    ) -> Result<Option<Open>, RecordingError> {
        let usual = Preparation::default();
        let is_open = preparation.cutoff_hz.is_none()
            && preparation.smoothing == usual.smoothing
            && preparation.decimate <= 1;
        if !is_open {
            return Ok(None);
        }
        // The band that figures are asked for is none of the motion.
        let preparation = Preparation {
            band_hz: None,
            ..preparation.clone()
        };
        let runs = self.runs_with(coordinates, drives, &preparation)?;
        let longest = runs.iter().max_by_key(|run| run.samples());
        let found = longest.and_then(|run| {
            let prepared = &run.prepared;
            let cutoff = prepared.cutoff_hz.filter(|cutoff| {
                let harmonics = prepared
                    .period
                    .map_or(f64::INFINITY, |period| cutoff * period);
                harmonics > MANY_HARMONICS
            });
            Some((mean_rate(&run.time), prepared.band_hz?, cutoff?))
        });
        Ok(found.map(|(rate_hz, band_hz, cutoff_hz)| {
            let as_series = Preparation {
                smoothing: Smoothing::Fourier { period: None },
                cutoff_hz: Some(cutoff_hz),
                ..preparation
            };
            let runs = self.runs_with(coordinates, drives, &as_series).ok();
            let longest = runs.and_then(|runs| runs.into_iter().max_by_key(Run::samples));
            Open {
                rate_hz,
                band_hz,
                cutoff_hz,
                period: longest.and_then(|run| run.prepared.period),
            }
        }))
    }
}

/// The series of which what is to be differentiated is samples, where the preparation leaves that open.
pub(crate) fn series_of(
    time: &[f64],
    columns: &[Recorded<'_>],
    preparation: &Preparation,
) -> Option<Periodic> {
    let is_open = matches!(
        preparation.smoothing,
        Smoothing::Automatic | Smoothing::Fourier { period: None }
    );
    if !is_open || preparation.cutoff_hz.is_some() {
        return None;
    }
    let incomplete = columns.iter().filter(|column| !column.is_complete());
    let signals: Vec<&[f64]> = incomplete.map(|column| column.source().values).collect();
    series::find_series(time, &signals)
}
