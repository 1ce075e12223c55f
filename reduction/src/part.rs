//! Step 2: groups that move alike become one substitution part; groups that only translate become point masses.
//!
//! That they move alike is not taken on trust: along sampled motions the bodies of a part must keep their distances
//! up to a shift that is constant in the plane, which changes no force. Then eq. (1) of the paper gives mass, centre
//! and inertia of all together.

use modelmill_rig::{Anchor, Rig};
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use crate::planar::{Flat, flat};
use crate::report::{Report, Size};
use crate::samples::{Moment, Plane, Samples};

/// A substitution part in the making.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) name: String,
    /// Bodies of all its groups, the leading one first.
    pub(crate) bodies: Vec<usize>,
    /// The part that carries it.
    pub(crate) parent: Option<usize>,
    /// Where its joint is: on its carrier, and on its leading body.
    pub(crate) joint: [Anchor; 2],
    /// The end of its longitudinal axis.
    pub(crate) to: Anchor,
    /// By how much the model shifts it in the plane.
    pub(crate) shift: Vector2<f64>,
}

impl Part {
    /// Direction of its longitudinal axis in the nominal configuration, rad.
    pub(crate) fn nominal_angle(&self, plane: &Plane, samples: &Samples) -> f64 {
        let nominal = &samples.nominal;
        let axis =
            plane.place(&nominal.place(&self.to)) - plane.place(&nominal.place(&self.joint[1]));
        axis.y.atan2(axis.x)
    }

    /// By how much it has turned since then, rad, within half a turn.
    pub(crate) fn turned(&self, moment: &Moment, plane: &Plane, samples: &Samples) -> f64 {
        turned(self.bodies[0], moment, plane, samples)
    }

    /// A place of its leading body, in the part's frame.
    pub(crate) fn local(&self, anchor: &Anchor, plane: &Plane, samples: &Samples) -> Vector2<f64> {
        let nominal = &samples.nominal;
        let d = plane.place(&nominal.place(anchor)) - plane.place(&nominal.place(&self.joint[1]));
        rotation(-self.nominal_angle(plane, samples)) * d
    }

    /// Where the model has a place of its frame.
    pub(crate) fn placed(
        &self,
        local: &Vector2<f64>,
        moment: &Moment,
        plane: &Plane,
        samples: &Samples,
    ) -> Vector2<f64> {
        let angle = self.nominal_angle(plane, samples) + self.turned(moment, plane, samples);
        plane.place(&moment.place(&self.joint[1])) + self.shift + rotation(angle) * local
    }
}

/// A rotation in the plane.
pub(crate) fn rotation(angle: f64) -> Matrix2<f64> {
    let (s, c) = angle.sin_cos();
    Matrix2::new(c, -s, s, c)
}

/// By how much a body has turned about the normal since the nominal configuration.
fn turned(body: usize, moment: &Moment, plane: &Plane, samples: &Samples) -> f64 {
    let then = samples.nominal.motion.bodies[body].R_WB.transpose() * plane.x;
    let now = plane.flat(&(moment.motion.bodies[body].R_WB * then));
    now.y.atan2(now.x)
}

/// An angle within half a turn.
fn wrapped(angle: f64) -> f64 {
    let turn = 2.0 * std::f64::consts::PI;
    angle - turn * (angle / turn).round()
}

/// Mass, centre in the part's frame and inertia of all its bodies, eq. (1); how well they move alike is reported.
pub(crate) fn substitute(
    rig: &Rig,
    part: &Part,
    plane: &Plane,
    samples: &Samples,
    report: &mut Report,
) -> Flat {
    let lead = part.bodies[0];
    let angle = part.nominal_angle(plane, samples);
    let mut flats = Vec::new();
    for &body in &part.bodies {
        let seen = flat(rig, body, plane, samples);
        let twist = samples.largest(|moment| {
            wrapped(turned(body, moment, plane, samples) - turned(lead, moment, plane, samples))
        });
        let solid = crate::planar::solid(rig, body);
        let at = Anchor {
            body: Some(body),
            at: solid.centre,
        };
        let (arm, shift, strays) = ride(part, &at, plane, samples);
        if body != lead {
            report.add(
                2,
                &part.name,
                format!(
                    "`{}` moves like `{}`, shifted by ({}, {}) m, which changes no force",
                    rig.bodies[body].name,
                    rig.bodies[lead].name,
                    crate::write::digits(shift.x, 6),
                    crate::write::digits(shift.y, 6)
                ),
                vec![
                    Size::new("angle between them changes by", twist, "rad"),
                    Size::new("place strays by", strays, "m"),
                ],
            );
        }
        flats.push(Flat {
            centre: rotation(-angle) * arm,
            ..seen
        });
    }
    merge(&flats)
}

/// A place rides on a part if it is `joint + turn * arm + shift` at all times: arm and shift by least squares, and
/// the largest distance from that.
fn ride(
    part: &Part,
    at: &Anchor,
    plane: &Plane,
    samples: &Samples,
) -> (Vector2<f64>, Vector2<f64>, f64) {
    let n = samples.moments.len() + 1;
    let mut matrix = DMatrix::zeros(2 * n, 4);
    let mut right = DVector::zeros(2 * n);
    let moments = || samples.moments.iter().chain([&samples.nominal]);
    for (i, moment) in moments().enumerate() {
        let (s, c) = part.turned(moment, plane, samples).sin_cos();
        let d = plane.place(&moment.place(at)) - plane.place(&moment.place(&part.joint[1]));
        for (row, values) in [(2 * i, [c, -s, 1.0, 0.0]), (2 * i + 1, [s, c, 0.0, 1.0])] {
            for (k, value) in values.into_iter().enumerate() {
                matrix[(row, k)] = value;
            }
            right[row] = d[row % 2];
        }
    }
    // A place on the leading body rides without any shift, also on a part that never turns.
    let solved = if at.body == Some(part.bodies[0]) {
        None
    } else {
        matrix.clone().svd(true, true).solve(&right, 1e-9).ok()
    };
    let x = solved
        .unwrap_or_else(|| DVector::from_vec(vec![right[2 * n - 2], right[2 * n - 1], 0.0, 0.0]));
    let strays = (matrix * &x - right).amax();
    (Vector2::new(x[0], x[1]), Vector2::new(x[2], x[3]), strays)
}

/// Eq. (1): total mass, common centre, inertia about it.
pub(crate) fn merge(flats: &[Flat]) -> Flat {
    let mass: f64 = flats.iter().map(|flat| flat.mass).sum();
    let moment: Vector2<f64> = flats.iter().map(|flat| flat.mass * flat.centre).sum();
    let centre = if mass > 0.0 {
        moment / mass
    } else {
        Vector2::zeros()
    };
    let inertia = flats
        .iter()
        .map(|flat| flat.inertia + flat.mass * (flat.centre - centre).norm_squared())
        .sum();
    Flat {
        mass,
        centre,
        inertia,
    }
}

/// The three residuals of eq. (1) between what a part is and what the model says.
pub(crate) fn residuals(whole: &Flat, said: &Flat) -> Vec<Size> {
    vec![
        Size::new("eq. (1): mass", whole.mass - said.mass, "kg"),
        Size::new("centre", (whole.centre - said.centre).norm(), "m"),
        Size::new("inertia", whole.inertia - said.inertia, "kg m^2"),
    ]
}

/// A point mass in place of groups: residuals of eq. (1) in the nominal configuration, and whether they matter.
///
/// `points` are the places of the masses, in equal shares, on the bodies of the rig that they ride on.
pub(crate) fn lump(
    rig: &Rig,
    name: &str,
    bodies: &[usize],
    points: &[Anchor],
    plane: &Plane,
    samples: &Samples,
    report: &mut Report,
) -> f64 {
    let flats: Vec<Flat> = bodies
        .iter()
        .map(|body| flat(rig, *body, plane, samples))
        .collect();
    let whole = merge(&flats);
    let masses: Vec<Flat> = points
        .iter()
        .map(|point| Flat {
            mass: whole.mass / points.len() as f64,
            centre: plane.place(&samples.nominal.place(point)),
            inertia: 0.0,
        })
        .collect();
    let turns = samples.largest(|moment| {
        bodies.iter().fold(0.0, |most: f64, b| {
            most.max(moment.motion.bodies[*b].w_WB_W.dot(&plane.normal).abs())
        })
    });
    let strays = samples.largest(|moment| {
        let mut most: f64 = 0.0;
        for body in bodies {
            let centre = Anchor {
                body: Some(*body),
                at: crate::planar::solid(rig, *body).centre,
            };
            for point in points {
                let difference = moment.acceleration(&centre) - moment.acceleration(point);
                most = most.max(plane.flat(&difference).norm());
            }
        }
        most
    });
    let mut sizes = residuals(&whole, &merge(&masses));
    sizes.push(Size::new("turns at up to", turns, "rad/s"));
    sizes.push(Size::new("accelerates otherwise by up to", strays, "m/s^2"));
    let says = if sizes[3].is_felt() || sizes[4].is_felt() {
        "becomes a point mass; it turns or moves otherwise than the point, so that the residuals are felt"
    } else {
        "becomes a point mass; it only translates, with the point, so that its centre and inertia change no force"
    };
    report.add(2, name, says, sizes);
    whole.mass
}
