//! Operations per call, pass by pass: what each pass saves of inverse dynamics and base regressor.
//!
//! `cargo bench -p modelmill-tests --bench operations`, or with `-- panda` for one model. Counted are additions with
//! subtractions, and multiplications, of what is computed at every state; negations and what depends on geometry and
//! parameters alone are not. Divisions, roots, and pairs of sine and cosine stand beside.

use std::process::ExitCode;

use modelmill_codegen::{ProgramStage, StraightLineProgram};
use modelmill_tests::counts::{best_known, text};
use modelmill_tests::fixtures::derived;

/// Models of which each pass is shown.
const MODELS: [&str; 8] = [
    "two_link",
    "puma560",
    "rx90",
    "panda",
    "stanford",
    "five_bar-tied-tool",
    "three_rrr",
    "spidermill",
];

fn main() -> ExitCode {
    let wanted = std::env::args().skip(1).find(|a| !a.starts_with('-'));
    let models = MODELS.iter().filter(|name| wanted.as_ref().is_none_or(|w| w == *name));
    let mut found = false;
    for name in models {
        found = true;
        if let Err(error) = table(name) {
            eprintln!("{name}: {error}");
            return ExitCode::FAILURE;
        }
    }
    if !found {
        eprintln!("no such model; there are {}", MODELS.join(", "));
        return ExitCode::from(2);
    }
    ExitCode::SUCCESS
}

fn table(name: &str) -> Result<(), modelmill_codegen::DeriveError> {
    let derivation = derived(name);
    println!("{name}");
    println!("  {:>22}  {:>22}  after", "inverse dynamics", "regressor");
    for count in derivation.operations_by_pass()? {
        let (a, b) = (text(&count.inverse_dynamics), text(&count.regressor));
        println!("  {a:>22}  {b:>22}  {}", count.pass);
    }
    let [a, b] = best_known(name).map(|n| n.map_or("-".to_owned(), |n| n.to_string()));
    println!("  {a:>22}  {b:>22}  best known of other tools");
    let dynamics = derivation.dynamics()?;
    let of = |what: &str, program: &StraightLineProgram| {
        println!("  {:>22}  {what}", text(&program.count_operations(ProgramStage::State)));
    };
    of("mass matrix", &dynamics.mass_matrix);
    of("centrifugal and Coriolis forces", &dynamics.coriolis);
    of("gravity", &dynamics.gravity);
    of("effects", &dynamics.effects);
    of("all but the mass matrix together", &dynamics.bias);
    println!();
    Ok(())
}
