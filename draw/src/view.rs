//! From where a scene is looked at: parallel projection onto the plane of the picture.

use nalgebra::Vector3;

use crate::scene::MechanismScene;

/// A direction to look from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewDirection {
    /// To the right in the picture; a unit vector in the base frame.
    pub right: Vector3<f64>,
    /// Upwards in the picture.
    pub up: Vector3<f64>,
}

impl ViewDirection {
    /// From azimuth and elevation, rad: around the vertical from the base's x axis, and above the horizon.
    pub fn from_angles(scene: &MechanismScene, azimuth: f64, elevation: f64) -> Self {
        let vertical = scene.down.map_or_else(Vector3::z, |down| -down);
        let level = |axis: Vector3<f64>| axis - vertical * axis.dot(&vertical);
        let ahead = [Vector3::x(), Vector3::y()].map(level);
        let ahead = ahead.into_iter().find(|a| a.norm() > 0.5);
        let ahead = ahead.unwrap_or_else(Vector3::z).normalize();
        let side = vertical.cross(&ahead);
        let around = ahead * azimuth.cos() + side * azimuth.sin();
        let towards = around * elevation.cos() + vertical * elevation.sin();
        let right = side * azimuth.cos() - ahead * azimuth.sin();
        Self {
            right,
            up: towards.cross(&right),
        }
    }

    /// Towards the viewer.
    pub fn viewer_direction(&self) -> Vector3<f64> {
        self.right.cross(&self.up)
    }

    /// Right and up, in m.
    pub fn project(&self, at: &Vector3<f64>) -> [f64; 2] {
        [at.dot(&self.right), at.dot(&self.up)]
    }
}

impl MechanismScene {
    /// The view that shows most: across the plane of motion where there is one, else from above and aside.
    pub fn best_view(&self) -> ViewDirection {
        let Some(normal) = self.plane else {
            return ViewDirection::from_angles(self, -0.9, 0.42);
        };
        let within = |v: Vector3<f64>| (v - normal * v.dot(&normal)).try_normalize(0.1);
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
