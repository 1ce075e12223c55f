//! Forces that are read later than they act.

use crate::exact::Symbol;
use crate::kinds::ActsOn;
use crate::mechanics::{Entry, Symbols};
use crate::mechanism::{Constant, Effect};
use crate::unit::Dimension;

pub(crate) struct Delay;

impl Entry for Delay {
    fn words(&self) -> &'static str {
        "forces of recordings are those of T before"
    }

    fn lead(&self) -> &'static str {
        "lets forces be read later than they act, s: "
    }

    fn on(&self) -> ActsOn {
        ActsOn::Force
    }

    fn constants(&self) -> Symbols {
        &[("T", Dimension::TIME)]
    }

    fn force_delay(&self, effect: &Effect, constants: &[Constant]) -> f64 {
        let value = |symbol| match symbol {
            Symbol::Constant(idx) => constants[idx.0].value,
            _ => f64::NAN,
        };
        let time = effect.constants.iter().find(|(name, _)| name == "T");
        time.map_or(0.0, |(_, time)| time.evaluate(&value))
    }

    fn is_part_of_load(&self) -> bool {
        false
    }
}
