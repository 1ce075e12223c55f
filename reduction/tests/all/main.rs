//! From a rig and a plan, or from a URDF, to a model file.

mod approximations;
mod attached;
mod budgets;
mod copies;
mod couplings;
mod descriptions;
mod export;
mod extensions;
mod faulty;
mod gaps;
mod left_out;
mod locks;
mod mjcf;
mod order_of_entries;
mod propose;
mod servos;
mod spidermill;
mod urdf;
mod welds;
mod zoo;

use modelmill_boundary::files::MemoryFiles;
use modelmill_boundary::text::Message;
use modelmill_codegen::Derivation;
use modelmill_runtime::RandomBits;

/// The text of a rig with its entries in a random order.
fn shuffled(text: &str, seed: u64) -> String {
    let (head, rest) = text.split_once("\n[[").expect("entries");
    let mut entries: Vec<&str> = rest.split("\n[[").collect();
    let mut draws = RandomBits::new(seed);
    for k in (1..entries.len()).rev() {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "below the number of entries"
        )]
        entries.swap(k, (draws.below_one() * (k + 1) as f64) as usize);
    }
    entries
        .iter()
        .fold(head.to_owned(), |text, entry| text + "\n[[" + entry + "\n")
}

/// The derivation of a model file.
fn derived(text: &str) -> Derivation {
    let loaded = modelmill_spec::load("model.toml", text, &MemoryFiles::default()).expect("a model");
    modelmill_codegen::derive(&loaded.mechanism).expect("a derivation")
}

/// Remarks in the words of the library, a line for each.
fn lines(remarks: &[Message]) -> String {
    Message::join(remarks.iter().cloned(), "\n").in_library_words()
}
