//! Gravity, total mass and size of a mechanism: wrong signs and units in the file are visible in these figures.
//!
//! A model goes in; its figures at the values of the file come out.

use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_spec::{Kinematics, PointIdx};
use serde_json::{Value, json};

use crate::model::Model;
use crate::model::sampled_rank::reachable_states;
use crate::model::thresholds::{EARTH_GRAVITY, ROUNDING_OF_SIZE, SIZE_POSES, SMALL_COMPONENT};
use crate::text::table::significant;

/// Gravity, mass and size of a mechanism at the values of its file.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelMagnitudes {
    /// Acceleration of gravity in the base frame, m/s^2.
    pub gravity: [f64; 3],
    /// What is unusual about gravity, as a sentence.
    pub gravity_remark: Option<String>,
    /// Sum of the nominal masses of all bodies that move, with masses at points, kg; `None` if the file does not give
    /// all of them.
    pub total_mass: Option<f64>,
    /// Box around the origins of all frames and all points at random poses, m: lower and upper end along x, y and z of
    /// the base frame. `None` if too few poses can be reached.
    pub extent: Option<[[f64; 2]; 3]>,
    /// Number of these poses.
    pub n_poses: usize,
}

impl ModelMagnitudes {
    /// The figures of a model.
    pub(crate) fn new(model: &Model) -> Self {
        let mechanism = &model.derivation.mechanism;
        let value = |symbol| mechanism.symbol_nominal(symbol);
        let gravity = mechanism.gravity.each_ref().map(|component| component.evaluate(&value));
        let (extent, n_poses) = extent(model);
        Self {
            gravity,
            gravity_remark: gravity_remark(gravity),
            total_mass: mechanism.total_nominal_mass(),
            extent,
            n_poses,
        }
    }

    /// Gravity as words: its magnitude and direction.
    pub(crate) fn gravity_text(&self) -> String {
        let magnitude = magnitude(self.gravity);
        if magnitude == 0.0 {
            return "none (the file has no `gravity`, or zero)".to_owned();
        }
        let direction = match main_axis(self.gravity) {
            Some((axis, sign)) => format!("along {sign}{axis} of the base"),
            None => {
                let components = self.gravity.map(|component| significant(component, 4));
                format!("with components ({}) in the base", components.join(", "))
            }
        };
        let text = format!("{} m/s^2 {direction}", significant(magnitude, 4));
        match &self.gravity_remark {
            Some(remark) => format!("{text}; {remark}"),
            None => text,
        }
    }

    /// The size as words.
    pub(crate) fn extent_text(&self) -> Option<String> {
        let lengths = self.extent?.map(|[low, high]| high - low);
        let largest = lengths.into_iter().fold(0.0, f64::max);
        let sides = lengths.map(|length| {
            // A quarter of a turn as a number leaves 1e-17 m across a plane.
            let is_rounding = length < ROUNDING_OF_SIZE * largest;
            significant(if is_rounding { 0.0 } else { length }, 3)
        });
        let poses = self.n_poses;
        Some(format!(
            "{} m along x, y, z: around all frames and points at {poses} random poses near the nominal one",
            sides.join(" x ")
        ))
    }

    /// The figures as JSON.
    pub(crate) fn json(&self) -> Value {
        json!({
            "gravity": {
                "vector": self.gravity,
                "magnitude": magnitude(self.gravity),
                "remark": self.gravity_remark,
            },
            "total_mass": self.total_mass,
            "extent": self.extent,
        })
    }
}

/// Length of a vector.
fn magnitude(vector: [f64; 3]) -> f64 {
    vector.iter().map(|component| component * component).sum::<f64>().sqrt()
}

/// The axis along which a vector points, with its sign; `None` if it is oblique or zero.
fn main_axis(vector: [f64; 3]) -> Option<(&'static str, &'static str)> {
    let small = SMALL_COMPONENT * magnitude(vector);
    let mut large = (0..3).filter(|k| vector[*k].abs() > small);
    let k = large.next().filter(|_| large.next().is_none())?;
    let sign = if vector[k] < 0.0 { "-" } else { "+" };
    Some((["x", "y", "z"][k], sign))
}

/// What is unusual about gravity: its direction or its magnitude.
fn gravity_remark(gravity: [f64; 3]) -> Option<String> {
    let magnitude = magnitude(gravity);
    if magnitude == 0.0 {
        return None;
    }
    if !EARTH_GRAVITY.contains(&magnitude) {
        return Some("this is not the gravity of the Earth, 9.81 m/s^2: check value and unit".to_owned());
    }
    let (axis, sign) = main_axis(gravity)?;
    (sign == "+")
        .then(|| format!("it points up if {axis} points up: unless the base is mounted upside down, change its sign"))
}

/// Box around all frames and points at random poses, and the number of these poses.
fn extent(model: &Model) -> (Option<[[f64; 2]; 3]>, usize) {
    let poses = sampled_poses(model);
    let mechanism = &model.derivation.mechanism;
    let kinematics = Kinematics::new(mechanism);
    let mut all: Vec<[f64; 3]> = Vec::new();
    for pose in &poses {
        let placed = kinematics.poses(pose);
        all.extend(placed.frames().iter().map(|frame| frame.origin));
        all.extend((0..mechanism.points.len()).map(|i| kinematics.point_position(&placed, PointIdx(i))));
    }
    if all.is_empty() {
        return (None, 0);
    }
    let sides = std::array::from_fn(|k| {
        let along = all.iter().map(|position| position[k]);
        [
            along.clone().fold(f64::INFINITY, f64::min),
            along.fold(f64::NEG_INFINITY, f64::max),
        ]
    });
    (Some(sides), poses.len())
}

/// One state at standstill at these values of the active coordinates.
pub(crate) fn state_at_standstill(active: &[f64]) -> MotionStates<'_> {
    let zeros = vec![&[0.0][..]; active.len()];
    MotionStates {
        q: active.iter().map(std::slice::from_ref).collect(),
        qd: zeros.clone(),
        qdd: zeros,
        load: Vec::new(),
    }
}

/// All coordinates at random poses that the mechanism can reach, rad or m. Poses whose loops do not close are left out.
fn sampled_poses(model: &Model) -> Vec<Vec<f64>> {
    let Ok([positions, ..]) = reachable_states(model, SIZE_POSES) else {
        return Vec::new();
    };
    let coordinates = &model.derivation.mechanism.coordinates;
    let has_passive = coordinates.iter().any(|c| c.passive);
    let evaluator = ModelEvaluator::new(&model.derivation);
    let n = positions.first().map_or(0, Vec::len);
    (0..n)
        .filter_map(|sample| {
            let active: Vec<f64> = positions.iter().map(|column| column[sample]).collect();
            let passive = if has_passive {
                evaluator.passive_motion(&state_at_standstill(&active)).ok()?
            } else {
                Vec::new()
            };
            let (mut active, mut passive) = (active.into_iter(), passive.into_iter());
            coordinates
                .iter()
                .map(|c| {
                    if c.passive {
                        Some(passive.next()?[0])
                    } else {
                        active.next()
                    }
                })
                .collect()
        })
        .collect()
}
