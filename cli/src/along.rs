//! A model along a recording: its forces, beside the measured ones, and where they differ.

use modelmill_codegen::{Evaluator, Reactions, States};
use modelmill_identify::{
    Comparison, Figures, LocateOptions, Region, TIME_COLUMN, decimate_columns, locate,
};
use modelmill_spec::DriveKind;

use crate::data::Data;
use crate::failure::{Failure, Outcome};
use crate::model::Model;
use crate::progress::watched;

/// The model's forces along a recording for given base parameters, `[drive][sample]`, decimated.
pub(crate) fn forces(model: &Model, data: &Data, values: &[f64]) -> Outcome<Vec<Vec<f64>>> {
    let evaluator = Evaluator::new(&model.derivation);
    let columns = columns(model, data, |states| {
        evaluator.inverse_dynamics(states, values)
    })?;
    decimated(columns, data)
}

/// Determined components of the reactions along a recording for nominal parameters, `[component][sample]`, decimated.
pub(crate) fn reactions(
    model: &Model,
    data: &Data,
    reactions: &Reactions,
) -> Outcome<Vec<Vec<f64>>> {
    let evaluator = Evaluator::new(&model.derivation);
    let columns = columns(model, data, |states| evaluator.reactions(reactions, states))?;
    decimated(columns, data)
}

/// The measured forces, `[drive][sample]`, decimated.
pub(crate) fn measured(data: &Data) -> Outcome<Vec<Vec<f64>>> {
    decimated(data.run.measured()?.to_vec(), data)
}

/// Error figures over several recordings; forces are `[drive][sample]` for each.
pub(crate) fn figures<'a>(
    drives: &[String],
    pairs: impl IntoIterator<Item = (&'a [Vec<f64>], &'a [Vec<f64>])>,
) -> Outcome<Figures> {
    let mut comparison = Comparison::new(drives.iter().cloned());
    for (measured, model) in pairs {
        comparison.add(&interleaved(measured), &interleaved(model))?;
    }
    Ok(comparison.finish()?)
}

/// `[sample * n_drives + drive]`.
pub(crate) fn interleaved(channels: &[Vec<f64>]) -> Vec<f64> {
    let samples = channels.first().map_or(0, Vec::len);
    (0..samples)
        .flat_map(|sample| channels.iter().map(move |channel| channel[sample]))
        .collect()
}

/// Errors below this fraction of the measured force are rounding of the numbers in the recording; where they sit says
/// nothing about the mechanism.
pub(crate) const ROUNDING: f64 = 1e-6;

/// Where errors live.
pub(crate) struct Places {
    /// Regions that hold more than their share.
    pub(crate) regions: Vec<Region>,
    /// Drives whose error is so small that it was not looked at.
    pub(crate) rounding: Vec<String>,
}

/// Regions of coordinates, rates, loads and time that hold more than their share of the error.
///
/// With several recordings, time is looked at in each of them on its own.
pub(crate) fn places(
    model: &Model,
    data: &[Data],
    measured: &[Vec<Vec<f64>>],
    forces: &[Vec<Vec<f64>>],
) -> Outcome<Places> {
    let mut rounding = Vec::new();
    let mut drives = Vec::new();
    for (d, drive) in model.drives().into_iter().enumerate() {
        if is_rounding(d, measured, forces) {
            rounding.push(drive);
        } else {
            drives.push((d, drive));
        }
    }
    if drives.is_empty() {
        return Ok(Places {
            regions: Vec::new(),
            rounding,
        });
    }
    let errors_of = |k: usize, d: usize| -> Vec<f64> {
        let pairs = measured[k][d].iter().zip(&forces[k][d]);
        pairs.map(|(y, m)| y - m).collect()
    };
    let mut joined: Vec<(String, Vec<f64>)> = Vec::new();
    let mut errors: Vec<Vec<f64>> = vec![Vec::new(); drives.len()];
    let mut in_time = Vec::new();
    for (k, one) in data.iter().enumerate() {
        let mut variables = variables(model, one)?;
        let time = one.time();
        if data.len() == 1 {
            variables.push((TIME_COLUMN.to_owned(), time));
        } else {
            for (d, drive) in &drives {
                let error = errors_of(k, *d);
                let mut found = locate(
                    &[(drive, &error)],
                    &[(TIME_COLUMN, &time)],
                    &LocateOptions::default(),
                );
                for region in &mut found {
                    region.says = format!("{}: {}", one.run.file, region.says);
                }
                in_time.extend(found);
            }
        }
        for (slot, (d, _)) in errors.iter_mut().zip(&drives) {
            slot.extend(errors_of(k, *d));
        }
        if joined.is_empty() {
            joined = variables;
        } else {
            for ((_, all), (_, values)) in joined.iter_mut().zip(variables) {
                all.extend(values);
            }
        }
    }
    let errors: Vec<(&str, &[f64])> = drives
        .iter()
        .map(|(_, drive)| drive.as_str())
        .zip(errors.iter().map(Vec::as_slice))
        .collect();
    let variables: Vec<(&str, &[f64])> = joined
        .iter()
        .map(|(name, values)| (name.as_str(), values.as_slice()))
        .collect();
    let mut regions = watched("looking where the error lives", 0, |_| {
        locate(&errors, &variables, &LocateOptions::default())
    });
    regions.extend(in_time);
    Ok(Places { regions, rounding })
}

/// Whether the error of a drive is rounding beside its force.
fn is_rounding(drive: usize, measured: &[Vec<Vec<f64>>], forces: &[Vec<Vec<f64>>]) -> bool {
    let (mut error, mut size) = (0.0, 0.0);
    for (measured, forces) in measured.iter().zip(forces) {
        for (y, m) in measured[drive].iter().zip(&forces[drive]) {
            error += (y - m).powi(2);
            size += y * y;
        }
    }
    error <= ROUNDING * ROUNDING * size
}

/// Variables on which an error may depend, decimated like the forces: coordinates and their
/// derivatives, passive coordinates, lengths and rates of linear drives, and measured loads.
pub(crate) fn variables(model: &Model, data: &Data) -> Outcome<Vec<(String, Vec<f64>)>> {
    let run = &data.run;
    let mut variables = Vec::new();
    for (i, name) in model.active().into_iter().enumerate() {
        variables.push((format!("{name}_d"), run.qd[i].clone()));
        variables.push((format!("{name}_dd"), run.qdd[i].clone()));
        variables.push((name, run.q[i].clone()));
    }
    let evaluator = Evaluator::new(&model.derivation);
    let passive = model.passive();
    if !passive.is_empty() {
        let mut columns = columns(model, data, |states| evaluator.passive(states))?.into_iter();
        variables.extend(passive.iter().cloned().zip(columns.by_ref()));
        variables.extend(passive.iter().map(|name| format!("{name}_d")).zip(columns));
    }
    let mechanism = &model.derivation.mechanism;
    let n_drives = mechanism.drives.len();
    if mechanism
        .drives
        .iter()
        .any(|d| matches!(d.kind, DriveKind::Linear { .. }))
    {
        let columns = columns(model, data, |states| evaluator.drives(states))?;
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
    // A force by the name of its column in the recording is the load.
    for (drive, force) in mechanism.drives.iter().zip(run.force.iter().flatten()) {
        variables.push((drive.name.clone(), force.clone()));
    }
    let (names, columns): (Vec<String>, Vec<Vec<f64>>) = variables.into_iter().unzip();
    // Variables only say where: every n-th value will do, and keeps signs and ends as they are.
    let factor = data.decimation();
    let picked = columns
        .into_iter()
        .map(|column| column.into_iter().step_by(factor).collect());
    Ok(names.into_iter().zip(picked).collect())
}

/// Columns of numbers along a recording, evaluated block by block.
pub(crate) fn columns(
    model: &Model,
    data: &Data,
    mut evaluate: impl FnMut(&States<'_>) -> Result<Vec<Vec<f64>>, modelmill_codegen::PoseFault>,
) -> Outcome<Vec<Vec<f64>>> {
    let mut columns: Vec<Vec<f64>> = Vec::new();
    watched(
        &format!("evaluating {}", data.run.file),
        data.samples(),
        |done| {
            data.for_each_block(model, |states| {
                Ok::<_, Failure>(evaluate(states).map(|block| {
                    done.add(states.len());
                    if columns.is_empty() {
                        columns = block;
                    } else {
                        for (column, more) in columns.iter_mut().zip(block) {
                            column.extend(more);
                        }
                    }
                }))
            })
        },
    )?;
    Ok(columns)
}

/// The parallel filter, on every column; one of zeros stays one.
pub(crate) fn decimated(columns: Vec<Vec<f64>>, data: &Data) -> Outcome<Vec<Vec<f64>>> {
    let factor = data.decimation();
    if factor == 1 {
        return Ok(columns);
    }
    let is_zero = |column: &[f64]| column.iter().all(|x| *x == 0.0);
    let moving: Vec<&[f64]> = columns
        .iter()
        .map(Vec::as_slice)
        .filter(|column| !is_zero(column))
        .collect();
    let mut filtered = decimate_columns(&moving, factor)
        .map_err(|error| Failure::Input(format!("{}: {error}", data.run.file)))?
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
