//! The next step after a command has compared a model with recordings: from a quick look at the residual to one message with
//! the next command. All commands use the same look, so that nobody records again while the model lacks an effect.

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Message, OptionName, Remedy};
use modelmill_identify::{ErrorFigures, ParameterStatus, RateDependence, RateTerm};

use crate::compare::ModelComparison;
use crate::faults::SuspectedFault;
use crate::identify::{Identification, RefinementResult};
use crate::text::names::joined_by_and;
use crate::text::table::{percent, significant};

/// A parameter is uncertain if its standard deviation is above this part of its value. By judgement.
const VAGUE: f64 = 0.5;
/// From this part of uncertain parameters on, the advice is about them. By judgement.
const MANY: f64 = 0.25;
/// Identified values are worse than nominal ones if their error is larger by this factor. By judgement.
const WORSE_FACTOR: f64 = 1.05;
/// Errors below this part of the force are not compared, nor called large. By judgement.
const SMALL_ERROR: f64 = 0.03;
/// Residuals whose neighbours are correlated by more than this are no white noise. By judgement.
const CORRELATED: f64 = 0.5;
/// Neighbours that are correlated by more than this are a function of the motion, whatever the size of the error. The
/// bundled recording `with-rods-fit`, whose error is 1.1 %, has 0.999.
const NEARLY_EQUAL: f64 = 0.95;
/// From this multiple of the force on, an error is no matter of a few wrong values: a wrong unit makes a factor of 57
/// (degrees) or 1000. By judgement.
const HUGE_ERROR: f64 = 10.0;
/// Errors below this part of the force are rounding or the error of smoothing. By judgement.
const NO_ERROR: f64 = 1e-3;

/// What a command knows of the residual of a model.
pub(crate) struct ResidualLook<'a> {
    /// Errors on the data that decide.
    pub(crate) figures: &'a ErrorFigures,
    /// Errors of the nominal values on the same data, if identified values are used.
    pub(crate) nominal: Option<&'a ErrorFigures>,
    /// How the residuals depend on the velocities of their drives.
    pub(crate) by_rate: &'a [RateDependence],
    /// Correlation of neighbouring residuals, by drive.
    pub(crate) correlations: &'a [f64],
    /// The suspected fault of a recording.
    pub(crate) suspect: Option<&'a SuspectedFault>,
}

impl ResidualLook<'_> {
    /// What shows that the model lacks an effect, as sentences; `None` if a quick look shows nothing.
    pub(crate) fn finding(&self) -> Option<Message> {
        let signs = [self.friction_text(), self.worse_text(), self.correlation_text()];
        let signs: Vec<Message> = signs.into_iter().flatten().map(Message::from).collect();
        (!signs.is_empty()).then(|| Message::join(signs, " "))
    }

    /// The next step if a recording has a fault that makes all figures doubtful: its correction, before any other step.
    pub(crate) fn correction_step(&self) -> Option<Message> {
        let fault = self.suspect?;
        Some(message!(
            "All figures are doubtful: in {} {}. Next: {}, then run the command again.",
            joined_by_and(&fault.recordings),
            fault.clause,
            fault.advice.clone()
        ))
    }

    /// The next step if the model's forces are larger than the measured ones by orders of magnitude: a look at the units.
    pub(crate) fn unit_step(&self) -> Option<Message> {
        let errors = self.figures.channels.iter();
        let huge = errors.filter_map(|(drive, one)| Some((drive, one.nrms.filter(|nrms| *nrms > HUGE_ERROR)?)));
        let (drive, error) = huge.max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(message!(
            "The error of {drive} is {} times its force. The units of a column, or values of the model, are wrong by orders of \
             magnitude. Next: check the units of positions and forces of the recording ({}) and those of the model file.",
            significant(error, 2),
            Remedy::option(OptionName::Columns)
        ))
    }

    /// The next step if something is missing: the diagnosis, before anything is recorded again.
    pub(crate) fn diagnosis_step(&self) -> Option<Message> {
        let finding = self.finding()?;
        Some(message!(
            "{} Next: {} finds the effects that explain this. Do so before you record again.",
            finding,
            Remedy::command(CommandName::Diagnose)
        ))
    }

    /// The next step if the values of friction are too large, and nothing else is wrong: the identification.
    fn identification_step(&self) -> Option<Message> {
        let drives = drives_of(self.by_rate);
        (self.finding().is_none() && !drives.is_empty()).then(|| {
            message!(
                "The friction of {} is smaller than in the model: its values are too large. Next: {} estimates them.",
                joined_by_and(&drives),
                Remedy::command(CommandName::Identify)
            )
        })
    }

    /// Drives whose residuals look like friction that the model lacks.
    fn friction_text(&self) -> Option<String> {
        let lacking: Vec<&RateDependence> = self.by_rate.iter().filter(|one| one.value > 0.0).collect();
        let drives = drives_of(lacking.iter().copied());
        let mut kinds: Vec<String> = Vec::new();
        for one in lacking {
            let kind = match one.term {
                RateTerm::Sign => "dry",
                RateTerm::Rate => "viscous",
                RateTerm::Load => "load-dependent",
                RateTerm::Hysteresis => "hysteretic",
            };
            if !kinds.iter().any(|known| known == kind) {
                kinds.push(kind.to_owned());
            }
        }
        (!drives.is_empty()).then(|| {
            format!(
                "The residual of {} depends on the velocity like {} friction. The model lacks this friction, or its friction has \
                 wrong values.",
                joined_by_and(&drives),
                joined_by_and(&kinds)
            )
        })
    }

    /// Errors that are larger with identified than with nominal values.
    fn worse_text(&self) -> Option<String> {
        let nominal = self.nominal?;
        let is_worse = |found: f64, nominal: f64| found > SMALL_ERROR && found > WORSE_FACTOR * nominal;
        let text = |what: &str, found: f64, nominal: f64| {
            let [found, nominal] = [found, nominal].map(|error| percent(Some(error)));
            format!("{what}{found} instead of {nominal}")
        };
        if let (Some(found), Some(nominal)) = (self.figures.nrms, nominal.nrms)
            && is_worse(found, nominal)
        {
            return Some(format!(
                "The identified values predict the validation run worse than the nominal ones: the error is {}.",
                text("", found, nominal)
            ));
        }
        let drives = self.figures.channels.iter().filter_map(|(drive, found)| {
            let (found, nominal) = (found.nrms?, nominal.channels.get(drive)?.nrms?);
            is_worse(found, nominal).then(|| text(&format!("{drive} "), found, nominal))
        });
        let drives: Vec<String> = drives.collect();
        (!drives.is_empty()).then(|| {
            format!(
                "The identified values predict some drives of the validation run worse than the nominal ones: the error is {}.",
                drives.join(", ")
            )
        })
    }

    /// The drive with the largest error of those whose errors are no white noise.
    fn correlation_text(&self) -> Option<String> {
        let drives = self.figures.channels.iter().zip(self.correlations);
        let errors = drives.filter_map(|((drive, one), correlation)| Some((drive, one.nrms?, *correlation)));
        let is_structured = |(_, error, correlation): &(&String, f64, f64)| {
            *error > SMALL_ERROR && *correlation > CORRELATED || *error > NO_ERROR && *correlation > NEARLY_EQUAL
        };
        let (drive, error, correlation) = errors.filter(is_structured).max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(format!(
            "The error of {drive}, {} of its force, is not white noise: neighbouring residuals are correlated (coefficient \
             {correlation:.2}).",
            percent(Some(error))
        ))
    }
}

/// The drives of some dependences, each once.
fn drives_of<'a>(dependences: impl IntoIterator<Item = &'a RateDependence>) -> Vec<String> {
    let mut drives: Vec<String> = Vec::new();
    for one in dependences {
        if !drives.contains(&one.channel) {
            drives.push(one.channel.clone());
        }
    }
    drives
}

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

impl ModelComparison {
    /// The next step: the diagnosis if the residual looks like friction that the model lacks, the identification if the
    /// friction of the model is too large; `None` if a quick check of the residual finds nothing.
    pub fn next_step(&self) -> Option<Message> {
        let look = ResidualLook {
            figures: &self.figures,
            nominal: None,
            by_rate: &self.error_locations.by_rate,
            correlations: &[],
            suspect: self.suspect.as_ref(),
        };
        look.correction_step()
            .or_else(|| look.unit_step())
            .or_else(|| look.diagnosis_step())
            .or_else(|| look.identification_step())
    }
}

impl Identification {
    /// The next step: the diagnosis if the residual shows that the model lacks an effect, else more information on uncertain
    /// parameters, a validation run, or the diagnosis.
    pub fn next_step(&self) -> Message {
        let look = ResidualLook {
            figures: self.fit.check.as_ref().unwrap_or(&self.fit.fit),
            // The fit itself cannot be worse than the nominal values.
            nominal: self.nominal_check.as_ref().filter(|_| self.has_nominal),
            by_rate: &self.by_rate,
            correlations: &self.found.uncertainty.residual_lag1,
            suspect: self.suspect.as_ref(),
        };
        if let Some(step) = look.correction_step().or_else(|| look.diagnosis_step()) {
            return step;
        }
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
            return message!(
                "Next: {vague} of {n} base parameters are uncertain by more than half their value. The error {}: if that is more \
                 than the noise, run {} first. If it finds nothing, record a richer motion ({}){}.",
                error_text(look.figures),
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

#[cfg(test)]
mod tests {
    use modelmill_boundary::text::RustWording;
    use serde_json::json;

    use super::*;
    use crate::faults::RecordingFaultKind;

    fn figures(errors: [f64; 2]) -> ErrorFigures {
        let channel =
            |nrms: f64| json!({ "nrms": nrms, "mean_relative": null, "max_abs": 1.0, "rms": 0.1, "zero_measured": 0 });
        let value = json!({
            "nrms": errors[0].hypot(errors[1]), "samples": 100,
            "channels": { "a": channel(errors[0]), "b": channel(errors[1]) },
        });
        serde_json::from_value(value).expect("error figures")
    }

    fn dependence(channel: &str, term: RateTerm) -> RateDependence {
        RateDependence {
            channel: channel.to_owned(),
            term,
            value: 2.0,
            std: 0.1,
            unit: "N m".to_owned(),
            share: 0.5,
            levels: None,
            alternative: None,
            says: String::new(),
        }
    }

    fn step(
        nominal: Option<[f64; 2]>,
        errors: [f64; 2],
        by_rate: &[RateDependence],
        correlation: f64,
    ) -> Option<String> {
        let nominal = nominal.map(figures);
        let look = ResidualLook {
            figures: &figures(errors),
            nominal: nominal.as_ref(),
            by_rate,
            correlations: &[0.0, correlation],
            suspect: None,
        };
        let step = look.diagnosis_step().or_else(|| look.identification_step());
        step.map(|step| step.format_for(&RustWording))
    }

    /// A fault of the recording is corrected before anything else, whatever the residual looks like.
    #[test]
    fn a_fault_of_the_recording_is_corrected_first() {
        let fault = SuspectedFault {
            kind: RecordingFaultKind::WrongSign,
            at: vec!["a".to_owned()],
            recordings: vec!["run.csv".to_owned()],
            clause: "the force of a has the wrong sign".to_owned(),
            advice: Message::from("turn it".to_owned()),
            evidence: String::new(),
            fit_gain: 1.0,
            correction: None,
        };
        let friction = [dependence("a", RateTerm::Sign)];
        let look = ResidualLook {
            figures: &figures([0.9, 0.1]),
            nominal: None,
            by_rate: &friction,
            correlations: &[0.99, 0.0],
            suspect: Some(&fault),
        };
        let text = look.correction_step().expect("a step").format_for(&RustWording);
        assert_eq!(
            text,
            "All figures are doubtful: in run.csv the force of a has the wrong sign. Next: turn it, then run \
             the command again."
        );
    }

    /// An error of a thousand times the force is one of units.
    #[test]
    fn a_huge_error_leads_to_the_units() {
        let look = |error: f64| {
            let look = ResidualLook {
                figures: &figures([error, 0.1]),
                nominal: None,
                by_rate: &[],
                correlations: &[],
                suspect: None,
            };
            look.unit_step().map(|step| step.format_for(&RustWording))
        };
        assert_eq!(look(3.0), None);
        let text = look(9e4).expect("a step");
        assert!(text.starts_with("The error of a is 90000 times its force."), "{text}");
    }

    /// White noise, and small errors whatever their correlation, are no reason for a diagnosis.
    #[test]
    fn noise_needs_no_diagnosis() {
        assert_eq!(step(None, [0.1, 0.1], &[], 0.1), None);
        assert_eq!(step(Some([0.01, 0.01]), [0.011, 0.011], &[], 0.9), None);
        assert_eq!(step(Some([0.2, 0.2]), [0.1, 0.1], &[], 0.2), None);
    }

    /// The error and the correlation of different drives do not belong together.
    #[test]
    fn a_large_white_error_beside_a_small_correlated_one_needs_no_diagnosis() {
        assert_eq!(step(None, [0.1, 1e-4], &[], 0.99), None);
    }

    /// A model with too much friction lacks none: its values are identified.
    #[test]
    fn too_much_friction_is_identified() {
        let mut friction = [dependence("a", RateTerm::Sign), dependence("b", RateTerm::Rate)];
        for one in &mut friction {
            one.value = -one.value;
        }
        let text = step(None, [0.1, 0.1], &friction, 0.0).expect("a step");
        assert_eq!(
            text,
            "The friction of a and b is smaller than in the model: its values are too large. Next: verb `identify` estimates them."
        );
        // With one drive that lacks friction, the diagnosis comes first, and names this drive only.
        friction[0].value = 2.0;
        let text = step(None, [0.1, 0.1], &friction, 0.0).expect("a step");
        assert!(
            text.contains("The residual of a depends") && text.contains("`diagnose`"),
            "{text}"
        );
    }

    /// Each sign of a missing effect leads to the diagnosis first.
    #[test]
    fn a_missing_effect_is_diagnosed_before_anything_is_recorded_again() {
        let friction = [
            dependence("a", RateTerm::Sign),
            dependence("a", RateTerm::Rate),
            dependence("b", RateTerm::Sign),
        ];
        for (found, expected) in [
            (
                step(None, [0.1, 0.1], &friction, 0.0),
                "of a and b depends on the velocity like dry and viscous friction",
            ),
            (
                step(Some([0.1, 0.1]), [0.2, 0.1], &[], 0.0),
                "worse than the nominal ones: the error is 22.4 % instead of 14.1 %",
            ),
            // The total may hide a drive.
            (
                step(Some([0.05, 0.4]), [0.2, 0.1], &[], 0.0),
                "a 20.0 % instead of 5.00 %",
            ),
            (
                step(None, [0.3, 0.3], &[], 0.95),
                "The error of b, 30.0 % of its force, is not white noise: neighbouring residuals are correlated (coefficient 0.95)",
            ),
            // A small error that follows the motion is no noise either.
            (
                step(None, [0.01, 0.01], &[], 0.99),
                "The error of b, 1.00 % of its force",
            ),
        ] {
            let found = found.expect("a step");
            assert!(found.contains(expected), "{found}");
            assert!(
                found.contains("`diagnose`") && found.ends_with("before you record again."),
                "{found}"
            );
        }
    }
}
