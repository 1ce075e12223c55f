//! Loops in the model file: closes them in numbers, and writes their points.

use std::fmt::Write as _;

use modelmill_boundary::message;
use nalgebra::Vector3;

use super::super::chain::CoincidentPair;
use super::super::closing::{self, LoopSolution, RANGE_TOLERANCE};
use super::super::description::{ClosureConstraint, DescriptionClosure, RobotDescription};
use super::{ModelTextBuilder, ORIENTATION_ARM};
use crate::write::significant_digits;

impl ModelTextBuilder<'_> {
    /// Closes the loops and sets the nominal values; none without loops.
    pub(super) fn close(&mut self, description: &RobotDescription) -> Result<Option<LoopSolution>, String> {
        for coordinate in &mut self.coordinates {
            let Some(variable) = coordinate.variable else {
                continue;
            };
            // Without loops the nominal value is zero, or the middle of the range if zero is outside.
            coordinate.nominal = match self.acts[variable].range {
                Some([low, high]) if low < high && !(low..=high).contains(&0.0) => 0.5 * (low + high),
                _ => 0.0,
            };
        }
        let mut pairs = Vec::new();
        for (k, closure) in description.closures.iter().enumerate() {
            // Equal axes and orientations are expressed by additional points that coincide.
            let offsets: &[[f64; 3]] = match closure.constraint {
                ClosureConstraint::Origins => &[[0.0; 3]],
                ClosureConstraint::Axes => &[[0.0; 3], [ORIENTATION_ARM, 0.0, 0.0]],
                ClosureConstraint::Frames => &[[0.0; 3], [ORIENTATION_ARM, 0.0, 0.0], [0.0, ORIENTATION_ARM, 0.0]],
            };
            for offset in offsets {
                // The point in the frames that carry both links.
                let ends = closure.ends.map(|(link, placed)| {
                    let point = placed.p + placed.r * Vector3::from(*offset);
                    match link {
                        None => (None, point),
                        Some(link) => {
                            let (frame, at) = self.links[link];
                            (frame, at.p + at.r * point)
                        }
                    }
                });
                self.check_free_ends(closure, ends.map(|(frame, _)| frame))?;
                pairs.push(CoincidentPair { ends, closure: k });
            }
        }
        if pairs.is_empty() {
            return Ok(None);
        }
        // Poses within the ranges are preferred.
        let ranges: Vec<Option<[f64; 2]>> = self
            .acts
            .iter()
            .map(|acts| acts.range.filter(|[low, high]| low < high))
            .collect();
        let closed = closing::close_loops(&self.chain, &pairs, &self.start, &ranges, &self.reluctance)?;
        for coordinate in &mut self.coordinates {
            let Some(variable) = coordinate.variable else {
                continue;
            };
            // The nominal values are those of the closed pose.
            coordinate.nominal = closed.values[variable];
            let Some([low, high]) = ranges[variable] else {
                continue;
            };
            if (low - RANGE_TOLERANCE..=high + RANGE_TOLERANCE).contains(&coordinate.nominal) {
                coordinate.nominal = coordinate.nominal.clamp(low, high);
            } else {
                self.acts[variable].range = None;
                self.remarks.push(message!(
                    "no pose was found with closed loops within all limits; the range of `{}`, {low} to {high}, is left out",
                    coordinate.name
                ));
            }
        }
        // Remarks on what the solution has changed.
        if closed.is_moved {
            self.remarks.push(
                "at the pose of the description the loops are open or singular; another pose is used for the nominal values"
                    .into(),
            );
        }
        let [conditions, independent] = closed.conditions;
        if conditions > independent {
            self.remarks.push(message!(
                "of {conditions} conditions of its loops {independent} are independent at the tested poses. If the model does not \
                 recognise the others as redundant, it has too many base parameters or treats poses as singular. Compare some forces \
                 with another program before you rely on it"
            ));
        }
        if let Some(gap) = closed.gap {
            self.remarks.push(message!(
                "with the digits of the description the loops close only to {} of their size; points were moved by this gap, so that \
                 they coincide at the nominal pose",
                significant_digits(gap, 2)
            ));
        }
        Ok(Some(closed))
    }

    /// Fails if a closure connects a free body to the world or to another body.
    fn check_free_ends(&self, closure: &DescriptionClosure, ends: [Option<usize>; 2]) -> Result<(), String> {
        // The frame at the root of each end, if it is that of a free body.
        let roots = ends.map(|mut frame| {
            let mut root = None;
            while let Some(k) = frame {
                root = Some(k);
                frame = self.chain.nodes[k].on;
            }
            root.filter(|root| {
                let name = &self.frame_names[*root];
                self.frames
                    .split("\n[[frame]]\n")
                    .any(|text| text.starts_with(&format!("name = \"{name}\"\n")) && text.contains("{ free = "))
            })
        });
        if roots[0] == roots[1] {
            return Ok(());
        }
        Err(format!(
            "line {}: the closure `{}` connects a free body to the world or to another body; models support loops within one \
             free body only",
            closure.line, closure.name
        ))
    }

    /// Writes the points and loops of the independent closures.
    pub(super) fn loops(&mut self, description: &RobotDescription, closed: Option<&LoopSolution>, text: &mut String) {
        let Some(closed) = closed else { return };
        let mut loops = String::new();
        // Each pair is a loop between two points.
        for pair in &closed.pairs {
            let name = self.unique_name(&format!("{}_closed", description.closures[pair.closure].name));
            let mut points = Vec::new();
            for ((frame, at), letter) in pair.ends.iter().zip(["a", "b"]) {
                let point = self.unique_name(&format!("{name}_{letter}"));
                self.write_point(text, &point, *frame, at);
                points.push(format!("\"{point}\""));
            }
            let _ = write!(
                loops,
                "\n[[loop]]\nname = \"{name}\"\njoins = [{}]\n",
                points.join(", ")
            );
        }
        text.push_str(&loops);
    }
}
