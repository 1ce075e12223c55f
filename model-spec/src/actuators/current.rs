//! A motor whose current is recorded: the drive force is proportional to it.

use super::voltage::PER_AMPERE;
use super::{ActuatorGain, ActuatorKindEntry, ActuatorTerm, GainEntry, SignalQuantity, constant, gain, signal};
use crate::unit::UnitDimension;

/// See [`super::ActuatorKind::Current`].
pub(super) struct CurrentDrive;

impl ActuatorKindEntry for CurrentDrive {
    fn name(&self) -> &'static str {
        "current"
    }

    fn formula(&self) -> &'static str {
        "torque_constant*ratio*efficiency*current"
    }

    fn signals(&self) -> &'static [&'static str] {
        &["current"]
    }

    fn quantity(&self) -> SignalQuantity {
        SignalQuantity::Current
    }

    fn is_commanded(&self) -> bool {
        false
    }

    fn gains(&self) -> &'static [GainEntry] {
        const {
            &[
                gain("torque_constant", true, PER_AMPERE, 0),
                constant("ratio", false, UnitDimension::ONE),
                constant("efficiency", false, UnitDimension::ONE),
            ]
        }
    }

    fn terms(&self, _: usize, gain: &dyn Fn(&str) -> Option<ActuatorGain>) -> Vec<ActuatorTerm> {
        let all = ["torque_constant", "ratio", "efficiency"].into_iter().filter_map(gain);
        let product = all.fold(ActuatorGain::unity(), |product, one| product.times(&one));
        vec![product.term(signal())]
    }
}
