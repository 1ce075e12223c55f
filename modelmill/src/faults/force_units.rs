//! Forces in thousands or thousandths of their unit, such as N mm for N m: of all drives or of a single one.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, OptionSetting};

use super::bench::FaultBench;
use super::correction::{ColumnOperation, ForceChange, MotionChange};
use super::{FaultHypothesis, FaultSubject, RecordingFaultEntry, RecordingFaultKind, name_list};

/// The entry of the list.
pub(super) struct ForceUnit;

impl RecordingFaultEntry for ForceUnit {
    fn hypotheses(&self, subject: &FaultSubject<'_>, bench: &FaultBench<'_>) -> Vec<FaultHypothesis> {
        let drives = bench.forces().len();
        // One logger has one unit for all forces, unless a column was converted by hand.
        let mut groups: Vec<Vec<usize>> = (0..drives).map(|d| vec![d]).collect();
        if drives > 1 {
            groups.push((0..drives).collect());
        }
        let both = |group: Vec<usize>| [1e-3, 1e3].map(|factor| hypothesis(subject, &group, factor));
        groups.into_iter().flat_map(both).collect()
    }
}

/// The hypothesis that some forces must be multiplied by a factor.
fn hypothesis(subject: &FaultSubject<'_>, group: &[usize], factor: f64) -> FaultHypothesis {
    let drives = subject.model.row_names();
    let at: Vec<String> = group.iter().map(|d| drives[*d].clone()).collect();
    let is_large = factor < 1.0;
    // The option divides, where the unit itself cannot be named.
    let maps = group.iter().map(|d| {
        let (name, unit) = (&drives[*d], subject.model.force_unit(*d));
        let column = if is_large {
            format!("{name}={name}/1000")
        } else {
            format!("{name}={name} [k{unit}]")
        };
        OptionSetting::new(OptionName::Columns, column)
    });
    let have_unit = |unit: &str| group.iter().all(|d| subject.model.force_unit(*d) == unit);
    let unit = match (is_large, have_unit("N m"), have_unit("N")) {
        (true, true, _) => "N mm and not in N m",
        (true, _, true) => "mN and not in N",
        (true, ..) => "thousandths of N and N m",
        (false, true, _) => "kN m and not in N m",
        (false, _, true) => "kN and not in N",
        (false, ..) => "thousands of N and N m",
    };
    let (forces, are) = if at.len() == 1 {
        ("force", "is")
    } else {
        ("forces", "are")
    };
    FaultHypothesis {
        kind: RecordingFaultKind::Units,
        clause: format!("the {forces} of {} {are} in {unit}", name_list(&at)),
        advice: message!("convert the force to SI units ({})", subject.column_remedy(maps)),
        motion: MotionChange::None,
        forces: ForceChange(group.iter().map(|d| (*d, *d, factor)).collect()),
        operations: at
            .iter()
            .flat_map(|name| ColumnOperation::scale_force(name, factor))
            .collect(),
        is_implausible_now: false,
        at,
    }
}
