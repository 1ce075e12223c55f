//! Faults of sensors that the preparation finds, as disturbances for a diagnosis: rates that lag, wrapped angles, and
//! positions with jitter or backlash.

use modelmill_identify::diagnose::{Disturbance, EstimatedQuantity};
use modelmill_identify::{PositionFault, SignalRecording as Raw, UnwrappedAngle};

use crate::faults::RecordingFaultKind;
use crate::model::Model;
use crate::text::table::significant;

/// Rates that lag the positions as a disturbance for the diagnosis; `None` without any.
pub(super) fn late_rates_fault(recording: &Raw) -> Option<Disturbance> {
    let late = recording.late_rates();
    let (_, longest) = late.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let names: Vec<&str> = late.iter().map(|(name, _)| name.as_str()).collect();
    Some(Disturbance {
        kind: "late_rates".to_owned(),
        at: late.iter().map(|(name, _)| name.clone()).collect(),
        estimates: vec![EstimatedQuantity::new("delay", *longest, "s")],
        recordings: vec![recording.file().to_owned()],
        interval: None,
        description: Some(format!(
            "the recorded rates of `{}` in {} lag the positions by up to {} ms, as after a low-pass, and are not used",
            names.join("`, `"),
            recording.file(),
            significant(1e3 * longest, 2)
        )),
    })
}

/// A fault of the positions as a disturbance for the diagnosis.
pub(super) fn position_fault(model: &Model, file: &str, fault: &PositionFault) -> Disturbance {
    // Both faults have one number with a unit.
    let mut standard_deviation = None;
    let (kind, at, name, value, unit, says) = match fault {
        PositionFault::Jitter { time } => (
            "time_jitter",
            "t",
            "jitter",
            *time,
            "s",
            format!(
                "the time stamps of {file} jitter: the position error is proportional to the rate, with the same time error for all coordinates, \
                 {} ms rms",
                significant(1e3 * time, 2)
            ),
        ),
        PositionFault::Backlash {
            coordinate,
            width,
            deviation,
        } => {
            standard_deviation = Some(*deviation);
            let is_angle = |(name, is): &(String, bool)| name == coordinate && *is;
            let unit = if model.active_coordinate_types().iter().any(is_angle) {
                "rad"
            } else {
                "m"
            };
            (
                "backlash",
                coordinate.as_str(),
                "width",
                *width,
                unit,
                format!(
                    "backlash between the encoder of {coordinate} and its load: in {file} the reading jumps back and forth by {} {unit}",
                    significant(*width, 2)
                ),
            )
        }
    };
    Disturbance {
        kind: kind.to_owned(),
        at: vec![at.to_owned()],
        estimates: vec![EstimatedQuantity {
            standard_deviation,
            ..EstimatedQuantity::new(name, value, unit)
        }],
        recordings: vec![file.to_owned()],
        interval: None,
        description: Some(says),
    }
}

/// An angle to which full turns were added, as a disturbance for the diagnosis.
pub(super) fn wrapped_angle(file: &str, angle: &UnwrappedAngle) -> Disturbance {
    Disturbance {
        kind: RecordingFaultKind::Wrapped.name().to_owned(),
        at: vec![angle.coordinate.clone()],
        estimates: vec![EstimatedQuantity::new("jumps", angle.jumps as f64, "")],
        recordings: vec![file.to_owned()],
        interval: None,
        description: Some(format!(
            "the angle {} in {file} is wrapped: full turns were added at its {}",
            angle.coordinate,
            count_of_jumps(angle.jumps)
        )),
    }
}

/// A number of jumps in words.
fn count_of_jumps(jumps: usize) -> String {
    if jumps == 1 {
        "jump".to_owned()
    } else {
        format!("{jumps} jumps")
    }
}
