//! Sensors: the errors of measurements of an exact motion.
//!
//! An exact value goes in, noise is added and the sum is rounded to the sensor's resolution, in this order:
//! noise arises before the counter or the converter.

use crate::noise::GaussianNoise;

/// All sensors of a rig.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RigSensors {
    /// Samples per second, Hz; `None` for the times of the trajectory.
    pub rate: Option<f64>,
    /// Whether exact derivatives of the coordinates are written; real encoders have none.
    pub derivatives: bool,
    /// One per coordinate of the rig.
    pub encoders: Vec<SensorChannel>,
    /// One per drive of the rig.
    pub force_sensors: Vec<SensorChannel>,
}

/// One measured quantity; zeros make it ideal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorChannel {
    /// Standard deviation of white noise, in the unit of the quantity.
    pub noise: f64,
    /// Smallest step of the reading, in the unit of the quantity.
    pub resolution: f64,
    /// Delay, s: the reading at a time is the quantity of this much earlier.
    pub delay: f64,
}

impl SensorChannel {
    /// The reading of a value.
    pub fn read(&self, value: f64, noise: &mut GaussianNoise) -> f64 {
        let mut reading = value;
        if self.noise > 0.0 {
            reading += self.noise * noise.normal();
        }
        if self.resolution > 0.0 {
            reading = libm::round(reading / self.resolution) * self.resolution;
        }
        reading
    }
}

#[cfg(test)]
mod tests {
    use super::{GaussianNoise, SensorChannel};

    #[test]
    fn readings_are_whole_steps_near_the_value() {
        let channel = SensorChannel {
            noise: 0.0,
            resolution: 0.25,
            delay: 0.0,
        };
        let mut noise = GaussianNoise::new(0, 0);
        assert_eq!(channel.read(1.1, &mut noise).to_bits(), 1.0_f64.to_bits());
        assert_eq!(channel.read(-1.2, &mut noise).to_bits(), (-1.25_f64).to_bits());
    }
}
