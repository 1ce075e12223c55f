//! Emits modules of random mechanisms and of fixtures, so that tests can hold emitted code against the evaluator beyond
//! the bundled models.

// The modules of the tests' library are built into this script, which needs only part of them.
#![allow(dead_code, unreachable_pub, unused_imports)]

#[path = "src/mechanics.rs"]
mod mechanics;
#[path = "src/random/mod.rs"]
mod random;
#[path = "src/scaled.rs"]
mod scaled;
#[path = "src/stream.rs"]
mod stream;

use std::fmt::Write as _;
use std::path::Path;

use modelmill_codegen::Derivation;
use modelmill_spec::Mechanism;
use random::Matter;

/// Mechanisms of each kind; loops with effects of the load would need another state.
const EACH: usize = 8;

/// Fixtures whose modules are tested, and units of length in which they are emitted besides.
///
/// Where a length is the independent coordinate, the numeric reduction needs lengths of a metre or more.
const FIXTURES: [(&str, &[(&str, f64)]); 5] = [
    ("names", &[]),
    ("spatial_slider", &[MM, LARGE, KM, SMALL]),
    ("spatial_press", &[MM, LARGE]),
    ("undefined_effects", &[]),
    ("swinging_cylinder", &[]),
];
const MM: (&str, f64) = ("mm", 1e3);
const KM: (&str, f64) = ("km", 1e-3);
const LARGE: (&str, f64) = ("large", 1024.0);
const SMALL: (&str, f64) = ("small", 1.0 / 1024.0);

fn main() {
    println!("cargo::rerun-if-changed=src");
    println!("cargo::rerun-if-changed=build.rs");
    let folder = std::env::var_os("OUT_DIR").expect("cargo sets OUT_DIR");
    let write = |file: &str, text: String| {
        std::fs::write(Path::new(&folder).join(file), text).expect("OUT_DIR can be written");
    };
    write("random_models.rs", random_models());
    write("fixture_models.rs", fixture_models());
    write("asked_models.rs", asked_models());
}

/// Models, fixtures and random mechanisms that are emitted with reactions and self-test.
const ASKED: [&str; 5] = [
    "model-spec/models/five_bar.toml",
    "model-spec/models/panda.toml",
    "model-spec/models/delta_tied.toml",
    "tests/fixtures/emitted/spatial_press.toml",
    "tests/fixtures/emitted/swinging_cylinder.toml",
];

fn asked_models() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut modules = String::new();
    let mut add = |derivation: &Derivation| {
        let name = &derivation.mechanism.name;
        let reactions = derivation.reactions();
        let reactions = reactions.unwrap_or_else(|error| panic!("{name}: {error}"));
        let emitted = modelmill_emit::emit(derivation).with_reactions(derivation, &reactions);
        modules.push_str(&emitted.with_self_test(derivation).module());
    };
    for file in ASKED {
        let file = root.join(file);
        println!("cargo::rerun-if-changed={}", file.display());
        let mechanism = match modelmill_spec::load_file(&file) {
            Ok(loaded) => loaded.mechanism,
            Err(failure) => panic!("{}", failure.render(false)),
        };
        let derivation = derived(&mechanism);
        add(&derivation);
        match mechanism.name.as_str() {
            "five_bar" => {
                let mut other = derivation;
                "five_bar_without_a_term".clone_into(&mut other.mechanism.name);
                without_a_term(&mut other);
                add(&other);
            }
            "panda" => {
                let mut other = derivation;
                "panda_with_a_column_twice".clone_into(&mut other.mechanism.name);
                // The last column is that of the one before it.
                let outputs = &mut other.programs.regressor.outputs;
                let n_base = other.reduction.retained.len();
                for row in outputs.chunks_mut(n_base) {
                    row[n_base - 1] = row[n_base - 2];
                }
                add(&other);
            }
            _ => {}
        }
    }
    for seed in 0..3 {
        add(&derived(&random::tree(seed, Matter::Physical)));
        add(&derived(&random::planar_loop(seed, Matter::Physical)));
    }
    modules
}

/// Takes the last term off the first base parameter that is a sum.
fn without_a_term(derivation: &mut Derivation) {
    let dependencies = &mut derivation.reduction.dependencies;
    let line = dependencies.iter_mut().rfind(|line| !line.equals.is_empty());
    let line = line.expect("a base parameter that is a sum");
    line.equals.pop();
}

fn derived(mechanism: &Mechanism) -> Derivation {
    modelmill_codegen::derive(mechanism).unwrap_or_else(|error| panic!("{}: {error}", mechanism.name))
}

fn module(mechanism: &Mechanism) -> String {
    let derivation = derived(mechanism);
    match derivation.dynamics() {
        Ok(dynamics) => modelmill_emit::emit_with_dynamics(&derivation, &dynamics).module(),
        Err(error) => panic!("{}: {error}", mechanism.name),
    }
}

fn fixture_models() -> String {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/emitted");
    println!("cargo::rerun-if-changed={}", fixtures.display());
    let mut modules = String::new();
    for (name, units) in FIXTURES {
        let mechanism = match modelmill_spec::load_file(&fixtures.join(format!("{name}.toml"))) {
            Ok(loaded) => loaded.mechanism,
            Err(failure) => panic!("{name}: {}", failure.render(false)),
        };
        modules.push_str(&module(&mechanism));
        for (unit, factor) in units {
            let name = format!("{name}_{unit}");
            modules.push_str(&module(&scaled::scaled(&mechanism, &name, *factor)));
        }
    }
    modules
}

fn random_models() -> String {
    let kinds: [fn(u64, Matter) -> Mechanism; 2] = [random::tree, random::planar_loop];
    let (mut modules, mut list) = (String::new(), String::new());
    for kind in kinds {
        let mechanisms = (0..)
            .map(|seed| (seed, kind(seed, Matter::Anything)))
            .filter(|(_, m)| m.effects.iter().all(|e| e.kind != "load_friction"));
        for (seed, mechanism) in mechanisms.take(EACH) {
            modules.push_str(&module(&mechanism));
            let name = &mechanism.name;
            let (function, passive) = if mechanism.loops.is_empty() {
                ("tree", "")
            } else {
                ("planar_loop", " passive")
            };
            _ = writeln!(list, "        {name}: {function} {seed}{passive};");
        }
    }
    format!(
        "{modules}\n/// Calls a macro with every module: name, the function that makes its mechanism, the seed.\n\
         macro_rules! for_each_random_model {{\n    ($then:ident) => {{\n        $then! {{\n{list}        }}\n    }};\n}}\n"
    )
}
