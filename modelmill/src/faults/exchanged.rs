//! Exchanged columns: of two forces, of two coordinates, or of two coordinates with the forces of their drives.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, OptionSetting};
use modelmill_identify::ColumnScaling;

use super::bench::FaultBench;
use super::correction::{ColumnOperation, ForceChange, MotionChange};
use super::{FaultHypothesis, FaultSubject, RecordingFaultEntry, RecordingFaultKind, drive_of_coordinate};

/// The entry for forces.
pub(super) struct ExchangedForces;
/// The entry for coordinates, alone and with the forces of their drives.
pub(super) struct ExchangedCoordinates;

/// The options that read two names from each other's columns.
fn exchange_maps(subject: &FaultSubject<'_>, one: &str, other: &str) -> Vec<OptionSetting> {
    let columns = ["", "_d", "_dd"].map(|suffix| [format!("{one}{suffix}"), format!("{other}{suffix}")]);
    // Columns that the recording lacks need no option.
    let present = columns
        .into_iter()
        .filter(|pair| pair.iter().all(|name| subject.raw.has_column(name)));
    let maps = present.flat_map(|[a, b]| [format!("{a}={b}"), format!("{b}={a}")]);
    maps.map(|map| OptionSetting::new(OptionName::Columns, map)).collect()
}

/// The scalings that turn the force of one drive into that of another, and back.
fn force_conversions(subject: &FaultSubject<'_>, one: &str, other: &str) -> [ColumnScaling; 2] {
    [subject.raw.conversion(one, other), subject.raw.conversion(other, one)]
}

/// The change of two exchanged forces by the places of their drives.
fn exchanged_forces(places: [usize; 2], [to_other, to_one]: [ColumnScaling; 2]) -> ForceChange {
    let [one, other] = places;
    ForceChange(vec![(one, other, to_one.factor), (other, one, to_other.factor)])
}

impl RecordingFaultEntry for ExchangedForces {
    fn hypotheses(&self, subject: &FaultSubject<'_>, bench: &FaultBench<'_>) -> Vec<FaultHypothesis> {
        let drives = subject.model.row_names();
        let n = bench.forces().len();
        // Forces of different units, N and N m, have columns that differ too much to be confused.
        let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
        pairs
            .filter(|(a, b)| subject.model.force_unit(*a) == subject.model.force_unit(*b))
            .map(|(a, b)| (a, b, force_conversions(subject, &drives[a], &drives[b])))
            .map(|(a, b, conversions)| FaultHypothesis {
                kind: RecordingFaultKind::ExchangedColumns,
                at: vec![drives[a].clone(), drives[b].clone()],
                clause: format!("the forces of `{}` and `{}` are exchanged", drives[a], drives[b]),
                advice: message!(
                    "check which column is which, and exchange them ({})",
                    subject.column_remedy(exchange_maps(subject, &drives[a], &drives[b]))
                ),
                motion: MotionChange::None,
                forces: exchanged_forces([a, b], conversions),
                operations: vec![ColumnOperation::exchange_forces(&drives[a], &drives[b], conversions)],
                is_implausible_now: false,
            })
            .collect()
    }
}

impl RecordingFaultEntry for ExchangedCoordinates {
    fn hypotheses(&self, subject: &FaultSubject<'_>, _: &FaultBench<'_>) -> Vec<FaultHypothesis> {
        let names = subject.model.active_coordinate_types();
        let joints = subject.model.joint_coordinates();
        let mechanism = &subject.model.derivation.mechanism;
        let mut hypotheses = Vec::new();
        for (k, a) in joints.iter().enumerate() {
            for b in &joints[k + 1..] {
                let [(one, is_angle), (other, is_other_angle)] = [&names[*a], &names[*b]];
                // Only coordinates of one kind can be exchanged.
                if is_angle != is_other_angle {
                    continue;
                }
                let maps = exchange_maps(subject, one, other);
                let difference = subject.raw.column_offset(other) - subject.raw.column_offset(one);
                hypotheses.push(FaultHypothesis {
                    kind: RecordingFaultKind::ExchangedColumns,
                    at: vec![one.clone(), other.clone()],
                    clause: format!("the coordinates `{one}` and `{other}` are exchanged"),
                    advice: message!(
                        "check which column is which, and exchange them ({})",
                        subject.column_remedy(maps.clone())
                    ),
                    motion: MotionChange::Exchange(*a, *b, difference),
                    forces: ForceChange::default(),
                    operations: vec![ColumnOperation::exchange_coordinates(one, other, difference)],
                    is_implausible_now: false,
                });
                // The order of two joints may be exchanged as a whole.
                if let (Some(c), Some(d)) = (
                    drive_of_coordinate(mechanism, one),
                    drive_of_coordinate(mechanism, other),
                ) {
                    // Drives have names of their own, which need not be those of the coordinates.
                    let [force, other_force] = [c, d].map(|k| mechanism.drives[k].name.clone());
                    let conversions = force_conversions(subject, &force, &other_force);
                    let mut all = maps;
                    all.extend(exchange_maps(subject, &force, &other_force));
                    hypotheses.push(FaultHypothesis {
                        kind: RecordingFaultKind::ExchangedColumns,
                        at: vec![one.clone(), other.clone(), force.clone(), other_force.clone()],
                        clause: format!(
                            "the coordinates `{one}` and `{other}` are exchanged, and so are the forces of `{force}` and \
                             `{other_force}`"
                        ),
                        advice: message!("check which column is which, and exchange them ({})", subject.column_remedy(all)),
                        motion: MotionChange::Exchange(*a, *b, difference),
                        forces: exchanged_forces([c, d], conversions),
                        operations: vec![
                            ColumnOperation::exchange_coordinates(one, other, difference),
                            ColumnOperation::exchange_forces(&force, &other_force, conversions),
                        ],
                        is_implausible_now: false,
                    });
                }
            }
        }
        hypotheses
    }
}
