//! Step 2: groups that move alike become one substitution part; groups that only translate become point masses.
//!
//! The motion is checked along samples: the bodies of a part must keep their positions relative to each other, up to a
//! constant shift in the plane, which changes no force. Then eq. (1) of the paper gives mass, centre and inertia of the
//! part.

use modelmill_rig::{BodyAnchor, Rig};
use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use crate::planar::{PlanarBody, planar_body};
use crate::report::{AssumptionSize, ReductionReport};
use crate::samples::{MotionPlane, MotionSample, MotionSamples};

/// A substitution part: several bodies of the rig as one body of the model.
#[derive(Clone, Debug)]
pub(crate) struct SubstitutionPart {
    /// Name of the part.
    pub(crate) name: String,
    /// Indices of the bodies of all its groups, the leading one first.
    pub(crate) bodies: Vec<usize>,
    /// Index of the part that carries it; none is the base.
    pub(crate) parent: Option<usize>,
    /// Its joint, as a point of its carrier and of its leading body.
    pub(crate) joint: [BodyAnchor; 2],
    /// The end of its longitudinal axis, on the leading body.
    pub(crate) to: BodyAnchor,
    /// Constant shift of the part in the model relative to the rig, m.
    pub(crate) shift: Vector2<f64>,
}

impl SubstitutionPart {
    /// Direction of its longitudinal axis in the nominal configuration, rad.
    pub(crate) fn nominal_angle(&self, plane: &MotionPlane, samples: &MotionSamples) -> f64 {
        let nominal = &samples.nominal;
        // From the joint to the end of the axis, in the plane.
        let axis =
            plane.plane_position(&nominal.place(&self.to)) - plane.plane_position(&nominal.place(&self.joint[1]));
        axis.y.atan2(axis.x)
    }

    /// Its rotation since the nominal configuration, rad, between -pi and pi.
    pub(crate) fn rotation_angle(&self, moment: &MotionSample, plane: &MotionPlane, samples: &MotionSamples) -> f64 {
        body_rotation(self.bodies[0], moment, plane, samples)
    }

    /// A point of its leading body in the frame of the part, m.
    pub(crate) fn local_position(
        &self,
        anchor: &BodyAnchor,
        plane: &MotionPlane,
        samples: &MotionSamples,
    ) -> Vector2<f64> {
        let nominal = &samples.nominal;
        // Relative to the joint, turned into the axes of the part.
        let d = plane.plane_position(&nominal.place(anchor)) - plane.plane_position(&nominal.place(&self.joint[1]));
        rotation(-self.nominal_angle(plane, samples)) * d
    }

    /// The position in the plane, in the model, of a point of its frame at a sample, m.
    pub(crate) fn model_position(
        &self,
        local: &Vector2<f64>,
        moment: &MotionSample,
        plane: &MotionPlane,
        samples: &MotionSamples,
    ) -> Vector2<f64> {
        let angle = self.nominal_angle(plane, samples) + self.rotation_angle(moment, plane, samples);
        plane.plane_position(&moment.place(&self.joint[1])) + self.shift + rotation(angle) * local
    }
}

/// The rotation matrix of the plane for an angle in rad.
pub(crate) fn rotation(angle: f64) -> Matrix2<f64> {
    let (s, c) = angle.sin_cos();
    Matrix2::new(c, -s, s, c)
}

/// The rotation of a body about the normal since the nominal configuration, rad.
pub(crate) fn body_rotation(body: usize, moment: &MotionSample, plane: &MotionPlane, samples: &MotionSamples) -> f64 {
    // The direction of the body that was along x of the plane in the nominal configuration.
    let then = samples.nominal.motion.bodies[body].R_WB.transpose() * plane.x;
    let now = plane.components(&(moment.motion.bodies[body].R_WB * then));
    now.y.atan2(now.x)
}

/// An angle between -pi and pi.
pub(crate) fn wrap_angle(angle: f64) -> f64 {
    let turn = 2.0 * std::f64::consts::PI;
    angle - turn * (angle / turn).round()
}

/// Mass, centre in the part's frame and inertia of all its bodies, eq. (1). Reports how closely the bodies move alike.
pub(crate) fn substitute(
    rig: &Rig,
    part: &SubstitutionPart,
    plane: &MotionPlane,
    samples: &MotionSamples,
    report: &mut ReductionReport,
) -> PlanarBody {
    // Each body in the frame of the part, as it moves along the samples.
    let lead = part.bodies[0];
    let angle = part.nominal_angle(plane, samples);
    let mut flats = Vec::new();
    for &body in &part.bodies {
        let seen = planar_body(rig, body, plane, samples);
        // A body of the part must not rotate relative to the leading one.
        let twist = samples.largest(|moment| {
            wrap_angle(body_rotation(body, moment, plane, samples) - body_rotation(lead, moment, plane, samples))
        });
        let solid = crate::planar::spatial_body(rig, body);
        let at = BodyAnchor {
            body: Some(body),
            at: solid.centre,
        };
        // Its centre of mass must move like a point of the part, up to a shift.
        let (arm, shift, strays) = fit_carried_point(part, &at, plane, samples);
        // The leading body defines the motion, so that it has no errors.
        if body != lead {
            report.add(
                2,
                &part.name,
                format!(
                    "`{}` moves like `{}`, shifted by ({}, {}) m, which changes no force",
                    rig.bodies[body].name,
                    rig.bodies[lead].name,
                    crate::write::significant_digits(shift.x, 6),
                    crate::write::significant_digits(shift.y, 6)
                ),
                vec![
                    AssumptionSize::new("angle between them changes by", twist, "rad"),
                    AssumptionSize::new("position changes by", strays, "m"),
                ],
            );
        }
        flats.push(PlanarBody {
            centre: rotation(-angle) * arm,
            ..seen
        });
    }
    merge_bodies(&flats)
}

/// Fits the motion of a point that is carried by a part, `joint + rotation * arm + shift`, by least squares. Returns
/// arm, shift and the largest residual, m.
pub(crate) fn fit_carried_point(
    part: &SubstitutionPart,
    at: &BodyAnchor,
    plane: &MotionPlane,
    samples: &MotionSamples,
) -> (Vector2<f64>, Vector2<f64>, f64) {
    // Two rows per sample; the nominal configuration is the last one.
    let n = samples.moments.len() + 1;
    let mut matrix = DMatrix::zeros(2 * n, 4);
    let mut right = DVector::zeros(2 * n);
    let moments = || samples.moments.iter().chain([&samples.nominal]);
    for (i, moment) in moments().enumerate() {
        // Position relative to the joint: rotation times arm, plus shift.
        let (s, c) = part.rotation_angle(moment, plane, samples).sin_cos();
        let d = plane.plane_position(&moment.place(at)) - plane.plane_position(&moment.place(&part.joint[1]));
        for (row, values) in [(2 * i, [c, -s, 1.0, 0.0]), (2 * i + 1, [s, c, 0.0, 1.0])] {
            for (k, value) in values.into_iter().enumerate() {
                matrix[(row, k)] = value;
            }
            right[row] = d[row % 2];
        }
    }
    // A point of the leading body has no shift; for a part that never rotates the fit could not distinguish arm and
    // shift.
    let solved = if at.body == Some(part.bodies[0]) {
        None
    } else {
        matrix.clone().svd(true, true).solve(&right, 1e-9).ok()
    };
    // Otherwise the arm is the position in the nominal configuration, without a shift.
    let x = solved.unwrap_or_else(|| DVector::from_vec(vec![right[2 * n - 2], right[2 * n - 1], 0.0, 0.0]));
    let strays = (matrix * &x - right).amax();
    (Vector2::new(x[0], x[1]), Vector2::new(x[2], x[3]), strays)
}

/// Eq. (1): total mass, common centre of mass, and inertia about it (Steiner).
pub(crate) fn merge_bodies(flats: &[PlanarBody]) -> PlanarBody {
    let mass: f64 = flats.iter().map(|flat| flat.mass).sum();
    let moment: Vector2<f64> = flats.iter().map(|flat| flat.mass * flat.centre).sum();
    let centre = if mass > 0.0 { moment / mass } else { Vector2::zeros() };
    // Inertias about the common centre add up.
    let inertia = flats
        .iter()
        .map(|flat| flat.inertia + flat.mass * (flat.centre - centre).norm_squared())
        .sum();
    PlanarBody { mass, centre, inertia }
}

/// The three residuals of eq. (1) between the exact values of a part and those of the model.
pub(crate) fn part_residuals(whole: &PlanarBody, said: &PlanarBody) -> Vec<AssumptionSize> {
    vec![
        AssumptionSize::new("eq. (1): mass", whole.mass - said.mass, "kg"),
        AssumptionSize::new("centre", (whole.centre - said.centre).norm(), "m"),
        AssumptionSize::new("inertia", whole.inertia - said.inertia, "kg m^2"),
    ]
}

/// Replaces groups by point masses, and returns the mass in kg. Reports the residuals of eq. (1) in the nominal
/// configuration, and whether they have an effect on the forces.
///
/// `points` are the positions of the masses, in equal shares, on bodies of the rig.
pub(crate) fn lump_mass(
    rig: &Rig,
    name: &str,
    bodies: &[usize],
    points: &[BodyAnchor],
    plane: &MotionPlane,
    samples: &MotionSamples,
    report: &mut ReductionReport,
) -> f64 {
    let flats: Vec<PlanarBody> = bodies
        .iter()
        .map(|body| planar_body(rig, *body, plane, samples))
        .collect();
    // The exact values of the groups, and those of the point masses.
    let whole = merge_bodies(&flats);
    let masses: Vec<PlanarBody> = points
        .iter()
        .map(|point| PlanarBody {
            mass: whole.mass / points.len() as f64,
            centre: plane.plane_position(&samples.nominal.place(point)),
            inertia: 0.0,
        })
        .collect();
    // Residuals have no effect if the bodies do not rotate and accelerate like the points.
    let turns = samples.largest(|moment| {
        bodies.iter().fold(0.0, |most: f64, b| {
            most.max(moment.motion.bodies[*b].w_WB_W.dot(&plane.normal).abs())
        })
    });
    // The largest difference of acceleration between a body's centre and any of the points.
    let strays = samples.largest(|moment| {
        let mut most: f64 = 0.0;
        for body in bodies {
            let centre = BodyAnchor {
                body: Some(*body),
                at: crate::planar::spatial_body(rig, *body).centre,
            };
            for point in points {
                let difference = moment.acceleration(&centre) - moment.acceleration(point);
                most = most.max(plane.components(&difference).norm());
            }
        }
        most
    });
    let mut sizes = part_residuals(&whole, &merge_bodies(&masses));
    sizes.push(AssumptionSize::new("largest rate of rotation", turns, "rad/s"));
    sizes.push(AssumptionSize::new(
        "largest difference of acceleration",
        strays,
        "m/s^2",
    ));
    // Entries 3 and 4 are the rate of rotation and the difference of acceleration.
    let says = if sizes[3].is_significant() || sizes[4].is_significant() {
        "becomes a point mass; it rotates or moves differently from the point, so the residuals have an effect on the forces"
    } else {
        "becomes a point mass; it only translates with the point, so its centre and inertia change no force"
    };
    report.add(2, name, says, sizes);
    whole.mass
}
