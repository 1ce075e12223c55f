//! `diagnose` on forces that a variant of the model makes along the bundled motion, with noise: constants that are searched
//! for among shared places, below zero, and between the points of their grid, and a base that tilts what is held.
//!
//! The variant is the truth: what is found has to be its effect, with its values. Each of these failed once.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use crate::common::{json, model, number, printed, run, scratch};
use modelmill_runtime::RandomBits;
use serde_json::Value;

const DRIVES: [&str; 2] = ["spindle_left", "spindle_right"];
/// Standard deviation of the noise on forces of a few hundred newtons, N.
const NOISE: f64 = 0.5;

/// A normal distribution by Box and Muller.
struct Noise(RandomBits);

impl Noise {
    fn uniform(&mut self) -> f64 {
        ((self.0.bits() >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    fn next(&mut self) -> f64 {
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        radius * (TAU * self.uniform()).cos()
    }
}

fn rows(csv: &str) -> (Vec<&str>, Vec<Vec<&str>>) {
    let mut lines = csv.lines().map(|line| line.split(',').collect());
    (lines.next().expect("a header"), lines.collect())
}

/// The bundled motion with the forces of a model file, and noise.
fn recorded(name: &str, truth: &str, motion: &str, seed: u64) -> String {
    let forces = scratch(&format!("made-{name}-forces.csv"));
    printed(&["evaluate", truth, "--data", motion, "--out", &forces]);
    let forces = std::fs::read_to_string(&forces).expect("forces");
    let motion = std::fs::read_to_string(motion).expect("a motion");
    let ((named, forces), (header, motion)) = (rows(&forces), rows(&motion));
    assert_eq!(forces.len(), motion.len());
    let at = DRIVES.map(|drive| named.iter().position(|n| *n == drive).expect("a force"));
    let mut noise = Noise(RandomBits::new(seed));
    let mut text = header.join(",") + "\n";
    for (state, force) in motion.iter().zip(&forces) {
        let fields: Vec<String> = header
            .iter()
            .zip(state)
            .map(|(name, field)| match DRIVES.iter().position(|d| d == name) {
                Some(drive) => {
                    let force: f64 = force[at[drive]].parse().expect("a number");
                    (force + NOISE * noise.next()).to_string()
                }
                None => (*field).to_owned(),
            })
            .collect();
        writeln!(text, "{}", fields.join(",")).expect("a string takes it");
    }
    let path = scratch(&format!("made-{name}-{seed}.csv"));
    std::fs::write(&path, text).expect("a recording");
    path
}

/// What `diagnose` says of the SpiderMill whose truth has more than the model.
fn diagnosed(name: &str, more: &str, args: &[&str]) -> Value {
    let truth = scratch(&format!("made-{name}.toml"));
    let bare = model("spidermill.toml");
    let text = format!("schema = 1\nname = \"truth\"\nextends = {bare:?}\n{more}");
    std::fs::write(&truth, text).expect("a variant");
    let fit = recorded(name, &truth, &run("plain-fit.csv"), 1);
    let check = recorded(name, &truth, &run("plain-check.csv"), 2);
    let mut all = vec!["diagnose", &bare, "--data", &fit, "--check", &check, "--json"];
    all.extend(args);
    json(&all)
}

/// The only effect that was found, after its kind and places have been compared.
#[track_caller]
fn only<'a>(answer: &'a Value, kind: &str, at: &[&str]) -> &'a Value {
    assert_eq!(answer["verdict"], "missing_effect", "{answer:#}");
    let effects = answer["effects"].as_array().expect("effects");
    assert_eq!(effects.len(), 1, "{effects:#?}");
    assert_eq!(effects[0]["kind"], kind);
    assert_eq!(effects[0]["at"], serde_json::json!(at));
    &effects[0]
}

/// Value of a parameter or constant of an effect.
#[track_caller]
fn value(effect: &Value, name: &str) -> f64 {
    for list in ["estimates", "constants"] {
        let entries = effect[list].as_array().into_iter().flatten();
        if let Some(entry) = entries.into_iter().find(|e| e["name"] == name) {
            return number(entry, "/value");
        }
    }
    panic!("no {name} in {effect:#}")
}

#[track_caller]
fn near(found: f64, truth: f64, share: f64) {
    assert!((found - truth).abs() <= share * truth.abs(), "{found}, not {truth}");
}

#[test]
fn a_tilt_is_found_while_parameters_are_held() {
    let tilt = "[[effect]]\nkind = \"gravity_tilt\"\nat = [\"base\"]\nconstants = { tz = 0.05 }\n";
    let answer = diagnosed("tilt", tilt, &["--held"]);
    near(value(only(&answer, "gravity_tilt", &["base"]), "tz"), 0.05, 0.01);
}

#[test]
fn a_constant_that_places_share_is_found() {
    let friction = "[[effect]]\nkind = \"stribeck_friction\"\nat = [\"spindle_left\", \"spindle_right\"]
parameters = { Fs = { nominal = 20.0 } }\nconstants = { vs = 0.01 }\n";
    let answer = diagnosed("shared", friction, &[]);
    let effect = only(&answer, "stribeck_friction", &DRIVES);
    near(value(effect, "Fs"), 20.0, 0.05);
    near(value(effect, "vs"), 0.01, 0.05);
}

/// Kinds of one's own: one whose constant is below zero, and one of two columns of which the first says nothing here.
const LIBRARY: &str = r#"
[[effect_kind]]
name = "shifted_sign"
on = ["drive"]
expression = "Fx*sign(rate - v0)"
says = "Dry friction whose sign changes at another rate than zero."
[effect_kind.parameters]
Fx = { unit = { force = "N", torque = "N m" } }
[effect_kind.constants]
v0 = { unit = { force = "m/s", torque = "rad/s" }, search = { from = -0.5, to = 0.5, of = "rate" } }

[[effect_kind]]
name = "bend"
on = ["drive"]
expression = "Zz*(abs(coordinate) - coordinate)*rate + Fs*rate*exp(-(rate/vs)^2)"
says = "A force that bends at low rates."
[effect_kind.parameters]
Zz = { unit = { force = "N s/m^2", torque = "N m s/rad^2" } }
Fs = { unit = { force = "N s/m", torque = "N m s/rad" }, sign = "positive" }
[effect_kind.constants]
vs = { unit = { force = "m/s", torque = "rad/s" }, search = { from = 0.003, to = 0.5, of = "rate" } }
"#;

fn with_library(name: &str, effect: &str) -> Value {
    let library = scratch(&format!("made-{name}-library.toml"));
    std::fs::write(&library, LIBRARY).expect("a library");
    let more = format!("library = {library:?}\n[[effect]]\n{effect}\n");
    diagnosed(name, &more, &["--library", &library])
}

#[test]
fn a_constant_below_zero_is_found_between_points_of_its_grid() {
    let answer = with_library(
        "below",
        "kind = \"shifted_sign\"\nat = [\"spindle_left\"]
parameters = { Fx = { nominal = 20.0 } }\nconstants = { v0 = -0.051 }",
    );
    let effect = only(&answer, "shifted_sign", &["spindle_left"]);
    near(value(effect, "Fx"), 20.0, 0.02);
    near(value(effect, "v0"), -0.051, 0.02);
}

#[test]
fn a_column_of_zeros_does_not_shift_its_neighbours() {
    let answer = with_library(
        "bend",
        "kind = \"bend\"\nat = [\"spindle_left\"]
parameters = { Fs = { nominal = 800.0 }, Zz = { nominal = 0.0 } }\nconstants = { vs = 0.035 }",
    );
    let effect = only(&answer, "bend", &["spindle_left"]);
    near(value(effect, "Fs"), 800.0, 0.05);
    near(value(effect, "vs"), 0.035, 0.05);
}
