//! `verify`: tests a model against recordings. A model, recordings and limits go in; checks with the results
//! pass, fail and not evaluated come out, each failure with its cause from the diagnosis.
//!
//! The modules, in the order of the data flow: `limits` reads limits, `recordings`, `drives`, `positions`,
//! `parameters` and `effects` make the checks of their scopes, `causes` explains failures, `fingerprints` states which files were
//! used.

mod causes;
mod checks;
mod digest;
mod drives;
mod effects;
mod fingerprints;
mod limits;
mod parameters;
mod positions;
mod recordings;
pub(crate) mod thresholds;

use crate::diagnose::{DiagnosisFindings, DiagnosisOptions};
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::PreparedRecording;

pub use checks::{CheckScope, CheckState, VerificationCheck};
pub use digest::hash_file;
pub use fingerprints::{FileFingerprint, FileRole};
pub use limits::{DriveErrorLimit, PositionErrorLimit, VerificationLimits};

/// The result of a verification, which [`Model::verify`] returns.
pub struct ModelVerification {
    /// Name of the model.
    pub model: String,
    /// All checks, by scope: recordings, drives, positions, parameters, effects.
    pub checks: Vec<VerificationCheck>,
    /// The limits that were used.
    pub limits: VerificationLimits,
    /// The diagnosis of all recordings together, or the reason why there is none.
    pub diagnosis: Result<DiagnosisFindings, Error>,
}

impl Model {
    /// Tests the model, with the values of [`Model::values`], against recordings. All recordings are diagnosed
    /// together.
    ///
    /// Fails when the job is cancelled, or when a recording contains a pose that the mechanism cannot reach.
    ///
    /// ```
    /// use modelmill::Model;
    /// use modelmill::recording::RecordingOptions;
    /// use modelmill::verify::{CheckState, VerificationLimits};
    ///
    /// let model = Model::open("../model-spec/models/spidermill.toml")?;
    /// let run = model.recording("../recordings/spidermill-mbs/with-rods-check.csv", &RecordingOptions::default())?;
    /// // The model lacks the inertia of the rods.
    /// let verified = model.verify(&[&run], &VerificationLimits::default())?;
    /// assert_eq!(verified.state(), CheckState::Fail);
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn verify(&self, recordings: &[&PreparedRecording], limits: &VerificationLimits) -> Outcome<ModelVerification> {
        let diagnosis = match self.diagnose(recordings, &[], &DiagnosisOptions::default()) {
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            found => found,
        };
        let reason = diagnosis.as_ref().err().map(ToString::to_string).unwrap_or_default();
        let findings = diagnosis.as_ref().map_err(|_| reason.as_str());
        let mut checks = recordings::check_recordings(recordings, findings);
        for one in recordings {
            checks.extend(drives::check_drives(self, one, limits, findings.ok())?);
        }
        for one in recordings {
            checks.extend(positions::check_positions(self, one, limits, findings.ok())?);
        }
        checks.extend(parameters::check_parameters(self, recordings, limits, findings)?);
        checks.extend(effects::check_effects(limits, findings));
        Ok(ModelVerification {
            model: self.name.clone(),
            checks,
            limits: limits.clone(),
            diagnosis,
        })
    }
}

impl ModelVerification {
    /// The result. Fail: at least one check fails. Pass: no check fails, that of at least one drive or position passes, and all
    /// checks with a limit of the user are evaluated. Otherwise: not evaluated.
    pub fn state(&self) -> CheckState {
        let count = |state: CheckState| self.count(state);
        let is_open = |one: &VerificationCheck| !one.is_default && one.state == CheckState::NotEvaluated;
        // The state of recordings says nothing about the model.
        let is_of_model = |one: &VerificationCheck| [CheckScope::Drive, CheckScope::Position].contains(&one.scope);
        let passes = |one: &VerificationCheck| is_of_model(one) && one.state == CheckState::Pass;
        if count(CheckState::Fail) > 0 {
            CheckState::Fail
        } else if self.checks.iter().any(is_open) || !self.checks.iter().any(passes) {
            CheckState::NotEvaluated
        } else {
            CheckState::Pass
        }
    }

    /// Number of checks with a state.
    pub fn count(&self, state: CheckState) -> usize {
        self.checks.iter().filter(|one| one.state == state).count()
    }
}
