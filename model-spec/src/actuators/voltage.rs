//! A motor whose voltage is recorded: the current follows from the resistance and the back-EMF.

use super::{ActuatorGain, ActuatorKindEntry, ActuatorTerm, GainEntry, SignalQuantity, constant, gain, motor_terms};
use crate::unit::UnitDimension;

/// See [`super::ActuatorKind::Voltage`].
pub(super) struct VoltageDrive;

/// 1/A
pub(super) const PER_AMPERE: UnitDimension = UnitDimension::new([0, 0, 0, -1]);
/// Ohm
pub(super) const OHM: UnitDimension = UnitDimension::new([1, 2, -3, -2]);
/// V s, the back-EMF per angular rate of the motor.
const VOLT_SECOND: UnitDimension = UnitDimension::new([1, 2, -2, -1]);
/// V
pub(super) const VOLT: UnitDimension = UnitDimension::new([1, 2, -3, -1]);

/// The back-EMF, which may be unknown.
pub(super) const BACK_EMF: GainEntry = GainEntry {
    key: "back_emf",
    is_required: false,
    may_be_unknown: true,
    per_load: VOLT_SECOND,
    has_load: false,
    per_position: -1,
};

impl ActuatorKindEntry for VoltageDrive {
    fn name(&self) -> &'static str {
        "voltage"
    }

    fn formula(&self) -> &'static str {
        "torque_constant*ratio*efficiency/resistance*(voltage - back_emf*ratio*rate)"
    }

    fn signals(&self) -> &'static [&'static str] {
        &["voltage"]
    }

    fn quantity(&self) -> SignalQuantity {
        SignalQuantity::Voltage
    }

    fn is_commanded(&self) -> bool {
        false
    }

    fn gains(&self) -> &'static [GainEntry] {
        const {
            &[
                gain("torque_constant", true, PER_AMPERE, 0),
                constant("resistance", true, OHM),
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
