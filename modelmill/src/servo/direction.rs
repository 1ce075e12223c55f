//! Friction whose direction follows the motion, in equations along a filtered motion.
//!
//! The low-pass of the preparation passes positions, and thus rates, accelerations and signals. The force of dry friction
//! jumps at a reversal, and the filtered motion contains the filtered jump. So the columns of dry friction pass the same
//! filter. Without it, estimates of dry friction grow as the cut-off falls: by 7 to 20 % at 6 Hz in the arm of six servos
//! of `lab/servo-plant`. Source: M. Gautier, "Dynamic identification of robots with power model", ICRA 1997 (parallel
//! filtering).

use modelmill_identify::LowPass;
use modelmill_spec::{EffectTerm, ExactExpression, ExactFunction};

use super::ServoModel;
use super::thresholds::{
    FILTERED_REVERSAL_PERIODS, REVERSAL_PERIODS, STANDING_PERIODS, STANDING_SHARE, STANDSTILL_SHARE, TRANSIENT_PERIODS,
};
use crate::along;
use crate::error::Outcome;
use crate::segment::RecordingSegment;

/// The columns of a regressor that jump at a reversal, and the filter that they pass.
pub(super) struct DirectionColumns {
    /// Positions of the base parameters.
    columns: Vec<usize>,
    /// The filter of the preparation; `None` without such columns, or if it cannot be applied.
    low_pass: Option<LowPass>,
    /// Period of the cut-off of the preparation, s; zero without a filter.
    period: f64,
}

impl DirectionColumns {
    /// Those of a model along a segment.
    pub(super) fn new(servo: &ServoModel, segment: &RecordingSegment) -> Self {
        let (columns, is_complete) = jumping_columns(servo);
        let low_pass = (is_complete && !columns.is_empty())
            .then(|| filter_of(segment))
            .flatten();
        Self {
            period: segment.run.prepared.cutoff_hz.map_or(0.0, f64::recip),
            columns,
            low_pass,
        }
    }

    /// Applies the filter to the columns of some rows, `values[sample][row][column]` with `n_rows` rows and `n_columns`
    /// columns.
    pub(super) fn filter(&self, values: &mut [f64], n_rows: usize, n_columns: usize) {
        let width = n_rows * n_columns;
        for row in 0..n_rows {
            for column in &self.columns {
                let start = row * n_columns + column;
                let series: Vec<f64> = values.iter().skip(start).step_by(width).copied().collect();
                let filtered = self.filter_series(series);
                for (slot, value) in values.iter_mut().skip(start).step_by(width).zip(filtered) {
                    *slot = value;
                }
            }
        }
    }

    /// A force of the equations, filtered as the columns are.
    pub(super) fn filter_series(&self, series: Vec<f64>) -> Vec<f64> {
        let Some(low_pass) = &self.low_pass else {
            return series;
        };
        // The segment is longer than the padding, which was tested when the filter was designed.
        low_pass.zero_phase(&series).unwrap_or(series)
    }

    /// Which equations count, `[row of a body][sample]`: forces that were measured, and drives whose friction has a known
    /// direction.
    ///
    /// Fails when a pose has no solution.
    pub(super) fn counting_samples(&self, servo: &ServoModel, segment: &RecordingSegment) -> Outcome<Vec<Vec<bool>>> {
        if self.low_pass.is_some() {
            let transient = TRANSIENT_PERIODS * self.period;
            let time = &segment.run.time;
            let (first, last) = (time[0] + transient, time[time.len() - 1] - transient);
            select_samples(servo, segment, |rates| {
                let standing = standing_samples(time, rates, self.period);
                let moving = moving_samples(time, rates, FILTERED_REVERSAL_PERIODS * self.period);
                let is_known = |i: usize| moving[i] && !standing[i] && (first..=last).contains(&time[i]);
                (0..rates.len()).map(is_known).collect()
            })
        } else {
            samples_between_reversals(servo, segment)
        }
    }
}

/// The base parameters whose columns jump at a reversal, and whether these are all that jumps.
fn jumping_columns(servo: &ServoModel) -> (Vec<usize>, bool) {
    let effects = servo.mechanism().effects.iter();
    let terms = effects.flat_map(|effect| &effect.terms);
    let jumping: Vec<&EffectTerm> = terms.filter(|term| has_sign(&term.expression)).collect();
    let reduction = &servo.equations.derivation.reduction;
    let contains = |k: usize, term: &EffectTerm| {
        let product = &reduction.products[reduction.retained[k]].0;
        product.iter().any(|(parameter, _)| *parameter == term.parameter.0)
    };
    let columns: Vec<usize> = (0..reduction.retained.len())
        .filter(|k| jumping.iter().any(|term| contains(*k, term)))
        .collect();
    // A number of the file is part of the column of all known numbers, which has other terms.
    let has_own_column = |term: &&EffectTerm| columns.iter().any(|k| contains(*k, term));
    let is_complete = jumping.iter().all(has_own_column);
    (columns, is_complete)
}

/// As [`DirectionColumns::counting_samples`], with the wider distance from a reversal that columns without a filter need.
///
/// Fails when a pose has no solution.
pub(super) fn samples_between_reversals(servo: &ServoModel, segment: &RecordingSegment) -> Outcome<Vec<Vec<bool>>> {
    let mut terms = servo.mechanism().effects.iter().flat_map(|effect| &effect.terms);
    let has_direction = terms.any(|term| has_sign(&term.expression));
    select_samples(servo, segment, |rates| {
        if has_direction {
            let period = segment.run.prepared.cutoff_hz.map_or(0.0, f64::recip);
            moving_samples(&segment.run.time, rates, REVERSAL_PERIODS * period)
        } else {
            vec![true; rates.len()]
        }
    })
}

/// The samples with a measured force that a choice by the rates of the drive selects, `[row of a body][sample]`.
fn select_samples(
    servo: &ServoModel,
    segment: &RecordingSegment,
    choose: impl Fn(&[f64]) -> Vec<bool>,
) -> Outcome<Vec<Vec<bool>>> {
    let rates = along::drive_rates(&servo.equations, segment)?;
    let of_drive = |d: usize| {
        let chosen = choose(&rates[d]).into_iter().enumerate();
        chosen
            .map(|(sample, counts)| counts && segment.run.is_force_measured(d, sample))
            .collect()
    };
    Ok(servo.body_rows().into_iter().map(of_drive).collect())
}

/// The low-pass that smoothed the motion, for columns with the times of the segment; `None` if the motion was smoothed by
/// another filter, or if the times are too sparse or too few for it.
fn filter_of(segment: &RecordingSegment) -> Option<LowPass> {
    let run = &segment.run;
    let (time, cutoff, order) = (&run.time, run.prepared.cutoff_hz?, run.prepared.butterworth_order?);
    let [first, .., last] = time.as_slice() else {
        return None;
    };
    let low_pass = LowPass::butterworth(order, cutoff, (time.len() - 1) as f64 / (last - first)).ok()?;
    let is_long = (last - first) * cutoff > 4.0 * TRANSIENT_PERIODS && time.len() > low_pass.padding();
    is_long.then_some(low_pass)
}

/// At which samples a drive moves in one direction: its rate is no standstill, and no reversal is nearer than `width`, s.
fn moving_samples(time: &[f64], rates: &[f64], width: f64) -> Vec<bool> {
    let least = STANDSTILL_SHARE * rms(rates);
    let is_moving = |sample: usize| rates[sample].abs() > least.max(slope(time, rates, sample).abs() * width);
    (0..rates.len()).map(is_moving).collect()
}

/// At which samples a drive stands, or has stood within a period of the cut-off before or after: friction may have any
/// value at standstill, and the filter spreads it. A reversal without standstill takes less than a period.
fn standing_samples(time: &[f64], rates: &[f64], period: f64) -> Vec<bool> {
    let least = STANDING_SHARE * rms(rates);
    let mut standing = vec![false; rates.len()];
    let mut start = 0;
    while start < rates.len() {
        let slow = rates[start..].iter().take_while(|rate| rate.abs() <= least).count();
        if slow > 0 && time[start + slow - 1] - time[start] >= STANDING_PERIODS * period {
            let from = time.partition_point(|t| *t < time[start] - period);
            let to = time.partition_point(|t| *t <= time[start + slow - 1] + period);
            standing[from..to].fill(true);
        }
        start += slow.max(1);
    }
    standing
}

/// The root mean square of a column.
fn rms(column: &[f64]) -> f64 {
    (column.iter().map(|x| x * x).sum::<f64>() / column.len().max(1) as f64).sqrt()
}

/// The derivative of a column by the differences to its neighbours.
fn slope(time: &[f64], column: &[f64], sample: usize) -> f64 {
    let (a, b) = (sample.saturating_sub(1), (sample + 1).min(column.len() - 1));
    if a == b {
        0.0
    } else {
        (column[b] - column[a]) / (time[b] - time[a])
    }
}

/// Whether an expression jumps with the sign of a quantity.
fn has_sign(expression: &ExactExpression) -> bool {
    match expression {
        ExactExpression::Rational(_) | ExactExpression::Pi | ExactExpression::Symbol(_) => false,
        ExactExpression::Sum(all) | ExactExpression::Product(all) => all.iter().any(has_sign),
        ExactExpression::Quotient(a, b) => has_sign(a) || has_sign(b),
        ExactExpression::Negative(a) | ExactExpression::Power(a, _) => has_sign(a),
        ExactExpression::Apply(function, a) => *function == ExactFunction::Sign || has_sign(a),
    }
}
