//! A delay of the recorded forces relative to the motion.
//!
//! Equations and generated code do not contain it; it is applied where recordings are prepared.

use crate::exact::ModelSymbol;
use crate::kinds::ActsOn;
use crate::mechanics::{MechanicsEntry, MechanicsSymbols};
use crate::mechanism::{ModelConstant, ModelEffect};
use crate::unit::UnitDimension;

/// The entry of [`crate::Mechanics::Delay`]: it has one constant, the time `T`, and no parameters.
pub(crate) struct DelayMechanics;

impl MechanicsEntry for DelayMechanics {
    fn description(&self) -> &'static str {
        "recorded forces are those of the time T before"
    }

    fn introduction(&self) -> &'static str {
        "delays recorded forces, s: "
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn::Force
    }

    fn constants(&self) -> MechanicsSymbols {
        &[("T", UnitDimension::TIME)]
    }

    // Constants of effects are expressions over constants of the model; other symbols cannot occur.
    fn force_delay(&self, effect: &ModelEffect, constants: &[ModelConstant]) -> f64 {
        let value = |symbol| match symbol {
            ModelSymbol::Constant(idx) => constants[idx.0].value,
            _ => f64::NAN,
        };
        // Without a value the delay is zero.
        let time = effect.constants.iter().find(|(name, _)| name == "T");
        time.map_or(0.0, |(_, time)| time.evaluate(&value))
    }

    fn is_part_of_load(&self) -> bool {
        false
    }
}
