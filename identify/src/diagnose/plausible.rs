//! Plausible values of effects: what the machine's own size and forces allow. A value beyond is no claim, however well it
//! fits, since parts that cancel fit anything.
//!
//! Bounds follow from units. A force of a parameter is compared with the largest force of its drive, a length with the
//! size of the machine, an angle and a time with those of real gears, encoders and amplifiers.

use super::bench::{EffectSelector, SelectedEffect, n_columns};
use super::problem::{CandidateEffect, CandidateNature, ColumnSource, DiagnosisProblem, ReadingFaultKind, TIME_BASE};
use super::thresholds::{
    GAIN_LEAST, GAIN_MOST, GRID_END_SHARE, PLAUSIBLE_MOST_ANGLE, PLAUSIBLE_MOST_CLOCK_SHARE, PLAUSIBLE_MOST_DELAY,
    PLAUSIBLE_MOST_FORCE_RATIO, PLAUSIBLE_MOST_LENGTH_SHARE, PLAUSIBLE_MOST_LOAD_SHARE, PLAUSIBLE_MOST_PLAY,
    PLAUSIBLE_MOST_PLAY_SHARE,
};

/// Largest magnitude of the forces of each channel, N or N m; infinite for a channel without force.
pub(crate) fn largest_forces(problem: &DiagnosisProblem) -> Vec<f64> {
    let channels = 0..problem.layout.channels.len();
    let largest = |d: usize| {
        let force = problem.measured_force(d);
        force.iter().fold(0.0_f64, |most, x| most.max(x.abs()))
    };
    channels
        .map(|d| match largest(d) {
            force if force > 0.0 && !problem.is_idle(d) => force,
            _ => f64::INFINITY,
        })
        .collect()
}

/// The largest plausible magnitude of a parameter by its unit and kind; `size` is the largest distance of two frames of
/// the machine, m, or zero if it is unknown.
fn largest_value(candidate: &CandidateEffect, parameter: usize, size: f64) -> f64 {
    let kind = candidate.effect.kind.as_str();
    let is_play = kind == "backlash" || kind == "encoder_eccentricity";
    match candidate.parameters[parameter].unit.as_str() {
        "m" if size > 0.0 && is_play => PLAUSIBLE_MOST_PLAY_SHARE * size,
        "m" if size > 0.0 => PLAUSIBLE_MOST_LENGTH_SHARE * size,
        "rad" if is_play => PLAUSIBLE_MOST_PLAY,
        // A tilt may be any rotation.
        "rad" if !matches!(candidate.source, ColumnSource::Tilt(_)) => PLAUSIBLE_MOST_ANGLE,
        "s" => PLAUSIBLE_MOST_DELAY,
        "1" if candidate.source == ColumnSource::LoadDependent => PLAUSIBLE_MOST_LOAD_SHARE,
        "1" if kind == TIME_BASE => PLAUSIBLE_MOST_CLOCK_SHARE,
        _ => f64::INFINITY,
    }
}

/// Whether the force of a parameter is compared with that of the drive. Terms of a polynomial are not, since they cancel
/// where the origin of the coordinate is far from its travel, nor are several parameters at a place that is no drive,
/// where a constant force has the curve of the lever. A polynomial has one term for each unit; further ones are waves.
fn is_force_bounded(candidate: &CandidateEffect, parameter: usize, drives: &[String]) -> bool {
    let unit = |k: usize| candidate.parameters[k].unit.as_str();
    let numbers = candidate.parameters.len();
    let is_polynomial = (0..numbers).any(|k| unit(k).contains("^3"));
    let is_wave = (0..parameter).any(|k| unit(k) == unit(parameter));
    let is_reading = matches!(candidate.source, ColumnSource::ReadingFault(_));
    let is_at_drives = candidate.effect.at.iter().all(|place| drives.contains(place));
    candidate.nature == CandidateNature::Effect
        && !is_reading
        && (numbers == 1 || is_at_drives)
        && (!is_polynomial || is_wave)
}

/// Whether the searched constant of an effect with one parameter sits at the upper end of its range, such as a Stribeck
/// speed near the largest speed: the effect then describes something else.
fn is_at_end_of_grid(candidate: &CandidateEffect, pick: &SelectedEffect) -> bool {
    let ColumnSource::Columns(choices) = &candidate.source else {
        return false;
    };
    let [(_, value)] = pick.constants.as_slice() else {
        return false;
    };
    let last = choices.last().and_then(|choice| choice.constants.first());
    choices.len() > 2
        && candidate.parameters.len() == 1
        && last.is_some_and(|(_, last)| *value >= GRID_END_SHARE * last)
}

impl EffectSelector<'_> {
    /// Effects of a set with a value that is implausible for the machine, by position; `factors` are those of the base
    /// and the set.
    pub(crate) fn find_implausible(&self, picks: &[SelectedEffect], factors: &[f64]) -> Vec<usize> {
        let mut at = factors.len() - n_columns(picks);
        let mut implausible = Vec::new();
        for (i, pick) in picks.iter().enumerate() {
            let values = &factors[at..at + pick.columns.len()];
            at += values.len();
            if self.is_implausible(pick, values) {
                implausible.push(i);
            }
        }
        implausible
    }

    /// Whether one of the values of an effect is implausible.
    fn is_implausible(&self, pick: &SelectedEffect, values: &[f64]) -> bool {
        let candidate = self.candidate(pick);
        // Below it the signal does not follow the motion at all, so that no scale describes it.
        if let ColumnSource::ReadingFault(fault) = candidate.source
            && fault.kind == ReadingFaultKind::Scaled
        {
            return !(GAIN_LEAST..=GAIN_MOST).contains(&values[0]);
        }
        is_at_end_of_grid(candidate, pick)
            || values
                .iter()
                .zip(&pick.columns)
                .enumerate()
                .any(|(k, (value, column))| {
                    let is_too_strong = || {
                        is_force_bounded(candidate, k, &self.problem.layout.channels)
                            && value.abs() * self.pool.relative_range(*column) > PLAUSIBLE_MOST_FORCE_RATIO
                    };
                    value.abs() > largest_value(candidate, k, self.problem.size) || is_too_strong()
                })
    }
}
