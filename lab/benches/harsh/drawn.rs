//! Cases drawn from a seed: the forty kinds of `spidermill-harsh` with other sizes, sides, motions and noise.
//!
//! Hidden effects and faults of the recordings come out, with the `truth.json` by which an answer is judged.

use modelmill_rig::RigEffect;
use serde_json::{Value, json};

use modelmill_lab::course::{CourseRepeats, DrawnCourse};
use modelmill_lab::plant::{DRIVES, PlantMotion, SpidermillPlant};
use modelmill_lab::random::{CaseRandom, three_digits};
use modelmill_lab::span::{ColumnSpan, rms};

use super::laws::Law;
use super::sensors::Fault;

/// Samples per second of the motions on which sizes are computed, Hz.
const COARSE: f64 = 50.0;
/// Range of the rms residual of a law in the force of its drive, when the base parameters are fitted, N.
const LAW_SHOWS: [f64; 2] = [5.0, 16.0];
/// Least such residual of hidden effects, N.
const EFFECT_SHOWS: f64 = 1.5;
/// Draws before a case fails.
const ATTEMPTS: u64 = 60;

/// Names of the kinds of cases, as in the folder.
const KINDS: [&str; 40] = [
    "clean",
    "backlash",
    "contact-check",
    "delay-medium",
    "delay-one-drive",
    "delay-small",
    "eccentric-joint",
    "eccentric-screw",
    "friction-fades",
    "hum",
    "hysteresis",
    "jitter-stamped",
    "jitter-unstamped",
    "lag",
    "noise-fast",
    "noise-medium",
    "noise-slow",
    "offset-drift",
    "other-day",
    "outliers",
    "payload-check",
    "quantised-coarse",
    "scale-one-drive",
    "coulomb-sides+outliers",
    "inertia+eccentric-joint",
    "point-mass+friction-fades",
    "rods+hum",
    "rods+offset-drift",
    "spring+noise-medium",
    "cross-friction",
    "load-and-viscous",
    "shared-and-single",
    "six-friction",
    "spring-and-offset",
    "drag-screw",
    "end-stop",
    "fading-friction",
    "power-even",
    "product",
    "sine-rate",
];

/// An effect with its place and values.
pub(crate) struct Hidden {
    kind: &'static str,
    at: String,
    values: Vec<(&'static str, f64)>,
}

/// A drawn pair of recordings.
pub(crate) struct Drawn {
    pub(crate) number: u64,
    /// Viscous and Coulomb friction of each drive that the model has, SI units; `None` for the model without friction.
    pub(crate) known: Option<[[f64; 2]; 2]>,
    pub(crate) hidden: Vec<Hidden>,
    pub(crate) law: Option<Law>,
    pub(crate) fault: Fault,
    /// Periods of each recording.
    pub(crate) periods: u32,
    /// Motions of the fit and of the validation run.
    pub(crate) courses: [DrawnCourse; 2],
    /// Rms residual of law and effects when the model is fitted, N per drive.
    pub(crate) shows: Vec<f64>,
}

impl Hidden {
    fn new(kind: &'static str, at: &str, values: &[(&'static str, f64)]) -> Self {
        let values = values.iter();
        Self {
            kind,
            at: at.to_owned(),
            values: values.map(|(s, x)| (*s, three_digits(*x))).collect(),
        }
    }

    /// Whether it is a property of the sensor: a delay, which is not a force of the rig.
    fn is_of_recording(&self) -> bool {
        self.kind == "time_delay"
    }

    fn effect(&self, plant: &SpidermillPlant) -> Result<RigEffect, String> {
        effect(plant, self.kind, &self.at, &self.values)
    }
}

fn effect(plant: &SpidermillPlant, kind: &str, at: &str, values: &[(&str, f64)]) -> Result<RigEffect, String> {
    let made = plant.rig.effect(kind, &[at], values);
    made.map_err(|faults| faults.iter().map(ToString::to_string).collect())
}

/// Draws viscous and Coulomb friction of a drive that the model has.
fn draw_friction(random: &mut CaseRandom) -> [f64; 2] {
    [random.log_between(80.0, 250.0), random.log_between(12.0, 40.0)]
}

/// The kind of a case; successive numbers go through all kinds.
fn kind(number: u64) -> &'static str {
    KINDS[usize::try_from((number - 1) % KINDS.len() as u64).unwrap_or(0)]
}

/// The name of the folder of a case.
pub(crate) fn name(number: u64) -> String {
    format!("{number:03}-{}", kind(number))
}

impl Drawn {
    /// Draws a case; the same seed and number give the same case.
    pub(crate) fn draw(plant: &SpidermillPlant, seed: u64, number: u64) -> Result<Self, String> {
        for attempt in 0..ATTEMPTS {
            let mut random = CaseRandom::new(seed, number, 1000 + attempt);
            let mut case = Self::of(kind(number), number, &mut random, plant);
            case.shows = case.left(plant)?;
            let most = case.shows.iter().copied().fold(0.0, f64::max);
            if let Some(law) = &mut case.law {
                let wanted = random.log_between(LAW_SHOWS[0], LAW_SHOWS[1]);
                if most > 1e-6 {
                    law.size = three_digits(law.size * wanted / most);
                    case.shows = case.left(plant)?;
                    return Ok(case);
                }
            } else if case.hidden.iter().all(Hidden::is_of_recording) || most > EFFECT_SHOWS {
                return Ok(case);
            }
        }
        Err(format!("case {number}: no visible effect was found; try another seed"))
    }

    /// A case of a kind, before a law is scaled.
    fn of(kind: &'static str, number: u64, random: &mut CaseRandom, plant: &SpidermillPlant) -> Self {
        let side = random.below(2);
        let [here, there] = [DRIVES[side], DRIVES[1 - side]];
        let (main, besides) = kind.split_once('+').unwrap_or(("", kind));
        let fault = Fault::draw(besides, side, random);
        let viscous = |random: &mut CaseRandom| random.log_between(80.0, 250.0);
        let coulomb = |random: &mut CaseRandom| random.log_between(12.0, 45.0);
        let v = |at, x| Hidden::new("viscous_friction", at, &[("Fv", x)]);
        let c = |at, x| Hidden::new("coulomb_friction", at, &[("Fc", x)]);
        let spring = |at, random: &mut CaseRandom| {
            let rest = random.uniform_between(0.5, 0.95);
            let k = random.log_between(150.0, 500.0);
            Hidden::new("spring", at, &[("k", k), ("rest", rest)])
        };
        let law = Law::draw(besides, side, random);
        let hidden = match if main.is_empty() { kind } else { main } {
            "coulomb-sides" => vec![c(here, coulomb(random)), c(there, coulomb(random))],
            "inertia" => {
                let size = random.log_between(8.0, 25.0);
                vec![Hidden::new("drive_inertia", here, &[("Ia", size)])]
            }
            "point-mass" => {
                let point = ["R2m", "R4m"][random.below(2)];
                let mass = random.uniform_between(1.5, 5.0);
                vec![Hidden::new("point_mass", point, &[("m", mass)])]
            }
            "rods" => DRIVES
                .map(|at| {
                    let mass = random.uniform_between(6.0, 15.0);
                    let length = random.uniform_between(0.7, 1.1);
                    let inertia = mass * length * length / 12.0;
                    let values = [("m", mass), ("c", 0.5 * length), ("I", inertia)];
                    Hidden::new("rod_inertia", at, &values)
                })
                .into(),
            "spring" => vec![spring(here, random)],
            "cross-friction" => vec![c(here, coulomb(random)), v(there, viscous(random))],
            "load-and-viscous" => {
                let mu = random.log_between(0.03, 0.12);
                let load = Hidden::new("load_friction", here, &[("mu", mu)]);
                vec![load, v(here, viscous(random))]
            }
            "shared-and-single" => {
                let shared = viscous(random);
                vec![v(here, shared), v(there, shared), c(here, coulomb(random))]
            }
            "six-friction" => {
                let mut all = Vec::new();
                for at in DRIVES {
                    all.extend([c(at, coulomb(random)), v(at, viscous(random))]);
                    let size = random.uniform_between(20.0, 50.0);
                    let values = [("Fs", size), ("vs", random.uniform_between(0.015, 0.04))];
                    all.push(Hidden::new("stribeck_friction", at, &values));
                }
                all
            }
            "spring-and-offset" => {
                let offset = random.sign() * random.uniform_between(10.0, 30.0);
                let offset = Hidden::new("force_offset", there, &[("F0", offset)]);
                vec![spring(here, random), offset]
            }
            "drag-screw" => {
                let size = random.log_between(150.0, 500.0);
                vec![Hidden::new("quadratic_friction", here, &[("Fq", size)])]
            }
            _ => match fault {
                Fault::Late { drive: None, by } => {
                    vec![Hidden::new("time_delay", "force", &[("T", by)])]
                }
                _ => Vec::new(),
            },
        };
        let plain = [
            "cross-friction",
            "load-and-viscous",
            "shared-and-single",
            "six-friction",
            "spring-and-offset",
            "drag-screw",
            "coulomb-sides+outliers",
        ];
        let is_known = !plain.contains(&kind) && law.as_ref().is_none_or(Law::has_known_friction);
        let known = is_known.then(|| [(); 2].map(|()| draw_friction(random)));
        let courses = [(); 2].map(|()| DrawnCourse::draw(random, plant.limits(), CourseRepeats::Once));
        Self {
            number,
            known,
            hidden,
            law,
            fault,
            periods: if random.chance(0.2) { 3 } else { 1 },
            courses,
            shows: Vec::new(),
        }
    }

    /// Effects of the rig: the hidden ones, and the friction of the model multiplied by a factor.
    pub(crate) fn effects(&self, plant: &SpidermillPlant, friction: f64) -> Result<Vec<RigEffect>, String> {
        let there = self.hidden.iter().filter(|one| !one.is_of_recording());
        let mut effects = there.map(|one| one.effect(plant)).collect::<Result<Vec<_>, _>>()?;
        if friction > 0.0 {
            effects.extend(self.friction(plant, friction)?);
        }
        Ok(effects)
    }

    /// The friction that the model has, multiplied by a factor.
    pub(crate) fn friction(&self, plant: &SpidermillPlant, factor: f64) -> Result<Vec<RigEffect>, String> {
        let mut effects = Vec::new();
        for (at, [viscous, coulomb]) in DRIVES.iter().zip(self.known.unwrap_or_default()) {
            let one = |kind, symbol, x| effect(plant, kind, at, &[(symbol, factor * x)]);
            effects.push(one("viscous_friction", "Fv", viscous)?);
            effects.push(one("coulomb_friction", "Fc", coulomb)?);
        }
        Ok(effects)
    }

    /// Rms residual of effects and law on the fit when the model is fitted, N per drive.
    fn left(&self, plant: &SpidermillPlant) -> Result<Vec<f64>, String> {
        let course = &self.courses[0];
        let along = PlantMotion::new(&plant.rig, course, course.times(COARSE))?;
        let mut columns = along.base(&plant.derivation)?;
        if self.known.is_some() {
            for effect in self.friction(plant, 1.0)? {
                columns.push(along.added(&[effect])?);
            }
        }
        let mut added = along.added(&self.effects(plant, 0.0)?)?;
        if let Some(law) = &self.law {
            for (sum, x) in added.iter_mut().zip(law.added(&along)) {
                *sum += x;
            }
        }
        let rest = ColumnSpan::from_columns(columns).rest(&added);
        let of = |d: usize| {
            let own: Vec<f64> = rest.iter().skip(d).step_by(DRIVES.len()).copied().collect();
            rms(&own)
        };
        Ok((0..DRIVES.len()).map(of).collect())
    }

    /// The content of `truth.json`; `floors` are the noise floors of fit and validation run.
    pub(crate) fn truth(&self, seed: u64, floors: [f64; 2]) -> Value {
        let effects: Vec<Value> = self
            .hidden
            .iter()
            .map(|one| {
                let (symbol, value) = one.values[0];
                json!({ "kind": one.kind, "at": one.at, "symbol": symbol, "value": value })
            })
            .collect();
        let says = [
            effects
                .iter()
                .map(ToString::to_string)
                .collect::<Vec<String>>()
                .join(", "),
            self.fault.says(),
            self.law.as_ref().map_or_else(String::new, Law::says),
        ];
        let has_effects = !self.hidden.is_empty();
        let (right, honest) = match (&self.law, has_effects) {
            (Some(_), _) => (vec!["unexplained"], vec![]),
            (None, true) if self.fault.must_be_named() => {
                let honest = if self.fault.is_of_positions() {
                    vec!["missing_effect"]
                } else {
                    vec![]
                };
                (vec!["unexplained", "missing_effect"], honest)
            }
            (None, true) => (vec!["missing_effect"], vec!["unexplained"]),
            (None, false) if self.fault.must_be_named() => {
                let honest = if self.fault.is_of_positions() {
                    vec!["adequate"]
                } else {
                    vec![]
                };
                (vec!["unexplained", "adequate"], honest)
            }
            (None, false) => (vec!["adequate"], vec![]),
        };
        let places = self.law.as_ref().map(|law| vec![DRIVES[law.at]]);
        let both = |all: Vec<[String; 2]>| json!(all);
        let of_law = self.law.as_ref();
        json!({
            "answer": says.join("; "),
            "effects": effects,
            "law": places.map(|at| json!({ "at": at })),
            "must_be_named": self.fault.must_be_named(),
            "named_by": of_law.map_or_else(|| self.fault.named_by(), Law::named_by),
            "also_named_as": both(of_law.map_or_else(|| self.fault.also(), Law::also)),
            "tolerated": both(of_law.map_or_else(|| self.fault.tolerated(), Law::tolerated)),
            "verdict": { "right": right, "honest": honest },
            "model": if self.known.is_some() { "spidermill-friction" } else { "spidermill" },
            "runs": { "fit": { "periods": self.periods, "floor": { "relative": floors[0] } },
                      "check": { "periods": self.periods, "floor": { "relative": floors[1] } } },
            "signal": self.shows,
            "seed": seed,
        })
    }
}
