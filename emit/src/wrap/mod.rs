//! Crates that make a model available to other languages: the emitted module, an interface for the language, and a
//! manifest.
//!
//! The interface is the only code with `unsafe`; the module next to it is the one that [`super::emit`] writes.
//!
//! Decision: such a crate carries the source of the runtime, so that its folder can be moved anywhere. C passes
//! constants and parameters as arrays with named places, because names of a model file may be keywords there. The
//! header is written here and not by `cbindgen`, which would not see places, units and expressions.

mod c_abi;
mod c_header;
mod functions;
mod python;

pub(super) use c_abi::emit_c;
pub(super) use python::emit_python;

use std::fmt::Write as _;
use std::path::Path;

use modelmill_codegen::{Derivation, DynamicsPrograms, PassivePosition};
use proc_macro2::{Ident, TokenStream};
use quote::{format_ident, quote};

use crate::fingerprint::Fingerprint;
use crate::identifier::{field_identifier, module_identifier};
use crate::language::rust::{doc_lines, emit, print_source};
use crate::language::{EmissionRequest, EmittedFile};
use crate::tree::uses_load;

/// What the interfaces of all languages read of a model.
pub(super) struct LanguageBinding<'a> {
    /// The model.
    pub(super) derivation: &'a Derivation,
    /// The equation of motion, if it is requested.
    pub(super) dynamics: Option<&'a DynamicsPrograms>,
    /// Name of the library and prefix of its functions.
    pub(super) name: String,
    /// Whether the forces of the drives are an input, because an effect depends on them.
    pub(super) load: bool,
    /// Whether the passive coordinates are solved for by Newton's method.
    pub(super) newton: bool,
}

impl<'a> LanguageBinding<'a> {
    /// The model with its library name; a name in `reserved` gets the suffix `_model`.
    pub(super) fn new(source: &EmissionRequest<'a>, reserved: &[&str]) -> Self {
        let derivation = source.derivation;
        // A raw identifier is no name of a file or a C function.
        let module = module_identifier(&derivation.mechanism.name).to_string();
        let mut name = module.trim_start_matches("r#").to_owned();
        if reserved.contains(&name.as_str()) {
            name.push_str("_model");
        }
        Self {
            derivation,
            dynamics: source.dynamics,
            name,
            load: uses_load(derivation),
            newton: matches!(derivation.programs.passive_position, PassivePosition::Newton(_)),
        }
    }

    /// Number of independent coordinates.
    pub(super) fn n_active(&self) -> usize {
        self.derivation.coordinates().0.len()
    }

    /// Number of passive coordinates.
    pub(super) fn n_passive(&self) -> usize {
        self.derivation.coordinates().1.len()
    }

    /// Number of drives.
    pub(super) fn n_drives(&self) -> usize {
        self.derivation.mechanism.drives.len()
    }

    /// Number of base parameters.
    pub(super) fn n_base(&self) -> usize {
        self.derivation.reduction.retained.len()
    }

    /// Names of the constants, in the order of the file.
    pub(super) fn constants(&self) -> Vec<&str> {
        let constants = &self.derivation.mechanism.constants;
        constants.iter().map(|c| c.name.as_str()).collect()
    }

    /// Names of the dynamic parameters, in the order of the file.
    pub(super) fn parameters(&self) -> Vec<&str> {
        let parameters = &self.derivation.mechanism.parameters;
        parameters.iter().map(|p| p.name.as_str()).collect()
    }

    /// The arrays of a state, in order, with their lengths.
    pub(super) fn state_parts(&self) -> Vec<(Ident, usize)> {
        let n = self.n_active();
        let mut parts = vec![("q", n), ("qd", n), ("qdd", n)];
        // Loads are part of the state only if an effect reads them.
        if self.load {
            parts.push(("load", self.n_drives()));
        }
        let parts = parts.into_iter();
        parts.map(|(name, n)| (format_ident!("{name}"), n)).collect()
    }

    /// The emitted module as a file, with the equation of motion if it is requested.
    pub(super) fn emitted_module(&self) -> EmittedFile {
        // Reactions and self-test are not part of interfaces.
        let mut emitted = emit(self.derivation);
        if let Some(dynamics) = self.dynamics {
            emitted = emitted.with_dynamics(self.derivation, dynamics);
        }
        EmittedFile {
            path: "src/model.rs".to_owned(),
            text: emitted.file(),
        }
    }

    /// A function that converts an array to `Geometry` or `Parameters`, and one that returns the default values as an
    /// array.
    pub(super) fn record_functions(function: &str, record: &str, names: &[&str]) -> TokenStream {
        let (from, to) = (format_ident!("{function}"), format_ident!("{function}_values"));
        let record = format_ident!("{record}");
        let n = names.len();
        let fields: Vec<Ident> = names.iter().map(|name| field_identifier(name)).collect();
        // Position k of the array belongs to field k.
        let places = 0..n;
        quote! {
            fn #from(values: &[f64; #n]) -> model::#record<f64> {
                #[allow(unused_mut, reason = "a model may have none of these")]
                let mut record = model::#record::default();
                #(record.#fields = values[#places];)*
                record
            }

            fn #to() -> [f64; #n] {
                #[allow(unused_variables, reason = "a model may have none of these")]
                let record = model::#record::<f64>::default();
                [#(record.#fields),*]
            }
        }
    }
}

/// Adds one fingerprint to the files of a crate, so that files of different models do not compile together: `src/lib.rs`
/// compares itself with `src/model.rs` and, if there is one, with the first line of the header.
pub(super) fn seal_files(mut files: Vec<EmittedFile>) -> Vec<EmittedFile> {
    let fingerprint = Fingerprint::new(files.iter().map(|file| file.text.as_str()));
    let header = files
        .iter()
        .find(|file| Path::new(&file.path).extension().is_some_and(|end| end == "h"));
    let header = header.map(|file| file.path.clone());
    for file in &mut files {
        if file.path == "src/model.rs" {
            _ = write!(
                file.text,
                "\n/// The number of the files that were written together; `src/lib.rs` has the same one.\n\
                 pub const FINGERPRINT: u64 = {fingerprint};\n"
            );
        } else if file.path == "src/lib.rs" {
            file.text.push_str(&comparisons(fingerprint, header.as_deref()));
        } else if Some(&file.path) == header.as_ref() {
            file.text.insert_str(0, &first_line(fingerprint));
        }
    }
    files
}

/// The first line of a header with this fingerprint.
fn first_line(fingerprint: Fingerprint) -> String {
    format!("/* Fingerprint {fingerprint}: src/lib.rs has the same number and compiles with no other header. */\n")
}

/// The items of `src/lib.rs` that stop the compiler when another file has another fingerprint.
fn comparisons(fingerprint: Fingerprint, header: Option<&str>) -> String {
    let mut text = format!(
        "
// Files of different models must not be built together.
const _: () = assert!(
    model::FINGERPRINT == {fingerprint},
    \"src/model.rs and src/lib.rs belong to different models or options; generate the crate again\"
);
"
    );
    if let Some(header) = header {
        let start = first_line(fingerprint);
        // Tools may convert the end of the line, so that it is not compared.
        let start = start.trim_end();
        _ = write!(
            text,
            "
const _: () = assert!(
    begins_with(include_bytes!(\"../{header}\"), b\"{start}\"),
    \"{header} and src/lib.rs belong to different models or options; generate the crate again\"
);

/// Whether bytes begin with others; at compile time.
const fn begins_with(bytes: &[u8], start: &[u8]) -> bool {{
    let mut k = 0;
    while k < start.len() {{
        if k == bytes.len() || bytes[k] != start[k] {{
            return false;
        }}
        k += 1;
    }}
    true
}}
"
        );
    }
    text
}

/// A source file that begins with a documentation comment.
pub(super) fn source_file(path: &str, doc: &str, items: &TokenStream) -> EmittedFile {
    let doc = doc_lines(doc, true);
    EmittedFile {
        path: path.to_owned(),
        text: print_source(&quote! { #doc #items }),
    }
}
