//! Time in another unit than seconds: milliseconds or microseconds.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, OptionSetting};

use super::bench::FaultBench;
use super::correction::{ColumnOperation, ForceChange, MotionChange};
use super::thresholds::{LONGEST_PLAUSIBLE_STEP_S, LONGEST_USUAL_STEP_S, SHORTEST_PLAUSIBLE_STEP_S};
use super::{FaultHypothesis, FaultSubject, RecordingFaultEntry, RecordingFaultKind};

/// Units of time with their size in s and their name in words.
const UNITS: [(&str, f64, &str); 2] = [("ms", 1e-3, "milliseconds"), ("us", 1e-6, "microseconds")];

/// The entry of the list.
pub(super) struct TimeUnit;

impl RecordingFaultEntry for TimeUnit {
    fn hypotheses(&self, subject: &FaultSubject<'_>, _: &FaultBench<'_>) -> Vec<FaultHypothesis> {
        let Ok(time) = subject.raw.column("t") else {
            return Vec::new();
        };
        let [first, .., last] = time else { return Vec::new() };
        let step = (last - first) / (time.len() - 1) as f64;
        // A step as short as usual needs no other unit.
        if step < LONGEST_USUAL_STEP_S {
            return Vec::new();
        }
        let coordinates = subject.model.active_coordinates();
        let plausible = SHORTEST_PLAUSIBLE_STEP_S..LONGEST_USUAL_STEP_S;
        let units = UNITS
            .into_iter()
            .filter(|(_, size, _)| plausible.contains(&(size * step)));
        units
            .map(|(unit, size, words)| {
                // Recorded derivatives are per second already; only those from positions change.
                let factors = |name: &String| {
                    let rate = if subject.is_recorded(name, 1) { 1.0 } else { 1.0 / size };
                    let is_recorded = subject.is_recorded(name, 2);
                    [1.0, rate, if is_recorded { 1.0 } else { rate / size }]
                };
                let scaled = coordinates.iter().map(factors).enumerate().collect();
                FaultHypothesis {
                    kind: RecordingFaultKind::TimeBase,
                    at: vec!["t".to_owned()],
                    clause: format!("the time `t` is in {words} and not in seconds"),
                    advice: message!(
                        "read the column in its unit ({})",
                        subject.column_remedy([OptionSetting::new(OptionName::Columns, format!("t=t [{unit}]"))])
                    ),
                    motion: MotionChange::Scale(scaled),
                    forces: ForceChange::default(),
                    operations: vec![ColumnOperation::scale(["t".to_owned()], size)],
                    is_implausible_now: step > LONGEST_PLAUSIBLE_STEP_S,
                }
            })
            .collect()
    }
}
