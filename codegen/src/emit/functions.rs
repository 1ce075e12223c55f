//! The functions of an emitted model: regressor, motion of drives and passive coordinates, inverse dynamics.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};

use super::blocks;
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
    /// What is left to do to a prepared `model`.
    pub(super) finish: TokenStream,
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
    let finishes = functions.iter().map(|f| &f.finish);
    let methods = functions.iter().map(|f| &f.method);
    let prepared = quote! { Self { input: geometry.check(), #(#inits)* } };
    let new = if functions.iter().all(|f| f.finish.is_empty()) {
        prepared
    } else {
        quote! { let mut model = #prepared; #(#finishes)* model }
    };
    quote! {
        #(#items)*

        /// The model for one geometry; what depends on the geometry alone is computed once.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Model<T> {
            /// What is wrong with the geometry.
            input: Result<(), PoseError>,
            #(#fields)*
        }

        impl<T: Real> Default for Model<T> {
            fn default() -> Self {
                Self::new(&Geometry::default())
            }
        }

        impl<T: Real> Model<T> {
            /// Prepares the model of a geometry.
            pub fn new(geometry: &Geometry<T>) -> Self {
                #new
            }

            #(#methods)*
        }
    }
}

/// A function of the state, as methods.
pub(super) struct Method<'a> {
    pub(super) name: &'a str,
    pub(super) doc: &'a str,
    pub(super) program: &'a Program,
    /// The program with its fixed values in `fixed`.
    pub(super) body: &'a Body<'a>,
    pub(super) kind: Kind,
    /// Where the fixed values and the model are.
    pub(super) fixed: TokenStream,
    pub(super) model: TokenStream,
    /// What the result is.
    pub(super) output: TokenStream,
}

/// How the result of a function comes about.
pub(super) enum Kind {
    /// An expression of the program's outputs.
    Single(TokenStream),
    /// An array that begins as zeros; the program is also run over many states.
    Blocks {
        zeros: TokenStream,
        owner: &'static str,
    },
}

impl Method<'_> {
    /// One method; where the passive coordinates are found by Newton's method, a second one that takes a guess.
    pub(super) fn tokens(&self, derivation: &Derivation) -> TokenStream {
        let Self {
            name,
            doc,
            body,
            fixed,
            model,
            output,
            ..
        } = self;
        let (method, program) = (format_ident!("{name}"), format_ident!("{name}_program"));
        let doc = format!(" {doc}");
        let newton = reads_passive(derivation, self.program);
        let passive_parameter = newton.then(|| quote! { passive: &[N::Value; N_PASSIVE], });
        let passive_argument = newton.then(|| quote! { passive, });
        let (compute, program) = match &self.kind {
            Kind::Single(result) => {
                let statements = body.state();
                let compute = quote! {
                    let (n, fixed) = (&One::<T>::new(), &#fixed);
                    #statements
                    Ok(#result)
                };
                (compute, TokenStream::new())
            }
            Kind::Blocks { zeros, .. } => {
                let statements = body.state_with_outputs();
                let compute = quote! {
                    let mut result = #zeros;
                    self.#program(&One::new(), state, #passive_argument &mut result)?;
                    Ok(result)
                };
                let program = quote! {
                    /// The program, for one state or as many as a vector holds; outputs begin as zeros.
                    #[inline(always)]
                    fn #program<N: Numbers<Scalar = T>>(
                        &self,
                        n: &N,
                        state: &State<N::Value>,
                        #passive_parameter
                        outputs: &mut impl Outputs<N::Value>,
                    ) -> Result<(), PoseError> {
                        let fixed = &#fixed;
                        #statements
                        Ok(())
                    }
                };
                (compute, program)
            }
        };
        if !newton {
            return quote! {
                #[doc = #doc]
                ///
                /// # Errors
                /// A pose out of reach or singular, or an input that is no number or too large.
                pub fn #method(&self, state: &State<T>) -> Result<#output, PoseError> {
                    self.input?;
                    state.check()?;
                    #compute
                }

                #program
            };
        }
        let (near, at) = (format_ident!("{name}_near"), format_ident!("{name}_at"));
        let cost = format!(
            " Cost: that of [`{}passive_position`] besides.",
            if model.to_string() == "self" {
                "Self::"
            } else {
                "Model::"
            }
        );
        let cost_near = cost.replace("passive_position", "passive_position_near");
        let same = format!(
            " The same as [`Self::{name}`], with the passive coordinates of a pose near by, such as those of the last \
             cycle; they become those of this state."
        );
        quote! {
            #[doc = #doc]
            ///
            #[doc = #cost]
            ///
            /// # Errors
            /// A pose out of reach or singular, or an input that is no number or too large.
            pub fn #method(&self, state: &State<T>) -> Result<#output, PoseError> {
                self.input?;
                state.check()?;
                self.#at(state, &#model.passive_position(&state.q)?)
            }

            #[doc = #same]
            ///
            #[doc = #cost_near]
            ///
            /// # Errors
            /// A pose out of reach or singular, or an input that is no number or too large.
            pub fn #near(&self, state: &State<T>, passive: &mut [T; N_PASSIVE]) -> Result<#output, PoseError> {
                self.input?;
                state.check()?;
                let found = #model.passive_position_near(&state.q, passive)?;
                let result = self.#at(state, &found)?;
                *passive = found;
                Ok(result)
            }

            fn #at(&self, state: &State<T>, passive: &[T; N_PASSIVE]) -> Result<#output, PoseError> {
                #compute
            }

            #program
        }
    }

    /// The function over many states, as items beside the type that has it.
    fn blocks(&self, derivation: &Derivation) -> TokenStream {
        let Kind::Blocks { owner, .. } = &self.kind else {
            return TokenStream::new();
        };
        let n_outputs = self.program.outputs.len();
        let newton = reads_passive(derivation, self.program);
        blocks::items(&blocks::Function {
            derivation,
            name: self.name,
            owner,
            model: &self.model,
            n_outputs,
            newton,
        })
    }
}

fn regressor(derivation: &Derivation) -> Function {
    let program = &derivation.programs.regressor;
    let input = input(derivation);
    let body = Body::new(program, &input);
    let (n, fixed) = (body.n_fixed(), body.fixed());
    let method = Method {
        name: "regressor",
        doc: &format!(
            "H_min: one row per drive, one column per base parameter. {}.",
            count(program)
        ),
        program,
        body: &body,
        kind: Kind::Blocks {
            zeros: quote! { [[T::from_f64(0.0); N_BASE]; N_DRIVES] },
            owner: "Model",
        },
        fixed: quote! { self.regressor },
        model: quote! { self },
        output: quote! { [[T; N_BASE]; N_DRIVES] },
    };
    Function {
        items: method.blocks(derivation),
        field: quote! { regressor: [T; #n], },
        init: quote! { regressor: { #fixed }, },
        finish: TokenStream::new(),
        method: method.tokens(derivation),
    }
}

fn drives(derivation: &Derivation) -> Function {
    let program = &derivation.programs.drives;
    let input = input(derivation);
    let body = Body::new(program, &input);
    let (n, fixed) = (body.n_fixed(), body.fixed());
    let n_drives = derivation.mechanism.drives.len();
    let n_active = derivation.coordinates().0.len();
    let (lengths, speeds) = (list(&body, 0, n_drives), list(&body, n_drives, n_drives));
    let jacobian = rows(&body, 2 * n_drives, n_drives, n_active);
    let method = Method {
        name: "drives",
        doc: "Lengths or angles of the drives, their rates, and their Jacobian.",
        program,
        body: &body,
        kind: Kind::Single(
            quote! { Drives { coordinate: #lengths, rate: #speeds, jacobian: #jacobian } },
        ),
        fixed: quote! { self.drives },
        model: quote! { self },
        output: quote! { Drives<T> },
    };
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
        finish: TokenStream::new(),
        method: method.tokens(derivation),
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
    let (n, fixed) = (body.n_fixed(), body.fixed());
    let [q, qd, qdd] = [0, 1, 2].map(|k| list(&body, k * n_passive, n_passive));
    let method = Method {
        name: "passive",
        doc: "Passive coordinates with their rates and accelerations.",
        program,
        body: &body,
        kind: Kind::Single(quote! { Passive { q: #q, qd: #qd, qdd: #qdd } }),
        fixed: quote! { self.motion },
        model: quote! { self },
        output: quote! { Passive<T> },
    };
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
        finish: TokenStream::new(),
        method: method.tokens(derivation),
    })
}

/// The struct `InverseDynamics`.
pub(super) fn inverse_dynamics(derivation: &Derivation) -> TokenStream {
    let input = input(derivation);
    let program = &derivation.programs.inverse_dynamics;
    let body = Body::new(program, &input);
    let (n, fixed) = (body.n_fixed(), body.fixed());
    let method = Method {
        name: "forces",
        doc: &format!("Forces of the drives, N or N m. {}.", count(program)),
        program,
        body: &body,
        kind: Kind::Blocks {
            zeros: quote! { [T::from_f64(0.0); N_DRIVES] },
            owner: "InverseDynamics",
        },
        fixed: quote! { self.fixed },
        model: quote! { self.model },
        output: quote! { [T; N_DRIVES] },
    };
    let blocks = method.blocks(derivation);
    let method = method.tokens(derivation);
    let needs_model = reads_passive(derivation, program);
    let model_field = needs_model.then(|| quote! { model: Model<T>, });
    let model_init = needs_model.then(|| quote! { model: Model::new(geometry), });
    quote! {
        /// Inverse dynamics for one geometry and one set of base parameters.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct InverseDynamics<T> {
            /// What is wrong with the geometry or the base parameters.
            input: Result<(), PoseError>,
            fixed: [T; #n],
            #model_field
        }

        impl<T: Real> InverseDynamics<T> {
            /// Prepares the recursion: what does not depend on the state is computed once.
            pub fn new(geometry: &Geometry<T>, base: &[T; N_BASE]) -> Self {
                let names = BASE_PARAMETERS.map(|parameter| parameter.name);
                let input = geometry.check().and(check_finite(base, &names));
                Self { input, fixed: { #fixed }, #model_init }
            }

            #method
        }

        #blocks
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

/// Whether a program needs passive coordinates that Newton's method finds.
pub(super) fn reads_passive(derivation: &Derivation, program: &Program) -> bool {
    let (_, passive) = derivation.coordinates();
    matches!(
        derivation.programs.passive_position,
        PassivePosition::Newton(_)
    ) && program
        .ops
        .iter()
        .any(|op| matches!(op, Op::Input(Atom::Coordinate(i)) if passive.contains(i)))
}
