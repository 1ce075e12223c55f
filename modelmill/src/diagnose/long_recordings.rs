//! Long recordings in fewer samples. If the parallel filter keeps few samples, states are decimated and forces
//! filtered before any column is computed. This saves memory and time.
//!
//! Smoothed states change little between samples. This first step leaves four samples for each one that the
//! parallel filter keeps, which it needs to filter regressor and forces alike.
//!
//! Decision: a diagnosis holds some thousand columns. Beyond 150 000 samples the parallel filter keeps one of four,
//! and 20 000 at most, unless that would remove more than three quarters of the band in which forces follow the
//! motion.

use modelmill_identify::{DECIMATION_PASSBAND, LowPass, RecordingNote, decimate_time};

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::segment::RecordingSegment;
use crate::text::table::significant;

use super::thresholds::FEWEST_SAMPLES;

/// Segments with fewer samples are not decimated here. By judgement.
const LONG: usize = 150_000;
/// Samples that are kept at most, if that leaves enough of the band in which forces follow the motion. By judgement.
const KEPT: usize = 12_000;
/// The parallel filter must pass at least this part of the band of the motion. By judgement.
const PART_OF_BAND: f64 = 0.25;
/// Samples that are left for each one that the parallel filter keeps.
const LEFT: usize = 4;
/// Order of the low-pass of the forces. It is Butterworth's, which is flat where the parallel filter passes:
/// one with ripples would change the forces relative to the states, which are not filtered.
const ORDER: usize = 4;

impl PreparedRecording {
    /// The recording with its long segments decimated to the samples that a diagnosis needs. This saves memory if the
    /// recording is not needed for anything else. Segments that are not long stay unchanged. Segments between gaps that
    /// are too short for a diagnosis are left out, with a note, if any is long enough.
    ///
    /// Fails if a segment cannot be filtered.
    pub fn for_diagnosis(&self, model: &Model) -> Outcome<Self> {
        let segments = self.segments.iter().map(|one| thin_out(model, one));
        Ok(self.with_segments(without_short_ones(
            model,
            self.file(),
            segments.collect::<Outcome<_>>()?,
        )))
    }
}

/// The segments that have enough samples for a diagnosis; all of them if none has.
fn without_short_ones(model: &Model, file: &str, segments: Vec<RecordingSegment>) -> Vec<RecordingSegment> {
    let is_long = |one: &RecordingSegment| one.samples().div_ceil(one.decimation()) >= FEWEST_SAMPLES;
    if segments.iter().all(is_long) || !segments.iter().any(is_long) {
        return segments;
    }
    let all = segments.len();
    let (mut kept, short): (Vec<_>, Vec<_>) = segments.into_iter().partition(is_long);
    let kept_count = kept.len();
    let lost: usize = short.iter().map(RecordingSegment::samples).sum();
    let every: usize = lost + kept.iter().map(RecordingSegment::samples).sum::<usize>();
    if let Some(first) = kept.first_mut() {
        // What was found in the recording is noted at its first segment.
        for one in short {
            first.run.notes.extend(one.run.notes);
            first.faults.extend(one.faults);
        }
        let share = significant(100.0 * lost as f64 / every as f64, 2);
        first.note(
            model,
            RecordingNote::warning(format!(
                "{} of the {all} segments between gaps of {file} are too short for a diagnosis and are left out, {share} % \
                 of its samples: they have fewer than {FEWEST_SAMPLES} samples after decimation.",
                all - kept_count,
            )),
        );
    }
    kept
}

/// A segment in fewer samples, if it is long and the parallel filter keeps few of them.
///
/// Fails when a column is too short for the filter.
pub(crate) fn thin_out(model: &Model, stretch: &RecordingSegment) -> Outcome<RecordingSegment> {
    let (samples, every) = (stretch.samples(), stretch.decimation());
    let time = &stretch.run.time;
    let step = match time.as_slice() {
        [first, .., last] => (last - first) / (samples - 1) as f64,
        _ => return Ok(stretch.clone()),
    };
    let kept = samples.div_ceil(every);
    // With more decimation the parallel filter would remove too much of the band in which effects differ.
    let most =
        (stretch.run.prepared.band_hz).map_or(every as f64, |band| DECIMATION_PASSBAND / (PART_OF_BAND * band * step));
    // The largest decimation that keeps the band, down to `KEPT` samples.
    let wanted = (every + 1..=every * kept.div_ceil(KEPT))
        .rev()
        .find(|wanted| *wanted as f64 <= most);
    let factor = wanted.unwrap_or(every) / LEFT;
    // A segment with weights stays as it is, since weights belong to single samples.
    if samples < LONG || factor < 2 || stretch.weights.is_some() {
        return Ok(stretch.clone());
    }
    let run = &stretch.run;
    let picked = |all: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let one = |values: &Vec<f64>| values.iter().copied().step_by(factor).collect();
        all.iter().map(one).collect()
    };
    let filtered = |all: &[Vec<f64>]| -> Outcome<Vec<Vec<f64>>> {
        let one = |values: &Vec<f64>| -> Outcome<Vec<f64>> {
            let filter = LowPass::butterworth(ORDER, DECIMATION_PASSBAND / factor as f64, 1.0);
            let smooth = filter.and_then(|filter| filter.zero_phase(values));
            let smooth = smooth.map_err(|error| Error::input(format!("{}: {error}", run.file)))?;
            Ok(smooth.into_iter().step_by(factor).collect())
        };
        all.iter().map(one).collect()
    };
    // The filter mixes neighbouring forces, so a kept sample is left out if any of them is.
    let heard = |out: &Vec<bool>| -> Vec<bool> {
        let about = |k: usize| {
            let from = (factor * k).saturating_sub(factor - 1);
            out[from..(factor * (k + 1)).min(out.len())].contains(&true)
        };
        (0..out.len().div_ceil(factor)).map(about).collect()
    };
    let mut thinned = RecordingSegment {
        variance: stretch.variance.as_deref().map(picked),
        load: stretch.load.as_deref().map(&filtered).transpose()?,
        maps_from_degrees: stretch.maps_from_degrees.clone(),
        faults: stretch.faults.clone(),
        computed: stretch.computed.clone(),
        ..RecordingSegment::from(modelmill_identify::PreparedRun {
            file: run.file.clone(),
            time: decimate_time(time, factor),
            q: picked(&run.q),
            qd: picked(&run.qd),
            qdd: picked(&run.qdd),
            force: run.force.as_deref().map(&filtered).transpose()?,
            missing_force: run.missing_force.clone(),
            left_out: run.left_out.iter().map(heard).collect(),
            lines: run.lines.iter().copied().step_by(factor).collect(),
            repeatability: run.repeatability.clone(),
            prepared: run.prepared.clone(),
            notes: run.notes.clone(),
        })
    };
    thinned.run.prepared.decimate = LEFT;
    let passed = DECIMATION_PASSBAND / (step * (factor * LEFT) as f64);
    let says = format!(
        "{} is long: the diagnosis uses every {}th of its {samples} samples, after a low-pass at {} Hz on forces and \
         regressor.",
        run.file,
        factor * LEFT,
        crate::text::table::significant(passed, 3)
    );
    thinned.note(model, RecordingNote::info(says));
    Ok(thinned)
}

#[cfg(test)]
mod tests {
    use modelmill_identify::{PreparationRecord, PreparedRun};

    use super::*;
    use crate::Host;

    /// A long segment of a pendulum, of which the parallel filter keeps one in ten samples.
    fn long(samples: usize, band_hz: f64) -> RecordingSegment {
        let time: Vec<f64> = (0..samples).map(|i| 1e-3 * i as f64).collect();
        let of = |f: &dyn Fn(f64) -> f64| vec![time.iter().map(|t| f(*t)).collect::<Vec<f64>>()];
        let states = [of(&f64::sin), of(&f64::cos), of(&|t| -t.sin())];
        let force = Some(of(&|t| 5.0 * t.sin()));
        RecordingSegment::from(PreparedRun {
            left_out: vec![vec![false; samples]],
            prepared: PreparationRecord {
                band_hz: Some(band_hz),
                decimate: 10,
                ..PreparationRecord::default()
            },
            ..PreparedRun::from_states("long.csv".to_owned(), time, states, force)
        })
    }

    #[test]
    fn as_few_samples_are_kept_as_the_band_allows() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../model-spec/models/emps.toml");
        let model = Host::default().model(path);
        let model = model.unwrap_or_else(|error| panic!("{error}"));
        for (samples, band, kept) in [
            (250_000, 200.0, 31_250),
            (250_000, 100.0, 15_625),
            (250_000, 60.0, 10_417),
            (250_000, 20.0, 8_929),
            (650_000, 100.0, 40_625),
        ] {
            let whole = long(samples, band);
            let fewer = thin_out(&model, &whole).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(fewer.samples().div_ceil(fewer.decimation()), kept, "{band} Hz");
            let again = thin_out(&model, &fewer).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(again.samples(), fewer.samples());
            assert_eq!(again.decimation(), fewer.decimation());
            // States are picked, and forces go with them.
            for (q, force) in fewer.run.q[0]
                .iter()
                .zip(&fewer.run.measured_forces().expect("forces")[0])
            {
                assert!((force - 5.0 * q).abs() < 1e-3, "{force} N m at {q}");
            }
        }
    }
}
