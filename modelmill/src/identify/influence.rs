//! Influence of sensor faults on a fit: the recordings are fitted once more without their repair, and a sentence
//! states the largest change of a base parameter.

use modelmill_identify::{ParameterInfo, RecordingNote};

use super::options::EstimatorOptions;
use super::regression::{self, RegressionEstimate};
use super::standstill;
use super::thresholds::FAULT_INFLUENCE_LEAST_SIGMAS;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::segment::RecordingSegment;
use crate::text::table::{number, significant};

/// The note on the base parameter that the faults change most, in its standard deviations; `None` if no fault was
/// repaired, or the fit without repair fails.
///
/// Fails when the job is cancelled.
pub(super) fn fault_influence(
    model: &Model,
    recordings: &[&PreparedRecording],
    found: &RegressionEstimate,
    options: &EstimatorOptions,
) -> Outcome<Option<RecordingNote>> {
    // Recordings with repaired faults are replaced by their faulty versions, the others are kept.
    let mut files = Vec::new();
    let mut data: Vec<RecordingSegment> = Vec::new();
    for one in recordings {
        match one.with_faults(model) {
            Some(faulty) => {
                files.push(one.file());
                data.extend(faulty);
            }
            None => data.extend(one.segments.iter().cloned()),
        }
    }
    if files.is_empty() {
        return Ok(None);
    }
    // The comparison uses the same equations as the fit.
    if let Some(part) = options.standstill
        && standstill::exclude_standstill(model, &mut data, part).is_err()
    {
        return Ok(None);
    }
    // The second fit uses the same options, on the unrepaired recordings.
    let faulty = match regression::identify(model, &data, &[], options) {
        Ok(faulty) => faulty,
        Err(Error::Cancelled) => return Err(Error::Cancelled),
        Err(_) => return Ok(None),
    };
    let infos = model.parameter_infos();
    // The change of each parameter is measured in its standard deviations.
    let pairs = found.solution.values.iter().zip(&faulty.solution.values);
    let moved = pairs
        .zip(&found.uncertainty.std)
        .zip(&found.unknown)
        .filter(|((_, std), _)| std.is_finite() && **std > 0.0);
    // Only parameters with a finite standard deviation can be compared.
    let most = moved.max_by(|(one, _), (other, _)| {
        let deviations = |((a, b), std): &((&f64, &f64), &f64)| (**b - **a).abs() / **std;
        deviations(one).total_cmp(&deviations(other))
    });
    let Some((((intact, faulty), std), k)) = most else {
        return Ok(None);
    };
    let deviations = (faulty - intact).abs() / std;
    let files = files.join(", ");
    // A change below one standard deviation needs no name.
    let says = if deviations < FAULT_INFLUENCE_LEAST_SIGMAS {
        format!(
            "Without their repair, the sensor faults in {files} would have changed no base parameter by more than {} standard \
             deviations.",
            significant(deviations, 2)
        )
    } else {
        let ParameterInfo { name, unit, .. } = &infos[*k];
        format!(
            "Without their repair, the sensor faults in {files} would have changed {name} from {} to {} {unit} ({} standard \
             deviations), and all other base parameters by fewer standard deviations.",
            number(*intact),
            number(*faulty),
            significant(deviations, 3)
        )
    };
    Ok(Some(RecordingNote::info(says)))
}
