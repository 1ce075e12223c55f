//! Step 1: projects bodies onto the plane of motion, and checks that this is permitted.
//!
//! Bodies of a rig go in; mass, centre and inertia in the plane come out, with the distance of each group's centre of
//! mass from the plane and the angle between its principal axis and the normal.

use modelmill_rig::Rig;
use nalgebra::{Matrix3, Vector2, Vector3};

use crate::report::{AssumptionSize, ReductionReport};
use crate::samples::{MotionPlane, MotionSamples};

/// A body with all masses that are fixed to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpatialBody {
    /// Mass, kg.
    pub(crate) mass: f64,
    /// Centre of mass in the body's frame, m.
    pub(crate) centre: Vector3<f64>,
    /// Inertia about the centre along the body's axes, kg m^2.
    pub(crate) inertia: Matrix3<f64>,
}

/// A body of the rig together with its lumped masses, by the theorem of Steiner.
pub(crate) fn spatial_body(rig: &Rig, body: usize) -> SpatialBody {
    // The body itself, then each lumped mass on it.
    let own = &rig.bodies[body];
    let mut parts = vec![SpatialBody {
        mass: own.mass,
        centre: own.centre,
        inertia: own.inertia,
    }];
    for lumped in rig.lumped_masses.iter().filter(|lumped| lumped.at.body == Some(body)) {
        parts.push(SpatialBody {
            mass: lumped.mass,
            centre: lumped.at.at,
            inertia: Matrix3::zeros(),
        });
    }
    merge_spatial(&parts)
}

/// Several rigidly connected bodies as one: total mass, common centre of mass, and inertia about it (Steiner).
fn merge_spatial(parts: &[SpatialBody]) -> SpatialBody {
    let mass: f64 = parts.iter().map(|part| part.mass).sum();
    // Without mass the centre has no meaning; any place is permitted.
    let moment: Vector3<f64> = parts.iter().map(|part| part.mass * part.centre).sum();
    let centre = if mass > 0.0 { moment / mass } else { parts[0].centre };
    let about = |part: &SpatialBody| {
        let d = part.centre - centre;
        part.inertia + part.mass * (Matrix3::identity() * d.norm_squared() - d * d.transpose())
    };
    SpatialBody {
        mass,
        centre,
        inertia: parts.iter().map(about).sum(),
    }
}

/// A body in the plane, nominal configuration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlanarBody {
    /// Mass, kg.
    pub(crate) mass: f64,
    /// Centre of mass in the plane, m.
    pub(crate) centre: Vector2<f64>,
    /// Inertia about the normal through the centre, kg m^2.
    pub(crate) inertia: f64,
}

/// The projection of a body onto the plane, in the nominal configuration.
pub(crate) fn planar_body(rig: &Rig, body: usize, plane: &MotionPlane, samples: &MotionSamples) -> PlanarBody {
    let solid = spatial_body(rig, body);
    // The moment about the normal, in the axes of the body.
    let moves = &samples.nominal.motion.bodies[body];
    let n = moves.R_WB.transpose() * plane.normal;
    PlanarBody {
        mass: solid.mass,
        centre: plane.plane_position(&moves.point_position(&solid.centre)),
        inertia: n.dot(&(solid.inertia * n)),
    }
}

/// The largest rate of any body out of the plane, m/s or rad/s, while coordinates have rates up to 1.
pub(crate) fn out_of_plane_rate(plane: &MotionPlane, samples: &MotionSamples) -> f64 {
    samples.largest(|moment| {
        let bodies = moment.motion.bodies.iter();
        bodies.fold(0.0, |most: f64, body| {
            // Velocity along the normal, and rotation about other axes than the normal.
            let slides = plane.normal.dot(&body.v_WB_W).abs();
            let tips = plane.normal.cross(&body.w_WB_W).norm();
            most.max(slides).max(tips)
        })
    })
}

/// Reports how far a group is from symmetry about the plane: distance of its centre of mass, tilt of its principal
/// axis, and product of inertia.
pub(crate) fn check_group(
    rig: &Rig,
    name: &str,
    bodies: &[usize],
    plane: &MotionPlane,
    samples: &MotionSamples,
    report: &mut ReductionReport,
) {
    // The bodies of the group in the axes of the base, as one body.
    let in_base: Vec<SpatialBody> = bodies
        .iter()
        .map(|body| {
            let solid = spatial_body(rig, *body);
            let moves = &samples.nominal.motion.bodies[*body];
            SpatialBody {
                mass: solid.mass,
                centre: moves.point_position(&solid.centre),
                inertia: moves.R_WB * solid.inertia * moves.R_WB.transpose(),
            }
        })
        .collect();
    let whole = merge_spatial(&in_base);
    let offset = plane.normal.dot(&(whole.centre - plane.at));
    // The part of `I n` that is not along n is the product of inertia, which loads bearings only.
    let turned = whole.inertia * plane.normal;
    let moment = plane.normal.dot(&turned);
    let product = (turned - moment * plane.normal).norm();
    let tilt = if product > 1e-12 * moment.abs().max(whole.inertia.amax()) {
        // The principal axis that is nearest to the normal.
        let eigen = whole.inertia.symmetric_eigen();
        let nearest = (0..3)
            .map(|k| eigen.eigenvectors.column(k).dot(&plane.normal).abs())
            .fold(0.0, f64::max);
        nearest.min(1.0).acos()
    } else {
        0.0
    };
    let sizes = vec![
        AssumptionSize::new("centre of mass out of the plane", offset, "m"),
        AssumptionSize::new("angle of the principal axis to the normal", tilt, "rad"),
        AssumptionSize::new("product of inertia", product, "kg m^2"),
    ];
    let says = if sizes.iter().any(AssumptionSize::is_significant) {
        "is not halved by the plane; this loads bearings, but has no effect on planar motion and drives"
    } else {
        "centre of mass in the plane, principal axis perpendicular"
    };
    report.add(1, name, says, sizes);
}
