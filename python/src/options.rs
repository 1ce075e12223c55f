//! Converts keywords of Python to options of the library, and refuses invalid values.

use modelmill::diagnose::NamedEffect;
use modelmill::excite::{ExcitationCriterion, ExcitationRequest, Options, SeparationRequest, TrajectoryLimit};
use modelmill::options::{DeclaredOptions, OptionDeclaration, OptionKind, OptionValue, find_excluded_pair};
use modelmill::runs::{KnownLoad, PerRunSelection, RunsOptions};
use pyo3::prelude::*;
use pyo3::types::PyFloat;

/// An option, or a sentence with the fault of its value.
pub(crate) type OptionResult<T> = Result<T, String>;

/// The options of a list of declarations, from a mapping of keywords to values. None stands for no value; so does false
/// for a switch and for a number with an implied value, where true stands for the implied value.
pub(crate) struct Keywords<T>(OptionResult<T>);

impl<T: DeclaredOptions> Keywords<T> {
    /// The options of the library; fails with the first invalid value.
    pub(crate) fn options(&self) -> OptionResult<T> {
        self.0.clone()
    }
}

impl<'py, T: DeclaredOptions> FromPyObject<'_, 'py> for Keywords<T> {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        Ok(Self(read_keywords(&given)?))
    }
}

/// Sets the options of all keywords. The outer error is for what is no mapping.
fn read_keywords<T: DeclaredOptions>(given: &Bound<'_, PyAny>) -> PyResult<OptionResult<T>> {
    let mut options = T::default();
    let mut names = Vec::new();
    for one in T::declarations() {
        if !given.contains(one.name)? {
            continue;
        }
        let value = given.get_item(one.name)?;
        let is_switch = matches!(one.kind, OptionKind::Switch { .. });
        if value.is_none() || is_switch && !value.is_truthy()? {
            continue;
        }
        let read = match (&one.kind, read_boolean(&value)) {
            (OptionKind::Number { implied: Some(_), .. }, Some(false)) => continue,
            (
                OptionKind::Number {
                    implied: Some(implied), ..
                },
                Some(true),
            ) => one.parse([*implied]),
            _ => read_value(one, &value).ok_or_else(|| one.expected()),
        };
        if let Err(expected) = read.and_then(|value| one.set(&mut options, value)) {
            return Ok(Err(format!("{}={}: {expected}", one.name, value.repr()?)));
        }
        names.push(one.name);
    }
    Ok(match find_excluded_pair::<T>(&names) {
        None => Ok(options),
        Some((one, other)) => Err(format!("{one} and {other} exclude each other; give one of them")),
    })
}

/// A boolean of Python or numpy; none for a value of another type.
fn read_boolean(value: &Bound<'_, PyAny>) -> Option<bool> {
    value.extract().ok()
}

/// A value of Python for an option, converted as `float()` and `operator.index()` do; none for one of another type, and
/// for booleans as numbers.
fn read_value<T>(one: &OptionDeclaration<T>, value: &Bound<'_, PyAny>) -> Option<OptionValue> {
    let number = |value: &Bound<'_, PyAny>| -> Option<f64> {
        // `float(True)` is 1, which nobody means.
        if read_boolean(value).is_some() {
            return None;
        }
        let number = value.py().get_type::<PyFloat>().call1((value,)).ok()?;
        number.extract().ok()
    };
    let integer = |value: &Bound<'_, PyAny>| match read_boolean(value) {
        Some(_) => None,
        None => value.extract::<usize>().ok(),
    };
    let pair = || -> Option<[Bound<'_, PyAny>; 2]> {
        let parts: Vec<Bound<'_, PyAny>> = value.try_iter().ok()?.collect::<PyResult<_>>().ok()?;
        parts.try_into().ok()
    };
    Some(match &one.kind {
        OptionKind::Switch { .. } => OptionValue::On,
        OptionKind::Number { .. } => OptionValue::Number(number(value)?),
        OptionKind::Integer { .. } => OptionValue::Integer(integer(value)?),
        OptionKind::IntegerPair { .. } => {
            if let Some(both) = integer(value) {
                return Some(OptionValue::IntegerPair(both, both));
            }
            let [first, second] = pair()?;
            OptionValue::IntegerPair(integer(&first)?, integer(&second)?)
        }
        OptionKind::Interval { .. } => {
            let [from, to] = pair()?;
            OptionValue::Interval(number(&from)?, number(&to)?)
        }
        OptionKind::Choice { .. } => OptionValue::Choice(value.extract().ok()?),
        OptionKind::Columns { .. } => OptionValue::Columns(value.extract().ok()?),
    })
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

/// The fault of a text that is not one of the known values.
fn expected_one_of(name: &str, given: &str, known: &[&str]) -> String {
    format!("{name}={given:?}: expected one of {}", known.join(", "))
}
