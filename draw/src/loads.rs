//! Forces of drives as arrows: straight for prismatic joints and linear drives, circular for revolute joints. Their
//! length shows the force, and their colour shows the error of a model.

use crate::scene::{JointMark, MarkShape, SceneMark};
use crate::symbols::polygon;

/// The force or torque of a drive at one time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DriveArrow {
    /// Name of the drive.
    pub drive: String,
    /// The force as a share of the largest one with the same unit, from -1 to 1.
    pub force: f64,
    /// The error of a model as a share of the same force, from 0.
    pub error: f64,
}

/// Shares of the largest force at which the colour of an arrow changes. The style has a colour below the first one,
/// one above the last one, and one between each two. By judgement: a good model has an error of 1 to 5 %, and this
/// range must not look like no error, so the steps are even on a logarithmic scale.
pub const ERROR_SHADES: [f64; 5] = [0.01, 0.02, 0.05, 0.1, 0.2];

/// Length of the longest straight arrow, in units of the picture.
const LONGEST_ARROW: f64 = 60.0;
/// Radius of an arrow around a joint, in units of the picture.
const ARC_RADIUS: f64 = 19.0;
/// Largest angle of an arrow around a joint, rad.
const LARGEST_ARC: f64 = 5.0;
/// Shorter arrows are left out, in units of the picture.
const SHORTEST_ARROW: f64 = 3.0;

/// The arrow of a load at the mark of its drive; empty for other marks. `at` and `direction` project places and
/// directions onto the picture, and `towards` returns the component of a direction towards the viewer.
pub(crate) fn drive_arrow(
    mark: &SceneMark,
    load: &DriveArrow,
    at: impl Fn(&nalgebra::Vector3<f64>) -> [f64; 2],
    direction: impl Fn(&nalgebra::Vector3<f64>) -> [f64; 2],
    towards: impl Fn(&nalgebra::Vector3<f64>) -> f64,
) -> String {
    // A force that is not finite is drawn as zero; an error that is not finite as the largest.
    let force = if load.force.is_finite() {
        load.force.clamp(-1.0, 1.0)
    } else {
        0.0
    };
    let drawn = match &mark.shape {
        MarkShape::Drive(ends) if mark.name == load.drive => {
            let [a, b] = ends.each_ref().map(&at);
            let length = (b[0] - a[0]).hypot(b[1] - a[1]).max(1e-9);
            let along = [0, 1].map(|k| (b[k] - a[k]) / length);
            // A positive force pushes the ends apart.
            straight_arrow(b, along, force) + &straight_arrow(a, along.map(|x| -x), force)
        }
        MarkShape::Joint(joint) if joint.drive.as_deref() == Some(load.drive.as_str()) => joint_arrow(
            joint,
            at(&joint.at),
            direction(&joint.axis),
            towards(&joint.axis),
            force,
        ),
        _ => return String::new(),
    };
    // An error that is not finite exceeds all bounds.
    let shade = (ERROR_SHADES.iter())
        .filter(|bound| load.error.is_nan() || load.error >= **bound)
        .count();
    format!("<g class=\"load e{shade}\">{drawn}</g>\n")
}

/// The arrow of a joint: along its axis if it is prismatic, else around it.
fn joint_arrow(joint: &JointMark, at: [f64; 2], axis: [f64; 2], towards: f64, force: f64) -> String {
    if joint.is_prismatic && !joint.is_revolute {
        let length = axis[0].hypot(axis[1]);
        return straight_arrow(at, axis, force * length.max(0.2));
    }
    // Seen from the tip of its axis, a positive torque turns counter-clockwise.
    circular_arrow(at, if towards < 0.0 { -force } else { force })
}

/// A straight arrow that begins at `from`; for a negative force it ends there.
fn straight_arrow(from: [f64; 2], along: [f64; 2], force: f64) -> String {
    let by = LONGEST_ARROW * force;
    if by.abs() < SHORTEST_ARROW {
        return String::new();
    }
    let length = along[0].hypot(along[1]).max(1e-9);
    let along = along.map(|x| x / length);
    let end = [0, 1].map(|k| from[k] + by.abs() * along[k]);
    let (tail, tip, along) = if by > 0.0 {
        (from, end, along)
    } else {
        (end, from, along.map(|x| -x))
    };
    format!(
        "<path d=\"M{:.1} {:.1}L{:.1} {:.1}\"/>{}",
        tail[0],
        tail[1],
        tip[0],
        tip[1],
        arrow_head(tip, along)
    )
}

/// An arrow around a joint, counter-clockwise for a positive force, which begins at the right of the joint.
pub(crate) fn circular_arrow(at: [f64; 2], force: f64) -> String {
    let turn = LARGEST_ARC * force;
    if turn.abs() * ARC_RADIUS < SHORTEST_ARROW {
        return String::new();
    }
    let place = |angle: f64| [at[0] + ARC_RADIUS * angle.cos(), at[1] - ARC_RADIUS * angle.sin()];
    let (start, end) = (place(0.0), place(turn));
    // The tangent of the circle at the end.
    let along = [-turn.signum() * turn.sin(), -turn.signum() * turn.cos()];
    format!(
        "<path d=\"M{:.1} {:.1}A{ARC_RADIUS} {ARC_RADIUS} 0 {} {} {:.1} {:.1}\"/>{}",
        start[0],
        start[1],
        u8::from(turn.abs() > std::f64::consts::PI),
        u8::from(turn < 0.0),
        end[0],
        end[1],
        arrow_head(end, along)
    )
}

/// A triangle at the tip of an arrow.
pub(crate) fn arrow_head(tip: [f64; 2], along: [f64; 2]) -> String {
    let across = [-along[1], along[0]];
    let corner = |back: f64, side: f64| [0, 1].map(|k| tip[k] + back * along[k] + side * across[k]);
    polygon("head", &[corner(5.0, 0.0), corner(-5.0, 4.5), corner(-5.0, -4.5)])
}
