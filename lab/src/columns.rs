//! Columns of the library along a motion: what each kind could say at a place, whatever its values.

use modelmill_rig::RigEffect;

use crate::course::DrawnCourse;
use crate::hidden::effect;
use crate::placed::PlacedEffect;
use crate::plant::{DRIVES, PlantMotion};

/// A delay of this size stands for small ones, s.
const DELAY: f64 = 0.005;

/// Columns of a kind at its places; what bends its curve takes the value `constant`, and friction by load feels the
/// masses `beside` it. `None` for kinds that the rig does not know, or cannot have there.
pub fn columns(
    along: &PlantMotion,
    placed: &PlacedEffect,
    constant: f64,
    beside: &[RigEffect],
) -> Option<Vec<Vec<f64>>> {
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
    let with =
        |all: &[&[(&str, f64)]]| -> Option<Vec<Vec<f64>>> { all.iter().map(|values| of(kind, at, values)).collect() };
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
        "spring" => Some(
            [
                with(&[&[("k", 1.0)]])?,
                of("force_offset", at, &[("F0", 1.0)]).into_iter().collect(),
            ]
            .concat(),
        ),
        "force_ripple" => with(&[&[("As", 1.0), ("pitch", constant)], &[("Ac", 1.0), ("pitch", constant)]]),
        // Sine and cosine of the coordinate.
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
        // Moment of inertia about the pivot, and mass times distance of the centre.
        "rod_inertia" => with(&[
            &[("m", 0.0), ("c", 0.0), ("I", 1.0)],
            &[("m", 1.0), ("c", 0.5), ("I", 0.0)],
        ]),
        "point_mass" => with(&[&[("m", 1.0)]]),
        "gravity_tilt" => with(&[&[("tz", 1e-3)]]),
        // Points of a part at three distances say whatever mass, centre and inertia along a bar can.
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

/// Which of a kind's [`columns`] have values that physics wants positive, as far as they come first; the others may be
/// anything.
pub fn must_be_positive(kind: &str) -> &'static [bool] {
    match kind {
        "directional_viscous_friction" | "directional_coulomb_friction" => &[true, true],
        "force_offset" | "force_ripple" | "counterbalance" | "coupled_drive" | "rod_inertia" | "gravity_tilt"
        | "untied_part" => &[],
        // Of a spring the stiffness only, its rest being anywhere.
        _ => &[true],
    }
}

/// What bends the curve of a kind, in values to try; one value for kinds without.
pub fn constants(kind: &str) -> Vec<f64> {
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

/// How forces change when they are read later: the column of a small delay. `forces` gives them along any times.
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

/// Every column of the library at every place where it acts alone, for the question what no library can say.
pub fn library(along: &PlantMotion) -> Vec<Vec<f64>> {
    let mut all = Vec::new();
    let mut put = |kind: &str, at: &[&str], constant: f64| {
        all.extend(columns(along, &PlacedEffect::new(kind, at), constant, &[]).unwrap_or_default());
    };
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
