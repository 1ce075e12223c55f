//! Arguments of the commands that work on recordings and fits.

use std::path::PathBuf;

use clap::Args;
use modelmill::model::BaseParameterValues;
use modelmill::{Host, Model};

use crate::args::estimation::EstimatorArgs;
use crate::args::preparation::PreparationArgs;
use crate::failure::CommandOutcome;
use crate::terminal;

/// Where the values of the base parameters come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum ParameterSource {
    /// The model file's nominal values.
    Nominal,
    /// A file that `identify` wrote.
    Fit(PathBuf),
}

impl ParameterSource {
    /// Reads the argument of `--parameters`.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        match text {
            "" => Err("expected `nominal` or the path of a fit".to_owned()),
            "nominal" => Ok(Self::Nominal),
            path => Ok(Self::Fit(PathBuf::from(path))),
        }
    }

    /// The file, if there is one.
    pub(crate) fn file(&self) -> Option<&PathBuf> {
        match self {
            Self::Nominal => None,
            Self::Fit(path) => Some(path),
        }
    }

    /// The values of the base parameters of a model. Remarks go to standard error.
    pub(crate) fn values(&self, host: &Host, model: &Model) -> CommandOutcome<Vec<f64>> {
        Ok(self.load_values(host, model)?.values)
    }

    /// The values with covariance and gains. Remarks go to standard error.
    pub(crate) fn load_values(&self, host: &Host, model: &Model) -> CommandOutcome<BaseParameterValues> {
        let values = match self {
            Self::Nominal => model.base_parameter_values(),
            Self::Fit(path) => {
                let fit = host.fit(path)?;
                model.values_of(&fit, &path.display().to_string())?
            }
        };
        // For example a parameter without a nominal value.
        for note in &values.notes {
            terminal::remark(note);
        }
        Ok(values)
    }

    /// The model with these values in the place of the file's.
    pub(crate) fn apply_to(&self, host: &Host, model: Model) -> CommandOutcome<Model> {
        Ok(match self {
            Self::Nominal => model,
            Self::Fit(_) => model.with_fit(&self.load_values(host, &model)?),
        })
    }

    /// Its name in JSON and text: `nominal`, or the path of the fit.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Nominal => "nominal".to_owned(),
            Self::Fit(path) => path.display().to_string(),
        }
    }
}

/// `evaluate`.
#[derive(Debug, Args)]
pub(crate) struct EvaluateArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Recording with the states (positions, rates, accelerations) at which forces are computed
    #[arg(long, value_name = "RUN")]
    pub(crate) data: PathBuf,
    /// Values of the base parameters: `nominal`, or a file that `identify` wrote
    #[arg(long, value_name = "nominal|FIT.json", default_value = "nominal", value_parser = ParameterSource::parse)]
    pub(crate) parameters: ParameterSource,
    /// Compute reactions instead of the drives' forces: forces (N) and moments (N m) in all joints, and the forces that
    /// close loops. They need the nominal values of all parameters; base parameters do not determine them
    #[arg(long)]
    pub(crate) reactions: bool,
    /// Write the forces to this file instead of standard output
    #[arg(long, value_name = "OUT.csv")]
    pub(crate) out: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) preparation: PreparationArgs,
}

/// `identify`.
#[derive(Debug, Args)]
pub(crate) struct IdentifyArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Recordings (CSV, Parquet, MATLAB, HDF5, MCAP, ROS bags) to identify from; may be repeated; `a.csv+b.csv` joins
    /// files of one run on time
    #[arg(long, value_name = "RUN", required = true, num_args = 1..)]
    pub(crate) data: Vec<PathBuf>,
    /// Recordings for validation, not used in the fit; may be repeated
    #[arg(long, value_name = "RUN", num_args = 1..)]
    pub(crate) check: Vec<PathBuf>,
    /// Write the fit as JSON to this file, for `--parameters` of other commands
    #[arg(long, value_name = "FIT.json")]
    pub(crate) out: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) estimators: EstimatorArgs,
    #[command(flatten)]
    pub(crate) preparation: PreparationArgs,
}

/// `adopt`.
#[derive(Debug, Args)]
pub(crate) struct AdoptArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// A file that `identify` wrote
    pub(crate) fit: PathBuf,
    /// Change the model file
    #[arg(long, conflicts_with = "out")]
    pub(crate) in_place: bool,
    /// Write the model with the fit to this file
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// `recordings`.
#[derive(Debug, Args)]
pub(crate) struct RecordingsArgs {
    /// Recordings (CSV, Parquet, MATLAB, HDF5, MCAP, ROS bags)
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// Propose the table `[recording.columns]` for this model file: columns are paired with its names by name, unit, rates
    /// and how much of a force the model explains; `a.csv+b.csv` joins files of one run on time
    #[arg(long, value_name = "MODEL")]
    pub(crate) model: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}

/// `compare`.
#[derive(Debug, Args)]
pub(crate) struct CompareArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Recordings (CSV, Parquet, MATLAB, HDF5, MCAP, ROS bags); may be repeated; `a.csv+b.csv` joins files of one run on
    /// time
    #[arg(long, value_name = "RUN", required = true, num_args = 1..)]
    pub(crate) data: Vec<PathBuf>,
    /// Values of the base parameters: `nominal`, or a file that `identify` wrote
    #[arg(long, value_name = "nominal|FIT.json", default_value = "nominal", value_parser = ParameterSource::parse)]
    pub(crate) parameters: ParameterSource,
    /// Also simulate the model under the recorded forces, and compare positions over horizons of 0.1 s, 1 s and the whole run
    #[arg(long)]
    pub(crate) forward: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) preparation: PreparationArgs,
}

/// Arguments that `diagnose` and `report` share.
#[derive(Debug, Args)]
pub(crate) struct DiagnosisArgs {
    /// Model file (TOML)
    pub(crate) model: PathBuf,
    /// Recordings in which missing effects are searched (CSV, Parquet, MATLAB, HDF5, MCAP, ROS bags); may be repeated
    #[arg(long, value_name = "RUN", required = true, num_args = 1..)]
    pub(crate) data: Vec<PathBuf>,
    /// Recordings for validation: an effect is accepted only if it lowers the error there. Without any, --data is split
    /// into blocks (cross-validation)
    #[arg(long, value_name = "RUN", num_args = 1..)]
    pub(crate) check: Vec<PathBuf>,
    /// Fix the base parameters at their nominal values: each difference between model and robot is then an error of the
    /// forces. Default: they are estimated
    #[arg(long)]
    pub(crate) held: bool,
    /// Base parameters of an earlier fit (a file that `identify` wrote), for example of a run without load. They are
    /// fixed, or may change within their uncertainty if the fit contains a covariance. `nominal`, the default, selects no
    /// fit: the base parameters are estimated, or fixed at their nominal values with --held
    #[arg(long, value_name = "nominal|FIT.json", default_value = "nominal", hide_default_value = true,
        value_parser = ParameterSource::parse)]
    pub(crate) parameters: ParameterSource,
    #[command(flatten)]
    pub(crate) preparation: PreparationArgs,
}

/// `diagnose`.
#[derive(Debug, Args)]
pub(crate) struct DiagnoseArgs {
    #[command(flatten)]
    pub(crate) diagnosis: DiagnosisArgs,
    /// Write the completed model to this file: the model file with all effects found added
    #[arg(long, value_name = "FILE", help_heading = None)]
    pub(crate) out: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long, help_heading = None)]
    pub(crate) json: bool,
}

/// `report`.
#[derive(Debug, Args)]
pub(crate) struct ReportArgs {
    #[command(flatten)]
    pub(crate) diagnosis: DiagnosisArgs,
    /// Write the page `report.html` into this folder
    #[arg(long, value_name = "DIR", help_heading = None)]
    pub(crate) out: PathBuf,
}

/// `interpret`.
#[derive(Debug, Args)]
pub(crate) struct InterpretArgs {
    /// Model file (TOML); parameters that are not in --unknown keep its nominal values
    pub(crate) model: PathBuf,
    /// Identified base parameters: a file that `identify` wrote
    #[arg(long, value_name = "FIT.json")]
    pub(crate) fit: PathBuf,
    /// Parameters of the model file to solve for, separated by commas
    #[arg(long, value_name = "NAME,...", required = true, value_delimiter = ',')]
    pub(crate) unknown: Vec<String>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub(crate) json: bool,
}
