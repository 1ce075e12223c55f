//! Faults of recordings that their preparation finds, as disturbances for a diagnosis: rates that lag, positions with
//! jitter or backlash, and force readings with a dead band.

use modelmill_identify::diagnose::{Disturbance, EstimatedQuantity};
use modelmill_identify::{PositionFault, PreparedRun, RecordingNote, SignalRecording as Raw};

use crate::model::Model;
use crate::text::table::{percent, significant};

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
        PositionFault::Backlash { coordinate, width } => {
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
        estimates: vec![EstimatedQuantity::new(name, value, unit)],
        recordings: vec![file.to_owned()],
        interval: None,
        description: Some(says),
    }
}

/// Dead bands of the force readings of a run as one disturbance, with the note on it; `None` without any.
pub(super) fn dead_band_fault(model: &Model, run: &PreparedRun) -> Option<(Disturbance, RecordingNote)> {
    let found = run.dead_bands();
    let (drives, undriven) = (model.drives(), model.undriven_rows());
    let found: Vec<_> = (found.into_iter())
        .filter(|one| !undriven.contains(&drives[one.drive]))
        .collect();
    if found.is_empty() {
        return None;
    }
    let each: Vec<String> = (found.iter())
        .map(|one| {
            let least = significant(one.least, 2);
            let unit = model.force_unit(one.drive);
            format!(
                "`{}` in {} of the samples (other readings from {least} {unit})",
                drives[one.drive],
                percent(Some(one.share))
            )
        })
        .collect();
    let says = format!("force readings of {} are exactly zero: {}", run.file, each.join(", "));
    let note = RecordingNote::warning(format!(
        "{says}. They have a dead band or a coarse resolution, so that small forces are not known: effects at these drives \
         are uncertain. Record the current with a finer resolution."
    ));
    let fault = Disturbance {
        kind: "dead_band".to_owned(),
        at: found.iter().map(|one| drives[one.drive].clone()).collect(),
        estimates: (found.iter())
            .map(|one| EstimatedQuantity::new("least", one.least, model.force_unit(one.drive)))
            .collect(),
        recordings: vec![run.file.clone()],
        interval: None,
        description: Some(says),
    };
    Some((fault, note))
}
