//! What nominal values say of the sign and the size of measured forces: forces along a recording go in, drives whose
//! forces point the other way or are in another unit come out, with the option that mends it. A fit alone does not show
//! either, since parameters may take any sign and size.

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, OptionSetting, Remedy};
use modelmill_identify::RecordingNote;
use modelmill_spec::{Mechanism, ModelDrive};

use super::{AuditFinding, UNITS, WRONG_SIGN};

/// Below this correlation with the nominal forces nothing is said: friction and wrong nominal values may be behind it.
const CLEAR: f64 = 0.8;
/// Factors between units of force are powers of 1000; nominal values may be off by this factor.
const TOLERANCE: f64 = 4.0;

/// Forces that are so many times as small may be those of motors before their gears; nearer, nominal values may be wrong.
const GEARS: std::ops::Range<f64> = 12.0..1000.0 / TOLERANCE;

/// How a column of forces may have been misread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ForceMisreading {
    /// It points the other way.
    Turned,
    /// Measured in thousands of the unit.
    TooSmall,
    /// Measured in thousandths of the unit.
    TooLarge,
}

/// What is odd about the force of a drive.
#[derive(Debug, Clone, Copy, PartialEq)]
enum ForceOddity {
    /// Sign or unit is another one.
    Misread(ForceMisreading),
    /// As small as that of a motor before its gear, or as its current, by this factor.
    BeforeGear(f64),
}

/// How much two forces resemble each other, -1 to 1, and by how much the first is larger.
fn correlation_and_ratio(one: &[f64], other: &[f64]) -> (f64, f64) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let sizes = [one, other].map(|force| dot(force, force).sqrt());
    (dot(one, other) / (sizes[0] * sizes[1]), sizes[0] / sizes[1])
}

/// How a measured force is related to the nominal one.
fn oddity(measured: &[f64], nominal: &[f64]) -> Option<ForceOddity> {
    let (correlation, ratio) = correlation_and_ratio(measured, nominal);
    if !correlation.is_finite() || correlation.abs() < CLEAR {
        return None;
    }
    let about = |factor: f64| (factor / TOLERANCE..factor * TOLERANCE).contains(&ratio);
    if about(1e-3) {
        Some(ForceOddity::Misread(ForceMisreading::TooSmall))
    } else if about(1e3) {
        Some(ForceOddity::Misread(ForceMisreading::TooLarge))
    } else if GEARS.contains(&ratio.recip()) {
        Some(ForceOddity::BeforeGear(correlation.signum() / ratio))
    } else if correlation < 0.0 && about(1.0) {
        Some(ForceOddity::Misread(ForceMisreading::Turned))
    } else {
        None
    }
}

/// What is told of drives whose measured forces are not those of the nominal values by their sign or unit; forces are
/// `[drive][sample]`, `upside_down` those of the nominal values if gravity pulled the other way.
pub(crate) fn oddities(
    mechanism: &Mechanism,
    measured: &[Vec<f64>],
    nominal: &[Vec<f64>],
    upside_down: Option<&[Vec<f64>]>,
    file: &str,
) -> Vec<AuditFinding> {
    let found: Vec<(&ModelDrive, ForceOddity)> =
        (mechanism.drives.iter().zip(measured).zip(nominal))
            .filter_map(|((drive, measured), nominal)| Some((drive, oddity(measured, nominal)?)))
            .collect();
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
        let may_hang = which == ForceMisreading::Turned
            && upside_down.is_some_and(|forces| is_sign_explained(forces, measured));
        (!drives.is_empty()).then(|| misreading_finding(mechanism, &drives, which, may_hang, file))
    })
    .collect();
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

/// Whether forces resemble those of all drives that resemble them at all, by their sign.
fn is_sign_explained(forces: &[Vec<f64>], measured: &[Vec<f64>]) -> bool {
    let pairs = measured.iter().zip(forces);
    let alike = pairs.map(|(measured, forces)| correlation_and_ratio(measured, forces).0);
    let clear: Vec<f64> = alike.filter(|alike| alike.abs() > CLEAR).collect();
    !clear.is_empty() && clear.iter().all(|alike| *alike > 0.0)
}

/// Asks what the columns of drives are whose forces are so many times as small as the nominal ones.
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
        "Beside what the nominal values give, forces in {file} are smaller by what a gear makes: {}. If a column is the \
         motor's torque before its gear, say so under `[recording.torque]` of the model file with the true ratio, as in \
         {}; if it is a current, with its `constant` in N m per ampere (or N per ampere) too. Else all base parameters come \
         out so many times too small.",
        each.join(", "),
        entries.join(", "),
    )
}

/// Forces of drives that were misread; gravity the other way may be behind it.
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
        ForceMisreading::Turned => (WRONG_SIGN, "of the opposite sign", "counted the other way"),
        ForceMisreading::TooSmall => (UNITS, "about 1000 times as small", "in kN or kN m"),
        ForceMisreading::TooLarge => (UNITS, "about 1000 times as large", "in mN or mN m"),
    };
    let names = names.join(", ");
    let (or, besides) = if may_hang {
        let besides = message!(
            " Gravity that pulls the other way would turn them, too: check {}, and which way up the machine is mounted, first.",
            Remedy::edit("gravity")
        );
        (", or gravity pulls the other way", besides)
    } else {
        ("", Message::new())
    };
    let says =
        format!("the {forces} of {names} {are} {what} beside what the nominal values give{or}");
    let note = message!(
        "Beside what the nominal values give, the {forces} of {names} in {file} {are} {what}; if {they_are} {if_so}, say {}.{}",
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
        let force = |phase: f64| {
            (0..200)
                .map(|k| (0.1 * f64::from(k) + phase).sin())
                .collect()
        };
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
        assert_eq!(
            of(-0.8, 0.1),
            Some(ForceOddity::Misread(ForceMisreading::Turned))
        );
        assert_eq!(
            of(1.4e-3, 0.1),
            Some(ForceOddity::Misread(ForceMisreading::TooSmall))
        );
        assert_eq!(
            of(-7e2, 0.1),
            Some(ForceOddity::Misread(ForceMisreading::TooLarge))
        );
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
