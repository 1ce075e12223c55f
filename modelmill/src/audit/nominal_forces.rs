//! Checks the sign and the size of measured forces with nominal values. Forces along a recording go in, drives with
//! forces of the opposite sign or in another unit come out, with the option that corrects them. A fit alone cannot
//! show this, since its parameters may have any sign and size.

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, OptionSetting, Remedy};
use modelmill_identify::RecordingNote;
use modelmill_spec::{Mechanism, ModelDrive};

use super::thresholds::{GEAR_RATIOS, NOMINAL_FORCE_FACTOR, NOMINAL_LEAST_CORRELATION};
use super::{AuditFinding, UNITS, WRONG_SIGN};

/// A mistake in a column of forces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ForceMisreading {
    /// It has the opposite sign.
    Turned,
    /// It is in thousands of the unit.
    TooSmall,
    /// It is in thousandths of the unit.
    TooLarge,
}

/// A suspicion about the force of a drive.
#[derive(Debug, Clone, Copy, PartialEq)]
enum ForceOddity {
    /// Sign or unit is wrong.
    Misread(ForceMisreading),
    /// It is smaller by this factor, as a motor torque before its gear or a motor current is.
    BeforeGear(f64),
}

/// The correlation of two forces, -1 to 1, and the ratio of their norms.
fn correlation_and_ratio(one: &[f64], other: &[f64]) -> (f64, f64) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let sizes = [one, other].map(|force| dot(force, force).sqrt());
    (dot(one, other) / (sizes[0] * sizes[1]), sizes[0] / sizes[1])
}

/// The suspicion about a measured force, from its correlation with the nominal one; `None` if they agree or are
/// unrelated.
fn oddity(measured: &[f64], nominal: &[f64]) -> Option<ForceOddity> {
    let (correlation, ratio) = correlation_and_ratio(measured, nominal);
    if !correlation.is_finite() || correlation.abs() < NOMINAL_LEAST_CORRELATION {
        return None;
    }
    // Units are tested first: their ratios are far from those of gears and wrong nominal values.
    let about = |factor: f64| (factor / NOMINAL_FORCE_FACTOR..factor * NOMINAL_FORCE_FACTOR).contains(&ratio);
    if about(1e-3) {
        Some(ForceOddity::Misread(ForceMisreading::TooSmall))
    } else if about(1e3) {
        Some(ForceOddity::Misread(ForceMisreading::TooLarge))
    } else if GEAR_RATIOS.contains(&ratio.recip()) {
        Some(ForceOddity::BeforeGear(correlation.signum() / ratio))
    } else if correlation < 0.0 && about(1.0) {
        Some(ForceOddity::Misread(ForceMisreading::Turned))
    } else {
        None
    }
}

/// Findings about drives whose measured forces contradict the nominal values in sign or unit. Forces are
/// `[drive][sample]`; `upside_down` are those at the nominal values with reversed gravity.
pub(crate) fn oddities(
    mechanism: &Mechanism,
    measured: &[Vec<f64>],
    nominal: &[Vec<f64>],
    upside_down: Option<&[Vec<f64>]>,
    file: &str,
) -> Vec<AuditFinding> {
    let found: Vec<(&ModelDrive, ForceOddity)> = (mechanism.drives.iter().zip(measured).zip(nominal))
        .filter_map(|((drive, measured), nominal)| Some((drive, oddity(measured, nominal)?)))
        .collect();
    // Drives with the same mistake are reported together.
    let mut told: Vec<AuditFinding> = [
        ForceMisreading::Turned,
        ForceMisreading::TooSmall,
        ForceMisreading::TooLarge,
    ]
    .into_iter()
    .filter_map(|which| {
        let drives: Vec<&ModelDrive> = found
            .iter()
            .filter(|(_, oddity)| *oddity == ForceOddity::Misread(which))
            .map(|(drive, _)| *drive)
            .collect();
        let may_hang =
            which == ForceMisreading::Turned && upside_down.is_some_and(|forces| is_sign_explained(forces, measured));
        (!drives.is_empty()).then(|| misreading_finding(mechanism, &drives, which, may_hang, file))
    })
    .collect();
    // Gear ratios cannot be corrected by a unit, and are reported separately.
    let before_gears = found.iter().filter_map(|(drive, oddity)| match oddity {
        ForceOddity::BeforeGear(factor) => Some((*drive, *factor)),
        ForceOddity::Misread(_) => None,
    });
    let before_gears: Vec<(&ModelDrive, f64)> = before_gears.collect();
    if !before_gears.is_empty() {
        let note = RecordingNote::warning(column_query_text(&before_gears, file));
        told.push(AuditFinding { note, fault: None });
    }
    told
}

/// Whether forces have the sign of the measured ones at all drives with a clear correlation.
fn is_sign_explained(forces: &[Vec<f64>], measured: &[Vec<f64>]) -> bool {
    let pairs = measured.iter().zip(forces);
    let alike = pairs.map(|(measured, forces)| correlation_and_ratio(measured, forces).0);
    let clear: Vec<f64> = alike.filter(|alike| alike.abs() > NOMINAL_LEAST_CORRELATION).collect();
    !clear.is_empty() && clear.iter().all(|alike| *alike > 0.0)
}

/// The note on drives whose forces are smaller than the nominal ones by a factor typical of a gear.
fn column_query_text(drives: &[(&ModelDrive, f64)], file: &str) -> String {
    let each: Vec<String> = drives
        .iter()
        .map(|(drive, factor)| format!("`{}` ({:.0} times)", drive.name, factor.abs()))
        .collect();
    let entries: Vec<String> = drives
        .iter()
        .map(|(drive, factor)| format!("`{} = {{ ratio = {factor:.0} }}`", drive.name))
        .collect();
    format!(
        "Compared with the nominal values, forces in {file} are smaller by a factor typical of a gear: {}. If a column is \
         the motor's torque before its gear, declare it under `[recording.torque]` of the model file with the true ratio, as \
         in {}. If it is a current, also give its `constant` in N m per ampere (or N per ampere). Otherwise all base \
         parameters are estimated too small by this factor.",
        each.join(", "),
        entries.join(", "),
    )
}

/// The finding about forces with a mistake; `may_hang` states that reversed gravity may be the cause.
fn misreading_finding(
    mechanism: &Mechanism,
    drives: &[&ModelDrive],
    which: ForceMisreading,
    may_hang: bool,
    file: &str,
) -> AuditFinding {
    let names: Vec<String> = drives.iter().map(|d| format!("`{}`", d.name)).collect();
    let (forces, are, they_are) = match drives {
        [_] => ("force", "is", "it is"),
        _ => ("forces", "are", "they are"),
    };
    // The options that correct the columns.
    let maps = drives.iter().map(|drive| {
        let name = &drive.name;
        let column = match which {
            ForceMisreading::Turned => format!("{name}=-{name}"),
            ForceMisreading::TooSmall => {
                let unit = drive.kind.force_unit(&mechanism.coordinates);
                format!("{name}={name} [k{unit}]")
            }
            ForceMisreading::TooLarge => format!("{name}={name}/1000"),
        };
        OptionSetting::new(OptionName::Columns, column)
    });
    let (kind, what, if_so) = match which {
        ForceMisreading::Turned => (WRONG_SIGN, "of the opposite sign", "measured in the opposite direction"),
        ForceMisreading::TooSmall => (UNITS, "about 1000 times as small", "in kN or kN m"),
        ForceMisreading::TooLarge => (UNITS, "about 1000 times as large", "in mN or mN m"),
    };
    let names = names.join(", ");
    let (or, besides) = if may_hang {
        let besides = message!(
            " Reversed gravity would also change their sign: first check {}, and how the machine is mounted.",
            Remedy::edit("gravity")
        );
        (", or gravity is reversed", besides)
    } else {
        ("", Message::new())
    };
    let says = format!("the {forces} of {names} {are} {what} compared with the nominal values{or}");
    let note = message!(
        "Compared with the nominal values, the {forces} of {names} in {file} {are} {what}; if {they_are} {if_so}, use {}.{}",
        Remedy::options(maps),
        besides
    );
    let at = drives.iter().map(|drive| drive.name.clone()).collect();
    AuditFinding::suspicion(kind, at, says, file, note)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gravity_may_turn_forces_if_that_is_so_of_all() {
        let force = |phase: f64| (0..200).map(|k| (0.1 * f64::from(k) + phase).sin()).collect();
        let [one, other, opposite]: [Vec<f64>; 3] = [0.0, 1.5, std::f64::consts::PI].map(force);
        let measured = [one.clone(), other.clone()];
        assert!(is_sign_explained(&measured, &measured));
        // What resembles nothing says nothing.
        assert!(is_sign_explained(&[one.clone(), one.clone()], &measured));
        assert!(!is_sign_explained(&[other.clone(), one.clone()], &measured));
        assert!(!is_sign_explained(&[opposite, other], &measured));
    }

    #[test]
    fn signs_and_units_are_told_where_forces_are_alike() {
        let nominal: Vec<f64> = (0..200).map(|k| (0.1 * f64::from(k)).sin() + 0.3).collect();
        let of = |scale: f64, other: f64| -> Option<ForceOddity> {
            let cosine = (0..200).map(|k| (0.07 * f64::from(k)).cos());
            let measured: Vec<f64> = nominal
                .iter()
                .zip(cosine)
                .map(|(f, c)| scale * (f + other * c))
                .collect();
            oddity(&measured, &nominal)
        };
        assert_eq!(of(1.3, 0.1), None);
        assert_eq!(of(-0.8, 0.1), Some(ForceOddity::Misread(ForceMisreading::Turned)));
        assert_eq!(of(1.4e-3, 0.1), Some(ForceOddity::Misread(ForceMisreading::TooSmall)));
        assert_eq!(of(-7e2, 0.1), Some(ForceOddity::Misread(ForceMisreading::TooLarge)));
        let Some(ForceOddity::BeforeGear(ratio)) = of(-1.0 / 101.0, 0.1) else {
            panic!("a gear");
        };
        assert!((ratio / -101.0 - 1.0).abs() < 0.05, "{ratio}");
        assert_eq!(of(0.12, 0.1), None);
        // Ten times may be a gear, and forces that hardly resemble the nominal ones tell nothing.
        assert_eq!(of(10.0, 0.1), None);
        assert_eq!(of(-1.0, 3.0), None);
        assert_eq!(oddity(&[0.0; 3], &[1.0; 3]), None);
    }
}
