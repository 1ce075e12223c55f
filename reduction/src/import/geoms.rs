//! Mass and inertia of homogeneous simple shapes about their own centres. Kinds, sizes and their order are those of
//! MuJoCo.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};

use super::description::DescriptionInertia;
use super::placed::DescriptionPose;

/// What to do where a mass cannot be computed.
pub(super) const GIVE_INERTIAL: &str =
    "give the body an <inertial>, which MuJoCo writes (mj_saveLastXML) with <compiler saveinertial=\"true\"/>";

/// A shape: its volume, and its moments of inertia per mass.
pub(crate) struct GeomShape {
    /// Volume, m^3.
    volume: f64,
    /// Principal moments about the centre for a mass of 1 kg, kg m^2.
    moments: [f64; 3],
}

impl GeomShape {
    /// A shape by MuJoCo's kind and sizes, m; `half` is half the length if both ends are given (`fromto`). None for
    /// kinds without mass, such as planes.
    pub(crate) fn new(kind: &str, size: &[f64], half: Option<f64>) -> Result<Option<Self>, String> {
        // A size of the list, which must be positive.
        let at = |k: usize| {
            size.get(k)
                .copied()
                .filter(|x| *x > 0.0)
                .ok_or_else(|| format!("a {kind} needs more positive numbers in `size`"))
        };
        let shape = match kind {
            "plane" | "hfield" => return Ok(None),
            // Solid shapes, with the z axis along the length.
            "sphere" => {
                let r = at(0)?;
                Self {
                    volume: 4.0 / 3.0 * PI * r.powi(3),
                    moments: [0.4 * r * r; 3],
                }
            }
            "ellipsoid" => {
                // With `fromto` the first size is both radii across.
                let [a, b, c] = match half {
                    Some(half) => [at(0)?, at(0)?, half],
                    None => [at(0)?, at(1)?, at(2)?],
                };
                Self {
                    volume: 4.0 / 3.0 * PI * a * b * c,
                    moments: [b * b + c * c, a * a + c * c, a * a + b * b].map(|sum| sum / 5.0),
                }
            }
            "box" => {
                // With `fromto` the first size is both half widths.
                let [a, b, c] = match half {
                    Some(half) => [at(0)?, at(0)?, half],
                    None => [at(0)?, at(1)?, at(2)?],
                };
                Self {
                    volume: 8.0 * a * b * c,
                    moments: [b * b + c * c, a * a + c * c, a * a + b * b].map(|sum| sum / 3.0),
                }
            }
            "cylinder" => {
                // Radius and half length.
                let (r, h) = (at(0)?, half.map_or_else(|| at(1), Ok)?);
                let across = r * r / 4.0 + h * h / 3.0;
                Self {
                    volume: 2.0 * PI * r * r * h,
                    moments: [across, across, r * r / 2.0],
                }
            }
            "capsule" => {
                let (r, h) = (at(0)?, half.map_or_else(|| at(1), Ok)?);
                // Volumes of the cylinder and of both caps, a sphere together.
                let (middle, caps) = (2.0 * PI * r * r * h, 4.0 / 3.0 * PI * r.powi(3));
                let volume = middle + caps;
                // The centre of each cap is 3/8 r beyond the end of the cylinder.
                let of_caps = 0.4 * r * r + h * h + 0.75 * h * r;
                let across = (middle * (r * r / 4.0 + h * h / 3.0) + caps * of_caps) / volume;
                let along = (middle * r * r / 2.0 + caps * 0.4 * r * r) / volume;
                Self {
                    volume,
                    moments: [across, across, along],
                }
            }
            other => {
                return Err(format!(
                    "mass and inertia of a {other} are not computed here; {GIVE_INERTIAL}"
                ));
            }
        };
        Ok(Some(shape))
    }

    /// Mass and inertia of the shape at a pose, from a mass in kg or else from a density in kg/m^3.
    pub(crate) fn inertial(&self, mass: Option<f64>, density: f64, at: DescriptionPose) -> DescriptionInertia {
        let mass = mass.unwrap_or(density * self.volume);
        let moments = Vector3::from(self.moments) * mass;
        DescriptionInertia {
            mass,
            at,
            inertia: Matrix3::from_diagonal(&moments),
        }
    }
}

/// Mass and inertia of several rigidly connected bodies, about their common centre of mass, in the axes of the frame.
pub(crate) fn combined_inertia(parts: &[DescriptionInertia]) -> DescriptionInertia {
    let mass: f64 = parts.iter().map(|part| part.mass).sum();
    if mass <= 0.0 {
        return DescriptionInertia::default();
    }
    // The common centre of mass.
    let moment: Vector3<f64> = parts.iter().map(|part| part.mass * part.at.p).sum();
    let centre = moment / mass;
    let mut inertia = Matrix3::zeros();
    for part in parts {
        // Rotate into the axes of the frame, then shift to the common centre (Steiner).
        let c = part.at.p - centre;
        inertia += part.at.r * part.inertia * part.at.r.transpose()
            + part.mass * (Matrix3::identity() * c.norm_squared() - c * c.transpose());
    }
    DescriptionInertia {
        mass,
        at: DescriptionPose {
            p: centre,
            r: Matrix3::identity(),
        },
        inertia,
    }
}
