//! The functions of an emitted model: regressor, motion of drives and passive coordinates, inverse dynamics.

use proc_macro2::TokenStream;
use quote::quote;

use super::body::Body;
use super::items::{count, input};
use super::newton::newton;
use crate::Derivation;
use crate::expr::Atom;
use crate::lower::{Op, Program};
use crate::programs::PassivePosition;

/// What one function of the model brings along.
pub(super) struct Function {
    /// Types that it returns.
    pub(super) items: TokenStream,
    /// The field of the model that holds what is fixed.
    pub(super) field: TokenStream,
    /// That field's initialiser, with `geometry` in scope.
    pub(super) init: TokenStream,
    /// The method itself.
    pub(super) method: TokenStream,
}

/// The struct `Model` with everything that needs no parameters.
pub(super) fn model(derivation: &Derivation) -> TokenStream {
    let mut functions = vec![regressor(derivation), drives(derivation)];
    functions.extend(passive(derivation));
    functions.extend(newton(derivation));
    let items = functions.iter().map(|f| &f.items);
    let fields = functions.iter().map(|f| &f.field);
    let inits = functions.iter().map(|f| &f.init);
    let methods = functions.iter().map(|f| &f.method);
    quote! {
        #(#items)*

        /// The model for one geometry; what depends on the geometry alone is computed once.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Model<T> { #(#fields)* }

        impl<T: Real> Default for Model<T> {
            fn default() -> Self {
                Self::new(&Geometry::default())
            }
        }

        impl<T: Real> Model<T> {
            /// Prepares the model of a geometry.
            pub fn new(geometry: &Geometry<T>) -> Self {
                let _ = geometry;
                Self { #(#inits)* }
            }

            #(#methods)*
        }
    }
}

fn regressor(derivation: &Derivation) -> Function {
    let program = &derivation.programs.regressor;
    let input = input(derivation);
    let body = Body::new(program, &input);
    let (n, fixed, state) = (body.n_fixed(), body.fixed(), body.state());
    let needs = passive_needed(derivation, program, &quote! { self });
    let n_drives = derivation.mechanism.drives.len();
    let h = rows(&body, 0, n_drives, derivation.reduction.retained.len());
    let doc = format!(
        " H_min: one row per drive, one column per base parameter. {}.",
        count(program)
    );
    Function {
        items: TokenStream::new(),
        field: quote! { regressor: [T; #n], },
        init: quote! { regressor: { #fixed }, },
        method: quote! {
            #[doc = #doc]
            ///
            /// # Errors
            /// A pose out of reach or singular.
            pub fn regressor(&self, state: &State<T>) -> Result<[[T; N_BASE]; N_DRIVES], PoseError> {
                let fixed = &self.regressor;
                #needs
                #state
                Ok(#h)
            }
        },
    }
}

fn drives(derivation: &Derivation) -> Function {
    let program = &derivation.programs.drives;
    let input = input(derivation);
    let body = Body::new(program, &input);
    let (n, fixed, state) = (body.n_fixed(), body.fixed(), body.state());
    let needs = passive_needed(derivation, program, &quote! { self });
    let n_drives = derivation.mechanism.drives.len();
    let n_active = derivation.coordinates().0.len();
    let (lengths, speeds) = (list(&body, 0, n_drives), list(&body, n_drives, n_drives));
    let jacobian = rows(&body, 2 * n_drives, n_drives, n_active);
    Function {
        items: quote! {
            /// Motion of the drives.
            #[derive(Clone, Copy, Debug, PartialEq)]
            pub struct Drives<T> {
                /// Lengths or angles.
                pub coordinate: [T; N_DRIVES],
                /// Their rates.
                pub rate: [T; N_DRIVES],
                /// Derivatives of the lengths by the independent coordinates.
                pub jacobian: [[T; N_ACTIVE]; N_DRIVES],
            }
        },
        field: quote! { drives: [T; #n], },
        init: quote! { drives: { #fixed }, },
        method: quote! {
            /// Lengths or angles of the drives, their rates, and their Jacobian.
            ///
            /// # Errors
            /// A pose out of reach or singular.
            pub fn drives(&self, state: &State<T>) -> Result<Drives<T>, PoseError> {
                let fixed = &self.drives;
                #needs
                #state
                Ok(Drives { coordinate: #lengths, rate: #speeds, jacobian: #jacobian })
            }
        },
    }
}

fn passive(derivation: &Derivation) -> Option<Function> {
    let n_passive = derivation.coordinates().1.len();
    if n_passive == 0 {
        return None;
    }
    let program = &derivation.programs.passive;
    let input = input(derivation);
    let body = Body::new(program, &input);
    let (n, fixed, state) = (body.n_fixed(), body.fixed(), body.state());
    let needs = passive_needed(derivation, program, &quote! { self });
    let [q, qd, qdd] = [0, 1, 2].map(|k| list(&body, k * n_passive, n_passive));
    Some(Function {
        items: quote! {
            /// Motion of the passive coordinates.
            #[derive(Clone, Copy, Debug, PartialEq)]
            pub struct Passive<T> {
                /// Coordinates.
                pub q: [T; N_PASSIVE],
                /// Rates.
                pub qd: [T; N_PASSIVE],
                /// Accelerations.
                pub qdd: [T; N_PASSIVE],
            }
        },
        field: quote! { motion: [T; #n], },
        init: quote! { motion: { #fixed }, },
        method: quote! {
            /// Passive coordinates with their rates and accelerations.
            ///
            /// # Errors
            /// A pose out of reach or singular.
            pub fn passive(&self, state: &State<T>) -> Result<Passive<T>, PoseError> {
                let fixed = &self.motion;
                #needs
                #state
                Ok(Passive { q: #q, qd: #qd, qdd: #qdd })
            }
        },
    })
}

/// The struct `InverseDynamics`.
pub(super) fn inverse_dynamics(derivation: &Derivation) -> TokenStream {
    let input = input(derivation);
    let program = &derivation.programs.inverse_dynamics;
    let body = Body::new(program, &input);
    let (n, fixed, state) = (body.n_fixed(), body.fixed(), body.state());
    let forces = list(&body, 0, derivation.mechanism.drives.len());
    let needs = passive_needed(derivation, program, &quote! { self.model });
    let doc = format!(" Forces of the drives, N or N m. {}.", count(program));
    let is_newton = matches!(
        derivation.programs.passive_position,
        PassivePosition::Newton { .. }
    );
    let model_field = is_newton.then(|| quote! { model: Model<T>, });
    let model_init = is_newton.then(|| quote! { model: Model::new(geometry), });
    quote! {
        /// Inverse dynamics for one geometry and one set of base parameters.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct InverseDynamics<T> {
            fixed: [T; #n],
            #model_field
        }

        impl<T: Real> InverseDynamics<T> {
            /// Prepares the recursion: what does not depend on the state is computed once.
            pub fn new(geometry: &Geometry<T>, base: &[T; N_BASE]) -> Self {
                let _ = (geometry, base);
                Self { fixed: { #fixed }, #model_init }
            }

            #[doc = #doc]
            ///
            /// # Errors
            /// A pose out of reach or singular.
            pub fn forces(&self, state: &State<T>) -> Result<[T; N_DRIVES], PoseError> {
                let fixed = &self.fixed;
                #needs
                #state
                Ok(#forces)
            }
        }
    }
}

pub(super) fn rows(body: &Body<'_>, first: usize, rows: usize, columns: usize) -> TokenStream {
    let rows = (0..rows).map(|r| {
        let entries = (0..columns).map(|c| body.output(first + r * columns + c));
        quote! { [#(#entries),*] }
    });
    quote! { [#(#rows),*] }
}

pub(super) fn list(body: &Body<'_>, first: usize, n: usize) -> TokenStream {
    let entries = (first..first + n).map(|k| body.output(k));
    quote! { [#(#entries),*] }
}

/// Statements that provide `passive` where a program reads it.
fn passive_needed(derivation: &Derivation, program: &Program, model: &TokenStream) -> TokenStream {
    let (_, passive) = derivation.coordinates();
    let reads = program
        .ops
        .iter()
        .any(|op| matches!(op, Op::Input(Atom::Coordinate(i)) if passive.contains(i)));
    if reads {
        quote! { let passive = #model.passive_position(&state.q)?; }
    } else {
        TokenStream::new()
    }
}
