//! Checks of base parameters: estimates of the diagnosis are compared with the values of the model, or with intervals
//! of the user.
//!
//! Decision: an estimate whose uncertainty reaches over a limit is neither a pass nor a failure. It is not evaluated,
//! and the sentence states the uncertainty.

use modelmill_identify::{FitParameter, ParameterStatus};

use crate::along;
use crate::diagnose::{DiagnosisFindings, words};
use crate::error::Outcome;
use crate::model::Model;
use crate::recording::{self, PreparedRecording};
use crate::text::table::{number, significant};

use super::causes::parameter_cause;
use super::checks::{CheckScope, CheckState, VerificationCheck};
use super::limits::VerificationLimits;
use super::thresholds::{DEFAULT_FORCE_SHARE, DEFAULT_RELATIVE_DIFFERENCE, DEFAULT_SIGMAS, INTERVAL_SIGMAS};

/// The checks of all base parameters that are not numbers of the file, and of those with an interval of the user.
///
/// Fails when a pose has no solution, or when the job is cancelled.
pub(super) fn check_parameters(
    model: &Model,
    recordings: &[&PreparedRecording],
    limits: &VerificationLimits,
    findings: Result<&DiagnosisFindings, &str>,
) -> Outcome<Vec<VerificationCheck>> {
    let shares = match findings {
        Ok(_) => force_shares(model, recordings)?,
        Err(_) => Vec::new(),
    };
    let mut checks = Vec::new();
    for (k, base) in model.base.iter().enumerate() {
        let interval = limits.interval(&base.name, &base.expression);
        let mut check = VerificationCheck {
            scope: CheckScope::Parameter,
            recording: None,
            at: base.name.clone(),
            quantity: "value",
            state: CheckState::NotEvaluated,
            value: None,
            std: None,
            limit: interval.map_or([None, None], |[low, high]| [Some(low), Some(high)]),
            unit: base.unit.clone(),
            is_default: interval.is_none(),
            says: String::new(),
            cause: None,
        };
        let said = format!("{} = {}", base.name, base.expression);
        if model.is_known(k) {
            // A number of the file needs no recording.
            let Some([low, high]) = interval else { continue };
            let value = model.values[k];
            check.value = Some(value);
            check.state = if (low..=high).contains(&value) {
                CheckState::Pass
            } else {
                CheckState::Fail
            };
            check.says = format!("{said} is {} {} in the model file", number(value), base.unit);
            checks.push(check);
            continue;
        }
        match findings {
            Err(reason) => check.says = format!("{said} was not estimated: {reason}"),
            Ok(findings) => match determined_estimate(model, findings, k) {
                Err(reason) => check.says = format!("{said} was not checked: {reason}"),
                Ok(estimate) => {
                    let nominal = model.has_values(k).then(|| model.values[k]);
                    evaluate(&mut check, &said, &estimate, nominal, shares[k]);
                    if check.state == CheckState::Fail {
                        check.cause = Some(parameter_cause(findings));
                    }
                }
            },
        }
        checks.push(check);
    }
    Ok(checks)
}

/// A value with its standard deviation.
struct DeterminedValue {
    value: f64,
    std: f64,
}

/// The estimate of a base parameter, with the effects that the diagnosis found; the reason why there is none as
/// error.
fn determined_estimate(model: &Model, findings: &DiagnosisFindings, k: usize) -> Result<DeterminedValue, String> {
    if !findings.unresolved.is_empty() {
        return Err("a fault of the recordings must be corrected first".to_owned());
    }
    if words::has_change_in_time(&findings.diagnosis) {
        return Err("something changes during a recording, so that no single value holds for all of it".to_owned());
    }
    let base = &model.base[k];
    let is_it = |p: &&FitParameter| p.expression == base.expression;
    let versions = [findings.final_version(), &findings.before];
    let mut found = versions.iter().filter_map(|version| {
        let fit = &version.identified.as_ref()?.fit;
        fit.parameters.iter().find(is_it)
    });
    match found.next() {
        Some(FitParameter {
            status: ParameterStatus::Identified,
            value,
            std: Some(std),
            ..
        }) if value.is_finite() && std.is_finite() => Ok(DeterminedValue {
            value: *value,
            std: *std,
        }),
        _ => Err("the recordings do not determine it".to_owned()),
    }
}

/// Compares an estimate with the interval of the check, or with the nominal value. `share` is the largest change of
/// the force of a drive, relative to its rms force, for a change of the parameter by one unit.
fn evaluate(check: &mut VerificationCheck, said: &str, estimate: &DeterminedValue, nominal: Option<f64>, share: f64) {
    let DeterminedValue { value, std } = *estimate;
    check.value = Some(value);
    check.std = Some(std);
    let unit = &check.unit;
    let is = format!(
        "{said} is estimated as {} ± {} {unit}",
        number(value),
        significant(std, 2)
    );
    let [low, high] = match (check.limit, nominal) {
        ([Some(low), Some(high)], _) => [low, high],
        (_, None) => {
            check.says = format!("{is}; the model file gives no value and the limits give no interval");
            return;
        }
        (_, Some(nominal)) => {
            let own = DEFAULT_RELATIVE_DIFFERENCE * nominal.abs();
            let half = if share > 0.0 {
                own.max(DEFAULT_FORCE_SHARE / share)
            } else {
                own
            };
            [nominal - half, nominal + half]
        }
    };
    check.limit = [Some(low), Some(high)];
    // A default interval is a guess, so that a failure needs a clear difference from the model's value.
    let (reference, sigmas) = match nominal.filter(|_| check.is_default) {
        Some(nominal) => (nominal, DEFAULT_SIGMAS),
        None => (value.clamp(low, high), INTERVAL_SIGMAS),
    };
    let is_inside = (low..=high).contains(&value);
    check.state = if is_inside && 2.0 * INTERVAL_SIGMAS * std <= high - low {
        CheckState::Pass
    } else if !is_inside && (value - reference).abs() > sigmas * std {
        CheckState::Fail
    } else {
        CheckState::NotEvaluated
    };
    let of_model = match nominal.filter(|_| check.is_default) {
        Some(nominal) => format!(", the model has {} {unit}", number(nominal)),
        None => String::new(),
    };
    let range = format!("{} to {} {unit}", number(low), number(high));
    check.says = match check.state {
        CheckState::NotEvaluated => format!("{is}{of_model}: too uncertain for the interval {range}"),
        _ => format!("{is}{of_model}; the interval is {range}"),
    };
}

/// For each base parameter, the largest rms change of the force of a drive, relative to its rms force along the same
/// recording, when the parameter changes by one unit.
///
/// Fails when a pose has no solution.
fn force_shares(model: &Model, recordings: &[&PreparedRecording]) -> Outcome<Vec<f64>> {
    let mut shares = vec![0.0_f64; model.base.len()];
    let [data, _] = recording::segments(model, recordings, &[]);
    let square = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
    for one in &data {
        let Ok(measured) = one.run.measured_forces() else {
            continue;
        };
        let measured: Vec<f64> = measured.iter().map(|force| square(force)).collect();
        let before = along::forces(model, one, &model.values)?;
        for (k, share) in shares.iter_mut().enumerate() {
            let mut values = model.values.clone();
            values[k] += 1.0;
            let after = along::forces(model, one, &values)?;
            for (d, (after, before)) in after.iter().zip(&before).enumerate() {
                let change: f64 = after.iter().zip(before).map(|(a, b)| (a - b).powi(2)).sum();
                let relative = (change / measured[d]).sqrt();
                if relative.is_finite() {
                    *share = share.max(relative);
                }
            }
        }
    }
    Ok(shares)
}
