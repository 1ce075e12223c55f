//! Library effects that can be hidden: kinds with their places and values of plausible size.

use modelmill_rig::{Rig, RigEffect};

use crate::placed::PlacedEffect;
use crate::random::{CaseRandom, three_digits};

/// A library effect with its values.
#[derive(Clone, Debug, PartialEq)]
pub struct HiddenEffect {
    /// Kind and places.
    pub placed: PlacedEffect,
    /// Values by symbol, in SI units, as the rig takes them.
    pub values: Vec<(&'static str, f64)>,
    /// Indices of the values that grow with the size of the effect.
    scaled: Vec<usize>,
}

impl HiddenEffect {
    /// An effect from values that grow with its size (`scaled`) and values that do not (`fixed`).
    fn new(kind: &str, at: &[&str], scaled: &[(&'static str, f64)], fixed: &[(&'static str, f64)]) -> Self {
        Self {
            placed: PlacedEffect::new(kind, at),
            values: [scaled, fixed].concat(),
            scaled: (0..scaled.len()).collect(),
        }
    }

    /// The effect multiplied by a factor; values are rounded to three digits.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        let mut scaled = self.clone();
        for k in &self.scaled {
            scaled.values[*k].1 = three_digits(factor * self.values[*k].1);
        }
        scaled
    }

    /// Whether a factor changes the effect; a delay keeps its drawn value.
    pub fn has_size(&self) -> bool {
        !self.scaled.is_empty()
    }

    /// The same effect in the rig; fails if the rig does not know its kind or place.
    pub fn effect(&self, rig: &Rig) -> Result<RigEffect, String> {
        effect(rig, &self.placed, &self.values)
    }

    /// The shape parameter, `vs` or `pitch`, SI units; `None` for kinds without one.
    pub fn constant(&self) -> Option<f64> {
        let mut values = self.values.iter();
        let bent = values.find(|(symbol, _)| ["vs", "pitch"].contains(symbol));
        bent.map(|(_, value)| *value)
    }

    /// The delay of the forces, s; zero for all other kinds.
    pub fn delay(&self) -> f64 {
        let of = self.values.iter().find(|_| self.placed.kind == "time_delay");
        of.map_or(0.0, |(_, value)| *value)
    }
}

impl std::fmt::Display for HiddenEffect {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let values = self.values.iter().map(|(symbol, value)| format!("{symbol}={value}"));
        write!(f, "{} ({})", self.placed, values.collect::<Vec<_>>().join(", "))
    }
}

/// Creates an effect of the rig from names; the error lists all faults.
pub fn effect(rig: &Rig, placed: &PlacedEffect, values: &[(&str, f64)]) -> Result<RigEffect, String> {
    let at: Vec<&str> = placed.at.iter().map(String::as_str).collect();
    rig.effect(&placed.kind, &at, values).map_err(|faults| {
        let says: Vec<String> = faults.iter().map(ToString::to_string).collect();
        says.join("; ")
    })
}

/// A kind that can be hidden, with its places.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HiddenChoice {
    /// A kind, or `stribeck` for the Stribeck curve: Coulomb friction and its excess near standstill.
    pub kind: &'static str,
    /// Places. Several mean the same kind at each of them, or one kind that takes two.
    pub at: &'static [&'static str],
}

/// The left drive.
const LEFT: &[&str] = &["spindle_left"];
/// The right drive.
const RIGHT: &[&str] = &["spindle_right"];
/// Both drives.
const BOTH: &[&str] = &["spindle_left", "spindle_right"];

/// Every kind at every plausible place.
///
/// Effects that base parameters represent are left out: masses that both sides share (R3m, both elbows), and
/// `lumped_mass_placement`, which has no effect after identification.
pub fn choices() -> Vec<HiddenChoice> {
    let of_drives: [(&str, &[&[&str]]); 12] = [
        ("viscous_friction", &[LEFT, RIGHT, BOTH]),
        ("coulomb_friction", &[LEFT, RIGHT, BOTH]),
        ("stribeck", &[LEFT, RIGHT]),
        ("load_friction", &[LEFT, RIGHT, BOTH]),
        ("directional_viscous_friction", &[LEFT, RIGHT]),
        ("directional_coulomb_friction", &[LEFT, RIGHT]),
        ("drive_inertia", &[LEFT, RIGHT, BOTH]),
        ("force_offset", &[LEFT, RIGHT, BOTH]),
        ("spring", &[LEFT, RIGHT]),
        ("force_ripple", &[LEFT, RIGHT]),
        ("rod_inertia", &[LEFT, RIGHT, BOTH]),
        ("coupled_drive", &[BOTH]),
    ];
    let elsewhere: [(&str, &[&[&str]]); 5] = [
        ("point_mass", &[&["R2m"], &["R4m"], &["A_left"], &["A_right"]]),
        ("gravity_tilt", &[&["base"]]),
        ("time_delay", &[&["force"]]),
        ("viscous_friction", &[&["gamma1"], &["gamma2"], &["gamma1", "gamma2"]]),
        ("coulomb_friction", &[&["gamma1"], &["gamma2"], &["gamma1", "gamma2"]]),
    ];
    let all = of_drives.into_iter().chain(elsewhere);
    all.flat_map(|(kind, places)| places.iter().map(move |at| HiddenChoice { kind, at }))
        .collect()
}

impl HiddenChoice {
    /// Kinds and places, without values.
    pub fn claims(&self) -> Vec<PlacedEffect> {
        if self.kind == "stribeck" {
            return ["coulomb_friction", "stribeck_friction"]
                .map(|kind| PlacedEffect::new(kind, self.at))
                .to_vec();
        }
        if self.kind == "coupled_drive" {
            return vec![PlacedEffect::new(self.kind, self.at)];
        }
        // Values at several places may differ, so each place is an effect of its own.
        self.at
            .iter()
            .map(|place| PlacedEffect::new(self.kind, &[*place]))
            .collect()
    }

    /// Draws values of unit size, to be multiplied later.
    ///
    /// Values at several places differ in half of the draws.
    pub fn draw(&self, random: &mut CaseRandom) -> Vec<HiddenEffect> {
        if self.kind == "coupled_drive" || self.at.len() == 1 {
            return self.at_places(self.at, random);
        }
        if random.chance(0.5) {
            return self.at_places(self.at, random);
        }
        let mut all = Vec::new();
        for place in self.at {
            let size = random.uniform_between(0.6, 1.6);
            let drawn = self.at_places(&[*place], random);
            all.extend(drawn.iter().map(|one| one.times(size)));
        }
        all
    }

    /// One effect at the given places, or the two parts of a Stribeck curve, with values of unit size.
    fn at_places(&self, at: &[&str], random: &mut CaseRandom) -> Vec<HiddenEffect> {
        let one = |scaled: &[(&'static str, f64)], fixed: &[(&'static str, f64)]| {
            vec![HiddenEffect::new(self.kind, at, scaled, fixed)]
        };
        match self.kind {
            "coulomb_friction" => one(&[("Fc", 1.0)], &[]),
            "load_friction" => one(&[("mu", 1.0)], &[]),
            "drive_inertia" => one(&[("Ia", 1.0)], &[]),
            "force_offset" => one(&[("F0", random.sign())], &[]),
            "point_mass" => one(&[("m", 1.0)], &[]),
            // The excess near standstill is 0.8 to 2.5 times the Coulomb friction.
            "stribeck" => {
                let vs = three_digits(random.log_between(0.015, 0.06));
                vec![
                    HiddenEffect::new("coulomb_friction", at, &[("Fc", 1.0)], &[]),
                    HiddenEffect::new(
                        "stribeck_friction",
                        at,
                        &[("Fs", random.uniform_between(0.8, 2.5))],
                        &[("vs", vs)],
                    ),
                ]
            }
            "directional_viscous_friction" | "directional_coulomb_friction" => {
                // The values of both directions differ from their mean by 25 to 70 %.
                let more = random.sign() * random.uniform_between(0.25, 0.7);
                let symbols = if self.kind == "directional_viscous_friction" {
                    ["Fvp", "Fvn"]
                } else {
                    ["Fcp", "Fcn"]
                };
                one(&[(symbols[0], 1.0 + more), (symbols[1], 1.0 - more)], &[])
            }
            // Lengths of the spindles lie between 0.62 and 0.88 m.
            "spring" => one(
                &[("k", 1.0)],
                &[("rest", three_digits(random.uniform_between(0.5, 0.95)))],
            ),
            // Amplitude 1 with a random phase.
            "force_ripple" => {
                let (sin, cos) = libm::sincos(random.uniform_between(0.0, 2.0 * std::f64::consts::PI));
                let pitch = three_digits(random.log_between(0.008, 0.1));
                one(&[("As", sin), ("Ac", cos)], &[("pitch", pitch)])
            }
            // A uniform rod of unit mass, with its centre at half its length.
            "rod_inertia" => {
                let length = random.uniform_between(0.7, 1.1);
                one(
                    &[("m", 1.0), ("I", length * length / 12.0)],
                    &[("c", three_digits(0.5 * length))],
                )
            }
            "gravity_tilt" => one(&[("tz", 0.01 * random.sign())], &[]),
            "time_delay" => one(&[], &[("T", three_digits(random.uniform_between(0.002, 0.012)))]),
            "coupled_drive" => {
                let parts = [("Ia", 30.0), ("Fv", 150.0), ("Fs", 20.0)];
                // One part is always present, each of the others in three of five draws.
                let always = random.below(parts.len());
                let mut values = Vec::new();
                for (k, (symbol, size)) in parts.into_iter().enumerate() {
                    let share = random.uniform_between(0.5, 1.5);
                    if random.chance(0.6) || k == always {
                        values.push((symbol, size * share));
                    }
                }
                one(&values, &[])
            }
            _ => one(&[("Fv", 1.0)], &[]),
        }
    }
}

/// The largest plausible value of a symbol for a machine of this size, SI units; infinite if it is not limited.
pub fn largest(placed: &PlacedEffect, symbol: &str) -> f64 {
    // Friction of the passive joints is limited to less than that of the drives.
    let passive = placed.at.iter().any(|place| place.starts_with("gamma"));
    match symbol {
        "Fv" if passive => 120.0,
        "Fc" if passive => 60.0,
        "Fv" | "Fvp" | "Fvn" => 1000.0,
        "Fc" | "Fcp" | "Fcn" | "Fs" => 120.0,
        "F0" | "Ia" => 150.0,
        "mu" => 0.5,
        "k" => 3000.0,
        "m" => 25.0,
        "tz" => 0.2,
        _ => f64::INFINITY,
    }
}
