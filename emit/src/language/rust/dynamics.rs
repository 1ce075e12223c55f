//! The struct `Dynamics` of an emitted module, the equation of motion: mass matrix, velocity terms, gravity, effects,
//! forward dynamics.

use modelmill_codegen::{Derivation, DynamicsPrograms};
use proc_macro2::TokenStream;
use quote::quote;

use super::items::operation_count;
use super::program::{
    ExtraItems, PreparationInputs, ProgramMethod, ProgramStateInputs, ProgramStruct, ResultConversion,
};
use crate::tree::{NameScope, reads_passive};

/// The struct `Dynamics` for one geometry and one set of base parameters.
pub(super) fn dynamics(derivation: &Derivation, scope: &NameScope, dynamics: &DynamicsPrograms) -> TokenStream {
    let (active, _) = derivation.coordinates();
    let names = active
        .iter()
        .map(|i| derivation.mechanism.coordinates[*i].name.as_str());
    let names: Vec<&str> = names.collect();
    // Names of outputs: one per coordinate, with a letter in front.
    let of_each = |letter: &str| -> Vec<String> { names.iter().map(|name| format!("{letter}_{name}")).collect() };
    // Entries of the mass matrix, row by row.
    let entries = names
        .iter()
        .flat_map(|a| names.iter().map(move |b| format!("M_{a}_{b}")));
    // The program of the bias also returns the Jacobian, which forward dynamics needs.
    let mut with_jacobian = of_each("b");
    for drive in &derivation.mechanism.drives {
        with_jacobian.extend(names.iter().map(|a| format!("J_{}_{a}", drive.name)));
    }
    let vector = quote! { [T; N_ACTIVE] };
    // Name and struct, program, documentation, names of outputs, and type of each method.
    let functions = [
        (
            ["mass_matrix", "MassMatrix"],
            &dynamics.mass_matrix,
            "M, row by row: generalised force per acceleration of the independent coordinates. Accelerations of the state are \
             not read.",
            entries.collect(),
            quote! { [[T; N_ACTIVE]; N_ACTIVE] },
        ),
        (
            ["coriolis", "Coriolis"],
            &dynamics.coriolis,
            "c: generalised forces that depend on the rates, centrifugal and Coriolis. Accelerations of the state are not \
             read.",
            of_each("c"),
            vector.clone(),
        ),
        (
            ["gravity", "Gravity"],
            &dynamics.gravity,
            "g: generalised forces of gravity. Rates and accelerations of the state are not read.",
            of_each("g"),
            vector.clone(),
        ),
        (
            ["effects", "Effects"],
            &dynamics.effects,
            "e: generalised forces of the effects at zero acceleration of the independent coordinates, such as \
             friction and springs. Accelerations of the state are not read.",
            of_each("e"),
            vector.clone(),
        ),
        (
            ["bias", "Bias"],
            &dynamics.bias,
            "c + g + e, at a lower cost than the three separately. Accelerations of the state are not read.",
            with_jacobian,
            vector,
        ),
    ];
    // The methods with their numbers of operations.
    let functions = functions.map(|([name, item], program, doc, outputs, output)| ProgramMethod {
        program,
        name,
        item,
        doc: format!("{doc} {}.", operation_count(program)),
        inputs: ProgramStateInputs::Motion,
        outputs,
        entries: Vec::new(),
        output: Some(output),
        // The Jacobian follows the bias in the outputs of the program; the method returns only the bias.
        results: (name == "bias").then(|| ResultConversion {
            from_type: quote! { Linearisation<T, N_ACTIVE, N_DRIVES> },
            conversion: quote! { found.values },
        }),
    });
    ProgramStruct {
        derivation,
        scope,
        name: "Dynamics",
        doc: quote! {
            /// The equation of motion for one geometry and one set of base parameters,
            /// `J' f = M(q) q'' + c(q, q') + g(q) + e(q, q')` with the forces f of the drives and their Jacobian J.
        },
        prepares: "Prepares the equation of motion: computes once what does not depend on the state.",
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

/// The method `forward`: solves the equation of motion for the accelerations. It has a form with a guess if loops are
/// followed.
fn forward_dynamics(derivation: &Derivation, dynamics: &DynamicsPrograms) -> TokenStream {
    // Both forms of the method have the same documentation.
    let doc = quote! {
        /// Forward dynamics: accelerations of the independent coordinates under given forces of the drives.
        ///
        /// Accelerations of the state are not read. Cost: [`Self::mass_matrix`], [`Self::bias`], and a linear system.
        ///
        /// # Errors
        /// A pose that is out of reach or singular, a singular mass matrix, or an input that is NaN or too large.
    };
    let [matrix_reads, bias_reads] =
        [&dynamics.mass_matrix, &dynamics.bias].map(|program| reads_passive(derivation, program));
    // Without passive coordinates to solve for, both programs read the state directly.
    if !matrix_reads && !bias_reads {
        return quote! {
            #doc
            pub fn forward(&self, state: &State<T>, forces: &[T; N_DRIVES]) -> Result<[T; N_ACTIVE], PoseError> {
                // The matrix, and the bias together with the Jacobian.
                let matrix = self.mass_matrix(state)?;
                let bias: Linearisation<T, N_ACTIVE, N_DRIVES> = run_checked(&Bias(self), inputs(state))?;
                accelerations(matrix, &bias, forces, &DRIVES)
            }
        };
    }
    // Each of the two programs may or may not read passive coordinates.
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

        /// The same as [`Self::forward`], starting from the passive coordinates of a nearby pose, such as those of the
        /// last step; they are replaced by those of this state.
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
            // The guess changes only if everything succeeds.
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
