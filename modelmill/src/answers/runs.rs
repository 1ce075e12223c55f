//! The answer of `runs`.

use serde::Serialize;

use super::EstimateAnswer;

/// The differences that `modelmill runs` finds.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct RunsAnswer {
    /// Name of the model.
    pub(crate) model: String,
    /// Base parameters of one fit to all runs.
    pub(crate) together: Vec<ParameterAnswer>,
    /// The runs, each fitted separately.
    pub(crate) runs: Vec<RunAnswer>,
    /// Base parameters that differ between the first run and another.
    pub(crate) moved: Vec<MovedParameterAnswer>,
    /// Physical changes of a run relative to the first.
    pub(crate) changes: Vec<RunChangeAnswer>,
    /// Permanent changes; they are searched for if there are at least four runs.
    pub(crate) change_points: Vec<ChangePointAnswer>,
    /// Files that could not be evaluated.
    pub(crate) unread: Vec<UnreadRunAnswer>,
    /// The fit of all runs at once in which some values are separate for each run; `null` if it was not requested.
    pub(crate) per_run: Option<SharedFitAnswer>,
}

/// A base parameter with its fitted value.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct ParameterAnswer {
    /// Its name.
    pub(crate) name: String,
    /// Its expression in the physical parameters.
    pub(crate) expression: String,
    /// The value, in `unit`.
    pub(crate) value: f64,
    /// Its standard deviation, in `unit`; `null` if the run does not determine it.
    pub(crate) std: Option<f64>,
    /// The unit.
    pub(crate) unit: String,
}

/// A run.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct RunAnswer {
    /// Its file.
    pub(crate) file: String,
    /// Number of samples.
    pub(crate) samples: usize,
    /// Base parameters of its own fit.
    pub(crate) parameters: Vec<ParameterAnswer>,
    /// `changed`, `different`, `unchanged` or `cannot_tell`, relative to the first run; `null` for the first.
    pub(crate) verdict: Option<&'static str>,
    /// Drives whose forces cannot show a change.
    pub(crate) undecided: Vec<UndecidedDriveAnswer>,
    /// The verdict as sentences; `null` for the first run.
    pub(crate) says: Option<String>,
}

/// A drive whose forces cannot show a change.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct UndecidedDriveAnswer {
    /// The drive.
    pub(crate) drive: String,
    /// Why.
    pub(crate) reason: &'static str,
    /// The share of the force that the reason is about; `null` if it is about none.
    pub(crate) share: Option<f64>,
}

/// A base parameter that differs between two runs.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct MovedParameterAnswer {
    /// Its name.
    pub(crate) parameter: String,
    /// The difference in standard deviations.
    pub(crate) sigmas: f64,
    /// The value in the first run, in `unit`.
    pub(crate) before: f64,
    /// The value in the other run, in `unit`.
    pub(crate) now: f64,
    /// Standard deviation of the difference, in `unit`.
    pub(crate) std: f64,
    /// The unit.
    pub(crate) unit: String,
    /// Indices of both runs.
    pub(crate) between: [usize; 2],
}

/// A physical change between runs, or within one.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct RunChangeAnswer {
    /// Its kind.
    pub(crate) kind: String,
    /// Its places.
    pub(crate) at: Vec<String>,
    /// Its sizes.
    pub(crate) estimates: Vec<EstimateAnswer>,
    /// Indices of both runs.
    pub(crate) between: [usize; 2],
    /// Start and end of a contact, s; `null` for other changes.
    pub(crate) interval: Option<[f64; 2]>,
    /// Increase of the sum of squared residuals without it, relative to the variance of the residual; 0 for contacts.
    pub(crate) gain: f64,
    /// Changes that explain the runs equally well.
    pub(crate) indistinguishable_from: Vec<String>,
    /// The change as a sentence.
    pub(crate) says: String,
}

/// A change that lasts from one run on.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct ChangePointAnswer {
    /// Index of the first run that has it.
    pub(crate) run: usize,
    /// File of this run.
    pub(crate) file: String,
    /// Base parameters with their means before and since.
    pub(crate) parameters: Vec<MeanStepAnswer>,
    /// Physical causes.
    pub(crate) changes: Vec<RunChangeAnswer>,
}

/// The mean of a base parameter before and since a change.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct MeanStepAnswer {
    /// Its name.
    pub(crate) parameter: String,
    /// The mean before, in `unit`.
    pub(crate) before: f64,
    /// The mean since, in `unit`.
    pub(crate) now: f64,
    /// Standard deviation of the difference, in `unit`.
    pub(crate) std: f64,
    /// The unit.
    pub(crate) unit: String,
}

/// A run that could not be evaluated.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct UnreadRunAnswer {
    /// Its file.
    pub(crate) file: String,
    /// The reason.
    pub(crate) says: String,
}

/// The fit of all runs at once, in which some values are separate for each run.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct SharedFitAnswer {
    /// Base parameters that all runs share.
    pub(crate) shared: Vec<ParameterAnswer>,
    /// Factors of force signals, which need a known load.
    pub(crate) gains: Vec<DriveGainAnswer>,
    /// Values of each run.
    pub(crate) runs: Vec<RunValuesAnswer>,
}

/// The factor of a force signal: true force = factor times measured force.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct DriveGainAnswer {
    /// The drive.
    pub(crate) drive: String,
    /// The factor.
    pub(crate) gain: f64,
    /// Its standard deviation.
    pub(crate) std: Option<f64>,
}

/// The values of a run in a fit of all runs.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct RunValuesAnswer {
    /// File of the run.
    pub(crate) file: String,
    /// Its values.
    pub(crate) values: Vec<RunValueAnswer>,
}

/// A value of one run.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(any(test, feature = "schema"), derive(schemars::JsonSchema))]
pub(crate) struct RunValueAnswer {
    /// What has the value, such as a drive.
    #[serde(rename = "of")]
    pub(crate) quantity: String,
    /// Name of the value.
    pub(crate) name: String,
    /// The value, in `unit`.
    pub(crate) value: f64,
    /// Its standard deviation, in `unit`; `null` if the run does not determine it.
    pub(crate) std: Option<f64>,
    /// The unit.
    pub(crate) unit: String,
    /// Whether it is the difference from the first run.
    #[serde(rename = "against_first")]
    pub(crate) is_against_first: bool,
}
