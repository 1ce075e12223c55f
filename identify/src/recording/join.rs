//! Columns that were sampled at different times, such as topics of a log or files of one run: each with its times go in,
//! rows with a value of every column come out.
//!
//! The slowest part gives the times, so that no samples are invented; the others are interpolated linearly between the two
//! samples around. Rows for which a part has no samples nearby are left out.
//!
//! Decision: interpolation to the fastest rate would count samples that nobody took, and standard deviations would
//! be too small.

use crate::recording::error::Fault;
use crate::recording::gaps::GAP;
use crate::recording::notes::Note;
use crate::signal::median;
use crate::words::{count_of, list};

/// Columns with the same times.
#[derive(Debug)]
pub(crate) struct Part {
    /// What messages call it.
    pub(crate) name: String,
    /// Times of the samples, s.
    pub(crate) time: Vec<f64>,
    /// Values by the place where they go.
    pub(crate) columns: Vec<(usize, Vec<f64>)>,
}

/// Columns that have all the same times.
#[derive(Debug)]
pub(crate) struct Joined {
    pub(crate) time: Vec<f64>,
    pub(crate) columns: Vec<(usize, Vec<f64>)>,
}

/// Joins parts; `None` if there are none. `tell` hears what was done.
///
/// Fails when the times of a part do not increase, or parts have no time in common.
pub(crate) fn joined(
    mut parts: Vec<Part>,
    tell: &mut dyn FnMut(Note),
) -> Result<Option<Joined>, Fault> {
    if parts.len() < 2 {
        return Ok(parts.pop().map(|part| Joined {
            time: part.time,
            columns: part.columns,
        }));
    }
    for part in &parts {
        check_increasing(part)?;
    }
    let steps: Vec<f64> = parts.iter().map(usual_step).collect();
    let slowest = steps.iter().copied().fold(0.0, f64::max);
    // Of those that are equally slow the one with the most columns, and of these the first.
    let base = (0..parts.len())
        .filter(|i| steps[*i] >= 0.99 * slowest)
        .rev()
        .max_by_key(|i| parts[*i].columns.len())
        .unwrap_or(0);
    let base_step = steps[base];
    let others_steps: Vec<f64> = (0..steps.len())
        .filter(|i| *i != base)
        .map(|i| steps[i])
        .collect();
    let names: Vec<String> = parts.iter().map(|part| part.name.clone()).collect();
    let base = parts.remove(base);
    let n = base.time.len();
    let mut is_covered = vec![true; n];
    let mut others = Vec::new();
    let mut columns = base.columns;
    for (part, step) in parts.into_iter().zip(others_steps) {
        let around: Vec<Option<(usize, f64)>> = base
            .time
            .iter()
            .map(|t| place_of(*t, &part.time, GAP * step.max(base_step)))
            .collect();
        for (covered, around) in is_covered.iter_mut().zip(&around) {
            *covered &= around.is_some();
        }
        if part.time != base.time {
            others.push(part.name);
        }
        for (place, values) in part.columns {
            let value = |around: &Option<(usize, f64)>| match around {
                Some((k, share)) if *share != 0.0 => {
                    values[*k] + share * (values[k + 1] - values[*k])
                }
                Some((k, _)) => values[*k],
                None => f64::NAN,
            };
            columns.push((place, around.iter().map(value).collect()));
        }
    }
    let covered = is_covered.iter().filter(|covered| **covered).count();
    if covered == 0 {
        return Err(Fault::NothingInCommon { parts: names });
    }
    if !others.is_empty() {
        tell(Note::info(format!(
            "Samples are those of `{}`, {base_step:.3e} s apart; {} {} taken at their times, between samples by straight \
             lines.",
            base.name,
            list(&others),
            if others.len() == 1 { "is" } else { "are" },
        )));
    }
    if covered < n {
        tell(Note::warning(format!(
            "{} of `{}` {} not between samples of all others and left out.",
            count_of(n - covered, "sample", "samples"),
            base.name,
            if n - covered == 1 { "is" } else { "are" },
        )));
    }
    let kept = |values: Vec<f64>| -> Vec<f64> {
        let pairs = values.into_iter().zip(&is_covered);
        pairs
            .filter(|(_, covered)| **covered)
            .map(|(value, _)| value)
            .collect()
    };
    Ok(Some(Joined {
        time: kept(base.time),
        columns: columns
            .into_iter()
            .map(|(place, values)| (place, kept(values)))
            .collect(),
    }))
}

fn check_increasing(part: &Part) -> Result<(), Fault> {
    for (k, pair) in part.time.windows(2).enumerate() {
        if pair[1].partial_cmp(&pair[0]) != Some(std::cmp::Ordering::Greater) {
            return Err(Fault::TimeNotIncreasing {
                line: k as u64 + 2,
                previous: pair[0],
                here: pair[1],
            });
        }
    }
    Ok(())
}

fn usual_step(part: &Part) -> f64 {
    median(part.time.windows(2).map(|pair| pair[1] - pair[0]).collect())
}

/// The sample at or before `t` with the share of the way to the next one; `None` outside, and in gaps longer than `gap`.
fn place_of(t: f64, times: &[f64], gap: f64) -> Option<(usize, f64)> {
    let after = times.partition_point(|other| *other <= t);
    let k = after.checked_sub(1)?;
    if times[k].total_cmp(&t).is_eq() {
        return Some((k, 0.0));
    }
    let next = *times.get(after)?;
    (next - times[k] <= gap).then(|| (k, (t - times[k]) / (next - times[k])))
}
