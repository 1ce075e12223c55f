//! `excite`: the periodic trajectory that tells the base parameters apart best, eq. (14), (15) and (17), or that tells an
//! effect from what it may be taken for.

pub mod limits;
pub mod plant;
mod separate;
mod separated;

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::RecordingNote;
use modelmill_identify::excite::{
    ExcitationMotion, ExcitationPlant, ExcitationTrajectory, excite, max_progress_steps,
    scaled_condition_number,
};

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

/// What is asked of an excitation; [`ExcitationRequest::default`] is the paper's, with samples at 500 Hz.
#[derive(Clone, Debug)]
pub struct ExcitationRequest {
    /// The search: harmonics, period, criterion, how many trajectories are tried, seed.
    pub options: Options,
    /// Samples per second of the trajectory, Hz.
    pub rate: f64,
    /// Limits beside those of the model file, or in their place.
    pub limits: Vec<TrajectoryLimit>,
    /// Instead of exciting the base parameters, tell effects apart.
    pub separate: Option<SeparationRequest>,
}

impl Default for ExcitationRequest {
    fn default() -> Self {
        Self {
            options: Options::default(),
            rate: 500.0,
            limits: Vec::new(),
            separate: None,
        }
    }
}

/// Effects that are to be told apart.
#[derive(Clone, Debug)]
pub struct SeparationRequest {
    /// The effect that is to differ most, with values of its parameters and constants, SI units.
    pub effect: NamedEffect,
    /// What it may be taken for. Constants without a value are fitted like parameters.
    pub from: Vec<NamedEffect>,
    /// What is there in either case and the model file lacks.
    pub common_effects: Vec<NamedEffect>,
    /// Standard deviation of the noise in the forces, N or N m, against which the difference is held.
    pub noise: Option<f64>,
}

/// A trajectory that was found.
pub struct ExcitationResult {
    /// What the JSON calls the model.
    pub model: String,
    /// Coefficients, condition numbers, and how close the trajectory comes to its limits.
    pub found: ExcitationTrajectory,
    /// How it was searched for.
    pub options: Options,
    /// By how much effects differ along it, where that was asked for.
    pub separated: Option<SeparationResult>,
    /// Condition number with columns of equal norm.
    pub scaled: Option<f64>,
    /// Times of one period, s.
    pub time: Vec<f64>,
    /// Positions, rates and accelerations of the active coordinates at these times.
    pub motion: ExcitationMotion,
    /// Names of the active coordinates, in their order.
    pub coordinates: Vec<String>,
    /// A picture of the trajectory (SVG).
    pub picture: String,
    /// Remarks.
    pub notes: Vec<RecordingNote>,
}

impl Model {
    /// Searches for the periodic trajectory within limits that tells the base parameters apart best, or effects; `recordings`
    /// are compared with when effects are told apart, and give their size and the noise where these are not given.
    ///
    /// Fails when a coordinate has no limits, when no trajectory keeps them, or when no motion tells the effects apart.
    pub fn excite(
        &self,
        request: &ExcitationRequest,
        recordings: &[&PreparedRecording],
    ) -> Outcome<ExcitationResult> {
        if free_bodies(&self.derivation.mechanism).next().is_some() {
            return Err(Error::input(format!(
                "{}: motion is planned for joints, and this model has a body that hangs on nothing; plan with the body held, \
                 its frame fixed to the base",
                self.path
            )));
        }
        let (all_limits, as_recorded) = limits::with_recorded_ranges(
            self,
            limits::merged_limits(self, &request.limits)?,
            recordings,
        );
        let coordinates = limits::active_limits(self, &all_limits)?;
        let mut options = request.options.clone();
        let plant = ModelPlant::new(self, &all_limits);
        let asked = match &request.separate {
            Some(asked) => Some(separated::prepare_separation(
                self,
                &plant,
                &coordinates,
                &options,
                asked,
                recordings,
            )?),
            None => None,
        };
        let of_asked = asked.iter().flat_map(|asked| asked.notes.clone());
        let notes = as_recorded.into_iter().chain(of_asked).collect();
        let separating = asked.as_ref().map(|asked| asked.plant(&plant, self));
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
        let found = self
            .host()
            .run_job(
                "searching for a trajectory",
                max_progress_steps(&options),
                |job| excite(searched, &coordinates, &options, &|more| job.flow(more)),
            )?
            .map_err(|error| Error::input(format!("{}: {error}", self.path)))?;
        let samples = samples_per_period(request.rate, options.period);
        let motion = ExcitationMotion::sample(&found.series, samples);
        let time: Vec<f64> = (0..samples)
            // Picoseconds are enough, and 7.288 reads better than 7.287999999999999.
            .map(|i| (1e12 * i as f64 * options.period / samples as f64).round() / 1e12)
            .collect();
        let apart = match &separating {
            Some(separating) => {
                let apart = separating.distance_along(&motion, &separating.which);
                Some(apart.ok_or_else(|| too_slow(self, request.rate))?)
            }
            None => None,
        };
        drop(separating);
        let separated = match (asked, apart) {
            (Some(asked), Some(apart)) => Some(SeparationResult {
                distance: apart,
                random: (-found.start_value).exp(),
                before: asked.distance_along_recordings(self)?,
                unit: separated::common_force_unit(self),
                drives: self.drives().len(),
                samples,
                task: asked,
            }),
            _ => None,
        };
        let title = match &separated {
            Some(separated) => format!("{}: tells {}", self.name, separated.task.description()),
            None => format!(
                "{}: excitation with condition number {}",
                self.name,
                significant(found.condition_number, 4)
            ),
        };
        let scaled = plant
            .regressor(&motion)
            .filter(|w| w.ncols() > 0)
            .map(|w| scaled_condition_number(&w))
            .filter(|c| c.is_finite());
        Ok(ExcitationResult {
            model: self.name.clone(),
            picture: picture(self, &plant, &found, &title, &time, &motion),
            found,
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

/// Why a rate of so many samples per second does not do.
fn too_slow(model: &Model, rate: f64) -> Error {
    Error::input(message!(
        "{}: nothing is left of the difference at {rate} samples per second; give a higher rate ({})",
        model.path,
        Remedy::option(OptionName::Rate)
    ))
}

/// Samples over one period.
fn samples_per_period(rate: f64, period: f64) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a float that is too large or negative becomes the nearest number of samples"
    )]
    let samples = (rate * period).round() as usize;
    samples.max(1)
}

impl ExcitationResult {
    /// The trajectory as a recording without forces (CSV): `t`, positions, rates and accelerations.
    pub fn csv(&self) -> String {
        let motion = [
            ("", &self.motion.q),
            ("_d", &self.motion.qd),
            ("_dd", &self.motion.qdd),
        ];
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

/// Positions around their means, rates, accelerations and the nominal model's forces.
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
    let mut panel = |title: &str, columns: &[Vec<f64>], names: &[String]| {
        let curves: Vec<(&str, &[f64])> = names
            .iter()
            .map(String::as_str)
            .zip(columns.iter().map(Vec::as_slice))
            .collect();
        figure.panel(title, &curves);
    };
    let motions = model.motions();
    let unit = match motions.iter().filter(|(_, is_angle)| *is_angle).count() {
        0 => "m",
        angles if angles == motions.len() => "rad",
        _ => "rad or m",
    };
    let title = format!("position around the mean ({}), {unit}", means.join(", "));
    panel(&title, &around, &names);
    let per = |seconds: &str| {
        unit.replace("rad", &format!("rad/{seconds}"))
            .replace('m', &format!("m/{seconds}"))
    };
    panel(&format!("rate, {}", per("s")), &motion.qd, &names);
    panel(
        &format!("acceleration, {}", per("s^2")),
        &motion.qdd,
        &names,
    );
    if let Some(forces) = plant.forces(motion) {
        panel(
            "force of the nominal model, N or N m",
            &forces,
            &model.drives(),
        );
    }
    figure.finish()
}
