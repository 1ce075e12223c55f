//! What is best done after an identification.

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Message, OptionName, Remedy};
use modelmill_identify::ParameterStatus;

use crate::identify::{Identification, RefinementResult};

/// Deviations above this part of the value say little more than that there is one.
const VAGUE: f64 = 0.5;
/// From this part of the parameters on, vague ones are an invitation.
const MANY: f64 = 0.25;

impl Identification {
    /// What to do next, in a sentence or two.
    pub fn next_step(&self) -> Message {
        let parameters = &self.fit.parameters;
        let asked = parameters
            .iter()
            .filter(|p| p.status != ParameterStatus::Known);
        let n = asked.clone().count();
        let vague = asked
            .filter(|p| match p.status {
                ParameterStatus::Undetermined => true,
                ParameterStatus::Identified => p.std.is_none_or(|std| std > VAGUE * p.value.abs()),
                ParameterStatus::NotEssential | ParameterStatus::Known => false,
            })
            .count();
        if vague > 0 && vague as f64 >= MANY * n as f64 {
            let physical = match self.found.refined {
                RefinementResult::Physical(..) => Message::new(),
                _ => message!(
                    "; {} lets bodies and nominal values say what the recording does not",
                    Remedy::option(OptionName::Physical)
                ),
            };
            return message!(
                "Next: {vague} of {n} base parameters have deviations above half of their values, so the recording hardly \
                 tells them{}; {} plans a motion that does.",
                physical,
                Remedy::command(CommandName::Excite)
            );
        }
        let diagnose = Remedy::command(CommandName::Diagnose);
        if self.fit.check.is_none() {
            return message!(
                "Next: hold the fit against a recording that it has not seen, with {}; {} says \
                 what the model lacks.",
                Remedy::option(OptionName::Check),
                diagnose
            );
        }
        message!(
            "Next: {} says what the model lacks; {} writes the fit into the model file.",
            diagnose,
            Remedy::command(CommandName::Adopt)
        )
    }
}
