//! What nominal values say of the sign and the size of measured forces: forces along a recording go in, drives whose
//! forces point the other way or are in another unit come out, with the option that mends it. A fit alone does not show
//! either, since parameters may take any sign and size.

use modelmill_spec::{Drive, Mechanism};

/// Below this correlation with the nominal forces nothing is said: friction and wrong nominal values may be behind it.
const CLEAR: f64 = 0.8;
/// Factors between units of force are powers of 1000; nominal values may be off by this factor.
const TOLERANCE: f64 = 4.0;

/// What is odd about the force of a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Oddity {
    /// It points the other way.
    Turned,
    /// Measured in thousands of the unit.
    TooSmall,
    /// Measured in thousandths of the unit.
    TooLarge,
}

/// How a measured force is related to the nominal one.
fn oddity(measured: &[f64], nominal: &[f64]) -> Option<Oddity> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let sizes = [measured, nominal].map(|force| dot(force, force).sqrt());
    let correlation = dot(measured, nominal) / (sizes[0] * sizes[1]);
    let ratio = sizes[0] / sizes[1];
    if !correlation.is_finite() || correlation.abs() < CLEAR {
        return None;
    }
    let about = |factor: f64| (factor / TOLERANCE..factor * TOLERANCE).contains(&ratio);
    if about(1e-3) {
        Some(Oddity::TooSmall)
    } else if about(1e3) {
        Some(Oddity::TooLarge)
    } else if correlation < 0.0 && about(1.0) {
        Some(Oddity::Turned)
    } else {
        None
    }
}

/// Sentences about drives whose measured forces are not those of the nominal values by their sign or unit; forces are
/// `[drive][sample]`.
pub(crate) fn oddities(
    mechanism: &Mechanism,
    measured: &[Vec<f64>],
    nominal: &[Vec<f64>],
    file: &str,
) -> Vec<String> {
    let found: Vec<(&Drive, Oddity)> = (mechanism.drives.iter().zip(measured).zip(nominal))
        .filter_map(|((drive, measured), nominal)| Some((drive, oddity(measured, nominal)?)))
        .collect();
    [Oddity::Turned, Oddity::TooSmall, Oddity::TooLarge]
        .into_iter()
        .filter_map(|which| {
            let drives: Vec<&Drive> = found
                .iter()
                .filter(|(_, oddity)| *oddity == which)
                .map(|(drive, _)| *drive)
                .collect();
            (!drives.is_empty()).then(|| says(mechanism, &drives, which, file))
        })
        .collect()
}

fn says(mechanism: &Mechanism, drives: &[&Drive], which: Oddity, file: &str) -> String {
    let names: Vec<String> = drives.iter().map(|d| format!("`{}`", d.name)).collect();
    let (forces, are, they_are) = match drives {
        [_] => ("force", "is", "it is"),
        _ => ("forces", "are", "they are"),
    };
    let maps: Vec<String> = drives
        .iter()
        .map(|drive| {
            let name = &drive.name;
            match which {
                Oddity::Turned => format!("option `columns` = `{name}=-{name}`"),
                Oddity::TooSmall => {
                    format!(
                        "option `columns` = `{name}={name} [k{}]`",
                        drive.kind.force_unit(&mechanism.coordinates)
                    )
                }
                Oddity::TooLarge => format!("option `columns` = `{name}={name}/1000`"),
            }
        })
        .collect();
    let what = match which {
        Oddity::Turned => format!("of the opposite sign; if {they_are} counted the other way"),
        Oddity::TooSmall => format!("about 1000 times as small; if {they_are} in kN or kN m"),
        Oddity::TooLarge => format!("about 1000 times as large; if {they_are} in mN or mN m"),
    };
    format!(
        "Beside what the nominal values give, the {forces} of {} in {file} {are} {what}, say {}.",
        names.join(", "),
        maps.join(" ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_and_units_are_told_where_forces_are_alike() {
        let nominal: Vec<f64> = (0..200).map(|k| (0.1 * f64::from(k)).sin() + 0.3).collect();
        let of = |scale: f64, other: f64| -> Option<Oddity> {
            let cosine = (0..200).map(|k| (0.07 * f64::from(k)).cos());
            let measured: Vec<f64> = nominal
                .iter()
                .zip(cosine)
                .map(|(f, c)| scale * (f + other * c))
                .collect();
            oddity(&measured, &nominal)
        };
        assert_eq!(of(1.3, 0.1), None);
        assert_eq!(of(-0.8, 0.1), Some(Oddity::Turned));
        assert_eq!(of(1.4e-3, 0.1), Some(Oddity::TooSmall));
        assert_eq!(of(-7e2, 0.1), Some(Oddity::TooLarge));
        // Ten times may be a gear, and forces that hardly resemble the nominal ones tell nothing.
        assert_eq!(of(10.0, 0.1), None);
        assert_eq!(of(-1.0, 3.0), None);
        assert_eq!(oddity(&[0.0; 3], &[1.0; 3]), None);
    }
}
