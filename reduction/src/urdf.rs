//! URDF as a starting point: a robot description of ROS goes in, the text of a model file comes out, with what was
//! left out or rounded.
//!
//! Every movable joint becomes a frame; links behind fixed joints become part of the link that carries them; each
//! body gets the ten linear parameters about its frame. Angles near multiples of a twelfth of pi are taken for these,
//! so that 1.5708 reads as the right angle that it means. Source of the format: the URDF specification of ROS
//! (wiki.ros.org/urdf/XML).

use std::fmt;
use std::fmt::Write as _;

use modelmill_boundary::files::Memory;
use nalgebra::{Matrix3, Vector3};

use crate::urdf_file::{Joint, Link, Robot, read};
use crate::urdf_geometry::{Placed, axis, roll_pitch_yaw, twelfths};
use crate::write::{digits, float, quoted};

/// A model file made from a robot description.
#[derive(Clone, Debug, PartialEq)]
pub struct Imported {
    /// The text of the model file.
    pub model: String,
    /// What was left out, rounded or made up; one sentence each.
    pub remarks: Vec<String>,
}

/// Why a robot description makes no model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UrdfError(String);

impl fmt::Display for UrdfError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for UrdfError {}

/// The longest text that is looked at, bytes.
pub const LARGEST_URDF: usize = 16 << 20;
/// Angles this near to a multiple of a twelfth of pi are taken for it, rad.
const SAME_ANGLE: f64 = 1e-4;
/// Deviations below this are rounding of the format.
const ROUNDING: f64 = 1e-9;

/// Makes a model file of a robot description.
///
/// Fails when the text is no URDF, its links form no tree, or a joint is of a kind that models do not have.
pub fn import_urdf(text: &str) -> Result<Imported, UrdfError> {
    if text.len() > LARGEST_URDF {
        return Err(UrdfError(
            "this file is too large for a robot description".to_owned(),
        ));
    }
    let robot = read(text).map_err(|error| {
        UrdfError(format!(
            "this is no URDF that can be read ({error}); expected <robot> with links and joints, with macros (xacro) \
             expanded"
        ))
    })?;
    let mut import = Import::default();
    let root = root(&robot)?;
    import.names.push("base".to_owned());
    import.link(&robot, root, None, &Placed::identity())?;
    import.tree(&robot, root)?;
    let imported = import.finish(&robot.name)?;
    match modelmill_spec::load(
        "the model made from it",
        &imported.model,
        &Memory::default(),
    ) {
        Ok(_) => Ok(imported),
        Err(failure) => Err(UrdfError(format!(
            "this description makes no sound model:\n{}",
            failure.render(false)
        ))),
    }
}

/// The link that no joint moves; all others must hang on it.
fn root(robot: &Robot) -> Result<&str, UrdfError> {
    let error = |text: String| Err(UrdfError(text));
    for (i, link) in robot.links.iter().enumerate() {
        if robot.links[..i].iter().any(|other| other.name == link.name) {
            return error(format!("two links are called `{}`; rename one", link.name));
        }
    }
    for joint in &robot.joints {
        for end in [&joint.parent, &joint.child] {
            if robot.links.iter().all(|link| &link.name != end) {
                return error(format!(
                    "the joint `{}` names the link `{end}`, which does not exist",
                    joint.name
                ));
            }
        }
    }
    let is_child = |link: &&Link| robot.joints.iter().any(|joint| joint.child == link.name);
    let mut roots = robot.links.iter().filter(|link| !is_child(link));
    match (roots.next(), roots.next()) {
        (Some(root), None) => Ok(&root.name),
        (None, _) => error("no link is the root: every link hangs on another".to_owned()),
        (Some(one), Some(two)) => error(format!(
            "the links `{}` and `{}` hang on nothing; join them to one robot",
            one.name, two.name
        )),
    }
}

/// A body of the model.
struct Body {
    frame: String,
    mass: f64,
    moment: Vector3<f64>,
    /// About the frame's origin.
    inertia: Matrix3<f64>,
}

#[derive(Default)]
struct Import {
    /// Names that are taken.
    names: Vec<String>,
    /// Links with the frame that carries them (none is the base) and where they are in it.
    links: Vec<(String, Option<String>, Placed)>,
    bodies: Vec<Body>,
    constants: Vec<String>,
    coordinates: Vec<String>,
    frames: Vec<String>,
    drives: Vec<String>,
    effects: Vec<String>,
    remarks: Vec<String>,
}

impl Import {
    /// Adds all links behind `root`, in the order of the file.
    fn tree(&mut self, robot: &Robot, root: &str) -> Result<(), UrdfError> {
        let mut waiting = vec![root];
        while let Some(parent) = waiting.pop() {
            let children: Vec<&Joint> = robot
                .joints
                .iter()
                .filter(|joint| joint.parent == parent)
                .collect();
            for joint in &children {
                if self.links.iter().any(|(name, _, _)| name == &joint.child) {
                    return Err(UrdfError(format!(
                        "the link `{}` hangs on two joints; URDF describes trees only",
                        joint.child
                    )));
                }
                self.joint(robot, joint)?;
            }
            waiting.extend(children.iter().rev().map(|joint| joint.child.as_str()));
        }
        match robot
            .links
            .iter()
            .find(|link| self.links.iter().all(|(name, _, _)| name != &link.name))
        {
            None => Ok(()),
            Some(link) => Err(UrdfError(format!(
                "the link `{}` is in a ring of joints that the root does not reach",
                link.name
            ))),
        }
    }

    /// Adds a joint and the link behind it.
    fn joint(&mut self, robot: &Robot, joint: &Joint) -> Result<(), UrdfError> {
        let parent = self.links.iter().find(|(name, _, _)| name == &joint.parent);
        let (frame, carried) = parent.map_or((None, Placed::identity()), |(_, frame, placed)| {
            (frame.clone(), *placed)
        });
        let origin = Placed::from_pose(&joint.origin);
        let numbers = origin
            .p
            .iter()
            .chain(joint.axis.iter())
            .chain(joint.origin.rpy.iter());
        if !numbers.copied().all(f64::is_finite) {
            return Err(UrdfError(format!(
                "a number of the joint `{}` is not finite",
                joint.name
            )));
        }
        let at = carried.then(&origin);
        let kind = match joint.kind.as_str() {
            "fixed" => return self.link(robot, &joint.child, frame, &at),
            "revolute" | "continuous" => "revolute",
            "prismatic" => "prismatic",
            other => {
                return Err(UrdfError(format!(
                    "the joint `{}` is {other}; models have revolute, continuous, prismatic and fixed joints: write it as \
                     several of these",
                    joint.name
                )));
            }
        };
        let coordinate = self.name(&joint.name);
        let own = self.name(&joint.child);
        let (axis, turned) = axis(&joint.axis).ok_or_else(|| {
            UrdfError(format!(
                "the axis of the joint `{}` has no direction",
                joint.name
            ))
        })?;
        let at = Placed {
            p: at.p,
            r: at.r * turned,
        };
        let given = if carried.r == Matrix3::identity() && turned == Matrix3::identity() {
            joint.origin.rpy
        } else {
            roll_pitch_yaw(&at.r)
        };
        let xyz: Vec<String> = ["x", "y", "z"]
            .iter()
            .zip(at.p.iter())
            .map(|(axis, value)| self.length(&format!("{coordinate}_{axis}"), *value))
            .collect();
        let rpy: Vec<String> = ["roll", "pitch", "yaw"]
            .iter()
            .zip(given)
            .map(|(angle, value)| self.angle(&format!("{coordinate}_{angle}"), value, &joint.name))
            .collect();
        let mut text = format!(
            "\n[[frame]]\nname = \"{own}\"\non = \"{}\"\n",
            frame.as_deref().unwrap_or("base")
        );
        let mut parts = Vec::new();
        for (key, values) in [("xyz", xyz), ("rpy", rpy)] {
            if values.iter().any(|value| value != "0") {
                parts.push(format!("{key} = [{}]", values.join(", ")));
            }
        }
        let _ = writeln!(text, "transform = {{ {} }}", parts.join(", "));
        let axis = if axis == "z" {
            String::new()
        } else {
            format!(", axis = \"{axis}\"")
        };
        let _ = writeln!(text, "joint = {{ {kind} = \"{coordinate}\"{axis} }}");
        self.frames.push(text);
        self.moves(joint, &coordinate);
        self.link(
            robot,
            &joint.child,
            Some(own),
            &Placed {
                p: Vector3::zeros(),
                r: turned.transpose(),
            },
        )
    }

    /// Coordinate, drive and effects of a joint.
    fn moves(&mut self, joint: &Joint, coordinate: &str) {
        let (lower, upper) = (joint.lower, joint.upper);
        let is_limited = joint.kind != "continuous" && lower < upper;
        let nominal = if is_limited && !(lower..=upper).contains(&0.0) {
            0.5 * (lower + upper)
        } else {
            0.0
        };
        self.coordinates.push(format!(
            "{coordinate} = {{ nominal = {} }}\n",
            float(nominal)
        ));
        let drive = self.name(&format!("{coordinate}_drive"));
        self.drives.push(format!(
            "\n[[drive]]\nname = \"{drive}\"\njoint = \"{coordinate}\"\n"
        ));
        if joint.is_mimic {
            self.remarks.push(format!(
                "`{}` follows another joint in the description; here it has a drive of its own",
                joint.name
            ));
        }
        for (kind, symbol, value) in [
            ("viscous_friction", "Fv", joint.damping),
            ("coulomb_friction", "Fc", joint.friction),
        ] {
            if value != 0.0 && value.is_finite() {
                self.effects.push(format!(
                    "\n[[effect]]\nkind = \"{kind}\"\nat = [\"{drive}\"]\nparameters = {{ {symbol} = {{ nominal = {} }} }}\n",
                    float(value)
                ));
            }
        }
    }

    /// Puts a link into the body that carries it.
    fn link(
        &mut self,
        robot: &Robot,
        name: &str,
        frame: Option<String>,
        at: &Placed,
    ) -> Result<(), UrdfError> {
        self.links.push((name.to_owned(), frame.clone(), *at));
        let Some(link) = robot.links.iter().find(|link| link.name == name) else {
            return Ok(());
        };
        let (mass, matrix) = (link.mass, link.inertia);
        let placed = at.then(&Placed::from_pose(&link.origin));
        if !(mass.is_finite()
            && mass >= 0.0
            && matrix
                .iter()
                .chain(placed.p.iter())
                .all(|x: &f64| x.is_finite()))
        {
            return Err(UrdfError(format!(
                "mass or inertia of the link `{name}` is no number that a body can have"
            )));
        }
        if mass == 0.0 && matrix.amax() == 0.0 {
            return Ok(());
        }
        let moments = matrix.symmetric_eigenvalues();
        if moments.min() < 0.0 || 2.0 * moments.amax() > moments.sum() * (1.0 + 1e-6) {
            self.remarks.push(format!(
                "no body has the inertia of `{name}`: its principal moments are {}, {} and {} kg m^2",
                digits(moments[0], 4),
                digits(moments[1], 4),
                digits(moments[2], 4)
            ));
        }
        let Some(frame) = frame else {
            self.remarks.push(format!(
                "`{name}` stands still; its {} kg have no effect and are left out",
                digits(mass, 4)
            ));
            return Ok(());
        };
        let c = placed.p;
        let inertia = placed.r * matrix * placed.r.transpose()
            + mass * (Matrix3::identity() * c.norm_squared() - c * c.transpose());
        if self.bodies.iter().all(|body| body.frame != frame) {
            self.bodies.push(Body {
                frame: frame.clone(),
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

    /// A name that the format takes and nothing else has.
    fn name(&mut self, wanted: &str) -> String {
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
        let name = self.name(name);
        self.constants.push(format!(
            "{name} = {{ value = {}, unit = \"m\" }}\n",
            float(crate::draft::rounded(value))
        ));
        format!("\"{name}\"")
    }

    /// A fixed angle: a multiple of a twelfth of pi, or a constant of its own.
    fn angle(&mut self, name: &str, value: f64, joint: &str) -> String {
        let twelfth = std::f64::consts::PI / 12.0;
        let n = (value / twelfth).round();
        let deviation = (value - n * twelfth).abs();
        if deviation < SAME_ANGLE && n.abs() <= 48.0 {
            if deviation > ROUNDING {
                self.remarks.push(format!(
                    "an angle of `{joint}`, {value} rad, is taken for {}; it differs by {} rad",
                    twelfths(n),
                    digits(deviation, 2)
                ));
            }
            let text = twelfths(n);
            return if text == "0" {
                text
            } else {
                format!("\"{text}\"")
            };
        }
        let name = self.name(name);
        self.constants.push(format!(
            "{name} = {{ value = {}, unit = \"rad\" }}\n",
            float(crate::draft::rounded(value))
        ));
        format!("\"{name}\"")
    }

    fn finish(mut self, robot: &str) -> Result<Imported, UrdfError> {
        if self.coordinates.is_empty() {
            return Err(UrdfError("this robot has no joint that moves".to_owned()));
        }
        let gravity = self.name("g");
        let model_name = {
            self.names.clear();
            self.name(robot).to_lowercase()
        };
        let mut text = format!(
            "# Made from a URDF by modelmill import: a starting point, to be read and mended.\nschema = 1\nname = \"{model_name}\"\n\
             title = {}\ngravity = [0, 0, \"-{gravity}\"]\n\n[constants]\n{gravity} = {{ value = 9.81, unit = \"m/s^2\", \
             note = \"acceleration of gravity; URDF does not say it\" }}\n",
            quoted(&format!("{robot}, imported"))
        );
        text.push_str(&self.constants.concat());
        text.push_str("\n[coordinates]\n");
        text.push_str(&self.coordinates.concat());
        text.push_str(&self.frames.concat());
        for (k, body) in self.bodies.iter().enumerate() {
            let suffix = if body.frame.len() < 32 {
                format!("_{}", body.frame)
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
                .map(|(key, v)| format!("{key} = {}", float(crate::draft::rounded(*v))))
                .collect();
            let _ = write!(
                text,
                "\n[[part]]\nname = \"{0}_body\"\non = \"{0}\"\nlinear = {{ all = \"{suffix}\", nominal = {{ {1} }} }}\n",
                body.frame,
                nominal.join(", ")
            );
        }
        text.push_str(&self.drives.concat());
        text.push_str(&self.effects.concat());
        Ok(Imported {
            model: text,
            remarks: self.remarks,
        })
    }
}
