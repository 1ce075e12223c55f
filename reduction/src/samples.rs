//! Poses and motions of the full robot, at which every claim of a reduction is checked.
//!
//! Coordinates, rates and accelerations come from a low-discrepancy sequence (M. Roberts 2018, after H. Weyl), so
//! that few samples fill the space evenly and every run has the same ones.
//!
//! Decision: claims of a plan ("these move alike", "this only translates", "this loop closes") are measured and
//! never assumed. Shifts that are constant in the plane change no force and are found by least squares. A claim
//! that contradicts the motion is a fault with its place in the plan; an inexact one is a size in the report. At
//! the end the forces of the model are compared with the rig's.

use modelmill_rig::{Anchor, BodyMotion, Motion, PoseError, Rig, State, Tracker};
use nalgebra::{Vector2, Vector3};

/// The plane of motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plane {
    pub(crate) at: Vector3<f64>,
    pub(crate) x: Vector3<f64>,
    pub(crate) y: Vector3<f64>,
    pub(crate) normal: Vector3<f64>,
}

impl Plane {
    /// From two directions that span it with its normal; they need not be normal to each other.
    pub(crate) fn new(at: [f64; 3], normal: [f64; 3], x: [f64; 3]) -> Self {
        let normal = Vector3::from(normal).normalize();
        let x = Vector3::from(x);
        let x = (x - normal * normal.dot(&x)).normalize();
        Self {
            at: Vector3::from(at),
            x,
            y: normal.cross(&x),
            normal,
        }
    }

    /// Components of a direction.
    pub(crate) fn flat(&self, v: &Vector3<f64>) -> Vector2<f64> {
        Vector2::new(self.x.dot(v), self.y.dot(v))
    }

    /// Where a place is in the plane.
    pub(crate) fn place(&self, p: &Vector3<f64>) -> Vector2<f64> {
        self.flat(&(p - self.at))
    }
}

/// A state with the motion of all bodies.
#[derive(Clone, Debug)]
pub(crate) struct Moment {
    pub(crate) state: State,
    pub(crate) motion: Motion,
}

impl Moment {
    /// How a body moves; the base rests.
    pub(crate) fn body(&self, body: Option<usize>) -> Option<&BodyMotion> {
        body.and_then(|b| self.motion.bodies.get(b))
    }

    /// Where an anchor is.
    pub(crate) fn place(&self, anchor: &Anchor) -> Vector3<f64> {
        self.body(anchor.body)
            .map_or(anchor.at, |body| body.place(&anchor.at))
    }

    /// How an anchor accelerates.
    pub(crate) fn acceleration(&self, anchor: &Anchor) -> Vector3<f64> {
        self.body(anchor.body)
            .map_or_else(Vector3::zeros, |body| body.acceleration(&anchor.at))
    }
}

/// The nominal configuration and motions around it.
pub(crate) struct Samples {
    pub(crate) nominal: Moment,
    pub(crate) moments: Vec<Moment>,
    /// How many states could not be reached.
    pub(crate) n_out_of_reach: usize,
}

impl Samples {
    /// Motions with coordinates up to `range` from nominal, rates and accelerations up to 1.
    ///
    /// Fails when the rig does not stand in its nominal configuration.
    pub(crate) fn new(rig: &Rig, number: usize, range: f64) -> Result<Self, PoseError> {
        let mut tracker = Tracker::new(rig)?;
        let q0 = tracker.coordinates().to_vec();
        let rest = vec![0.0; q0.len()];
        let state = State {
            q: q0.clone(),
            qd: rest.clone(),
            qdd: rest,
        };
        let nominal = Moment {
            motion: tracker.follow(&state)?,
            state,
        };
        let mut moments = Vec::new();
        let mut n_out_of_reach = 0;
        for state in states(&q0, number, range) {
            // Each from the nominal configuration, so that all are assembled alike.
            let mut from_nominal = tracker.clone();
            match from_nominal.follow(&state) {
                Ok(motion) => moments.push(Moment { state, motion }),
                Err(_) => n_out_of_reach += 1,
            }
        }
        Ok(Self {
            nominal,
            moments,
            n_out_of_reach,
        })
    }

    /// The largest of a quantity over all motions.
    pub(crate) fn largest(&self, of: impl Fn(&Moment) -> f64) -> f64 {
        self.moments.iter().map(of).fold(
            0.0,
            |most: f64, x| if x.is_nan() { x } else { most.max(x.abs()) },
        )
    }
}

/// The rig's own forces at motions around its nominal configuration, for a model to be held against: one state and
/// one force per drive each; poses out of reach are left out.
///
/// Fails when the rig does not stand, or its drives cannot balance a load.
pub fn sampled_forces(
    rig: &Rig,
    number: usize,
    range: f64,
) -> Result<Vec<(State, Vec<f64>)>, PoseError> {
    let samples = Samples::new(rig, number, range)?;
    let moments = samples.moments.into_iter();
    moments
        .map(|moment| Ok((moment.state, modelmill_rig::forces(rig, &moment.motion)?)))
        .collect()
}

fn states(q0: &[f64], number: usize, range: f64) -> impl Iterator<Item = State> {
    let n = q0.len();
    let dimension = 3 * n;
    // The positive root of x^(d+1) = x + 1.
    let mut root: f64 = 1.5;
    for _ in 0..60 {
        root = (1.0 + root).powf(1.0 / (dimension as f64 + 1.0));
    }
    (0..number).map(move |i| {
        let draw = |k: usize| {
            let step = root.powi(-(i32::try_from(k).unwrap_or(i32::MAX - 1) + 1));
            2.0 * (0.5 + (i as f64 + 1.0) * step).fract() - 1.0
        };
        State {
            q: (0..n).map(|k| q0[k] + range * draw(k)).collect(),
            qd: (n..2 * n).map(draw).collect(),
            qdd: (2 * n..3 * n).map(draw).collect(),
        }
    })
}
