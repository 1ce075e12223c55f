//! Reads a robot description: the XML of URDF goes in, links and joints with the defaults of the format come out.
//!
//! Only what a model needs is read: masses and joints, not shapes, colours or transmissions. Source of names and
//! defaults: the URDF specification of ROS (wiki.ros.org/urdf/XML).

use nalgebra::{Matrix3, Vector3};
use roxmltree::{Document, Node};

/// A robot description.
pub(crate) struct Robot {
    pub(crate) name: String,
    pub(crate) links: Vec<Link>,
    pub(crate) joints: Vec<Joint>,
}

/// A link with what it weighs; all zero where the description gives no `<inertial>`.
pub(crate) struct Link {
    pub(crate) name: String,
    pub(crate) mass: f64,
    /// About the centre of mass, in the axes of `origin`.
    pub(crate) inertia: Matrix3<f64>,
    /// The centre of mass in the frame of the link.
    pub(crate) origin: Pose,
}

/// Where something is: metres and radians.
#[derive(Clone, Copy, Default)]
pub(crate) struct Pose {
    pub(crate) xyz: Vector3<f64>,
    pub(crate) rpy: [f64; 3],
}

/// A joint between two links.
pub(crate) struct Joint {
    pub(crate) name: String,
    pub(crate) kind: String,
    pub(crate) parent: String,
    pub(crate) child: String,
    /// Of the child at zero, in the frame of the parent.
    pub(crate) origin: Pose,
    pub(crate) axis: Vector3<f64>,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    pub(crate) damping: f64,
    pub(crate) friction: f64,
    /// Whether it follows another joint.
    pub(crate) is_mimic: bool,
}

/// Reads a description, or says in one line what is wrong and where.
pub(crate) fn read(text: &str) -> Result<Robot, String> {
    let document = Document::parse(text).map_err(|error| error.to_string())?;
    let robot = document.root_element();
    if robot.tag_name().name() != "robot" {
        return Err(at(&robot, "expected <robot> here"));
    }
    let all = |tag: &'static str| {
        robot
            .children()
            .filter(move |node| node.tag_name().name() == tag)
    };
    Ok(Robot {
        name: robot.attribute("name").unwrap_or_default().to_owned(),
        links: all("link")
            .map(|node| link(&node))
            .collect::<Result<_, _>>()?,
        joints: all("joint")
            .map(|node| joint(&node))
            .collect::<Result<_, _>>()?,
    })
}

fn link(node: &Node) -> Result<Link, String> {
    let mut link = Link {
        name: word(node, "name")?,
        mass: 0.0,
        inertia: Matrix3::zeros(),
        origin: Pose::default(),
    };
    if let Some(inertial) = child(node, "inertial") {
        link.mass = number(&required(&inertial, "mass")?, "value")?;
        let inertia = required(&inertial, "inertia")?;
        for (i, j, key) in [
            (0, 0, "ixx"),
            (0, 1, "ixy"),
            (0, 2, "ixz"),
            (1, 1, "iyy"),
            (1, 2, "iyz"),
            (2, 2, "izz"),
        ] {
            let value = number(&inertia, key)?;
            link.inertia[(i, j)] = value;
            link.inertia[(j, i)] = value;
        }
        link.origin = pose(&inertial)?;
    }
    Ok(link)
}

fn joint(node: &Node) -> Result<Joint, String> {
    let (limit, dynamics) = (child(node, "limit"), child(node, "dynamics"));
    let or_zero = |of: Option<Node>, key: &str| match of {
        Some(node) if node.has_attribute(key) => number(&node, key),
        _ => Ok(0.0),
    };
    Ok(Joint {
        name: word(node, "name")?,
        kind: word(node, "type")?,
        parent: word(&required(node, "parent")?, "link")?,
        child: word(&required(node, "child")?, "link")?,
        origin: pose(node)?,
        axis: match child(node, "axis") {
            Some(axis) => Vector3::from(three(&axis, "xyz")?),
            None => Vector3::x(),
        },
        lower: or_zero(limit, "lower")?,
        upper: or_zero(limit, "upper")?,
        damping: or_zero(dynamics, "damping")?,
        friction: or_zero(dynamics, "friction")?,
        is_mimic: child(node, "mimic").is_some(),
    })
}

/// The `<origin>` of an element; without one it is where the element is.
fn pose(of: &Node) -> Result<Pose, String> {
    let Some(node) = child(of, "origin") else {
        return Ok(Pose::default());
    };
    let or_zeros = |key: &str| {
        if node.has_attribute(key) {
            three(&node, key)
        } else {
            Ok([0.0; 3])
        }
    };
    Ok(Pose {
        xyz: Vector3::from(or_zeros("xyz")?),
        rpy: or_zeros("rpy")?,
    })
}

fn child<'a, 'i>(of: &Node<'a, 'i>, tag: &str) -> Option<Node<'a, 'i>> {
    of.children().find(|node| node.tag_name().name() == tag)
}

fn required<'a, 'i>(of: &Node<'a, 'i>, tag: &str) -> Result<Node<'a, 'i>, String> {
    child(of, tag).ok_or_else(|| at(of, &format!("it needs <{tag}>")))
}

fn word(of: &Node, key: &str) -> Result<String, String> {
    let text = of.attribute(key);
    text.map(str::to_owned)
        .ok_or_else(|| at(of, &format!("it needs the attribute `{key}`")))
}

fn number(of: &Node, key: &str) -> Result<f64, String> {
    let text = word(of, key)?;
    let fault = || at(of, &format!("expected a number in `{key}`"));
    text.trim().parse().map_err(|_| fault())
}

fn three(of: &Node, key: &str) -> Result<[f64; 3], String> {
    let text = word(of, key)?;
    let numbers: Option<Vec<f64>> = text
        .split_whitespace()
        .map(|part| part.parse().ok())
        .collect();
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| at(of, &format!("expected three numbers in `{key}`")))
}

/// A fault with the place of its element.
fn at(node: &Node, fault: &str) -> String {
    let place = node.document().text_pos_at(node.range().start);
    format!("line {}, <{}>: {fault}", place.row, node.tag_name().name())
}
