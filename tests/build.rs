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
}

fn module(mechanism: &Mechanism) -> String {
    let derivation = modelmill_codegen::derive(mechanism)
        .unwrap_or_else(|error| panic!("{}: {error}", mechanism.name));
    match derivation.dynamics() {
        Ok(dynamics) => modelmill_codegen::emit_with_dynamics(&derivation, &dynamics).module(),
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
