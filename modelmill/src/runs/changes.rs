//! What a change is in physics.

use modelmill_identify::changes::Change;
use modelmill_spec::{DriveKind, Place};
use nalgebra::DVector;

use crate::model::Model;
use crate::runs::columns::Layout;
use crate::runs::payload::{Payloads, TEN};
use crate::text::table::number;

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
        format!(
            "{} +- {} {unit}",
            number(self.value),
            number(self.deviation)
        )
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
    /// Another zero of an encoder.
    EncoderZero {
        /// The coordinate.
        coordinate: String,
        /// By how much the true position lies above the recorded one, rad or m.
        shift: Estimate,
    },
}

impl What {
    /// What scripts call it, where it is, and its values with their names and units; `unit` is that of the force or coordinate.
    pub fn parts(
        &self,
        unit: &'static str,
    ) -> (
        &'static str,
        &str,
        Vec<(&'static str, Estimate, &'static str)>,
    ) {
        match self {
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
            Self::Clock { factor } => ("time_base", "t", vec![("factor", *factor, "1")]),
            Self::EncoderZero { coordinate, shift } => {
                ("encoder_zero", coordinate, vec![("shift", *shift, unit)])
            }
        }
    }
}

/// A change of a run against the first one.
#[derive(Clone, Debug, PartialEq)]
pub struct Changed {
    /// What it is.
    pub what: What,
    /// By how much the sum of squares of the white residual would rise without it.
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
enum Kind {
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
    kind: Kind,
    /// Its columns.
    pub(crate) columns: Vec<usize>,
}

/// All changes that are possible.
pub(crate) fn possible(model: &Model, payloads: &Payloads, layout: Layout) -> Vec<Possible> {
    let mut all = Vec::new();
    for (f, frame) in payloads.frames.iter().enumerate() {
        let at = layout.payload(f);
        all.push(Possible {
            kind: Kind::Payload(frame.clone()),
            columns: (at..at + TEN).collect(),
        });
    }
    for drive in 0..model.drives().len() {
        let friction = layout.friction(drive);
        for (kind, columns) in [
            (Kind::Friction(drive), vec![friction, friction + 1]),
            (Kind::Offset(drive), vec![layout.offset(drive)]),
            (Kind::Scale(drive), vec![layout.scale(drive)]),
        ] {
            all.push(Possible { kind, columns });
        }
    }
    all.push(Possible {
        kind: Kind::Clock,
        columns: vec![layout.clock()],
    });
    all.extend((0..layout.coordinates).map(|i| Possible {
        kind: Kind::EncoderZero(i),
        columns: vec![layout.zero(i)],
    }));
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
            // The centre is first moment over mass, with the deviations of both and what they share.
            let centre = |i: usize| {
                let mass = mass?;
                let value = found.values[i] / mass.value;
                let c = |a: usize, b: usize| found.covariance[(a, b)];
                let variance = c(i, i) - 2.0 * value * c(0, i) + value * value * c(0, 0);
                found.determined[i].then(|| Estimate {
                    value,
                    deviation: variance.max(0.0).sqrt() / mass.value.abs(),
                })
            };
            What::Payload {
                frame: frame.clone(),
                mass,
                centre: [1, 2, 3].map(centre),
            }
        }
        Kind::Friction(d) => {
            let before = friction(model, *d, values);
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
fn per_rate(unit: &str) -> &'static str {
    if unit == "N" { "N s/m" } else { "N m s/rad" }
}

fn one_more(part: Estimate) -> Estimate {
    Estimate {
        value: 1.0 + part.value,
        ..part
    }
}

/// Dry and viscous friction of a drive in the first run, where they are base parameters of their own.
fn friction(model: &Model, drive: usize, values: &DVector<f64>) -> [Option<f64>; 2] {
    let mechanism = &model.derivation.mechanism;
    let is_here = |place: &Place| match (place, mechanism.drives[drive].kind) {
        (Place::Drive(d), _) => d.0 == drive,
        (Place::Coordinate(a), DriveKind::Joint(b)) => *a == b,
        _ => false,
    };
    let unknown = (0..model.base.len()).filter(|k| !model.is_known(*k));
    let infos = model.infos();
    ["coulomb_friction", "viscous_friction"].map(|kind| {
        let mut effects = mechanism.effects.iter();
        let effect = effects.find(|e| e.kind == kind && e.places.iter().any(is_here))?;
        let name = &mechanism.parameters[effect.terms.first()?.parameter.0].name;
        let at = unknown.clone().position(|k| infos[k].expression == *name)?;
        Some(values[at])
    })
}

/// What a kind of change is called.
fn name(model: &Model, kind: &Kind) -> String {
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
    format!(
        "{}{} +- {}",
        if estimate.value > 0.0 { "+" } else { "" },
        number(estimate.value),
        number(estimate.deviation)
    )
}
