//! modelmill as a library.

pub mod add;
pub mod along;
pub mod audit;
pub mod compare;
pub mod diagnose;
pub mod error;
pub mod evaluate;
pub mod excite;
pub mod generate;
pub mod host;
pub mod identify;
pub mod import;
pub mod interpret;
pub mod model;
pub mod print;
pub mod progress;
pub mod recording;
pub mod reduce;
pub mod report;
pub mod simulate;
pub mod stretch;
pub mod text;

pub use modelmill_identify::{Note, Severity};
pub use modelmill_spec::edit;

pub use error::{Error, Outcome};
pub use host::Host;
pub use model::Model;
