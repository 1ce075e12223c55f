//! The sections of the model file after frames: coordinates, parts, drives, effects and limits.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use modelmill_boundary::message;
use modelmill_boundary::text::Message;
use nalgebra::Vector3;

use super::super::DescriptionImport;
use super::super::closing::LoopSolution;
use super::super::description::{JointServo, RobotDescription};
use super::super::thresholds::ROUNDING_OF_ROTATION;
use super::lines::NamedDriveLine;
use super::{ImportCoordinate, ModelTextBuilder, round_to_15_digits};
use crate::write::{significant_digits, toml_float, toml_string};

/// The ten linear parameters of a body.
const BODY_SYMBOLS: [&str; 10] = ["XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M"];

impl ModelTextBuilder<'_> {
    /// Joins all sections to the text of the model file.
    pub(super) fn finish(
        mut self,
        description: &RobotDescription,
        closed: Option<&LoopSolution>,
        lines: &[NamedDriveLine<'_>],
    ) -> DescriptionImport {
        let robot = &description.name;
        // The head of the file, with gravity and constants.
        let gravity = description.gravity.unwrap_or(Vector3::new(0.0, 0.0, -9.81));
        let mut text = format!(
            "# Made from {} by modelmill import: a starting point; check and correct it.\nschema = 1\nname = \"{}\"\n\
             title = {}\n",
            match description.format {
                "URDF" => "a URDF".to_owned(),
                other => format!("an {other} file"),
            },
            module_name(robot),
            toml_string(&format!("{robot}, imported"))
        );
        let note = if description.gravity.is_some() {
            "acceleration of gravity"
        } else {
            "acceleration of gravity; the description does not specify it"
        };
        // Gravity along -z is written with the symbol `g`.
        let along_z = gravity.x == 0.0 && gravity.y == 0.0;
        if gravity.norm() == 0.0 {
            self.remarks.push("the description has no gravity".into());
            text.push_str("gravity = [0, 0, 0]\n\n[constants]\n");
        } else if along_z && gravity.z < 0.0 {
            let _ = write!(
                text,
                "gravity = [0, 0, \"-g\"]\n\n[constants]\ng = {{ value = {}, unit = \"m/s^2\", note = \"{note}\" }}\n",
                toml_float(-gravity.z)
            );
        } else {
            let _ = write!(
                text,
                "gravity = [{}, {}, {}]\n\n[constants]\n",
                toml_float(gravity.x),
                toml_float(gravity.y),
                toml_float(gravity.z)
            );
        }
        text.push_str(&self.constants);
        text.push_str("\n[coordinates]\n");
        // Passive coordinates are those that the loops determine.
        let is_passive = |coordinate: &ImportCoordinate| matches!((closed, coordinate.variable), (Some(closed), Some(v)) if closed.passive[v]);
        for coordinate in &self.coordinates {
            // Coordinates of free bodies are never driven, so that this is not written.
            let more = if is_passive(coordinate) {
                ", passive = true"
            } else if coordinate.is_driven || coordinate.is_free || coordinate.is_pulled {
                ""
            } else {
                ", driven = false"
            };
            let _ = writeln!(
                text,
                "{} = {{ nominal = {}{more} }}",
                coordinate.name,
                toml_float(round_to_15_digits(coordinate.nominal))
            );
        }
        text.push_str(&self.followers);
        text.push_str(&self.frames);
        // Tables in the order of the format: loops, parts, points, then forces.
        self.loops(description, closed, &mut text);
        self.parts(&mut text);
        self.line_points(lines, &mut text);
        self.forces(&is_passive, lines, &mut text);
        DescriptionImport {
            model: text,
            facts: self.facts(),
            remarks: self.remarks,
            joints: self.joints,
        }
    }

    /// What every reader of the description would leave out.
    fn facts(&self) -> Vec<Message> {
        /// Most links that are named.
        const NAMED: usize = 4;
        let all = &self.fixed_links;
        if all.is_empty() {
            return Vec::new();
        }
        let names: Vec<String> = all.iter().take(NAMED).map(|(name, _)| format!("`{name}`")).collect();
        let more = match all.len().saturating_sub(NAMED) {
            0 => String::new(),
            n => format!(" and {n} more"),
        };
        let mass: f64 = all.iter().map(|(_, mass)| mass).sum();
        vec![message!(
            "{}{more} {}; {} kg have no effect on the drives and are left out",
            names.join(", "),
            if all.len() == 1 { "does not move" } else { "do not move" },
            significant_digits(mass, 4)
        )]
    }

    /// Writes the bodies with their ten linear parameters.
    fn parts(&self, text: &mut String) {
        let mut used = BTreeSet::new();
        for (k, body) in self.bodies.iter().enumerate() {
            let frame = &self.frame_names[body.frame];
            // Symbols have the name of the frame; long names are replaced by a number.
            let mut suffix = if frame.len() < 32 {
                format!("_{frame}")
            } else {
                format!("_{}", k + 1)
            };
            // A joint may have the name of such a symbol, and another body may have the suffix.
            let is_symbol_used = |suffix: &str| {
                let mut symbols = BODY_SYMBOLS.iter();
                symbols.any(|symbol| self.names.contains(&format!("{symbol}{suffix}")))
            };
            while used.contains(&suffix) || is_symbol_used(&suffix) {
                suffix.push_str("_body");
            }
            used.insert(suffix.clone());
            // The ten parameters about the origin of the frame. Rotations leave rounding where an entry is zero.
            let largest = |entries: &[f64]| entries.iter().fold(0.0_f64, |all, one| all.max(one.abs()));
            let i = body
                .inertia
                .map(|one| zero_if_rounding(one, largest(body.inertia.as_slice())));
            let c = body
                .moment
                .map(|one| zero_if_rounding(one, largest(body.moment.as_slice())));
            let values = [
                i[(0, 0)],
                i[(0, 1)],
                i[(0, 2)],
                i[(1, 1)],
                i[(1, 2)],
                i[(2, 2)],
                c.x,
                c.y,
                c.z,
                body.mass,
            ];
            // Zeros are written as well: a value that the file does not state counts as unknown.
            let numbers: Vec<String> = BODY_SYMBOLS
                .iter()
                .zip(values)
                .map(|(key, v)| format!("{key} = {}", toml_float(round_to_15_digits(v))))
                .collect();
            let numbers = numbers.join(", ");
            let linear = if self.options.known_bodies {
                format!("{{ {numbers} }}")
            } else {
                format!("{{ all = \"{suffix}\", nominal = {{ {numbers} }} }}")
            };
            let _ = write!(
                text,
                "\n[[part]]\nname = \"{frame}_body\"\non = \"{frame}\"\nlinear = {linear}\n"
            );
        }
    }

    /// Writes drives, effects at coordinates, and limits.
    fn forces(
        &mut self,
        is_passive: &dyn Fn(&ImportCoordinate) -> bool,
        lines: &[NamedDriveLine<'_>],
        text: &mut String,
    ) {
        // Names and remarks are added during the loop, so that the coordinates are taken out first.
        let coordinates = std::mem::take(&mut self.coordinates);
        let (mut drives, mut actuators, mut effects) = (String::new(), String::new(), String::new());
        let (mut ranges, mut forces) = (String::new(), String::new());
        for coordinate in &coordinates {
            // Coordinates of free bodies have neither drives nor effects.
            let Some(variable) = coordinate.variable else {
                continue;
            };
            let acts = self.acts[variable].clone();
            // A passive coordinate cannot have a drive.
            let has_drive = coordinate.is_driven && !is_passive(coordinate);
            let mut place = coordinate.name.clone();
            if has_drive {
                place = self.unique_name(&format!("{place}_drive"));
                let _ = write!(
                    drives,
                    "\n[[drive]]\nname = \"{place}\"\njoint = \"{}\"\n",
                    coordinate.name
                );
                if let Some(servo) = &acts.servo {
                    // The command has the name of the actuator, unless another quantity has it.
                    let signal = &servo.name;
                    let is_usable = is_plain_name(signal) && signal != "t" && self.names.insert(signal.clone());
                    actuators.push_str(&servo_text(&place, servo, is_usable));
                }
            } else if coordinate.is_driven {
                self.remarks.push(message!(
                    "`{}` is determined by loops and couplings; it has no separate drive in the model",
                    coordinate.name
                ));
            }
            // With surplus drives, effects act at coordinates and not at drives.
            let effects_at = if self.has_surplus {
                coordinate.name.clone()
            } else {
                place.clone()
            };
            for (kind, symbol, value) in [
                ("viscous_friction", "Fv", acts.damping),
                ("coulomb_friction", "Fc", acts.friction),
                ("drive_inertia", "Ia", acts.armature),
                ("spring", "k", acts.stiffness),
            ] {
                if value == 0.0 {
                    continue;
                }
                let _ = write!(
                    effects,
                    "\n[[effect]]\nkind = \"{kind}\"\nat = [\"{effects_at}\"]\nparameters = {{ {symbol} = {{ nominal = {} }} }}\n",
                    toml_float(value)
                );
                // The relaxed position of several springs is the mean, weighted with their stiffnesses.
                if kind == "spring" {
                    let _ = writeln!(effects, "constants = {{ rest = {} }}", toml_float(acts.pull / value));
                }
            }
            // Limits of the coordinate; the rate of a passive one follows from the others.
            let mut limits = Vec::new();
            if let Some([low, high]) = acts.range.filter(|[low, high]| low < high) {
                limits.push(format!(
                    "position = [{}, {}]",
                    toml_float(round_to_15_digits(low)),
                    toml_float(round_to_15_digits(high))
                ));
            }
            if let Some(rate) = acts.rate.filter(|_| !is_passive(coordinate)) {
                limits.push(format!("rate = {}", toml_float(rate)));
            }
            if !limits.is_empty() {
                let _ = writeln!(ranges, "{} = {{ {} }}", coordinate.name, limits.join(", "));
            }
            // Limits of the drive.
            if let Some([low, high]) = acts.force.filter(|[low, high]| has_drive && low < high) {
                let _ = writeln!(
                    forces,
                    "{place} = {{ force = [{}, {}] }}",
                    toml_float(low),
                    toml_float(high)
                );
            }
        }
        // Straight drives come after those of the joints.
        self.line_forces(lines, [&mut drives, &mut effects, &mut forces]);
        text.push_str(&drives);
        // Surplus drives have no equations of their own.
        if !self.has_surplus {
            text.push_str(&actuators);
        }
        text.push_str(&effects);
        // Tables of limits without entries are left out.
        for (table, entries) in [("coordinates", ranges), ("drives", forces)] {
            if !entries.is_empty() {
                let _ = write!(text, "\n[limits.{table}]\n{entries}");
            }
        }
    }
}

/// The actuator of a drive with a controller.
fn servo_text(drive: &str, servo: &JointServo, has_own_signal: bool) -> String {
    let mut text = format!("\n[[actuator]]\ndrive = \"{drive}\"\n");
    let _ = match servo.kp {
        Some(kp) => write!(
            text,
            "kind = \"position_servo\"\nkp = {}\nkd = {}\n",
            toml_float(kp),
            toml_float(servo.kd)
        ),
        None => write!(text, "kind = \"velocity_servo\"\nkv = {}\n", toml_float(servo.kd)),
    };
    if has_own_signal {
        let _ = writeln!(text, "signal = {}", toml_string(&servo.name));
    }
    // Descriptions seldom state a delay, and machines have one: it is estimated unless the file gives it.
    if servo.delay > 0.0 {
        let _ = writeln!(text, "delay = {}", toml_float(servo.delay));
    }
    if let Some(limit) = servo.saturation {
        let _ = writeln!(text, "saturation = {}", toml_float(limit));
    }
    text
}

/// Zero for an entry that is only rounding of entries of size `largest`.
fn zero_if_rounding(entry: f64, largest: f64) -> f64 {
    if entry.abs() <= ROUNDING_OF_ROTATION * largest {
        0.0
    } else {
        entry
    }
}

/// Whether a name may stand in a model file: letters, digits and `_`, with a letter first.
fn is_plain_name(name: &str) -> bool {
    let is_word = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    is_word && name.starts_with(|c: char| c.is_ascii_alphabetic())
}

/// The name of a model: an identifier in lower-case letters.
fn module_name(robot: &str) -> String {
    let mut name: String = robot
        .chars()
        .take(40)
        .map(|c| {
            if c.is_ascii_alphanumeric() {
                c.to_ascii_lowercase()
            } else {
                '_'
            }
        })
        .collect();
    if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
        name.insert_str(0, "n_");
    }
    name
}
