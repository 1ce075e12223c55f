//! Links and joints: frames that move as one are one link, and each motion of a coordinate between two of them is a joint.

use modelmill_spec::{FrameStep, Kinematics, Mechanism, PointIdx};
use nalgebra::{Matrix3, Vector3};

use super::{ExportError, FollowedCoordinate};

/// A position with axes, in those of the base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LinkPlacement {
    pub(super) rotation: Matrix3<f64>,
    /// m
    pub(super) origin: Vector3<f64>,
}

impl LinkPlacement {
    /// Where something stands, seen from here.
    pub(super) fn relative_placement(&self, other: &Self) -> Self {
        let back = self.rotation.transpose();
        Self {
            rotation: back * other.rotation,
            origin: back * (other.origin - self.origin),
        }
    }

    /// A point of the base, seen from here.
    pub(super) fn relative_point(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.transpose() * (point - self.origin)
    }
}

/// How a link moves against its parent.
#[derive(Clone, Debug)]
pub(super) struct ExportedJoint {
    pub(super) name: String,
    /// Position of its coordinate.
    pub(super) coordinate: usize,
    /// Its value for a coordinate of one; only the joint that has the coordinate's name has one.
    pub(super) ratio: f64,
    pub(super) is_rotation: bool,
    /// Unit vector in the axes of the base.
    pub(super) axis: Vector3<f64>,
    /// Where the axis is, in the base.
    pub(super) origin: Vector3<f64>,
}

/// Frames that move as one.
#[derive(Clone, Debug)]
pub(super) struct ExportedLink {
    pub(super) name: String,
    /// The base is its own.
    pub(super) parent: usize,
    /// From the parent outwards; none if it hangs on nothing.
    pub(super) joints: Vec<ExportedJoint>,
    pub(super) placed: LinkPlacement,
}

/// A mechanism as links, the base first and parents before their children.
#[derive(Clone, Debug)]
pub(super) struct LinkTree {
    pub(super) links: Vec<ExportedLink>,
    /// Of each frame.
    pub(super) link_of: Vec<usize>,
    /// Of each frame.
    pub(super) frames: Vec<LinkPlacement>,
    /// Couplings that formats have.
    pub(super) followed: Vec<FollowedCoordinate>,
}

impl LinkTree {
    /// The link of a point, and where it is on it, m.
    pub(super) fn point(&self, mechanism: &Mechanism, point: PointIdx) -> (usize, Vector3<f64>) {
        let point = &mechanism.points[point.0];
        let at = Vector3::from_fn(|k, _| point.at[k].evaluate(&|s| mechanism.symbol_nominal(s)));
        let frame = &self.frames[point.frame.0];
        let link = self.link_of[point.frame.0];
        let in_base = frame.origin + frame.rotation * at;
        (link, self.links[link].placed.relative_point(&in_base))
    }
}

/// Links and joints, drawn at given coordinates.
pub(super) fn link_tree(mechanism: &Mechanism, at: &[f64]) -> Result<LinkTree, ExportError> {
    let mut at = at.to_vec();
    for (value, coordinate) in at.iter_mut().zip(&mechanism.coordinates) {
        // A body that hangs on nothing stands upright at its zero.
        if coordinate.motion == modelmill_spec::CoordinateMotion::QuaternionScalar {
            *value = 1.0;
        } else if coordinate.motion.is_quaternion() {
            *value = 0.0;
        }
    }
    let poses = Kinematics::new(mechanism).poses(&at);
    let frames: Vec<LinkPlacement> = (poses.frames().iter())
        .map(|pose| LinkPlacement {
            rotation: Matrix3::from_fn(|i, j| pose.rotation[i][j]),
            origin: Vector3::from(pose.origin),
        })
        .collect();
    let owners = coordinate_owners(mechanism, &poses)?;
    let mut links = vec![ExportedLink {
        name: mechanism.frames[0].name.clone(),
        parent: 0,
        joints: Vec::new(),
        placed: frames[0],
    }];
    let mut link_of = vec![0];
    for (f, pose) in poses.frames().iter().enumerate().skip(1) {
        let frame = &mechanism.frames[f];
        let parent = link_of[frame.parent.0];
        let is_free = frame
            .steps
            .iter()
            .any(|step| matches!(step, FrameStep::Free(_)));
        if pose.joint_axes.is_empty() && !is_free {
            link_of.push(parent);
            continue;
        }
        let joint = |(k, moved): (usize, &modelmill_spec::CoordinateAxis)| {
            let is_owner = owners[moved.coordinate] == Some((f, k));
            let coordinate = &mechanism.coordinates[moved.coordinate].name;
            // The owner turns about an axis that makes its value the coordinate's.
            let sign = if is_owner { moved.factor.signum() } else { 1.0 };
            ExportedJoint {
                name: if is_owner {
                    coordinate.clone()
                } else {
                    format!("{coordinate}_at_{}", frame.name)
                },
                coordinate: moved.coordinate,
                ratio: if is_owner { 1.0 } else { moved.factor },
                is_rotation: moved.is_rotation,
                axis: sign * Vector3::from(moved.axis),
                origin: Vector3::from(moved.origin),
            }
        };
        let joints: Vec<ExportedJoint> = pose.joint_axes.iter().enumerate().map(joint).collect();
        let origin = joints.last().map_or(frames[f].origin, |last| last.origin);
        link_of.push(links.len());
        links.push(ExportedLink {
            name: frame.name.clone(),
            parent,
            joints,
            placed: LinkPlacement {
                rotation: frames[f].rotation,
                origin,
            },
        });
    }
    Ok(LinkTree {
        links,
        link_of,
        frames,
        followed: Vec::new(),
    })
}

/// Which joint has each coordinate's name: the first that moves by just as much, by frame and place among its joints; none for
/// those of bodies that hang on nothing.
fn coordinate_owners(
    mechanism: &Mechanism,
    poses: &modelmill_spec::MechanismPoses,
) -> Result<Vec<Option<(usize, usize)>>, ExportError> {
    let mut owners = vec![None; mechanism.coordinates.len()];
    let mut moves = vec![false; mechanism.coordinates.len()];
    for (f, pose) in poses.frames().iter().enumerate() {
        for (k, moved) in pose.joint_axes.iter().enumerate() {
            moves[moved.coordinate] = true;
            if (moved.factor.abs() - 1.0).abs() < f64::EPSILON {
                owners[moved.coordinate].get_or_insert((f, k));
            }
        }
    }
    for (c, coordinate) in mechanism.coordinates.iter().enumerate() {
        if moves[c] && owners[c].is_none() {
            return Err(ExportError(format!(
                "`{}` moves its joints by a ratio only, and no joint by itself; robot descriptions need a joint for each \
                 coordinate: take the angle or length of one of its joints for the coordinate",
                coordinate.name
            )));
        }
    }
    Ok(owners)
}
