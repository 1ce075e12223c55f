//! Joints in the model file: frames, coordinates, couplings and forces of each kind of joint.

use std::fmt::Write as _;

use modelmill_boundary::message;
use nalgebra::{Matrix3, Vector3};

use super::super::ImportedJoint;
use super::super::chain::ChainMotion;
use super::super::couplings::{self, JointFollower};
use super::super::description::{DescriptionJoint, DescriptionJointKind, DescriptionLink, RobotDescription};
use super::super::placed::{DescriptionPose, named_axis};
use super::{ImportCoordinate, ModelTextBuilder, VariableForces, round_to_15_digits};
use crate::write::toml_float;

impl ModelTextBuilder<'_> {
    /// Adds the frame of a revolute or prismatic joint. Returns the frame and the pose of the link in it.
    #[allow(clippy::too_many_lines, reason = "one frame, piece by piece")]
    pub(super) fn add_scalar_joint(
        &mut self,
        description: &RobotDescription,
        joint: &DescriptionJoint,
        on: Option<usize>,
        link: &DescriptionPose,
        name: &str,
    ) -> Result<(Option<usize>, DescriptionPose), String> {
        // Joints of a model move along a named axis, so the frame is turned for other directions.
        let (axis, turned) = named_axis(&joint.axis)
            .ok_or_else(|| format!("line {}: the axis of `{}` has no direction", joint.line, joint.name))?;
        // Pose of the frame on its parent.
        let at = DescriptionPose {
            p: link.p + link.r * joint.anchor,
            r: link.r * turned,
        };
        // How the joint follows its variable.
        let follows = self.couplings.find_follower(&joint.name).ok_or_else(|| {
            format!(
                "line {}: two joints have the name `{}`; rename one",
                joint.line, joint.name
            )
        })?;
        let is_turn = joint.kind == DescriptionJointKind::Revolute;
        // Ratio and name of the coordinate; none if a coupling or the user fixes the joint.
        let moved = follows.variable.map(|variable| {
            let coordinate = self.variable(variable);
            self.add_joint_forces(description, joint, variable, follows.ratio, follows.offset);
            (follows.ratio, coordinate)
        });
        // Coordinates of the description are `zero` at the pose in which links are given.
        let constant = follows.offset - joint.zero;
        if moved.is_none() {
            // The links behind a fixed joint become one body with those before it.
            self.remarks.push(message!(
                "line {}: `{}` is fixed at {}",
                joint.line,
                joint.name,
                follows.offset
            ));
            return Ok((on, pose_behind_fixed(joint, &at, &turned, constant)));
        }
        // The constant part of the frame's pose.
        let shown = self.transform_text(&joint.name, &at);
        // A joint that cannot share the coordinate of its variable gets its own.
        let follower = moved
            .as_ref()
            .filter(|_| follows.has_own)
            .map(|(_, leader)| self.follower(joint, leader, &follows));
        let own = self.unique_name(name);
        // The expression of the joint's coordinate.
        let text = match (&follower, &moved) {
            (Some(follower), _) => follower.clone(),
            (None, None) => String::new(),
            (None, Some((1.0, name))) => name.clone(),
            (None, Some((-1.0, name))) => format!("-{name}"),
            (None, Some((ratio, name))) => format!("{}*{name}", plain_number(*ratio)),
        };
        // A follower with its own coordinate has the offset in that coordinate.
        let left = if follower.is_some() { -joint.zero } else { constant };
        let offset = self.offset(&format!("{}_zero", joint.name), left, joint);
        let text = with_offset(text, &offset);
        let kind = if is_turn { "revolute" } else { "prismatic" };
        // The z axis is the default of the format.
        let axis_text = if axis == "z" {
            String::new()
        } else {
            format!(", axis = \"{axis}\"")
        };
        let joint_text = format!("{kind} = \"{text}\"{axis_text}");
        // The same motion for the numeric kinematics.
        let direction = turned.transpose() * joint.axis.normalize();
        let motion = ChainMotion {
            is_turn,
            axis: direction,
            variable: follows.variable,
            ratio: follows.ratio,
            offset: constant,
        };
        // Pose of the link in the frame: the inverse of shift and turn.
        let back = DescriptionPose {
            p: -(turned.transpose() * joint.anchor),
            r: turned.transpose(),
        };
        // Tell the caller which coordinate belongs to the joint.
        if let Some((_, coordinate)) = &moved {
            let (coordinate, ratio, offset) = match &follower {
                Some(own) => (own, 1.0, 0.0),
                None => (coordinate, follows.ratio, follows.offset),
            };
            self.joints.push(ImportedJoint {
                name: joint.name.clone(),
                coordinates: vec![coordinate.clone()],
                ratio,
                offset,
                axes: String::new(),
            });
        }
        let frame = self.frame(own, on, at, &shown, &joint_text, vec![motion]);
        Ok((Some(frame), back))
    }

    /// The expression of a constant part of a joint's coordinate, rad or m.
    fn offset(&mut self, name: &str, value: f64, joint: &DescriptionJoint) -> String {
        let text = if joint.kind == DescriptionJointKind::Revolute {
            self.angle(name, value, &joint.name)
        } else {
            self.length(name, value)
        };
        text.trim_matches('"').to_owned()
    }

    /// Adds a coordinate that follows another one, and returns its name. If one is an angle and the other a length, the
    /// ratio is a constant with a unit.
    fn follower(&mut self, joint: &DescriptionJoint, leader: &str, follows: &JointFollower) -> String {
        let own = self.unique_name(&joint.name);
        let offset = self.offset(&format!("{}_offset", joint.name), follows.offset, joint);
        // A ratio between equal units is written as a number.
        let ratio = if follows.changes_kind {
            let unit = if joint.kind == DescriptionJointKind::Revolute {
                "1/m"
            } else {
                "m"
            };
            let per = self.unique_name(&format!("{}_per_{leader}", joint.name));
            let _ = writeln!(
                self.constants,
                "{per} = {{ value = {}, unit = \"{unit}\" }}",
                toml_float(follows.ratio)
            );
            per
        } else {
            couplings::ratio_text(follows.ratio)
        };
        let followed = format!("{ratio}*{leader}");
        let followed = with_offset(followed, &offset);
        let _ = writeln!(self.followers, "{own} = {{ follows = \"{followed}\" }}");
        own
    }

    /// The name of the coordinate of a variable; adds the coordinate at the first call.
    fn variable(&mut self, variable: usize) -> String {
        if let Some(k) = self.of_variable[variable] {
            return self.coordinates[k].name.clone();
        }
        // The coordinate has the name of the joint whose value it is.
        let meant = self.couplings.variables[variable].clone();
        let name = self.unique_name(&meant.joint);
        self.of_variable[variable] = Some(self.coordinates.len());
        self.coordinates.push(ImportCoordinate {
            name: name.clone(),
            variable: Some(variable),
            nominal: 0.0,
            is_driven: meant.is_driven,
            is_free: false,
            is_pulled: false,
        });
        name
    }

    /// Adds forces and limits of a joint to those of its variable, for a joint `ratio*variable + offset`.
    fn add_joint_forces(
        &mut self,
        description: &RobotDescription,
        joint: &DescriptionJoint,
        variable: usize,
        ratio: f64,
        offset: f64,
    ) {
        let acts = &mut self.acts[variable];
        // Power is preserved: coefficients of quadratic terms scale with the square of the ratio.
        acts.damping += ratio * ratio * joint.damping;
        acts.friction += ratio.abs() * joint.friction;
        acts.armature += ratio * ratio * joint.armature;
        let stiffness = ratio * ratio * joint.stiffness;
        acts.stiffness += stiffness;
        acts.pull += stiffness * (joint.rest - offset) / ratio;
        // A spring acts on a coordinate, which should then be independent.
        if stiffness != 0.0 && self.reluctance[variable] == 2 {
            self.reluctance[variable] = 1;
        }
        // The range of the variable; a negative ratio exchanges its ends.
        if let Some([low, high]) = joint.range.filter(|[low, high]| low >= high) {
            self.remarks.push(if low > high {
                message!(
                    "line {}: the lower limit of `{}`, {low}, is above its upper limit, {high}; both are left out",
                    joint.line,
                    joint.name
                )
            } else {
                message!(
                    "line {}: both limits of `{}` are {low}, so that it cannot move; in the model it moves without limits: lock it at \
                     {low} in the import",
                    joint.line,
                    joint.name
                )
            });
        } else if let Some(range) = joint.range {
            let mut ends = range.map(|end| (end - offset) / ratio);
            ends.sort_by(f64::total_cmp);
            acts.range = Some(
                acts.range
                    .map_or(ends, |old| [old[0].max(ends[0]), old[1].min(ends[1])]),
            );
        }
        // The lowest rate of all joints that the variable moves.
        if let Some(rate) = joint.rate {
            let rate = rate / ratio.abs();
            acts.rate = Some(acts.rate.map_or(rate, |old| old.min(rate)));
        }
        // Force limits and the starting value are those of the joint that gives the variable its name.
        let leader = &self.couplings.variables[variable].joint;
        let is_leader = *leader == joint.name;
        if is_leader {
            acts.force = joint.force.map(|force| force.map(|force| force * ratio));
            acts.servo.clone_from(&joint.servo);
        } else if joint.force.is_some() {
            self.remarks.push(message!(
                "line {}: the force limit of `{}`, which follows `{leader}`, is left out: one drive moves both",
                joint.line,
                joint.name
            ));
        }
        if !is_leader && joint.servo.is_some() {
            self.remarks.push(message!(
                "line {}: the controller of `{}`, which follows `{leader}`, is left out: one drive moves both",
                joint.line,
                joint.name
            ));
        }
        // Loops are closed from the pose of the description, or from the zero of the joint.
        let given = description.pose.iter().find(|(name, _)| name == &joint.name);
        match given {
            Some((_, value)) if is_leader => self.start[variable] = (value - offset) / ratio,
            None if is_leader => self.start[variable] = (joint.zero - offset) / ratio,
            _ => {}
        }
    }

    /// Adds a ball joint with three angles. The last one is about the axis along which the loop closure `tip` is
    /// farthest, so that the closure hardly depends on it. Returns the frame and the pose of the link in it.
    pub(super) fn add_ball_joint(
        &mut self,
        joint: &DescriptionJoint,
        on: Option<usize>,
        link: &DescriptionPose,
        name: &str,
        tip: Option<Vector3<f64>>,
    ) -> (Option<usize>, DescriptionPose) {
        // Sequences that end with x, y or z.
        let along = tip.map_or(0, |tip| tip.iamax());
        let axes = ["zyx", "zxy", "yxz"][along];
        let at = DescriptionPose {
            p: link.p + link.r * joint.anchor,
            r: link.r,
        };
        let shown = self.transform_text(&joint.name, &at);
        let own = self.unique_name(name);
        let mut names = Vec::new();
        let mut moves = Vec::new();
        // One variable, coordinate and motion for each angle.
        for (k, letter) in axes.chars().enumerate() {
            let variable = self.chain.n_variables;
            self.chain.n_variables += 1;
            let coordinate = self.unique_name(&format!("{}_{letter}", joint.name));
            self.of_variable.push(Some(self.coordinates.len()));
            self.acts.push(VariableForces::default());
            // Angles of ball joints become passive before all others, the last one last.
            self.reluctance.push(if k == 2 { 3 } else { 4 });
            self.start.push(0.0);
            self.coordinates.push(ImportCoordinate {
                name: coordinate.clone(),
                variable: Some(variable),
                nominal: 0.0,
                is_driven: joint.is_driven,
                is_free: false,
                is_pulled: false,
            });
            names.push(coordinate);
            let mut axis = Vector3::zeros();
            axis[usize::from(letter as u8 - b'x')] = 1.0;
            moves.push(ChainMotion {
                is_turn: true,
                axis,
                variable: Some(variable),
                ratio: 1.0,
                offset: 0.0,
            });
        }
        self.remarks.push(message!(
            "line {}: the ball joint `{}` has three angles in the model, in the sequence {axes}; they are singular if the second \
             is a right angle",
            joint.line, joint.name
        ));
        // Effects at the angles would be different from effects at the joint.
        let acting = [joint.damping, joint.friction, joint.stiffness, joint.armature];
        if joint.has_limits() || acting.iter().any(|value| *value != 0.0) {
            self.remarks.push(message!(
                "line {}: damping, friction, spring, armature and limits of the ball joint `{}` are left out",
                joint.line,
                joint.name
            ));
        }
        self.joints.push(ImportedJoint {
            name: joint.name.clone(),
            coordinates: names.clone(),
            ratio: 1.0,
            offset: 0.0,
            axes: axes.to_owned(),
        });
        // The frame with its three angles.
        let list: Vec<String> = names.iter().map(|name| format!("\"{name}\"")).collect();
        let text = format!("spherical = [{}], axes = \"{axes}\"", list.join(", "));
        let frame = self.frame(own, on, at, &shown, &text, moves);
        let back = DescriptionPose {
            p: -joint.anchor,
            r: Matrix3::identity(),
        };
        (Some(frame), back)
    }

    /// Adds a free body with position and quaternion. Returns the frame and the pose of the link in it.
    pub(super) fn add_free_joint(
        &mut self,
        joint: &DescriptionJoint,
        link: &DescriptionPose,
        name: &str,
    ) -> (Option<usize>, DescriptionPose) {
        let own = self.unique_name(name);
        // Nominal values are the pose of the description; nalgebra has the real part of a quaternion last.
        let quaternion = nalgebra::UnitQuaternion::from_matrix(&link.r);
        let [x, y, z, w] = quaternion.coords.into();
        let values = [link.p.x, link.p.y, link.p.z, w, x, y, z];
        let mut names = Vec::new();
        // Coordinates of a free body have no variable, since loops do not depend on them.
        for (suffix, nominal) in ["x", "y", "z", "qw", "qx", "qy", "qz"].iter().zip(values) {
            let name = self.unique_name(&format!("{}_{suffix}", joint.name));
            self.coordinates.push(ImportCoordinate {
                name: name.clone(),
                variable: None,
                nominal: round_to_15_digits(nominal),
                is_driven: false,
                is_free: true,
                is_pulled: false,
            });
            names.push(name);
        }
        self.joints.push(ImportedJoint {
            name: joint.name.clone(),
            coordinates: names.clone(),
            ratio: 1.0,
            offset: 0.0,
            axes: "wxyz".to_owned(),
        });
        let list: Vec<String> = names.iter().map(|name| format!("\"{name}\"")).collect();
        let text = format!("free = [{}], quaternion = \"wxyz\", twist = \"mixed\"", list.join(", "));
        // A free body has no joint at which these could act.
        if joint.damping != 0.0 || joint.armature != 0.0 || joint.friction != 0.0 || joint.stiffness != 0.0 {
            self.remarks.push(message!(
                "line {}: damping, friction, spring and armature of the free joint `{}` are left out",
                joint.line,
                joint.name
            ));
        }
        let frame = self.frame(own, None, *link, "", &text, Vec::new());
        (Some(frame), DescriptionPose::identity())
    }
}

/// The point of a loop closure on a link or on one that is fixed to it, in the frame of the link; none if there is
/// none.
pub(super) fn closure_point(description: &RobotDescription, index: usize) -> Option<Vector3<f64>> {
    let closures = description.closures.iter();
    let mut ends = closures.flat_map(|closure| &closure.ends);
    ends.find_map(|(end, placed)| {
        let (mut link, mut at) = ((*end)?, *placed);
        // Go up from the closure, through links that are fixed to their parents.
        while link != index {
            let DescriptionLink {
                parent,
                at: own,
                joints,
                ..
            } = &description.links[link];
            if !joints.is_empty() {
                return None;
            }
            at = own.compose(&at);
            link = (*parent)?;
        }
        Some(at.p)
    })
}

/// The expression of a coordinate plus its constant part.
fn with_offset(text: String, offset: &str) -> String {
    match (text.is_empty(), offset) {
        (true, _) => offset.to_owned(),
        (false, "0") => text,
        (false, offset) if offset.starts_with('-') => format!("{text} {offset}"),
        (false, offset) => format!("{text} + {offset}"),
    }
}

/// A ratio, without a decimal point if it is an integer.
fn plain_number(ratio: f64) -> String {
    if ratio.fract() == 0.0 {
        format!("{ratio}")
    } else {
        toml_float(ratio)
    }
}

/// Pose of the link behind a revolute or prismatic joint that is fixed, in the frame that carries it. `at` is the pose
/// of the joint's frame there, `turned` its axes in those of the link, and `moved` its distance from the pose of the
/// description, rad or m.
fn pose_behind_fixed(
    joint: &DescriptionJoint,
    at: &DescriptionPose,
    turned: &Matrix3<f64>,
    moved: f64,
) -> DescriptionPose {
    let direction = turned.transpose() * joint.axis.normalize();
    let motion = if joint.kind == DescriptionJointKind::Revolute {
        DescriptionPose {
            p: Vector3::zeros(),
            r: super::super::placed::rotation_about(&direction, moved),
        }
    } else {
        DescriptionPose {
            p: direction * moved,
            r: Matrix3::identity(),
        }
    };
    // Pose of the link in the frame: the inverse of shift and turn.
    let back = DescriptionPose {
        p: -(turned.transpose() * joint.anchor),
        r: turned.transpose(),
    };
    at.compose(&motion).compose(&back)
}
