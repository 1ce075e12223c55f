//! What is best done after an identification.

use modelmill_identify::ParameterStatus;

use crate::identify::{Identification, RefinementResult};

/// Deviations above this part of the value say little more than that there is one.
const VAGUE: f64 = 0.5;
/// From this part of the parameters on, vague ones are an invitation.
const MANY: f64 = 0.25;

impl Identification {
    /// What to do next, in a sentence or two.
    pub fn next_step(&self) -> String {
        let parameters = &self.fit.parameters;
        let asked = parameters.iter().filter(|p| p.status != ParameterStatus::Known);
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
                RefinementResult::Physical(..) => "",
                _ => {
                    "; option `physical` lets bodies and nominal values say what the recording does not"
                }
            };
            return format!(
                "Next: {vague} of {n} base parameters have deviations above half of their values, so the recording hardly \
                 tells them{physical}; verb `excite` plans a motion that does."
            );
        }
        if self.fit.check.is_none() {
            return "Next: hold the fit against a recording that it has not seen, with option `check`; verb `diagnose` says \
                    what the model lacks."
                .to_owned();
        }
        "Next: verb `diagnose` says what the model lacks; verb `adopt` writes the fit into the model file.".to_owned()
    }
}
