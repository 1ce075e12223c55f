//! Equations at standstill: while a drive hardly moves, its friction may have any value and the sign of its rate is
//! noise. Such equations may be excluded from a fit.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::RecordingNote;

use crate::along::drive_rates;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::segment::RecordingSegment;
use crate::text::table::count;

/// Gives equations at standstill the weight 0, and adds a note with their number.
///
/// `part` is the fraction of a drive's maximum rate below which it is at standstill. Fails when all equations of a
/// drive would be excluded.
pub(crate) fn exclude_standstill(model: &Model, data: &mut [RecordingSegment], part: f64) -> Outcome {
    let drives = model.row_names();
    // Rates at the decimated samples, since these are the equations of the fit.
    let rates: Vec<Vec<Vec<f64>>> = data
        .iter()
        .map(|one| {
            let rates = drive_rates(model, one)?;
            let pick = |rate: Vec<f64>| rate.into_iter().step_by(one.decimation()).collect();
            Ok(rates.into_iter().map(pick).collect())
        })
        .collect::<Outcome<_>>()?;
    // The maximum rate of each drive is taken over all recordings.
    let fastest: Vec<f64> = (0..drives.len())
        .map(|d| {
            let all = rates.iter().flat_map(|run| &run[d]);
            all.map(|rate| rate.abs()).fold(0.0, f64::max)
        })
        .collect();
    let mut out = vec![0; drives.len()];
    let mut of = 0;
    for (one, run) in data.iter_mut().zip(&rates) {
        let samples = run.first().map_or(0, Vec::len);
        of += samples;
        // Weights of other exclusions are kept.
        let weights = one.weights.get_or_insert_with(|| vec![1.0; samples * drives.len()]);
        for (k, row) in weights.chunks_exact_mut(drives.len()).enumerate() {
            for (d, weight) in row.iter_mut().enumerate() {
                if run[d][k].abs() <= part * fastest[d] {
                    *weight = 0.0;
                    out[d] += 1;
                }
            }
        }
    }
    // One note for each drive; a drive without any equation is an error.
    let standstill = Remedy::option(OptionName::Standstill);
    for (drive, out) in drives.iter().zip(out) {
        if out == of {
            return Err(Error::input(message!(
                "`{drive}` is at standstill in all recordings of the fit, so {} excludes all its equations; \
                 use a recording in which it moves, or omit {}",
                standstill,
                standstill
            )));
        }
        if out > 0 {
            data[0].note(model, RecordingNote::info(message!(
                "Of the {} of `{drive}`, {out} are left out of the fit: its rate there is below {part} of its fastest \
                 ({}). Error figures include them.",
                count(of, "equation", "equations"),
                standstill,
            )));
        }
    }
    Ok(())
}
