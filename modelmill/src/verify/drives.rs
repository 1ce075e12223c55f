//! Checks of the errors of drives: one recording goes in, one check for each drive and limit comes out.

use crate::along;
use crate::compare;
use crate::diagnose::DiagnosisFindings;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::{self, PreparedRecording};
use crate::text::table::significant;

use super::causes::drive_error_cause;
use super::checks::{CheckScope, CheckState, VerificationCheck};
use super::limits::VerificationLimits;
use super::thresholds::DEFAULT_ERROR_PERCENT;

/// Rms error of a drive, N or N m, and relative to the rms force.
struct DriveError {
    rms: f64,
    share: Option<f64>,
    /// The frequency below which the error is computed, Hz.
    band_hz: Option<f64>,
}

/// The errors of all drives along a recording, for the nominal values of the model; `None` for a drive without
/// samples.
///
/// Fails when the recording has no forces, or contains a pose that the mechanism cannot reach.
fn errors(model: &Model, recording: &PreparedRecording) -> Outcome<Vec<Option<DriveError>>> {
    let [data, _] = recording::segments(model, &[recording], &[]);
    let forces = data
        .iter()
        .map(|one| along::forces(model, one, &model.values))
        .collect::<Outcome<Vec<_>>>()?;
    let figures = compare::figures(model, &data, &forces, compare::band(&data))?;
    let of_drive = |drive: String| {
        let all = figures.channels.get(&drive)?;
        if all.not_counted >= figures.samples {
            return None;
        }
        // Above the band of the recorded motion nothing can be compared.
        let band = figures.band.as_ref();
        let filtered = band.and_then(|band| Some((band.cutoff_hz, band.channels.get(&drive)?)));
        Some(match filtered {
            Some((hz, one)) => DriveError {
                rms: one.rms,
                share: one.nrms,
                band_hz: Some(hz),
            },
            None => DriveError {
                rms: all.rms,
                share: all.nrms,
                band_hz: None,
            },
        })
    };
    Ok(model.row_names().into_iter().map(of_drive).collect())
}

/// The checks of all drives along a recording. The diagnosis, if there is one, gives the noise of each drive and the
/// causes of failures.
///
/// Fails when the job is cancelled.
pub(super) fn check_drives(
    model: &Model,
    recording: &PreparedRecording,
    limits: &VerificationLimits,
    findings: Option<&DiagnosisFindings>,
) -> Outcome<Vec<VerificationCheck>> {
    let drives = model.row_names();
    let found = match errors(model, recording) {
        Err(Error::Cancelled) => return Err(Error::Cancelled),
        found => found,
    };
    let mut checks = Vec::new();
    for (d, drive) in drives.iter().enumerate() {
        let (error, reason) = match &found {
            Ok(all) => (all[d].as_ref(), "no sample of its force was measured".to_owned()),
            Err(error) => (None, error.to_string()),
        };
        for (quantity, limit, is_default) in limits_of(drive, limits, noise(findings, drive)) {
            let unit = if quantity == "error" { model.force_unit(d) } else { "%" };
            let mut check = VerificationCheck {
                scope: CheckScope::Drive,
                recording: Some(recording.file().to_owned()),
                at: drive.clone(),
                quantity,
                state: CheckState::NotEvaluated,
                value: None,
                std: None,
                limit: [None, Some(limit)],
                unit: unit.to_owned(),
                is_default,
                says: format!("the error of {drive} could not be evaluated: {reason}"),
                cause: None,
            };
            if let Some(error) = error {
                evaluate(&mut check, error, limit);
            }
            if check.state == CheckState::Fail {
                check.cause = findings.map(|all| drive_error_cause(all, recording.file(), drive));
            }
            checks.push(check);
        }
    }
    Ok(checks)
}

/// The limits of a drive as quantity, limit, and whether it is a default.
fn limits_of(drive: &str, limits: &VerificationLimits, noise: f64) -> Vec<(&'static str, f64, bool)> {
    let own = limits.drive(drive);
    if own.is_empty() {
        // Noise of the sensors is no error of the model.
        return vec![("error_percent", DEFAULT_ERROR_PERCENT.hypot(100.0 * noise), true)];
    }
    let percent = own.percent.map(|limit| ("error_percent", limit, false));
    let rms = own.rms.map(|limit| ("error", limit, false));
    percent.into_iter().chain(rms).collect()
}

/// Noise of a drive relative to its rms force; zero if it is not known.
fn noise(findings: Option<&DiagnosisFindings>, drive: &str) -> f64 {
    let budget = findings.and_then(|all| {
        let d = all.channels().iter().position(|channel| channel == drive)?;
        all.diagnosis.budgets.get(d)
    });
    let relative = budget.filter(|one| one.force > 0.0).map(|one| one.noise / one.force);
    relative.filter(|noise| noise.is_finite()).unwrap_or(0.0)
}

/// Compares an error with its limit.
fn evaluate(check: &mut VerificationCheck, error: &DriveError, limit: f64) {
    let value = match check.quantity {
        "error" => Some(error.rms),
        _ => error.share.map(|share| 100.0 * share),
    };
    let value = value.filter(|value| value.is_finite());
    let drive = &check.at;
    let Some(value) = value else {
        check.says = format!(
            "the error of {drive} has no relative value, since its measured force is zero; give a limit `error` in N or N m"
        );
        return;
    };
    let band = error
        .band_hz
        .map_or_else(String::new, |hz| format!(" below {} Hz", significant(hz, 3)));
    let of = if check.unit == "%" { " of its rms force" } else { "" };
    check.state = if value <= limit {
        CheckState::Pass
    } else {
        CheckState::Fail
    };
    check.value = Some(value);
    check.says = format!(
        "the rms error of {drive}{band} is {} {}{of}, the limit is {} {}",
        significant(value, 3),
        check.unit,
        significant(limit, 3),
        check.unit
    );
}
