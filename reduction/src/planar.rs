//! Step 1: bodies as they are in the plane of motion, and the checks that they may be seen so.
//!
//! Bodies of a rig go in; mass, centre and inertia in the plane come out, with how far each group's centre of mass is
//! from the plane and its principal axis from the normal.

use modelmill_rig::Rig;
use nalgebra::{Matrix3, Vector2, Vector3};

use crate::report::{Report, Size};
use crate::samples::{Plane, Samples};

/// A body with all masses that are fixed to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Solid {
    pub(crate) mass: f64,
    /// Centre of mass in the body's frame.
    pub(crate) centre: Vector3<f64>,
    /// Inertia about the centre along the body's axes.
    pub(crate) inertia: Matrix3<f64>,
}

/// A body of the rig together with its lumped masses, by the theorem of Steiner.
pub(crate) fn solid(rig: &Rig, body: usize) -> Solid {
    let own = &rig.bodies[body];
    let mut parts = vec![Solid {
        mass: own.mass,
        centre: own.centre,
        inertia: own.inertia,
    }];
    for lumped in rig
        .lumped_masses
        .iter()
        .filter(|lumped| lumped.at.body == Some(body))
    {
        parts.push(Solid {
            mass: lumped.mass,
            centre: lumped.at.at,
            inertia: Matrix3::zeros(),
        });
    }
    merge(&parts)
}

fn merge(parts: &[Solid]) -> Solid {
    let mass: f64 = parts.iter().map(|part| part.mass).sum();
    let moment: Vector3<f64> = parts.iter().map(|part| part.mass * part.centre).sum();
    let centre = if mass > 0.0 {
        moment / mass
    } else {
        parts[0].centre
    };
    let about = |part: &Solid| {
        let d = part.centre - centre;
        part.inertia + part.mass * (Matrix3::identity() * d.norm_squared() - d * d.transpose())
    };
    Solid {
        mass,
        centre,
        inertia: parts.iter().map(about).sum(),
    }
}

/// A body in the plane, nominal configuration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Flat {
    pub(crate) mass: f64,
    /// Centre of mass in the plane.
    pub(crate) centre: Vector2<f64>,
    /// Inertia about the normal through the centre.
    pub(crate) inertia: f64,
}

/// One body as the plane sees it.
pub(crate) fn flat(rig: &Rig, body: usize, plane: &Plane, samples: &Samples) -> Flat {
    let solid = solid(rig, body);
    let moves = &samples.nominal.motion.bodies[body];
    let n = moves.R_WB.transpose() * plane.normal;
    Flat {
        mass: solid.mass,
        centre: plane.place(&moves.place(&solid.centre)),
        inertia: n.dot(&(solid.inertia * n)),
    }
}

/// Checks that all bodies move in the plane; the largest rate out of it, with the rates of the samples up to 1.
pub(crate) fn out_of_plane(plane: &Plane, samples: &Samples) -> f64 {
    samples.largest(|moment| {
        let bodies = moment.motion.bodies.iter();
        bodies.fold(0.0, |most: f64, body| {
            let slides = plane.normal.dot(&body.v_WB_W).abs();
            let tips = plane.normal.cross(&body.w_WB_W).norm();
            most.max(slides).max(tips)
        })
    })
}

/// How far a group is from one that the plane halves.
pub(crate) fn check_group(
    rig: &Rig,
    name: &str,
    bodies: &[usize],
    plane: &Plane,
    samples: &Samples,
    report: &mut Report,
) {
    let in_base: Vec<Solid> = bodies
        .iter()
        .map(|body| {
            let solid = solid(rig, *body);
            let moves = &samples.nominal.motion.bodies[*body];
            Solid {
                mass: solid.mass,
                centre: moves.place(&solid.centre),
                inertia: moves.R_WB * solid.inertia * moves.R_WB.transpose(),
            }
        })
        .collect();
    let whole = merge(&in_base);
    let offset = plane.normal.dot(&(whole.centre - plane.at));
    let turned = whole.inertia * plane.normal;
    let moment = plane.normal.dot(&turned);
    let product = (turned - moment * plane.normal).norm();
    let tilt = if product > 1e-12 * moment.abs().max(whole.inertia.amax()) {
        let eigen = whole.inertia.symmetric_eigen();
        let nearest = (0..3)
            .map(|k| eigen.eigenvectors.column(k).dot(&plane.normal).abs())
            .fold(0.0, f64::max);
        nearest.min(1.0).acos()
    } else {
        0.0
    };
    let sizes = vec![
        Size::new("centre of mass out of the plane", offset, "m"),
        Size::new("principal axis off the normal", tilt, "rad"),
        Size::new("product of inertia", product, "kg m^2"),
    ];
    let says = if sizes.iter().any(Size::is_felt) {
        "is not halved by the plane; bearings feel it, planar motion and its drives do not"
    } else {
        "centre of mass in the plane, principal axis perpendicular"
    };
    report.add(1, name, says, sizes);
}
