//! From a rig and a plan, or from a URDF, to a model file.

mod approximations;
mod budgets;
mod couplings;
mod descriptions;
mod export;
mod extensions;
mod faulty;
mod locks;
mod mjcf;
mod order_of_entries;
mod propose;
mod spidermill;
mod urdf;
mod welds;
mod zoo;

use modelmill_boundary::text::Message;

/// Remarks in the words of the library, a line for each.
fn lines(remarks: &[Message]) -> String {
    Message::join(remarks.iter().cloned(), "\n").in_library_words()
}
