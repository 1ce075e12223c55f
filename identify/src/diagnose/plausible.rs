//! Plausible values of effects: what the machine's own size and forces allow. A value beyond is no claim, however well it
//! fits, since parts that cancel fit anything.
//!
//! Bounds follow from units. A force of a parameter is compared with the largest force of its drive, a length with the
//! size of the machine, an angle and a time with those of real gears, encoders and amplifiers.

use super::bench::{EffectSelector, SelectedEffect, n_columns};
use super::column::ForceColumn;
use super::pool::FitScope;
use super::problem::{CandidateEffect, CandidateNature, ColumnSource, DiagnosisProblem, ReadingFaultKind, TIME_BASE};
use super::thresholds::{
    GAIN_CHANGE_LEAST, GAIN_LEAST, GAIN_MOST, GRID_END_SHARE, PLAUSIBLE_MOST_ANGLE, PLAUSIBLE_MOST_CLOCK_SHARE,
    PLAUSIBLE_MOST_DELAY, PLAUSIBLE_MOST_FORCE_RATIO, PLAUSIBLE_MOST_FRICTION_CHANGE, PLAUSIBLE_MOST_LENGTH_SHARE,
    PLAUSIBLE_MOST_LOAD_SHARE, PLAUSIBLE_MOST_PLAY, PLAUSIBLE_MOST_PLAY_SHARE, SAME_SHAPE_MOST_REST,
};
use crate::signal::dot;

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
            let drives_back = || {
                self.friction_change(pick, values)
                    .is_some_and(|change| change.turns_negative(&self.friction_levels(change.channel, picks)))
            };
            if self.is_implausible(pick, values) || drives_back() {
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
        if candidate.effect.kind == "gain_change" {
            return !(GAIN_CHANGE_LEAST..=GAIN_MOST).contains(&values[0]);
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

    /// The change of friction that a drift states; `None` for other effects.
    fn friction_change(&self, pick: &SelectedEffect, values: &[f64]) -> Option<FrictionChange> {
        let candidate = self.candidate(pick);
        if candidate.effect.kind != "friction_drift" {
            return None;
        }
        let channel = (self.problem.layout.channels.iter()).position(|name| candidate.effect.at.contains(name))?;
        let largest = |shape: &str| {
            (candidate.parameters.iter().zip(values))
                .filter(|(parameter, _)| parameter.symbol.contains(shape))
                .fold(0.0_f64, |most, (_, value)| most.max(value.abs()))
        };
        let rate = self.problem.friction.get(3 * channel)?.0[channel].as_ref()?;
        Some(FrictionChange {
            channel,
            viscous: largest("Fv"),
            dry: largest("Fc"),
            top_speed: rate.iter().fold(0.0, |most, v| most.max(v.abs())),
        })
    }

    /// Viscous and dry friction of a channel in the base and in a set; `None` for what neither has as a column of its own.
    fn friction_levels(&self, channel: usize, picks: &[SelectedEffect]) -> [Option<f64>; 2] {
        let (factors, _) = self.fit(picks, FitScope::All);
        let all = || {
            let base = self.problem.base.iter();
            let of_set = picks.iter().flat_map(|pick| {
                let is_drift = self.candidate(pick).is_per_run;
                (pick.columns.iter()).map(move |k| (!is_drift).then(|| self.pool.column(*k)))
            });
            base.map(Some).chain(of_set).zip(&factors)
        };
        [0, 1].map(|which| {
            let shape = self.problem.friction.get(3 * channel + which)?.0[channel].as_ref()?;
            let levels = all().filter_map(|(column, factor)| Some(factor * multiple_of(column?, channel, shape)?));
            levels.reduce(|sum, level| sum + level)
        })
    }
}

/// By how much the friction of a channel changes over a recording, at most.
struct FrictionChange {
    /// The channel.
    channel: usize,
    /// Change of the viscous friction, N s/m or N m s/rad.
    viscous: f64,
    /// Change of the dry friction, N or N m.
    dry: f64,
    /// Largest speed of the drive, m/s or rad/s.
    top_speed: f64,
}

impl FrictionChange {
    /// Whether the change turns friction into a force that drives: half of the change is missing at the start or at the end
    /// of the recording. `levels` are viscous and dry friction in the middle, where they are known.
    fn turns_negative(&self, levels: &[Option<f64>; 2]) -> bool {
        let [viscous, dry] = *levels;
        let slack = |level: f64| PLAUSIBLE_MOST_FRICTION_CHANGE * level.max(0.0);
        let is_dry_negative = dry.is_some_and(|dry| self.dry / 2.0 > slack(dry));
        let is_sum_negative = dry.zip(viscous).is_some_and(|(dry, viscous)| {
            let change = self.dry / 2.0 + self.viscous / 2.0 * self.top_speed;
            change > slack(dry + viscous * self.top_speed)
        });
        is_dry_negative || is_sum_negative
    }
}

/// The factor by which a column is a multiple of a shape that acts on one channel only; `None` if it is none.
fn multiple_of(column: &ForceColumn, channel: usize, shape: &[f64]) -> Option<f64> {
    let acts_elsewhere = (column.0.iter().enumerate()).any(|(d, values)| d != channel && values.is_some());
    let values = column.0[channel].as_ref().filter(|_| !acts_elsewhere)?;
    let factor = dot(values, shape) / dot(shape, shape);
    let rest = values.iter().zip(shape).map(|(x, s)| (x - factor * s).powi(2));
    (rest.sum::<f64>() < SAME_SHAPE_MOST_REST * dot(values, values)).then_some(factor)
}
