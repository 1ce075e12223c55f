//! Limits of planned motions: ranges of coordinates, forces and points, and the distance from singular poses.
//!
//! The table `limits` goes in, [`MotionLimits`] by index come out.

use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::exact::CoordinateIdx;
use crate::mechanism::{CoordinateBounds, DriveIdx, FramePoint, JointCoordinate, ModelDrive, MotionLimits, PointIdx};
use crate::range::ValueRange;
use crate::schema::ModelEntry;
use crate::suggest;

/// Reads the limits; a name that the file does not have is reported.
///
/// Coordinates, drives and points are those of the mechanism, in their order.
pub(super) fn limits(
    model: &ModelEntry,
    coordinates: &[JointCoordinate],
    drives: &[ModelDrive],
    points: &[FramePoint],
    log: &mut DiagnosticLog,
) -> MotionLimits {
    let mut limits = MotionLimits::default();
    let Some(entry) = &model.limits else {
        return limits;
    };
    // After an error a name may be missing only because its entry was faulty.
    let is_sound = log.n_errors() == 0;
    let ends = |range: &Option<ValueRange>| range.as_ref().map(|range| range.ends);
    // Limits of coordinates: position, rate and acceleration.
    for (key, one) in entry.coordinates.iter().flat_map(|named| &named.entries) {
        let names = coordinates.iter().map(|c| c.name.as_str());
        let Some(i) = position(&key.name, key.span, "coordinate", names, is_sound, log) else {
            continue;
        };
        let coordinate = &coordinates[i];
        // Rates of passive coordinates are functions of the active ones, so they have no limits of their own.
        let of_rates = one.rate.as_ref().or(one.acceleration.as_ref());
        if let (true, Some(range)) = (coordinate.passive, of_rates) {
            log.push(
                Diagnostic::error(
                    range.span,
                    format!("`{}` is passive: only its position can be limited", key.name),
                )
                .label("rates and accelerations are limited where drives act")
                .help("limit the rates of the active coordinates instead"),
            );
        }
        // The nominal pose must satisfy the limits, because planning starts there.
        if let Some(range) = &one.position
            && !(range.ends[0]..=range.ends[1]).contains(&coordinate.nominal)
        {
            log.push(
                Diagnostic::error(
                    range.span,
                    format!(
                        "the nominal pose has `{}` at {}, outside of its limits",
                        key.name, coordinate.nominal
                    ),
                )
                .label(format!("from {} to {}", range.ends[0], range.ends[1]))
                .help("widen the limits, or move the nominal value into them; angles are in rad"),
            );
        }
        // A range without zero could never be met at the start and end of a motion.
        for (what, range) in [("rate", &one.rate), ("acceleration", &one.acceleration)] {
            if let Some(range) = range
                && !(range.ends[0] < 0.0 && range.ends[1] > 0.0)
            {
                log.push(
                    Diagnostic::error(range.span, format!("this {what} can never be zero"))
                        .label("expected a range around 0")
                        .help("one number means both directions, such as `rate = 2`"),
                );
            }
        }
        // All ranges of one coordinate are kept together.
        limits.coordinates.push((
            CoordinateIdx(i),
            CoordinateBounds {
                position: ends(&one.position),
                rate: ends(&one.rate),
                acceleration: ends(&one.acceleration),
            },
        ));
    }
    // Limits of forces of drives.
    for (key, one) in entry.drives.iter().flat_map(|named| &named.entries) {
        let names = drives.iter().map(|d| d.name.as_str());
        let found = position(&key.name, key.span, "drive", names, is_sound, log);
        if let (Some(i), Some(force)) = (found, ends(&one.force)) {
            limits.forces.push((DriveIdx(i), force));
        }
    }
    // Boxes of points, one range per axis.
    for (key, one) in entry.points.iter().flat_map(|named| &named.entries) {
        let names = points.iter().map(|p| p.name.as_str());
        if let Some(i) = position(&key.name, key.span, "point", names, is_sound, log) {
            let ranges = [ends(&one.x), ends(&one.y), ends(&one.z)];
            limits.points.push((PointIdx(i), ranges));
        }
    }
    // The distance from singular poses is a share between 0 and 1, both excluded.
    if let Some(number) = &entry.singularity {
        if number.value > 0.0 && number.value < 1.0 {
            limits.singularity = Some(number.value);
        } else {
            log.push(
                Diagnostic::error(number.span, "this is not a share of the value at the nominal pose")
                    .label("expected a number between 0 and 1, such as 0.3"),
            );
        }
    }
    limits
}

/// The position of a name in a list; an unknown name is reported, unless an earlier error may explain it.
///
/// `what` is the sort of thing in the singular; `is_sound` is false after an earlier error.
fn position<'a>(
    name: &str,
    span: SourceSpan,
    what: &str,
    names: impl Iterator<Item = &'a str> + Clone,
    is_sound: bool,
    log: &mut DiagnosticLog,
) -> Option<usize> {
    let found = names.clone().position(|other| other == name);
    if found.is_none() && is_sound && !log.is_full() {
        log.push(
            Diagnostic::error(span, format!("there is no {what} `{name}`"))
                .label(format!("expected the name of a {what}"))
                .help(suggest::advice(name, &format!("{what}s"), names)),
        );
    }
    found
}
