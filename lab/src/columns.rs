//! Columns of the library along a motion: a kind with its places goes in, its forces for unit values come out.
//!
//! The columns of a kind span all forces that it can have there for any values.

use modelmill_rig::RigEffect;

use crate::course::DrawnCourse;
use crate::hidden::effect;
use crate::placed::PlacedEffect;
use crate::plant::{DRIVES, PlantMotion};

/// Half the distance of the central difference that represents small delays, s.
const DELAY: f64 = 0.005;

/// Columns of a kind at its places, N for unit values, samples times drives.
///
/// The shape parameter of the kind has the value `constant`. Load friction depends on the effects `beside` it, such as
/// masses. `None` if the rig does not know the kind or cannot have it there.
pub fn columns(
    along: &PlantMotion,
    placed: &PlacedEffect,
    constant: f64,
    beside: &[RigEffect],
) -> Option<Vec<Vec<f64>>> {
    // The column of one effect with given values.
    let of = |kind: &str, at: &[String], values: &[(&str, f64)]| {
        let placed = PlacedEffect {
            kind: kind.to_owned(),
            at: at.to_vec(),
        };
        let unit = effect(along.rig(), &placed, values).ok()?;
        if kind == "load_friction" {
            return along.added_beside(beside, unit).ok();
        }
        along.added(&[unit]).ok()
    };
    let at = placed.at.as_slice();
    let kind = placed.kind.as_str();
    // One column per set of values of the kind itself.
    let with =
        |all: &[&[(&str, f64)]]| -> Option<Vec<Vec<f64>>> { all.iter().map(|values| of(kind, at, values)).collect() };
    // One column per unit mass at a point.
    let masses = |points: [&str; 3]| -> Option<Vec<Vec<f64>>> {
        let column = |p: &str| of("point_mass", &[p.to_owned()], &[("m", 1.0)]);
        points.into_iter().map(column).collect()
    };
    match kind {
        "viscous_friction" => with(&[&[("Fv", 1.0)]]),
        "coulomb_friction" => with(&[&[("Fc", 1.0)]]),
        "stribeck_friction" => with(&[&[("Fs", 1.0), ("vs", constant)]]),
        "quadratic_friction" => with(&[&[("Fq", 1.0)]]),
        "load_friction" => with(&[&[("mu", 1.0)]]),
        "directional_viscous_friction" => with(&[&[("Fvp", 1.0), ("Fvn", 0.0)], &[("Fvp", 0.0), ("Fvn", 1.0)]]),
        "directional_coulomb_friction" => with(&[&[("Fcp", 1.0), ("Fcn", 0.0)], &[("Fcp", 0.0), ("Fcn", 1.0)]]),
        "drive_inertia" => with(&[&[("Ia", 1.0)]]),
        "force_offset" => with(&[&[("F0", 1.0)]]),
        // The rest length of a spring acts as an offset.
        "spring" => Some(
            [
                with(&[&[("k", 1.0)]])?,
                of("force_offset", at, &[("F0", 1.0)]).into_iter().collect(),
            ]
            .concat(),
        ),
        "force_ripple" => with(&[&[("As", 1.0), ("pitch", constant)], &[("Ac", 1.0), ("pitch", constant)]]),
        // Sine and cosine of the coordinate: a ripple with one period per revolution.
        "counterbalance" => ["As", "Ac"]
            .iter()
            .map(|symbol| {
                of(
                    "force_ripple",
                    at,
                    &[(symbol, 1.0), ("pitch", 2.0 * std::f64::consts::PI)],
                )
            })
            .collect(),
        "coupled_drive" => with(&[&[("Ia", 1.0)], &[("Fv", 1.0)], &[("Fs", 1.0)]]),
        // Moment of inertia, and mass times distance of the centre.
        "rod_inertia" => with(&[
            &[("m", 0.0), ("c", 0.0), ("I", 1.0)],
            &[("m", 1.0), ("c", 0.5), ("I", 0.0)],
        ]),
        "point_mass" => with(&[&[("m", 1.0)]]),
        "gravity_tilt" => with(&[&[("tz", 1e-3)]]),
        // Point masses at three places represent any mass, centre and inertia along a bar.
        "untied_part" => match at {
            [part] if part == "crank_left" => masses(["R2m", "A_left", "R2m"]),
            [part] if part == "crank_right" => masses(["R4m", "A_right", "R4m"]),
            [part] if part == "coupler_left" => masses(["G9_upper", "G9_middle", "G9_lower"]),
            [part] if part == "coupler_right" => masses(["G10_upper", "G10_middle", "G10_lower"]),
            _ => None,
        },
        _ => None,
    }
}

/// Whether the values of the [`columns`] of a kind must be positive for physical reasons.
///
/// Columns beyond the end of the list may have any sign.
pub fn must_be_positive(kind: &str) -> &'static [bool] {
    match kind {
        "directional_viscous_friction" | "directional_coulomb_friction" => &[true, true],
        "force_offset" | "force_ripple" | "counterbalance" | "coupled_drive" | "rod_inertia" | "gravity_tilt"
        | "untied_part" => &[],
        // Of a spring only the stiffness, because its rest length may be on either side.
        _ => &[true],
    }
}

/// Values of the shape parameter to try for a kind, SI units; the single value 1 for kinds without one.
pub fn constants(kind: &str) -> Vec<f64> {
    // `n` values with a constant ratio.
    let geometric = |low: f64, high: f64, n: i32| -> Vec<f64> {
        let step = libm::log(high / low) / f64::from(n - 1);
        (0..n).map(|k| low * libm::exp(step * f64::from(k))).collect()
    };
    match kind {
        "stribeck_friction" => geometric(0.005, 0.2, 20),
        "force_ripple" => geometric(0.005, 0.25, 120),
        _ => vec![1.0],
    }
}

/// The column of a small delay: a central difference of the forces, N. `forces` returns them along a motion.
pub fn delay_column(
    along: &PlantMotion,
    course: &DrawnCourse,
    forces: &dyn Fn(&PlantMotion) -> Result<Vec<f64>, String>,
) -> Result<Vec<f64>, String> {
    let at = |shift: f64| {
        let times = along.times.iter().map(|t| t + shift).collect();
        forces(&PlantMotion::new(along.rig(), course, times)?)
    };
    let (later, earlier) = (at(DELAY)?, at(-DELAY)?);
    Ok(earlier.iter().zip(&later).map(|(a, b)| a - b).collect())
}

/// All columns of the library at all places, to check that a force is outside their span.
pub fn library(along: &PlantMotion) -> Vec<Vec<f64>> {
    let mut all = Vec::new();
    let mut put = |kind: &str, at: &[&str], constant: f64| {
        all.extend(columns(along, &PlacedEffect::new(kind, at), constant, &[]).unwrap_or_default());
    };
    // Nonlinear kinds have a few values of their shape parameter each.
    for drive in DRIVES {
        for kind in [
            "viscous_friction",
            "coulomb_friction",
            "quadratic_friction",
            "load_friction",
            "directional_viscous_friction",
            "directional_coulomb_friction",
            "drive_inertia",
            "force_offset",
            "spring",
            "rod_inertia",
        ] {
            put(kind, &[drive], 1.0);
        }
        for vs in [0.01, 0.03, 0.1] {
            put("stribeck_friction", &[drive], vs);
        }
        for pitch in [0.01, 0.02, 0.05, 0.1, 0.2] {
            put("force_ripple", &[drive], pitch);
        }
    }
    // Friction of joints, and point masses, which act outside the drives.
    for angle in ["gamma1", "gamma2", "theta1", "theta2"] {
        put("viscous_friction", &[angle], 1.0);
        put("coulomb_friction", &[angle], 1.0);
    }
    for point in ["R2m", "R4m", "A_left", "A_right"] {
        put("point_mass", &[point], 1.0);
    }
    put("coupled_drive", &DRIVES, 1.0);
    put("gravity_tilt", &["base"], 1.0);
    all
}
