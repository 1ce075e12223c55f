//! The equation of motion as a struct of its own: mass matrix, velocity terms, gravity, effects, forward dynamics.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};

use super::body::Body;
use super::functions::{Kind, Method, list, reads_passive, rows};
use super::items::{count, input};
use crate::Derivation;
use crate::lower::Program;
use crate::on_request::dynamics::Dynamics;

/// How the result of a program is written.
type Written<'a> = &'a dyn Fn(&Body<'_>) -> TokenStream;

/// The struct `Dynamics`.
pub(super) fn dynamics(derivation: &Derivation, dynamics: &Dynamics) -> TokenStream {
    let n = derivation.coordinates().0.len();
    let n_drives = derivation.mechanism.drives.len();
    let vector = quote! { [T; N_ACTIVE] };
    let matrix = quote! { [[T; N_ACTIVE]; N_ACTIVE] };
    let functions: [(&str, &Program, &str, Written<'_>, &TokenStream); 5] = [
        (
            "mass_matrix",
            &dynamics.mass_matrix,
            "M, by rows: generalised force per acceleration of the independent coordinates. Accelerations of the state are \
             not read.",
            &|body| rows(body, 0, n, n),
            &matrix,
        ),
        (
            "coriolis",
            &dynamics.coriolis,
            "c: generalised forces that rates alone ask for, centrifugal and Coriolis. Accelerations of the state are not \
             read.",
            &|body| list(body, 0, n),
            &vector,
        ),
        (
            "gravity",
            &dynamics.gravity,
            "g: generalised forces that weight alone asks for. Rates and accelerations of the state are not read.",
            &|body| list(body, 0, n),
            &vector,
        ),
        (
            "effects",
            &dynamics.effects,
            "e: generalised forces that effects ask for where the independent coordinates do not accelerate, such as \
             friction and springs. Accelerations of the state are not read.",
            &|body| list(body, 0, n),
            &vector,
        ),
        (
            "bias",
            &dynamics.bias,
            "c + g + e, at a lower cost than one by one. Accelerations of the state are not read.",
            &|body| list(body, 0, n),
            &vector,
        ),
    ];
    let input = input(derivation);
    let needs_model = functions
        .iter()
        .any(|(_, program, ..)| reads_passive(derivation, program));
    let (mut fields, mut inits, mut methods) = (Vec::new(), Vec::new(), Vec::new());
    for (name, program, doc, result, output) in functions {
        let body = Body::new(program, &input);
        let (n_fixed, fixed, field) = (body.n_fixed(), body.fixed(), format_ident!("{name}"));
        fields.push(quote! { #field: [T; #n_fixed], });
        inits.push(quote! { #field: { #fixed }, });
        let method = Method {
            name,
            doc: &format!("{doc} {}.", count(program)),
            program,
            body: &body,
            kind: Kind::Single(result(&body)),
            fixed: quote! { self.#field },
            model: quote! { self.model },
            output: output.clone(),
        };
        methods.push(method.tokens(derivation));
    }
    methods.push(forward(derivation, dynamics, &input, n, n_drives));
    let (model_field, model_init) = if needs_model {
        (
            quote! { model: Model<T>, },
            quote! { model: Model::new(geometry), },
        )
    } else {
        (TokenStream::new(), TokenStream::new())
    };
    quote! {
        /// The equation of motion for one geometry and one set of base parameters,
        /// `J' f = M(q) q'' + c(q, q') + g(q) + e(q, q')` with the forces f of the drives and their Jacobian J.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Dynamics<T> {
            /// What is wrong with the geometry or the base parameters.
            input: Result<(), PoseError>,
            #(#fields)*
            #model_field
        }

        impl<T: Real> Dynamics<T> {
            /// Prepares the equation of motion: what does not depend on the state is computed once.
            pub fn new(geometry: &Geometry<T>, base: &[T; N_BASE]) -> Self {
                let names = BASE_PARAMETERS.map(|parameter| parameter.name);
                let input = geometry.check().and(check_finite(base, &names));
                Self { input, #(#inits)* #model_init }
            }

            #(#methods)*
        }
    }
}

/// Accelerations from forces: a linear system with the mass matrix.
fn forward(
    derivation: &Derivation,
    dynamics: &Dynamics,
    input: &dyn Fn(crate::expr::Atom) -> TokenStream,
    n: usize,
    n_drives: usize,
) -> TokenStream {
    // The Jacobian stands behind the bias in its program.
    let body = Body::new(&dynamics.bias, input);
    let statements = body.state();
    let (bias, jacobian) = (list(&body, 0, n), rows(&body, n, n_drives, n));
    let accelerate = quote! {
        let (n, fixed) = (&One::<T>::new(), &self.bias);
        #statements
        let bias: [T; N_ACTIVE] = #bias;
        let jacobian: [[T; N_ACTIVE]; N_DRIVES] = #jacobian;
        let mut accelerations = bias.map(|x| -x);
        for (row, force) in jacobian.iter().zip(forces) {
            for (sum, slope) in accelerations.iter_mut().zip(row) {
                *sum = *sum + *slope * *force;
            }
        }
        ::modelmill_runtime::solve(&mut matrix, &mut accelerations)?;
        if !accelerations.iter().all(|x| x.is_finite()) {
            return Err(PoseError::Singular);
        }
        Ok(accelerations)
    };
    let doc = quote! {
        /// Forward dynamics: accelerations of the independent coordinates under given forces of the drives.
        ///
        /// Accelerations of the state are not read. Cost: [`Self::mass_matrix`], [`Self::bias`], and a linear system.
        ///
        /// # Errors
        /// A pose out of reach or singular, a mass matrix that is singular, or an input that is no number or too large.
    };
    if !reads_passive(derivation, &dynamics.mass_matrix)
        && !reads_passive(derivation, &dynamics.bias)
    {
        return quote! {
            #doc
            pub fn forward(&self, state: &State<T>, forces: &[T; N_DRIVES]) -> Result<[T; N_ACTIVE], PoseError> {
                let mut matrix = self.mass_matrix(state)?;
                check_finite(forces, &DRIVES)?;
                #accelerate
            }
        };
    }
    let matrix = if reads_passive(derivation, &dynamics.mass_matrix) {
        quote! { self.mass_matrix_at(state, passive)? }
    } else {
        quote! { self.mass_matrix(state)? }
    };
    quote! {
        #doc
        pub fn forward(&self, state: &State<T>, forces: &[T; N_DRIVES]) -> Result<[T; N_ACTIVE], PoseError> {
            self.input?;
            state.check()?;
            self.forward_at(state, forces, &self.model.passive_position(&state.q)?)
        }

        /// The same as [`Self::forward`], with the passive coordinates of a pose near by, such as those of the last step;
        /// they become those of this state.
        ///
        /// # Errors
        /// As [`Self::forward`].
        pub fn forward_near(
            &self,
            state: &State<T>,
            forces: &[T; N_DRIVES],
            passive: &mut [T; N_PASSIVE],
        ) -> Result<[T; N_ACTIVE], PoseError> {
            self.input?;
            state.check()?;
            let found = self.model.passive_position_near(&state.q, passive)?;
            let result = self.forward_at(state, forces, &found)?;
            *passive = found;
            Ok(result)
        }

        fn forward_at(
            &self,
            state: &State<T>,
            forces: &[T; N_DRIVES],
            passive: &[T; N_PASSIVE],
        ) -> Result<[T; N_ACTIVE], PoseError> {
            let mut matrix = #matrix;
            check_finite(forces, &DRIVES)?;
            #accelerate
        }
    }
}
