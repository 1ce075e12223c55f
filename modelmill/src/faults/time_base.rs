//! Time in another unit than seconds: milliseconds, microseconds or nanoseconds.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, OptionSetting};

use super::bench::FaultBench;
use super::correction::{ColumnOperation, ForceChange, MotionChange};
use super::thresholds::{LONGEST_PLAUSIBLE_STEP_S, LONGEST_USUAL_STEP_S, SHORTEST_PLAUSIBLE_STEP_S};
use super::{FaultHypothesis, FaultSubject, RecordingFaultEntry, RecordingFaultKind};

/// Units of time with their size in s and their name in words.
const UNITS: [(&str, f64, &str); 3] = [
    ("ms", 1e-3, "milliseconds"),
    ("us", 1e-6, "microseconds"),
    ("ns", 1e-9, "nanoseconds"),
];

/// The entry of the list.
pub(super) struct TimeUnit;

impl RecordingFaultEntry for TimeUnit {
    fn hypotheses(&self, subject: &FaultSubject<'_>, _: &FaultBench<'_>) -> Vec<FaultHypothesis> {
        let Ok(time) = subject.raw.column("t") else {
            return Vec::new();
        };
        let [first, .., last] = time else { return Vec::new() };
        let step = (last - first) / (time.len() - 1) as f64;
        let coordinates = subject.model.active_coordinates();
        plausible_units(step)
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
                        "convert the time to s ({})",
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

/// Units other than seconds in which a mean step of the time is plausible; none if the step is as short as usual.
fn plausible_units(step: f64) -> impl Iterator<Item = (&'static str, f64, &'static str)> {
    let plausible = SHORTEST_PLAUSIBLE_STEP_S..LONGEST_USUAL_STEP_S;
    let is_unusual = step >= LONGEST_USUAL_STEP_S;
    let units = UNITS.into_iter();
    units.filter(move |(_, size, _)| is_unusual && plausible.contains(&(size * step)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_of_a_time_in_another_unit_is_tested() {
        let names = |step: f64| -> Vec<&str> { plausible_units(step).map(|(unit, ..)| unit).collect() };
        for rate in [50.0, 125.0, 1000.0, 5000.0] {
            assert!(names(1e3 / rate).contains(&"ms"), "{rate} Hz");
            assert!(names(1e6 / rate).contains(&"us"), "{rate} Hz");
            assert!(names(1e9 / rate).contains(&"ns"), "{rate} Hz");
            assert!(names(1.0 / rate).is_empty(), "{rate} Hz");
        }
    }
}
