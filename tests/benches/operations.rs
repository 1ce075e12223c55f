//! Operations per call, pass by pass: what each pass saves of inverse dynamics and base regressor.
//!
//! `cargo bench -p modelmill-tests --bench operations`, or with `-- panda` for one model. Counted are additions with
//! subtractions, and multiplications, of what is computed at every state; negations and what depends on geometry and
//! parameters alone are not. Divisions, roots, and pairs of sine and cosine stand beside.

use std::process::ExitCode;

use modelmill_codegen::{OperationCount, Program, Stage};
use modelmill_tests::fixtures::derived;

/// Models with lowest counts of others: inverse dynamics with base parameters, base regressor.
const MODELS: [(&str, [Option<usize>; 2]); 8] = [
    ("two_link", [Some(38), Some(26)]),
    ("puma560", [Some(539), Some(909)]),
    ("rx90", [Some(521), Some(887)]),
    ("panda", [Some(648), Some(1256)]),
    ("stanford", [None, None]),
    ("five_bar-tied-tool", [None, Some(130)]),
    ("three_rrr", [None, None]),
    ("spidermill", [None, None]),
];

fn main() -> ExitCode {
    let wanted = std::env::args().skip(1).find(|a| !a.starts_with('-'));
    let models = MODELS
        .iter()
        .filter(|(name, _)| wanted.as_ref().is_none_or(|w| w == name));
    let mut found = false;
    for (name, best_known) in models {
        found = true;
        if let Err(error) = table(name, *best_known) {
            eprintln!("{name}: {error}");
            return ExitCode::FAILURE;
        }
    }
    if !found {
        eprintln!(
            "no such model; there are {}",
            MODELS.map(|(n, _)| n).join(", ")
        );
        return ExitCode::from(2);
    }
    ExitCode::SUCCESS
}

fn table(name: &str, best_known: [Option<usize>; 2]) -> Result<(), modelmill_codegen::DeriveError> {
    let derivation = derived(name);
    println!("{name}");
    println!("  {:>22}  {:>22}  after", "inverse dynamics", "regressor");
    for count in derivation.operations_by_pass()? {
        let (a, b) = (short(&count.inverse_dynamics), short(&count.regressor));
        println!("  {a:>22}  {b:>22}  {}", count.pass);
    }
    let [a, b] = best_known.map(|n| n.map_or("-".to_owned(), |n| n.to_string()));
    println!("  {a:>22}  {b:>22}  best known of other tools");
    let dynamics = derivation.dynamics()?;
    let of = |what: &str, program: &Program| {
        println!("  {:>22}  {what}", short(&program.count(Stage::State)));
    };
    of("mass matrix", &dynamics.mass_matrix);
    of("centrifugal and Coriolis forces", &dynamics.coriolis);
    of("gravity", &dynamics.gravity);
    of("effects", &dynamics.effects);
    of("all but the mass matrix together", &dynamics.bias);
    println!();
    Ok(())
}

/// Additions and multiplications, then divisions with roots, then sines with cosines.
fn short(count: &OperationCount) -> String {
    format!(
        "{} ({} / {} sc)",
        count.add + count.mul,
        count.div + count.sqrt,
        count.sincos
    )
}
