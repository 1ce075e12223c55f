//! A model evaluated at all samples of a recording: its forces and reactions, the measured forces, and variables on
//! which an error may depend.

use modelmill_codegen::{ModelEvaluator, MotionStates, PoseFault, PoseReason, ReactionPrograms};
use modelmill_identify::{DECIMATION_PASSBAND, decimate_columns};
use modelmill_spec::DriveKind;

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::segment::RecordingSegment;

/// The model's forces along a segment for given base parameters, `[drive][sample]`, N or N m, not decimated.
///
/// Fails when a pose has no solution.
pub fn forces(model: &Model, data: &RecordingSegment, values: &[f64]) -> Outcome<Vec<Vec<f64>>> {
    let evaluator = ModelEvaluator::new(&model.derivation);
    columns(model, data, |states| evaluator.inverse_dynamics(states, values))
}

/// Reactions of the joints along a segment for nominal parameters, `[component][sample]`, N or N m, decimated. Only
/// those components are computed that the equations of motion determine.
///
/// Fails when a pose has no solution, or the segment is too short to be filtered.
pub fn reactions(model: &Model, data: &RecordingSegment, reactions: &ReactionPrograms) -> Outcome<Vec<Vec<f64>>> {
    let evaluator = ModelEvaluator::new(&model.derivation);
    let columns = columns(model, data, |states| evaluator.reactions(reactions, states))?;
    filter_and_decimate(columns, data)
}

/// The measured forces, `[drive][sample]`, N or N m, decimated.
///
/// Fails when the recording has no forces, or the segment is too short to be filtered.
pub fn measured_forces(data: &RecordingSegment) -> Outcome<Vec<Vec<f64>>> {
    filter_and_decimate(data.run.measured_forces()?.to_vec(), data)
}

/// The measured forces with excluded samples set to zero, `[drive][sample]`, decimated. Rows of the regressor are set
/// to zero at the same samples, so that both sides of each equation stay consistent after any filter.
///
/// Fails as [`measured_forces`] does.
pub fn included_forces(data: &RecordingSegment) -> Outcome<Vec<Vec<f64>>> {
    let mut forces = data.run.measured_forces()?.to_vec();
    for (force, out) in forces.iter_mut().zip(&data.run.left_out) {
        for (force, _) in force.iter_mut().zip(out).filter(|(_, out)| **out) {
            *force = 0.0;
        }
    }
    filter_and_decimate(forces, data)
}

/// Channels interleaved per sample: `[sample * n_drives + drive]`.
pub fn interleave(channels: &[Vec<f64>]) -> Vec<f64> {
    let samples = channels.first().map_or(0, Vec::len);
    (0..samples)
        .flat_map(|sample| channels.iter().map(move |channel| channel[sample]))
        .collect()
}

/// Variables on which an error may depend, with their names, decimated like the forces: coordinates and their
/// derivatives, passive coordinates, lengths and rates of linear drives, and measured loads; SI units.
///
/// Fails when a pose has no solution.
pub fn variables(model: &Model, data: &RecordingSegment) -> Outcome<Vec<(String, Vec<f64>)>> {
    let run = &data.run;
    let mut variables = Vec::new();
    // Active coordinates come from the recording with their derivatives.
    for (i, name) in model.active_coordinates().into_iter().enumerate() {
        variables.push((format!("{name}_d"), run.qd[i].clone()));
        variables.push((format!("{name}_dd"), run.qdd[i].clone()));
        variables.push((name, run.q[i].clone()));
    }
    // Passive coordinates and their rates are computed by loop closure.
    let evaluator = ModelEvaluator::new(&model.derivation);
    let passive = model.passive_coordinates();
    if !passive.is_empty() {
        let mut columns = columns(model, data, |states| evaluator.passive_motion(states))?.into_iter();
        variables.extend(passive.iter().cloned().zip(columns.by_ref()));
        variables.extend(passive.iter().map(|name| format!("{name}_d")).zip(columns));
    }
    // Linear drives act along a length that is no coordinate.
    let mechanism = &model.derivation.mechanism;
    let n_drives = mechanism.drives.len();
    if mechanism
        .drives
        .iter()
        .any(|d| matches!(d.kind, DriveKind::Linear { .. }))
    {
        let columns = columns(model, data, |states| evaluator.drive_motion(states))?;
        for (d, drive) in mechanism.drives.iter().enumerate() {
            if matches!(drive.kind, DriveKind::Linear { .. })
                && let [length, rate] = [d, n_drives + d].map(|i| columns.get(i).cloned())
                && let (Some(length), Some(rate)) = (length, rate)
            {
                variables.push((format!("{}_length", drive.name), length));
                variables.push((format!("{}_d", drive.name), rate));
            }
        }
    }
    // A variable with the name of a drive is its measured force, the load.
    for (drive, force) in mechanism.drives.iter().zip(run.force.iter().flatten()) {
        variables.push((drive.name.clone(), force.clone()));
    }
    let (names, columns): (Vec<String>, Vec<Vec<f64>>) = variables.into_iter().unzip();
    // Variables only locate errors: every n-th value suffices, and keeps signs and ends unchanged.
    let factor = data.decimation();
    let picked = columns
        .into_iter()
        .map(|column| column.into_iter().step_by(factor).collect());
    Ok(names.into_iter().zip(picked).collect())
}

/// Columns of numbers along a segment, evaluated block by block: `[column][sample]`.
///
/// Fails at the first pose without a solution, and at the first value that is not finite.
pub fn columns(
    model: &Model,
    data: &RecordingSegment,
    mut evaluate: impl FnMut(&MotionStates<'_>) -> Result<Vec<Vec<f64>>, PoseFault>,
) -> Outcome<Vec<Vec<f64>>> {
    let mut columns: Vec<Vec<f64>> = Vec::new();
    model
        .host()
        .run_job(&format!("evaluating {}", data.run.file), data.samples(), |job| {
            data.for_each_block(model, |states| {
                job.step(states.len())?;
                Ok::<_, Error>(evaluate(states).and_then(check_finite).map(|block| {
                    if columns.is_empty() {
                        columns = block;
                    } else {
                        for (column, more) in columns.iter_mut().zip(block) {
                            column.extend(more);
                        }
                    }
                }))
            })
        })??;
    Ok(columns)
}

/// Rejects infinite values and NaN, such as products of values that are too large.
fn check_finite(block: Vec<Vec<f64>>) -> Result<Vec<Vec<f64>>, PoseFault> {
    let first = block
        .iter()
        .filter_map(|column| column.iter().position(|x| !x.is_finite()));
    match first.min() {
        Some(sample) => Err(PoseFault {
            sample,
            reason: PoseReason::Undefined,
        }),
        None => Ok(block),
    }
}

/// Applies a low-pass to every column, then decimates it by the factor of the recording; a column of zeros stays zero.
///
/// Fails when a column is too short for the filter.
pub fn filter_and_decimate(columns: Vec<Vec<f64>>, data: &RecordingSegment) -> Outcome<Vec<Vec<f64>>> {
    let factor = data.decimation();
    if factor == 1 {
        return Ok(columns);
    }
    // Zero columns are only thinned: filtering them would take time and add rounding.
    let is_zero = |column: &[f64]| column.iter().all(|x| *x == 0.0);
    let moving: Vec<&[f64]> = columns
        .iter()
        .map(Vec::as_slice)
        .filter(|column| !is_zero(column))
        .collect();
    let mut filtered = decimate_columns(&moving, factor)
        .map_err(|error| Error::input(format!("{}: {error}", data.run.file)))?
        .into_iter();
    let picked = |column: &Vec<f64>| column.iter().copied().step_by(factor).collect();
    Ok(columns
        .iter()
        .map(|column| {
            if is_zero(column) {
                picked(column)
            } else {
                filtered.next().unwrap_or_default()
            }
        })
        .collect())
}

/// The highest frequency that the filter of the decimation passes, Hz.
pub fn decimation_passband(data: &RecordingSegment) -> f64 {
    let time = &data.run.time;
    let rate = match time.as_slice() {
        [first, .., last] => (time.len() - 1) as f64 / (last - first),
        _ => 0.0,
    };
    DECIMATION_PASSBAND * rate / data.decimation() as f64
}

/// Rates of the drives, `[drive][sample]`, rad/s or m/s, not decimated. They are computed from the drives' Jacobian,
/// since a drive may act along a rod or on a passive coordinate.
///
/// Fails when a pose has no solution.
pub fn drive_rates(model: &Model, data: &RecordingSegment) -> Outcome<Vec<Vec<f64>>> {
    let [_, rates] = drive_motion(model, data)?;
    Ok(rates)
}

/// Positions and rates of the drives, each `[drive][sample]`, rad or m and rad/s or m/s, not decimated.
///
/// Fails when a pose has no solution.
pub fn drive_motion(model: &Model, data: &RecordingSegment) -> Outcome<[Vec<Vec<f64>>; 2]> {
    let evaluator = ModelEvaluator::new(&model.derivation);
    let mut positions = columns(model, data, |states| evaluator.drive_motion(states))?;
    // Columns are ordered: positions, rates, Jacobian.
    let mut rates = positions.split_off(model.derivation.mechanism.drives.len());
    rates.truncate(positions.len());
    Ok([positions, rates])
}
