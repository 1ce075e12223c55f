//! Writes the model file of a robot description: a description with cut loops goes in, the text with remarks comes out.
//!
//! Every movable joint becomes a frame. Links with fixed joints are merged into the link that carries them. Each body
//! gets the ten linear parameters about its frame.

mod joints;
mod lines;
mod loops;
mod sections;

use std::collections::BTreeSet;
use std::fmt::Write as _;

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, Remedy};
use nalgebra::{Matrix3, Vector3};

use self::joints::closure_point;
use self::lines::relative_variables;
use super::chain::{ChainFrame, ChainMotion, FrameChain};
use super::couplings::{self, ImportCouplings};
use super::description::{DescriptionJointKind, DescriptionLink, JointServo, RobotDescription};
use super::placed::{DescriptionPose, roll_pitch_yaw, twelfths_of_pi};
use super::{DescriptionImport, ImportedJoint, Options};
use crate::write::{significant_digits, toml_float};

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
    /// The controller of the drive.
    servo: Option<JointServo>,
}

/// The model file as it is built: sections of text, the numeric kinematics, and names.
struct ModelTextBuilder<'a> {
    /// Options of the import.
    options: &'a Options<'a>,
    /// Joints as functions of variables.
    couplings: ImportCouplings,
    /// Names that are used already.
    names: BTreeSet<String>,
    /// Remarks so far.
    remarks: Vec<Message>,
    /// Links that do not move, with their masses, kg.
    fixed_links: Vec<(String, f64)>,
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
        names: ["base", "g"].map(str::to_owned).into(),
        remarks: description.remarks.drain(..).map(Message::from).collect(),
        fixed_links: Vec::new(),
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
        // A link without a frame is fixed to the base.
        let Some(frame) = frame else {
            self.fixed_links.push((name.to_owned(), mass));
            return Ok(());
        };
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

    /// A valid and unique name: invalid characters become `_`, and a number is added to a name that is used already or has
    /// a meaning in expressions.
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
        while self.names.contains(&name) || modelmill_spec::is_reserved_word(&name) {
            n += 1;
            name = format!("{stem}_{n}");
        }
        self.names.insert(name.clone());
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

    /// Writes a point at a place in the frame that carries it; `None` is the base.
    fn write_point(&self, text: &mut String, name: &str, frame: Option<usize>, place: &Vector3<f64>) {
        let on = frame.map_or("base", |frame| self.frame_names[frame].as_str());
        let number = |x: &f64| match *x {
            x if x.abs() < 1e-12 => "0".to_owned(),
            x => toml_float(round_to_15_digits(x)),
        };
        let at: Vec<String> = place.iter().map(number).collect();
        let at = at.join(", ");
        let _ = write!(text, "\n[[point]]\nname = \"{name}\"\non = \"{on}\"\nat = [{at}]\n");
    }
}

/// A value rounded to fifteen significant digits; further digits are rounding errors of sums.
fn round_to_15_digits(value: f64) -> f64 {
    format!("{value:.14e}").parse().unwrap_or(value)
}
