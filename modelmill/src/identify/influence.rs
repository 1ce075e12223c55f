//! What faults of sensors would have done to a fit, had they been left in: recordings go in, a sentence comes out.

use modelmill_identify::{ParameterInfo, RecordingNote};

use super::options::EstimatorOptions;
use super::regression::{self, RegressionEstimate};
use super::standstill;
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::stretch::RecordingSegment;
use crate::text::table::{number, significant};

/// The base parameter that faults move most, in its deviations, by fitting once more with the faults left in; `None` where no
/// fault was taken out, or no fit comes of it.
pub(super) fn fault_influence(
    model: &Model,
    recordings: &[&PreparedRecording],
    found: &RegressionEstimate,
    options: &EstimatorOptions,
) -> Option<RecordingNote> {
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
        return None;
    }
    if let Some(part) = options.standstill {
        standstill::exclude_standstill(model, &mut data, part).ok()?;
    }
    let faulty = regression::identify(model, &data, &[], options).ok()?;
    let infos = model.parameter_infos();
    let pairs = found.solution.values.iter().zip(&faulty.solution.values);
    let moved = pairs
        .zip(&found.deviations.std)
        .zip(&found.unknown)
        .filter(|((_, std), _)| std.is_finite() && **std > 0.0);
    let most = moved.max_by(|(one, _), (other, _)| {
        let deviations = |((a, b), std): &((&f64, &f64), &f64)| (**b - **a).abs() / **std;
        deviations(one).total_cmp(&deviations(other))
    });
    let (((sound, faulty), std), k) = most?;
    let deviations = (faulty - sound).abs() / std;
    let files = files.join(", ");
    let says = if deviations < 1.0 {
        format!(
            "Left in, the faults of sensors in {files} would have moved no base parameter by more than {} of its standard \
             deviations.",
            significant(deviations, 2)
        )
    } else {
        let ParameterInfo { name, unit, .. } = &infos[*k];
        format!(
            "Left in, the faults of sensors in {files} would have moved {name} from {} to {} {unit} ({} standard deviations), \
             and no base parameter by more of its deviations.",
            number(*sound),
            number(*faulty),
            significant(deviations, 3)
        )
    };
    Some(RecordingNote::info(says))
}
