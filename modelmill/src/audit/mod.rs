//! What a model says of a recording before anything is believed: delays between force and motion, columns that are
//! exchanged or turned round, angles in degrees, gravity that pulls the other way. Everything goes into the notes.

mod delay;
pub(crate) mod events;
mod gravity;
mod nominal_forces;
mod rows;

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, OptionSetting, Remedy};
use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_identify::diagnose::Disturbance;
use modelmill_identify::{ChannelRegressor, ForceAudit, RecordingNote, WiringFault};
use nalgebra::{DMatrix, DVector};

use crate::model::Model;
use crate::stretch::RecordingSegment;
use crate::text::table::percent;
use delay::ForceDelayAudit;

/// Kinds of suspicions: before one is cleared up, whatever else is found may be part of it.
const EXCHANGED: &str = "exchanged_columns";
const WRONG_SIGN: &str = "wrong_sign";
const UNITS: &str = "units";
const GRAVITY: &str = "gravity_direction";
pub(crate) const SUSPICIONS: [&str; 4] = [EXCHANGED, WRONG_SIGN, UNITS, GRAVITY];

/// Samples that are looked at, spread over the recording; fewer of many drives, but at least [`FEWEST_LOOKED_AT`].
const LOOKED_AT: usize = 1500;
const ROWS_LOOKED_AT: usize = 12_000;
const FEWEST_LOOKED_AT: usize = 300;
/// Fewest samples of which anything is said.
const FEWEST: usize = 100;
/// Relative errors below this one raise no suspicion of exchanged columns.
const BEARABLE: f64 = 0.05;
/// Where a mechanism cannot reach the poses as they are, others must explain forces to this relative error.
const CONVINCING: f64 = 0.3;
/// An exchange must lower the error to this part.
const BETTER: f64 = 0.5;
/// Errors that are the same but for this part cannot tell one change from another.
const ALIKE: f64 = 0.05;
/// Errors as small as this one are rounding.
const EXACT: f64 = 1e-6;
/// Rows for each base parameter that a change is judged by at least.
const ROWS_PER_COLUMN: usize = 4;
/// Multiplications that trying all changes of the motion may take, some ten seconds of one core: more than 32 bits hold.
const AFFORDABLE: u64 = 20_000_000_000;

/// Looks at every recording that has forces, and adds what it finds to their notes; the forces of contacts and pushes count no
/// more where `leave_out_events`.
pub fn examine(model: &Model, data: &mut [RecordingSegment], leave_out_events: bool) {
    for one in data {
        for AuditFinding { note, fault } in findings(model, one) {
            one.note(model, note);
            one.faults.extend(fault);
        }
        for note in events::event_notes(model, one, leave_out_events) {
            one.note(model, note);
        }
    }
}

/// What is told of a recording, and the disturbance that the verdict of a diagnosis begins with.
struct AuditFinding {
    note: RecordingNote,
    fault: Option<Disturbance>,
}

impl AuditFinding {
    /// A suspicion of a kind in [`SUSPICIONS`], as a clause and as the whole note.
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

fn findings(model: &Model, data: &RecordingSegment) -> Vec<AuditFinding> {
    let run = &data.run;
    let n = data.samples();
    let Some(forces) = run.force.as_deref().filter(|_| n > FEWEST) else {
        return Vec::new();
    };
    let n_drives = forces.len();
    let wanted = (ROWS_LOOKED_AT / n_drives.max(1)).clamp(FEWEST_LOOKED_AT, LOOKED_AT);
    let samples: Vec<usize> = (0..n).step_by((n / wanted).max(1)).collect();
    // Poses without answer are reported with their place when the whole recording is evaluated.
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
    // Forces that are late by a good part of a period look like those of another drive.
    if error > BEARABLE && with_delay.is_none_or(|left| left > BETTER * error) {
        let drives = model.drives();
        let columns = Remedy::option(OptionName::Columns);
        if let Some((suspect, [before, after])) = as_it_is.find_wiring_fault(&measured)
            && after < BETTER * before
            // Nominal values know which drive it is.
            && (beside.is_empty() || !matches!(suspect, WiringFault::Reversed(_)))
        {
            let (kind, at, says) = match suspect {
                WiringFault::Swapped(a, b) => (
                    EXCHANGED,
                    vec![a, b],
                    format!(
                        "the forces of `{}` and `{}` seem to be exchanged",
                        drives[a], drives[b]
                    ),
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
                "In {} {says}: the best fit of the model is off by {} as the columns are, and by {} then. Check which column is \
                 which ({}).",
                run.file,
                percent(Some(before)),
                percent(Some(after)),
                columns
            );
            let at = at.into_iter().map(|d| drives[d].clone()).collect();
            notes.push(AuditFinding::suspicion(kind, at, says, &run.file, note));
        }
        if notes.is_empty() {
            notes = motion_findings(model, data, &samples);
        }
    }
    // A change of the motion may look like it.
    if notes.is_empty() {
        notes.extend(gravity::reversed_gravity_finding(
            model, data, &samples, &measured,
        ));
    }
    if notes.is_empty() {
        notes = beside;
    }
    if notes.is_empty() {
        let late = late.and_then(|late| late.delay_note(model, &run.file));
        notes.extend(late.map(|note| AuditFinding { note, fault: None }));
    }
    notes
}

/// Signs and units of the forces, held against those that the nominal values give.
fn nominal_force_findings(
    model: &Model,
    data: &RecordingSegment,
    samples: &[usize],
) -> Vec<AuditFinding> {
    let Some(regressor) = regressor(model, data, samples, &|_| {}) else {
        return Vec::new();
    };
    let forces = data.run.force.as_deref().unwrap_or(&[]);
    let nominal = DVector::from_column_slice(&model.nominal);
    let n = forces.len();
    let by_drive = |forces: DVector<f64>| -> Vec<Vec<f64>> {
        let of = |d: usize| forces.iter().skip(d).step_by(n).copied().collect();
        (0..n).map(of).collect()
    };
    let expected = by_drive(regressor * &nominal);
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

/// Positions, rates and accelerations, `[order][coordinate][sample]`.
type MotionColumns = [Vec<Vec<f64>>; 3];
/// What could be done to a recording's motion to make sense of it.
type MotionChange<'a> = dyn Fn(&mut MotionColumns) + 'a;
/// Forces at some samples, those of all drives one after the other.
fn interleave_forces(forces: &[Vec<f64>], samples: &[usize]) -> DVector<f64> {
    let rows = samples
        .iter()
        .flat_map(|k| forces.iter().map(move |force| force[*k]));
    DVector::from_iterator(samples.len() * forces.len(), rows)
}

/// How well the model explains the forces once the motion is changed.
fn force_audit(
    model: &Model,
    data: &RecordingSegment,
    samples: &[usize],
    change: &MotionChange<'_>,
) -> Option<ForceAudit> {
    let regressor = regressor(model, data, samples, change)?;
    ForceAudit::new(ChannelRegressor::new(&regressor, model.drives().len()))
}

/// Coordinates that are exchanged or turned round, or angles in degrees.
fn motion_findings(model: &Model, data: &RecordingSegment, samples: &[usize]) -> Vec<AuditFinding> {
    let Some(forces) = data.run.force.as_deref() else {
        return Vec::new();
    };
    let file = &data.run.file;
    let mut hypotheses = hypotheses(model, &data.maps_from_degrees);
    let thinned = |hypotheses: usize| {
        let rows = (samples.len() * forces.len() * hypotheses) as u64;
        let all = (model.base.len() as u64).pow(2) * rows;
        usize::try_from(all.div_ceil(AFFORDABLE).max(1)).unwrap_or(usize::MAX)
    };
    let fewest = (ROWS_PER_COLUMN * model.base.len()).max(1);
    let most = (samples.len() * forces.len() / fewest).max(1);
    if thinned(hypotheses.len()) > most {
        // Exchanges come last, and are many.
        let turned = hypotheses.iter().rposition(|one| one.kind == WRONG_SIGN);
        hypotheses.truncate(turned.map_or(0, |last| last + 1));
    }
    let thinned = thinned(hypotheses.len()).min(most);
    let samples: Vec<usize> = samples.iter().copied().step_by(thinned).collect();
    let measured = interleave_forces(forces, &samples);
    let now = force_audit(model, data, &samples, &|_| {}).and_then(|audit| audit.error(&measured));
    let limit = now.map_or(CONVINCING, |error| BETTER * error);
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
    let alike = tried
        .iter()
        .filter(|(one, other)| one.kind == WRONG_SIGN && *other <= (1.0 + ALIKE) * error + EXACT);
    let turned: Vec<&str> = alike
        .flat_map(|(one, _)| one.at.iter().map(String::as_str))
        .collect();
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
        Some(now) => format!("is off by {}", percent(Some(now))),
        None => "does not exist, for the mechanism cannot reach such poses".to_owned(),
    };
    let note = message!(
        "In {file} {says}: {}. The best fit of the model {as_it_is} as the columns are, and would be off by {} then.",
        first.advice,
        percent(Some(*error))
    );
    vec![AuditFinding::suspicion(first.kind, at, says, file, note)]
}

/// What may have happened to the columns of a motion.
struct ColumnHypothesis {
    /// One of [`SUSPICIONS`].
    kind: &'static str,
    /// Coordinates that it changes.
    at: Vec<String>,
    /// What happened, as a clause.
    says: String,
    /// What to do about it.
    advice: Message,
    change: Box<MotionChange<'static>>,
}

/// Angles in degrees, coordinates with the wrong sign, and pairs that are exchanged.
fn hypotheses(model: &Model, maps_from_degrees: &[OptionSetting]) -> Vec<ColumnHypothesis> {
    let columns = Remedy::option(OptionName::Columns);
    let motions = model.motions();
    let mut hypotheses = Vec::new();
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
    let angles: Vec<usize> = (0..motions.len()).filter(|i| motions[*i].1).collect();
    if !angles.is_empty() {
        hypotheses.push(ColumnHypothesis {
            kind: UNITS,
            at: angles.iter().map(|i| motions[*i].0.clone()).collect(),
            says: "the angles seem to be in degrees".to_owned(),
            advice: message!(
                "they must be in rad, so say {}",
                Remedy::options(maps_from_degrees.to_vec())
            ),
            change: scaled(angles, 1.0_f64.to_radians()),
        });
    }
    for (a, (name, _)) in motions.iter().enumerate() {
        hypotheses.push(ColumnHypothesis {
            kind: WRONG_SIGN,
            at: vec![name.clone()],
            says: format!("the coordinate `{name}` seems to have the wrong sign"),
            advice: message!("check which way it counts ({})", columns),
            change: scaled(vec![a], -1.0),
        });
    }
    for a in 0..motions.len() {
        for b in a + 1..motions.len() {
            if motions[a].1 == motions[b].1 {
                hypotheses.push(ColumnHypothesis {
                    kind: EXCHANGED,
                    at: [a, b].map(|i| motions[i].0.clone()).to_vec(),
                    says: format!(
                        "the coordinates `{}` and `{}` seem to be exchanged",
                        motions[a].0, motions[b].0
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

/// The regressor at some samples, with the states changed.
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
    let mut states = [&run.q, &run.qd, &run.qdd].map(|columns| pick(columns));
    change(&mut states);
    let load = pick(run.force.as_deref().unwrap_or(&[]));
    let states = MotionStates {
        q: states[0].iter().map(Vec::as_slice).collect(),
        qd: states[1].iter().map(Vec::as_slice).collect(),
        qdd: states[2].iter().map(Vec::as_slice).collect(),
        load: load.iter().map(Vec::as_slice).collect(),
    };
    ModelEvaluator::new(&model.derivation)
        .regressor(&states)
        .ok()
}
