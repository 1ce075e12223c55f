//! How the bodies of a rig move in a plane: which stand still, which only translate, and which rotate alike.

use modelmill_rig::{BodyAnchor, Rig};
use nalgebra::{Matrix3, Vector2, Vector3};

use super::thresholds::{RANGES, REACHED_SHARE, SAMPLES};
use crate::part::{SubstitutionPart, body_rotation, fit_carried_point};
use crate::samples::{MotionPlane, MotionSamples};
use crate::tolerance::{angle_tolerance, distance_tolerance, rate_tolerance};

/// The kind of a body's motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BodyMotionKind {
    /// It does not move.
    Fixed,
    /// It moves without rotation.
    Translating,
    /// It rotates as the other bodies of a family do: its index.
    Rotating(usize),
}

/// The motion of all bodies.
pub(super) struct ClassifiedMotion {
    /// The plane of motion.
    pub(super) plane: MotionPlane,
    /// Range of the samples, rad or m.
    pub(super) range: f64,
    /// The samples.
    pub(super) samples: MotionSamples,
    /// One per body.
    pub(super) kinds: Vec<BodyMotionKind>,
    /// Bodies that move as one up to constant shifts, in the order of the rig.
    pub(super) families: Vec<Vec<usize>>,
}

impl ClassifiedMotion {
    /// Samples the motion of a rig and classifies its bodies. Fails with a reason.
    pub(super) fn new(rig: &Rig) -> Result<Self, String> {
        let (samples, range) = sample_motion(rig, SAMPLES)?;
        let plane = find_plane(rig, &samples)?;
        let mut motion = Self {
            plane,
            range,
            samples,
            kinds: Vec::new(),
            families: Vec::new(),
        };
        for body in 0..rig.bodies.len() {
            let kind = motion.kind_of(rig, body);
            motion.kinds.push(kind);
            if let BodyMotionKind::Rotating(family) = kind {
                match motion.families.get_mut(family) {
                    Some(members) => members.push(body),
                    None => motion.families.push(vec![body]),
                }
            }
        }
        Ok(motion)
    }

    /// How a body moves, compared with the families so far; a new family has the next index.
    fn kind_of(&self, rig: &Rig, body: usize) -> BodyMotionKind {
        let (plane, samples) = (&self.plane, &self.samples);
        let rotation = samples.largest(|moment| body_rotation(body, moment, plane, samples));
        if rotation <= angle_tolerance(rig, body) {
            let centre = BodyAnchor {
                body: Some(body),
                at: rig.bodies[body].centre,
            };
            let moves = self.path(&centre).iter().any(|d| d.norm() > distance_tolerance(rig));
            return if moves {
                BodyMotionKind::Translating
            } else {
                BodyMotionKind::Fixed
            };
        }
        let alike = self
            .families
            .iter()
            .position(|members| self.is_alike(rig, members[0], body));
        BodyMotionKind::Rotating(alike.unwrap_or(self.families.len()))
    }

    /// Whether a body rotates as another one does, and is carried by it up to a constant shift.
    fn is_alike(&self, rig: &Rig, lead: usize, body: usize) -> bool {
        let (plane, samples) = (&self.plane, &self.samples);
        let twist = samples.largest(|moment| {
            let d = body_rotation(body, moment, plane, samples) - body_rotation(lead, moment, plane, samples);
            d.sin().atan2(d.cos())
        });
        if twist.is_nan() || twist > angle_tolerance(rig, body) {
            return false;
        }
        let anchor = |body: usize, at: Vector3<f64>| BodyAnchor { body: Some(body), at };
        let carrier = SubstitutionPart {
            name: String::new(),
            bodies: vec![lead],
            parent: None,
            joint: [anchor(lead, Vector3::zeros()); 2],
            to: anchor(lead, Vector3::x()),
            shift: Vector2::zeros(),
        };
        let (_, _, strays) = fit_carried_point(&carrier, &anchor(body, rig.bodies[body].centre), plane, samples);
        strays <= distance_tolerance(rig)
    }

    /// Displacements of an anchor in the plane since the nominal configuration, m, one per sample.
    pub(super) fn path(&self, anchor: &BodyAnchor) -> Vec<Vector2<f64>> {
        let start = self.place(anchor);
        let moments = self.samples.moments.iter();
        moments
            .map(|moment| self.plane.plane_position(&moment.place(anchor)) - start)
            .collect()
    }

    /// The position of an anchor in the plane in the nominal configuration, m.
    pub(super) fn place(&self, anchor: &BodyAnchor) -> Vector2<f64> {
        self.plane.plane_position(&self.samples.nominal.place(anchor))
    }
}

/// Samples in the largest range in which most poses can be reached.
pub(super) fn sample_motion(rig: &Rig, number: usize) -> Result<(MotionSamples, f64), String> {
    for range in RANGES {
        let samples = MotionSamples::new(rig, number, range).map_err(|error| error.to_string())?;
        #[expect(clippy::cast_precision_loss, reason = "a few hundred samples")]
        if samples.moments.len() as f64 >= REACHED_SHARE * number as f64 {
            return Ok((samples, range));
        }
    }
    Err("most poses around the nominal configuration cannot be reached".to_owned())
}

/// The plane in which all bodies move: its normal is the direction of all angular velocities. Its x axis is the axis of
/// the base frame that is nearest to it.
pub(super) fn find_plane(rig: &Rig, samples: &MotionSamples) -> Result<MotionPlane, String> {
    let rates = || samples.moments.iter().flat_map(|moment| &moment.motion.bodies);
    let spread: Matrix3<f64> = rates().map(|body| body.w_WB_W * body.w_WB_W.transpose()).sum();
    let eigen = spread.symmetric_eigen();
    if eigen.eigenvalues.max() <= 0.0 {
        return Err("no body rotates".to_owned());
    }
    let mut normal: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into();
    // Axes of the base frame are exact, and point in the positive direction.
    let k = normal.iamax();
    normal *= normal[k].signum();
    let axis = |k: usize| Vector3::from_fn(|i, _| f64::from(u8::from(i == k)));
    if (normal - axis(k)).norm() < rate_tolerance(rig) {
        normal = axis(k);
    }
    // x for a normal along y or z; y for a normal along x.
    let x = if k == 0 { axis(1) } else { axis(0) };
    // The origin of the model is the joint of the first coordinate on the base.
    let on_base = (0..rig.joints.len())
        .filter(|joint| rig.coordinate_of_joint(*joint).is_some())
        .filter_map(|joint| rig.hinge(joint))
        .flatten()
        .find(|anchor| anchor.body.is_none());
    let at = on_base.map_or_else(Vector3::zeros, |anchor| anchor.at);
    let plane = MotionPlane::new(at.into(), normal.into(), x.into());
    let out = crate::planar::out_of_plane_rate(&plane, samples);
    if out.is_nan() || out > rate_tolerance(rig) {
        return Err("its bodies do not move in one plane".to_owned());
    }
    Ok(plane)
}
