//! Checks of recordings: one for each, which fails if the recording has a fault that makes its numbers meaningless.

use crate::diagnose::DiagnosisFindings;
use crate::faults::SuspectedFault;
use crate::recording::PreparedRecording;

use super::causes::fault_text;
use super::checks::{CheckScope, CheckState, VerificationCheck};

/// The checks of all recordings. Without a diagnosis, only the faults of each recording alone are known.
pub(super) fn check_recordings(
    recordings: &[&PreparedRecording],
    findings: Result<&DiagnosisFindings, &str>,
) -> Vec<VerificationCheck> {
    let faults: Vec<&SuspectedFault> = match findings {
        Ok(findings) => findings.corrected.iter().chain(&findings.unresolved).collect(),
        Err(_) => recordings.iter().filter_map(|one| one.suspected_fault()).collect(),
    };
    let one = |recording: &&PreparedRecording| {
        let file = recording.file();
        let fault = faults
            .iter()
            .find(|fault| fault.recordings.iter().any(|one| one == file));
        VerificationCheck {
            scope: CheckScope::Recording,
            recording: Some(file.to_owned()),
            at: file.to_owned(),
            quantity: "fault",
            state: fault.map_or(CheckState::Pass, |_| CheckState::Fail),
            value: None,
            std: None,
            limit: [None, None],
            unit: String::new(),
            is_default: true,
            says: match fault {
                None => "no fault of signs, units, columns, time or gravity".to_owned(),
                Some(fault) => format!("the recording contradicts the model: {}", fault.clause.replace('`', "")),
            },
            cause: fault.map(|fault| fault_text(fault)),
        }
    };
    recordings.iter().map(one).collect()
}
