//! A velocity controller: the drive force is proportional to the error of the rate.

use super::{ActuatorGain, ActuatorKindEntry, ActuatorTerm, GainEntry, SignalQuantity, difference, gain, rate, signal};
use crate::unit::UnitDimension;

/// See [`super::ActuatorKind::VelocityServo`].
pub(super) struct VelocityServo;

impl ActuatorKindEntry for VelocityServo {
    fn name(&self) -> &'static str {
        "velocity_servo"
    }

    fn formula(&self) -> &'static str {
        "kv*(command - rate)"
    }

    fn signals(&self) -> &'static [&'static str] {
        &["command"]
    }

    fn quantity(&self) -> SignalQuantity {
        SignalQuantity::Rate
    }

    fn is_commanded(&self) -> bool {
        true
    }

    fn gains(&self) -> &'static [GainEntry] {
        const { &[gain("kv", true, UnitDimension::TIME, -1)] }
    }

    fn terms(&self, _: usize, gain: &dyn Fn(&str) -> Option<ActuatorGain>) -> Vec<ActuatorTerm> {
        let kv = gain("kv").map(|kv| kv.term(difference(signal(), rate())));
        kv.into_iter().collect()
    }
}
