//! Converts keywords of Python to options of the library, and refuses invalid values.

use modelmill::diagnose::NamedEffect;
use modelmill::excite::{ExcitationCriterion, ExcitationRequest, Options, SeparationRequest, TrajectoryLimit};
use modelmill::identify::{EquationWeights, EstimateRefinement, EstimatorOptions};
use modelmill::recording::{
    DerivativeSource, MAX_FILTER_ORDER, RecordingOptions, SmoothingMethod, StandstillRule, StatePreparation,
};
use modelmill::runs::{KnownLoad, PerRunSelection, RunsOptions};
use pyo3::prelude::*;

/// An option, or a sentence with the fault of its value.
pub(crate) type OptionResult<T> = Result<T, String>;

/// How a recording is read and prepared; the keywords of every method that takes recordings.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct ReadingOptions {
    /// Names of the model with the columns of the recording.
    columns: Vec<(String, String)>,
    /// Cut-off frequency of the low-pass, Hz.
    cutoff_hz: Option<f64>,
    /// Order of the low-pass.
    order: Option<usize>,
    /// Numbers of samples to remove at the start and at the end.
    trim: Option<(usize, usize)>,
    /// Decimation: one of so many samples is kept.
    decimate: usize,
    /// Source of rates and accelerations: `recorded` or `positions`.
    source: String,
    /// Method of smoothing.
    smoothing: String,
    /// Period of the motion, s, for a Fourier series.
    period: Option<f64>,
    /// Highest frequency at which forces are compared, Hz.
    band_hz: Option<f64>,
    /// Whether samples with NaN or empty fields are left out.
    skip_bad_samples: bool,
    /// Whether forces during contacts and pushes are left out of fits and error figures.
    leave_out_events: bool,
    /// First and last time that are used, s.
    between: Option<(f64, f64)>,
    /// Sampling rate of recordings without times, Hz.
    rate: Option<f64>,
    /// Forces of a drive that is slower than this fraction of its maximum rate are left out; 0 leaves out none.
    standstill: Option<f64>,
}

impl ReadingOptions {
    /// The options of the library; fails with the first invalid value.
    pub(crate) fn reading(&self) -> OptionResult<RecordingOptions> {
        let usual = StatePreparation::default();
        let order = self.order.unwrap_or(usual.order);
        if !(1..=MAX_FILTER_ORDER).contains(&order) {
            return Err(format!("order={order}: expected 1 to {MAX_FILTER_ORDER}; 4 is usual"));
        }
        if self.decimate == 0 {
            return Err("decimate=0: expected an integer of at least 1; 1 keeps all samples".to_owned());
        }
        if let Some((from, to)) = self.between
            && !(from < to && from.is_finite() && to.is_finite())
        {
            return Err(format!(
                "between=({from}, {to}): expected two times in s, the first before the second"
            ));
        }
        Ok(RecordingOptions {
            columns: self.columns.clone(),
            preparation: StatePreparation {
                cutoff_hz: check_positive("cutoff_hz", self.cutoff_hz, "a frequency in Hz such as 25")?,
                order,
                trim: self.trim,
                decimate: self.decimate,
                band_hz: check_positive("band_hz", self.band_hz, "a frequency in Hz such as 25")?,
                source: match self.source.as_str() {
                    "recorded" => DerivativeSource::RecordedFirst,
                    "positions" => DerivativeSource::Positions,
                    other => {
                        return Err(expected_one_of("source", other, &["recorded", "positions"]));
                    }
                },
                smoothing: self.smoothing()?,
                ..usual
            },
            skip_bad_samples: self.skip_bad_samples,
            leave_out_events: self.leave_out_events,
            between: self.between,
            rate: check_positive("rate", self.rate, "a sampling rate in Hz such as 100")?,
            standstill: match check_fraction("standstill", self.standstill)? {
                None => StandstillRule::Automatic,
                Some(part) if part > 0.0 => StandstillRule::Below(part),
                Some(_) => StandstillRule::KeepAll,
            },
        })
    }

    /// The method of smoothing; a period selects the Fourier series.
    fn smoothing(&self) -> OptionResult<SmoothingMethod> {
        let period = check_positive("period", self.period, "a time in s such as 7.29")?;
        Ok(match (self.smoothing.as_str(), period) {
            ("auto", None) => SmoothingMethod::Automatic,
            ("auto" | "fourier", period) => SmoothingMethod::Fourier { period },
            ("butterworth", _) => SmoothingMethod::Butterworth,
            ("savitzky_golay", _) => SmoothingMethod::SavitzkyGolay,
            (other, _) => {
                let known = ["auto", "butterworth", "savitzky_golay", "fourier"];
                return Err(expected_one_of("smoothing", other, &known));
            }
        })
    }
}

/// How parameters are estimated.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct EstimationOptions {
    /// Weights of the equations.
    weights: String,
    /// Bound of the robust weights.
    robust: Option<f64>,
    /// Relative standard deviation of the nominal values, as prior knowledge.
    prior: Option<f64>,
    /// Whether the parameters must be physically possible.
    physical: bool,
    /// Whether parameters that the recording does not support are left out.
    essential: bool,
    /// Equations of a drive that is slower than this fraction of its maximum rate are excluded.
    standstill: Option<f64>,
}

impl EstimationOptions {
    /// The options of the library; fails with the first invalid value.
    pub(crate) fn estimation(&self) -> OptionResult<EstimatorOptions> {
        let prior = check_positive("prior", self.prior, "a relative standard deviation such as 0.2")?;
        let refinement = match (prior, self.physical, self.essential) {
            (None, false, false) => EstimateRefinement::None,
            (Some(sigma), false, false) => EstimateRefinement::Prior(sigma),
            (None, true, false) => EstimateRefinement::Physical,
            (None, false, true) => EstimateRefinement::Essential,
            _ => {
                return Err("prior, physical and essential exclude each other; give one of them".to_owned());
            }
        };
        Ok(EstimatorOptions {
            weights: match self.weights.as_str() {
                "auto" => EquationWeights::Automatic,
                "none" => EquationWeights::None,
                "channels" => EquationWeights::Channels,
                "variance" => EquationWeights::Variance,
                other => {
                    return Err(expected_one_of(
                        "weights",
                        other,
                        &["auto", "none", "channels", "variance"],
                    ));
                }
            },
            robust: check_positive("robust", self.robust, "a bound such as 1.345")?,
            refinement,
            standstill: check_fraction("standstill", self.standstill)?.filter(|part| *part > 0.0),
        })
    }
}

/// Options of an excitation.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct ExcitationOptions {
    /// Number of harmonics.
    harmonics: usize,
    period: f64,
    /// Limits as texts, such as `q1=-1:1`.
    limits: Vec<String>,
    /// Criterion of the search: `condition` or `log_det`.
    criterion: String,
    /// Number of random trajectories that are tried first.
    random: usize,
    /// Number of the best random trajectories from which the search starts.
    starts: usize,
    /// Seed of the random numbers.
    seed: u64,
    /// Sampling rate of the trajectory, Hz.
    rate: f64,
    /// The effect that is to be distinguished from others.
    separate: Option<String>,
    /// Its alternatives: effects with which it may be confused.
    apart_from: Vec<String>,
    /// Effects that are present in both cases and missing in the model file.
    beside: Vec<String>,
    /// Standard deviation of the forces, N or N m.
    noise: Option<f64>,
}

impl ExcitationOptions {
    /// The options of the library; fails with the first invalid value.
    pub(crate) fn request(&self) -> OptionResult<ExcitationRequest> {
        let within = |name: &str, value: f64, least: f64, most: f64| {
            if (least..=most).contains(&value) {
                Ok(())
            } else {
                Err(format!("{name}={value}: expected {least} to {most}"))
            }
        };
        within(
            "harmonics",
            f64::from(u32::try_from(self.harmonics).unwrap_or(u32::MAX)),
            1.0,
            50.0,
        )?;
        within("period", self.period, 1e-3, 1e4)?;
        within("rate", self.rate, 1.0, 1e5)?;
        for (name, count) in [("random", self.random), ("starts", self.starts)] {
            if !(1..=1_000_000).contains(&count) {
                return Err(format!("{name}={count}: expected 1 to 1000000"));
            }
        }
        let named = |all: &[String]| {
            all.iter()
                .map(|text| NamedEffect::parse(text))
                .collect::<OptionResult<_>>()
        };
        let separate = match &self.separate {
            None => None,
            Some(_) if self.apart_from.is_empty() => {
                return Err(
                    "separate: the other effects are missing; give them, as in apart_from=[\"viscous_friction@motor\"]"
                        .to_owned(),
                );
            }
            Some(effect) => Some(SeparationRequest {
                effect: NamedEffect::parse(effect)?,
                from: named(&self.apart_from)?,
                common_effects: named(&self.beside)?,
                noise: check_positive("noise", self.noise, "a standard deviation in N or N m")?,
            }),
        };
        Ok(ExcitationRequest {
            options: Options {
                harmonics: self.harmonics,
                period: self.period,
                criterion: match self.criterion.as_str() {
                    "condition" => ExcitationCriterion::Condition,
                    "log_det" => ExcitationCriterion::LogDet,
                    other => {
                        return Err(expected_one_of("criterion", other, &["condition", "log_det"]));
                    }
                },
                random: self.random,
                starts: self.starts,
                seed: self.seed,
                ..Options::default()
            },
            other_harmonics: Vec::new(),
            rate: self.rate,
            limits: self
                .limits
                .iter()
                .map(|text| TrajectoryLimit::parse(text))
                .collect::<OptionResult<_>>()?,
            separate,
        })
    }
}

/// Options for the joint fit of several runs.
pub(crate) fn runs_options(per_run: &[String], loads: &[String]) -> OptionResult<RunsOptions> {
    Ok(RunsOptions {
        per_run: per_run
            .iter()
            .map(|text| PerRunSelection::parse(text))
            .collect::<OptionResult<_>>()?,
        loads: loads
            .iter()
            .map(|text| KnownLoad::parse(text))
            .collect::<OptionResult<_>>()?,
    })
}

/// An optional number, which must be finite and above 0.
fn check_positive(name: &str, value: Option<f64>, expected: &str) -> OptionResult<Option<f64>> {
    match value {
        Some(value) if !(value > 0.0 && value.is_finite()) => {
            Err(format!("{name}={value}: expected {expected}, above 0"))
        }
        value => Ok(value),
    }
}

/// An optional fraction, which must be from 0 to below 1.
fn check_fraction(name: &str, value: Option<f64>) -> OptionResult<Option<f64>> {
    match value {
        Some(value) if !(0.0..1.0).contains(&value) => Err(format!(
            "{name}={value}: expected a number between 0 and 1, such as 0.01"
        )),
        value => Ok(value),
    }
}

/// The fault of a text that is not one of the known values.
fn expected_one_of(name: &str, given: &str, known: &[&str]) -> String {
    format!("{name}={given:?}: expected one of {}", known.join(", "))
}
