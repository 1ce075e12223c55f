//! Physical changes between runs: their kinds, values and texts.
//!
//! Decision: at a drive whose only force is its own friction, more friction and a larger scale of the force are
//! indistinguishable. Friction changes every day and sensors hardly ever, so friction is named first and the scale
//! as its alternative.

use modelmill_identify::changes::{JointValues, PossibleChange, SelectedChange};
use modelmill_spec::{DriveKind, EffectPlace};
use nalgebra::DVector;

use crate::audit::events::ContactEvent;
use crate::model::Model;
use crate::runs::layout::RunColumnLayout;
use crate::runs::payload::{PayloadColumns, TEN};
use crate::runs::thresholds::{KNOWN_VALUE_SIGMAS, SCALE_CHANGE_RARITY};
use crate::text::table::{significant, with_std};

/// An estimated value with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangeEstimate {
    /// The value, in the unit of the quantity.
    pub value: f64,
    /// Its standard deviation, in the same unit.
    pub std: f64,
}

impl ChangeEstimate {
    /// The value with its standard deviation and unit.
    fn text(self, unit: &str) -> String {
        let [value, std] = with_std(self.value, self.std);
        format!("{value} +- {std} {unit}").trim_end().to_owned()
    }

    /// Whether its standard deviation is below a third of its size.
    fn is_known(self) -> bool {
        KNOWN_VALUE_SIGMAS * self.std < self.value.abs()
    }
}

/// A physical change of the machine or of its recording.
#[derive(Clone, Debug, PartialEq)]
pub enum PhysicalChange {
    /// Another load on a body.
    Payload {
        /// The frame that carries the load.
        frame: String,
        /// Mass of the load, kg; `None` if the motion does not determine it.
        mass: Option<ChangeEstimate>,
        /// Centre of the load in the frame, m; `None` for directions that the motion does not determine.
        centre: [Option<ChangeEstimate>; 3],
    },
    /// Changed friction of a drive.
    Friction {
        /// The drive.
        drive: String,
        /// Change of the dry friction, N or N m.
        dry: ChangeEstimate,
        /// Change of the viscous friction, N or N m per m/s or rad/s.
        viscous: ChangeEstimate,
        /// Both relative to the friction in the first run, if the model has such friction.
        parts: [Option<f64>; 2],
    },
    /// A changed constant force of a drive.
    Offset {
        /// The drive.
        drive: String,
        /// Change of the force, N or N m.
        force: ChangeEstimate,
    },
    /// A changed scale of a drive's measured force.
    Scale {
        /// The drive.
        drive: String,
        /// Scale of the measured force in this run, divided by its scale in the first run; 1 without a change.
        factor: ChangeEstimate,
    },
    /// A changed clock of the time stamps.
    Clock {
        /// Ratio of the true speed of the motion to the speed that follows from the time stamps; 1 without a change.
        factor: ChangeEstimate,
    },
    /// A contact or a push within the run.
    ContactEvent {
        /// The drives on which it acts, each with the largest unexplained force, N or N m.
        drives: Vec<(String, f64)>,
        /// Start and end, s.
        interval: [f64; 2],
    },
    /// A changed zero of an encoder.
    EncoderZero {
        /// The coordinate.
        coordinate: String,
        /// True position minus recorded position, rad or m; `diagnose` reports the opposite sign, which is the error of
        /// the recording.
        shift: ChangeEstimate,
    },
}

/// A value with its symbol and unit.
pub type NamedEstimate = (&'static str, ChangeEstimate, &'static str);

impl PhysicalChange {
    /// The change in the form of the JSON: name of its kind, its places, and its values with symbols and units. `unit`
    /// is the unit of the force or coordinate that it changes.
    pub fn parts(&self, unit: &'static str) -> (&'static str, Vec<&str>, Vec<NamedEstimate>) {
        let (kind, at, estimates) = match self {
            Self::ContactEvent { drives, interval } => {
                let names = drives.iter().map(|(name, _)| name.as_str()).collect();
                // The times of an event are those of samples, so that they have no standard deviation.
                let [from, to] = interval.map(|value| ChangeEstimate { value, std: 0.0 });
                let times = vec![("from", from, "s"), ("to", to, "s")];
                return ("contact_event", names, times);
            }
            Self::Payload { frame, mass, centre } => {
                let of_mass = mass.iter().map(|mass| ("mass", *mass, "kg"));
                let at = ["x", "y", "z"].into_iter().zip(centre);
                let at = at.filter_map(|(axis, at)| Some((axis, (*at)?, "m")));
                ("payload", frame, of_mass.chain(at).collect())
            }
            Self::Friction {
                drive, dry, viscous, ..
            } => (
                "friction",
                drive,
                vec![("Fc", *dry, unit), ("Fv", *viscous, viscous_unit(unit))],
            ),
            Self::Offset { drive, force } => ("offset", drive, vec![("F0", *force, unit)]),
            Self::Scale { drive, factor } => ("drive_gain", drive, vec![("gain", *factor, "1")]),
            Self::Clock { factor } => {
                return ("time_base", vec!["t"], vec![("factor", *factor, "1")]);
            }
            Self::EncoderZero { coordinate, shift } => ("encoder_zero", coordinate, vec![("shift", *shift, unit)]),
        };
        (kind, vec![at.as_str()], estimates)
    }
}

/// A change of a run relative to the first run.
#[derive(Clone, Debug, PartialEq)]
pub struct RunChange {
    /// The physical change.
    pub change: PhysicalChange,
    /// Increase of the sum of squared residuals if the change is omitted, relative to the variance of the residual. 0
    /// for events, which are found separately.
    pub gain: f64,
    /// Unit of the force or coordinate that changed, for [`PhysicalChange::parts`]: `m` for a load, `1` for the clock,
    /// `s` for an event.
    pub unit: &'static str,
    /// Names of other changes that explain the difference between the runs nearly as well.
    pub rivals: Vec<String>,
    /// Weight of each drive in the estimate of a load, with the sum 1; empty for other changes.
    pub drive_weights: Vec<f64>,
    /// The change as text.
    pub says: String,
}

/// Kinds of change, each with the frame, drive or coordinate that it belongs to.
#[derive(Clone, Debug)]
pub(crate) enum ChangeKind {
    /// A load on a frame, by its name.
    Payload(String),
    /// Friction of a drive, by its index.
    Friction(usize),
    /// A constant force on a drive, by its index.
    Offset(usize),
    /// The scale of a drive's measured force, by its index.
    Scale(usize),
    /// The clock of the run.
    Clock,
    /// The zero of an encoder, by the index of the active coordinate.
    EncoderZero(usize),
}

/// A hypothesis of the search.
#[derive(Clone, Debug)]
pub(crate) struct ChangeHypothesis {
    /// The kind and its place.
    pub(crate) kind: ChangeKind,
    /// Its columns and its cost in the search.
    pub(crate) candidate: PossibleChange,
}

/// All hypotheses of the search: payloads, then friction, offset and scale of each drive, clock, zeros of encoders.
pub(crate) fn possible_changes(
    model: &Model,
    payloads: &PayloadColumns,
    layout: RunColumnLayout,
) -> Vec<ChangeHypothesis> {
    let possible = |kind: ChangeKind, columns: Vec<usize>| {
        let (most, rarity) = match kind {
            // Dry and viscous friction usually change together, so that they cost as much as one value.
            ChangeKind::Friction(_) => (1, 0.0),
            ChangeKind::Scale(_) => (1, SCALE_CHANGE_RARITY),
            _ => (columns.len(), 0.0),
        };
        ChangeHypothesis {
            kind,
            candidate: PossibleChange {
                columns,
                max_charged_values: most,
                rarity,
            },
        }
    };
    let mut all = Vec::new();
    for (f, frame) in payloads.frames.iter().enumerate() {
        let at = layout.payload(f);
        all.push(possible(ChangeKind::Payload(frame.clone()), (at..at + TEN).collect()));
    }
    for drive in 0..model.row_names().len() {
        let friction = layout.friction(drive);
        for (kind, columns) in [
            (ChangeKind::Friction(drive), vec![friction, friction + 1]),
            (ChangeKind::Offset(drive), vec![layout.offset(drive)]),
            (ChangeKind::Scale(drive), vec![layout.scale(drive)]),
        ] {
            all.push(possible(kind, columns));
        }
    }
    all.push(possible(ChangeKind::Clock, vec![layout.clock()]));
    let zeros = (0..layout.coordinates).map(|i| possible(ChangeKind::EncoderZero(i), vec![layout.zero(i)]));
    all.extend(zeros);
    all
}

/// A change that was found, with its physical meaning; `values` are the unknown base parameters of the first run.
pub(crate) fn identified_change(
    model: &Model,
    possible: &[ChangeHypothesis],
    found: &SelectedChange,
    values: &DVector<f64>,
) -> RunChange {
    let what = physical_change(model, &possible[found.candidate].kind, found, values);
    RunChange {
        says: change_text(model, &what),
        unit: unit(model, &possible[found.candidate].kind),
        change: what,
        gain: found.gain,
        rivals: found.rivals.iter().map(|k| name(model, &possible[*k].kind)).collect(),
        drive_weights: Vec::new(),
    }
}

/// The change of a clock that recorded rates show.
pub(crate) fn clock_change(factor: ChangeEstimate) -> RunChange {
    RunChange {
        says: clock_text(factor),
        change: PhysicalChange::Clock { factor },
        gain: ((factor.value - 1.0) / factor.std).powi(2),
        unit: "1",
        rivals: Vec::new(),
        drive_weights: Vec::new(),
    }
}

/// A changed clock as a clause.
fn clock_text(factor: ChangeEstimate) -> String {
    format!(
        "the time base: this run was {} times as fast as its time stamps state",
        factor.text("")
    )
}

/// The change of a contact or push within a run.
pub(crate) fn event(model: &Model, event: &ContactEvent) -> RunChange {
    let names = model.row_names();
    let drives = event.drives.iter();
    let what = PhysicalChange::ContactEvent {
        drives: drives.map(|(d, largest, _)| (names[*d].clone(), *largest)).collect(),
        interval: [event.from, event.to],
    };
    RunChange {
        says: change_text(model, &what),
        unit: "s",
        change: what,
        gain: 0.0,
        rivals: Vec::new(),
        drive_weights: Vec::new(),
    }
}

/// The physical values of a change that was found.
fn physical_change(model: &Model, kind: &ChangeKind, found: &SelectedChange, values: &DVector<f64>) -> PhysicalChange {
    let estimate = |i: usize| ChangeEstimate {
        value: found.values[i],
        std: found.covariance[(i, i)].max(0.0).sqrt(),
    };
    let drive = |d: &usize| model.row_names()[*d].clone();
    match kind {
        ChangeKind::Payload(frame) => {
            // Mass and centre are given only if the mass is known.
            let mass = found.determined[0].then(|| estimate(0)).filter(|m| m.is_known());
            PhysicalChange::Payload {
                frame: frame.clone(),
                mass,
                centre: centre(&JointValues {
                    values: found.values.clone(),
                    covariance: found.covariance.clone(),
                    determined: found.determined.clone(),
                }),
            }
        }
        ChangeKind::Friction(d) => {
            // Relative changes exist only if the model has friction on this drive.
            let before = friction(model, *d).map(|k| k.map(|k| values[k]));
            let part = |i: usize| before[i].filter(|f| *f != 0.0).map(|f| found.values[i] / f);
            PhysicalChange::Friction {
                drive: drive(d),
                dry: estimate(0),
                viscous: estimate(1),
                parts: [part(0), part(1)],
            }
        }
        ChangeKind::Offset(d) => PhysicalChange::Offset {
            drive: drive(d),
            force: estimate(0),
        },
        ChangeKind::Scale(d) => PhysicalChange::Scale {
            drive: drive(d),
            factor: one_plus(estimate(0)),
        },
        ChangeKind::Clock => PhysicalChange::Clock {
            factor: one_plus(estimate(0)),
        },
        ChangeKind::EncoderZero(i) => PhysicalChange::EncoderZero {
            coordinate: model.active_coordinates()[*i].clone(),
            shift: estimate(0),
        },
    }
}

/// The unit of the values of a change: of a force, a coordinate, or none.
fn unit(model: &Model, kind: &ChangeKind) -> &'static str {
    match kind {
        ChangeKind::Friction(d) | ChangeKind::Offset(d) | ChangeKind::Scale(d) => model.force_unit(*d),
        ChangeKind::EncoderZero(i) if model.active_coordinate_types()[*i].1 => "rad",
        ChangeKind::EncoderZero(_) | ChangeKind::Payload(_) => "m",
        ChangeKind::Clock => "1",
    }
}

/// The unit of viscous friction of a drive, from the unit of its force.
pub(crate) fn viscous_unit(unit: &str) -> &'static str {
    if unit == "N" { "N s/m" } else { "N m s/rad" }
}

/// A factor from its difference to 1.
fn one_plus(part: ChangeEstimate) -> ChangeEstimate {
    ChangeEstimate {
        value: 1.0 + part.value,
        ..part
    }
}

/// Columns of a drive's dry and viscous friction, if they are separate base parameters.
pub(crate) fn friction(model: &Model, drive: usize) -> [Option<usize>; 2] {
    ["coulomb_friction", "viscous_friction"].map(|kind| column_of(model, drive, kind))
}

/// The column of a drive's constant force, if it is a separate base parameter.
pub(crate) fn offset(model: &Model, drive: usize) -> Option<usize> {
    column_of(model, drive, "force_offset")
}

/// The column of an effect kind with one parameter on a drive, counted among the unknown base parameters.
fn column_of(model: &Model, drive: usize, kind: &str) -> Option<usize> {
    let mechanism = &model.derivation.mechanism;
    // The place is the drive, or the joint on which it acts.
    let is_here = |place: &EffectPlace| match (place, mechanism.drives[drive].kind) {
        (EffectPlace::Drive(d), _) => d.0 == drive,
        (EffectPlace::Coordinate(a), DriveKind::Joint(b)) => *a == b,
        _ => false,
    };
    let mut effects = mechanism.effects.iter();
    let effect = effects.find(|e| e.kind == kind && e.places.iter().all(is_here))?;
    let name = &mechanism.parameters[effect.terms.first()?.parameter.0].name;
    let infos = model.parameter_infos();
    let mut unknown = (0..model.base.len()).filter(|k| !model.is_known(*k));
    unknown.position(|k| infos[k].expression == *name)
}

/// The centre of a body whose first four values are mass and first moments, m: first moment over mass, with the
/// standard deviation from both and their covariance. `None` for directions that are not determined.
pub(crate) fn centre(found: &JointValues) -> [Option<ChangeEstimate>; 3] {
    let estimate = |i: usize| ChangeEstimate {
        value: found.values[i],
        std: found.covariance[(i, i)].max(0.0).sqrt(),
    };
    [1, 2, 3].map(|i| {
        let mass = found.determined[0].then(|| estimate(0));
        let mass = mass.filter(|mass| mass.is_known())?;
        let value = found.values[i] / mass.value;
        // Variance of a quotient to first order.
        let c = |a: usize, b: usize| found.covariance[(a, b)];
        let variance = c(i, i) - 2.0 * value * c(0, i) + value * value * c(0, 0);
        found.determined[i].then(|| ChangeEstimate {
            value,
            std: variance.max(0.0).sqrt() / mass.value.abs(),
        })
    })
}

/// The name of a kind of change, as a noun phrase.
pub(crate) fn name(model: &Model, kind: &ChangeKind) -> String {
    let drive = |d: &usize| model.row_names()[*d].clone();
    match kind {
        ChangeKind::Payload(frame) => format!("a load on {frame}"),
        ChangeKind::Friction(d) => format!("friction of {}", drive(d)),
        ChangeKind::Offset(d) => format!("a constant force on {}", drive(d)),
        ChangeKind::Scale(d) => format!("the scale of {}", drive(d)),
        ChangeKind::Clock => "the clock".to_owned(),
        ChangeKind::EncoderZero(i) => format!("the zero of {}", model.active_coordinates()[*i]),
    }
}

/// The change as a clause, with its values.
pub(crate) fn change_text(model: &Model, what: &PhysicalChange) -> String {
    let unit = |name: &str| {
        let at = model.row_names().iter().position(|drive| drive == name);
        at.map_or("", |d| model.force_unit(d))
    };
    match what {
        PhysicalChange::Payload { frame, mass, centre } => {
            let Some(mass) = mass else {
                return format!("another load on {frame}; this motion does not determine its mass");
            };
            let [differs, moved] = if mass.value > 0.0 {
                ["larger", "added"]
            } else {
                ["smaller", "removed"]
            };
            let weighs = ChangeEstimate {
                value: mass.value.abs(),
                ..*mass
            };
            let known: Vec<String> = ["x", "y", "z"]
                .iter()
                .zip(centre)
                .filter_map(|(axis, at)| Some(format!("{axis} = {}", (*at)?.text("m"))))
                .collect();
            let there = match known.as_slice() {
                [] => String::new(),
                known => format!(", and the centre of the {moved} mass is at {}", known.join(", ")),
            };
            format!("the load on {frame} is {} {differs}{there}", weighs.text("kg"))
        }
        PhysicalChange::Friction {
            drive,
            dry,
            viscous,
            parts,
        } => {
            // Signs decide between the usual causes of more and of less friction.
            let part = |p: Option<f64>| p.map_or(String::new(), |p| format!(" ({:+.0} %)", 100.0 * p));
            let total: f64 = parts.iter().flatten().sum();
            let why = if total > 0.0 || (parts == &[None, None] && dry.value > 0.0) {
                "a colder drive, wear or other grease"
            } else {
                "a warmer drive, running-in or other grease"
            };
            format!(
                "the friction of {drive} differs: dry friction by {} {}{}, viscous friction by {} {}{}. Possible causes: {why}",
                signed_text(*dry),
                unit(drive),
                part(parts[0]),
                signed_text(*viscous),
                viscous_unit(unit(drive)),
                part(parts[1]),
            )
        }
        PhysicalChange::Offset { drive, force } => format!(
            "a constant force of {} on {drive}: the zero of its sensor, or weight whose direction does not change in this motion",
            force.text(unit(drive))
        ),
        PhysicalChange::Scale { drive, factor } => format!(
            "measured force of {drive} scaled by {}: its sensor, torque constant or gear",
            factor.text("")
        ),
        PhysicalChange::Clock { factor } => clock_text(*factor),
        PhysicalChange::ContactEvent {
            drives,
            interval: [from, to],
        } => {
            let drives: Vec<String> = drives
                .iter()
                .map(|(name, force)| format!("{name} by up to {} {}", significant(*force, 3), unit(name)))
                .collect();
            format!(
                "a contact or a push from {} to {} s: {}; excluded from what follows",
                significant(*from, 5),
                significant(*to, 5),
                drives.join(", ")
            )
        }
        PhysicalChange::EncoderZero { coordinate, shift } => {
            let is_angle = |(name, is): &(String, bool)| name == coordinate && *is;
            let is_angle = model.active_coordinate_types().iter().any(is_angle);
            format!(
                "the zero of {coordinate}: the true position is {} from the encoder's",
                shift.text(if is_angle { "rad" } else { "m" })
            )
        }
    }
}

/// A change with its sign.
fn signed_text(estimate: ChangeEstimate) -> String {
    let sign = if estimate.value > 0.0 { "+" } else { "" };
    format!("{sign}{}", estimate.text(""))
}
