//! Functions over many states: what the runtime's blocks ask of a model, and who calls them.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};

use super::items::uses_load;
use crate::Derivation;

/// A function of one state that is wanted over many.
pub(super) struct Function<'a> {
    pub(super) derivation: &'a Derivation,
    /// Name of the function of one state.
    pub(super) name: &'a str,
    /// The type that has it, and where that holds the model.
    pub(super) owner: &'a str,
    pub(super) model: &'a TokenStream,
    pub(super) n_outputs: usize,
    /// Whether passive coordinates are found by Newton's method first.
    pub(super) newton: bool,
}

/// The struct of many states.
pub(super) fn states(load: bool) -> TokenStream {
    let load = load.then(|| {
        quote! {
            /// Force or torque that each drive carries.
            pub load: [&'a [T]; N_DRIVES],
        }
    });
    quote! {
        /// Motion at many states: one array per coordinate, all of the same length.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct States<'a, T> {
            /// Coordinates.
            pub q: [&'a [T]; N_ACTIVE],
            /// Rates.
            pub qd: [&'a [T]; N_ACTIVE],
            /// Accelerations.
            pub qdd: [&'a [T]; N_ACTIVE],
            #load
        }
    }
}

/// The adapter that the runtime runs, and the methods over many states.
#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
pub(super) fn items(function: &Function<'_>) -> TokenStream {
    let Function { name, owner, .. } = function;
    let program = program(function);
    let adapter = adapter(name);
    let owner = format_ident!("{owner}");
    let inputs = slices(function);
    let [many, parallel, blocks] = ["of_many", "of_many_in_parallel", "in_blocks"]
        .map(|suffix| format_ident!("{name}_{suffix}"));
    let one = format!("[`Self::{name}`]");
    let vectors = format!(
        " {one} at many states, in the widest vectors of the machine if the runtime has its feature `std`."
    );
    let all_cores =
        format!(" [`Self::{many}`] on all cores, if the runtime has its feature `rayon`.");
    let in_blocks =
        format!(" {one} at many states, shown block by block; nothing is kept between blocks.");
    let n_outputs = function.n_outputs;
    // The forces have a row per drive and no columns.
    let matrix = *name != "forces";
    let (layout, parameter, columns) = if matrix {
        (
            " One column of all states after the other: first those of the first drive, one per base parameter.",
            quote! { outputs: &mut [T] },
            quote! { &mut columns_of(outputs, n_states(&#adapter(self), &#inputs)?)? },
        )
    } else {
        (
            " One array per drive, as long as those of the states.",
            quote! { outputs: &mut [&mut [T]; N_DRIVES] },
            quote! { outputs },
        )
    };
    let block_layout = if matrix {
        " Output `d * N_BASE + b` of a block belongs to drive `d` and base parameter `b`."
    } else {
        " Output `d` of a block belongs to drive `d`."
    };
    let ready = quote! {
        self.input.map_err(|reason| BlockError::At { sample: 0, reason })?;
    };
    quote! {
        #program

        impl<T: Blocks> #owner<T> {
            #[doc = #vectors]
            ///
            #[doc = #layout]
            ///
            /// # Errors
            /// Arrays of different lengths; else the first state without an answer, with the results of all before it
            /// in place.
            pub fn #many(&self, states: &States<'_, T>, #parameter) -> Result<(), BlockError> {
                #ready
                fill_columns(&#adapter(self), &#inputs, #columns)
            }

            #[doc = #all_cores]
            ///
            /// # Errors
            /// Arrays of different lengths; else the first state without an answer.
            pub fn #parallel(&self, states: &States<'_, T>, #parameter) -> Result<(), BlockError>
            where
                T: Send + Sync,
            {
                #ready
                fill_columns_in_parallel(&#adapter(self), &#inputs, #columns)
            }

            #[doc = #in_blocks]
            ///
            #[doc = #block_layout]
            ///
            /// # Errors
            /// Arrays of different lengths; else the first state without an answer, after all before it have been shown.
            pub fn #blocks(
                &self,
                states: &States<'_, T>,
                visit: impl FnMut(Block<'_, T::Line, #n_outputs>),
            ) -> Result<(), BlockError> {
                #ready
                visit_blocks(&#adapter(self), &#inputs, visit)
            }
        }
    }
}

fn adapter(name: &str) -> proc_macro2::Ident {
    match name {
        "forces" => format_ident!("ForcesOfMany"),
        "regressor" => format_ident!("RegressorOfMany"),
        _ => format_ident!("OfMany_{name}"),
    }
}

/// The program as the runtime knows it: numbers in a row go in and out.
#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
fn program(function: &Function<'_>) -> TokenStream {
    let Function {
        derivation,
        name,
        owner,
        model,
        n_outputs,
        newton,
    } = function;
    let (adapter, owner, method) = (
        adapter(name),
        format_ident!("{owner}"),
        format_ident!("{name}_program"),
    );
    let names = names(function);
    let n_inputs = names.len();
    let (active, passive) = derivation.coordinates();
    let n = active.len();
    let list = |first: usize, n: usize| (first..first + n).map(|k| quote! { inputs[#k] });
    let [q, qd, qdd] = [0, n, 2 * n].map(|first| {
        let values = list(first, n);
        quote! { [#(#values),*] }
    });
    let mut next = 3 * n;
    let load = uses_load(derivation).then(|| {
        let values = list(next, derivation.mechanism.drives.len());
        next += derivation.mechanism.drives.len();
        quote! { load: [#(#values),*], }
    });
    let passive_of = |array: TokenStream| {
        let values = (next..next + passive.len()).map(|k| quote! { #array[#k] });
        quote! { [#(#values),*] }
    };
    let argument = newton.then(|| {
        let values = passive_of(quote! { inputs });
        quote! { &#values, }
    });
    let complete = newton.then(|| {
        let last = passive_of(quote! { last });
        let last_q = (0..n).map(|k| quote! { last[#k] });
        // Of `self.model`, or of `self`, behind the adapter's reference.
        let model: TokenStream = if model.to_string() == "self" {
            quote! { self.0 }
        } else {
            quote! { (&self.0.model) }
        };
        let set = (0..passive.len()).map(|k| {
            let place = next + k;
            quote! { inputs[#place] = passive[#k]; }
        });
        quote! {
            const COMPLETED: usize = N_PASSIVE;

            fn complete(
                &self,
                inputs: &mut [T; #n_inputs],
                last: Option<&[T; #n_inputs]>,
            ) -> Result<(), PoseError> {
                let q = #q;
                // Followed from the state before, in a straight line; where that fails, from the nominal pose.
                let near = last.and_then(|last| follow(#model, &[#(#last_q),*], &#last, &q).ok());
                let passive = match near {
                    Some(passive) => passive,
                    None => #model.passive_position(&q)?,
                };
                #(#set)*
                Ok(())
            }
        }
    });
    quote! {
        struct #adapter<'a, T>(&'a #owner<T>);

        impl<T: Real> Program<T, #n_inputs, #n_outputs> for #adapter<'_, T> {
            fn names(&self) -> [&'static str; #n_inputs] {
                [#(#names),*]
            }

            #[inline(always)]
            fn run<N: Numbers<Scalar = T>>(
                &self,
                n: &N,
                inputs: &[N::Value; #n_inputs],
                outputs: &mut impl Outputs<N::Value>,
            ) -> Result<(), PoseError> {
                let state = State { q: #q, qd: #qd, qdd: #qdd, #load };
                self.0.#method(n, &state, #argument outputs)
            }

            #complete
        }
    }
}

/// Names of the inputs: of the state, then passive coordinates that are found first.
fn names(function: &Function<'_>) -> Vec<String> {
    let mechanism = &function.derivation.mechanism;
    let (active, passive) = function.derivation.coordinates();
    let name = |i: &usize| mechanism.coordinates[*i].name.clone();
    let mut names = Vec::new();
    for suffix in ["", "_d", "_dd"] {
        names.extend(active.iter().map(|i| format!("{}{suffix}", name(i))));
    }
    if uses_load(function.derivation) {
        names.extend(mechanism.drives.iter().map(|d| d.name.clone()));
    }
    if function.newton {
        names.extend(passive.iter().map(name));
    }
    names
}

/// The slices of `states` in that order; those of passive coordinates are empty.
fn slices(function: &Function<'_>) -> TokenStream {
    let (active, passive) = function.derivation.coordinates();
    let mut slices = Vec::new();
    for field in ["q", "qd", "qdd"] {
        let field = format_ident!("{field}");
        slices.extend((0..active.len()).map(|k| quote! { states.#field[#k] }));
    }
    if uses_load(function.derivation) {
        let n_drives = function.derivation.mechanism.drives.len();
        slices.extend((0..n_drives).map(|k| quote! { states.load[#k] }));
    }
    if function.newton {
        slices.extend(passive.iter().map(|_| quote! { &[] }));
    }
    quote! { [#(#slices),*] }
}
