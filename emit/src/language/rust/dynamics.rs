//! The equation of motion as a struct of its own: mass matrix, velocity terms, gravity, effects, forward dynamics.

use modelmill_codegen::{Derivation, DynamicsPrograms};
use proc_macro2::TokenStream;
use quote::quote;

use super::items::operation_count;
use super::program::{
    ExtraItems, PreparationInputs, ProgramMethod, ProgramStateInputs, ProgramStruct,
    ResultConversion,
};
use crate::tree::{NameScope, reads_passive};

/// The struct `Dynamics`.
pub(super) fn dynamics(
    derivation: &Derivation,
    scope: &NameScope,
    dynamics: &DynamicsPrograms,
) -> TokenStream {
    let (active, _) = derivation.coordinates();
    let names = active
        .iter()
        .map(|i| derivation.mechanism.coordinates[*i].name.as_str());
    let names: Vec<&str> = names.collect();
    let of_each = |letter: &str| -> Vec<String> {
        names
            .iter()
            .map(|name| format!("{letter}_{name}"))
            .collect()
    };
    let entries = names
        .iter()
        .flat_map(|a| names.iter().map(move |b| format!("M_{a}_{b}")));
    let mut with_jacobian = of_each("b");
    for drive in &derivation.mechanism.drives {
        with_jacobian.extend(names.iter().map(|a| format!("J_{}_{a}", drive.name)));
    }
    let vector = quote! { [T; N_ACTIVE] };
    let functions = [
        (
            ["mass_matrix", "MassMatrix"],
            &dynamics.mass_matrix,
            "M, by rows: generalised force per acceleration of the independent coordinates. Accelerations of the state are \
             not read.",
            entries.collect(),
            quote! { [[T; N_ACTIVE]; N_ACTIVE] },
        ),
        (
            ["coriolis", "Coriolis"],
            &dynamics.coriolis,
            "c: generalised forces that rates alone ask for, centrifugal and Coriolis. Accelerations of the state are not \
             read.",
            of_each("c"),
            vector.clone(),
        ),
        (
            ["gravity", "Gravity"],
            &dynamics.gravity,
            "g: generalised forces that weight alone asks for. Rates and accelerations of the state are not read.",
            of_each("g"),
            vector.clone(),
        ),
        (
            ["effects", "Effects"],
            &dynamics.effects,
            "e: generalised forces that effects ask for where the independent coordinates do not accelerate, such as \
             friction and springs. Accelerations of the state are not read.",
            of_each("e"),
            vector.clone(),
        ),
        (
            ["bias", "Bias"],
            &dynamics.bias,
            "c + g + e, at a lower cost than one by one. Accelerations of the state are not read.",
            with_jacobian,
            vector,
        ),
    ];
    let functions = functions.map(
        |([name, item], program, doc, outputs, output)| ProgramMethod {
            program,
            name,
            item,
            doc: format!("{doc} {}.", operation_count(program)),
            inputs: ProgramStateInputs::Motion,
            outputs,
            output: Some(output),
            // The Jacobian stands behind the bias in its program.
            results: (name == "bias").then(|| ResultConversion {
                from_type: quote! { Linearisation<T, N_ACTIVE, N_DRIVES> },
                conversion: quote! { found.values },
            }),
        },
    );
    ProgramStruct {
        derivation,
        scope,
        name: "Dynamics",
        doc: quote! {
            /// The equation of motion for one geometry and one set of base parameters,
            /// `J' f = M(q) q'' + c(q, q') + g(q) + e(q, q')` with the forces f of the drives and their Jacobian J.
        },
        prepares: "Prepares the equation of motion: what does not depend on the state is computed once.",
        is_public: true,
        preparation: PreparationInputs::Base,
        functions: functions.into(),
        more: ExtraItems {
            methods: forward_dynamics(derivation, dynamics),
            ..ExtraItems::default()
        },
    }
    .tokens()
}

/// Accelerations from forces: a linear system with the mass matrix.
fn forward_dynamics(derivation: &Derivation, dynamics: &DynamicsPrograms) -> TokenStream {
    let doc = quote! {
        /// Forward dynamics: accelerations of the independent coordinates under given forces of the drives.
        ///
        /// Accelerations of the state are not read. Cost: [`Self::mass_matrix`], [`Self::bias`], and a linear system.
        ///
        /// # Errors
        /// A pose out of reach or singular, a mass matrix that is singular, or an input that is no number or too large.
    };
    let [matrix_reads, bias_reads] =
        [&dynamics.mass_matrix, &dynamics.bias].map(|program| reads_passive(derivation, program));
    if !matrix_reads && !bias_reads {
        return quote! {
            #doc
            pub fn forward(&self, state: &State<T>, forces: &[T; N_DRIVES]) -> Result<[T; N_ACTIVE], PoseError> {
                let matrix = self.mass_matrix(state)?;
                let bias: Linearisation<T, N_ACTIVE, N_DRIVES> = run_checked(&Bias(self), inputs(state))?;
                accelerations(matrix, &bias, forces, &DRIVES)
            }
        };
    }
    let inputs = |reads: bool| {
        if reads {
            quote! { inputs_with_passive(state, passive) }
        } else {
            quote! { inputs(state) }
        }
    };
    let (of_matrix, of_bias) = (inputs(matrix_reads), inputs(bias_reads));
    quote! {
        #doc
        pub fn forward(&self, state: &State<T>, forces: &[T; N_DRIVES]) -> Result<[T; N_ACTIVE], PoseError> {
            self.input?;
            check_finite(&inputs(state), &INPUTS)?;
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
            check_finite(&inputs(state), &INPUTS)?;
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
            let matrix = run_checked(&MassMatrix(self), #of_matrix)?;
            let bias: Linearisation<T, N_ACTIVE, N_DRIVES> = run_checked(&Bias(self), #of_bias)?;
            accelerations(matrix, &bias, forces, &DRIVES)
        }
    }
}
