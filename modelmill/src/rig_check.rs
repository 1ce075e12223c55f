//! `check` of a rig: whether its loops close, and what it contains.

use std::path::Path;

use modelmill_boundary::files::PathKind;
use modelmill_rig::{JointGap, LoadedRig, Rig, RigTracker};
use toml::Table;

use crate::error::{Error, Outcome};
use crate::host::Host;
use crate::text::table::significant;

/// Gaps of joints (m, rad) below this are rounding, as in the closing of joints itself.
const ROUNDING: f64 = 1e-9;
/// Most files that extend one another are examined; more are refused when the file is read.
const MOST_EXTENDED: usize = 16;
/// Number of joints that an error lists.
const LISTED_GAPS: usize = 5;

/// Contents of a rig whose loops close.
#[derive(Clone, Debug)]
pub struct RigCheck {
    /// Name of the rig.
    pub name: String,
    /// Title; may be empty.
    pub title: String,
    /// Names of the bodies with their masses, kg.
    pub bodies: Vec<(String, f64)>,
    /// Mass of all bodies and of masses at points, kg.
    pub mass: f64,
    /// Number of joints.
    pub joints: usize,
    /// Names of the coordinates.
    pub coordinates: Vec<String>,
    /// Names of the drives.
    pub drives: Vec<String>,
    /// The joint with the largest gap if all bodies have the poses of the file, before joints are closed. `None` if the
    /// rig has no joints.
    pub largest_gap: Option<JointGap>,
    /// The largest displacement of a body that closed the joints, m.
    pub largest_move: f64,
}

impl Host {
    /// Whether a file, or one that it extends, has the tables of a rig and not those of a model. False for a pipe, which
    /// can be read only once.
    pub fn is_rig_file(&self, path: &Path) -> bool {
        self.extends_rig(path, MOST_EXTENDED)
    }

    /// As [`Self::is_rig_file`], with at most this many files that extend one another.
    fn extends_rig(&self, path: &Path, depth: usize) -> bool {
        if self.files().kind(path) != PathKind::File {
            return false;
        }
        let Ok(text) = self.files().read_text(path, modelmill_spec::LARGEST_FILE as u64) else {
            return false;
        };
        // A text beyond the limits of model files is refused by their reader.
        if modelmill_spec::find_toml_excess(&text).is_some() {
            return false;
        }
        // Recordings and pictures are no TOML.
        let Ok(table) = text.parse::<Table>() else {
            return false;
        };
        let has = |key: &str| table.contains_key(key);
        // A model may have `[[body]]` by mistake; its faults are then those of a model.
        if has("part") || has("frame") {
            return false;
        }
        if has("body") || has("mass_properties") {
            return true;
        }
        // A variant may have few tables; the file that it extends decides.
        let base = table.get("extends").and_then(toml::Value::as_str);
        let folder = path.parent().unwrap_or(Path::new(""));
        depth > 0 && base.is_some_and(|base| self.extends_rig(&folder.join(base), depth - 1))
    }

    /// Closes the joints of a rig and describes its contents.
    ///
    /// Fails when the joints do not close. The error lists the largest gaps of joints at the poses of the file.
    pub fn check_rig(&self, loaded: &LoadedRig) -> Outcome<RigCheck> {
        let rig = &loaded.rig;
        let mut gaps = rig.nominal_gaps();
        gaps.sort_by(|a, b| size_of_gap(b).total_cmp(&size_of_gap(a)));
        let tracker = RigTracker::new(rig).map_err(|error| {
            let open: Vec<String> = gaps
                .iter()
                .filter(|gap| size_of_gap(gap) > ROUNDING)
                .take(LISTED_GAPS)
                .map(describe_gap)
                .collect();
            let note = match open.len() {
                0 => String::new(),
                _ => format!("\nnote: gaps with the poses of the file: {}", open.join("; ")),
            };
            Error::input(format!("{}: {error}{note}", rig.name))
        })?;
        Ok(RigCheck {
            name: rig.name.clone(),
            title: rig.title.clone(),
            bodies: rig.bodies.iter().map(|body| (body.name.clone(), body.mass)).collect(),
            mass: total_mass(rig),
            joints: rig.joints.len(),
            coordinates: rig.coordinates.iter().map(|c| c.name.clone()).collect(),
            drives: rig.drives.iter().map(|drive| drive.name.clone()).collect(),
            largest_gap: gaps.into_iter().next(),
            largest_move: tracker.largest_displacement(),
        })
    }
}

impl RigCheck {
    /// Whether the joints are closed with the poses of the file, up to rounding.
    pub fn is_closed_as_stated(&self) -> bool {
        self.largest_gap.as_ref().is_none_or(|gap| size_of_gap(gap) <= ROUNDING)
    }
}

/// The larger of distance (m) and angle (rad).
fn size_of_gap(gap: &JointGap) -> f64 {
    gap.distance.max(gap.angle)
}

/// A gap as text: the distance, and the angle if there is one.
pub(crate) fn describe_gap(gap: &JointGap) -> String {
    let distance = significant(1e3 * gap.distance, 3);
    if gap.angle < ROUNDING {
        return format!("`{}` {distance} mm", gap.joint);
    }
    format!("`{}` {distance} mm, {} rad", gap.joint, significant(gap.angle, 2))
}

/// Mass of all bodies and of masses at points, kg.
fn total_mass(rig: &Rig) -> f64 {
    let bodies = rig.bodies.iter().map(|body| body.mass);
    let points = rig.lumped_masses.iter().map(|lumped| lumped.mass);
    bodies.chain(points).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A gap above rounding is listed, so that its size must not be printed as zero.
    #[test]
    fn small_gaps_are_not_printed_as_zero() {
        for (distance, expected) in [(3e-8, "3.00e-5 mm"), (0.012, "12.0 mm")] {
            let gap = JointGap {
                joint: "hinge".to_owned(),
                distance,
                angle: 0.0,
            };
            let says = describe_gap(&gap);
            assert!(says.contains(expected), "{says}");
        }
    }
}
