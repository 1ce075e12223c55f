//! The direction from which a scene is viewed: a parallel projection onto the plane of the picture.

use nalgebra::Vector3;

use crate::scene::{MarkShape, MechanismScene};

/// Azimuth of the oblique view unless another one shows more, rad.
const USUAL_AZIMUTH: f64 = -0.9;
/// Elevation of the oblique view, rad.
const ELEVATION: f64 = 0.42;
/// Number of azimuths that are tried.
const AZIMUTHS: u8 = 12;
/// Increase of the mean logarithm of visible shares from which another azimuth is used: 5 %. By judgement.
const CLEARLY_MORE: f64 = 0.05;
/// Share of its length below which a link counts as hidden. By judgement.
const HIDDEN_SHARE: f64 = 0.1;

/// A direction of view, by the two axes of the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewDirection {
    /// The direction to the right in the picture; a unit vector in the base frame.
    pub right: Vector3<f64>,
    /// The upward direction in the picture; a unit vector in the base frame.
    pub up: Vector3<f64>,
}

impl ViewDirection {
    /// The view from an azimuth around the vertical, from the base's x axis, and an elevation above the horizon, rad.
    pub fn from_angles(scene: &MechanismScene, azimuth: f64, elevation: f64) -> Self {
        // The vertical is opposite to gravity, or z without gravity.
        let vertical = scene.down.map_or_else(Vector3::z, |down| -down);
        // Horizontal directions: x of the base, or another axis if x is nearly vertical.
        let level = |axis: Vector3<f64>| axis - vertical * axis.dot(&vertical);
        let ahead = [Vector3::x(), Vector3::y()].map(level);
        let ahead = ahead.into_iter().find(|a| a.norm() > 0.5);
        let ahead = ahead.unwrap_or_else(Vector3::z).normalize();
        let side = vertical.cross(&ahead);
        let around = ahead * azimuth.cos() + side * azimuth.sin();
        // The viewer's direction, and the horizontal axis of the picture.
        let towards = around * elevation.cos() + vertical * elevation.sin();
        let right = side * azimuth.cos() - ahead * azimuth.sin();
        Self {
            right,
            up: towards.cross(&right),
        }
    }

    /// Unit vector towards the viewer.
    pub fn viewer_direction(&self) -> Vector3<f64> {
        self.right.cross(&self.up)
    }

    /// Coordinates of a place in the picture: to the right and up, m.
    pub fn project(&self, at: &Vector3<f64>) -> [f64; 2] {
        [at.dot(&self.right), at.dot(&self.up)]
    }
}

impl MechanismScene {
    /// The most informative view: onto the plane of motion if there is one, else obliquely from above, from the side
    /// from which the links are longest.
    pub fn best_view(&self) -> ViewDirection {
        let Some(normal) = self.plane else {
            return self.best_oblique_view();
        };
        let within = |v: Vector3<f64>| (v - normal * v.dot(&normal)).try_normalize(0.1);
        // Up is opposite to gravity, as far as it lies in the plane, else y or z of the base.
        let against = self.down.and_then(|down| within(-down));
        let up = against
            .or_else(|| within(Vector3::y()))
            .or_else(|| within(Vector3::z()))
            .expect("no plane has both of two axes as its normal");
        ViewDirection {
            right: up.cross(&normal),
            up,
        }
    }

    /// The oblique view in which no link is seen from its end, as far as possible. Each link counts with the logarithm
    /// of the share of its length that is seen, so that one hidden link is worse than many shortened ones.
    fn best_oblique_view(&self) -> ViewDirection {
        let links: Vec<Vector3<f64>> = (self.marks.iter())
            .filter_map(|mark| match &mark.shape {
                MarkShape::Bar([a, b]) | MarkShape::Drive([a, b]) if mark.body != 0 => Some(b - a),
                _ => None,
            })
            .filter(|link| link.norm() > 1e-9)
            .collect();
        let weight: f64 = links.iter().map(|link| link.norm().sqrt()).sum();
        let visibility = |view: &ViewDirection| -> f64 {
            let seen = links.iter().map(|link| {
                let [right, up] = view.project(link);
                let share = right.hypot(up) / link.norm();
                link.norm().sqrt() / weight * (HIDDEN_SHARE + share).ln()
            });
            seen.sum()
        };
        let mut best = ViewDirection::from_angles(self, USUAL_AZIMUTH, ELEVATION);
        // Another side must show clearly more, so that small changes of a model do not turn its picture.
        let mut least = visibility(&best) + CLEARLY_MORE;
        for k in 1..AZIMUTHS {
            let azimuth = USUAL_AZIMUTH + f64::from(k) * std::f64::consts::TAU / f64::from(AZIMUTHS);
            let view = ViewDirection::from_angles(self, azimuth, ELEVATION);
            let visible = visibility(&view);
            if visible > least {
                (best, least) = (view, visible);
            }
        }
        best
    }
}
