//! Contents of a rig, as JSON for scripts and as text for people.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::rig_check::{RigCheck, describe_gap};
use crate::text::table::{count, significant};

impl RigCheck {
    /// The contents as one JSON object.
    pub fn json(&self) -> Value {
        let bodies: Vec<Value> = self
            .bodies
            .iter()
            .map(|(name, mass)| json!({ "name": name, "mass": mass }))
            .collect();
        json!({
            "rig": self.name,
            "title": self.title,
            "bodies": bodies,
            "mass": self.mass,
            "joints": self.joints,
            "coordinates": self.coordinates,
            "drives": self.drives,
            "largest_gap": self.largest_gap.as_ref().map(|gap| json!({
                "joint": gap.joint,
                "distance": gap.distance,
                "angle": gap.angle,
            })),
            "largest_move": self.largest_move,
        })
    }

    /// The contents as text for a terminal.
    pub fn text(&self) -> String {
        let mut text = format!(
            "{}: {}\n",
            self.name,
            if self.title.is_empty() { "a rig" } else { &self.title }
        );
        let _ = writeln!(
            text,
            "  {} of {:.6} kg, {}, coordinates {}, drives {}",
            count(self.bodies.len(), "body", "bodies"),
            self.mass,
            count(self.joints, "joint", "joints"),
            self.coordinates.join(", "),
            self.drives.join(", ")
        );
        match &self.largest_gap {
            Some(gap) if !self.is_closed_as_stated() => {
                let _ = writeln!(
                    text,
                    "  the joints close after bodies were moved by up to {} mm; the largest gap of the file is at {}",
                    significant(1e3 * self.largest_move, 3),
                    describe_gap(gap)
                );
            }
            _ => text.push_str("  all joints are closed in the nominal configuration\n"),
        }
        text
    }
}
