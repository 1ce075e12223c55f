//! A fit as a file: the JSON that `identify --json` prints and `--parameters FIT.json` reads.

use std::collections::BTreeSet;
use std::path::Path;

use indexmap::IndexMap;
use modelmill_boundary::files::{DiskFiles, FileSource};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::estimate::{ParameterUncertainty, RegressionSolution};
use crate::figures::ErrorFigures;
use crate::figures::equation_sample::EquationSample;
use crate::figures::fit_error::{FitFault, FitFileError};
use crate::recording::RecordingNote;
use crate::words::nearest_name;

/// Largest size of a fit file, bytes.
const LONGEST_FIT: u64 = 64 << 20;

/// A base parameter as the model describes it.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterInfo {
    /// Its name, such as `p1_min`.
    pub name: String,
    /// Its expression in the physical parameters.
    pub expression: String,
    /// Its unit.
    pub unit: String,
    /// Its value from the nominal values of the model file; `None` if one of them is missing.
    pub nominal: Option<f64>,
}

/// Origin of a value of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ParameterStatus {
    /// The recordings determine it.
    #[default]
    Identified,
    /// The recordings do not determine it. Of all values that fit equally well, it is the one nearest to the nominal
    /// values.
    Undetermined,
    /// Fixed, because the recordings do not support an estimate of it in addition to the other parameters
    /// (`identify --essential`). The value is the nominal one, or 0 if there is none.
    NotEssential,
    /// A number of the model file, whose force was subtracted from the measured forces before the fit.
    Known,
}

impl ParameterStatus {
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
    /// Whether it is the default, which is omitted in JSON.
    fn is_identified(&self) -> bool {
        *self == Self::Identified
    }
}

/// A base parameter with its identified value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FitParameter {
    /// Its name, such as `p1_min`.
    pub name: String,
    /// Its expression in the physical parameters.
    pub expression: String,
    /// The identified value; the nominal one (or 0) if the recording does not determine it.
    pub value: f64,
    /// Standard deviation allowing for autocorrelated residuals; `null` if the parameter is not identified, or if there
    /// are no more equations than parameters.
    pub std: Option<f64>,
    /// Standard deviation for independent residuals, for comparison only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub classical_std: Option<f64>,
    /// Number of independent samples that would give the same standard deviation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub effective_samples: Option<f64>,
    /// Unit of the values.
    pub unit: String,
    /// The value from the nominal values of the model file.
    pub nominal: Option<f64>,
    /// Origin of the value; omitted for identified parameters.
    #[serde(default, skip_serializing_if = "ParameterStatus::is_identified")]
    pub status: ParameterStatus,
}

/// An identified gain of an actuator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FitGain {
    /// Its name in `[parameters]` of the model file.
    pub name: String,
    /// The value.
    pub value: f64,
    /// Standard deviation; `null` for a value that was assumed, since the signals determine only its sum with a parameter.
    pub std: Option<f64>,
    /// Unit of the value.
    pub unit: String,
}

/// An identified delay of the only actuator of a drive.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FitDelay {
    /// Name of the drive.
    pub drive: String,
    /// The delay, s.
    pub value: f64,
    /// Standard deviation, s.
    pub std: f64,
}

/// What the JSON of an identification from signals contains for its readers.
#[derive(Deserialize)]
struct SignalFitFile {
    /// `signals`.
    source: String,
    /// The fit of the model without actuators; `null` if only ratios are known.
    model_fit: serde_json::Value,
}

/// A fit read from the JSON file that `identify` writes, or to be written to it: values and standard deviations of all
/// base parameters, error figures and notes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FitFile {
    /// Name of the model.
    pub model: String,
    /// Number of sampling times of the fit; each has one force per drive.
    pub samples: usize,
    /// Condition number of the regressor (2-norm); `null` if its rank is deficient.
    pub condition_number: Option<f64>,
    /// The same for columns of norm 1.
    #[serde(default)]
    pub scaled_condition_number: Option<f64>,
    /// The base parameters, in the order of the regressor's columns.
    pub parameters: Vec<FitParameter>,
    /// Gains of actuators, if the fit is from their signals.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gains: Vec<FitGain>,
    /// Delays of actuators, if the fit is from their signals.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub delays: Vec<FitDelay>,
    /// Covariance of the values, row by row in the order of `parameters`, in the products of their units; omitted if a
    /// standard deviation is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<Vec<Vec<f64>>>,
    /// Values of the model's constants, on which the regressor and the expressions depend.
    #[serde(default, skip_serializing_if = "IndexMap::is_empty")]
    pub constants: IndexMap<String, f64>,
    /// The model's equations at one state. They show whether a fit belongs to another model; absent in fits of earlier
    /// versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equation_sample: Option<EquationSample>,
    /// Directions that the recording does not determine, one sentence each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub undetermined: Vec<String>,
    /// Error figures on the recordings of the fit; no samples in a fit from signals.
    pub fit: ErrorFigures,
    /// Error figures on the validation runs, if any.
    pub check: Option<ErrorFigures>,
    /// Notes on the data.
    #[serde(default, skip_serializing_if = "Vec::is_empty", with = "crate::recording::notes")]
    pub data: Vec<RecordingNote>,
    /// Further results of the estimator, of which only physical parameters are read again.
    #[serde(default, skip_serializing)]
    pub estimator: EstimatorOutput,
}

/// Further results of the estimator.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
pub struct EstimatorOutput {
    /// Physically possible parameters, if these were requested.
    #[serde(default)]
    physical: Option<FitFilePhysical>,
}

/// Physical parameters in a fit file.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct FitFilePhysical {
    /// All of them, in the order of the file.
    parameters: Vec<PhysicalValue>,
}

/// A physical parameter in a fit file.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct PhysicalValue {
    name: String,
    value: f64,
}

/// The parameters of a fit file from the model's description, the solution and its standard deviations, all in the
/// order of the regressor's columns (asserted to have equal length).
pub fn fit_parameters(
    infos: &[ParameterInfo],
    solution: &RegressionSolution,
    deviations: &ParameterUncertainty,
) -> Vec<FitParameter> {
    assert_eq!(infos.len(), solution.values.len(), "one description per column");
    assert_eq!(infos.len(), deviations.std.len(), "one standard deviation per column");
    let finite = |value: f64| value.is_finite().then_some(value);
    infos
        .iter()
        .enumerate()
        .map(|(i, info)| FitParameter {
            name: info.name.clone(),
            expression: info.expression.clone(),
            value: solution.values[i],
            std: finite(deviations.std[i]),
            classical_std: finite(solution.classical_std[i]),
            effective_samples: finite(deviations.effective_samples[i]).filter(|x| *x > 0.0),
            unit: info.unit.clone(),
            nominal: info.nominal,
            status: if solution.determined[i] {
                ParameterStatus::Identified
            } else {
                ParameterStatus::Undetermined
            },
        })
        .collect()
}

impl FitFile {
    /// Physically possible parameters as (name, value); none unless they were requested.
    pub fn physical_parameters(&self) -> Vec<(String, f64)> {
        let found = self.estimator.physical.iter().flat_map(|found| &found.parameters);
        found.map(|one| (one.name.clone(), one.value)).collect()
    }

    /// Covariance of some of the parameters, by their positions: that of the file, or else the squares of its standard
    /// deviations as if the values were independent. `None` if a standard deviation is missing. The flag is true for
    /// the file's covariance.
    pub fn covariance_of(&self, parameters: &[usize]) -> Option<(DMatrix<f64>, bool)> {
        let n = parameters.len();
        let std: Option<Vec<f64>> = parameters.iter().map(|k| self.parameters.get(*k)?.std).collect();
        let std = std?;
        let whole = self.covariance.as_ref().filter(|rows| {
            let m = self.parameters.len();
            rows.len() == m && rows.iter().all(|row| row.len() == m)
        });
        Some(match whole {
            Some(rows) => {
                let entry = |a: usize, b: usize| rows[parameters[a]][parameters[b]];
                (DMatrix::from_fn(n, n, entry), true)
            }
            None => {
                let diagonal = std.iter().map(|s| s * s);
                let diagonal = DVector::from_iterator(n, diagonal);
                (DMatrix::from_diagonal(&diagonal), false)
            }
        })
    }

    /// Reads a fit; fails if the file cannot be read or is something else.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, FitFileError> {
        Self::read_from(&DiskFiles::default(), path.as_ref())
    }

    /// Reads a fit as [`FitFile::read`] does, from `files`.
    pub fn read_from(files: &dyn FileSource, path: &Path) -> Result<Self, FitFileError> {
        let file = path.display().to_string();
        let text = files.read_text(path, LONGEST_FIT).map_err(|error| FitFileError {
            file: file.clone(),
            fault: FitFault::Unreadable {
                reason: error.fault.to_string(),
            },
        })?;
        Self::parse(&text, &file)
    }

    /// Reads a fit from its text. `file` is only used in messages, as the name of the fit.
    pub fn parse(text: &str, file: &str) -> Result<Self, FitFileError> {
        if !text.trim_start().starts_with('{') {
            return Err(FitFileError {
                file: file.to_owned(),
                fault: FitFault::NoJson,
            });
        }
        if let Ok(signals) = serde_json::from_str::<SignalFitFile>(text)
            && signals.source == "signals"
        {
            let fault = if signals.model_fit.is_null() {
                FitFault::OnlyRatios
            } else {
                match serde_json::from_value(signals.model_fit) {
                    Ok(fit) => return Ok(fit),
                    Err(error) => FitFault::NotAFit {
                        line: 1,
                        column: 1,
                        reason: format!("`model_fit`: {error}"),
                    },
                }
            };
            return Err(FitFileError {
                file: file.to_owned(),
                fault,
            });
        }
        serde_json::from_str(text).map_err(|error| {
            let full = error.to_string();
            let reason = full.split(" at line ").next().unwrap_or(&full).to_owned();
            let fault = FitFault::NotAFit {
                line: error.line(),
                column: error.column(),
                reason,
            };
            FitFileError {
                file: file.to_owned(),
                fault,
            }
        })
    }

    /// Constants of the model that had other values when the fit was computed: `(name, value then, value now)`. `model`
    /// contains `(name, value)`; a fit without constants, from an earlier version, has none that differ.
    /// Fails if such a constant is in an expression of the base parameters, which then are different.
    /// `file` is only used in messages, as the name of the fit.
    pub fn differing_constants(
        &self,
        model: &[(&str, f64)],
        file: &str,
    ) -> Result<Vec<(String, f64, f64)>, FitFileError> {
        let mut others = Vec::new();
        for (name, now) in model {
            let Some(then) = self.constants.get(*name) else {
                continue;
            };
            if (then - now).abs() <= 1e-12 * then.abs().max(now.abs()) {
                continue;
            }
            if self.parameters.iter().any(|p| contains_name(&p.expression, name)) {
                return Err(FitFileError {
                    file: file.to_owned(),
                    fault: FitFault::ConstantDiffers {
                        name: (*name).to_owned(),
                        file: *then,
                        model: *now,
                    },
                });
            }
            others.push(((*name).to_owned(), *then, *now));
        }
        Ok(others)
    }

    /// The values for a model's base parameters, `(name, expression)` in the model's order.
    /// `file` is only used in messages, as the name of the fit. Fails if the parameters of the file are not exactly
    /// these.
    pub fn values_for(&self, model: &[(&str, &str)], file: &str) -> Result<Vec<f64>, FitFileError> {
        let fail = |fault| FitFileError {
            file: file.to_owned(),
            fault,
        };
        let mut known = BTreeSet::new();
        for parameter in &self.parameters {
            if !known.insert(parameter.name.as_str()) {
                return Err(fail(FitFault::DuplicateParameter {
                    name: parameter.name.clone(),
                }));
            }
        }
        let mut values = Vec::with_capacity(model.len());
        for (name, expression) in model {
            let Some(parameter) = self.parameters.iter().find(|parameter| parameter.name == *name) else {
                let present: Vec<String> = self.parameters.iter().map(|p| p.name.clone()).collect();
                return Err(fail(FitFault::MissingParameter {
                    name: (*name).to_owned(),
                    nearest: nearest_name(name, present.iter().map(String::as_str)).map(str::to_owned),
                    present,
                }));
            };
            if parameter.expression != *expression {
                return Err(fail(FitFault::ExpressionDiffers {
                    name: parameter.name.clone(),
                    file: parameter.expression.clone(),
                    model: (*expression).to_owned(),
                }));
            }
            values.push(parameter.value);
        }
        let known = |name: &str| model.iter().any(|(ours, _)| *ours == name);
        let unknown: Vec<String> = self
            .parameters
            .iter()
            .map(|p| p.name.clone())
            .filter(|name| !known(name))
            .collect();
        if unknown.is_empty() {
            Ok(values)
        } else {
            Err(fail(FitFault::UnknownParameters { names: unknown }))
        }
    }
}

/// Whether a name occurs in an expression as a complete word.
fn contains_name(expression: &str, name: &str) -> bool {
    expression
        .split(|c: char| !(c.is_alphanumeric() || c == '_'))
        .any(|word| word == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"{"model": "axis", "samples": 10, "condition_number": 2.0,
        "parameters": [
            {"name": "p1_min", "expression": "m", "value": 95.1, "std": 0.2, "unit": "kg", "nominal": 90.0},
            {"name": "p2_min", "expression": "fv", "value": 203.5, "std": null, "unit": "N s/m", "nominal": null}],
        "fit": {"nrms": 0.04, "rms": 1.0, "samples": 10,
            "channels": {"axis": {"nrms": 0.04, "mean_relative": 0.1, "max_abs": 3.0, "rms": 1.0, "zero_measured": 0}}},
        "check": null}"#;

    #[test]
    fn a_fit_survives_writing_and_reading() {
        let fit = FitFile::parse(TEXT, "fit.json").unwrap();
        let again = FitFile::parse(&serde_json::to_string_pretty(&fit).unwrap(), "fit.json").unwrap();
        assert_eq!(fit, again);
        assert_eq!(
            fit.values_for(&[("p2_min", "fv"), ("p1_min", "m")], "fit.json")
                .unwrap(),
            [203.5, 95.1]
        );
    }

    #[test]
    fn other_constants_are_told_and_refused_where_parameters_hold_them() {
        let text = TEXT
            .replace("\"expression\": \"m\"", "\"expression\": \"m + L*m2\"")
            .replace(
                "\"parameters\"",
                "\"constants\": {\"L\": 0.5, \"g\": 9.81}, \"parameters\"",
            );
        let fit = FitFile::parse(&text, "fit.json").unwrap();
        let others = |model: &[(&str, f64)]| fit.differing_constants(model, "fit.json");
        assert_eq!(others(&[("L", 0.5), ("g", 9.81), ("new", 1.0)]), Ok(vec![]));
        assert_eq!(
            others(&[("L", 0.5), ("g", 9.80)]),
            Ok(vec![("g".to_owned(), 9.81, 9.80)])
        );
        let says = others(&[("L", 0.6)]).unwrap_err().to_string();
        assert!(says.contains("L = 0.5") && says.contains("L = 0.6"), "{says}");
        let earlier = FitFile::parse(TEXT, "fit.json").unwrap();
        assert_eq!(earlier.differing_constants(&[("m", 1.0)], "fit.json"), Ok(vec![]));
    }

    #[test]
    fn a_fit_of_another_model_is_refused_with_the_reason() {
        let fit = FitFile::parse(TEXT, "fit.json").unwrap();
        let says = |model: &[(&str, &str)]| fit.values_for(model, "fit.json").unwrap_err().to_string();
        assert_eq!(
            says(&[("p1_min", "m"), ("p3_min", "fc"), ("p2_min", "fv")]),
            "fit.json: the model's parameter `p3_min` is not in the fit (the closest is `p1_min`), \
             which has `p1_min`, `p2_min`; identify this model again"
        );
        assert!(says(&[("p1_min", "m")]).contains("has `p2_min`, which the model does not have"));
        assert!(says(&[("p1_min", "m + d"), ("p2_min", "fv")]).contains("`m` in the fit but `m + d` in the model"));
        let broken = FitFile::parse(&TEXT.replace("\"fit\"", "\"fits\""), "fit.json")
            .unwrap_err()
            .to_string();
        assert!(
            broken.contains("line") && broken.contains("missing field `fit`"),
            "{broken}"
        );
        let absent = FitFile::read("no/such/fit.json").unwrap_err().to_string();
        assert!(
            absent.contains("no/such/fit.json") && absent.contains("verb `identify`"),
            "{absent}"
        );
    }
}
