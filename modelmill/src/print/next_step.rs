//! The advice after an identification: from the uncertainties of its parameters to one message with the next command.

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Message, OptionName, Remedy};
use modelmill_identify::{ErrorFigures, ParameterStatus};

use crate::identify::{Identification, RefinementResult};
use crate::text::table::percent;

/// A parameter is uncertain if its standard deviation is above this part of its value. By judgement.
const VAGUE: f64 = 0.5;
/// From this part of uncertain parameters on, the advice is about them. By judgement.
const MANY: f64 = 0.25;

/// The error relative to the force, as the end of a sentence: of all drives, or where their units differ of the drive with
/// the largest error.
fn error_text(figures: &ErrorFigures) -> String {
    if let Some(nrms) = figures.nrms {
        return format!("is {} of the force", percent(Some(nrms)));
    }
    let of_drives = figures.channels.iter();
    let largest = of_drives
        .filter_map(|(name, one)| Some((name, one.nrms?)))
        .max_by(|a, b| a.1.total_cmp(&b.1));
    match largest {
        Some((name, nrms)) => format!("of {name} is {} of its force", percent(Some(nrms))),
        None => "has no force to compare with".to_owned(),
    }
}

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
                "Next: {vague} of {n} base parameters are uncertain by more than half their value. The error {}: if that is more than the noise, run {} first. If it finds nothing, record a richer motion ({}){}.",
                error_text(judged),
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
