//! A mechanism as the peers know it: a chain of bodies, each on a joint that turns about or slides along an axis, in numbers.

use std::fmt::Write as _;

use modelmill_spec::{
    CoordinateIdx, DriveKind, ExactExpression, FrameAxis, FrameIdx, FrameStep, LumpedMass, Mechanism, ModelPart,
    ModelSymbol, PartInertia,
};
use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::models::Motion;

/// Bodies on joints, one for each coordinate.
pub(crate) struct Chain {
    gravity: Vector3<f64>,
    joints: Vec<Joint>,
}

struct Joint {
    coordinate: usize,
    parent: Option<usize>,
    slides: bool,
    axis: usize,
    placement: Placement,
    body: Body,
}

/// Where something stands on a joint or on the base: rotation to its axes, and position.
#[derive(Clone, Copy)]
struct Placement {
    rotation: Matrix3<f64>,
    position: Vector3<f64>,
}

/// Mass, first moment, and inertia about the origin.
#[derive(Clone, Copy, Default)]
struct Body {
    mass: f64,
    moment: Vector3<f64>,
    inertia: Matrix3<f64>,
}

impl Placement {
    fn none() -> Self {
        Self {
            rotation: Matrix3::identity(),
            position: Vector3::zeros(),
        }
    }
}

impl Body {
    /// The same body about the origin that it is placed from.
    fn placed(&self, at: &Placement) -> Self {
        let moment = at.rotation * self.moment;
        let (p, m) = (at.position.cross_matrix(), moment.cross_matrix());
        let turned = at.rotation * self.inertia * at.rotation.transpose();
        Self {
            mass: self.mass,
            moment: moment + self.mass * at.position,
            inertia: turned - p * m - m * p - self.mass * p * p,
        }
    }

    fn add(&mut self, other: &Self) {
        self.mass += other.mass;
        self.moment += other.moment;
        self.inertia += other.inertia;
    }
}

impl Chain {
    /// The chain of a mechanism with given values of its parameters; the reason why there is none.
    pub(crate) fn from_mechanism(mechanism: &Mechanism, parameters: &[f64]) -> Result<Self, String> {
        if !mechanism.loops.is_empty() || mechanism.coordinates.iter().any(|c| c.passive) {
            return Err("it has loops".to_owned());
        }
        let drives = mechanism.drives.iter().map(|d| &d.kind);
        if drives.clone().any(|kind| !matches!(kind, DriveKind::Joint(_))) {
            return Err("a drive acts between points".to_owned());
        }
        if mechanism.effects.iter().any(|e| e.mechanics.is_some()) {
            return Err("its effects have mechanics of their own".to_owned());
        }
        let value = |symbol: ModelSymbol| match symbol {
            ModelSymbol::Coordinate(_) => 0.0,
            ModelSymbol::Parameter(i) => parameters[i.0],
            other => mechanism.symbol_nominal(other),
        };
        let number = |e: &ExactExpression| e.evaluate(&value);
        let mut joints: Vec<Joint> = Vec::new();
        // The last joint on the way to each frame, and the frame on it.
        let mut frames: Vec<(Option<usize>, Placement)> = vec![(None, Placement::none())];
        for frame in &mechanism.frames[1..] {
            let (mut last, mut at) = frames[frame.parent.0];
            for step in &frame.steps {
                let (axis, slides, offset, moved) = elementary(step, mechanism, &value)?;
                if slides {
                    at.position += at.rotation.column(axis) * offset;
                } else {
                    at.rotation *= Rotation3::new(Vector3::ith(axis, offset)).matrix();
                }
                let Some(CoordinateIdx(coordinate)) = moved else {
                    continue;
                };
                if joints.iter().any(|j| j.coordinate == coordinate) {
                    return Err("a coordinate moves two joints".to_owned());
                }
                joints.push(Joint {
                    coordinate,
                    parent: last,
                    slides,
                    axis,
                    placement: at,
                    body: Body::default(),
                });
                (last, at) = (Some(joints.len() - 1), Placement::none());
            }
            frames.push((last, at));
        }
        if joints.len() != mechanism.coordinates.len() {
            return Err("a coordinate moves no joint".to_owned());
        }
        let parts = mechanism.parts.iter().map(|p| (p.frame, part(p, &number)));
        let mut bodies: Vec<(FrameIdx, Body)> = parts.collect();
        for mass in &mechanism.lumped_masses {
            bodies.push((mass.frame, lumped_mass(mass, &number)?));
        }
        for (frame, body) in bodies {
            if let (Some(joint), at) = &frames[frame.0] {
                joints[*joint].body.add(&body.placed(at));
            }
        }
        let gravity = Vector3::from_fn(|i, _| number(&mechanism.gravity[i]));
        Ok(Self { gravity, joints })
    }

    /// The chain and its states with the torques of the coordinates, as the peers' programs read it.
    pub(crate) fn text(&self, motion: &Motion, torques: &[Vec<f64>]) -> String {
        let n = motion.q.first().map_or(0, Vec::len);
        let mut text = format!("{} {n}\n", self.joints.len());
        let mut line = |numbers: &mut dyn Iterator<Item = f64>| {
            for x in numbers {
                _ = write!(text, "{} ", snapped(x));
            }
            text.push('\n');
        };
        line(&mut self.gravity.iter().copied());
        for joint in &self.joints {
            let parent = joint.parent.map_or(-1.0, |p| p as f64);
            let kind = [parent, f64::from(u8::from(joint.slides)), joint.axis as f64];
            line(&mut kind.into_iter());
            line(&mut joint.placement.rotation.transpose().iter().copied());
            line(&mut joint.placement.position.iter().copied());
            let (body, i) = (&joint.body, &joint.body.inertia);
            let inertia = [i.m11, i.m12, i.m13, i.m22, i.m23, i.m33];
            let first = std::iter::once(body.mass).chain(body.moment.iter().copied());
            line(&mut first.chain(inertia));
        }
        for k in 0..n {
            let of_joints = |columns: &[Vec<f64>]| -> Vec<f64> {
                let joints = self.joints.iter();
                joints.map(|j| columns[j.coordinate][k]).collect()
            };
            let columns = [&motion.q, &motion.qd, &motion.qdd].map(|c| of_joints(c));
            let numbers = columns.concat().into_iter().chain(of_joints(torques));
            for x in numbers {
                _ = write!(text, "{x} ");
            }
            text.push('\n');
        }
        text
    }
}

/// Zeros and ones that rounding has blurred are made whole, so that generators leave them out.
fn snapped(x: f64) -> f64 {
    let whole = x.round();
    if (x - whole).abs() < 1e-15 && whole.abs() <= 1.0 {
        // No minus in front of zero.
        whole + 0.0
    } else {
        x
    }
}

/// Axis, whether it slides, the fixed part, and the coordinate of a step.
type Elementary = (usize, bool, f64, Option<CoordinateIdx>);

fn elementary(
    step: &FrameStep,
    mechanism: &Mechanism,
    value: &dyn Fn(ModelSymbol) -> f64,
) -> Result<Elementary, String> {
    let with = |i: usize| {
        move |symbol: ModelSymbol| match symbol {
            ModelSymbol::Coordinate(c) => f64::from(u8::from(c.0 == i)),
            other => value(other),
        }
    };
    let evaluate = |value: &dyn Fn(ModelSymbol) -> f64| match step {
        FrameStep::Rotate(_, angle) => angle.evaluate(value),
        FrameStep::Translate(_, length) => length.evaluate(value),
        FrameStep::Free(_) => f64::NAN,
    };
    if let FrameStep::Free(_) = step {
        return Err("a free body has no joint".to_owned());
    }
    let offset = evaluate(value);
    let mut moved = None;
    for i in 0..mechanism.coordinates.len() {
        let factor = evaluate(&with(i)) - offset;
        if factor.abs() < 1e-12 {
            continue;
        }
        if (factor - 1.0).abs() > 1e-12 || moved.is_some() {
            return Err("a joint moves by more than its coordinate".to_owned());
        }
        moved = Some(CoordinateIdx(i));
    }
    let (axis, slides) = match step {
        FrameStep::Rotate(axis, _) => (axis, false),
        FrameStep::Translate(axis, _) => (axis, true),
        FrameStep::Free(_) => unreachable!("refused above"),
    };
    let axis = match axis {
        FrameAxis::X => 0,
        FrameAxis::Y => 1,
        FrameAxis::Z => 2,
    };
    Ok((axis, slides, offset, moved))
}

fn symmetric(entries: &[ExactExpression; 6], number: &dyn Fn(&ExactExpression) -> f64) -> Matrix3<f64> {
    let [xx, xy, xz, yy, yz, zz] = std::array::from_fn(|i| number(&entries[i]));
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

fn part(part: &ModelPart, number: &dyn Fn(&ExactExpression) -> f64) -> Body {
    let vector = |v: &[ExactExpression; 3]| Vector3::from_fn(|i, _| number(&v[i]));
    match &part.inertial {
        PartInertia::Linear {
            mass,
            first_moment,
            inertia,
        } => Body {
            mass: number(mass),
            moment: vector(first_moment),
            inertia: symmetric(inertia, number),
        },
        PartInertia::AboutCentre { mass, centre, inertia } => {
            let about_centre = Body {
                mass: number(mass),
                moment: Vector3::zeros(),
                inertia: symmetric(inertia, number),
            };
            about_centre.placed(&Placement {
                position: vector(centre),
                ..Placement::none()
            })
        }
    }
}

fn lumped_mass(mass: &LumpedMass, number: &dyn Fn(&ExactExpression) -> f64) -> Result<Body, String> {
    let vector = |v: &[ExactExpression; 3]| Vector3::from_fn(|i, _| number(&v[i]));
    let (position, other) = (vector(&mass.force_at), vector(&mass.moment_at));
    if position != other {
        return Err("forces and moments see a mass at different places".to_owned());
    }
    let ratio = |n: &num_rational::BigRational| ExactExpression::Rational(n.clone()).evaluate(&|_| 0.0);
    let point = Body {
        mass: number(&mass.mass) * ratio(&mass.share),
        ..Body::default()
    };
    Ok(point.placed(&Placement {
        position,
        ..Placement::none()
    }))
}
