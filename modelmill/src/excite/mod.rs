//! `excite`: the periodic trajectory that determines the base parameters best, eq. (14), (15) and (17), or that
//! distinguishes an effect best from its alternatives.

pub mod limits;
pub mod plant;
mod separate;
mod separated;

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::excite::{
    ExcitationLimits, ExcitationMotion, ExcitationPlant, ExcitationTrajectory, FourierSeries, excite,
    max_progress_steps, scaled_condition_number,
};
use modelmill_identify::{RecordingNote, float_to_count};

use crate::diagnose::NamedEffect;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::recording::free::free_bodies;
use crate::text::csv::csv;
use crate::text::svg::SvgFigure;
use crate::text::table::significant;

pub use limits::TrajectoryLimit;
pub use modelmill_identify::excite::{ExcitationCriterion, Options};
use plant::ModelPlant;
pub use separated::SeparationResult;

/// A request for an excitation. [`ExcitationRequest::default`] has the settings of the paper, with samples at 500 Hz.
#[derive(Clone, Debug)]
pub struct ExcitationRequest {
    /// The search: harmonics, period, criterion, number of trajectories, seed.
    pub options: Options,
    /// Other numbers of harmonics, each with a search of its own. The best result counts.
    pub other_harmonics: Vec<usize>,
    /// Sampling rate of the trajectory, Hz.
    pub rate: f64,
    /// Limits in addition to those of the model file, or in their place.
    pub limits: Vec<TrajectoryLimit>,
    /// Effects to distinguish; if given, they are the goal of the search instead of the base parameters.
    pub separate: Option<SeparationRequest>,
}

impl Default for ExcitationRequest {
    fn default() -> Self {
        Self {
            options: Options::default(),
            other_harmonics: Vec::new(),
            rate: 500.0,
            limits: Vec::new(),
            separate: None,
        }
    }
}

/// Effects that the motion must distinguish.
#[derive(Clone, Debug)]
pub struct SeparationRequest {
    /// The effect whose force must differ most, with values of its parameters and constants, SI units.
    pub effect: NamedEffect,
    /// Its alternatives: effects with which it may be confused. Constants without a value are fitted like parameters.
    pub from: Vec<NamedEffect>,
    /// Effects that the machine has in any case and the model file lacks. They act with the effect and with its
    /// alternatives.
    pub common_effects: Vec<NamedEffect>,
    /// Standard deviation of the noise in the forces, N or N m. The difference between the forces of the effects is given
    /// in multiples of it.
    pub noise: Option<f64>,
}

/// The result of a search.
pub struct ExcitationResult {
    /// Name of the model in the JSON.
    pub model: String,
    /// The trajectory: coefficients, condition numbers, and its distance from the limits.
    pub found: ExcitationTrajectory,
    /// The options of the search, with the number of harmonics and the period of the result.
    pub options: Options,
    /// The bounds of the period, s, if it was a variable of the search.
    pub period_range: Option<[f64; 2]>,
    /// The result for each number of harmonics, in the order of the request; one row if there was one number.
    pub compared: Vec<HarmonicsResult>,
    /// The difference of the effects along the trajectory; `None` if the request had no effects to distinguish.
    pub separated: Option<SeparationResult>,
    /// Condition number of the regressor with columns of equal norm; `None` if it is infinite or no base parameter is
    /// unknown.
    pub scaled: Option<f64>,
    /// Times of one period, s.
    pub time: Vec<f64>,
    /// Positions, rates and accelerations of the active coordinates at these times.
    pub motion: ExcitationMotion,
    /// Names of the active coordinates, in their order.
    pub coordinates: Vec<String>,
    /// A picture of the trajectory (SVG).
    pub picture: String,
    /// Notes on limits and effects.
    pub notes: Vec<RecordingNote>,
}

/// The best trajectory for one number of harmonics.
#[derive(Clone, Debug, PartialEq)]
pub struct HarmonicsResult {
    /// Number of harmonics.
    pub harmonics: usize,
    /// Period, s.
    pub period: f64,
    /// Value of the criterion that was minimised.
    pub value: f64,
    /// Condition number of the regressor.
    pub condition_number: f64,
}

impl HarmonicsResult {
    /// The result of a search.
    fn new(harmonics: usize, found: &ExcitationTrajectory) -> Self {
        Self {
            harmonics,
            period: found.series.first().map_or(f64::NAN, FourierSeries::period),
            value: found.value,
            condition_number: found.condition_number,
        }
    }
}

/// Searches once for each number of harmonics and keeps the best trajectory. The options get its number and period.
///
/// Fails if no number of harmonics has a trajectory, or if the listener stops the job.
fn search_all(
    model: &Model,
    plant: &dyn ExcitationPlant,
    limits: &[ExcitationLimits],
    options: &mut Options,
    others: &[usize],
) -> Outcome<(ExcitationTrajectory, Vec<HarmonicsResult>)> {
    let mut compared = Vec::new();
    let mut best: Option<(usize, ExcitationTrajectory)> = None;
    let mut failure = None;
    for harmonics in std::iter::once(options.harmonics).chain(others.iter().copied()) {
        let one = Options {
            harmonics,
            ..options.clone()
        };
        // The search reports progress for each trajectory.
        let found = model
            .host()
            .run_job("searching for a trajectory", max_progress_steps(&one), |job| {
                excite(plant, limits, &one, &|more| job.flow(more))
            })?;
        match found {
            Ok(found) => {
                compared.push(HarmonicsResult::new(harmonics, &found));
                if best.as_ref().is_none_or(|(_, best)| found.value < best.value) {
                    best = Some((harmonics, found));
                }
            }
            Err(error) => {
                if !others.is_empty() {
                    let says = format!("With {harmonics} harmonics no trajectory was found: {error}");
                    model.host().note(&RecordingNote::warning(message!("{says}")));
                }
                failure = Some(error);
            }
        }
    }
    match (best, failure) {
        (Some((harmonics, found)), _) => {
            options.harmonics = harmonics;
            // Without a range the period stays as it was given, to the last digit.
            if options.period_range.is_some() {
                options.period = found.series.first().map_or(options.period, FourierSeries::period);
            }
            Ok((found, compared))
        }
        (None, Some(error)) => Err(Error::input(format!("{}: {error}", model.path))),
        (None, None) => Err(Error::input(format!(
            "{}: no number of harmonics was given",
            model.path
        ))),
    }
}

impl Model {
    /// Searches for a periodic trajectory within limits. The best trajectory determines the base parameters most
    /// accurately, or distinguishes the requested effects most clearly.
    ///
    /// `recordings` may be empty. They provide limits of coordinates for which neither the request nor the model file
    /// has a range of positions. If effects are to be distinguished, they also provide the size of the effect and the
    /// noise of the forces, unless the request does. The difference of the effects along these recordings is then part
    /// of the result.
    ///
    /// Fails when a coordinate has no limits, when no trajectory keeps them, or when no motion distinguishes the
    /// effects.
    pub fn excite(&self, request: &ExcitationRequest, recordings: &[&PreparedRecording]) -> Outcome<ExcitationResult> {
        if free_bodies(&self.derivation.mechanism).next().is_some() {
            return Err(Error::input(format!(
                "{}: motion is planned for joints, but this model has a free body; fix the body to the base and plan \
                 the motion of the joints",
                self.path
            )));
        }
        // Options replace limits of the model file; recordings fill in what both leave open.
        let (all_limits, as_recorded) =
            limits::with_recorded_ranges(self, limits::merged_limits(self, &request.limits)?, recordings);
        let coordinates = limits::active_limits(self, &all_limits)?;
        // The criterion of the options is replaced if effects are the goal.
        let mut options = request.options.clone();
        let plant = ModelPlant::new(self, &all_limits);
        // Effects that no motion can distinguish are refused before the search.
        let separation = match &request.separate {
            Some(separation) => Some(separated::prepare_separation(
                self,
                &plant,
                &coordinates,
                &options,
                separation,
                recordings,
            )?),
            None => None,
        };
        let of_asked = separation.iter().flat_map(|separation| separation.notes.clone());
        let notes = as_recorded.into_iter().chain(of_asked).collect();
        let separating = separation.as_ref().map(|separation| separation.plant(&plant, self));
        // The goal of the search: effects, or else the unknown base parameters.
        if separating.is_some() {
            options.criterion = ExcitationCriterion::Separation;
        } else if !plant.has_unknowns() {
            return Err(Error::input(format!(
                "{}: no base parameter is unknown, so there is nothing to excite",
                self.path
            )));
        }
        let searched: &dyn ExcitationPlant = match &separating {
            Some(separating) => separating,
            None => &plant,
        };
        let (found, compared) = search_all(self, searched, &coordinates, &mut options, &request.other_harmonics)?;
        let samples = samples_per_period(request.rate, options.period);
        let motion = ExcitationMotion::sample(&found.series, samples);
        let time: Vec<f64> = (0..samples)
            // Picoseconds are enough, and 7.288 reads better than 7.287999999999999.
            .map(|i| (1e12 * i as f64 * options.period / samples as f64).round() / 1e12)
            .collect();
        // The samples of the file decide how far the effects differ, not those of the search.
        let apart = match &separating {
            Some(separating) => {
                let apart = separating.distance_along(&motion, &separating.which);
                Some(apart.ok_or_else(|| too_slow(self, request.rate))?)
            }
            None => None,
        };
        drop(separating);
        // The result keeps the task, for its texts.
        let separated = match (separation, apart) {
            (Some(separation), Some(apart)) => Some(SeparationResult {
                distance: apart,
                random: (-found.start_value).exp(),
                before: separation.distance_along_recordings(self)?,
                unit: separated::common_force_unit(self),
                drives: self.row_names().len(),
                samples,
                task: separation,
            }),
            _ => None,
        };
        // The title of the picture names the goal.
        let title = match &separated {
            Some(separated) => format!("{}: separates {}", self.name, separated.task.description()),
            None => format!(
                "{}: excitation with condition number {}",
                self.name,
                significant(found.condition_number, 4)
            ),
        };
        // The scaled condition number is computed along the samples of the file.
        let scaled = plant
            .regressor(&motion)
            .filter(|w| w.ncols() > 0)
            .map(|w| scaled_condition_number(&w))
            .filter(|c| c.is_finite());
        Ok(ExcitationResult {
            model: self.name.clone(),
            picture: picture(self, &plant, &found, &title, &time, &motion),
            found,
            period_range: options.period_range,
            compared,
            options,
            separated,
            scaled,
            time,
            motion,
            coordinates: self.active_coordinates(),
            notes,
        })
    }
}

/// The error of a sampling rate that is too low to show the difference.
fn too_slow(model: &Model, rate: f64) -> Error {
    Error::input(message!(
        "{}: the difference of the effects is lost at {rate} samples per second; give a higher rate ({})",
        model.path,
        Remedy::option(OptionName::Rate)
    ))
}

/// Number of samples of one period, at least 1.
fn samples_per_period(rate: f64, period: f64) -> usize {
    let samples = float_to_count((rate * period).round());
    samples.max(1)
}

impl ExcitationResult {
    /// The trajectory as a recording without forces (CSV): `t`, positions, rates and accelerations, SI units.
    pub fn csv(&self) -> String {
        let motion = [("", &self.motion.q), ("_d", &self.motion.qd), ("_dd", &self.motion.qdd)];
        let named: Vec<(String, &[f64])> = motion
            .iter()
            .flat_map(|(suffix, columns)| {
                let named = self.coordinates.iter().zip(*columns);
                named.map(move |(name, column)| (format!("{name}{suffix}"), column.as_slice()))
            })
            .collect();
        let mut columns = vec![("t", self.time.as_slice())];
        columns.extend(named.iter().map(|(name, column)| (name.as_str(), *column)));
        csv(&columns)
    }
}

/// The picture of a trajectory (SVG): positions around their means, rates, accelerations and the nominal model's
/// forces.
fn picture(
    model: &Model,
    plant: &ModelPlant<'_>,
    found: &ExcitationTrajectory,
    title: &str,
    time: &[f64],
    motion: &ExcitationMotion,
) -> String {
    let names = model.active_coordinates();
    let mut figure = SvgFigure::new(title, time);
    // Positions are drawn around their means, which the title states.
    let around: Vec<Vec<f64>> = motion
        .q
        .iter()
        .zip(&found.series)
        .map(|(q, series)| q.iter().map(|q| q - series.offset).collect())
        .collect();
    let means: Vec<String> = names
        .iter()
        .zip(&found.series)
        .map(|(name, series)| format!("{name} {}", significant(series.offset, 4)))
        .collect();
    // One panel for each kind of quantity, with one curve for each coordinate.
    let mut panel = |title: &str, columns: &[Vec<f64>], names: &[String]| {
        let curves: Vec<(&str, &[f64])> = names
            .iter()
            .map(String::as_str)
            .zip(columns.iter().map(Vec::as_slice))
            .collect();
        figure.panel(title, &curves);
    };
    let active = model.active_coordinate_types();
    let unit = match active.iter().filter(|(_, is_angle)| *is_angle).count() {
        0 => "m",
        angles if angles == active.len() => "rad",
        _ => "rad or m",
    };
    let title = format!("position around the mean ({}), {unit}", means.join(", "));
    panel(&title, &around, &names);
    // Units of derivatives, also if coordinates have different units.
    let per = |seconds: &str| {
        unit.replace("rad", &format!("rad/{seconds}"))
            .replace('m', &format!("m/{seconds}"))
    };
    panel(&format!("rate, {}", per("s")), &motion.qd, &names);
    panel(&format!("acceleration, {}", per("s^2")), &motion.qdd, &names);
    // Forces of the nominal model show whether the drives can follow.
    if let Some(forces) = plant.forces(motion) {
        panel("force of the nominal model, N or N m", &forces, &model.row_names());
    }
    figure.finish()
}
