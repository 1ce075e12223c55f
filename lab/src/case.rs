//! Cases: seed and number go in; motion, noise and what is hidden come out, with sizes that show.

use modelmill_rig::{Rig, RigEffect};
use serde_json::{Value, json};

use crate::columns::{columns, delay_column, library};
use crate::course::{CourseRepeats, DrawnCourse};
use crate::hidden::{HiddenChoice, HiddenEffect, choices, largest};
use crate::judge::CaseClass;
use crate::outside::{OutsideForce, OutsideLaw};
use crate::placed::PlacedEffect;
use crate::plant::{PlantMotion, SpidermillPlant};
use crate::random::{CaseRandom, three_digits};
use crate::span::{ColumnSpan, rms};

/// Samples per second at which sizes are worked out and alternatives are compared.
pub const COARSE: f64 = 50.0;
/// Samples per second of the recordings.
pub const RATE: f64 = 250.0;
/// Classes in their order, over and over: half one effect, a fifth two, the rest none and outside.
const PATTERN: [CaseClass; 20] = {
    use CaseClass::{None as N, One as I, Outside as O, Two as T};
    [I, T, I, O, I, N, I, T, I, O, I, N, I, T, I, O, I, N, I, T]
};
/// Errors, of the force, that an effect alone causes in a model without it after identification.
const ERRORS: [f64; 2] = [0.02, 0.30];
/// Least of such errors where a machine of this size cannot have a larger effect.
const LEAST_ERROR: f64 = 0.015;
/// Least error that is left when all else is in the model, else an effect does not show.
const LEAST_SHOWN: f64 = 0.01;
/// The same as a share of the noise.
const LEAST_OF_NOISE: f64 = 1.0;
/// Error, as a share of the noise, that all columns of a library together must leave of what is outside.
const LEAST_OUTSIDE: f64 = 2.0;
/// Largest share of the force that the model may miss of a rig without effects.
const AGREEMENT: f64 = 1e-6;
/// Draws of values and places before a case is given up; far more than are needed.
const ATTEMPTS: u64 = 200;
/// Draws of values for one choice of kind and place.
const PER_CHOICE: u64 = 4;

/// Factors of the masses and inertias that both sides share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnMasses {
    crank: f64,
    coupling: f64,
    coupler: f64,
    platform: f64,
}

impl DrawnMasses {
    /// Masses of another machine.
    pub fn draw(random: &mut CaseRandom) -> Self {
        Self {
            crank: three_digits(random.uniform_between(0.8, 1.3)),
            coupling: three_digits(random.uniform_between(0.7, 1.6)),
            coupler: three_digits(random.uniform_between(0.8, 1.4)),
            platform: three_digits(random.uniform_between(0.8, 2.5)),
        }
    }
}

/// A recording to be diagnosed, and one to check.
pub struct HiddenCase {
    /// Its number, from 1.
    pub number: u64,
    /// What kind of thing is hidden.
    pub class: CaseClass,
    /// Row of the table.
    pub label: String,
    /// Effects that are hidden.
    pub hidden: Vec<HiddenEffect>,
    /// What is hidden and no library holds.
    pub outside: Option<OutsideForce>,
    masses: Option<DrawnMasses>,
    /// How the motions repeat.
    pub repeats: CourseRepeats,
    /// Whether derivatives are recorded.
    pub full: bool,
    /// Standard deviation of the noise of forces, N.
    pub noise: f64,
    /// Errors of a model without the effects, after identification, as shares of the force: fit and check.
    pub errors: [f64; 2],
    /// The rig with its masses, without effects.
    pub rig: Rig,
    /// Fit and check.
    pub courses: [DrawnCourse; 2],
    /// Both at fewer samples, for sizes and comparisons.
    pub coarse: [PlantMotion; 2],
}

/// The class of a case and how many of the class come before it.
pub fn class_of(number: u64) -> (CaseClass, u64) {
    let at = |n: u64| PATTERN[usize::try_from((n - 1) % PATTERN.len() as u64).unwrap_or(0)];
    let class = at(number);
    (class, (1..number).filter(|n| at(*n) == class).count() as u64)
}

impl HiddenCase {
    /// Draws a case; the same seed and number give the same case.
    pub fn draw(plant: &SpidermillPlant, seed: u64, number: u64) -> Result<Self, String> {
        let (class, before) = class_of(number);
        let mut random = CaseRandom::new(seed, number, 0);
        let repeats = match random.below(10) {
            0..6 => CourseRepeats::Twice,
            6..8 => CourseRepeats::Once,
            _ => CourseRepeats::Never,
        };
        let full = random.chance(1.0 / 3.0);
        let plain_noise = random.chance(0.6) && class != CaseClass::None;
        let noise = if plain_noise {
            1.0
        } else {
            three_digits(random.log_between(0.5, 3.0))
        };
        let masses = (class == CaseClass::None && before % 3 != 0).then(|| DrawnMasses::draw(&mut random));
        let rig = with_masses(&plant.rig, masses);
        let courses = [(); 2].map(|()| DrawnCourse::draw(&mut random, plant.limits(), repeats));
        let along = |course: &DrawnCourse| PlantMotion::new(&rig, course, course.times(COARSE));
        let coarse = [along(&courses[0])?, along(&courses[1])?];
        let mut case = Self {
            number,
            class,
            label: String::new(),
            hidden: Vec::new(),
            outside: None,
            masses,
            repeats,
            full,
            noise,
            errors: [0.0; 2],
            rig,
            courses,
            coarse,
        };
        case.hide(plant, seed, before)?;
        Ok(case)
    }

    /// A name for folders.
    pub fn name(&self) -> String {
        let label: String = self
            .label
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
            .collect();
        format!("{:03}_{}_{label}", self.number, self.class.name())
    }

    /// Kinds and places that are hidden.
    pub fn placed(&self) -> Vec<PlacedEffect> {
        self.hidden.iter().map(|hidden| hidden.placed.clone()).collect()
    }

    /// What is hidden, in words.
    pub fn truth(&self) -> String {
        let mut parts: Vec<String> = self.hidden.iter().map(ToString::to_string).collect();
        parts.extend(self.outside.as_ref().map(ToString::to_string));
        if let Some(m) = self.masses {
            parts.push(format!(
                "masses times {} (cranks), {} (couplings), {} (couplers), {} (platform)",
                m.crank, m.coupling, m.coupler, m.platform
            ));
        }
        if parts.is_empty() {
            "nothing".to_owned()
        } else {
            parts.join(", ")
        }
    }

    /// What is hidden, for `truth.json`; `floor` is that of fit and check, `doubles` those of [`Self::doubles`].
    pub fn json(&self, seed: u64, floor: [f64; 2], doubles: &[PlacedEffect]) -> Value {
        let doubles: Vec<Value> = doubles
            .iter()
            .map(|one| json!({ "kind": one.kind, "at": one.at }))
            .collect();
        let hidden = self.hidden.iter().map(|one| {
            let values: serde_json::Map<String, Value> =
                one.values.iter().map(|(s, v)| ((*s).to_owned(), json!(v))).collect();
            json!({ "kind": one.placed.kind, "at": one.placed.at, "values": values })
        });
        let hidden: Vec<Value> = hidden.collect();
        json!({
            "class": self.class.name(),
            "hidden": if self.outside.is_some() { json!("unexplained") } else { json!(hidden) },
            "says": self.truth(),
            "indistinguishable_alone": doubles,
            "columns": if self.full { "full" } else { "positions only" },
            "repeats": self.repeats.word(),
            "force_noise": self.noise,
            "error_without": { "fit": self.errors[0], "check": self.errors[1] },
            "floor": { "fit": floor[0], "check": floor[1] },
            "seed": seed,
            "number": self.number,
        })
    }

    /// Chooses what to hide, and sizes that show.
    fn hide(&mut self, plant: &SpidermillPlant, seed: u64, before: u64) -> Result<(), String> {
        let base = [
            self.coarse[0].base(&plant.derivation)?,
            self.coarse[1].base(&plant.derivation)?,
        ];
        let spans = base.map(ColumnSpan::from_columns);
        for (span, along) in spans.iter().zip(&self.coarse) {
            let error = rms(&span.rest(&along.plain)) / rms(&along.plain);
            if error > AGREEMENT {
                return Err(format!(
                    "case {}: rig and model differ by {error:e} of the force",
                    self.number
                ));
            }
        }
        if self.class == CaseClass::None {
            let what = if self.masses.is_some() {
                "other masses"
            } else {
                "nothing"
            };
            what.clone_into(&mut self.label);
            return Ok(());
        }
        let all = choices();
        let pick = |purpose: u64, turn: u64, n: usize| {
            let order = CaseRandom::new(seed, 0, purpose).order(n);
            order[usize::try_from(turn % n as u64).unwrap_or(0)]
        };
        for attempt in 0..ATTEMPTS {
            let mut random = CaseRandom::new(seed, self.number, 100 + attempt);
            // Choices come round one after the other; one that cannot show is passed over.
            let turn = before + 7 * (attempt / PER_CHOICE);
            let fits = match self.class {
                CaseClass::One => {
                    let choice = &all[pick(1, turn, all.len())];
                    self.label = format!("{} {}", choice.kind, choice.at.join("+"));
                    self.hide_effects(&[choice], &mut random, &spans)?
                }
                CaseClass::Two => {
                    let choice = &all[pick(2, turn, all.len())];
                    let other = &all[random.below(all.len())];
                    self.label = format!("{} + {}", choice.kind, other.kind);
                    !would_merge(choice, other) && self.hide_effects(&[choice, other], &mut random, &spans)?
                }
                _ => {
                    let law = OutsideLaw::ALL[pick(3, turn, OutsideLaw::ALL.len())];
                    law.name().clone_into(&mut self.label);
                    self.hide_outside(law, &mut random, &spans)
                }
            };
            if fits {
                return Ok(());
            }
        }
        Err(format!("case {}: nothing that shows was found", self.number))
    }

    fn hide_effects(
        &mut self,
        choices: &[&HiddenChoice],
        random: &mut CaseRandom,
        spans: &[ColumnSpan; 2],
    ) -> Result<bool, String> {
        let mut hidden = Vec::new();
        for choice in choices {
            let error = random.log_between(ERRORS[0], ERRORS[1]);
            let Some(sized) = self.sized(&choice.draw(random), error, &spans[0])? else {
                return Ok(false);
            };
            hidden.extend(sized);
        }
        self.hidden = hidden;
        for (k, span) in spans.iter().enumerate() {
            let added = self.added(k)?;
            self.errors[k] = rms(&span.rest(&added)) / rms(&sum(&self.coarse[k].plain, &added));
        }
        Ok(self.errors[1] >= LEAST_SHOWN && self.all_show(&spans[0])?)
    }

    /// The effects at a size that causes a given error on the fit; `None` if a machine cannot have that much.
    fn sized(&self, unit: &[HiddenEffect], error: f64, span: &ColumnSpan) -> Result<Option<Vec<HiddenEffect>>, String> {
        let along = &self.coarse[0];
        let plain = &along.plain;
        if unit.iter().all(|one| !one.has_size()) {
            return Ok(Some(unit.to_vec()));
        }
        let effects = unit
            .iter()
            .map(|one| one.effect(&self.rig))
            .collect::<Result<Vec<_>, _>>()?;
        let added = along.added(&effects)?;
        let shown = rms(&span.rest(&added));
        if shown <= 1e-9 * rms(&added) {
            return Ok(None);
        }
        // The effect is part of the force of which its error is a share.
        let most = unit.iter().flat_map(|one| {
            let symbols = one.values.iter().filter(|(_, value)| *value != 0.0);
            symbols.map(|(symbol, value)| largest(&one.placed, symbol) / value.abs())
        });
        let most = most.fold(f64::INFINITY, f64::min);
        let mut factor = 0.0;
        for _ in 0..50 {
            let force: Vec<f64> = plain.iter().zip(&added).map(|(f, a)| f + factor * a).collect();
            factor = (error * rms(&force) / shown).min(most);
        }
        let force: Vec<f64> = plain.iter().zip(&added).map(|(f, a)| f + factor * a).collect();
        let enough = factor * shown >= LEAST_ERROR * rms(&force);
        Ok(enough.then(|| unit.iter().map(|one| one.times(factor)).collect()))
    }

    /// Whether each effect shows beside the others, and beside simpler ones that say nearly the same.
    fn all_show(&self, span: &ColumnSpan) -> Result<bool, String> {
        let along = &self.coarse[0];
        let total = self.added(0)?;
        let force = rms(&sum(&along.plain, &total));
        let enough = |rest: f64| rest >= (LEAST_SHOWN * force).max(LEAST_OF_NOISE * self.noise);
        for (k, one) in self.hidden.iter().enumerate() {
            let mut others = span.clone();
            for (_, other) in self.hidden.iter().enumerate().filter(|(j, _)| *j != k) {
                others.extend(self.columns_of(other)?);
            }
            let mut simpler: Vec<Vec<PlacedEffect>> = vec![Vec::new()];
            let lesser = |kind: &str| {
                vec![PlacedEffect {
                    kind: kind.to_owned(),
                    at: one.placed.at.clone(),
                }]
            };
            match one.placed.kind.as_str() {
                "directional_viscous_friction" => simpler.push(lesser("viscous_friction")),
                "directional_coulomb_friction" => {
                    simpler.push(lesser("coulomb_friction"));
                    simpler.push(lesser("force_offset"));
                }
                "spring" => simpler.push(lesser("force_offset")),
                _ => {}
            }
            for less in simpler {
                let mut others = others.clone();
                for placed in &less {
                    others.extend(columns(along, placed, 1.0, &[]).unwrap_or_default());
                }
                if !enough(rms(&others.rest(&total))) {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    fn columns_of(&self, hidden: &HiddenEffect) -> Result<Vec<Vec<f64>>, String> {
        if hidden.placed.kind == "time_delay" {
            return Ok(vec![self.delay_column(0)?]);
        }
        let constant = hidden.constant().unwrap_or(1.0);
        columns(&self.coarse[0], &hidden.placed, constant, &self.masses_hidden()?)
            .ok_or_else(|| format!("no columns of {}", hidden.placed))
    }

    /// Hidden effects with mass, which friction by load feels.
    pub fn masses_hidden(&self) -> Result<Vec<RigEffect>, String> {
        let massive =
            |one: &&HiddenEffect| ["point_mass", "rod_inertia", "gravity_tilt"].contains(&one.placed.kind.as_str());
        let effects = self.hidden.iter().filter(massive);
        effects.map(|one| one.effect(&self.rig)).collect()
    }

    fn hide_outside(&mut self, law: OutsideLaw, random: &mut CaseRandom, spans: &[ColumnSpan; 2]) -> bool {
        let along = &self.coarse[0];
        let unit = OutsideForce::draw(law, random);
        let error = random.log_between(ERRORS[0], ERRORS[1]);
        let mut all = spans[0].clone();
        all.extend(library(along));
        let shows = |outside: &OutsideForce, k: usize| {
            let added = outside.added(&self.coarse[k]);
            let force = rms(&sum(&self.coarse[k].plain, &added));
            (rms(&spans[k].rest(&added)) / force, added)
        };
        let wanted = |outside: &OutsideForce| {
            let (share, added) = shows(outside, 0);
            (share, rms(&all.rest(&added)) / self.noise)
        };
        // Sizes from small to large; cutting works the other way round.
        let peak = along.plain.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
        let (start, step) = if law == OutsideLaw::Saturation {
            (peak, 0.97)
        } else {
            (1e-2, 1.05)
        };
        let mut outside = unit.times(start / unit.size.abs());
        for _ in 0..400 {
            let (share, left) = wanted(&outside);
            if share > 1.2 * ERRORS[1] {
                return false;
            }
            let of_check = shows(&outside, 1).0;
            if share >= error && left >= LEAST_OUTSIDE && of_check >= LEAST_SHOWN {
                self.errors = [share, of_check];
                self.outside = Some(outside);
                return true;
            }
            let next = outside.times(step);
            // Three digits may stand still.
            outside = if next == outside {
                outside.times(step * step)
            } else {
                next
            };
        }
        false
    }

    /// What is hidden adds to the forces of a coarse motion: fit 0, check 1.
    fn added(&self, which: usize) -> Result<Vec<f64>, String> {
        let along = &self.coarse[which];
        let forces = self.forces(along, &self.courses[which])?;
        Ok(forces.iter().zip(&along.plain).map(|(a, b)| a - b).collect())
    }

    /// True forces as they are read without noise.
    pub fn forces(&self, along: &PlantMotion, course: &DrawnCourse) -> Result<Vec<f64>, String> {
        let delay: f64 = self.hidden.iter().map(HiddenEffect::delay).sum();
        let read = if delay > 0.0 {
            let times = along.times.iter().map(|t| t - delay).collect();
            Some(PlantMotion::new(&self.rig, course, times)?)
        } else {
            None
        };
        self.prompt_forces(read.as_ref().unwrap_or(along))
    }

    /// True forces at their own time.
    pub fn prompt_forces(&self, along: &PlantMotion) -> Result<Vec<f64>, String> {
        let effects = self
            .hidden
            .iter()
            .map(|one| one.effect(&self.rig))
            .collect::<Result<Vec<_>, _>>()?;
        let forces = along.forces(&effects)?;
        Ok(match &self.outside {
            Some(outside) => sum(&forces, &outside.added(along)),
            None => forces,
        })
    }

    /// How the forces change when they are read later: fit 0, check 1.
    pub fn delay_column(&self, which: usize) -> Result<Vec<f64>, String> {
        delay_column(&self.coarse[which], &self.courses[which], &|along| {
            self.prompt_forces(along)
        })
    }
}

/// Whether two choices would make one effect, or one that takes the other up.
fn would_merge(one: &HiddenChoice, other: &HiddenChoice) -> bool {
    let shared = one.at.iter().any(|place| other.at.contains(place));
    let family = |kind: &str| match kind {
        "viscous_friction" | "directional_viscous_friction" => 1,
        "coulomb_friction" | "directional_coulomb_friction" | "stribeck" => 2,
        "spring" | "force_offset" => 3,
        _ => 0,
    };
    let offsets = |a: &HiddenChoice, b: &HiddenChoice| {
        a.kind == "directional_coulomb_friction" && ["force_offset", "spring"].contains(&b.kind)
    };
    let same = one.kind == other.kind || (family(one.kind) > 0 && family(one.kind) == family(other.kind));
    shared && (same || offsets(one, other) || offsets(other, one))
}

/// The rig with bodies of other masses.
pub fn with_masses(rig: &Rig, masses: Option<DrawnMasses>) -> Rig {
    let mut rig = rig.clone();
    let Some(masses) = masses else { return rig };
    for body in &mut rig.bodies {
        let factor = match body.name.as_str() {
            "G1" | "G7" | "G8" | "G11" => masses.crank,
            "G2" | "G6" => masses.coupling,
            "G4" => masses.platform,
            _ => masses.coupler,
        };
        body.mass *= factor;
        body.inertia *= factor;
    }
    rig
}

fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(x, y)| x + y).collect()
}
