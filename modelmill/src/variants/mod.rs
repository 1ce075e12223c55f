//! Comparison of two variants of a machine along the same motions: requirements on each drive, the products of
//! parameters that cause the difference, exceeded limits, and errors against measured forces.

mod counterparts;
mod effort;
mod limits;
mod terms;
mod thresholds;

use modelmill_boundary::message;
use modelmill_identify::{ErrorFigures, RecordingNote};

use crate::along;
use crate::compare;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::segment::RecordingSegment;

use counterparts::ModelCounterparts;
use effort::EffortSums;
use terms::SummandColumns;
use thresholds::FORCE_DIFFERENCE_LEAST_SHARE;

pub use effort::DriveEffort;
pub use limits::{LimitCrossing, LimitUse};
pub use terms::{ProductShare, TermShare};

/// The comparison of two models of one machine along the same motions.
#[derive(Clone, Debug)]
pub struct VariantComparison {
    /// File names of the recordings that provide the motions.
    pub recordings: Vec<String>,
    /// Number of samples of all recordings.
    pub samples: usize,
    /// Total duration of the segments, s.
    pub seconds: f64,
    /// The drives that both models have, in the order of the first model.
    pub drives: Vec<DriveVariants>,
    /// The limits of both files, including those that neither model exceeds.
    pub limits: Vec<LimitUse>,
    /// Error metrics, by comparison with measured forces, as [`Model::compare`] computes them; `None` for a model
    /// without measured forces.
    pub errors: [Option<ErrorFigures>; 2],
    /// Notes: what was left out, assumptions, and notes on the recordings.
    pub notes: Vec<RecordingNote>,
}

/// The comparison of one drive.
#[derive(Clone, Debug)]
pub struct DriveVariants {
    /// Its name.
    pub drive: String,
    /// Unit of its force: N or N m.
    pub unit: &'static str,
    /// Requirements of the first model.
    pub before: DriveEffort,
    /// Requirements of the second model.
    pub after: DriveEffort,
    /// The force of the second model minus that of the first, sample by sample.
    pub difference: ForceDifference,
    /// Causes of the difference, the largest share first; empty without a difference. Shares add up to 1.
    pub products: Vec<ProductShare>,
}

/// A difference of forces along motions, N or N m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ForceDifference {
    /// The largest magnitude.
    pub peak: f64,
    /// Root mean square over all samples.
    pub rms: f64,
}

impl VariantComparison {
    /// Fails when two models cannot be compared, as [`VariantComparison::along_recordings`] would, before any
    /// recording is read.
    ///
    /// ```
    /// use modelmill::Model;
    /// use modelmill::variants::VariantComparison;
    ///
    /// let arm = Model::open("../model-spec/models/two_link.toml")?;
    /// VariantComparison::check([&arm, &arm])?;
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn check(models: [&Model; 2]) -> Outcome {
        ModelCounterparts::match_models(models).map(|_| ())
    }

    /// Compares two models along the motions of recordings: `runs` are the same recordings, read for the first and for
    /// the second model. The motions of the first reading are used for both models, and the base parameters are those
    /// of the files.
    ///
    /// Measured forces are not needed. Effects that depend on the load of a drive get a calculated load: the force of
    /// their own model without these effects.
    ///
    /// Fails when the models do not have the same active coordinates, have no drive in common, or cannot follow
    /// a motion.
    pub fn along_recordings(models: [&Model; 2], runs: [&[&PreparedRecording]; 2]) -> Outcome<Self> {
        // Stage 1: assign coordinates and drives, and collect notes of both models.
        let counterparts = ModelCounterparts::match_models(models)?;
        let stretches = |runs: &[&PreparedRecording]| -> Vec<RecordingSegment> {
            runs.iter().flat_map(|one| one.segments.clone()).collect()
        };
        let motions = stretches(runs[0]);
        let mut notes = counterparts.notes.clone();
        notes.extend(load_note(models));
        for note in models.into_iter().flat_map(|m| m.base_parameter_values().notes) {
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        // Stage 2: sums over all motions: efforts, differences, causes and limits.
        let mut terms = SummandColumns::from_models(models);
        let mut limits = limits::VariantLimits::from_models(models);
        let n = counterparts.drives.len();
        let mut gathered = vec![[EffortSums::default(); 2]; n];
        let mut differences = vec![(0.0_f64, 0.0_f64); n];
        let (mut samples, mut seconds) = (0, 0.0);
        for motion in &motions {
            let time = &motion.run.time;
            let own = counterparts.own_states(models, motion)?;
            let forces = for_both(|m| forces_of(models[m], &own[m]))?;
            let rates = for_both(|m| along::drive_rates(models[m], &own[m]))?;
            let mut rest = Vec::new();
            for (k, [d, e]) in counterparts.drives.iter().copied().enumerate() {
                for (m, i) in [d, e].into_iter().enumerate() {
                    gathered[k][m].add(time, &forces[m][i], &rates[m][i]);
                }
                // The difference of the forces, with its peak and sum of squares.
                let pairs = forces[1][e].iter().zip(&forces[0][d]);
                let rest_of_drive: Vec<f64> = pairs.map(|(after, before)| after - before).collect();
                for x in &rest_of_drive {
                    differences[k].0 = differences[k].0.max(x.abs());
                    differences[k].1 += x * x;
                }
                rest.push(rest_of_drive);
            }
            terms.add(models, &own, &counterparts.drives, &rest)?;
            limits.add(models, &own, [&forces[0], &forces[1]])?;
            samples += time.len();
            seconds += time.last().zip(time.first()).map_or(0.0, |(end, start)| end - start);
        }
        // Stage 3: the results of each drive.
        let drives = (counterparts.drives.iter().enumerate()).map(|(k, [d, _])| {
            let [before, after] = gathered[k].map(EffortSums::effort);
            let (peak, squares) = differences[k];
            let rms = (squares / samples.max(1) as f64).sqrt();
            let is_rounding = rms <= FORCE_DIFFERENCE_LEAST_SHARE * before.rms.max(after.rms);
            DriveVariants {
                drive: models[0].derivation.mechanism.drives[*d].name.clone(),
                unit: models[0].force_unit(*d),
                before,
                after,
                difference: ForceDifference { peak, rms },
                products: if is_rounding {
                    Vec::new()
                } else {
                    terms.shares(models, k, squares)
                },
            }
        });
        let drives = drives.collect();
        // Stage 4: each model is compared with measured forces in its own reading.
        let errors = for_both(|m| errors(models[m], &stretches(runs[m])))?;
        if errors.iter().all(Option::is_none) {
            notes.push(RecordingNote::info(
                "No recording has the forces of all drives, so neither model is compared with measured forces.",
            ));
        }
        Ok(Self {
            recordings: motions.iter().map(|one| one.run.file.clone()).collect(),
            samples,
            seconds,
            drives,
            limits: limits.into_uses(),
            errors,
            notes,
        })
    }
}

/// Computes a value for the first and for the second model.
fn for_both<T>(mut of: impl FnMut(usize) -> Outcome<T>) -> Outcome<[T; 2]> {
    Ok([of(0)?, of(1)?])
}

/// Forces of a model at the values of its file, `[drive][sample]`, N or N m.
///
/// Fails when the model cannot follow the motion; the message names it.
fn forces_of(model: &Model, states: &RecordingSegment) -> Outcome<Vec<Vec<f64>>> {
    along::forces(model, states, &model.values).map_err(|error| match error {
        Error::Cancelled => error,
        // The error names the model, since the recording does not show which of both cannot follow.
        error => Error::input(message!("{} cannot follow the motion: {}", model.path, error.message())),
    })
}

/// The note on effects that depend on the load, and on the load that they use; `None` without such effects.
fn load_note(models: [&Model; 2]) -> Option<RecordingNote> {
    let mut effects: Vec<&str> = models.iter().flat_map(|m| m.load_dependent_effects()).collect();
    // Both models may have the same effect.
    effects.sort_unstable();
    effects.dedup();
    (!effects.is_empty()).then(|| {
        RecordingNote::info(format!(
            "The load of a drive, on which {} depends, is the force of each model without that effect, not the measured \
             one. Errors use the measured one, as `compare` does.",
            effects.join(", ")
        ))
    })
}

/// Error metrics of a model along those recordings that have forces; `None` if none has.
fn errors(model: &Model, runs: &[RecordingSegment]) -> Outcome<Option<ErrorFigures>> {
    let mut measured = runs.to_vec();
    measured.retain(|one| one.run.force.is_some());
    if measured.is_empty() {
        return Ok(None);
    }
    let forces = measured
        .iter()
        .map(|one| along::forces(model, one, &model.values))
        .collect::<Outcome<Vec<_>>>()?;
    let band = compare::band(&measured);
    compare::figures(model, &measured, &forces, band).map(Some)
}
