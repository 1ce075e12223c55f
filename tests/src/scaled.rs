//! The same mechanism in another unit of length.

use modelmill_spec::Mechanism;

/// A mechanism all of whose lengths are `unit` times as long, under a name of its own.
pub fn scaled(mechanism: &Mechanism, name: &str, unit: f64) -> Mechanism {
    let mut scaled = mechanism.clone();
    name.clone_into(&mut scaled.name);
    for constant in scaled.constants.iter_mut().filter(|c| c.unit == "m") {
        constant.value *= unit;
    }
    for coordinate in &mut scaled.coordinates {
        if !coordinate.motion.is_angle() {
            coordinate.nominal *= unit;
        }
    }
    scaled
}
