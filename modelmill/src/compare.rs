//! `compare`: errors of a model along recordings, the ranges of variables in which they are large, and how they depend
//! on the rates of the drives.

use modelmill_identify::{
    BandError, DriveResidual, ErrorAccumulator, ErrorFigures, ErrorRegion, FilteredFigures, LocateOptions,
    RateDependence, RecordingNote, TIME_COLUMN, add_filtered_forces, find_rate_dependence, locate_errors,
};
use modelmill_spec::DriveKind;

use crate::along::{self, interleave, variables};
use crate::error::Outcome;
use crate::faults::SuspectedFault;
use crate::model::Model;
use crate::recording::{self, PreparedRecording};
use crate::segment::RecordingSegment;
use crate::text::table::significant;

/// Errors of a model along recordings.
pub struct ModelComparison {
    /// Name of the model in the JSON.
    pub model: String,
    /// File names of the segments, in order.
    pub files: Vec<String>,
    /// Error metrics, over all drives and for each drive.
    pub figures: ErrorFigures,
    /// Ranges of variables in which the error is large.
    pub error_locations: ErrorLocations,
    /// Notes on the recordings.
    pub notes: Vec<RecordingNote>,
    /// The suspected mistake of the first recording that has one: until it is corrected, all figures are doubtful.
    pub suspect: Option<SuspectedFault>,
}

impl Model {
    /// Compares the model with recordings; `values` are those of its base parameters, in its order and in their units.
    ///
    /// Fails when a recording lacks the force of a drive, or contains a pose that the mechanism cannot reach.
    pub fn compare(&self, recordings: &[&PreparedRecording], values: &[f64]) -> Outcome<ModelComparison> {
        // Forces are computed once, for the figures and for the regions.
        let [data, _] = recording::segments(self, recordings, &[]);
        let forces = data
            .iter()
            .map(|one| along::forces(self, one, values))
            .collect::<Outcome<Vec<_>>>()?;
        let figures = figures(self, &data, &forces, band(&data))?;
        // Regions are located on decimated forces, figures are computed on all samples.
        let measured = (data.iter().map(along::measured_forces)).collect::<Outcome<Vec<_>>>()?;
        let forces = (forces.into_iter().zip(&data))
            .map(|(forces, one)| along::filter_and_decimate(forces, one))
            .collect::<Outcome<Vec<_>>>()?;
        Ok(ModelComparison {
            model: self.name.clone(),
            files: data.iter().map(|one| one.run.file.clone()).collect(),
            figures,
            error_locations: error_locations(self, &data, &measured, &forces)?,
            suspect: first_suspect(recordings),
            notes: {
                let notes = data.iter().flat_map(RecordingSegment::notes).cloned();
                self.caution().into_iter().chain(notes).collect()
            },
        })
    }
}

/// The suspected mistake of the first of some recordings that has one.
pub(crate) fn first_suspect(recordings: &[&PreparedRecording]) -> Option<SuspectedFault> {
    recordings.iter().find_map(|one| one.suspected_fault()).cloned()
}

/// The frequency up to which the forces of all recordings can be compared, Hz. Each recording may have such a frequency
/// from its preparation: the cut-off of the filter, or the band of the motion. The lowest one counts; `None` if no
/// recording has one.
pub fn band(data: &[RecordingSegment]) -> Option<f64> {
    let bands = data.iter().filter_map(|one| one.run.prepared.band_hz);
    bands.reduce(f64::min)
}

/// Error metrics over several recordings, from all samples whose force was measured. With `band_hz` (Hz), the result
/// also contains the metrics after a low-pass of both forces with this cut-off. `forces` are the model's,
/// `[drive][sample]` for each recording.
///
/// Fails when a recording has no forces, or when forces differ in number.
pub fn figures(
    model: &Model,
    data: &[RecordingSegment],
    forces: &[Vec<Vec<f64>>],
    band_hz: Option<f64>,
) -> Outcome<ErrorFigures> {
    let mut raw = comparison(model);
    for (one, forces) in data.iter().zip(forces) {
        let measured = one.run.measured_forces()?;
        raw.add_counted(&interleave(measured), &interleave(forces), |sample, drive| {
            one.run.is_force_measured(drive, sample)
        })?;
    }
    let mut figures = raw.finish()?;
    // Figures in the band use both forces after the same low-pass.
    figures.band = band_hz.and_then(|band_hz| {
        let mut filtered = comparison(model);
        for (one, forces) in data.iter().zip(forces) {
            let measured = one.run.measured_forces().ok()?;
            // A segment that is too short for the filter has no samples left between its ends.
            match add_filtered_forces(&mut filtered, &one.run.time, measured, forces, band_hz) {
                Ok(()) | Err(BandError::Filter(_)) => {}
                Err(BandError::Figures(_)) => return None,
            }
        }
        let found = filtered.finish().ok()?;
        Some(FilteredFigures::new(band_hz, &found))
    });
    Ok(figures)
}

/// Error figures of the decimated forces that a fit used; `None` if no recording is decimated.
///
/// Fails as [`figures`] does.
pub fn figures_of_rows(
    model: &Model,
    data: &[RecordingSegment],
    forces: &[Vec<Vec<f64>>],
) -> Outcome<Option<FilteredFigures>> {
    let Some(first) = data.iter().find(|one| one.decimation() > 1) else {
        return Ok(None);
    };
    let mut rows = comparison(model);
    for (one, forces) in data.iter().zip(forces) {
        let measured = along::measured_forces(one)?;
        let forces = along::filter_and_decimate(forces.clone(), one)?;
        rows.add(&interleave(&measured), &interleave(&forces))?;
    }
    // The passband of the first decimated segment stands for all.
    let passed = along::decimation_passband(first);
    Ok(Some(FilteredFigures::new(passed, &rows.finish()?)))
}

/// An accumulator of errors for the model's drives, without samples yet.
fn comparison(model: &Model) -> ErrorAccumulator {
    let drives = model.row_names();
    let units = (0..drives.len()).map(|d| model.force_unit(d).to_owned());
    ErrorAccumulator::new(drives.clone()).with_units(units)
}

/// Errors below this fraction of the measured force are rounding of the numbers in the recording, so they are not
/// located.
pub const ROUNDING: f64 = 1e-6;

/// Ranges of variables in which the error of a model is large, and how it depends on the rates of the drives.
pub struct ErrorLocations {
    /// Ranges of a variable whose share of the squared error is larger than their share of the samples.
    pub regions: Vec<ErrorRegion>,
    /// Drives whose error is rounding and was not located.
    pub rounding: Vec<String>,
    /// How the residual of each drive depends on the rate of this drive. It shows forms of friction whose error is
    /// spread over all samples, and therefore appears in no region. Empty if the dependence is not significant or too
    /// small to matter.
    pub by_rate: Vec<RateDependence>,
}

/// Ranges of coordinates, rates, loads and time in which the error is large: their share of the squared error is larger
/// than their share of the samples.
///
/// With several recordings, time is analysed in each of them separately.
///
/// Fails when a pose has no solution.
pub fn error_locations(
    model: &Model,
    data: &[RecordingSegment],
    measured: &[Vec<Vec<f64>>],
    forces: &[Vec<Vec<f64>>],
) -> Outcome<ErrorLocations> {
    let mut rounding = Vec::new();
    let mut drives = Vec::new();
    // Drives with nothing but rounding are excluded first.
    for (d, drive) in model.row_names().into_iter().enumerate() {
        if is_rounding(d, measured, forces) {
            rounding.push(drive);
        } else {
            drives.push((d, drive));
        }
    }
    if drives.is_empty() {
        return Ok(ErrorLocations {
            regions: Vec::new(),
            rounding,
            by_rate: Vec::new(),
        });
    }
    let errors_of = |k: usize, d: usize| -> Vec<f64> {
        let pairs = measured[k][d].iter().zip(&forces[k][d]);
        pairs.map(|(y, m)| y - m).collect()
    };
    // Errors and variables of all recordings are joined, except for time, which is analysed per recording.
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
                let mut found = locate_errors(&[(drive, &error)], &[(TIME_COLUMN, &time)], &LocateOptions::default());
                for region in &mut found {
                    region.says = format!("{}: {}", one.run.file, region_sentence(model, region));
                }
                in_time.extend(found);
            }
        }
        // Errors and variables of a recording are appended together, so that their samples stay aligned.
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
    let mut regions = model.host().run_job("locating errors", 0, |_| {
        locate_errors(&errors, &variables, &LocateOptions::default())
    })?;
    for region in &mut regions {
        region.says = region_sentence(model, region);
    }
    regions.extend(in_time);
    Ok(ErrorLocations {
        regions,
        rounding,
        by_rate: residuals_by_rate(model, data, measured, forces, &drives)?,
    })
}

/// A region as a sentence without full stop. The range has its unit, which only the model knows.
fn region_sentence(model: &Model, region: &ErrorRegion) -> String {
    format!(
        "{:.0} % of the squared error of {} is in the samples with {} {} ({:.0} % of all samples)",
        100.0 * region.share,
        region.channel,
        variable_phrase(model, &region.variable),
        region_range(region, &variable_unit(model, &region.variable)),
        100.0 * region.samples
    )
}

/// The range of a region as a phrase, such as `between 0.1 and 0.2 m/s`.
pub(crate) fn region_range(region: &ErrorRegion, unit: &str) -> String {
    let [low, high] = region.range;
    // A range of equal size on both sides of zero is a range of magnitudes, as for rates near standstill.
    let is_around_zero = low < 0.0 && low.to_bits() == (-high).to_bits();
    let around = if is_around_zero { ", around zero" } else { "" };
    let [low, high] = [low, high].map(|end| significant(end, 3));
    let separator = if unit.is_empty() { "" } else { " " };
    format!("between {low} and {high}{separator}{unit}{around}")
}

/// A variable in words by its name: `the length of spindle_left` for `spindle_left_length`, `the velocity theta1_d`.
/// Coordinates and the time keep their names.
pub(crate) fn variable_phrase(model: &Model, name: &str) -> String {
    let mut drives = model.derivation.mechanism.drives.iter().enumerate();
    let phrase = drives.find_map(|(d, drive)| {
        let is_linear = matches!(drive.kind, DriveKind::Linear { .. });
        let quantity = match name.strip_prefix(drive.name.as_str())? {
            "" if model.force_unit(d) == "N" => "force",
            "" => "torque",
            "_length" if is_linear => "length",
            "_d" if is_linear => "velocity",
            _ => return None,
        };
        Some(format!("the {quantity} of {}", drive.name))
    });
    phrase.unwrap_or_else(|| match derivative_word(model, name) {
        Some(word) => format!("the {word} {name}"),
        None => name.to_owned(),
    })
}

/// The word for a derivative of a coordinate by its name, such as `velocity` for `theta1_d`; `None` for other variables
/// and for quaternions, whose rates are components of an angular velocity.
fn derivative_word(model: &Model, name: &str) -> Option<&'static str> {
    let (of, word) = match name.strip_suffix("_dd") {
        Some(of) => (of, "acceleration"),
        None => (name.strip_suffix("_d")?, "velocity"),
    };
    let mut coordinates = model.derivation.mechanism.coordinates.iter();
    let coordinate = coordinates.find(|c| c.name == of)?;
    (coordinate.motion.unit() != "1").then_some(word)
}

/// Unit of a variable by its name: a coordinate or the length of a drive, their rates and accelerations, a force, the
/// time. Empty for a quaternion.
pub(crate) fn variable_unit(model: &Model, name: &str) -> String {
    let mechanism = &model.derivation.mechanism;
    if name == TIME_COLUMN {
        return "s".to_owned();
    }
    if let Some(d) = mechanism.drives.iter().position(|d| d.name == name) {
        return model.force_unit(d).to_owned();
    }
    let (of, per) = if let Some(of) = name.strip_suffix("_dd") {
        (of, "/s^2")
    } else if let Some(of) = name.strip_suffix("_d") {
        (of, "/s")
    } else {
        (name, "")
    };
    let of = of.strip_suffix("_length").unwrap_or(of);
    let coordinate = mechanism.coordinates.iter().find(|c| c.name == of);
    match coordinate.map_or("m", |c| c.motion.unit()) {
        "1" if per.is_empty() => String::new(),
        // The rates of a quaternion are components of an angular velocity.
        "1" => format!("rad{per}"),
        unit => format!("{unit}{per}"),
    }
}

/// How the residuals of a model with some values of its base parameters depend on the rates of their drives.
///
/// Fails when a pose has no solution.
pub(crate) fn residual_dependences(
    model: &Model,
    data: &[RecordingSegment],
    values: &[f64],
) -> Outcome<Vec<RateDependence>> {
    let measured = (data.iter().map(along::measured_forces)).collect::<Outcome<Vec<_>>>()?;
    let forces = data
        .iter()
        .map(|one| along::filter_and_decimate(along::forces(model, one, values)?, one))
        .collect::<Outcome<Vec<_>>>()?;
    let drives = model.row_names().into_iter().enumerate();
    let drives: Vec<(usize, String)> = drives.filter(|(d, _)| !is_rounding(*d, &measured, &forces)).collect();
    residuals_by_rate(model, data, &measured, &forces, &drives)
}

/// How the residuals of some drives, given by index and name, depend on their rates.
///
/// Fails when a pose has no solution.
fn residuals_by_rate(
    model: &Model,
    data: &[RecordingSegment],
    measured: &[Vec<Vec<f64>>],
    forces: &[Vec<Vec<f64>>],
    drives: &[(usize, String)],
) -> Outcome<Vec<RateDependence>> {
    let motions = data
        .iter()
        .map(|one| along::drive_motion(model, one))
        .collect::<Outcome<Vec<_>>>()?;
    let times: Vec<Vec<f64>> = data.iter().map(RecordingSegment::time).collect();
    let mut dependences = Vec::new();
    for (d, drive) in drives {
        let segments = data.iter().enumerate().map(|(k, one)| {
            // Positions and rates are not filtered: every n-th value keeps their signs.
            let pick = |values: &[f64]| values.iter().copied().step_by(one.decimation()).collect();
            let [positions, rates] = &motions[k];
            let pairs = measured[k][*d].iter().zip(&forces[k][*d]);
            let residual: Vec<f64> = pairs.map(|(y, m)| y - m).collect();
            let excluded = (0..residual.len()).map(|kept| one.has_excluded_input(*d, kept));
            DriveResidual {
                time: times[k].clone(),
                load: forces[k][*d].clone(),
                position: pick(&positions[*d]),
                rate: pick(&rates[*d]),
                excluded: excluded.collect(),
                residual,
            }
        });
        let segments: Vec<DriveResidual> = segments.collect();
        dependences.extend(find_rate_dependence(drive, model.force_unit(*d), &segments));
    }
    Ok(dependences)
}

/// Whether the error of a drive is rounding relative to its force; samples of all recordings count.
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
