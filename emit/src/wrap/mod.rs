//! Crates that bring a model to other languages: the emitted module, a face for the language, and a manifest.
//!
//! The face is the only code with `unsafe`; the module beside it is the one that [`crate::emit`] makes.

mod c_abi;
mod c_header;
mod functions;
mod python;

pub(super) use c_abi::emit_c;
pub(super) use python::emit_python;

use modelmill_codegen::{Derivation, DynamicsPrograms, PassivePosition};
use proc_macro2::{Ident, TokenStream};
use quote::{format_ident, quote};

use crate::identifier::{field_identifier, module_identifier};
use crate::language::rust::{doc_lines, emit, print_source};
use crate::language::{EmissionRequest, EmittedFile};
use crate::tree::uses_load;

/// What faces of all languages need to know of a model.
pub(super) struct LanguageBinding<'a> {
    pub(super) derivation: &'a Derivation,
    /// The equation of motion, if that is wanted.
    pub(super) dynamics: Option<&'a DynamicsPrograms>,
    /// Name of the library and prefix of its functions.
    pub(super) name: String,
    pub(super) load: bool,
    /// Whether passive coordinates are found by Newton's method.
    pub(super) newton: bool,
}

impl<'a> LanguageBinding<'a> {
    /// Names that are `reserved` in the other language get `_model` behind them.
    pub(super) fn new(source: &EmissionRequest<'a>, reserved: &[&str]) -> Self {
        let derivation = source.derivation;
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
            newton: matches!(
                derivation.programs.passive_position,
                PassivePosition::Newton(_)
            ),
        }
    }

    pub(super) fn n_active(&self) -> usize {
        self.derivation.coordinates().0.len()
    }

    pub(super) fn n_passive(&self) -> usize {
        self.derivation.coordinates().1.len()
    }

    pub(super) fn n_drives(&self) -> usize {
        self.derivation.mechanism.drives.len()
    }

    pub(super) fn n_base(&self) -> usize {
        self.derivation.reduction.retained.len()
    }

    pub(super) fn constants(&self) -> Vec<&str> {
        let constants = &self.derivation.mechanism.constants;
        constants.iter().map(|c| c.name.as_str()).collect()
    }

    pub(super) fn parameters(&self) -> Vec<&str> {
        let parameters = &self.derivation.mechanism.parameters;
        parameters.iter().map(|p| p.name.as_str()).collect()
    }

    /// The parts of a state, in order, with how many numbers each has.
    pub(super) fn state_parts(&self) -> Vec<(Ident, usize)> {
        let n = self.n_active();
        let mut parts = vec![("q", n), ("qd", n), ("qdd", n)];
        if self.load {
            parts.push(("load", self.n_drives()));
        }
        let parts = parts.into_iter();
        parts
            .map(|(name, n)| (format_ident!("{name}"), n))
            .collect()
    }

    /// The emitted module as a file.
    pub(super) fn emitted_module(&self) -> EmittedFile {
        let mut emitted = emit(self.derivation);
        if let Some(dynamics) = self.dynamics {
            emitted = emitted.with_dynamics(self.derivation, dynamics);
        }
        EmittedFile {
            path: "src/model.rs".to_owned(),
            text: emitted.file(),
        }
    }

    /// A function that makes `Geometry` or `Parameters` of an array, and its inverse.
    pub(super) fn record_functions(function: &str, record: &str, names: &[&str]) -> TokenStream {
        let (from, to) = (
            format_ident!("{function}"),
            format_ident!("{function}_values"),
        );
        let record = format_ident!("{record}");
        let n = names.len();
        let fields: Vec<Ident> = names.iter().map(|name| field_identifier(name)).collect();
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

/// Source of a file that begins with a comment for its reader.
pub(super) fn source_file(path: &str, doc: &str, items: &TokenStream) -> EmittedFile {
    let doc = doc_lines(doc, true);
    EmittedFile {
        path: path.to_owned(),
        text: print_source(&quote! { #doc #items }),
    }
}
