//! A motor with a recorded duty cycle, -1 to 1, of a known supply voltage.

use super::voltage::{BACK_EMF, OHM, PER_AMPERE, VOLT};
use super::{ActuatorGain, ActuatorKindEntry, ActuatorTerm, GainEntry, SignalQuantity, constant, gain, motor_terms};
use crate::unit::UnitDimension;

/// See [`super::ActuatorKind::Duty`].
pub(super) struct DutyDrive;

impl ActuatorKindEntry for DutyDrive {
    fn name(&self) -> &'static str {
        "duty"
    }

    fn formula(&self) -> &'static str {
        "torque_constant*ratio*efficiency/resistance*(supply*duty - back_emf*ratio*rate)"
    }

    fn signals(&self) -> &'static [&'static str] {
        &["duty"]
    }

    fn quantity(&self) -> SignalQuantity {
        SignalQuantity::Share
    }

    fn is_commanded(&self) -> bool {
        false
    }

    fn gains(&self) -> &'static [GainEntry] {
        const {
            &[
                gain("torque_constant", true, PER_AMPERE, 0),
                constant("resistance", true, OHM),
                constant("supply", true, VOLT),
                BACK_EMF,
                constant("ratio", false, UnitDimension::ONE),
                constant("efficiency", false, UnitDimension::ONE),
            ]
        }
    }

    fn terms(&self, _: usize, gain: &dyn Fn(&str) -> Option<ActuatorGain>) -> Vec<ActuatorTerm> {
        motor_terms(gain)
    }
}
