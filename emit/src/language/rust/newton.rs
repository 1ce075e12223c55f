//! Newton's method for loops that have no closed form: the traits of the runtime that a model implements, and the
//! methods that call them.

use modelmill_codegen::{Derivation, PassivePosition};
use proc_macro2::{Literal, TokenStream};
use quote::quote;

use super::items::{loop_scale, nominal_values, operation_count};
use super::program::{ExtraItems, ProgramMethod, ProgramStateInputs};
use crate::tree::NameScope;

/// What a model with such loops has in addition.
pub(super) struct NewtonItems<'a> {
    /// Programs of residual and scales.
    pub(super) functions: Vec<ProgramMethod<'a>>,
    /// Implementations of the runtime's traits.
    pub(super) items: TokenStream,
    /// Fields, their initial values and methods of `Model`.
    pub(super) more: ExtraItems,
}

/// The items of a model whose loops have no closed form; `None` for all others.
#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
pub(super) fn newton<'a>(derivation: &'a Derivation, scope: &NameScope) -> Option<NewtonItems<'a>> {
    let PassivePosition::Newton(loops) = &derivation.programs.passive_position else {
        return None;
    };
    let (active, passive) = derivation.coordinates();
    // Programs of a pose, which only the runtime calls.
    let function = |program, name, item| ProgramMethod {
        program,
        name,
        item,
        doc: String::new(),
        inputs: ProgramStateInputs::Pose,
        outputs: Vec::new(),
        entries: Vec::new(),
        output: None,
        results: None,
    };
    // Residuals with their Jacobian, and scales.
    let functions = vec![
        function(&loops.residual, "gaps", "Gaps"),
        function(&loops.scales, "scales", "LoopScales"),
    ];
    // Nominal lengths in loops are scaled with the geometry.
    let scale = loop_scale(derivation, scope);
    // The scale inside a method, and inside `new`.
    let of_self = scale.as_ref().map(|_| quote! { self.scale });
    let nominal_active = nominal_values(derivation, &active, of_self.as_ref());
    let of_model = scale.as_ref().map(|_| quote! { model.scale });
    let nominal_passive = nominal_values(derivation, &passive, of_model.as_ref());
    // A field only if lengths are in the loops.
    let scale_field = scale.as_ref().map(|_| {
        quote! {
            /// Size of the loops relative to those of the file; it scales lengths of the nominal pose.
            scale: T,
        }
    });
    let scale_init = scale.map(|scale| quote! { scale: #scale, });
    // The entries of an array as expressions.
    let entries = |array: &str, n: usize| -> Vec<TokenStream> {
        let array = quote::format_ident!("{array}");
        (0..n)
            .map(|k| {
                let k = Literal::usize_unsuffixed(k);
                quote! { #array[#k] }
            })
            .collect()
    };
    // A pose is one array: independent coordinates, then passive ones.
    let mut pose = entries("q", active.len());
    pose.extend(entries("passive", passive.len()));
    let n_pose = Literal::usize_unsuffixed(pose.len());
    // The cost of a step, for the documentation of the method.
    let cost = format!(
        " Every step of Newton's method takes one evaluation of the loops ({}) and a linear system of {} unknowns.",
        operation_count(&loops.residual),
        passive.len()
    );
    let items = quote! {
        /// Names of the inputs of a pose. They are empty, because a pose is not checked before the loops are closed.
        const POSE: [&str; #n_pose] = [""; #n_pose];

        /// The values of a pose in one array.
        fn pose<T: Copy>(q: &[T; N_ACTIVE], passive: &[T; N_PASSIVE]) -> [T; #n_pose] {
            [#(#pose),*]
        }

        // What Newton's method evaluates.
        impl<T: Real> Loops for Model<T> {
            type Number = T;
            type Active = [T; N_ACTIVE];
            type Passive = [T; N_PASSIVE];
            type Matrix = [[T; N_PASSIVE]; N_PASSIVE];

            fn linearise(
                &self,
                q: &[T; N_ACTIVE],
                passive: &[T; N_PASSIVE],
            ) -> ([T; N_PASSIVE], [[T; N_PASSIVE]; N_PASSIVE]) {
                let found: Linearisation<T, N_PASSIVE, N_PASSIVE> = run_unchecked(&Gaps(self), pose(q, passive));
                (found.values, found.jacobian)
            }

            fn scales(&self, q: &[T; N_ACTIVE], passive: &[T; N_PASSIVE]) -> Scales<[T; N_ACTIVE], [T; N_PASSIVE]> {
                run_unchecked(&LoopScales(self), pose(q, passive))
            }
        }

        // Where it starts.
        impl<T: Real> Assembly for Model<T> {
            const N_PASSIVE: usize = N_PASSIVE;

            fn nominal_active(&self) -> [T; N_ACTIVE] {
                [#(#nominal_active),*]
            }

            fn nominal_passive(&self) -> Result<[T; N_PASSIVE], PoseError> {
                self.input.and(self.nominal)
            }

            fn names(&self) -> &'static [&'static str] {
                &ACTIVE
            }
        }
    };
    // Methods of the model that make the traits available without importing them.
    let methods = quote! {
        /// Passive coordinates of a pose, in the assembly mode of the nominal pose, followed from there; see
        /// [`Assembly::passive_position`].
        ///
        #[doc = #cost]
        ///
        /// # Errors
        /// A pose that is out of reach, cannot be followed from the nominal pose, is singular, or is NaN.
        pub fn passive_position(&self, q: &[T; N_ACTIVE]) -> Result<[T; N_PASSIVE], PoseError> {
            Assembly::passive_position(self, q)
        }

        /// Passive coordinates of a pose, from those of a nearby pose; see [`Assembly::passive_position_near`].
        ///
        /// # Errors
        /// As [`Self::passive_position`].
        pub fn passive_position_near(
            &self,
            q: &[T; N_ACTIVE],
            guess: &[T; N_PASSIVE],
        ) -> Result<[T; N_PASSIVE], PoseError> {
            Assembly::passive_position_near(self, q, guess)
        }
    };
    Some(NewtonItems {
        functions,
        items,
        more: ExtraItems {
            fields: quote! {
                /// Passive coordinates of the nominal pose.
                nominal: Result<[T; N_PASSIVE], PoseError>,
                #scale_field
            },
            // The solution at the nominal pose needs the other fields, so it is set at the end.
            inits: quote! { nominal: Err(PoseError::OutOfReach), #scale_init },
            finish: quote! { model.nominal = solve_passive(&model, &model.nominal_active(), &[#(#nominal_passive),*]); },
            methods,
        },
    })
}
