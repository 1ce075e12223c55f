//! Friction whose direction follows the motion, in equations along a filtered motion.
//!
//! The low-pass of the preparation passes positions, and thus rates, accelerations and signals. The force of dry friction
//! jumps at a reversal, and the filtered motion contains the filtered jump. So the columns of dry friction pass the same
//! filter. Without it, estimates of dry friction grow as the cut-off falls: by 7 to 20 % at 6 Hz in the arm of six servos
//! of `lab/servo-plant`. Source: M. Gautier, "Dynamic identification of robots with power model", ICRA 1997 (parallel
//! filtering).

use modelmill_identify::{LowPass, is_even};
use modelmill_spec::{EffectTerm, ExactExpression, ExactFunction};

use super::ServoModel;
use super::thresholds::{
    FILTERED_REVERSAL_PERIODS, REVERSAL_PERIODS, SAMPLES_PER_PERIOD, STANDING_PERIODS, STANDING_SHARE,
    STANDSTILL_SHARE, TRANSIENT_PERIODS,
};
use crate::along;
use crate::error::Outcome;
use crate::segment::RecordingSegment;

/// The columns of a regressor that jump at a reversal, and the filter that they pass.
pub(super) struct DirectionColumns {
    /// Positions of the base parameters.
    columns: Vec<usize>,
    /// Whether any effect depends on the direction of a motion.
    has_jumps: bool,
    /// The filter of the preparation; `None` without such columns, or if it cannot be applied.
    low_pass: Option<LowPass>,
    /// Period of the cut-off of the preparation, s; zero without a filter.
    period: f64,
}

impl DirectionColumns {
    /// Those of a model along a segment.
    pub(super) fn new(servo: &ServoModel, segment: &RecordingSegment) -> Self {
        let jumping = jumping_terms(servo);
        let (columns, is_complete) = jumping_columns(servo, &jumping);
        let low_pass = (is_complete && !columns.is_empty())
            .then(|| filter_of(segment))
            .flatten();
        Self {
            period: segment.run.prepared.cutoff_hz.map_or(0.0, f64::recip),
            has_jumps: !jumping.is_empty(),
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

    /// Which samples of a segment are used: forces that were measured, and drives whose friction has a known direction.
    ///
    /// Fails when a pose has no solution.
    pub(super) fn choose_samples(&self, servo: &ServoModel, segment: &RecordingSegment) -> Outcome<SampleChoice> {
        let rates = along::drive_rates(&servo.equations, segment)?;
        let body_rows = servo.body_rows();
        let measured = |d: usize, chosen: Vec<bool>| -> Vec<bool> {
            let chosen = chosen.into_iter().enumerate();
            chosen
                .map(|(sample, counts)| counts && segment.run.is_force_measured(d, sample))
                .collect()
        };
        let of_drive = |d: &usize| measured(*d, self.between_reversals(&segment.run.time, &rates[*d]));
        let between_reversals: Vec<Vec<bool>> = body_rows.iter().map(of_drive).collect();
        let counts = if self.low_pass.is_some() {
            let of_drive = |d: &usize| measured(*d, self.with_known_direction(&segment.run.time, &rates[*d]));
            body_rows.iter().map(of_drive).collect()
        } else {
            between_reversals.clone()
        };
        Ok(SampleChoice {
            counts,
            between_reversals,
        })
    }

    /// At which samples the filtered columns of friction are known.
    fn with_known_direction(&self, time: &[f64], rates: &[f64]) -> Vec<bool> {
        let transient = TRANSIENT_PERIODS * self.period;
        let (first, last) = (time[0] + transient, time[time.len() - 1] - transient);
        let standing = standing_samples(time, rates, self.period);
        let moving = moving_samples(time, rates, FILTERED_REVERSAL_PERIODS * self.period);
        let is_known = |i: usize| moving[i] && !standing[i] && (first..=last).contains(&time[i]);
        (0..rates.len()).map(is_known).collect()
    }

    /// At which samples the filter of the motion mixes no two directions; all without dry friction.
    fn between_reversals(&self, time: &[f64], rates: &[f64]) -> Vec<bool> {
        if self.has_jumps {
            moving_samples(time, rates, REVERSAL_PERIODS * self.period)
        } else {
            vec![true; rates.len()]
        }
    }
}

/// The samples of a segment that are used, each `[row of a body][sample]`.
pub(super) struct SampleChoice {
    /// The equations that count in a fit.
    pub(super) counts: Vec<Vec<bool>>,
    /// Those that are a whole period of the filter's cut-off from a reversal, where even a friction that is no step has a
    /// known force.
    pub(super) between_reversals: Vec<Vec<bool>>,
}

/// The terms of effects that jump with the sign of a quantity.
fn jumping_terms(servo: &ServoModel) -> Vec<&EffectTerm> {
    let effects = servo.mechanism().effects.iter();
    let terms = effects.flat_map(|effect| &effect.terms);
    terms.filter(|term| has_sign(&term.expression)).collect()
}

/// The base parameters whose columns jump at a reversal, and whether these are all that jumps.
fn jumping_columns(servo: &ServoModel, jumping: &[&EffectTerm]) -> (Vec<usize>, bool) {
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

/// The low-pass that smoothed the motion, for columns with the times of the segment; `None` if the motion was smoothed by
/// another filter, or if the times are uneven, or too sparse or too few for it.
fn filter_of(segment: &RecordingSegment) -> Option<LowPass> {
    let run = &segment.run;
    let (time, cutoff, order) = (&run.time, run.prepared.cutoff_hz?, run.prepared.butterworth_order?);
    let [first, .., last] = time.as_slice() else {
        return None;
    };
    let rate = (time.len() - 1) as f64 / (last - first);
    let low_pass = LowPass::butterworth(order, cutoff, rate).ok()?;
    let is_long = (last - first) * cutoff > 4.0 * TRANSIENT_PERIODS && time.len() > low_pass.padding();
    (is_long && is_even(time) && rate >= SAMPLES_PER_PERIOD * cutoff).then_some(low_pass)
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
