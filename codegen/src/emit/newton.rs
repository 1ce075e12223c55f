//! Newton's method on loops that have no closed form.

use proc_macro2::TokenStream;
use quote::quote;

use super::body::Body;
use super::functions::{Function, list, rows};
use super::items::{input, signed};
use crate::Derivation;
use crate::expr::Atom;
use crate::programs::PassivePosition;

/// Newton's method on the loops, where there is no closed form.
#[expect(clippy::too_many_lines, reason = "one template of emitted code")]
pub(super) fn newton(derivation: &Derivation) -> Option<Function> {
    let PassivePosition::Newton { residual } = &derivation.programs.passive_position else {
        return None;
    };
    let (active, passive) = derivation.coordinates();
    let n = passive.len();
    let input = {
        let (active, passive) = (active.clone(), passive.clone());
        let other = input(derivation);
        move |atom: Atom| match atom {
            Atom::Coordinate(i) => match active.iter().position(|a| *a == i) {
                Some(k) => quote! { q[#k] },
                None => {
                    let k = passive
                        .iter()
                        .position(|p| *p == i)
                        .expect("a coordinate is active or passive");
                    quote! { passive[#k] }
                }
            },
            _ => other(atom),
        }
    };
    let body = Body::new(residual, &input);
    let statements = body.state();
    let (values, jacobian) = (list(&body, 0, n), rows(&body, n, n, n));
    let nominal = |indices: &[usize]| -> Vec<TokenStream> {
        indices
            .iter()
            .map(|i| signed(derivation.mechanism.coordinates[*i].nominal))
            .collect()
    };
    let (nominal_active, nominal_passive) = (nominal(&active), nominal(&passive));
    let (n_fixed, fixed) = (body.n_fixed(), body.fixed());
    let method = quote! {
        /// Passive coordinates of a pose, in the assembly mode of the nominal pose, followed from there in small steps.
        ///
        /// # Errors
        /// A pose out of reach or singular.
        pub fn passive_position(&self, q: &[T; N_ACTIVE]) -> Result<[T; N_PASSIVE], PoseError> {
            let nominal: [T; N_ACTIVE] = [#(T::from_f64(#nominal_active)),*];
            self.passive_position_from(&nominal, [#(T::from_f64(#nominal_passive)),*], q)
        }

        /// Passive coordinates of a pose, followed from a known pose near by: for control, the one of the last cycle.
        ///
        /// # Errors
        /// A pose out of reach or singular.
        pub fn passive_position_from(
            &self,
            from: &[T; N_ACTIVE],
            mut passive: [T; N_PASSIVE],
            to: &[T; N_ACTIVE],
        ) -> Result<[T; N_PASSIVE], PoseError> {
            let mut steps = 1_u32;
            let mut reach = T::from_f64(0.1);
            let mut far = T::from_f64(0.0);
            for (a, b) in from.iter().zip(to) {
                let distance = (*b - *a).abs();
                if distance > far {
                    far = distance;
                }
            }
            while far > reach && steps < 1000 {
                steps += 1;
                reach = reach + T::from_f64(0.1);
            }
            for step in 1..=steps {
                let share = T::from_f64(f64::from(step) / f64::from(steps));
                let mut q = *to;
                for k in 0..N_ACTIVE {
                    q[k] = from[k] + share * (to[k] - from[k]);
                }
                passive = self.close(&q, passive)?;
            }
            Ok(passive)
        }

        fn close(&self, q: &[T; N_ACTIVE], mut passive: [T; N_PASSIVE]) -> Result<[T; N_PASSIVE], PoseError> {
            let mut smallest = T::from_f64(1e30);
            for _ in 0..40 {
                let (residual, jacobian) = self.loops(q, &passive);
                let step = ::modelmill_runtime::solve(jacobian, residual)?;
                let mut size = T::from_f64(0.0);
                for k in 0..N_PASSIVE {
                    let most = T::from_f64(0.5);
                    let bounded = if step[k] > most { most } else if step[k] < -most { -most } else { step[k] };
                    passive[k] = passive[k] - bounded;
                    size = size + step[k].abs();
                }
                if !(size < T::from_f64(1e30)) {
                    return Err(PoseError::Singular);
                }
                // Rounding ends the convergence: the steps stop shrinking once they are tiny.
                if size < T::from_f64(1e-3) && !(size < smallest * T::from_f64(0.5)) || !(size > T::from_f64(1e-14)) {
                    return Ok(passive);
                }
                smallest = size;
            }
            Err(PoseError::OutOfReach)
        }

        /// Residuals of the loops and their Jacobian by the passive coordinates.
        fn loops(&self, q: &[T; N_ACTIVE], passive: &[T; N_PASSIVE]) -> ([T; N_PASSIVE], [[T; N_PASSIVE]; N_PASSIVE]) {
            let fixed = &self.residual;
            #statements
            (#values, #jacobian)
        }
    };
    Some(Function {
        items: TokenStream::new(),
        field: quote! { residual: [T; #n_fixed], },
        init: quote! { residual: { #fixed }, },
        method,
    })
}
