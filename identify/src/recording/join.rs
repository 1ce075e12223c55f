//! Joins columns that were sampled at different times, such as topics of a log or files of one run. Columns with
//! their times go in, rows with a value of every column come out.
//!
//! The slowest part gives the sample times, so that no samples are invented. The other parts are interpolated
//! linearly between their two neighbouring samples. Rows without neighbouring samples in some part are left out.
//!
//! Decision: interpolation to the fastest rate would count samples that were never measured, and standard deviations
//! would be too small.

use crate::recording::error::RecordingFault;
use crate::recording::notes::RecordingNote;
use crate::recording::thresholds::{EQUALLY_SLOW_SHARE, GAP_LEAST_STEPS};
use crate::signal::median;
use crate::words::{backquoted_list, count_of};

/// Columns with the same times.
#[derive(Debug)]
pub(crate) struct JoinPart {
    /// Its name in messages.
    pub(crate) name: String,
    /// Times of the samples, s.
    pub(crate) time: Vec<f64>,
    /// Values, each with the position of its column in the result.
    pub(crate) columns: Vec<(usize, Vec<f64>)>,
}

/// Columns with common times.
#[derive(Debug)]
pub(crate) struct JoinedColumns {
    /// Times of the rows, s.
    pub(crate) time: Vec<f64>,
    /// Values, each with the position of its column in the result.
    pub(crate) columns: Vec<(usize, Vec<f64>)>,
}

/// Joins parts; `None` if there are none. `add_note` receives notes about what was done.
///
/// Fails when the times of a part do not increase, or parts have no time in common.
pub(crate) fn join_parts(
    mut parts: Vec<JoinPart>,
    add_note: &mut dyn FnMut(RecordingNote),
) -> Result<Option<JoinedColumns>, RecordingFault> {
    // A single part needs no interpolation.
    if parts.len() < 2 {
        return Ok(parts.pop().map(|part| JoinedColumns {
            time: part.time,
            columns: part.columns,
        }));
    }
    for part in &parts {
        check_increasing(part)?;
    }
    let steps: Vec<f64> = parts.iter().map(usual_step).collect();
    let slowest = steps.iter().copied().fold(0.0, f64::max);
    // Among equally slow parts the one with the most columns is the base; among these the first.
    let base = (0..parts.len())
        .filter(|i| steps[*i] >= EQUALLY_SLOW_SHARE * slowest)
        .rev()
        .max_by_key(|i| parts[*i].columns.len())
        .unwrap_or(0);
    let base_step = steps[base];
    let others_steps: Vec<f64> = (0..steps.len()).filter(|i| *i != base).map(|i| steps[i]).collect();
    let names: Vec<String> = parts.iter().map(|part| part.name.clone()).collect();
    let base = parts.remove(base);
    let n = base.time.len();
    let mut is_covered = vec![true; n];
    let mut others = Vec::new();
    let mut columns = base.columns;
    // Interpolate every other part to the times of the base.
    for (part, step) in parts.into_iter().zip(others_steps) {
        // The neighbouring samples of each row; none in a gap of this part.
        let around: Vec<Option<(usize, f64)>> = base
            .time
            .iter()
            .map(|t| find_sample(*t, &part.time, GAP_LEAST_STEPS * step.max(base_step)))
            .collect();
        for (covered, around) in is_covered.iter_mut().zip(&around) {
            *covered &= around.is_some();
        }
        if part.time != base.time {
            others.push(part.name);
        }
        for (place, values) in part.columns {
            // The first sample of the pair, plus the share of the way to the second one.
            let value = |around: &Option<(usize, f64)>| match around {
                Some((k, share)) if *share != 0.0 => values[*k] + share * (values[k + 1] - values[*k]),
                Some((k, _)) => values[*k],
                None => f64::NAN,
            };
            columns.push((place, around.iter().map(value).collect()));
        }
    }
    // A row is kept only if all parts have neighbouring samples.
    let covered = is_covered.iter().filter(|covered| **covered).count();
    if covered == 0 {
        return Err(RecordingFault::NoCommonTime { parts: names });
    }
    if !others.is_empty() {
        add_note(RecordingNote::info(format!(
            "The sample times are those of `{}`, {base_step:.3e} s apart; {} {} interpolated linearly to them.",
            base.name,
            backquoted_list(&others),
            if others.len() == 1 { "is" } else { "are" },
        )));
    }
    if covered < n {
        add_note(RecordingNote::warning(format!(
            "{} of `{}` {} left out, because another part has no samples around that time.",
            count_of(n - covered, "sample", "samples"),
            base.name,
            if n - covered == 1 { "is" } else { "are" },
        )));
    }
    // Remove the rows that are left out from all columns.
    let kept = |values: Vec<f64>| -> Vec<f64> {
        let pairs = values.into_iter().zip(&is_covered);
        pairs.filter(|(_, covered)| **covered).map(|(value, _)| value).collect()
    };
    Ok(Some(JoinedColumns {
        time: kept(base.time),
        columns: columns
            .into_iter()
            .map(|(place, values)| (place, kept(values)))
            .collect(),
    }))
}

/// Fails when the times of a part do not increase; lines count from 1 with the header.
fn check_increasing(part: &JoinPart) -> Result<(), RecordingFault> {
    for (k, pair) in part.time.windows(2).enumerate() {
        // A comparison with NaN fails as well.
        if pair[1].partial_cmp(&pair[0]) != Some(std::cmp::Ordering::Greater) {
            return Err(RecordingFault::TimeNotIncreasing {
                line: k as u64 + 2,
                previous: pair[0],
                here: pair[1],
            });
        }
    }
    Ok(())
}

/// Median step of time of a part, s.
fn usual_step(part: &JoinPart) -> f64 {
    median(part.time.windows(2).map(|pair| pair[1] - pair[0]).collect())
}

/// The sample at or before `t`, and the share of the way to the next one. `None` outside of the times, and in gaps
/// longer than `gap`, s.
fn find_sample(t: f64, times: &[f64], gap: f64) -> Option<(usize, f64)> {
    let after = times.partition_point(|other| *other <= t);
    let k = after.checked_sub(1)?;
    if times[k].total_cmp(&t).is_eq() {
        return Some((k, 0.0));
    }
    let next = *times.get(after)?;
    (next - times[k] <= gap).then(|| (k, (t - times[k]) / (next - times[k])))
}
