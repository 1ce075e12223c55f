//! The direction from which a scene is viewed: a parallel projection onto the plane of the picture.

use nalgebra::Vector3;

use crate::scene::MechanismScene;

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
    /// The most informative view: onto the plane of motion if there is one, else obliquely from above.
    pub fn best_view(&self) -> ViewDirection {
        let Some(normal) = self.plane else {
            return ViewDirection::from_angles(self, -0.9, 0.42);
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
}
