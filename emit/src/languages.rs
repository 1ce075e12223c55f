//! The list of output languages, including crates that wrap the Rust module.

use super::language::{C99Sources, EmissionRequest, EmittedFile, JuliaFile, OutputForm, OutputLanguage, RustModule};
use super::wrap::{emit_c, emit_python};

/// All languages; the first is the default.
pub const LANGUAGES: [&dyn OutputLanguage; 5] = [&RustModule, &C99Sources, &CCrate, &PythonCrate, &JuliaFile];

/// A crate that wraps the Rust module in a C library.
struct CCrate;

impl OutputLanguage for CCrate {
    fn name(&self) -> &'static str {
        "c"
    }

    fn description(&self) -> &'static str {
        "A static and a shared library, and a header"
    }

    fn output_form(&self) -> OutputForm {
        OutputForm::Crate {
            makes: "a C library and its header: build it there with `cargo build --release`",
        }
    }

    // The header declares neither.
    fn has_reactions_and_self_test(&self) -> bool {
        false
    }

    fn emit_files(&self, source: &EmissionRequest<'_>) -> Vec<EmittedFile> {
        emit_c(source)
    }
}

/// A crate that wraps the Rust module in a Python module.
struct PythonCrate;

impl OutputLanguage for PythonCrate {
    fn name(&self) -> &'static str {
        "python"
    }

    fn description(&self) -> &'static str {
        "A module for numpy arrays"
    }

    fn output_form(&self) -> OutputForm {
        OutputForm::Crate {
            makes: "a Python module: build it there with `maturin build --release`, or `cargo build --release`",
        }
    }

    fn has_reactions_and_self_test(&self) -> bool {
        false
    }

    fn emit_files(&self, source: &EmissionRequest<'_>) -> Vec<EmittedFile> {
        emit_python(source)
    }
}
