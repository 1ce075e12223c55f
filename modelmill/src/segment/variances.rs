//! Variances of the measured forces, if a recording has the columns `DRIVE_var`. Such a column can be computed, for
//! example, by averaging a motion over many periods.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::{PreparedRun, SignalRecording, sample_place_word};

use crate::error::{Error, Outcome};

/// Name of the column with the variance of a drive's force, N^2 or (N m)^2.
pub fn column(drive: &str) -> String {
    format!("{drive}_var")
}

/// Variances for the samples of a run, `[drive][sample]`; `None` unless all drives have them.
///
/// Fails when the samples of the run cannot be matched with lines of the file.
pub fn recorded_variances(
    recording: &SignalRecording,
    run: &PreparedRun,
    drives: &[String],
) -> Outcome<Option<Vec<Vec<f64>>>> {
    if drives.is_empty() || !drives.iter().all(|drive| recording.has_column(&column(drive))) {
        return Ok(None);
    }
    // A run may have lost samples at its ends and at gaps; the lines of the file identify those that remain.
    let lines: Vec<u64> = (0..recording.samples()).filter_map(|i| recording.line(i)).collect();
    let places: Option<Vec<usize>> = run.lines.iter().map(|line| lines.binary_search(line).ok()).collect();
    let Some(places) = places else {
        return Err(Error::input(message!(
            "{}: the variances cannot be matched with the samples that remain after preparation; omit \
             {}",
            run.file,
            Remedy::option(OptionName::Weights).with_value("variance")
        )));
    };
    let column_of = |drive: &String| -> Outcome<Vec<f64>> {
        let values = recording.column(&column(drive))?;
        Ok(places.iter().map(|at| values[*at]).collect())
    };
    drives.iter().map(column_of).collect::<Outcome<Vec<_>>>().map(Some)
}

/// Weights of the rows: the inverse standard deviation, interleaved per sample; every `every`-th sample.
///
/// Fails at a variance that is not positive.
pub fn factors(variance: &[Vec<f64>], run: &PreparedRun, drives: &[String], every: usize) -> Outcome<Vec<f64>> {
    let samples = variance.first().map_or(0, Vec::len);
    let mut factors = Vec::with_capacity(samples.div_ceil(every) * drives.len());
    // Decimation keeps every n-th sample; its variance stands for the row.
    for sample in (0..samples).step_by(every) {
        for (drive, values) in drives.iter().zip(variance) {
            let value = values[sample];
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::input(message!(
                    "{}, {} {}: {} = {value}, but a variance must be a positive number for {}; remove such \
                     samples from the recording",
                    run.file,
                    sample_place_word(&run.file),
                    run.lines.get(sample).copied().unwrap_or(0),
                    column(drive),
                    Remedy::option(OptionName::Weights).with_value("variance")
                )));
            }
            factors.push(value.sqrt().recip());
        }
    }
    Ok(factors)
}
