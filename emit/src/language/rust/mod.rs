//! Rust: a module as tokens, printed by prettyplease. A derivation goes in, source text comes out.
//!
//! The module depends on `modelmill-runtime` alone. It is `no_std`, allocates nothing, contains no unsafe code, and works
//! for `f32` and `f64`.
//!
//! Decision: emitted functions suit real time. They have no loops but Newton's, no branch on the state except for
//! what is refused, and no code that can panic: a test builds libraries without the standard library and looks for
//! traces of a panic.

mod dynamics;
mod functions;
mod items;
mod newton;
mod program;
mod reactions;
mod self_test;
mod statements;

#[cfg(test)]
mod tests;

use modelmill_codegen::{Derivation, DynamicsPrograms, ReactionPrograms};
use proc_macro2::TokenStream;
use quote::quote;

use crate::identifier;
use crate::tree::NameScope;

/// Source of an emitted module, to which further structs can be added.
#[derive(Clone, Debug)]
pub struct EmittedModule {
    /// Name of the module.
    pub name: String,
    /// Documentation of the module, in Markdown.
    pub doc: String,
    /// Names of all values, shared by the structs.
    scope: NameScope,
    /// All items of the module.
    items: TokenStream,
}

/// Writes the module of a derivation: regressor and inverse dynamics.
pub fn emit(derivation: &Derivation) -> EmittedModule {
    // Programs share the part of the pose that they have in common.
    let scope = NameScope::with_pose(derivation);
    EmittedModule {
        name: derivation.mechanism.name.clone(),
        doc: items::module_doc(derivation),
        items: items::items(derivation, &scope),
        scope,
    }
}

/// Writes the module of a derivation together with its equation of motion: mass matrix, forward dynamics and related
/// terms.
pub fn emit_with_dynamics(derivation: &Derivation, dynamics: &DynamicsPrograms) -> EmittedModule {
    emit(derivation).with_dynamics(derivation, dynamics)
}

// Each method adds items that use the names of the same scope.
impl EmittedModule {
    /// The module with the equation of motion of the same derivation.
    #[must_use]
    pub fn with_dynamics(mut self, derivation: &Derivation, dynamics: &DynamicsPrograms) -> Self {
        let items = dynamics::dynamics(derivation, &self.scope, dynamics);
        self.items.extend(items);
        self
    }

    /// The module with a test of its base parameters.
    #[must_use]
    pub fn with_self_test(mut self, derivation: &Derivation) -> Self {
        let items = self_test::self_test(derivation, &self.scope);
        self.items.extend(items);
        self
    }

    /// The module with the reactions of the same derivation.
    #[must_use]
    pub fn with_reactions(mut self, derivation: &Derivation, reactions: &ReactionPrograms) -> Self {
        let items = reactions::reactions(derivation, &self.scope, reactions);
        self.items.extend(items);
        self
    }

    /// The source as a file of its own, to be declared with `mod`.
    pub fn file(&self) -> String {
        // Attributes of a file are inner ones.
        let (doc, lints, items) = (doc_lines(&self.doc, true), lint_attributes(true), &self.items);
        print_source(&quote! { #doc #lints #items })
    }

    /// The source as a `pub mod` that can be included anywhere.
    pub fn module(&self) -> String {
        // Attributes of a module are outer ones.
        let (doc, lints, items) = (doc_lines(&self.doc, false), lint_attributes(false), &self.items);
        let name = identifier::module_identifier(&self.name);
        print_source(&quote! { #doc #lints pub mod #name { #items } })
    }
}

/// The name of the module that is emitted for a model: its own, or a similar one where Rust does not allow that.
pub fn module_name(model: &str) -> String {
    identifier::module_identifier(model).to_string()
}

/// Attributes that allow the lints which emitted code does not follow; `inner` ones belong to the file that they are in.
///
/// The first two lints are about names and numbers of the model file. The others are pedantic ones of clippy, for crates
/// that enable these.
fn lint_attributes(inner: bool) -> TokenStream {
    let mark = inner.then(|| quote! { ! });
    quote! {
        # #mark [allow(non_snake_case, clippy::approx_constant, reason = "names and numbers come from the model file")]
        # #mark [allow(
            unused_imports,
            clippy::wildcard_imports,
            reason = "a model may need no item of the runtime's list"
        )]
        # #mark [allow(
            clippy::similar_names,
            clippy::many_single_char_names,
            clippy::unreadable_literal,
            clippy::too_many_lines,
            clippy::doc_markdown,
            reason = "formulas have the symbols and the digits of their sources"
        )]
        # #mark [allow(
            clippy::inline_always,
            clippy::unnecessary_wraps,
            clippy::unused_self,
            clippy::must_use_candidate,
            clippy::trivially_copy_pass_by_ref,
            reason = "all models have the same functions"
        )]
    }
}

/// Lines of documentation as attributes; `inner` ones belong to the file or module that they are in.
pub(crate) fn doc_lines(doc: &str, inner: bool) -> TokenStream {
    let lines = doc.lines().map(|line| {
        let line = format!(" {line}");
        // A blank after the slashes, as rustfmt has it.
        if inner {
            quote! { #![doc = #line] }
        } else {
            quote! { #[doc = #line] }
        }
    });
    quote! { #(#lines)* }
}

/// The source text of tokens that form a file.
pub(crate) fn print_source(tokens: &TokenStream) -> String {
    let file =
        syn::parse2(tokens.clone()).unwrap_or_else(|error| panic!("emitted tokens do not parse: {error}\n{tokens}"));
    statements::restore_lines(&prettyplease::unparse(&file))
}
