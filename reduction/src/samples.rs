//! Sampled poses and motions of the full robot, along which every assumption of a reduction is checked. A rig, a number
//! and a range go in; states with the motion of all bodies come out.
//!
//! Coordinates, rates and accelerations come from a low-discrepancy sequence (M. Roberts 2018, after H. Weyl): few
//! samples fill the space evenly, and every run has the same samples.
//!
//! Decision: assumptions of a plan ("these move alike", "this only translates", "this loop closes") are always
//! measured. Shifts that are constant in the plane change no force and are found by least squares. An assumption that
//! contradicts the motion is a fault with its position in the plan; an inexact one is a size in the report. At the end
//! the forces of the model are compared with the rig's.

use modelmill_rig::{BodyAnchor, BodyMotion, Rig, RigMotion, RigPoseError, RigState, RigTracker};
use nalgebra::{Vector2, Vector3};

/// The plane of motion, in the rig's base frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionPlane {
    /// Origin of the model, m.
    pub(crate) at: Vector3<f64>,
    /// Unit vector of the model's x axis.
    pub(crate) x: Vector3<f64>,
    /// Unit vector of the model's y axis.
    pub(crate) y: Vector3<f64>,
    /// Unit normal.
    pub(crate) normal: Vector3<f64>,
}

impl MotionPlane {
    /// The plane with a normal and an x direction, which need not be perpendicular to each other.
    pub(crate) fn new(at: [f64; 3], normal: [f64; 3], x: [f64; 3]) -> Self {
        let normal = Vector3::from(normal).normalize();
        let x = Vector3::from(x);
        // The component of x in the plane.
        let x = (x - normal * normal.dot(&x)).normalize();
        Self {
            at: Vector3::from(at),
            x,
            y: normal.cross(&x),
            normal,
        }
    }

    /// Components of a vector along x and y.
    pub(crate) fn components(&self, v: &Vector3<f64>) -> Vector2<f64> {
        Vector2::new(self.x.dot(v), self.y.dot(v))
    }

    /// The projection of a position onto the plane, m.
    pub(crate) fn plane_position(&self, p: &Vector3<f64>) -> Vector2<f64> {
        self.components(&(p - self.at))
    }
}

/// A state with the motion of all bodies.
#[derive(Clone, Debug)]
pub(crate) struct MotionSample {
    /// Coordinates, rates and accelerations.
    pub(crate) state: RigState,
    /// Motion of all bodies.
    pub(crate) motion: RigMotion,
}

impl MotionSample {
    /// The motion of a body; none for the base.
    pub(crate) fn body(&self, body: Option<usize>) -> Option<&BodyMotion> {
        body.and_then(|b| self.motion.bodies.get(b))
    }

    /// The position of an anchor in the base frame, m.
    pub(crate) fn place(&self, anchor: &BodyAnchor) -> Vector3<f64> {
        self.body(anchor.body)
            .map_or(anchor.at, |body| body.point_position(&anchor.at))
    }

    /// The acceleration of an anchor in the base frame, m/s^2.
    pub(crate) fn acceleration(&self, anchor: &BodyAnchor) -> Vector3<f64> {
        self.body(anchor.body)
            .map_or_else(Vector3::zeros, |body| body.point_acceleration(&anchor.at))
    }
}

/// The nominal configuration and motions around it.
pub(crate) struct MotionSamples {
    /// The nominal configuration at standstill.
    pub(crate) nominal: MotionSample,
    /// The samples.
    pub(crate) moments: Vec<MotionSample>,
    /// Number of states that could not be reached.
    pub(crate) n_out_of_reach: usize,
    /// The joint with the largest gap of all poses, and this gap in m or rad. Above rounding only with a tolerance.
    pub(crate) largest_gap: (String, f64),
}

impl MotionSamples {
    /// Samples with coordinates up to `range` (rad or m) from nominal, and rates and accelerations up to 1.
    ///
    /// Fails if the rig cannot be assembled in its nominal configuration.
    pub(crate) fn new(rig: &Rig, number: usize, range: f64) -> Result<Self, RigPoseError> {
        // The nominal configuration at standstill.
        let mut tracker = RigTracker::new(rig)?;
        let q0 = tracker.coordinates().to_vec();
        let rest = vec![0.0; q0.len()];
        let state = RigState {
            q: q0.clone(),
            qd: rest.clone(),
            qdd: rest,
        };
        let nominal = MotionSample {
            motion: tracker.follow(&state)?,
            state,
        };
        let mut moments = Vec::new();
        let mut n_out_of_reach = 0;
        let mut largest_gap = tracker.largest_gap();
        for state in sampled_states(&q0, number, range) {
            // Each pose is solved from the nominal configuration, so that all have the same assembly mode.
            let mut from_nominal = tracker.clone();
            match from_nominal.follow(&state) {
                Ok(motion) => {
                    let gap = from_nominal.largest_gap();
                    if gap.1 > largest_gap.1 {
                        largest_gap = gap;
                    }
                    moments.push(MotionSample { state, motion });
                }
                Err(_) => n_out_of_reach += 1,
            }
        }
        Ok(Self {
            nominal,
            moments,
            n_out_of_reach,
            largest_gap: (largest_gap.0.to_owned(), largest_gap.1),
        })
    }

    /// The largest magnitude of a quantity over all samples; NaN if any is NaN.
    pub(crate) fn largest(&self, of: impl Fn(&MotionSample) -> f64) -> f64 {
        self.moments
            .iter()
            .map(of)
            .fold(0.0, |most: f64, x| if x.is_nan() { x } else { most.max(x.abs()) })
    }
}

/// The rig's forces at sampled motions around its nominal configuration, for a comparison with a model: pairs of a
/// state and one force per drive (N or N m). Poses that cannot be reached are left out.
///
/// Fails if the rig cannot be assembled, or its drives cannot balance a load.
pub fn sampled_forces(rig: &Rig, number: usize, range: f64) -> Result<Vec<(RigState, Vec<f64>)>, RigPoseError> {
    let samples = MotionSamples::new(rig, number, range)?;
    let moments = samples.moments.into_iter();
    moments
        .map(|moment| Ok((moment.state, modelmill_rig::forces(rig, &moment.motion)?)))
        .collect()
}

/// The states of a low-discrepancy sequence in 3n dimensions, around the coordinates `q0`.
fn sampled_states(q0: &[f64], number: usize, range: f64) -> impl Iterator<Item = RigState> {
    let n = q0.len();
    let dimension = 3 * n;
    // The positive root of x^(d+1) = x + 1, by fixed-point iteration; its powers are the steps of the sequence.
    let mut root: f64 = 1.5;
    for _ in 0..60 {
        root = (1.0 + root).powf(1.0 / (dimension as f64 + 1.0));
    }
    (0..number).map(move |i| {
        let draw = |k: usize| {
            // A number between -1 and 1.
            let step = root.powi(-(i32::try_from(k).unwrap_or(i32::MAX - 1) + 1));
            2.0 * (0.5 + (i as f64 + 1.0) * step).fract() - 1.0
        };
        RigState {
            q: (0..n).map(|k| q0[k] + range * draw(k)).collect(),
            qd: (n..2 * n).map(draw).collect(),
            qdd: (2 * n..3 * n).map(draw).collect(),
        }
    })
}
