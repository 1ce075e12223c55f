//! Angles in degrees: all of them, those that are too large for rad, or a single one.

use modelmill_boundary::message;
use modelmill_boundary::text::OptionSetting;

use super::bench::FaultBench;
use super::correction::{ColumnOperation, ForceChange, MotionChange};
use super::thresholds::{LARGEST_USUAL_ANGLE_RAD, LEAST_ANGLE_IN_DEGREES};
use super::{FaultHypothesis, FaultSubject, RecordingFaultEntry, RecordingFaultKind, name_list};

/// The entry of the list.
pub(super) struct AngleUnit;

impl RecordingFaultEntry for AngleUnit {
    fn hypotheses(&self, subject: &FaultSubject<'_>, bench: &FaultBench<'_>) -> Vec<FaultHypothesis> {
        let coordinates = subject.model.active_coordinate_types();
        // Numbers as small as one degree are not examined: a joint moves further.
        let is_possible = |i: &usize| coordinates[*i].1 && bench.largest_position(*i) > LEAST_ANGLE_IN_DEGREES;
        let single: Vec<usize> = (0..coordinates.len()).filter(is_possible).collect();
        let is_large = |i: &usize| bench.largest_position(*i) > LARGEST_USUAL_ANGLE_RAD;
        let large: Vec<usize> = single.iter().copied().filter(is_large).collect();
        let all: Vec<usize> = (0..coordinates.len()).filter(|i| coordinates[*i].1).collect();
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for group in [all, large].into_iter().chain(single.iter().map(|i| vec![*i])) {
            if !single.is_empty() && !group.is_empty() && !groups.contains(&group) {
                groups.push(group);
            }
        }
        groups.into_iter().map(|group| hypothesis(subject, &group)).collect()
    }
}

/// The hypothesis that some coordinates are in degrees.
fn hypothesis(subject: &FaultSubject<'_>, group: &[usize]) -> FaultHypothesis {
    let names = subject.model.active_coordinates();
    let at: Vec<String> = group.iter().map(|i| names[*i].clone()).collect();
    let degree = 1.0_f64.to_radians();
    // Derivatives in degrees are named with their angle; those in rad stay as they are.
    let columns: Vec<Vec<String>> = at.iter().map(|name| subject.raw.degree_columns(name)).collect();
    let scaled = group.iter().zip(&at).zip(&columns).map(|((i, name), columns)| {
        let factor = |order: usize, suffix: &str| {
            let is_in_degrees = columns.contains(&format!("{name}{suffix}"));
            !subject.is_recorded(name, order) || is_in_degrees
        };
        // An acceleration from recorded rates has their unit.
        let rate = if factor(1, "_d") { degree } else { 1.0 };
        let acceleration = match (subject.is_recorded(name, 2), factor(2, "_dd")) {
            (true, true) => degree,
            (true, false) => 1.0,
            (false, _) => rate,
        };
        (*i, [degree, rate, acceleration])
    });
    let maps: Vec<OptionSetting> = at
        .iter()
        .flat_map(|name| subject.raw.degree_conversion_options(name))
        .collect();
    let (is, angle) = if at.len() == 1 {
        ("is", "angle")
    } else {
        ("are", "angles")
    };
    FaultHypothesis {
        kind: RecordingFaultKind::Units,
        clause: format!("the {angle} {} {is} in degrees and not in rad", name_list(&at)),
        advice: message!("convert the angle to rad ({})", subject.column_remedy(maps)),
        motion: MotionChange::Scale(scaled.collect()),
        forces: ForceChange::default(),
        operations: vec![ColumnOperation::scale(columns.into_iter().flatten(), degree)],
        // A joint that turns on has large angles too.
        is_implausible_now: false,
        at,
    }
}
