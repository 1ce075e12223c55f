//! Links and joints of an export: a mechanism goes in; frames that move together come out as one link, and each motion
//! of a coordinate between two links as a joint.

use modelmill_spec::{FrameStep, Kinematics, Mechanism, PointIdx};
use nalgebra::{Matrix3, Vector3};

use super::{ExportError, FollowedCoordinate};

/// A pose in the base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LinkPlacement {
    /// Rotation matrix: columns are the own axes in the base.
    pub(super) rotation: Matrix3<f64>,
    /// Position, m.
    pub(super) origin: Vector3<f64>,
}

impl LinkPlacement {
    /// The pose of `other` relative to this one.
    pub(super) fn relative_placement(&self, other: &Self) -> Self {
        let back = self.rotation.transpose();
        Self {
            rotation: back * other.rotation,
            origin: back * (other.origin - self.origin),
        }
    }

    /// A point of the base in this frame, m.
    pub(super) fn relative_point(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.transpose() * (point - self.origin)
    }
}

/// A joint of a link: one rotation or translation relative to the parent.
#[derive(Clone, Debug)]
pub(super) struct ExportedJoint {
    /// Name: that of the coordinate, or made from coordinate and frame.
    pub(super) name: String,
    /// Index of its coordinate.
    pub(super) coordinate: usize,
    /// Its value for a coordinate of one; 1 for the joint that has the name of the coordinate.
    pub(super) ratio: f64,
    /// Whether it is a rotation; else a translation.
    pub(super) is_rotation: bool,
    /// Unit vector in the axes of the base.
    pub(super) axis: Vector3<f64>,
    /// A point of the axis in the base, m.
    pub(super) origin: Vector3<f64>,
}

/// A link: frames that move together.
#[derive(Clone, Debug)]
pub(super) struct ExportedLink {
    /// Name of its first frame.
    pub(super) name: String,
    /// Index of the parent; the base is its own parent.
    pub(super) parent: usize,
    /// Joints from the parent outwards; empty for a free body.
    pub(super) joints: Vec<ExportedJoint>,
    /// Pose in the base; the origin is on the axis of the last joint.
    pub(super) placed: LinkPlacement,
}

/// A mechanism as links, the base first and parents before their children.
#[derive(Clone, Debug)]
pub(super) struct LinkTree {
    /// The links.
    pub(super) links: Vec<ExportedLink>,
    /// Index of the link of each frame.
    pub(super) link_of: Vec<usize>,
    /// Pose of each frame in the base.
    pub(super) frames: Vec<LinkPlacement>,
    /// Coordinates that follow a single other one.
    pub(super) followed: Vec<FollowedCoordinate>,
}

impl LinkTree {
    /// The link of a point, and its position on the link, m.
    pub(super) fn point(&self, mechanism: &Mechanism, point: PointIdx) -> (usize, Vector3<f64>) {
        let point = &mechanism.points[point.0];
        let at = Vector3::from_fn(|k, _| point.at[k].evaluate(&|s| mechanism.symbol_nominal(s)));
        // From the frame to the base, then into the link.
        let frame = &self.frames[point.frame.0];
        let link = self.link_of[point.frame.0];
        let in_base = frame.origin + frame.rotation * at;
        (link, self.links[link].placed.relative_point(&in_base))
    }
}

/// Links and joints of a mechanism, drawn at the coordinates `at`.
///
/// Fails if a coordinate has no joint with its name, see [`coordinate_owners`].
pub(super) fn link_tree(mechanism: &Mechanism, at: &[f64]) -> Result<LinkTree, ExportError> {
    let mut at = at.to_vec();
    for (value, coordinate) in at.iter_mut().zip(&mechanism.coordinates) {
        // A free body is drawn with the identity quaternion.
        if coordinate.motion == modelmill_spec::CoordinateMotion::QuaternionScalar {
            *value = 1.0;
        } else if coordinate.motion.is_quaternion() {
            *value = 0.0;
        }
    }
    // Poses of all frames, with the axes of their joints.
    let poses = Kinematics::new(mechanism).poses(&at);
    let frames: Vec<LinkPlacement> = (poses.frames().iter())
        .map(|pose| LinkPlacement {
            rotation: Matrix3::from_fn(|i, j| pose.rotation[i][j]),
            origin: Vector3::from(pose.origin),
        })
        .collect();
    let owners = coordinate_owners(mechanism, &poses)?;
    // The base is the first link.
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
        // A free body moves without joints.
        let is_free = frame.steps.iter().any(|step| matches!(step, FrameStep::Free(_)));
        // A frame without motion belongs to the link of its parent.
        if pose.joint_axes.is_empty() && !is_free {
            link_of.push(parent);
            continue;
        }
        // A joint for each motion of the frame.
        let joint = |(k, moved): (usize, &modelmill_spec::CoordinateAxis)| {
            let is_owner = owners[moved.coordinate] == Some((f, k));
            let coordinate = &mechanism.coordinates[moved.coordinate].name;
            // The axis of the owner gets the sign with which its value equals the coordinate.
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
        // The origin of a link is on the axis of its last joint, as URDF requires.
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

/// For each coordinate the joint that gets its name: the first with a ratio of one, by frame and index among its
/// joints. None for coordinates of free bodies.
///
/// Fails if a coordinate moves its joints only by other ratios.
fn coordinate_owners(
    mechanism: &Mechanism,
    poses: &modelmill_spec::MechanismPoses,
) -> Result<Vec<Option<(usize, usize)>>, ExportError> {
    let mut owners = vec![None; mechanism.coordinates.len()];
    let mut moves = vec![false; mechanism.coordinates.len()];
    for (f, pose) in poses.frames().iter().enumerate() {
        for (k, moved) in pose.joint_axes.iter().enumerate() {
            // A joint with a ratio of 1 or -1 can have the name of its coordinate.
            moves[moved.coordinate] = true;
            if (moved.factor.abs() - 1.0).abs() < f64::EPSILON {
                owners[moved.coordinate].get_or_insert((f, k));
            }
        }
    }
    for (c, coordinate) in mechanism.coordinates.iter().enumerate() {
        if moves[c] && owners[c].is_none() {
            return Err(ExportError(format!(
                "`{}` moves all its joints by ratios other than 1, but robot descriptions need a joint for each coordinate; define \
                 the coordinate as the angle or length of one of its joints",
                coordinate.name
            )));
        }
    }
    Ok(owners)
}
