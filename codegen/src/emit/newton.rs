//! Newton's method on loops that have no closed form: what the runtime asks of a model, and who calls it.

use proc_macro2::TokenStream;
use quote::quote;

use super::body::Body;
use super::functions::{Function, list, rows};
use super::items::{count, input, nominal, scale};
use crate::Derivation;
use crate::expr::Atom;
use crate::programs::PassivePosition;

/// The model's loops and its passive coordinates, where there is no closed form.
pub(super) fn newton(derivation: &Derivation) -> Option<Function> {
    let PassivePosition::Newton(loops) = &derivation.programs.passive_position else {
        return None;
    };
    let (active, passive) = derivation.coordinates();
    let (n, n_active) = (passive.len(), active.len());
    let input = of_pose(derivation);
    let (body, scales) = (
        Body::new(&loops.residual, &input),
        Body::new(&loops.scales, &input),
    );
    let (statements, scale_statements) = (body.state(), scales.state());
    let (values, jacobian) = (list(&body, 0, n), rows(&body, n, n, n));
    let [of_residual, of_passive] = [0, n].map(|first| list(&scales, first, n));
    let of_active = list(&scales, 2 * n, n_active);
    let (n_fixed, fixed) = (body.n_fixed(), body.fixed());
    let (n_scales, fixed_scales) = (scales.n_fixed(), scales.fixed());
    let scale = scale(derivation);
    let of_self = scale.as_ref().map(|_| quote! { self.scale });
    let nominal_active = nominal(derivation, &active, of_self.as_ref());
    let of_model = scale.as_ref().map(|_| quote! { model.scale });
    let nominal_passive = nominal(derivation, &passive, of_model.as_ref());
    let scale_field = scale.as_ref().map(|_| {
        quote! {
            /// How large the loops are beside those of the file, for lengths at the nominal pose.
            scale: T,
        }
    });
    let scale_init = scale.map(|scale| quote! { scale: #scale, });
    let cost = format!(
        " Cost: one evaluation of the loops ({}) with a linear system of {n} unknowns per Newton step,",
        count(&loops.residual)
    );
    let items = quote! {
        impl<T: Real> ::modelmill_runtime::Loops for Model<T> {
            type Number = T;
            type Active = [T; N_ACTIVE];
            type Passive = [T; N_PASSIVE];
            type Matrix = [[T; N_PASSIVE]; N_PASSIVE];

            fn linearise(
                &self,
                q: &[T; N_ACTIVE],
                passive: &[T; N_PASSIVE],
            ) -> ([T; N_PASSIVE], [[T; N_PASSIVE]; N_PASSIVE]) {
                let (n, fixed) = (&One::<T>::new(), &self.residual);
                #statements
                (#values, #jacobian)
            }

            fn scales(&self, q: &[T; N_ACTIVE], passive: &[T; N_PASSIVE]) -> Scales<[T; N_ACTIVE], [T; N_PASSIVE]> {
                let (n, fixed) = (&One::<T>::new(), &self.scales);
                #scale_statements
                Scales { residual: #of_residual, passive: #of_passive, active: #of_active }
            }
        }
    };
    let method = quote! {
        /// Passive coordinates of a pose, in the assembly mode of the nominal pose, followed from there in a straight
        /// line of the independent coordinates.
        ///
        #[doc = #cost]
        /// three to five steps for every half radian from the nominal pose; [`Self::passive_position_near`] saves these.
        ///
        /// # Errors
        /// A pose that is out of reach, or cannot be followed from the nominal one, or is singular, or is no number.
        pub fn passive_position(&self, q: &[T; N_ACTIVE]) -> Result<[T; N_PASSIVE], PoseError> {
            self.input?;
            check_finite(q, &ACTIVE)?;
            follow(self, &self.nominal_active(), &self.nominal?, q)
        }

        /// Passive coordinates of a pose, from those of a pose near by: for control, of the last cycle.
        ///
        #[doc = #cost]
        /// two or three steps for a motion of some hundredths of a radian. If the guess is too far away to be sure of the
        /// assembly mode, the pose is followed from the nominal one, at that cost besides.
        ///
        /// # Errors
        /// As [`Self::passive_position`].
        pub fn passive_position_near(
            &self,
            q: &[T; N_ACTIVE],
            guess: &[T; N_PASSIVE],
        ) -> Result<[T; N_PASSIVE], PoseError> {
            self.input?;
            check_finite(q, &ACTIVE)?;
            correct(self, q, guess).or_else(|_| self.passive_position(q))
        }

        /// Independent coordinates of the nominal pose.
        fn nominal_active(&self) -> [T; N_ACTIVE] {
            [#(#nominal_active),*]
        }
    };
    Some(Function {
        items,
        field: quote! {
            residual: [T; #n_fixed],
            scales: [T; #n_scales],
            /// Passive coordinates of the nominal pose.
            nominal: Result<[T; N_PASSIVE], PoseError>,
            #scale_field
        },
        init: quote! {
            residual: { #fixed },
            scales: { #fixed_scales },
            nominal: Err(PoseError::OutOfReach),
            #scale_init
        },
        finish: quote! { model.nominal = settle(&model, &model.nominal_active(), &[#(#nominal_passive),*]); },
        method,
    })
}

/// How the inputs of a program of the pose alone are written.
fn of_pose(derivation: &Derivation) -> impl Fn(Atom) -> TokenStream {
    let (active, _) = derivation.coordinates();
    let other = input(derivation);
    move |atom| match atom {
        Atom::Coordinate(i) if active.contains(&i) => {
            let k = active.iter().position(|a| *a == i);
            quote! { q[#k] }
        }
        _ => other(atom),
    }
}
