//! Newton's method on loops that have no closed form: what the runtime asks of a model, and who calls it.

use modelmill_codegen::{Derivation, PassivePosition};
use proc_macro2::{Literal, TokenStream};
use quote::quote;

use super::items::{loop_scale, nominal_values, operation_count};
use super::program::{ExtraItems, ProgramMethod, ProgramStateInputs};
use crate::tree::NameScope;

/// What a model with such loops brings along.
pub(super) struct NewtonItems<'a> {
    pub(super) functions: Vec<ProgramMethod<'a>>,
    pub(super) items: TokenStream,
    pub(super) more: ExtraItems,
}

/// The model's loops and its passive coordinates, where there is no closed form.
#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
pub(super) fn newton<'a>(derivation: &'a Derivation, scope: &NameScope) -> Option<NewtonItems<'a>> {
    let PassivePosition::Newton(loops) = &derivation.programs.passive_position else {
        return None;
    };
    let (active, passive) = derivation.coordinates();
    let function = |program, name, item| ProgramMethod {
        program,
        name,
        item,
        doc: String::new(),
        inputs: ProgramStateInputs::Pose,
        outputs: Vec::new(),
        output: None,
        results: None,
    };
    let functions = vec![
        function(&loops.residual, "gaps", "Gaps"),
        function(&loops.scales, "scales", "LoopScales"),
    ];
    let scale = loop_scale(derivation, scope);
    let of_self = scale.as_ref().map(|_| quote! { self.scale });
    let nominal_active = nominal_values(derivation, &active, of_self.as_ref());
    let of_model = scale.as_ref().map(|_| quote! { model.scale });
    let nominal_passive = nominal_values(derivation, &passive, of_model.as_ref());
    let scale_field = scale.as_ref().map(|_| {
        quote! {
            /// How large the loops are beside those of the file, for lengths at the nominal pose.
            scale: T,
        }
    });
    let scale_init = scale.map(|scale| quote! { scale: #scale, });
    let entries = |array: &str, n: usize| -> Vec<TokenStream> {
        let array = quote::format_ident!("{array}");
        (0..n)
            .map(|k| {
                let k = Literal::usize_unsuffixed(k);
                quote! { #array[#k] }
            })
            .collect()
    };
    let mut pose = entries("q", active.len());
    pose.extend(entries("passive", passive.len()));
    let n_pose = Literal::usize_unsuffixed(pose.len());
    let cost = format!(
        " Every step of Newton's method takes one evaluation of the loops ({}) and a linear system of {} unknowns.",
        operation_count(&loops.residual),
        passive.len()
    );
    let items = quote! {
        /// A pose is not looked at before the loops are closed.
        const POSE: [&str; #n_pose] = [""; #n_pose];

        /// The numbers of a pose in one row.
        fn pose<T: Copy>(q: &[T; N_ACTIVE], passive: &[T; N_PASSIVE]) -> [T; #n_pose] {
            [#(#pose),*]
        }

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
    let methods = quote! {
        /// Passive coordinates of a pose, in the assembly mode of the nominal pose, followed from there; see
        /// [`Assembly::passive_position`].
        ///
        #[doc = #cost]
        ///
        /// # Errors
        /// A pose that is out of reach, or cannot be followed from the nominal one, or is singular, or is no number.
        pub fn passive_position(&self, q: &[T; N_ACTIVE]) -> Result<[T; N_PASSIVE], PoseError> {
            Assembly::passive_position(self, q)
        }

        /// Passive coordinates of a pose, from those of a pose near by; see [`Assembly::passive_position_near`].
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
            inits: quote! { nominal: Err(PoseError::OutOfReach), #scale_init },
            finish: quote! { model.nominal = solve_passive(&model, &model.nominal_active(), &[#(#nominal_passive),*]); },
            methods,
        },
    })
}
