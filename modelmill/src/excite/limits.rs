//! Limits given as options, which extend those of the model file or replace them: `theta1=1.5:2.1`, `theta1_d=1.2`,
//! `spindle_left=1500`, `R3m.x=0.2:0.7`, `singularity=0.3`.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::RecordingNote;
use modelmill_identify::excite::ExcitationLimits;
use modelmill_spec::{CoordinateIdx, DriveIdx, MotionLimits, PointIdx};

use crate::error::{Error, Outcome};
use crate::excite::plant::AXES;
use crate::model::Model;
use crate::recording::{self, PreparedRecording};
use crate::text::table::significant;

/// One limit that was given as an option.
#[derive(Debug, Clone, PartialEq)]
pub struct TrajectoryLimit {
    /// The limited quantity: a coordinate, its rate or acceleration, a drive, an axis of a point, or
    /// `singularity`.
    name: String,
    /// The single number, if one was given; NaN for a range.
    value: f64,
    /// Lower and upper end, SI units.
    ends: [f64; 2],
}

impl TrajectoryLimit {
    /// Reads `NAME=SIZE`, which is the range from -SIZE to SIZE, or `NAME=LOW:HIGH`.
    ///
    /// Fails with the expected form, as text.
    ///
    /// ```
    /// use modelmill::excite::TrajectoryLimit;
    ///
    /// assert!(TrajectoryLimit::parse("theta1=1.5:2.1").is_ok());
    /// assert!(TrajectoryLimit::parse("theta1=2.1:1.5").is_err());
    /// ```
    pub fn parse(text: &str) -> Result<Self, String> {
        let expected = || "expected NAME=SIZE or NAME=LOW:HIGH, such as theta1_d=1.2 or theta1=1.5:2.1".to_owned();
        let (name, range) = text.split_once('=').ok_or_else(expected)?;
        // Numbers must be finite, so that a range has an end.
        let number = |text: &str| {
            let value: Option<f64> = text.trim().parse().ok();
            value.filter(|v| v.is_finite()).ok_or_else(expected)
        };
        let (value, ends) = match range.split_once(':') {
            Some((low, high)) => (f64::NAN, [number(low)?, number(high)?]),
            None => {
                let size = number(range)?;
                (size, [-size, size])
            }
        };
        if ends[0] >= ends[1] {
            return Err("this range is empty; the lower end comes first, and a size is above 0".to_owned());
        }
        Ok(Self {
            name: name.trim().to_owned(),
            value,
            ends,
        })
    }
}

/// The model file's limits, with the given ones added or in their place.
///
/// Fails when a name is unknown, or a range is not possible for its quantity.
pub fn merged_limits(model: &Model, given: &[TrajectoryLimit]) -> Outcome<MotionLimits> {
    let mechanism = &model.derivation.mechanism;
    let mut limits = mechanism.limits.clone();
    // A name may be a singularity, a point with an axis, a drive, or a coordinate with its
    // derivatives.
    for limit in given {
        let name = limit.name.as_str();
        if name == "singularity" {
            if !(limit.value > 0.0 && limit.value < 1.0) {
                return Err(Error::options(message!(
                    "{}: expected a share of the nominal pose's value between 0 and 1, such as 0.3",
                    Remedy::option(OptionName::Limits).with_value(name)
                )));
            }
            limits.singularity = Some(limit.value);
        } else if let Some((point, axis)) = name.rsplit_once('.')
            && let Some(axis) = AXES.iter().position(|a| *a == axis)
            && let Some(i) = mechanism.points.iter().position(|p| p.name == point)
        {
            // An axis of a point that has limits on other axes keeps these.
            let known = limits.points.iter_mut().find(|(p, _)| p.0 == i);
            match known {
                Some((_, ranges)) => ranges[axis] = Some(limit.ends),
                None => {
                    let mut ranges = [None; 3];
                    ranges[axis] = Some(limit.ends);
                    limits.points.push((PointIdx(i), ranges));
                }
            }
        } else if let Some(i) = mechanism.drives.iter().position(|d| d.name == name) {
            limits.forces.retain(|(d, _)| d.0 != i);
            limits.forces.push((DriveIdx(i), limit.ends));
        } else {
            set_coordinate_limit(model, &mut limits, limit)?;
        }
    }
    Ok(limits)
}

/// Sets a limit of a coordinate, of its rate (`_d`) or of its acceleration (`_dd`).
///
/// Fails when there is no such coordinate, when a rate of a passive coordinate is limited, or when the range of
/// a rate excludes 0.
fn set_coordinate_limit(model: &Model, limits: &mut MotionLimits, limit: &TrajectoryLimit) -> Outcome {
    let coordinates = &model.derivation.mechanism.coordinates;
    let name = limit.name.as_str();
    // The option is repeated in every message of this limit.
    let this = Remedy::option(OptionName::Limits).with_value(name);
    // The suffix selects position, rate or acceleration.
    let (stem, derivative) = match (name.strip_suffix("_dd"), name.strip_suffix("_d")) {
        (Some(stem), _) => (stem, 2),
        (None, Some(stem)) => (stem, 1),
        _ => (name, 0),
    };
    let Some(i) = coordinates.iter().position(|c| c.name == stem) else {
        return Err(Error::input(message!(
            "{}: {} has no such coordinate, drive or point; expected one of {}, with _d for a rate and _dd \
             for an acceleration, a drive such as {}, a point with .x, .y or .z, or `singularity`",
            this,
            model.path,
            coordinates
                .iter()
                .map(|c| c.name.as_str())
                .collect::<Vec<_>>()
                .join(", "),
            model.row_names().join(", ")
        )));
    };
    // Rates of passive coordinates follow from the active ones.
    if coordinates[i].passive && derivative > 0 {
        return Err(Error::input(message!(
            "{}: `{stem}` is passive, and only its position can be limited; limit the rates of active coordinates",
            this
        )));
    }
    if derivative > 0 && !(limit.ends[0] < 0.0 && limit.ends[1] > 0.0) {
        return Err(Error::input(message!(
            "{}: the range must contain 0, since periodic motion reverses; one number sets both directions",
            this
        )));
    }
    // A coordinate without limits gets an entry.
    let position = limits.coordinates.iter().position(|(c, _)| c.0 == i);
    let k = position.unwrap_or_else(|| {
        limits
            .coordinates
            .push((CoordinateIdx(i), modelmill_spec::CoordinateBounds::default()));
        limits.coordinates.len() - 1
    });
    let one = &mut limits.coordinates[k].1;
    *[&mut one.position, &mut one.rate, &mut one.acceleration][derivative] = Some(limit.ends);
    Ok(())
}

/// Adds recorded ranges to limits: active coordinates without a range of positions get that of the recordings, with
/// their rates and accelerations. What a machine has done it can do again. A note states the ranges.
pub(crate) fn with_recorded_ranges(
    model: &Model,
    mut limits: MotionLimits,
    recordings: &[&PreparedRecording],
) -> (MotionLimits, Option<RecordingNote>) {
    // Ranges are taken over all segments.
    let [recordings, _] = recording::segments(model, recordings, &[]);
    let (active, _) = model.derivation.coordinates();
    let coordinates = &model.derivation.mechanism.coordinates;
    let mut says = Vec::new();
    for (k, i) in active.iter().enumerate() {
        // Limits of the file or of the options have priority.
        let known = limits.coordinates.iter().position(|(c, _)| c.0 == *i);
        let mut one = known.map(|k| limits.coordinates[k].1).unwrap_or_default();
        if one.position.is_some() {
            continue;
        }
        // Range of a derivative over all recordings.
        let range = |order: usize| {
            let runs = recordings.iter().map(|segment| &segment.run);
            let values = runs.flat_map(|run| &[&run.q, &run.qd, &run.qdd][order][k]);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                [low.min(*x), high.max(*x)]
            })
        };
        // A coordinate that never moved stays without limits.
        let [low, high] = range(0);
        if low >= high {
            continue;
        }
        one.position = Some([low, high]);
        // Rates and accelerations get a range that is symmetric about zero.
        let around_zero = |order: usize| {
            let [low, high] = range(order);
            let most = high.max(-low);
            (most > 0.0).then_some([-most, most])
        };
        one.rate = one.rate.or_else(|| around_zero(1));
        one.acceleration = one.acceleration.or_else(|| around_zero(2));
        limits.coordinates.retain(|(c, _)| c.0 != *i);
        limits.coordinates.push((CoordinateIdx(*i), one));
        let ends = [low, high].map(|x| significant(x, 3));
        let unit = if coordinates[*i].motion.is_angle() { "rad" } else { "m" };
        says.push(format!(
            "`{}` from {} to {} {unit}",
            coordinates[*i].name, ends[0], ends[1]
        ));
    }
    // The note shows how to allow more.
    let note = (!says.is_empty()).then(|| {
        RecordingNote::info(message!(
            "{} has no limits for positions. The motion stays within the recorded ranges: {}, and within the largest recorded \
             rates and accelerations. Set wider limits with {} or {}.",
            model.path,
            says.join(", "),
            Remedy::option(OptionName::Limits),
            Remedy::edit("[limits.coordinates]")
        ))
    });
    if let Some(note) = &note {
        model.host().note(note);
    }
    (limits, note)
}

/// Limits of the active coordinates, in their order.
///
/// Fails when one of them has no range of positions.
pub fn active_limits(model: &Model, limits: &MotionLimits) -> Outcome<Vec<ExcitationLimits>> {
    let (active, _) = model.derivation.coordinates();
    let coordinates = &model.derivation.mechanism.coordinates;
    // Rates and accelerations may be unlimited, positions may not.
    let of_one = |i: &usize| {
        let found = limits.coordinates.iter().find(|(c, _)| c.0 == *i);
        let limits = found.map(|(_, limits)| *limits).unwrap_or_default();
        Some(ExcitationLimits {
            name: coordinates[*i].name.clone(),
            position: limits.position?,
            rate: limits.rate,
            acceleration: limits.acceleration,
        })
    };
    let missing: Vec<&str> = active
        .iter()
        .filter(|i| of_one(i).is_none())
        .map(|i| coordinates[*i].name.as_str())
        .collect();
    if let Some(first) = missing.first() {
        return Err(Error::input(message!(
            "{}: the positions of {} have no limits, and excitation would grow without bound; add \
             `[limits.coordinates]` with `{first} = {{ position = [low, high], rate = ..., acceleration = ... }}` to the \
             model file, or give {}",
            model.path,
            missing.join(", "),
            Remedy::option(OptionName::Limits).with_value(format!("{first}=LOW:HIGH"))
        )));
    }
    Ok(active.iter().filter_map(of_one).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_read_and_nonsense_is_refused() {
        let ends = |text: &str| TrajectoryLimit::parse(text).unwrap().ends.to_vec();
        assert_eq!(ends("q=1:2"), [1.0, 2.0]);
        assert_eq!(ends("q_d = 3"), [-3.0, 3.0]);
        for text in ["q", "q=", "q=2:1", "q=-1", "q=1:x", "q=nan", "q=1:inf"] {
            assert!(TrajectoryLimit::parse(text).is_err(), "{text}");
        }
    }
}
