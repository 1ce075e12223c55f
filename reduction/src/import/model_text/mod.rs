//! Writes the model file of a robot description: a description with cut loops goes in, the text with remarks comes out.
//!
//! Every movable joint becomes a frame. Links with fixed joints are merged into the link that carries them. Each body
//! gets the ten linear parameters about its frame.

mod lines;

use std::fmt::Write as _;

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, Remedy};
use nalgebra::{Matrix3, Vector3};

use super::chain::{ChainFrame, ChainMotion, CoincidentPair, FrameChain};
use super::closing::{self, LoopSolution, RANGE_TOLERANCE};
use super::couplings::{self, ImportCouplings, JointFollower};
use super::description::{
    ClosureConstraint, DescriptionClosure, DescriptionJoint, DescriptionJointKind, DescriptionLink, RobotDescription,
};
use super::placed::{DescriptionPose, named_axis, roll_pitch_yaw, twelfths_of_pi};
use super::{DescriptionImport, ImportedJoint, Options};
use crate::write::{significant_digits, toml_float, toml_string};
use lines::{NamedDriveLine, relative_variables};

/// Distance from a multiple of pi/12 up to which an angle is rounded to it, if the option `round_angles` is set, rad.
const SAME_ANGLE: f64 = 1e-4;
/// Differences from a multiple of pi/12 below this are always rounded, rad. A right angle is often written with eleven
/// decimals, and the relative effect on forces is not larger than this. If kept, such a difference would add base
/// parameters that are rounding only.
const ROUNDING: f64 = 2e-11;
/// Distance from the origin of the additional points by which closures fix orientations, m.
const ORIENTATION_ARM: f64 = 0.1;

/// A body of the model: all links that move with one frame.
struct ImportBody {
    /// Index of the frame.
    frame: usize,
    /// Mass, kg.
    mass: f64,
    /// First moment about the frame's origin, kg m.
    moment: Vector3<f64>,
    /// About the frame's origin, in its axes, kg m^2.
    inertia: Matrix3<f64>,
}

/// A coordinate of the model.
struct ImportCoordinate {
    /// Name in the model file.
    name: String,
    /// Index of its variable; none for the coordinates of a free body.
    variable: Option<usize>,
    /// Nominal value, rad or m.
    nominal: f64,
    /// Whether the description drives it.
    is_driven: bool,
    /// Whether it belongs to a free body, so that `driven = false` is not written.
    is_free: bool,
    /// Whether a straight drive is counted as its drive.
    is_pulled: bool,
}

/// Forces and limits at a variable, added up over the joints that it moves.
#[derive(Default, Clone)]
struct VariableForces {
    /// Viscous friction, N m s/rad or N s/m.
    damping: f64,
    /// Coulomb friction, N m or N.
    friction: f64,
    /// Reflected rotor inertia, kg m^2 or kg.
    armature: f64,
    /// Stiffness of springs, N m/rad or N/m.
    stiffness: f64,
    /// Sum of stiffness times relaxed position, N m or N.
    pull: f64,
    /// Limits of the position: the intersection over all joints, rad or m.
    range: Option<[f64; 2]>,
    /// Largest rate, rad/s or m/s.
    rate: Option<f64>,
    /// Limits of the drive's force, N m or N.
    force: Option<[f64; 2]>,
}

/// The model file as it is built: sections of text, the numeric kinematics, and names.
struct ModelTextBuilder<'a> {
    /// Options of the import.
    options: &'a Options<'a>,
    /// Joints as functions of variables.
    couplings: ImportCouplings,
    /// Names that are used already.
    names: Vec<String>,
    /// Remarks so far.
    remarks: Vec<Message>,
    /// Lines of `[constants]`.
    constants: String,
    /// Constants that are angles, with their values in rad.
    angles: Vec<(String, f64)>,
    /// Lines of `[coordinates]` for coordinates that follow others.
    followers: String,
    /// Tables `[[frame]]`.
    frames: String,
    /// Names of the frames, by index.
    frame_names: Vec<String>,
    /// Numeric kinematics of the same frames.
    chain: FrameChain,
    /// For each link, the frame that carries it and its pose in that frame.
    links: Vec<(Option<usize>, DescriptionPose)>,
    /// The coordinates, in the order of the file.
    coordinates: Vec<ImportCoordinate>,
    /// Index into `coordinates` of each variable.
    of_variable: Vec<Option<usize>>,
    /// Forces and limits at each variable.
    acts: Vec<VariableForces>,
    /// Reluctance of each variable to be independent; variables with low values stay independent.
    reluctance: Vec<u8>,
    /// Values of the variables from which loops are closed, rad or m.
    start: Vec<f64>,
    /// Bodies with mass.
    bodies: Vec<ImportBody>,
    /// Joints with their coordinates, for the caller.
    joints: Vec<ImportedJoint>,
    /// Whether there are more drives than degrees of freedom; then drives cannot have effects.
    has_surplus: bool,
}

/// Writes the model file of a description.
///
/// Fails if nothing moves, a mass is negative, or the loops do not close.
pub(crate) fn model_text(mut description: RobotDescription, options: &Options) -> Result<DescriptionImport, String> {
    // Joints first become variables, so that links can be written in one pass.
    let couplings = couplings::resolve(&mut description)?;
    let n = couplings.variables.len();
    let mut build = ModelTextBuilder {
        options,
        names: vec!["base".to_owned(), "g".to_owned()],
        remarks: description.remarks.drain(..).map(Message::from).collect(),
        constants: String::new(),
        angles: Vec::new(),
        followers: String::new(),
        frames: String::new(),
        frame_names: Vec::new(),
        chain: FrameChain {
            nodes: Vec::new(),
            n_variables: n,
        },
        links: Vec::new(),
        coordinates: Vec::new(),
        of_variable: vec![None; n],
        acts: vec![VariableForces::default(); n],
        reluctance: vec![0; n],
        start: vec![0.0; n],
        bodies: Vec::new(),
        joints: Vec::new(),
        has_surplus: false,
        couplings,
    };
    // Driven variables should stay independent, others become passive first.
    for (k, variable) in build.couplings.variables.iter().enumerate() {
        build.reluctance[k] = u8::from(!variable.is_driven) * 2;
    }
    // Frames, coordinates and bodies, link by link; parents stand before their children.
    for index in 0..description.links.len() {
        build.link(&description, index)?;
    }
    if build.coordinates.is_empty() {
        return Err("this robot has no joint that moves; a model needs at least one".to_owned());
    }
    // Variables that a straight drive moves should stay independent.
    for line in &description.straight_drives {
        for variable in relative_variables(&build.chain, build.frames_of(line)) {
            build.reluctance[variable] = build.reluctance[variable].min(1);
        }
    }
    // Loops decide which coordinates are passive; then drives can be assigned to the others.
    let closed = build.close(&description)?;
    let lines = build.assign_coordinates(&description.straight_drives, closed.as_ref());
    Ok(build.finish(&description, closed.as_ref(), &lines))
}

impl ModelTextBuilder<'_> {
    /// Adds the frames of a link's joints, and its mass and inertia.
    fn link(&mut self, description: &RobotDescription, index: usize) -> Result<(), String> {
        let link = &description.links[index];
        // The frame that carries the parent, and the pose of the parent in it.
        let (mut frame, carried) = link
            .parent
            .map_or((None, DescriptionPose::identity()), |parent| self.links[parent]);
        let mut here = carried.compose(&link.at);
        let n = link.joints.len();
        for (k, joint) in link.joints.iter().enumerate() {
            // The last frame of a link has the link's name, the ones before also that of their joint.
            let name = if k + 1 == n {
                link.name.clone()
            } else {
                format!("{}_{}", link.name, joint.name)
            };
            // Position of a closure on this link relative to the joint, for the choice of angles of a ball joint.
            let tip = closure_point(description, index).map(|tip| tip - joint.anchor);
            (frame, here) = match joint.kind {
                DescriptionJointKind::Free => self.add_free_joint(joint, &here, &name),
                DescriptionJointKind::Ball => self.add_ball_joint(joint, frame, &here, &name, tip),
                DescriptionJointKind::Revolute | DescriptionJointKind::Prismatic => {
                    self.add_scalar_joint(description, joint, frame, &here, &name)?
                }
            };
        }
        // The link is fixed to the frame of its last joint.
        self.links.push((frame, here));
        self.add_inertia(link, frame, &here)
    }

    /// Adds the frame of a revolute or prismatic joint. Returns the frame and the pose of the link in it.
    #[allow(clippy::too_many_lines, reason = "one frame, piece by piece")]
    fn add_scalar_joint(
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
        // Ratio and name of the coordinate; none if a coupling fixes the joint.
        let moved = follows.variable.map(|variable| {
            let coordinate = self.variable(variable);
            self.add_joint_forces(description, joint, variable, follows.ratio, follows.offset);
            (follows.ratio, coordinate)
        });
        // Coordinates of the description are `zero` at the pose in which links are given.
        let constant = follows.offset - joint.zero;
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
        // The `joint` of the frame; a joint that a coupling fixes has none.
        let joint_text = if moved.is_some() {
            format!("{kind} = \"{text}\"{axis_text}")
        } else {
            self.remarks.push(message!(
                "line {}: a coupling fixes `{}` at {}",
                joint.line,
                joint.name,
                follows.offset
            ));
            String::new()
        };
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
        if moved.is_none() {
            // A fixed joint becomes a frame with a constant transform.
            let held = DescriptionPose {
                p: if is_turn {
                    Vector3::zeros()
                } else {
                    direction * constant
                },
                r: if is_turn {
                    super::placed::rotation_about(&direction, constant)
                } else {
                    Matrix3::identity()
                },
            };
            let at = at.compose(&held);
            let shown = self.transform_text(&format!("{}_held", joint.name), &at);
            let frame = self.frame(own, on, at, &shown, "", Vec::new());
            return Ok((Some(frame), back));
        }
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
        if let Some(range) = joint.range {
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
        let is_leader = self.couplings.variables[variable].joint == joint.name;
        if is_leader {
            acts.force = joint.force.map(|force| force.map(|force| force * ratio));
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
    fn add_ball_joint(
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
        if joint.damping != 0.0 || joint.friction != 0.0 || joint.stiffness != 0.0 || joint.armature != 0.0 {
            self.remarks.push(message!(
                "line {}: damping, friction, spring and armature of the ball joint `{}` are left out",
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
    fn add_free_joint(
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
        if joint.damping != 0.0 || joint.armature != 0.0 || joint.friction != 0.0 {
            self.remarks.push(message!(
                "line {}: damping, friction and armature of the free joint `{}` are left out",
                joint.line,
                joint.name
            ));
        }
        let frame = self.frame(own, None, *link, "", &text, Vec::new());
        (Some(frame), DescriptionPose::identity())
    }

    /// The contents of `transform` of a frame; empty if it coincides with its parent.
    fn transform_text(&mut self, joint: &str, at: &DescriptionPose) -> String {
        let mut parts = Vec::new();
        let xyz: Vec<String> = ["x", "y", "z"]
            .iter()
            .zip(at.p.iter())
            .map(|(axis, value)| self.length(&format!("{joint}_{axis}"), *value))
            .collect();
        let rpy: Vec<String> = ["roll", "pitch", "yaw"]
            .iter()
            .zip(roll_pitch_yaw(&at.r))
            .map(|(angle, value)| self.angle(&format!("{joint}_{angle}"), value, joint))
            .collect();
        // Zeros are the default of both.
        for (key, values) in [("xyz", xyz), ("rpy", rpy)] {
            if values.iter().any(|value| value != "0") {
                parts.push(format!("{key} = [{}]", values.join(", ")));
            }
        }
        parts.join(", ")
    }

    /// Writes a frame and adds it to the numeric kinematics. Returns its index.
    fn frame(
        &mut self,
        name: String,
        on: Option<usize>,
        at: DescriptionPose,
        place: &str,
        joint: &str,
        moves: Vec<ChainMotion>,
    ) -> usize {
        // The table of the model file.
        let parent = on.map_or("base", |on| self.frame_names[on].as_str());
        let _ = write!(self.frames, "\n[[frame]]\nname = \"{name}\"\non = \"{parent}\"\n");
        if !place.is_empty() || joint.is_empty() {
            let _ = writeln!(self.frames, "transform = {{ {place} }}");
        }
        if !joint.is_empty() {
            let _ = writeln!(self.frames, "joint = {{ {joint} }}");
        }
        // The same frame in the numeric kinematics.
        self.frame_names.push(name);
        self.chain.nodes.push(ChainFrame { on, at, moves });
        self.chain.nodes.len() - 1
    }

    /// Adds mass and inertia of a link to the body of its frame.
    fn add_inertia(
        &mut self,
        link: &DescriptionLink,
        frame: Option<usize>,
        at: &DescriptionPose,
    ) -> Result<(), String> {
        let (name, mass, matrix) = (&link.name, link.inertial.mass, link.inertial.inertia);
        let placed = at.compose(&link.inertial.at);
        if mass < 0.0 {
            return Err(format!(
                "the mass of the link `{name}` is negative; correct it in the description"
            ));
        }
        // Links without mass have no body.
        if mass == 0.0 && matrix.amax() == 0.0 {
            return Ok(());
        }
        // Principal moments of a body are positive and satisfy the triangle inequality.
        let moments = matrix.symmetric_eigenvalues();
        if moments.min() < -1e-15 * moments.amax() || 2.0 * moments.amax() > moments.sum() * (1.0 + 1e-6) {
            self.remarks.push(message!(
                "the inertia of `{name}` is impossible for a body: its principal moments are {}, {} and {} kg m^2",
                significant_digits(moments[0], 4),
                significant_digits(moments[1], 4),
                significant_digits(moments[2], 4)
            ));
        }
        // A link without a frame is fixed to the base.
        let Some(frame) = frame else {
            self.remarks.push(message!(
                "`{name}` does not move; its {} kg have no effect and are left out",
                significant_digits(mass, 4)
            ));
            return Ok(());
        };
        // Rotate into the axes of the frame and shift to its origin (Steiner).
        let c = placed.p;
        let inertia = placed.r * matrix * placed.r.transpose()
            + mass * (Matrix3::identity() * c.norm_squared() - c * c.transpose());
        // All links of a frame are one body.
        if self.bodies.iter().all(|body| body.frame != frame) {
            self.bodies.push(ImportBody {
                frame,
                mass: 0.0,
                moment: Vector3::zeros(),
                inertia: Matrix3::zeros(),
            });
        }
        if let Some(body) = self.bodies.iter_mut().find(|body| body.frame == frame) {
            body.mass += mass;
            body.moment += mass * c;
            body.inertia += inertia;
        }
        Ok(())
    }

    /// Closes the loops and sets the nominal values; none without loops.
    fn close(&mut self, description: &RobotDescription) -> Result<Option<LoopSolution>, String> {
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

    /// A valid and unique name: invalid characters become `_`, and a number is added to a name that is used already.
    fn unique_name(&mut self, wanted: &str) -> String {
        // Names have at most 40 characters before a number is added.
        let mut name: String = wanted
            .chars()
            .take(40)
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
            .collect();
        if !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
            name.insert_str(0, "n_");
        }
        let stem = name.clone();
        let mut n = 1;
        while self.names.contains(&name) {
            n += 1;
            name = format!("{stem}_{n}");
        }
        self.names.push(name.clone());
        name
    }

    /// A length in m as a new constant, in quotes; `0` below rounding.
    fn length(&mut self, name: &str, value: f64) -> String {
        // Lengths below a picometre are rounding.
        if value.abs() < 1e-12 {
            return "0".to_owned();
        }
        let name = self.unique_name(name);
        let _ = writeln!(
            self.constants,
            "{name} = {{ value = {}, unit = \"m\" }}",
            toml_float(round_to_15_digits((value * 1e13).round() / 1e13))
        );
        format!("\"{name}\"")
    }

    /// A constant angle in rad, in quotes: a multiple of pi/12, the sum of one and a known constant, or a new constant.
    fn angle(&mut self, name: &str, value: f64, joint: &str) -> String {
        // The nearest multiple of 15 degrees, up to two turns.
        let twelfth = std::f64::consts::PI / 12.0;
        let n = (value / twelfth).round();
        let deviation = (value - n * twelfth).abs();
        let same = if self.options.round_angles {
            SAME_ANGLE
        } else {
            ROUNDING
        };
        // Angles close to it are reported, whether they are rounded or not.
        if deviation < SAME_ANGLE && deviation > ROUNDING && n.abs() <= 48.0 {
            let short = significant_digits(deviation, 2);
            self.remarks.push(if self.options.round_angles {
                message!(
                    "an angle of `{joint}`, {value} rad, is rounded to {} (difference {short} rad)",
                    twelfths_of_pi(n)
                )
            } else {
                message!(
                    "an angle of `{joint}`, {value} rad, is not rounded to {} (difference {short} rad); rounding gives shorter \
                     equations: use {}",
                    twelfths_of_pi(n),
                    Remedy::option(OptionName::RoundAngles)
                )
            });
        }
        if deviation < same && n.abs() <= 48.0 {
            let text = twelfths_of_pi(n);
            return if text == "0" { text } else { format!("\"{text}\"") };
        }
        // An angle that differs from a known one by a multiple of pi/12, as in fingers that face each other, is written
        // as this sum.
        for (known, of) in &self.angles {
            for (sign, minus) in [(1.0, ""), (-1.0, "-")] {
                let rest = value - sign * of;
                let n = (rest / twelfth).round();
                if (rest - n * twelfth).abs() < ROUNDING && n.abs() <= 48.0 {
                    let more = twelfths_of_pi(n);
                    return match more.strip_prefix('-') {
                        _ if more == "0" => format!("\"{minus}{known}\""),
                        Some(less) => format!("\"{minus}{known} - {less}\""),
                        None => format!("\"{minus}{known} + {more}\""),
                    };
                }
            }
        }
        let name = self.unique_name(name);
        let _ = writeln!(
            self.constants,
            "{name} = {{ value = {}, unit = \"rad\" }}",
            toml_float(round_to_15_digits(value))
        );
        self.angles.push((name.clone(), round_to_15_digits(value)));
        format!("\"{name}\"")
    }

    /// Joins all sections to the text of the model file.
    fn finish(
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
            remarks: self.remarks,
            joints: self.joints,
        }
    }

    /// Writes the points and loops of the independent closures.
    fn loops(&mut self, description: &RobotDescription, closed: Option<&LoopSolution>, text: &mut String) {
        let Some(closed) = closed else { return };
        let mut loops = String::new();
        // Each pair is a loop between two points.
        for pair in &closed.pairs {
            let name = self.unique_name(&format!("{}_closed", description.closures[pair.closure].name));
            let mut points = Vec::new();
            for ((frame, at), letter) in pair.ends.iter().zip(["a", "b"]) {
                let point = self.unique_name(&format!("{name}_{letter}"));
                // The point in the frame that carries it.
                let on = frame.map_or("base", |frame| self.frame_names[frame].as_str());
                let at: Vec<String> = at
                    .iter()
                    .map(|x| {
                        if x.abs() < 1e-12 {
                            "0".to_owned()
                        } else {
                            toml_float(round_to_15_digits(*x))
                        }
                    })
                    .collect();
                let _ = write!(
                    text,
                    "\n[[point]]\nname = \"{point}\"\non = \"{on}\"\nat = [{}]\n",
                    at.join(", ")
                );
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

    /// Writes the bodies with their ten linear parameters.
    fn parts(&self, text: &mut String) {
        for (k, body) in self.bodies.iter().enumerate() {
            let frame = &self.frame_names[body.frame];
            // Symbols have the name of the frame; long names are replaced by a number.
            let suffix = if frame.len() < 32 {
                format!("_{frame}")
            } else {
                format!("_{}", k + 1)
            };
            // The ten parameters about the origin of the frame.
            let (i, c) = (&body.inertia, &body.moment);
            let values = [
                ("XX", i[(0, 0)]),
                ("XY", i[(0, 1)]),
                ("XZ", i[(0, 2)]),
                ("YY", i[(1, 1)]),
                ("YZ", i[(1, 2)]),
                ("ZZ", i[(2, 2)]),
                ("MX", c.x),
                ("MY", c.y),
                ("MZ", c.z),
                ("M", body.mass),
            ];
            // Zeros are the default and are not written.
            let nominal: Vec<String> = values
                .iter()
                .filter(|(_, v)| *v != 0.0)
                .map(|(key, v)| format!("{key} = {}", toml_float(round_to_15_digits(*v))))
                .collect();
            let _ = write!(
                text,
                "\n[[part]]\nname = \"{frame}_body\"\non = \"{frame}\"\nlinear = {{ all = \"{suffix}\", nominal = {{ {} }} }}\n",
                nominal.join(", ")
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
        let (mut drives, mut effects) = (String::new(), String::new());
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
        text.push_str(&effects);
        // Tables of limits without entries are left out.
        for (table, entries) in [("coordinates", ranges), ("drives", forces)] {
            if !entries.is_empty() {
                let _ = write!(text, "\n[limits.{table}]\n{entries}");
            }
        }
    }
}

/// The point of a loop closure on a link or on one that is fixed to it, in the frame of the link; none if there is
/// none.
fn closure_point(description: &RobotDescription, index: usize) -> Option<Vector3<f64>> {
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

/// A value rounded to fifteen significant digits; further digits are rounding errors of sums.
fn round_to_15_digits(value: f64) -> f64 {
    format!("{value:.14e}").parse().unwrap_or(value)
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
