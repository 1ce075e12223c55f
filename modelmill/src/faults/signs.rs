//! Columns with the opposite sign: of a force, of all forces, of a coordinate whose encoder counts the other way, or of
//! a coordinate together with the force of its drive.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, OptionSetting};

use super::bench::FaultBench;
use super::correction::{ColumnOperation, ForceChange, MotionChange};
use super::{FaultHypothesis, FaultSubject, RecordingFaultEntry, RecordingFaultKind, drive_of_coordinate, name_list};

/// The entry for forces.
pub(super) struct ForceSign;
/// The entry for coordinates, alone and with the forces of their drives.
pub(super) struct CoordinateSign;

/// The option that reads a column with the other sign.
fn reversed_column(name: &str) -> OptionSetting {
    OptionSetting::new(OptionName::Columns, format!("{name}=-{name}"))
}

impl RecordingFaultEntry for ForceSign {
    fn hypotheses(&self, subject: &FaultSubject<'_>, bench: &FaultBench<'_>) -> Vec<FaultHypothesis> {
        let n = bench.forces().len();
        let drives = subject.model.row_names();
        // A drive alone has another sensor or driver; all drives together have another convention.
        let mut groups: Vec<Vec<usize>> = (0..n).map(|d| vec![d]).collect();
        if n > 1 {
            groups.push((0..n).collect());
        }
        let one = |group: Vec<usize>| {
            let at: Vec<String> = group.iter().map(|d| drives[*d].clone()).collect();
            let (forces, have) = if at.len() == 1 {
                ("force", "has")
            } else {
                ("forces", "have")
            };
            FaultHypothesis {
                kind: RecordingFaultKind::WrongSign,
                clause: format!("the {forces} of {} {have} the wrong sign", name_list(&at)),
                advice: message!(
                    "check the direction in which the force counts as positive, and read the column with the other sign ({})",
                    subject.column_remedy(at.iter().map(|name| reversed_column(name)))
                ),
                motion: MotionChange::None,
                forces: ForceChange(group.iter().map(|d| (*d, *d, -1.0)).collect()),
                operations: at
                    .iter()
                    .flat_map(|name| ColumnOperation::scale_force(name, -1.0))
                    .collect(),
                is_implausible_now: false,
                at,
            }
        };
        groups.into_iter().map(one).collect()
    }
}

impl RecordingFaultEntry for CoordinateSign {
    fn hypotheses(&self, subject: &FaultSubject<'_>, _: &FaultBench<'_>) -> Vec<FaultHypothesis> {
        let mechanism = &subject.model.derivation.mechanism;
        let names = subject.model.active_coordinates();
        let mut hypotheses = Vec::new();
        for i in subject.model.joint_coordinates() {
            let name = &names[i];
            // Recorded derivatives come from the same encoder, and turn with it.
            let columns = ["", "_d", "_dd"].map(|suffix| format!("{name}{suffix}"));
            let present = || columns.iter().filter(|column| subject.raw.has_column(column));
            let alone = FaultHypothesis {
                kind: RecordingFaultKind::WrongSign,
                at: vec![name.clone()],
                clause: format!("the coordinate `{name}` has the wrong sign"),
                advice: message!(
                    "check the direction in which its encoder counts, and read the column with the other sign ({})",
                    subject.column_remedy(present().map(|column| reversed_column(column)))
                ),
                motion: MotionChange::Scale(vec![(i, [-1.0; 3])]),
                forces: ForceChange::default(),
                operations: vec![ColumnOperation::scale(present().cloned(), -1.0)],
                is_implausible_now: false,
            };
            if let Some(d) = drive_of_coordinate(mechanism, name) {
                let force = &mechanism.drives[d].name;
                let mut operations = alone.operations.clone();
                operations.extend(ColumnOperation::scale_force(force, -1.0));
                let maps = present()
                    .map(|column| reversed_column(column))
                    .chain([reversed_column(force)]);
                hypotheses.push(FaultHypothesis {
                    kind: RecordingFaultKind::WrongSign,
                    at: vec![name.clone(), force.clone()],
                    clause: format!("the coordinate `{name}` and the force of `{force}` have the wrong sign"),
                    advice: message!(
                        "check the positive direction of the joint, and read both columns with the other sign ({})",
                        subject.column_remedy(maps)
                    ),
                    motion: alone.motion.clone(),
                    forces: ForceChange(vec![(d, d, -1.0)]),
                    operations,
                    is_implausible_now: false,
                });
            }
            hypotheses.push(alone);
        }
        hypotheses
    }
}
