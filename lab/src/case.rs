//! Cases of the benchmark of hidden effects: seed and number go in; motions, noise and hidden effects come out.
//!
//! The size of an effect is drawn as the error that it causes in a model without it after identification.

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

/// Samples per second of the coarse motions on which sizes are computed and alternatives are compared, Hz.
pub const COARSE: f64 = 50.0;
/// Samples per second of the recordings, Hz.
pub const RATE: f64 = 250.0;
/// Classes of 20 successive cases, then repeated: half have one effect and a fifth have two. The rest have no effect or
/// a force outside the library.
const PATTERN: [CaseClass; 20] = {
    use CaseClass::{None as N, One as I, Outside as O, Two as T};
    [I, T, I, O, I, N, I, T, I, O, I, N, I, T, I, O, I, N, I, T]
};
/// Range of the error that an effect alone causes in a model without it after identification, relative to the force.
const ERRORS: [f64; 2] = [0.02, 0.30];
/// Least such error for an effect that is limited by the size of the machine.
const LEAST_ERROR: f64 = 0.015;
/// Least residual of a visible effect, relative to the force, when everything else is in the model.
const LEAST_SHOWN: f64 = 0.01;
/// The same relative to the standard deviation of the noise.
const LEAST_OF_NOISE: f64 = 1.0;
/// Least residual of a force outside the library, relative to the noise, when all columns of the library are fitted.
const LEAST_OUTSIDE: f64 = 2.0;
/// Largest error of the model relative to the forces of a rig without effects.
const AGREEMENT: f64 = 1e-6;
/// Draws of values and places before a case fails; far more than are needed.
const ATTEMPTS: u64 = 200;
/// Draws of values for one choice of kind and place.
const PER_CHOICE: u64 = 4;

/// Factors of masses and inertias; the left and the right side have the same factors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnMasses {
    /// Factor of the cranks G1, G7, G8 and G11.
    crank: f64,
    /// Factor of the couplings G2 and G6.
    coupling: f64,
    /// Factor of the couplers, which are all other bodies.
    coupler: f64,
    /// Factor of the platform G4.
    platform: f64,
}

impl DrawnMasses {
    /// Draws the factors of another machine, rounded to three digits.
    pub fn draw(random: &mut CaseRandom) -> Self {
        Self {
            crank: three_digits(random.uniform_between(0.8, 1.3)),
            coupling: three_digits(random.uniform_between(0.7, 1.6)),
            coupler: three_digits(random.uniform_between(0.8, 1.4)),
            platform: three_digits(random.uniform_between(0.8, 2.5)),
        }
    }
}

/// A pair of recordings with something hidden: one to fit and one to validate.
pub struct HiddenCase {
    /// Number of the case, from 1.
    pub number: u64,
    /// Class of what is hidden.
    pub class: CaseClass,
    /// Label of its row in the table of scores.
    pub label: String,
    /// Hidden effects of the library.
    pub hidden: Vec<HiddenEffect>,
    /// Hidden force outside the library; `None` in all other classes.
    pub outside: Option<OutsideForce>,
    /// Factors of the masses; `None` for the masses of the rig file.
    masses: Option<DrawnMasses>,
    /// Periodicity of both motions.
    pub repeats: CourseRepeats,
    /// Whether rates and accelerations are recorded as well.
    pub full: bool,
    /// Standard deviation of the noise of forces, N.
    pub noise: f64,
    /// Errors of a model without the effects after identification, relative to the force: `[fit, validation]`.
    pub errors: [f64; 2],
    /// The rig with its masses, without effects.
    pub rig: Rig,
    /// Motions of the fit and of the validation run.
    pub courses: [DrawnCourse; 2],
    /// The rig along both motions at [`COARSE`] samples per second, for sizes and comparisons.
    pub coarse: [PlantMotion; 2],
}

/// The class of a case and the number of earlier cases of that class.
pub fn class_of(number: u64) -> (CaseClass, u64) {
    let at = |n: u64| PATTERN[usize::try_from((n - 1) % PATTERN.len() as u64).unwrap_or(0)];
    let class = at(number);
    (class, (1..number).filter(|n| at(*n) == class).count() as u64)
}

impl HiddenCase {
    /// Draws a case; the same seed and number give the same case.
    ///
    /// Fails if the rig cannot follow a motion, or if no draw has a visible effect.
    pub fn draw(plant: &SpidermillPlant, seed: u64, number: u64) -> Result<Self, String> {
        let (class, before) = class_of(number);
        let mut random = CaseRandom::new(seed, number, 0);
        // Six of ten motions have two periods, two have one, and two are not periodic.
        let repeats = match random.below(10) {
            0..6 => CourseRepeats::Twice,
            6..8 => CourseRepeats::Once,
            _ => CourseRepeats::Never,
        };
        let full = random.chance(1.0 / 3.0);
        // Three of five cases with something hidden have noise of 1 N; all others have a drawn level.
        let plain_noise = random.chance(0.6) && class != CaseClass::None;
        let noise = if plain_noise {
            1.0
        } else {
            three_digits(random.log_between(0.5, 3.0))
        };
        // Two of three cases without an effect have other masses, which the base parameters represent.
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

    /// The name of the folder of the case.
    pub fn name(&self) -> String {
        let label: String = self
            .label
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
            .collect();
        format!("{:03}_{}_{label}", self.number, self.class.name())
    }

    /// Kinds and places of the hidden effects.
    pub fn placed(&self) -> Vec<PlacedEffect> {
        self.hidden.iter().map(|hidden| hidden.placed.clone()).collect()
    }

    /// Hidden effects, forces and masses as text.
    pub fn truth(&self) -> String {
        let mut parts: Vec<String> = self.hidden.iter().map(ToString::to_string).collect();
        parts.extend(self.outside.as_ref().map(ToString::to_string));
        if let Some(m) = self.masses {
            parts.push(format!(
                "masses multiplied by {} (cranks), {} (couplings), {} (couplers), {} (platform)",
                m.crank, m.coupling, m.coupler, m.platform
            ));
        }
        if parts.is_empty() {
            "nothing".to_owned()
        } else {
            parts.join(", ")
        }
    }

    /// The entry of `truth.json`.
    ///
    /// `floor` has the true noise floors of fit and validation run, `doubles` the result of [`Self::doubles`].
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

    /// Chooses what is hidden, with sizes at which it is visible.
    fn hide(&mut self, plant: &SpidermillPlant, seed: u64, before: u64) -> Result<(), String> {
        let base = [
            self.coarse[0].base(&plant.derivation)?,
            self.coarse[1].base(&plant.derivation)?,
        ];
        // Without effects the model must agree with the rig, so that every later error has a hidden cause.
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
        // The order of the choices depends on the seed alone, so that successive cases use different choices.
        let all = choices();
        let pick = |purpose: u64, turn: u64, n: usize| {
            let order = CaseRandom::new(seed, 0, purpose).order(n);
            order[usize::try_from(turn % n as u64).unwrap_or(0)]
        };
        for attempt in 0..ATTEMPTS {
            let mut random = CaseRandom::new(seed, self.number, 100 + attempt);
            // Cases use the choices in turn. After some draws without a visible effect, the next choice is tried.
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
        Err(format!(
            "case {}: no visible effect was found; try another seed",
            self.number
        ))
    }

    /// Hides effects with drawn sizes; false if a size is impossible or an effect is not visible.
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
        // The residual of the added forces after the base parameters were fitted is the error without the effects.
        for (k, span) in spans.iter().enumerate() {
            let added = self.added(k)?;
            self.errors[k] = rms(&span.rest(&added)) / rms(&sum(&self.coarse[k].plain, &added));
        }
        Ok(self.errors[1] >= LEAST_SHOWN && self.all_show(&spans[0])?)
    }

    /// The effects multiplied by the factor that causes a given error on the fit, limited to plausible values.
    ///
    /// `None` if the base parameters represent the effects, or if plausible values cause too small an error.
    fn sized(&self, unit: &[HiddenEffect], error: f64, span: &ColumnSpan) -> Result<Option<Vec<HiddenEffect>>, String> {
        let along = &self.coarse[0];
        let plain = &along.plain;
        // Effects without a size, such as a delay, stay as drawn.
        if unit.iter().all(|one| !one.has_size()) {
            return Ok(Some(unit.to_vec()));
        }
        let effects = unit
            .iter()
            .map(|one| one.effect(&self.rig))
            .collect::<Result<Vec<_>, _>>()?;
        let added = along.added(&effects)?;
        let shown = rms(&span.rest(&added));
        // The base parameters represent the effects up to rounding.
        if shown <= 1e-9 * rms(&added) {
            return Ok(None);
        }
        // The largest factor at which all values are plausible.
        let most = unit.iter().flat_map(|one| {
            let symbols = one.values.iter().filter(|(_, value)| *value != 0.0);
            symbols.map(|(symbol, value)| largest(&one.placed, symbol) / value.abs())
        });
        let most = most.fold(f64::INFINITY, f64::min);
        // The error is relative to a force that contains the effect, hence a fixed-point iteration.
        let mut factor = 0.0;
        for _ in 0..50 {
            let force: Vec<f64> = plain.iter().zip(&added).map(|(f, a)| f + factor * a).collect();
            factor = (error * rms(&force) / shown).min(most);
        }
        let force: Vec<f64> = plain.iter().zip(&added).map(|(f, a)| f + factor * a).collect();
        let enough = factor * shown >= LEAST_ERROR * rms(&force);
        Ok(enough.then(|| unit.iter().map(|one| one.times(factor)).collect()))
    }

    /// Whether each effect is visible when the others are in the model, also if a similar simpler effect is added.
    fn all_show(&self, span: &ColumnSpan) -> Result<bool, String> {
        let along = &self.coarse[0];
        let total = self.added(0)?;
        let force = rms(&sum(&along.plain, &total));
        let enough = |rest: f64| rest >= (LEAST_SHOWN * force).max(LEAST_OF_NOISE * self.noise);
        for (k, one) in self.hidden.iter().enumerate() {
            // Columns of the base parameters and of all other hidden effects.
            let mut others = span.clone();
            for (_, other) in self.hidden.iter().enumerate().filter(|(j, _)| *j != k) {
                others.extend(self.columns_of(other)?);
            }
            // Simpler effects at the same place that nearly represent this one; the first entry adds none.
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
                // Everything except this effect is in the span, so the residual belongs to it.
                if !enough(rms(&others.rest(&total))) {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// Columns of a hidden effect along the fit, samples times drives; fails for kinds without columns.
    fn columns_of(&self, hidden: &HiddenEffect) -> Result<Vec<Vec<f64>>, String> {
        if hidden.placed.kind == "time_delay" {
            return Ok(vec![self.delay_column(0)?]);
        }
        let constant = hidden.constant().unwrap_or(1.0);
        columns(&self.coarse[0], &hidden.placed, constant, &self.masses_hidden()?)
            .ok_or_else(|| format!("no columns of {}", hidden.placed))
    }

    /// Hidden masses and tilts, which change the load on which load friction depends.
    pub fn masses_hidden(&self) -> Result<Vec<RigEffect>, String> {
        let massive =
            |one: &&HiddenEffect| ["point_mass", "rod_inertia", "gravity_tilt"].contains(&one.placed.kind.as_str());
        let effects = self.hidden.iter().filter(massive);
        effects.map(|one| one.effect(&self.rig)).collect()
    }

    /// Hides a force outside the library with the drawn error or more; false if no size fulfils all conditions.
    fn hide_outside(&mut self, law: OutsideLaw, random: &mut CaseRandom, spans: &[ColumnSpan; 2]) -> bool {
        let along = &self.coarse[0];
        let unit = OutsideForce::draw(law, random);
        let error = random.log_between(ERRORS[0], ERRORS[1]);
        // Base parameters and all columns of the library together.
        let mut all = spans[0].clone();
        all.extend(library(along));
        // The error that the force causes in a model without it, and the force itself.
        let shows = |outside: &OutsideForce, k: usize| {
            let added = outside.added(&self.coarse[k]);
            let force = rms(&sum(&self.coarse[k].plain, &added));
            (rms(&spans[k].rest(&added)) / force, added)
        };
        // The same error on the fit, and the residual of the complete library relative to the noise.
        let wanted = |outside: &OutsideForce| {
            let (share, added) = shows(outside, 0);
            (share, rms(&all.rest(&added)) / self.noise)
        };
        // The size grows from a small effect to a large one. Saturation grows with a lower limit.
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
            // Rounding to three digits may leave the size unchanged.
            outside = if next == outside {
                outside.times(step * step)
            } else {
                next
            };
        }
        false
    }

    /// Forces that the hidden things add along a coarse motion, N, samples times drives: fit 0, validation 1.
    fn added(&self, which: usize) -> Result<Vec<f64>, String> {
        let along = &self.coarse[which];
        let forces = self.forces(along, &self.courses[which])?;
        Ok(forces.iter().zip(&along.plain).map(|(a, b)| a - b).collect())
    }

    /// Measured forces without noise, N: the true forces with the hidden delay.
    pub fn forces(&self, along: &PlantMotion, course: &DrawnCourse) -> Result<Vec<f64>, String> {
        let delay: f64 = self.hidden.iter().map(HiddenEffect::delay).sum();
        // A delayed reading at one time is the force of an earlier time.
        let read = if delay > 0.0 {
            let times = along.times.iter().map(|t| t - delay).collect();
            Some(PlantMotion::new(&self.rig, course, times)?)
        } else {
            None
        };
        self.prompt_forces(read.as_ref().unwrap_or(along))
    }

    /// True forces without delay, N, samples times drives.
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

    /// Change of the forces by a small delay of their reading, N: fit 0, validation 1.
    pub fn delay_column(&self, which: usize) -> Result<Vec<f64>, String> {
        delay_column(&self.coarse[which], &self.courses[which], &|along| {
            self.prompt_forces(along)
        })
    }
}

/// Whether two choices would form one effect, or one that contains the other.
fn would_merge(one: &HiddenChoice, other: &HiddenChoice) -> bool {
    let shared = one.at.iter().any(|place| other.at.contains(place));
    // Kinds of one family contain each other or share a column.
    let family = |kind: &str| match kind {
        "viscous_friction" | "directional_viscous_friction" => 1,
        "coulomb_friction" | "directional_coulomb_friction" | "stribeck" => 2,
        "spring" | "force_offset" => 3,
        _ => 0,
    };
    // Directional Coulomb friction contains an offset.
    let offsets = |a: &HiddenChoice, b: &HiddenChoice| {
        a.kind == "directional_coulomb_friction" && ["force_offset", "spring"].contains(&b.kind)
    };
    let same = one.kind == other.kind || (family(one.kind) > 0 && family(one.kind) == family(other.kind));
    shared && (same || offsets(one, other) || offsets(other, one))
}

/// The rig with masses and inertias of its bodies multiplied by the factors.
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

/// The sum of two columns, element by element.
fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(x, y)| x + y).collect()
}
