//! What a change is in physics.
//!
//! Decision: where a drive carries nothing but its friction, more friction and a larger force scale are the same.
//! Friction changes every day and sensors hardly ever, so friction is named first and the scale as its alternative.

use modelmill_identify::changes::{Candidate, Change, Values};
use modelmill_spec::{DriveKind, Place};
use nalgebra::DVector;

use crate::audit::events::Event;
use crate::model::Model;
use crate::runs::layout::Layout;
use crate::runs::payload::{Payloads, TEN};
use crate::text::table::{significant, with_deviation};

/// A value with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard deviation.
    pub deviation: f64,
}

impl Estimate {
    fn text(self, unit: &str) -> String {
        let [value, deviation] = with_deviation(self.value, self.deviation);
        format!("{value} +- {deviation} {unit}")
            .trim_end()
            .to_owned()
    }

    /// Whether it is known to a third of its size.
    fn is_known(self) -> bool {
        3.0 * self.deviation < self.value.abs()
    }
}

/// What changed.
#[derive(Clone, Debug, PartialEq)]
pub enum What {
    /// Another load on a body.
    Payload {
        /// The frame that carries it.
        frame: String,
        /// What it weighs, kg; `None` where the motion does not tell.
        mass: Option<Estimate>,
        /// Its centre in the frame, m; `None` for directions that the motion does not tell.
        centre: [Option<Estimate>; 3],
    },
    /// Other friction of a drive.
    Friction {
        /// The drive.
        drive: String,
        /// Dry friction, N or N m.
        dry: Estimate,
        /// Viscous friction, N or N m per m/s or rad/s.
        viscous: Estimate,
        /// Both as parts of what the first run has, where the model has such friction.
        parts: [Option<f64>; 2],
    },
    /// Another constant force of a drive, N or N m.
    Offset {
        /// The drive.
        drive: String,
        /// The force.
        force: Estimate,
    },
    /// Another scale of a drive's measured force.
    Scale {
        /// The drive.
        drive: String,
        /// The factor; 1 where nothing changed.
        factor: Estimate,
    },
    /// Another clock.
    Clock {
        /// How many times as fast as its time stamps say the run was; 1 where nothing changed.
        factor: Estimate,
    },
    /// A contact or a push within the run.
    ContactEvent {
        /// The drives on which it shows, each with the largest force that nothing explains, N or N m.
        drives: Vec<(String, f64)>,
        /// When it begins and ends, s.
        interval: [f64; 2],
    },
    /// Another zero of an encoder.
    EncoderZero {
        /// The coordinate.
        coordinate: String,
        /// By how much the true position lies above the recorded one, rad or m.
        shift: Estimate,
    },
}

/// A value with its name and unit.
pub type Named = (&'static str, Estimate, &'static str);

impl What {
    /// What scripts call it, where it is, and its values with their names and units; `unit` is that of the force or coordinate.
    pub fn parts(&self, unit: &'static str) -> (&'static str, Vec<&str>, Vec<Named>) {
        let (kind, at, estimates) = match self {
            Self::ContactEvent { drives, interval } => {
                let names = drives.iter().map(|(name, _)| name.as_str()).collect();
                // An event is told by its samples, which lie a step apart.
                let [from, to] = interval.map(|value| Estimate {
                    value,
                    deviation: 0.0,
                });
                let times = vec![("from", from, "s"), ("to", to, "s")];
                return ("contact_event", names, times);
            }
            Self::Payload {
                frame,
                mass,
                centre,
            } => {
                let of_mass = mass.iter().map(|mass| ("mass", *mass, "kg"));
                let at = ["x", "y", "z"].into_iter().zip(centre);
                let at = at.filter_map(|(axis, at)| Some((axis, (*at)?, "m")));
                ("payload", frame, of_mass.chain(at).collect())
            }
            Self::Friction {
                drive,
                dry,
                viscous,
                ..
            } => (
                "friction",
                drive,
                vec![("Fc", *dry, unit), ("Fv", *viscous, per_rate(unit))],
            ),
            Self::Offset { drive, force } => ("offset", drive, vec![("F0", *force, unit)]),
            Self::Scale { drive, factor } => ("drive_gain", drive, vec![("gain", *factor, "1")]),
            Self::Clock { factor } => {
                return ("time_base", vec!["t"], vec![("factor", *factor, "1")]);
            }
            Self::EncoderZero { coordinate, shift } => {
                ("encoder_zero", coordinate, vec![("shift", *shift, unit)])
            }
        };
        (kind, vec![at.as_str()], estimates)
    }
}

/// A change of a run against the first one.
#[derive(Clone, Debug, PartialEq)]
pub struct Changed {
    /// What it is.
    pub what: What,
    /// By how much the sum of squares of the white residual would rise without it; 0 for events, which are looked for by
    /// themselves.
    pub gain: f64,
    /// Unit of its values where it is that of a drive or a coordinate.
    pub unit: &'static str,
    /// Changes that explain nearly as much in its place, in words.
    pub rivals: Vec<String>,
    /// The change in words.
    pub says: String,
}

/// Kinds of change, each with the drive or frame that it belongs to.
#[derive(Clone, Debug)]
pub(crate) enum Kind {
    Payload(String),
    Friction(usize),
    Offset(usize),
    Scale(usize),
    Clock,
    EncoderZero(usize),
}

/// A change that is possible.
#[derive(Clone, Debug)]
pub(crate) struct Possible {
    pub(crate) kind: Kind,
    /// What the search knows of it.
    pub(crate) candidate: Candidate,
}

/// What a drive's other scale is charged beside its value: friction changes every day, sensors, torque constants and gears
/// hardly ever. It decides where both explain the same, as at a drive that carries nothing but its own friction.
const RARE: f64 = 0.2;

/// All changes that are possible.
pub(crate) fn possible(model: &Model, payloads: &Payloads, layout: Layout) -> Vec<Possible> {
    let possible = |kind: Kind, columns: Vec<usize>| {
        let (most, rarity) = match kind {
            // Dry and viscous friction rise and fall together.
            Kind::Friction(_) => (1, 0.0),
            Kind::Scale(_) => (1, RARE),
            _ => (columns.len(), 0.0),
        };
        Possible {
            kind,
            candidate: Candidate {
                columns,
                most,
                rarity,
            },
        }
    };
    let mut all = Vec::new();
    for (f, frame) in payloads.frames.iter().enumerate() {
        let at = layout.payload(f);
        all.push(possible(
            Kind::Payload(frame.clone()),
            (at..at + TEN).collect(),
        ));
    }
    for drive in 0..model.drives().len() {
        let friction = layout.friction(drive);
        for (kind, columns) in [
            (Kind::Friction(drive), vec![friction, friction + 1]),
            (Kind::Offset(drive), vec![layout.offset(drive)]),
            (Kind::Scale(drive), vec![layout.scale(drive)]),
        ] {
            all.push(possible(kind, columns));
        }
    }
    all.push(possible(Kind::Clock, vec![layout.clock()]));
    let zeros =
        (0..layout.coordinates).map(|i| possible(Kind::EncoderZero(i), vec![layout.zero(i)]));
    all.extend(zeros);
    all
}

/// A change that was found, with what it is; `values` are the base parameters of the first run that are no known numbers.
pub(crate) fn told(
    model: &Model,
    possible: &[Possible],
    found: &Change,
    values: &DVector<f64>,
) -> Changed {
    let what = what(model, &possible[found.which].kind, found, values);
    Changed {
        says: says(model, &what),
        unit: unit(model, &possible[found.which].kind),
        what,
        gain: found.gain,
        rivals: found
            .rivals
            .iter()
            .map(|k| name(model, &possible[*k].kind))
            .collect(),
    }
}

/// A contact or a push within a run.
pub(crate) fn event(model: &Model, event: &Event) -> Changed {
    let names = model.drives();
    let drives = event.drives.iter();
    let what = What::ContactEvent {
        drives: drives
            .map(|(d, largest, _)| (names[*d].clone(), *largest))
            .collect(),
        interval: [event.from, event.to],
    };
    Changed {
        says: says(model, &what),
        unit: "s",
        what,
        gain: 0.0,
        rivals: Vec::new(),
    }
}

fn what(model: &Model, kind: &Kind, found: &Change, values: &DVector<f64>) -> What {
    let estimate = |i: usize| Estimate {
        value: found.values[i],
        deviation: found.covariance[(i, i)].max(0.0).sqrt(),
    };
    let drive = |d: &usize| model.drives()[*d].clone();
    match kind {
        Kind::Payload(frame) => {
            let mass = found.determined[0]
                .then(|| estimate(0))
                .filter(|m| m.is_known());
            What::Payload {
                frame: frame.clone(),
                mass,
                centre: centre(&Values {
                    values: found.values.clone(),
                    covariance: found.covariance.clone(),
                    determined: found.determined.clone(),
                }),
            }
        }
        Kind::Friction(d) => {
            let before = friction(model, *d).map(|k| k.map(|k| values[k]));
            let part = |i: usize| before[i].filter(|f| *f != 0.0).map(|f| found.values[i] / f);
            What::Friction {
                drive: drive(d),
                dry: estimate(0),
                viscous: estimate(1),
                parts: [part(0), part(1)],
            }
        }
        Kind::Offset(d) => What::Offset {
            drive: drive(d),
            force: estimate(0),
        },
        Kind::Scale(d) => What::Scale {
            drive: drive(d),
            factor: one_more(estimate(0)),
        },
        Kind::Clock => What::Clock {
            factor: one_more(estimate(0)),
        },
        Kind::EncoderZero(i) => What::EncoderZero {
            coordinate: model.active()[*i].clone(),
            shift: estimate(0),
        },
    }
}

/// The unit of a force of a drive, or of a coordinate.
fn unit(model: &Model, kind: &Kind) -> &'static str {
    match kind {
        Kind::Friction(d) | Kind::Offset(d) | Kind::Scale(d) => model.force_unit(*d),
        Kind::EncoderZero(i) if model.motions()[*i].1 => "rad",
        Kind::EncoderZero(_) | Kind::Payload(_) => "m",
        Kind::Clock => "1",
    }
}

/// The unit of viscous friction of a drive whose force has the unit.
pub(crate) fn per_rate(unit: &str) -> &'static str {
    if unit == "N" { "N s/m" } else { "N m s/rad" }
}

fn one_more(part: Estimate) -> Estimate {
    Estimate {
        value: 1.0 + part.value,
        ..part
    }
}

/// Columns of a drive's dry and viscous friction, where they are base parameters of their own.
pub(crate) fn friction(model: &Model, drive: usize) -> [Option<usize>; 2] {
    ["coulomb_friction", "viscous_friction"].map(|kind| column_of(model, drive, kind))
}

/// The column of a drive's constant force, where it is a base parameter of its own.
pub(crate) fn offset(model: &Model, drive: usize) -> Option<usize> {
    column_of(model, drive, "force_offset")
}

/// The column of a kind of effect with one parameter on a drive.
fn column_of(model: &Model, drive: usize, kind: &str) -> Option<usize> {
    let mechanism = &model.derivation.mechanism;
    let is_here = |place: &Place| match (place, mechanism.drives[drive].kind) {
        (Place::Drive(d), _) => d.0 == drive,
        (Place::Coordinate(a), DriveKind::Joint(b)) => *a == b,
        _ => false,
    };
    let mut effects = mechanism.effects.iter();
    let effect = effects.find(|e| e.kind == kind && e.places.iter().all(is_here))?;
    let name = &mechanism.parameters[effect.terms.first()?.parameter.0].name;
    let infos = model.infos();
    let mut unknown = (0..model.base.len()).filter(|k| !model.is_known(*k));
    unknown.position(|k| infos[k].expression == *name)
}

/// The centre of a body whose first four values are mass and first moments: first moment over mass, with the deviations of both
/// and what they share; `None` for directions that are not told.
pub(crate) fn centre(found: &Values) -> [Option<Estimate>; 3] {
    let estimate = |i: usize| Estimate {
        value: found.values[i],
        deviation: found.covariance[(i, i)].max(0.0).sqrt(),
    };
    [1, 2, 3].map(|i| {
        let mass = found.determined[0].then(|| estimate(0));
        let mass = mass.filter(|mass| mass.is_known())?;
        let value = found.values[i] / mass.value;
        let c = |a: usize, b: usize| found.covariance[(a, b)];
        let variance = c(i, i) - 2.0 * value * c(0, i) + value * value * c(0, 0);
        found.determined[i].then(|| Estimate {
            value,
            deviation: variance.max(0.0).sqrt() / mass.value.abs(),
        })
    })
}

/// What a kind of change is called.
pub(crate) fn name(model: &Model, kind: &Kind) -> String {
    let drive = |d: &usize| model.drives()[*d].clone();
    match kind {
        Kind::Payload(frame) => format!("a load on {frame}"),
        Kind::Friction(d) => format!("friction of {}", drive(d)),
        Kind::Offset(d) => format!("a constant force on {}", drive(d)),
        Kind::Scale(d) => format!("the scale of {}", drive(d)),
        Kind::Clock => "the clock".to_owned(),
        Kind::EncoderZero(i) => format!("the zero of {}", model.active()[*i]),
    }
}

fn says(model: &Model, what: &What) -> String {
    let unit = |name: &str| {
        let at = model.drives().iter().position(|drive| drive == name);
        at.map_or("", |d| model.force_unit(d))
    };
    match what {
        What::Payload {
            frame,
            mass,
            centre,
        } => {
            let Some(mass) = mass else {
                return format!(
                    "another load on {frame}; what it weighs is not told by this motion"
                );
            };
            let more = if mass.value > 0.0 { "more" } else { "less" };
            let weighs = Estimate {
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
                known => format!(", its centre at {}", known.join(", ")),
            };
            format!("{} {more} on {frame}{there}", weighs.text("kg"))
        }
        What::Friction {
            drive,
            dry,
            viscous,
            parts,
        } => {
            let part =
                |p: Option<f64>| p.map_or(String::new(), |p| format!(" ({:+.0} %)", 100.0 * p));
            let total: f64 = parts.iter().flatten().sum();
            let why = if total > 0.0 || (parts == &[None, None] && dry.value > 0.0) {
                "colder, worn, or other grease"
            } else {
                "warmer, run in, or other grease"
            };
            format!(
                "friction of {drive}: dry {} {}{}, viscous {} {}{}; {why}",
                signed(*dry),
                unit(drive),
                part(parts[0]),
                signed(*viscous),
                per_rate(unit(drive)),
                part(parts[1]),
            )
        }
        What::Offset { drive, force } => format!(
            "a constant force of {} on {drive}: the zero of its sensor, or weight that this motion does not turn",
            force.text(unit(drive))
        ),
        What::Scale { drive, factor } => format!(
            "measured force of {drive} scaled by {}: its sensor, torque constant or gear",
            factor.text("")
        ),
        What::Clock { factor } => format!(
            "the time base: this run was {} times as fast as its time stamps say",
            factor.text("")
        ),
        What::ContactEvent {
            drives,
            interval: [from, to],
        } => {
            let drives: Vec<String> = drives
                .iter()
                .map(|(name, force)| {
                    format!("{name} by up to {} {}", significant(*force, 3), unit(name))
                })
                .collect();
            format!(
                "a contact or a push from {} to {} s: {}; left out of what follows",
                significant(*from, 5),
                significant(*to, 5),
                drives.join(", ")
            )
        }
        What::EncoderZero { coordinate, shift } => {
            let is_angle = |(name, is): &(String, bool)| name == coordinate && *is;
            let is_angle = model.motions().iter().any(is_angle);
            format!(
                "the zero of {coordinate}: it stands {} from where its encoder says",
                shift.text(if is_angle { "rad" } else { "m" })
            )
        }
    }
}

fn signed(estimate: Estimate) -> String {
    let sign = if estimate.value > 0.0 { "+" } else { "" };
    format!("{sign}{}", estimate.text(""))
}
