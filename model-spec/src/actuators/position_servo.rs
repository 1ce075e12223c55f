//! A position controller: the drive force is proportional to the error of position, less a damping.

use super::{ActuatorGain, ActuatorKindEntry, ActuatorTerm, GainEntry, SignalQuantity, difference, gain, rate, signal};
use crate::exact::{ExactExpression, ModelSymbol, PlaceQuantity};
use crate::unit::UnitDimension;

/// See [`super::ActuatorKind::PositionServo`].
pub(super) struct PositionServo;

impl ActuatorKindEntry for PositionServo {
    fn name(&self) -> &'static str {
        "position_servo"
    }

    fn formula(&self) -> &'static str {
        "kp*(command - position) - kd*rate + kv*(command rate - rate)"
    }

    fn signals(&self) -> &'static [&'static str] {
        &["command"]
    }

    fn quantity(&self) -> SignalQuantity {
        SignalQuantity::Position
    }

    fn is_commanded(&self) -> bool {
        true
    }

    fn gains(&self) -> &'static [GainEntry] {
        const {
            &[
                gain("kp", true, UnitDimension::ONE, -1),
                gain("kd", false, UnitDimension::TIME, -1),
                gain("kv", false, UnitDimension::TIME, -1),
            ]
        }
    }

    fn terms(&self, _: usize, gain: &dyn Fn(&str) -> Option<ActuatorGain>) -> Vec<ActuatorTerm> {
        let place = |quantity| ExactExpression::Symbol(ModelSymbol::Place(quantity));
        let kp = gain("kp").map(|kp| kp.term(difference(signal(), place(PlaceQuantity::Coordinate))));
        let kd = gain("kd").map(|kd| kd.term(ExactExpression::Negative(Box::new(rate()))));
        let kv = gain("kv").map(|kv| kv.term(difference(place(PlaceQuantity::OtherRate), rate())));
        kp.into_iter().chain(kd).chain(kv).collect()
    }
}
