//! Checks of a recording with the model, before any result is computed: delays between force and motion, exchanged
//! columns and wrong signs, angles in degrees, reversed gravity. All findings become notes.

mod delay;
pub(crate) mod events;
mod gravity;
mod nominal_forces;
mod rows;
mod thresholds;

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, OptionSetting, Remedy};
use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::diagnose::Disturbance;
use modelmill_identify::{ChannelRegressor, ForceAudit, RecordingNote, WiringFault};
use nalgebra::{DMatrix, DVector};

use crate::model::Model;
use crate::segment::RecordingSegment;
use crate::text::table::percent;
use delay::ForceDelayAudit;
use thresholds::{
    AUDIT_FEWEST_SAMPLES, CORRECTION_MOST_RATIO, CORRECTION_ROWS_PER_COLUMN, SAME_ERROR_TOLERANCE,
    UNREACHABLE_MOST_ERROR, WIRING_LEAST_ERROR,
};

/// Kinds of suspicions. Until one is resolved, other findings may be a consequence of it.
const EXCHANGED: &str = "exchanged_columns";
const WRONG_SIGN: &str = "wrong_sign";
const UNITS: &str = "units";
const GRAVITY: &str = "gravity_direction";
/// The kinds that are reported before all other findings.
pub(crate) const SUSPICIONS: [&str; 4] = [EXCHANGED, WRONG_SIGN, UNITS, GRAVITY];

/// Largest number of samples, spread over the recording; fewer for many drives, but at least [`FEWEST_LOOKED_AT`].
const LOOKED_AT: usize = 1500;
/// Largest number of rows, over all drives.
const ROWS_LOOKED_AT: usize = 12_000;
/// Smallest number of samples, even for many drives.
const FEWEST_LOOKED_AT: usize = 300;
/// Errors below this one are rounding.
const EXACT: f64 = 1e-6;
/// Largest number of multiplications for all changes of the motion, some ten seconds of one core; exceeds 32 bits.
const AFFORDABLE: u64 = 20_000_000_000;

/// Checks every recording that has forces and adds the findings to its notes. With `leave_out_events`, forces during
/// contacts and pushes are excluded.
pub fn examine(model: &Model, data: &mut [RecordingSegment], leave_out_events: bool) {
    for one in data {
        // Notes go to the listener at once; suspicions are kept for the diagnosis.
        for AuditFinding { note, fault } in findings(model, one) {
            one.note(model, note);
            one.faults.extend(fault);
        }
        for note in events::event_notes(model, one, leave_out_events) {
            one.note(model, note);
        }
    }
}

/// A note on a recording, with the disturbance that a diagnosis reports first, if it is a suspicion.
struct AuditFinding {
    /// For the user.
    note: RecordingNote,
    /// For the diagnosis.
    fault: Option<Disturbance>,
}

impl AuditFinding {
    /// A suspicion of a kind in [`SUSPICIONS`], as a clause and as the complete note.
    fn suspicion(kind: &str, at: Vec<String>, says: String, file: &str, note: Message) -> Self {
        let fault = Disturbance {
            kind: kind.to_owned(),
            at,
            estimates: Vec::new(),
            recordings: vec![file.to_owned()],
            interval: None,
            description: Some(says),
        };
        Self {
            note: RecordingNote::warning(note),
            fault: Some(fault),
        }
    }
}

/// The findings of a recording; only the first kind that is found, since one fault may cause others.
fn findings(model: &Model, data: &RecordingSegment) -> Vec<AuditFinding> {
    let run = &data.run;
    let n = data.samples();
    let Some(forces) = run.force.as_deref().filter(|_| n > AUDIT_FEWEST_SAMPLES) else {
        return Vec::new();
    };
    let n_drives = forces.len();
    // Samples are spread evenly over the recording.
    let wanted = (ROWS_LOOKED_AT / n_drives.max(1)).clamp(FEWEST_LOOKED_AT, LOOKED_AT);
    let samples: Vec<usize> = (0..n).step_by((n / wanted).max(1)).collect();
    // Poses without a solution are reported with their place when the complete recording is evaluated.
    let Some(as_it_is) = force_audit(model, data, &samples, &|_| {}) else {
        return motion_findings(model, data, &samples);
    };
    let measured = interleave_forces(forces, &samples);
    let Some(error) = as_it_is.error(&measured) else {
        return Vec::new();
    };
    let beside = nominal_force_findings(model, data, &samples);
    let late = ForceDelayAudit::from_segment(model, data);
    let with_delay = late.as_ref().and_then(ForceDelayAudit::residual_with_delay);
    let mut notes = Vec::new();
    // Forces delayed by a large part of a period resemble those of another drive.
    if error > WIRING_LEAST_ERROR && with_delay.is_none_or(|left| left > CORRECTION_MOST_RATIO * error) {
        let drives = model.drives();
        let columns = Remedy::option(OptionName::Columns);
        if let Some((suspect, [before, after])) = as_it_is.find_wiring_fault(&measured)
            && after < CORRECTION_MOST_RATIO * before
            // The check with nominal values identifies the drive.
            && (beside.is_empty() || !matches!(suspect, WiringFault::Reversed(_)))
        {
            // Of two drives it cannot be known which of them has the wrong sign.
            let (kind, at, says) = match suspect {
                WiringFault::Swapped(a, b) => (
                    EXCHANGED,
                    vec![a, b],
                    format!("the forces of `{}` and `{}` seem to be exchanged", drives[a], drives[b]),
                ),
                WiringFault::Reversed(_) if drives.len() == 2 => (
                    WRONG_SIGN,
                    vec![0, 1],
                    format!(
                        "one of the forces of `{}` and `{}` seems to have the wrong sign",
                        drives[0], drives[1]
                    ),
                ),
                WiringFault::Reversed(a) => (
                    WRONG_SIGN,
                    vec![a],
                    format!("the force of `{}` seems to have the wrong sign", drives[a]),
                ),
            };
            let note = message!(
                "In {} {says}: the best fit of the model has an error of {} with the columns as they are, and of {} after this \
                 correction. Check which column is which ({}).",
                run.file,
                percent(Some(before)),
                percent(Some(after)),
                columns
            );
            let at = at.into_iter().map(|d| drives[d].clone()).collect();
            notes.push(AuditFinding::suspicion(kind, at, says, &run.file, note));
        }
        // Exchanged or reversed coordinates would explain the forces as well.
        if notes.is_empty() {
            notes = motion_findings(model, data, &samples);
        }
    }
    // Reversed gravity is tested after the motion, whose changes may look like it.
    if notes.is_empty() {
        notes.extend(gravity::reversed_gravity_finding(model, data, &samples, &measured));
    }
    if notes.is_empty() {
        notes = beside;
    }
    // A delay is reported only if nothing else is suspicious.
    if notes.is_empty() {
        let late = late.and_then(|late| late.delay_note(&run.file));
        notes.extend(late.map(|note| AuditFinding { note, fault: None }));
    }
    notes
}

/// Signs and units of the forces, compared with the forces at the nominal values.
fn nominal_force_findings(model: &Model, data: &RecordingSegment, samples: &[usize]) -> Vec<AuditFinding> {
    let Some(regressor) = regressor(model, data, samples, &|_| {}) else {
        return Vec::new();
    };
    let forces = data.run.force.as_deref().unwrap_or(&[]);
    let nominal = DVector::from_column_slice(&model.nominal);
    let n = forces.len();
    // Rows are interleaved by drive.
    let by_drive = |forces: DVector<f64>| -> Vec<Vec<f64>> {
        let of = |d: usize| forces.iter().skip(d).step_by(n).copied().collect();
        (0..n).map(of).collect()
    };
    let expected = by_drive(regressor * &nominal);
    // Forces with reversed gravity may explain a wrong sign.
    let upside_down = rows::regressor_with_reversed_gravity(model, data, samples);
    let upside_down = upside_down.map(|rows| by_drive(rows * &nominal));
    let measured: Vec<Vec<f64>> = forces
        .iter()
        .map(|force| samples.iter().map(|k| force[*k]).collect())
        .collect();
    let mechanism = &model.derivation.mechanism;
    let upside_down = upside_down.as_deref();
    nominal_forces::oddities(mechanism, &measured, &expected, upside_down, &data.run.file)
}

/// Positions, rates and accelerations, `[order][coordinate][sample]`, SI units.
type MotionColumns = [Vec<Vec<f64>>; 3];
/// A change of a recording's motion that may explain the forces better.
type MotionChange<'a> = dyn Fn(&mut MotionColumns) + 'a;
/// Forces at some samples, interleaved by drive.
fn interleave_forces(forces: &[Vec<f64>], samples: &[usize]) -> DVector<f64> {
    let rows = samples.iter().flat_map(|k| forces.iter().map(move |force| force[*k]));
    DVector::from_iterator(samples.len() * forces.len(), rows)
}

/// The fit of the model to the forces after a change of the motion; `None` if a pose has no solution.
fn force_audit(
    model: &Model,
    data: &RecordingSegment,
    samples: &[usize],
    change: &MotionChange<'_>,
) -> Option<ForceAudit> {
    let regressor = regressor(model, data, samples, change)?;
    ForceAudit::new(ChannelRegressor::new(&regressor, model.drives().len()))
}

/// Exchanged coordinates, coordinates with the wrong sign, or angles in degrees.
fn motion_findings(model: &Model, data: &RecordingSegment, samples: &[usize]) -> Vec<AuditFinding> {
    let Some(forces) = data.run.force.as_deref() else {
        return Vec::new();
    };
    let file = &data.run.file;
    let mut hypotheses = hypotheses(model, &data.maps_from_degrees);
    // Samples are thinned, or exchanges are not tested, if all hypotheses would take too long.
    let thinned = |hypotheses: usize| {
        let rows = (samples.len() * forces.len() * hypotheses) as u64;
        let all = (model.base.len() as u64).pow(2) * rows;
        usize::try_from(all.div_ceil(AFFORDABLE).max(1)).unwrap_or(usize::MAX)
    };
    // A change is judged with several rows for each base parameter.
    let fewest = (CORRECTION_ROWS_PER_COLUMN * model.base.len()).max(1);
    let most = (samples.len() * forces.len() / fewest).max(1);
    if thinned(hypotheses.len()) > most {
        // Exchanges are last in the list and most numerous.
        let turned = hypotheses.iter().rposition(|one| one.kind == WRONG_SIGN);
        hypotheses.truncate(turned.map_or(0, |last| last + 1));
    }
    let thinned = thinned(hypotheses.len()).min(most);
    let samples: Vec<usize> = samples.iter().copied().step_by(thinned).collect();
    let measured = interleave_forces(forces, &samples);
    // The error without a change is the reference; it does not exist if poses cannot be reached.
    let now = force_audit(model, data, &samples, &|_| {}).and_then(|audit| audit.error(&measured));
    let limit = now.map_or(UNREACHABLE_MOST_ERROR, |error| CORRECTION_MOST_RATIO * error);
    // Only changes that reduce the error clearly are kept, the best first.
    let mut tried: Vec<(&ColumnHypothesis, f64)> = hypotheses
        .iter()
        .filter_map(|one| {
            let audit = force_audit(model, data, &samples, one.change.as_ref())?;
            Some((one, audit.error(&measured)?))
        })
        .filter(|(_, error)| *error < limit)
        .collect();
    tried.sort_by(|a, b| a.1.total_cmp(&b.1));
    let Some((first, error)) = tried.first() else {
        return Vec::new();
    };
    // Several coordinates may explain the forces equally well by their sign.
    let alike = tried
        .iter()
        .filter(|(one, other)| one.kind == WRONG_SIGN && *other <= (1.0 + SAME_ERROR_TOLERANCE) * error + EXACT);
    let turned: Vec<&str> = alike.flat_map(|(one, _)| one.at.iter().map(String::as_str)).collect();
    // If several signs explain the same, all coordinates are named.
    let (at, says) = if first.kind == WRONG_SIGN && turned.len() > 1 {
        let says = format!(
            "one of the coordinates `{}` seems to have the wrong sign",
            turned.join("`, `")
        );
        (turned.into_iter().map(str::to_owned).collect(), says)
    } else {
        (first.at.clone(), first.says.clone())
    };
    let as_it_is = match now {
        Some(now) => format!("an error of {}", percent(Some(now))),
        None => "no solution, since the mechanism cannot reach such poses".to_owned(),
    };
    let note = message!(
        "In {file} {says}: {}. With the columns as they are, the best fit of the model has {as_it_is}; after this correction its \
         error is {}.",
        first.advice,
        percent(Some(*error))
    );
    vec![AuditFinding::suspicion(first.kind, at, says, file, note)]
}

/// A possible mistake in the columns of a motion.
struct ColumnHypothesis {
    /// One of [`SUSPICIONS`].
    kind: &'static str,
    /// Coordinates that it changes.
    at: Vec<String>,
    /// What happened, as a clause.
    says: String,
    /// What to do about it.
    advice: Message,
    /// What it does to the motion.
    change: Box<MotionChange<'static>>,
}

/// All hypotheses: angles in degrees, coordinates with the wrong sign, and exchanged pairs, in this order.
fn hypotheses(model: &Model, maps_from_degrees: &[OptionSetting]) -> Vec<ColumnHypothesis> {
    let columns = Remedy::option(OptionName::Columns);
    let active = model.active_coordinate_types();
    let mut hypotheses = Vec::new();
    // A factor changes positions and derivatives alike.
    let scaled = |coordinates: Vec<usize>, factor: f64| -> Box<MotionChange<'static>> {
        Box::new(move |states| {
            for order in states.iter_mut() {
                for i in &coordinates {
                    for value in &mut order[*i] {
                        *value *= factor;
                    }
                }
            }
        })
    };
    // All angles together, since a recorder uses one unit.
    let angles: Vec<usize> = (0..active.len()).filter(|i| active[*i].1).collect();
    if !angles.is_empty() {
        hypotheses.push(ColumnHypothesis {
            kind: UNITS,
            at: angles.iter().map(|i| active[*i].0.clone()).collect(),
            says: "the angles seem to be in degrees".to_owned(),
            advice: message!(
                "they must be in rad; use {}",
                Remedy::options(maps_from_degrees.to_vec())
            ),
            change: scaled(angles, 1.0_f64.to_radians()),
        });
    }
    for (a, (name, _)) in active.iter().enumerate() {
        hypotheses.push(ColumnHypothesis {
            kind: WRONG_SIGN,
            at: vec![name.clone()],
            says: format!("the coordinate `{name}` seems to have the wrong sign"),
            advice: message!("check its positive direction ({})", columns),
            change: scaled(vec![a], -1.0),
        });
    }
    // Only coordinates of one kind can be exchanged.
    for a in 0..active.len() {
        for b in a + 1..active.len() {
            if active[a].1 == active[b].1 {
                hypotheses.push(ColumnHypothesis {
                    kind: EXCHANGED,
                    at: [a, b].map(|i| active[i].0.clone()).to_vec(),
                    says: format!(
                        "the coordinates `{}` and `{}` seem to be exchanged",
                        active[a].0, active[b].0
                    ),
                    advice: message!("check which column is which ({})", columns),
                    change: Box::new(move |states| {
                        for order in states.iter_mut() {
                            order.swap(a, b);
                        }
                    }),
                });
            }
        }
    }
    hypotheses
}

/// The regressor at some samples with changed states; `None` if a pose has no solution.
fn regressor(
    model: &Model,
    data: &RecordingSegment,
    samples: &[usize],
    change: &MotionChange<'_>,
) -> Option<DMatrix<f64>> {
    let pick = |columns: &[Vec<f64>]| -> Vec<Vec<f64>> {
        let pick = |column: &Vec<f64>| samples.iter().map(|k| column[*k]).collect();
        columns.iter().map(pick).collect()
    };
    let run = &data.run;
    // The change is applied to the selected samples only.
    let mut states = [&run.q, &run.qd, &run.qdd].map(|columns| pick(columns));
    change(&mut states);
    let load = pick(run.force.as_deref().unwrap_or(&[]));
    let states = MotionStates {
        q: states[0].iter().map(Vec::as_slice).collect(),
        qd: states[1].iter().map(Vec::as_slice).collect(),
        qdd: states[2].iter().map(Vec::as_slice).collect(),
        load: load.iter().map(Vec::as_slice).collect(),
    };
    ModelEvaluator::new(&model.derivation).regressor(&states).ok()
}
