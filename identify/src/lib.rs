pub mod derivatives;
pub mod filters;
mod notes;
mod spectrum;
#[cfg(test)]
mod test_noise;
pub use filters::FilterError;
pub use notes::{Note, Severity};
