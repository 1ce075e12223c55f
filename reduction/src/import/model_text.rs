//! A description as the text of a model file.
//!
//! Every movable joint becomes a frame; links behind fixed joints become part of the link that carries them; each body gets
//! the ten linear parameters about its frame.

mod lines;

use std::fmt::Write as _;

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, Remedy};
use nalgebra::{Matrix3, Vector3};

use super::chain::{ChainFrame, ChainMotion, CoincidentPair, FrameChain};
use super::closing::{self, LoopSolution, RANGE_TOLERANCE};
use super::couplings::{self, ImportCouplings, JointFollower};
use super::description::{
    ClosureConstraint, DescriptionClosure, DescriptionJoint, DescriptionJointKind, DescriptionLink,
    RobotDescription,
};
use super::placed::{DescriptionPose, named_axis, roll_pitch_yaw, twelfths_of_pi};
use super::{DescriptionImport, ImportedJoint, Options};
use crate::write::{significant_digits, toml_float, toml_string};
use lines::{NamedDriveLine, relative_variables};

/// Angles this near to a multiple of a twelfth of pi are taken for it where the option asks for it, rad.
const SAME_ANGLE: f64 = 1e-4;
/// Deviations below this are rounding: a right angle is often written with eleven digits behind the point, and forces that
/// differ by that share of theirs are the same. Kept, such deviations would make base parameters of nothing but rounding.
const ROUNDING: f64 = 2e-11;
/// Points by which closures hold orientations stand this far from their origins, m.
const ORIENTATION_ARM: f64 = 0.1;

/// A body of the model.
struct ImportBody {
    frame: usize,
    mass: f64,
    moment: Vector3<f64>,
    /// About the frame's origin.
    inertia: Matrix3<f64>,
}

/// A coordinate of the model.
struct ImportCoordinate {
    name: String,
    /// None for those of a free body.
    variable: Option<usize>,
    nominal: f64,
    is_driven: bool,
    /// Whether the format wants to know that nothing drives it.
    is_free: bool,
    /// Whether a line moves it, as far as the count of drives goes.
    is_pulled: bool,
}

/// What acts at a variable, added up over the joints that it moves.
#[derive(Default, Clone)]
struct VariableForces {
    damping: f64,
    friction: f64,
    armature: f64,
    stiffness: f64,
    /// Stiffness times the place of rest.
    pull: f64,
    range: Option<[f64; 2]>,
    rate: Option<f64>,
    force: Option<[f64; 2]>,
}

struct ModelTextBuilder<'a> {
    options: &'a Options<'a>,
    couplings: ImportCouplings,
    /// Names that are taken.
    names: Vec<String>,
    remarks: Vec<Message>,
    constants: String,
    /// Constants that are angles, with their values.
    angles: Vec<(String, f64)>,
    /// Coordinates that follow others.
    followers: String,
    frames: String,
    frame_names: Vec<String>,
    chain: FrameChain,
    /// Frame that carries each link, and where the link is in it.
    links: Vec<(Option<usize>, DescriptionPose)>,
    coordinates: Vec<ImportCoordinate>,
    /// Index into `coordinates` of each variable.
    of_variable: Vec<Option<usize>>,
    acts: Vec<VariableForces>,
    /// Rank of each variable when independent ones are chosen; low ones stay independent.
    reluctance: Vec<u8>,
    start: Vec<f64>,
    bodies: Vec<ImportBody>,
    joints: Vec<ImportedJoint>,
    /// Whether there are more drives than freedoms: such have no effects of their own.
    has_surplus: bool,
}

/// Makes the model file of a description.
pub(crate) fn model_text(
    mut description: RobotDescription,
    options: &Options,
) -> Result<DescriptionImport, String> {
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
    for (k, variable) in build.couplings.variables.iter().enumerate() {
        build.reluctance[k] = u8::from(!variable.is_driven) * 2;
    }
    for index in 0..description.links.len() {
        build.link(&description, index)?;
    }
    if build.coordinates.is_empty() {
        return Err("this robot has no joint that moves".to_owned());
    }
    // What a line pulls had better be independent.
    for line in &description.straight_drives {
        for variable in relative_variables(&build.chain, build.frames_of(line)) {
            build.reluctance[variable] = build.reluctance[variable].min(1);
        }
    }
    let closed = build.close(&description)?;
    let lines = build.assign_coordinates(&description.straight_drives, closed.as_ref());
    Ok(build.finish(&description, closed.as_ref(), &lines))
}

impl ModelTextBuilder<'_> {
    /// Adds the frames of a link's joints and what it weighs.
    fn link(&mut self, description: &RobotDescription, index: usize) -> Result<(), String> {
        let link = &description.links[index];
        let (mut frame, carried) = link
            .parent
            .map_or((None, DescriptionPose::identity()), |parent| {
                self.links[parent]
            });
        let mut here = carried.compose(&link.at);
        let n = link.joints.len();
        for (k, joint) in link.joints.iter().enumerate() {
            let name = if k + 1 == n {
                link.name.clone()
            } else {
                format!("{}_{}", link.name, joint.name)
            };
            let tip = closure_point(description, index).map(|tip| tip - joint.anchor);
            (frame, here) = match joint.kind {
                DescriptionJointKind::Free => self.add_free_joint(joint, &here, &name),
                DescriptionJointKind::Ball => self.add_ball_joint(joint, frame, &here, &name, tip),
                DescriptionJointKind::Revolute | DescriptionJointKind::Prismatic => {
                    self.add_scalar_joint(description, joint, frame, &here, &name)?
                }
            };
        }
        self.links.push((frame, here));
        self.add_inertia(link, frame, &here)
    }

    /// The frame of a joint that turns or slides; also where the link is in it.
    #[allow(clippy::too_many_lines, reason = "one frame, piece by piece")]
    fn add_scalar_joint(
        &mut self,
        description: &RobotDescription,
        joint: &DescriptionJoint,
        on: Option<usize>,
        link: &DescriptionPose,
        name: &str,
    ) -> Result<(Option<usize>, DescriptionPose), String> {
        let (axis, turned) = named_axis(&joint.axis).ok_or_else(|| {
            format!(
                "line {}: the axis of `{}` has no direction",
                joint.line, joint.name
            )
        })?;
        let at = DescriptionPose {
            p: link.p + link.r * joint.anchor,
            r: link.r * turned,
        };
        let follows = self.couplings.find_follower(&joint.name).ok_or_else(|| {
            format!(
                "line {}: two joints are called `{}`",
                joint.line, joint.name
            )
        })?;
        let is_turn = joint.kind == DescriptionJointKind::Revolute;
        // Ratio, number of the variable and its name.
        let moved = follows.variable.map(|variable| {
            let coordinate = self.variable(variable);
            self.add_joint_forces(description, joint, variable, follows.ratio, follows.offset);
            (follows.ratio, coordinate)
        });
        let constant = follows.offset - joint.zero;
        let shown = self.transform_text(&joint.name, &at);
        let follower = moved
            .as_ref()
            .filter(|_| follows.has_own)
            .map(|(_, leader)| self.follower(joint, leader, &follows));
        let own = self.unique_name(name);
        let text = match (&follower, &moved) {
            (Some(follower), _) => follower.clone(),
            (None, None) => String::new(),
            (None, Some((1.0, name))) => name.clone(),
            (None, Some((-1.0, name))) => format!("-{name}"),
            (None, Some((ratio, name))) => format!("{}*{name}", plain_number(*ratio)),
        };
        // What follows has its offset in its own coordinate.
        let left = if follower.is_some() {
            -joint.zero
        } else {
            constant
        };
        let offset = self.offset(&format!("{}_zero", joint.name), left, joint);
        let text = with_offset(text, &offset);
        let kind = if is_turn { "revolute" } else { "prismatic" };
        let axis_text = if axis == "z" {
            String::new()
        } else {
            format!(", axis = \"{axis}\"")
        };
        let joint_text = if moved.is_some() {
            format!("{kind} = \"{text}\"{axis_text}")
        } else {
            self.remarks.push(message!(
                "line {}: `{}` is held at {} by a coupling",
                joint.line,
                joint.name,
                follows.offset
            ));
            String::new()
        };
        let direction = turned.transpose() * joint.axis.normalize();
        let motion = ChainMotion {
            is_turn,
            axis: direction,
            variable: follows.variable,
            ratio: follows.ratio,
            offset: constant,
        };
        let back = DescriptionPose {
            p: -(turned.transpose() * joint.anchor),
            r: turned.transpose(),
        };
        if moved.is_none() {
            // A joint that is held is a fixed place.
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

    /// A fixed part of a joint's angle or length.
    fn offset(&mut self, name: &str, value: f64, joint: &DescriptionJoint) -> String {
        let text = if joint.kind == DescriptionJointKind::Revolute {
            self.angle(name, value, &joint.name)
        } else {
            self.length(name, value)
        };
        text.trim_matches('"').to_owned()
    }

    /// The coordinate of a joint that follows another coordinate.
    fn follower(
        &mut self,
        joint: &DescriptionJoint,
        leader: &str,
        follows: &JointFollower,
    ) -> String {
        let own = self.unique_name(&joint.name);
        let offset = self.offset(&format!("{}_offset", joint.name), follows.offset, joint);
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

    /// The coordinate of a variable, made when it is first met.
    fn variable(&mut self, variable: usize) -> String {
        if let Some(k) = self.of_variable[variable] {
            return self.coordinates[k].name.clone();
        }
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

    /// Adds up what acts at a joint.
    fn add_joint_forces(
        &mut self,
        description: &RobotDescription,
        joint: &DescriptionJoint,
        variable: usize,
        ratio: f64,
        offset: f64,
    ) {
        let acts = &mut self.acts[variable];
        acts.damping += ratio * ratio * joint.damping;
        acts.friction += ratio.abs() * joint.friction;
        acts.armature += ratio * ratio * joint.armature;
        let stiffness = ratio * ratio * joint.stiffness;
        acts.stiffness += stiffness;
        acts.pull += stiffness * (joint.rest - offset) / ratio;
        if stiffness != 0.0 && self.reluctance[variable] == 2 {
            self.reluctance[variable] = 1;
        }
        if let Some(range) = joint.range {
            let mut ends = range.map(|end| (end - offset) / ratio);
            ends.sort_by(f64::total_cmp);
            acts.range = Some(
                acts.range
                    .map_or(ends, |old| [old[0].max(ends[0]), old[1].min(ends[1])]),
            );
        }
        if let Some(rate) = joint.rate {
            let rate = rate / ratio.abs();
            acts.rate = Some(acts.rate.map_or(rate, |old| old.min(rate)));
        }
        let is_leader = self.couplings.variables[variable].joint == joint.name;
        if is_leader {
            acts.force = joint.force.map(|force| force.map(|force| force * ratio));
        }
        let given = description
            .pose
            .iter()
            .find(|(name, _)| name == &joint.name);
        match given {
            Some((_, value)) if is_leader => self.start[variable] = (value - offset) / ratio,
            None if is_leader => self.start[variable] = (joint.zero - offset) / ratio,
            _ => {}
        }
    }

    /// A ball joint as three angles, the last about the axis along which the link is longest.
    fn add_ball_joint(
        &mut self,
        joint: &DescriptionJoint,
        on: Option<usize>,
        link: &DescriptionPose,
        name: &str,
        tip: Option<Vector3<f64>>,
    ) -> (Option<usize>, DescriptionPose) {
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
        for (k, letter) in axes.chars().enumerate() {
            let variable = self.chain.n_variables;
            self.chain.n_variables += 1;
            let coordinate = self.unique_name(&format!("{}_{letter}", joint.name));
            self.of_variable.push(Some(self.coordinates.len()));
            self.acts.push(VariableForces::default());
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
            "line {}: the ball joint `{}` has three angles here, about {axes} one after the other, which are singular where \
             the second is a right angle",
            joint.line, joint.name
        ));
        if joint.damping != 0.0
            || joint.friction != 0.0
            || joint.stiffness != 0.0
            || joint.armature != 0.0
        {
            self.remarks.push(message!(
                "line {}: damping, friction, spring and armature of the ball joint `{}` are left out",
                joint.line, joint.name
            ));
        }
        self.joints.push(ImportedJoint {
            name: joint.name.clone(),
            coordinates: names.clone(),
            ratio: 1.0,
            offset: 0.0,
            axes: axes.to_owned(),
        });
        let list: Vec<String> = names.iter().map(|name| format!("\"{name}\"")).collect();
        let text = format!("spherical = [{}], axes = \"{axes}\"", list.join(", "));
        let frame = self.frame(own, on, at, &shown, &text, moves);
        let back = DescriptionPose {
            p: -joint.anchor,
            r: Matrix3::identity(),
        };
        (Some(frame), back)
    }

    /// A body that hangs on nothing.
    fn add_free_joint(
        &mut self,
        joint: &DescriptionJoint,
        link: &DescriptionPose,
        name: &str,
    ) -> (Option<usize>, DescriptionPose) {
        let own = self.unique_name(name);
        let quaternion = nalgebra::UnitQuaternion::from_matrix(&link.r);
        let [x, y, z, w] = quaternion.coords.into();
        let values = [link.p.x, link.p.y, link.p.z, w, x, y, z];
        let mut names = Vec::new();
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
        let text = format!(
            "free = [{}], quaternion = \"wxyz\", twist = \"mixed\"",
            list.join(", ")
        );
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

    /// `transform` of a frame; empty where it is where its parent is.
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
        for (key, values) in [("xyz", xyz), ("rpy", rpy)] {
            if values.iter().any(|value| value != "0") {
                parts.push(format!("{key} = [{}]", values.join(", ")));
            }
        }
        parts.join(", ")
    }

    fn frame(
        &mut self,
        name: String,
        on: Option<usize>,
        at: DescriptionPose,
        place: &str,
        joint: &str,
        moves: Vec<ChainMotion>,
    ) -> usize {
        let parent = on.map_or("base", |on| self.frame_names[on].as_str());
        let _ = write!(
            self.frames,
            "\n[[frame]]\nname = \"{name}\"\non = \"{parent}\"\n"
        );
        if !place.is_empty() || joint.is_empty() {
            let _ = writeln!(self.frames, "transform = {{ {place} }}");
        }
        if !joint.is_empty() {
            let _ = writeln!(self.frames, "joint = {{ {joint} }}");
        }
        self.frame_names.push(name);
        self.chain.nodes.push(ChainFrame { on, at, moves });
        self.chain.nodes.len() - 1
    }

    /// Puts a link into the body that carries it.
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
                "the mass of the link `{name}` is no number that a body can have"
            ));
        }
        if mass == 0.0 && matrix.amax() == 0.0 {
            return Ok(());
        }
        let moments = matrix.symmetric_eigenvalues();
        if moments.min() < -1e-15 * moments.amax()
            || 2.0 * moments.amax() > moments.sum() * (1.0 + 1e-6)
        {
            self.remarks.push(message!(
                "no body has the inertia of `{name}`: its principal moments are {}, {} and {} kg m^2",
                significant_digits(moments[0], 4),
                significant_digits(moments[1], 4),
                significant_digits(moments[2], 4)
            ));
        }
        let Some(frame) = frame else {
            self.remarks.push(message!(
                "`{name}` stands still; its {} kg have no effect and are left out",
                significant_digits(mass, 4)
            ));
            return Ok(());
        };
        let c = placed.p;
        let inertia = placed.r * matrix * placed.r.transpose()
            + mass * (Matrix3::identity() * c.norm_squared() - c * c.transpose());
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

    /// Closes the loops; none where there are none.
    fn close(&mut self, description: &RobotDescription) -> Result<Option<LoopSolution>, String> {
        for coordinate in &mut self.coordinates {
            let Some(variable) = coordinate.variable else {
                continue;
            };
            // Without loops the middle of the range, where zero is outside.
            coordinate.nominal = match self.acts[variable].range {
                Some([low, high]) if low < high && !(low..=high).contains(&0.0) => {
                    0.5 * (low + high)
                }
                _ => 0.0,
            };
        }
        let mut pairs = Vec::new();
        for (k, closure) in description.closures.iter().enumerate() {
            let offsets: &[[f64; 3]] = match closure.constraint {
                ClosureConstraint::Origins => &[[0.0; 3]],
                ClosureConstraint::Axes => &[[0.0; 3], [ORIENTATION_ARM, 0.0, 0.0]],
                ClosureConstraint::Frames => &[
                    [0.0; 3],
                    [ORIENTATION_ARM, 0.0, 0.0],
                    [0.0, ORIENTATION_ARM, 0.0],
                ],
            };
            for offset in offsets {
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
        let ranges: Vec<Option<[f64; 2]>> = self
            .acts
            .iter()
            .map(|acts| acts.range.filter(|[low, high]| low < high))
            .collect();
        let closed =
            closing::close_loops(&self.chain, &pairs, &self.start, &ranges, &self.reluctance)?;
        for coordinate in &mut self.coordinates {
            let Some(variable) = coordinate.variable else {
                continue;
            };
            coordinate.nominal = closed.values[variable];
            let Some([low, high]) = ranges[variable] else {
                continue;
            };
            if (low - RANGE_TOLERANCE..=high + RANGE_TOLERANCE).contains(&coordinate.nominal) {
                coordinate.nominal = coordinate.nominal.clamp(low, high);
            } else {
                self.acts[variable].range = None;
                self.remarks.push(message!(
                    "no pose was found at which the loops close within all limits: the range of `{}`, {low} to {high}, is left out",
                    coordinate.name
                ));
            }
        }
        if closed.is_moved {
            self.remarks.push(
                "at the pose of the description the loops are open or singular; nominal values are those of another pose"
                    .into(),
            );
        }
        let [conditions, independent] = closed.conditions;
        if conditions > independent {
            self.remarks.push(message!(
                "of {conditions} conditions of its loops {independent} are independent at the poses that were tried; where the others \
                 are not recognised as following from these, a model keeps too many base parameters or counts poses as singular: \
                 hold some forces against another program before you rely on it"
            ));
        }
        if let Some(gap) = closed.gap {
            self.remarks.push(message!(
                "the digits of the description close its loops to {} of their size only; points were moved by that to meet at the \
                 nominal pose",
                significant_digits(gap, 2)
            ));
        }
        Ok(Some(closed))
    }

    /// Fails where a loop would act between a free body and something else.
    fn check_free_ends(
        &self,
        closure: &DescriptionClosure,
        ends: [Option<usize>; 2],
    ) -> Result<(), String> {
        let roots = ends.map(|mut frame| {
            let mut root = None;
            while let Some(k) = frame {
                root = Some(k);
                frame = self.chain.nodes[k].on;
            }
            root.filter(|root| {
                let name = &self.frame_names[*root];
                self.frames.split("\n[[frame]]\n").any(|text| {
                    text.starts_with(&format!("name = \"{name}\"\n")) && text.contains("{ free = ")
                })
            })
        });
        if roots[0] == roots[1] {
            return Ok(());
        }
        Err(format!(
            "line {}: the closure `{}` holds a free body to the world or to another body; models close loops within one \
             free body only",
            closure.line, closure.name
        ))
    }

    /// A name that the format takes and nothing else has.
    fn unique_name(&mut self, wanted: &str) -> String {
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

    /// A length as a constant of its own.
    fn length(&mut self, name: &str, value: f64) -> String {
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

    /// A fixed angle: a multiple of a twelfth of pi, or a constant of its own.
    fn angle(&mut self, name: &str, value: f64, joint: &str) -> String {
        let twelfth = std::f64::consts::PI / 12.0;
        let n = (value / twelfth).round();
        let deviation = (value - n * twelfth).abs();
        let same = if self.options.round_angles {
            SAME_ANGLE
        } else {
            ROUNDING
        };
        if deviation < SAME_ANGLE && deviation > ROUNDING && n.abs() <= 48.0 {
            let short = significant_digits(deviation, 2);
            self.remarks.push(if self.options.round_angles {
                message!(
                    "an angle of `{joint}`, {value} rad, is taken for {}; it differs by {short} rad",
                    twelfths_of_pi(n)
                )
            } else {
                message!(
                    "an angle of `{joint}`, {value} rad, stays as it is; {}, from which it differs by {short} rad, makes shorter \
                     equations: {} takes it for that",
                    twelfths_of_pi(n),
                    Remedy::option(OptionName::RoundAngles)
                )
            });
        }
        if deviation < same && n.abs() <= 48.0 {
            let text = twelfths_of_pi(n);
            return if text == "0" {
                text
            } else {
                format!("\"{text}\"")
            };
        }
        // Angles that differ by known ones, such as those of fingers that face each other, are so in symbols too.
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

    fn finish(
        mut self,
        description: &RobotDescription,
        closed: Option<&LoopSolution>,
        lines: &[NamedDriveLine<'_>],
    ) -> DescriptionImport {
        let robot = &description.name;
        let gravity = description.gravity.unwrap_or(Vector3::new(0.0, 0.0, -9.81));
        let mut text = format!(
            "# Made from {} by modelmill import: a starting point, to be read and mended.\nschema = 1\nname = \"{}\"\n\
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
            "acceleration of gravity; the description does not say it"
        };
        let along_z = gravity.x == 0.0 && gravity.y == 0.0;
        if gravity.norm() == 0.0 {
            self.remarks
                .push("the description says that there is no gravity".into());
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
        let is_passive = |coordinate: &ImportCoordinate| matches!((closed, coordinate.variable), (Some(closed), Some(v)) if closed.passive[v]);
        for coordinate in &self.coordinates {
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

    fn loops(
        &mut self,
        description: &RobotDescription,
        closed: Option<&LoopSolution>,
        text: &mut String,
    ) {
        let Some(closed) = closed else { return };
        let mut loops = String::new();
        for pair in &closed.pairs {
            let name = self.unique_name(&format!(
                "{}_closed",
                description.closures[pair.closure].name
            ));
            let mut points = Vec::new();
            for ((frame, at), letter) in pair.ends.iter().zip(["a", "b"]) {
                let point = self.unique_name(&format!("{name}_{letter}"));
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

    fn parts(&self, text: &mut String) {
        for (k, body) in self.bodies.iter().enumerate() {
            let frame = &self.frame_names[body.frame];
            let suffix = if frame.len() < 32 {
                format!("_{frame}")
            } else {
                format!("_{}", k + 1)
            };
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

    /// Drives, what acts at coordinates, and limits.
    fn forces(
        &mut self,
        is_passive: &dyn Fn(&ImportCoordinate) -> bool,
        lines: &[NamedDriveLine<'_>],
        text: &mut String,
    ) {
        let coordinates = std::mem::take(&mut self.coordinates);
        let (mut drives, mut effects) = (String::new(), String::new());
        let (mut ranges, mut forces) = (String::new(), String::new());
        for coordinate in &coordinates {
            let Some(variable) = coordinate.variable else {
                continue;
            };
            let acts = self.acts[variable].clone();
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
                    "`{}` is settled by loops and couplings; it has no drive of its own here",
                    coordinate.name
                ));
            }
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
                if kind == "spring" {
                    let _ = writeln!(
                        effects,
                        "constants = {{ rest = {} }}",
                        toml_float(acts.pull / value)
                    );
                }
            }
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
            if let Some([low, high]) = acts.force.filter(|[low, high]| has_drive && low < high) {
                let _ = writeln!(
                    forces,
                    "{place} = {{ force = [{}, {}] }}",
                    toml_float(low),
                    toml_float(high)
                );
            }
        }
        self.line_forces(lines, [&mut drives, &mut effects, &mut forces]);
        text.push_str(&drives);
        text.push_str(&effects);
        for (table, entries) in [("coordinates", ranges), ("drives", forces)] {
            if !entries.is_empty() {
                let _ = write!(text, "\n[limits.{table}]\n{entries}");
            }
        }
    }
}

/// Where a link, or one that is fixed to it, is closed to others, in the frame of the link.
fn closure_point(description: &RobotDescription, index: usize) -> Option<Vector3<f64>> {
    let closures = description.closures.iter();
    let mut ends = closures.flat_map(|closure| &closure.ends);
    ends.find_map(|(end, placed)| {
        let (mut link, mut at) = ((*end)?, *placed);
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

/// Fifteen significant digits: what follows is rounding of sums.
fn round_to_15_digits(value: f64) -> f64 {
    format!("{value:.14e}").parse().unwrap_or(value)
}

/// A coordinate's expression with its fixed part behind it.
fn with_offset(text: String, offset: &str) -> String {
    match (text.is_empty(), offset) {
        (true, _) => offset.to_owned(),
        (false, "0") => text,
        (false, offset) if offset.starts_with('-') => format!("{text} {offset}"),
        (false, offset) => format!("{text} + {offset}"),
    }
}

/// A ratio without a point where it is whole.
fn plain_number(ratio: f64) -> String {
    if ratio.fract() == 0.0 {
        format!("{ratio}")
    } else {
        toml_float(ratio)
    }
}

/// The name of a model: an identifier in small letters.
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
