//! The list of languages, those of crates around the Rust module included.

use super::language::{C99, EmittedFile, Form, Language, RustModule, Source};
use super::wrap::{emit_c, emit_python};

/// All languages; the first is taken where none is named.
pub const LANGUAGES: [&dyn Language; 4] = [&RustModule, &C99, &CCrate, &PythonCrate];

/// A crate around the Rust module that makes a C library.
struct CCrate;

impl Language for CCrate {
    fn name(&self) -> &'static str {
        "c"
    }

    fn about(&self) -> &'static str {
        "A static and a shared library, and a header"
    }

    fn form(&self) -> Form {
        Form::Crate {
            makes: "a C library and its header: build it there with `cargo build --release`",
        }
    }

    fn has_all(&self) -> bool {
        false
    }

    fn write(&self, source: &Source<'_>) -> Vec<EmittedFile> {
        emit_c(source)
    }
}

/// A crate around the Rust module that makes a Python module.
struct PythonCrate;

impl Language for PythonCrate {
    fn name(&self) -> &'static str {
        "python"
    }

    fn about(&self) -> &'static str {
        "A module for numpy arrays"
    }

    fn form(&self) -> Form {
        Form::Crate {
            makes: "a Python module: build it there with `maturin build --release`, or `cargo build --release`",
        }
    }

    fn has_all(&self) -> bool {
        false
    }

    fn write(&self, source: &Source<'_>) -> Vec<EmittedFile> {
        emit_python(source)
    }
}
