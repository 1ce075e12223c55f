//! The advice after an identification: from the uncertainties of its parameters to one message with the next command.

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Message, OptionName, Remedy};
use modelmill_identify::ParameterStatus;

use crate::identify::{Identification, RefinementResult};
use crate::text::table::percent;

/// A parameter is uncertain if its standard deviation is above this part of its value. By judgement.
const VAGUE: f64 = 0.5;
/// From this part of uncertain parameters on, the advice is about them. By judgement.
const MANY: f64 = 0.25;

impl Identification {
    /// The next step: more information on uncertain parameters, a validation run, or the diagnosis.
    pub fn next_step(&self) -> Message {
        let parameters = &self.fit.parameters;
        let estimated = parameters.iter().filter(|p| p.status != ParameterStatus::Known);
        // Parameters that the file declares as known are not counted.
        let n = estimated.clone().count();
        let vague = estimated
            .filter(|p| match p.status {
                ParameterStatus::Undetermined => true,
                ParameterStatus::Identified => p.std.is_none_or(|std| std > VAGUE * p.value.abs()),
                ParameterStatus::NotEssential | ParameterStatus::Known => false,
            })
            .count();
        if vague > 0 && vague as f64 >= MANY * n as f64 {
            // Physical bounds are advised only if they were not used.
            let physical = match self.found.refined {
                RefinementResult::Physical(..) => Message::new(),
                _ => message!(
                    ", or use {} to add nominal values and physical bounds",
                    Remedy::option(OptionName::Physical)
                ),
            };
            let judged = self.fit.check.as_ref().unwrap_or(&self.fit.fit);
            return message!(
                "Next: {vague} of {n} base parameters are uncertain by more than half their value. The error is {} of the \
                 force: if that is more than the noise, run {} first. If it finds nothing, record a richer motion ({}){}.",
                percent(judged.nrms),
                Remedy::command(CommandName::Diagnose),
                Remedy::command(CommandName::Excite),
                physical
            );
        }
        let diagnose = Remedy::command(CommandName::Diagnose);
        if self.fit.check.is_none() {
            return message!(
                "Next: validate the fit on a recording that was not fitted, with {}. {} finds effects that the model \
                 lacks.",
                Remedy::option(OptionName::Check),
                diagnose
            );
        }
        message!(
            "Next: {} finds effects that the model lacks; {} writes the fitted values into the model file.",
            diagnose,
            Remedy::command(CommandName::Adopt)
        )
    }
}
