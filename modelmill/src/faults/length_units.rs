//! Positions of prismatic joints in millimetres: all of them, or a single one.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, OptionSetting};

use super::bench::FaultBench;
use super::correction::{ColumnOperation, ForceChange, MotionChange};
use super::thresholds::LEAST_LENGTH_IN_MILLIMETRES;
use super::{FaultHypothesis, FaultSubject, RecordingFaultEntry, RecordingFaultKind, name_list};

/// The entry of the list.
pub(super) struct LengthUnit;

impl RecordingFaultEntry for LengthUnit {
    fn hypotheses(&self, subject: &FaultSubject<'_>, bench: &FaultBench<'_>) -> Vec<FaultHypothesis> {
        let coordinates = subject.model.active_coordinate_types();
        let is_long = |i: &usize| !coordinates[*i].1 && bench.largest_position(*i) > LEAST_LENGTH_IN_MILLIMETRES;
        let long: Vec<usize> = (0..coordinates.len()).filter(is_long).collect();
        // A long axis alone, or all of them together.
        let mut groups: Vec<Vec<usize>> = long.iter().map(|i| vec![*i]).collect();
        if long.len() > 1 {
            groups.push(long);
        }
        groups.into_iter().map(|group| hypothesis(subject, &group)).collect()
    }
}

/// The hypothesis that some coordinates are in millimetres, together with their derivatives.
fn hypothesis(subject: &FaultSubject<'_>, group: &[usize]) -> FaultHypothesis {
    let names = subject.model.active_coordinates();
    let at: Vec<String> = group.iter().map(|i| names[*i].clone()).collect();
    // Derivatives are in the same unit of length.
    let units = [("", "mm"), ("_d", "mm/s"), ("_dd", "mm/s^2")];
    let mut columns = Vec::new();
    let mut maps = Vec::new();
    for name in &at {
        for (suffix, unit) in units {
            let column = format!("{name}{suffix}");
            if subject.raw.has_column(&column) {
                maps.push(OptionSetting::new(
                    OptionName::Columns,
                    format!("{column}={column} [{unit}]"),
                ));
                columns.push(column);
            }
        }
    }
    let (is, position) = if at.len() == 1 {
        ("is", "position")
    } else {
        ("are", "positions")
    };
    FaultHypothesis {
        kind: RecordingFaultKind::Units,
        clause: format!("the {position} {} {is} in mm and not in m", name_list(&at)),
        advice: message!("convert the position to m ({})", subject.column_remedy(maps)),
        motion: MotionChange::Scale(group.iter().map(|i| (*i, [1e-3; 3])).collect()),
        forces: ForceChange::default(),
        operations: vec![ColumnOperation::scale(columns, 1e-3)],
        is_implausible_now: false,
        at,
    }
}
