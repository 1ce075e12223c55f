//! Writes a rig file from a robot description: bodies with their poses, joints, coordinates and drives, for a reduction to
//! a planar model.
//!
//! Decision: a closure of two points becomes a revolute joint about the axis that all joints share. The reduction is for
//! planar mechanisms, in which both are the same, and revolute joints are what its parts are connected by.

use std::fmt::Write as _;

use nalgebra::{Matrix3, Vector3};

use super::description::{
    ClosureConstraint, DescriptionInertia, DescriptionJoint, DescriptionJointKind, DescriptionLink, RobotDescription,
};
use super::placed::{DescriptionPose, roll_pitch_yaw};

/// Sines of angles between axes below this are rounding (1).
const PARALLEL: f64 = 1e-6;

/// The text of a rig file for a description. Fails with a reason.
pub(super) fn rig_text(description: &RobotDescription) -> Result<String, String> {
    if let Some(drive) = description.straight_drives.first() {
        return Err(format!(
            "line {}: the drive `{}` acts between two points; write a rig file for this mechanism",
            drive.line, drive.name
        ));
    }
    if let Some(coupling) = description.couplings.first() {
        return Err(format!(
            "line {}: the joint `{}` follows another one; write a rig file for this mechanism",
            coupling.line, coupling.joint
        ));
    }
    let places = world_poses(description);
    let carriers = carriers(description);
    let mut text = format!("schema = 1\nname = \"{}\"\n", word_of(&description.name));
    let gravity = description.gravity.unwrap_or_else(|| Vector3::new(0.0, 0.0, -9.81));
    let _ = writeln!(text, "gravity = {}", triple(&gravity));
    let mut names = BodyNames::default();
    for (k, link) in description.links.iter().enumerate() {
        // Links without a joint belong to their carrier.
        if link.joints.is_empty() {
            continue;
        }
        let name = names.add(k, &link.name);
        write_body(
            &mut text,
            &name,
            &places[k],
            &combined_inertia(description, &places, &carriers, k),
        );
    }
    let mut coordinates = String::new();
    for (k, link) in description.links.iter().enumerate() {
        let [joint] = &link.joints[..] else {
            if link.joints.is_empty() {
                continue;
            }
            return Err(format!(
                "the link `{}` has {} joints; write a rig file for this mechanism",
                link.name,
                link.joints.len()
            ));
        };
        write_joint(&mut text, &mut coordinates, joint, link, k, &places, &carriers, &names)?;
    }
    write_closures(&mut text, description, &places, &carriers, &names)?;
    Ok(text + &coordinates)
}

/// Names of bodies: words without repetition.
#[derive(Default)]
struct BodyNames(Vec<(usize, String)>);

impl BodyNames {
    /// Adds the name of a link.
    fn add(&mut self, link: usize, name: &str) -> String {
        let word = word_of(name);
        let is_taken = |name: &str| name == "base" || self.0.iter().any(|(_, known)| known == name);
        let (mut n, mut free) = (1, word.clone());
        while is_taken(&free) {
            n += 1;
            free = format!("{word}_{n}");
        }
        self.0.push((link, free.clone()));
        free
    }

    /// The name of a body, or `base`.
    fn name(&self, link: Option<usize>) -> &str {
        let found = self.0.iter().find(|(known, _)| Some(*known) == link);
        found.map_or("base", |(_, name)| name)
    }
}

/// Poses of all links in the world with the joints as the description has them.
fn world_poses(description: &RobotDescription) -> Vec<DescriptionPose> {
    let mut poses: Vec<DescriptionPose> = Vec::new();
    for link in &description.links {
        let parent = link
            .parent
            .map_or_else(DescriptionPose::identity, |parent| poses[parent]);
        poses.push(parent.compose(&link.at));
    }
    poses
}

/// For each link the nearest link with a joint that carries it, or itself; none is the world.
fn carriers(description: &RobotDescription) -> Vec<Option<usize>> {
    let mut carriers: Vec<Option<usize>> = Vec::new();
    for (k, link) in description.links.iter().enumerate() {
        let own = if link.joints.is_empty() {
            link.parent.and_then(|parent| carriers[parent])
        } else {
            Some(k)
        };
        carriers.push(own);
    }
    carriers
}

/// Mass, centre and inertia of a link and of all links that are fixed to it, in its frame.
fn combined_inertia(
    description: &RobotDescription,
    places: &[DescriptionPose],
    carriers: &[Option<usize>],
    body: usize,
) -> DescriptionInertia {
    let to_body = places[body].inverse();
    let members = (0..description.links.len()).filter(|link| carriers[*link] == Some(body));
    let parts: Vec<(f64, Vector3<f64>, Matrix3<f64>)> = members
        .map(|link| {
            let own = &description.links[link].inertial;
            let at = to_body.compose(&places[link]).compose(&own.at);
            (own.mass, at.p, at.r * own.inertia * at.r.transpose())
        })
        .collect();
    let mass: f64 = parts.iter().map(|(mass, ..)| mass).sum();
    let moment: Vector3<f64> = parts.iter().map(|(mass, centre, _)| *mass * centre).sum();
    let centre = if mass > 0.0 { moment / mass } else { Vector3::zeros() };
    let inertia = parts
        .iter()
        .map(|(mass, at, inertia)| {
            let d = at - centre;
            inertia + *mass * (Matrix3::identity() * d.norm_squared() - d * d.transpose())
        })
        .sum();
    DescriptionInertia {
        mass,
        at: DescriptionPose {
            p: centre,
            r: Matrix3::identity(),
        },
        inertia,
    }
}

/// The table of a body.
fn write_body(text: &mut String, name: &str, place: &DescriptionPose, own: &DescriptionInertia) {
    let i = &own.inertia;
    let _ = writeln!(
        text,
        "\n[[body]]\nname = \"{name}\"\nat = {}\nrpy = {}\nmass = {:?}\ncentre = {}\ninertia = {{ xx = {:?}, yy = {:?}, zz = \
         {:?}, xy = {:?}, xz = {:?}, yz = {:?} }}",
        triple(&place.p),
        triple(&Vector3::from(roll_pitch_yaw(&place.r))),
        own.mass,
        triple(&own.at.p),
        i[(0, 0)],
        i[(1, 1)],
        i[(2, 2)],
        i[(0, 1)],
        i[(0, 2)],
        i[(1, 2)]
    );
}

/// The table of a joint; a driven one gets a coordinate, a drive and its losses.
#[expect(clippy::too_many_arguments, reason = "the link, and all places and names")]
fn write_joint(
    text: &mut String,
    coordinates: &mut String,
    joint: &DescriptionJoint,
    link: &DescriptionLink,
    k: usize,
    places: &[DescriptionPose],
    carriers: &[Option<usize>],
    names: &BodyNames,
) -> Result<(), String> {
    let kind = match joint.kind {
        DescriptionJointKind::Revolute => "revolute",
        DescriptionJointKind::Prismatic => "prismatic",
        DescriptionJointKind::Ball | DescriptionJointKind::Free => {
            return Err(format!(
                "line {}: the joint `{}` is neither revolute nor prismatic, so that the mechanism is not planar",
                joint.line, joint.name
            ));
        }
    };
    let at = places[k].p + places[k].r * joint.anchor;
    let axis = places[k].r * joint.axis;
    let parent = link.parent.and_then(|parent| carriers[parent]);
    let name = word_of(&joint.name);
    let _ = writeln!(
        text,
        "\n[[joint]]\nname = \"{name}\"\nkind = \"{kind}\"\nbetween = [\"{}\", \"{}\"]\nat = {}\naxis = {}",
        names.name(parent),
        names.name(Some(k)),
        triple(&at),
        triple(&axis)
    );
    if !joint.is_driven {
        return Ok(());
    }
    let drive = format!("{name}_drive");
    let _ = writeln!(
        coordinates,
        "\n[[coordinate]]\nname = \"{name}\"\njoint = \"{name}\"\nnominal = {:?}\n\n[[drive]]\nname = \"{drive}\"\njoint = \
         \"{name}\"",
        joint.zero
    );
    let losses = [
        ("viscous_friction", "Fv", joint.damping),
        ("coulomb_friction", "Fs", joint.friction),
        ("drive_inertia", "Ia", joint.armature),
    ];
    for (kind, symbol, value) in losses.into_iter().filter(|(.., value)| *value != 0.0) {
        let _ = writeln!(
            coordinates,
            "\n[[effect]]\nkind = \"{kind}\"\nat = [\"{drive}\"]\nvalues = {{ {symbol} = {value:?} }}"
        );
    }
    Ok(())
}

/// Loop closures as joints.
fn write_closures(
    text: &mut String,
    description: &RobotDescription,
    places: &[DescriptionPose],
    carriers: &[Option<usize>],
    names: &BodyNames,
) -> Result<(), String> {
    let common = common_axis(description, places);
    for closure in &description.closures {
        let ends = closure.ends.each_ref().map(|(link, pose)| {
            let place = link.map_or_else(DescriptionPose::identity, |link| places[link]);
            (link.and_then(|link| carriers[link]), place.compose(pose))
        });
        let (kind, axis) = match closure.constraint {
            ClosureConstraint::Frames => ("fixed", Vector3::z()),
            ClosureConstraint::Axes => ("revolute", ends[0].1.r * Vector3::x()),
            ClosureConstraint::Origins => {
                let axis = common.ok_or_else(|| {
                    format!(
                        "line {}: the loop `{}` closes at a point, and the axes of the joints are not parallel, so that the \
                         mechanism is not planar",
                        closure.line, closure.name
                    )
                })?;
                ("revolute", axis)
            }
        };
        let name = word_of(&closure.name);
        // The places of both ends, as points of their bodies, since the loop may be open at the pose of the description.
        let points = [("a", &ends[0]), ("b", &ends[1])].map(|(letter, (body, at))| {
            let local = body.map_or(at.p, |body| places[body].inverse().compose(at).p);
            let point = format!("{name}_{letter}");
            let _ = writeln!(
                text,
                "\n[[point]]\nname = \"{point}\"\non = \"{}\"\nat = {}",
                names.name(*body),
                triple(&local)
            );
            point
        });
        let _ = writeln!(
            text,
            "\n[[joint]]\nname = \"{name}\"\nkind = \"{kind}\"\nbetween = [\"{}\", \"{}\"]\npoints = [\"{}\", \"{}\"]\naxis = {}",
            names.name(ends[0].0),
            names.name(ends[1].0),
            points[0],
            points[1],
            triple(&axis)
        );
    }
    Ok(())
}

/// The direction of the axes of all revolute joints, if they are parallel.
fn common_axis(description: &RobotDescription, places: &[DescriptionPose]) -> Option<Vector3<f64>> {
    let links = description.links.iter().zip(places);
    let mut axes = links.flat_map(|(link, place)| {
        let revolute = link
            .joints
            .iter()
            .filter(|joint| joint.kind == DescriptionJointKind::Revolute);
        revolute.filter_map(move |joint| (place.r * joint.axis).try_normalize(0.0))
    });
    let first = axes.next()?;
    axes.all(|axis| first.cross(&axis).norm() < PARALLEL).then_some(first)
}

/// Three numbers of a rig file.
fn triple(v: &Vector3<f64>) -> String {
    // A zero has no sign.
    format!("[{:?}, {:?}, {:?}]", v.x + 0.0, v.y + 0.0, v.z + 0.0)
}

/// A name as a word that rig files accept.
fn word_of(name: &str) -> String {
    let word: String = name
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect();
    match word.chars().next() {
        Some(first) if first.is_ascii_digit() => format!("_{word}"),
        Some(_) => word,
        None => "robot".to_owned(),
    }
}
