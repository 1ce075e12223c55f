//! Trajectories of the experiment, eq. (14), (15) and (17), and the rig's runs along them.

use std::f64::consts::PI;

use modelmill_identify::PreparedRun;
use modelmill_identify::excite::{
    ExcitationLimits, ExcitationMotion, ExcitationPlant, FourierSeries, Options, condition_number, excite,
    max_progress_steps,
};
use modelmill_rig::{Rig, RigState, Trajectory};

use modelmill::Model;
use modelmill::excite::limits;
use modelmill::excite::plant::ModelPlant;
use modelmill::segment::RecordingSegment;
use modelmill::{Error, Outcome};

/// Inverse of the step to which coefficients are rounded, so that they can be printed and everybody can repeat the
/// runs.
const DECIMALS: f64 = 1e4;
/// Number of samples of a period at which limits are checked again after rounding.
const FINE: usize = 4000;

/// A periodic trajectory.
pub(crate) struct PeriodicTrajectory {
    /// One series for each active coordinate.
    pub(crate) series: Vec<FourierSeries>,
    /// Period, s.
    pub(crate) period: f64,
    /// Condition number of the regressor along it.
    pub(crate) condition_number: f64,
    /// The same for the best random trajectory.
    pub(crate) start: f64,
    /// Number of random trajectories that were tried.
    pub(crate) random: usize,
}

/// Factors of the limits of the active coordinates: of their ranges, and of rates and accelerations.
#[derive(Clone, Copy)]
pub(crate) struct LimitFactors {
    /// Factor of the ranges of positions, about their middles.
    pub(crate) positions: f64,
    /// Factor of rates and accelerations.
    pub(crate) rates: f64,
}

impl Default for LimitFactors {
    fn default() -> Self {
        Self {
            positions: 1.0,
            rates: 1.0,
        }
    }
}

/// The best trajectory within scaled limits, without rounding; otherwise the reason why there is none.
///
/// Fails if the user cancels it.
pub(crate) fn search_within(
    model: &Model,
    options: &Options,
    factors: LimitFactors,
    message: &str,
) -> Outcome<Result<PeriodicTrajectory, String>> {
    let all_limits = limits::merged_limits(model, &[])?;
    let mut coordinates = limits::active_limits(model, &all_limits)?;
    for one in &mut coordinates {
        let [low, high] = one.position;
        let (middle, half) = (0.5 * (low + high), 0.5 * factors.positions * (high - low));
        one.position = [middle - half, middle + half];
        for range in [&mut one.rate, &mut one.acceleration].into_iter().flatten() {
            *range = range.map(|end| factors.rates * end);
        }
    }
    let plant = ModelPlant::new(model, &all_limits);
    let search = model.host().run_job(message, max_progress_steps(options), |job| {
        excite(&plant, &coordinates, options, &|more| job.flow(more))
    })?;
    let found = search.map_err(|error| error.to_string());
    Ok(found.map(|found| PeriodicTrajectory {
        period: found.series.first().map_or(options.period, FourierSeries::period),
        condition_number: found.condition_number,
        series: found.series,
        start: found.start_condition_number,
        random: found.feasible_starts,
    }))
}

/// Searches for a trajectory; it satisfies all limits with rounded coefficients.
pub(crate) fn search(model: &Model, options: &Options, message: &str) -> Outcome<PeriodicTrajectory> {
    // Limits of the model file, for the active coordinates.
    let all_limits = limits::merged_limits(model, &[])?;
    let coordinates = limits::active_limits(model, &all_limits)?;
    let plant = ModelPlant::new(model, &all_limits);
    let search = model.host().run_job(message, max_progress_steps(options), |job| {
        excite(&plant, &coordinates, options, &|more| job.flow(more))
    })?;
    let found = search.map_err(|error| Error::input(format!("{}: {error}", model.path)))?;
    // Rounding may exceed the limits slightly. The motion is then reduced in steps of 0.1 %.
    // The first factor with which the rounded trajectory is within all limits.
    let series = (0..50)
        .map(|k| round_coefficients(&found.series, 1.0 - 1e-3 * f64::from(k), options.period))
        .find(|series| is_within_limits(&plant, &coordinates, series))
        .ok_or_else(|| {
            Error::input(format!(
                "{}: with rounded coefficients the trajectory exceeds its limits; widen the limits",
                model.path
            ))
        })?;
    // The condition number belongs to the rounded coefficients.
    let motion = ExcitationMotion::sample(&series, modelmill_identify::excite::samples_per_period(options));
    Ok(PeriodicTrajectory {
        condition_number: plant.regressor(&motion).map_or(f64::INFINITY, |w| condition_number(&w)),
        series,
        period: options.period,
        start: found.start_condition_number,
        random: found.feasible_starts,
    })
}

/// Coefficients multiplied by a factor and rounded to four decimals.
fn round_coefficients(series: &[FourierSeries], factor: f64, period: f64) -> Vec<FourierSeries> {
    let round = |x: f64| (x * DECIMALS).round() / DECIMALS;
    let scaled = |list: &[f64]| list.iter().map(|x| round(factor * x)).collect();
    let one = |one: &FourierSeries| FourierSeries {
        offset: round(one.offset),
        mu: scaled(&one.mu),
        nu: scaled(&one.nu),
        omega: 2.0 * PI / period,
    };
    series.iter().map(one).collect()
}

/// Whether a trajectory satisfies the limits of coordinates, rates and accelerations, and those of the plant.
fn is_within_limits(plant: &ModelPlant<'_>, limits: &[ExcitationLimits], series: &[FourierSeries]) -> bool {
    // Extremes of a Fourier series and of its derivatives.
    let within = |one: &FourierSeries, limits: &ExcitationLimits| {
        let ranges = [Some(limits.position), limits.rate, limits.acceleration];
        ranges.into_iter().enumerate().all(|(derivative, range)| {
            let [low, high] = one.extremes(derivative);
            range.is_none_or(|range| range[0] <= low && high <= range[1])
        })
    };
    // Other limits, such as those of passive coordinates and forces, at finely spaced times.
    let excess = plant.excess(&ExcitationMotion::sample(series, FINE));
    series.iter().zip(limits).all(|(s, l)| within(s, l))
        && excess.is_some_and(|all| all.iter().flatten().all(|excess| *excess <= 0.0))
}

/// Simulates a rig along a trajectory: exact states and forces, as of ideal sensors. Differences between them and a
/// model are then errors of the model.
pub(crate) fn run(rig: &Rig, model: &Model, periodic: &PeriodicTrajectory, rate: f64) -> Outcome<RecordingSegment> {
    // Order of coordinates and drives in the rig for those of the model.
    let coordinates = model
        .active_coordinates()
        .iter()
        .map(|name| rig.coordinates.iter().position(|c| c.name == *name))
        .collect::<Option<Vec<usize>>>();
    let drives = model
        .row_names()
        .iter()
        .map(|name| rig.drives.iter().position(|d| d.name == *name))
        .collect::<Option<Vec<usize>>>();
    let (Some(coordinates), Some(drives)) = (coordinates, drives) else {
        return Err(Error::input(format!(
            "{}: the coordinates or drives of the rig have other names than those of {}",
            rig.name, model.path
        )));
    };
    // Times of the samples, with the end of the period included.
    let mut time = Vec::new();
    while time.len() as f64 <= rate * periodic.period {
        time.push(time.len() as f64 / rate);
    }
    // The trajectory in the order of the rig's coordinates.
    let trajectory = Trajectory::from_function(time.clone(), |t| {
        let mut state = RigState::default();
        let zeros = || vec![0.0; rig.coordinates.len()];
        (state.q, state.qd, state.qdd) = (zeros(), zeros(), zeros());
        for (series, k) in periodic.series.iter().zip(&coordinates) {
            [state.q[*k], state.qd[*k], state.qdd[*k]] = series.at_time(t);
        }
        state
    })
    .map_err(|error| Error::input(format!("{}: {error}", rig.name)))?;
    let message = format!("simulating {}", rig.name);
    let made = model.host().run_job(&message, time.len(), |job| {
        modelmill_rig::forces_along(rig, &trajectory, &time, || job.add(1))
    })?;
    let instants = made.map_err(|error| Error::input(format!("{}: {error}", rig.name)))?;
    // One column per coordinate or drive of the model.
    let state = |of: fn(&RigState) -> &Vec<f64>| -> Vec<Vec<f64>> {
        let column = |k: &usize| instants.iter().map(|i| of(&i.state)[*k]).collect();
        coordinates.iter().map(column).collect()
    };
    let force = |k: &usize| instants.iter().map(|i| i.forces[*k]).collect();
    let states = [state(|s| &s.q), state(|s| &s.qd), state(|s| &s.qdd)];
    let forces = Some(drives.iter().map(force).collect());
    Ok(RecordingSegment::from(PreparedRun::from_states(
        rig.name.clone(),
        time,
        states,
        forces,
    )))
}
