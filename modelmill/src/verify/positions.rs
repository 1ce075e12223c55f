//! Checks of positions: the model is simulated from recorded states, and one check for each coordinate with a limit comes
//! out.

use crate::diagnose::DiagnosisFindings;
use crate::error::{Error, Outcome};
use crate::forward::{ForwardComparison, HorizonError, SimulationInput, VERIFIED_HORIZON_S};
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::text::table::significant;

use super::causes::position_error_cause;
use super::checks::{CheckScope, CheckState, VerificationCheck};
use super::limits::VerificationLimits;

/// The checks of all coordinates with a limit along a recording; none without limits of the user.
///
/// Fails when the job is cancelled.
pub(super) fn check_positions(
    model: &Model,
    recording: &PreparedRecording,
    limits: &VerificationLimits,
    findings: Option<&DiagnosisFindings>,
) -> Outcome<Vec<VerificationCheck>> {
    let mut compared: Vec<(f64, Result<ForwardComparison, String>)> = Vec::new();
    let mut checks = Vec::new();
    for (k, (name, is_angle)) in model.active_coordinate_types().into_iter().enumerate() {
        let own = limits.position(&name);
        let Some(limit) = own.rms else {
            continue;
        };
        let horizon = own.horizon.unwrap_or(VERIFIED_HORIZON_S);
        if compared.iter().all(|(other, _)| other.total_cmp(&horizon).is_ne()) {
            let found = match model.compare_over(&[recording], &model.values, &[horizon]) {
                Err(Error::Cancelled) => return Err(Error::Cancelled),
                Err(error) => Err(error.to_string()),
                Ok(found) => Ok(found),
            };
            compared.push((horizon, found));
        }
        let mut check = VerificationCheck {
            scope: CheckScope::Position,
            recording: Some(recording.file().to_owned()),
            at: name,
            quantity: "position_error",
            state: CheckState::NotEvaluated,
            value: None,
            std: None,
            limit: [None, Some(limit)],
            unit: if is_angle { "rad" } else { "m" }.to_owned(),
            is_default: false,
            says: String::new(),
            cause: None,
        };
        match compared.iter().find(|(other, _)| other.total_cmp(&horizon).is_eq()) {
            Some((_, Ok(found))) => evaluate(&mut check, found, k, [limit, horizon]),
            Some((_, Err(reason))) => {
                check.says = format!("the motion of {} could not be simulated: {reason}", check.at);
            }
            None => {}
        }
        if check.state == CheckState::Fail {
            check.cause = findings.map(|all| position_error_cause(all, recording.file()));
        }
        checks.push(check);
    }
    Ok(checks)
}

/// Compares the position error of a coordinate over its horizon with its limit.
fn evaluate(check: &mut VerificationCheck, found: &ForwardComparison, k: usize, [limit, horizon]: [f64; 2]) {
    // The first horizon is the requested one, or the whole run if that is shorter.
    let Some(one) = found.horizons.first() else {
        return;
    };
    let over = horizon_words(one);
    let at = &check.at;
    if !one.is_judged {
        let longest = found.longest_horizon.unwrap_or(0.0);
        check.says = format!(
            "the position of {at} over {over} says nothing about the model, since a disturbance of the first state grows by a \
             factor of 100 within {} s; give a shorter `horizon`",
            significant(longest, 2)
        );
        return;
    }
    if one.is_whole_run && one.seconds < horizon {
        check.says = format!(
            "the recording of {} s is shorter than the horizon of {} s",
            significant(one.seconds, 3),
            significant(horizon, 3)
        );
        return;
    }
    if one.ended_early > 0 {
        check.state = CheckState::Fail;
        check.says = format!(
            "{} of {} simulations of {at} over {over} left the reach of the mechanism",
            one.ended_early, one.windows
        );
        return;
    }
    let Some(value) = one.rms.as_ref().map(|all| all[k]).filter(|value| value.is_finite()) else {
        check.says = format!("no simulation of {at} over {over} has a sample to compare");
        return;
    };
    check.state = if value <= limit {
        CheckState::Pass
    } else {
        CheckState::Fail
    };
    check.value = Some(value);
    let input = match found.input {
        SimulationInput::Forces => "recorded forces",
        SimulationInput::Commands => "recorded commands",
        SimulationInput::Signals => "recorded signals",
    };
    check.says = format!(
        "simulated under the {input} over {over}, the rms position error of {at} is {} {}, the limit is {} {}",
        significant(value, 3),
        check.unit,
        significant(limit, 3),
        check.unit
    );
}

/// A horizon in words.
fn horizon_words(one: &HorizonError) -> String {
    let seconds = significant(one.seconds, 3);
    if one.is_whole_run {
        format!("the whole run of {seconds} s")
    } else {
        format!("{seconds} s")
    }
}
