//! Instruments of instrumental-variable estimation: the reference motion, or the measured motion one period later.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::sample_place_word;

use crate::error::{Error, Outcome};
use crate::identify::options::{EquationWeights, EstimatorOptions};
use crate::identify::thresholds::{
    INSTRUMENT_FEWEST_PERIODS, INSTRUMENT_PERIOD_FEWEST_STEPS, INSTRUMENT_PERIOD_TOLERANCE_STEPS,
    INSTRUMENT_TIME_TOLERANCE_STEPS,
};
use crate::recording::PreparedRecording;
use crate::segment::RecordingSegment;

/// The source of instruments, against noise that is correlated with the states through the controller.
#[derive(Clone, Copy, Default)]
pub enum Instruments<'a> {
    /// No instruments: least squares.
    #[default]
    None,
    /// The states one period later; the period in s.
    Period(f64),
    /// Recordings of the reference motion, one for each recording of the fit, with the same times.
    Recordings(&'a [&'a PreparedRecording]),
}

/// One segment of instruments for each of `data`; none without instruments.
///
/// Fails when the weights do not allow instruments, or when the times of the instruments differ.
pub(crate) fn instrument_segments(
    data: &[RecordingSegment],
    instruments: &Instruments<'_>,
    options: &EstimatorOptions,
) -> Outcome<Vec<RecordingSegment>> {
    if matches!(instruments, Instruments::None) {
        return Ok(Vec::new());
    }
    // Weights from residuals would make the estimate depend on itself.
    if options.weights == EquationWeights::Channels {
        return Err(Error::options(message!(
            "{} needs {} or `variance`: weights from residuals would depend on the estimate that \
             the instruments are to correct",
            Remedy::option(OptionName::Instruments),
            Remedy::option(OptionName::Weights).with_value("none")
        )));
    }
    match instruments {
        // The first case has returned before.
        Instruments::None => Ok(Vec::new()),
        Instruments::Period(period) => data.iter().map(|one| shift_by_period(one, *period)).collect(),
        Instruments::Recordings(recordings) => {
            let all: Vec<RecordingSegment> = recordings.iter().flat_map(|one| one.segments.clone()).collect();
            check_same_times(data, &all)?;
            Ok(all)
        }
    }
}

/// Fails unless the instruments have the same segments and times as the recordings.
fn check_same_times(data: &[RecordingSegment], instruments: &[RecordingSegment]) -> Outcome {
    if data.len() != instruments.len() {
        return Err(Error::options(message!(
            "{} gives {} for {} of {} (recordings count once for each segment between gaps); give one for \
             each, in the same order",
            Remedy::option(OptionName::Instruments),
            instruments.len(),
            data.len(),
            Remedy::option(OptionName::Data)
        )));
    }
    for (own, theirs) in data.iter().zip(instruments) {
        // Times are compared sample by sample, within a part of the smallest step.
        let (a, b) = (&own.run.time, &theirs.run.time);
        let step = a.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
        // Times may differ by rounding only.
        let apart = a
            .iter()
            .zip(b)
            .position(|(x, y)| (x - y).abs() > INSTRUMENT_TIME_TOLERANCE_STEPS * step);
        if let Some(sample) = apart {
            return Err(Error::input(format!(
                "{}, {} {}: t = {} s, but t = {} s in the recording {}; instruments must have the same times",
                theirs.run.file,
                sample_place_word(&theirs.run.file),
                theirs.run.lines.get(sample).copied().unwrap_or(0),
                b[sample],
                a[sample],
                own.run.file
            )));
        }
        if a.len() != b.len() {
            return Err(Error::input(format!(
                "{}: {} samples after preparation, but {} in {}; instruments must have the same times",
                theirs.run.file,
                b.len(),
                a.len(),
                own.run.file
            )));
        }
    }
    Ok(())
}

/// The recording with the states of the next period; near its end with those of the period before.
///
/// Fails when the recording is shorter than one and a half periods, or has no sample one period
/// away.
fn shift_by_period(data: &RecordingSegment, period: f64) -> Outcome<RecordingSegment> {
    let time = &data.run.time;
    let n = time.len();
    // A period must fit into the recording one and a half times.
    let span = time.last().zip(time.first()).map_or(0.0, |(last, first)| last - first);
    let step = span / n.saturating_sub(1).max(1) as f64;
    if span < INSTRUMENT_FEWEST_PERIODS * period || period < INSTRUMENT_PERIOD_FEWEST_STEPS * step {
        return Err(Error::input(format!(
            "{}: the recording lasts {span:.3} s, which is not one and a half periods of {period} s; instruments from \
             another period need two of them",
            data.run.file
        )));
    }
    // By time, not by a number of samples, since steps may be uneven.
    let nearest = |t: f64| {
        let at = time.partition_point(|x| *x < t).clamp(1, n - 1);
        if t - time[at - 1] < time[at] - t { at - 1 } else { at }
    };
    // Near the end the period before is used.
    let mut places = Vec::with_capacity(n);
    for t in time {
        let wanted = if t + period <= time[n - 1] + 0.5 * step {
            t + period
        } else {
            t - period
        };
        let at = nearest(wanted);
        if (time[at] - wanted).abs() > INSTRUMENT_PERIOD_TOLERANCE_STEPS * step {
            return Err(Error::input(format!(
                "{}: there is no sample one period of {period} s away from t = {t} s; check the recording for gaps",
                data.run.file
            )));
        }
        places.push(at);
    }
    // Positions, derivatives and forces are shifted together.
    let mut shifted = data.clone();
    let run = &mut shifted.run;
    let columns = run
        .q
        .iter_mut()
        .chain(&mut run.qd)
        .chain(&mut run.qdd)
        .chain(run.force.iter_mut().flatten());
    for column in columns {
        *column = places.iter().map(|at| column[*at]).collect();
    }
    Ok(shifted)
}
