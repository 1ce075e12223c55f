//! Compares the size of measured forces with nominal values. Forces along a recording go in; a note comes out on drives
//! whose forces are smaller by a factor typical of a gear. A fit alone cannot show this, since its parameters may have
//! any size.

use modelmill_identify::RecordingNote;
use modelmill_spec::{Mechanism, ModelDrive};

use super::thresholds::{GEAR_RATIOS, NOMINAL_LEAST_CORRELATION};

/// The correlation of two forces, -1 to 1, and the ratio of their norms.
fn correlation_and_ratio(one: &[f64], other: &[f64]) -> (f64, f64) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let sizes = [one, other].map(|force| dot(force, force).sqrt());
    (dot(one, other) / (sizes[0] * sizes[1]), sizes[0] / sizes[1])
}

/// The factor by which a measured force is smaller than the nominal one, as a torque on the motor side of a gear or a
/// motor current is, with its sign; `None` if they agree or are unrelated.
pub(super) fn gear_factor(measured: &[f64], nominal: &[f64]) -> Option<f64> {
    let (correlation, ratio) = correlation_and_ratio(measured, nominal);
    let is_clear = correlation.is_finite() && correlation.abs() >= NOMINAL_LEAST_CORRELATION;
    (is_clear && GEAR_RATIOS.contains(&ratio.recip())).then(|| correlation.signum() / ratio)
}

/// The note on drives whose forces are smaller than the nominal ones by a factor typical of a gear, given one factor per
/// drive; `None` without any.
pub(super) fn gear_note(mechanism: &Mechanism, factors: &[Option<f64>], file: &str) -> Option<RecordingNote> {
    let found: Vec<(&ModelDrive, f64)> = (mechanism.drives.iter().zip(factors))
        .filter_map(|(drive, factor)| Some((drive, (*factor)?)))
        .collect();
    (!found.is_empty()).then(|| RecordingNote::warning(column_query_text(&found, file)))
}

/// The text of the note.
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
         the torque on the motor side of the gear, declare it under `[recording.torque]` of the model file with the true ratio, as \
         in {}. If it is a current, also give its `constant` in N m per ampere (or N per ampere). Otherwise all base \
         parameters are estimated too small by this factor.",
        each.join(", "),
        entries.join(", "),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gear_ratios_are_reported_where_forces_are_alike() {
        let nominal: Vec<f64> = (0..200).map(|k| (0.1 * f64::from(k)).sin() + 0.3).collect();
        let of = |scale: f64, other: f64| -> Option<f64> {
            let cosine = (0..200).map(|k| (0.07 * f64::from(k)).cos());
            let measured: Vec<f64> = nominal
                .iter()
                .zip(cosine)
                .map(|(f, c)| scale * (f + other * c))
                .collect();
            gear_factor(&measured, &nominal)
        };
        let ratio = of(-1.0 / 101.0, 0.1).expect("a gear");
        assert!((ratio / -101.0 - 1.0).abs() < 0.05, "{ratio}");
        // Signs and units are faults with entries of their own, and forces that hardly resemble the nominal ones tell
        // nothing.
        for (scale, other) in [
            (1.3, 0.1),
            (-0.8, 0.1),
            (1.4e-3, 0.1),
            (-7e2, 0.1),
            (0.12, 0.1),
            (-0.01, 3.0),
        ] {
            assert_eq!(of(scale, other), None, "{scale} {other}");
        }
        assert_eq!(gear_factor(&[0.0; 3], &[1.0; 3]), None);
    }
}
