//! The structs `Model` and `InverseDynamics` of an emitted module: regressor, motion of drives and passive coordinates,
//! forces.

use modelmill_codegen::{Derivation, PassivePosition};
use proc_macro2::TokenStream;
use quote::quote;

use super::items::operation_count;
use super::newton::newton;
use super::program::{ExtraItems, PreparationInputs, ProgramMethod, ProgramStateInputs, ProgramStruct};
use crate::tree::{NameScope, matrix_entry_names, reads_passive};

/// The struct `Model`: all programs that need only the geometry.
pub(super) fn model(derivation: &Derivation, scope: &NameScope) -> TokenStream {
    let programs = &derivation.programs;
    let mechanism = &derivation.mechanism;
    let (active, passive) = derivation.coordinates();
    let name = |i: &usize| mechanism.coordinates[*i].name.as_str();
    // H_min.
    let regressor = ProgramMethod {
        program: &programs.regressor,
        name: "regressor",
        item: "Regressor",
        doc: format!(
            "H_min: one row per drive, one column per base parameter. {}.",
            operation_count(&programs.regressor)
        ),
        inputs: ProgramStateInputs::Motion,
        outputs: Vec::new(),
        entries: matrix_entry_names("H", mechanism.drives.len(), derivation.reduction.retained.len()),
        output: Some(quote! { [[T; N_BASE]; N_DRIVES] }),
        results: None,
    };
    // Names of the outputs: `l_left`, `l_left_d`, one per drive.
    let of_drives = |letter: &str, suffix: &str| -> Vec<String> {
        let drives = mechanism.drives.iter();
        drives.map(|d| format!("{letter}_{}{suffix}", d.name)).collect()
    };
    // Lengths, rates, then the Jacobian row by row: the order of the program's outputs.
    let mut of_motion = of_drives("l", "");
    of_motion.extend(of_drives("l", "_d"));
    for drive in &mechanism.drives {
        of_motion.extend(active.iter().map(|a| format!("J_{}_{}", drive.name, name(a))));
    }
    // Kinematics of the drives.
    let drives = ProgramMethod {
        program: &programs.drives,
        name: "drives",
        item: "MotionOfDrives",
        doc: "Lengths or angles of the drives, their rates, and their Jacobian.".to_owned(),
        inputs: ProgramStateInputs::Motion,
        outputs: of_motion,
        entries: Vec::new(),
        output: Some(quote! { Drives<T> }),
        results: None,
    };
    let mut functions = vec![regressor, drives];
    // Only mechanisms with loops have passive coordinates.
    if !passive.is_empty() {
        let motion = ["", "_d", "_dd"].iter();
        let motion = motion.flat_map(|suffix| passive.iter().map(move |p| (p, suffix)));
        functions.push(ProgramMethod {
            program: &programs.passive,
            name: "passive",
            item: "MotionOfPassive",
            doc: "Passive coordinates with their rates and accelerations.".to_owned(),
            inputs: ProgramStateInputs::Motion,
            outputs: motion.map(|(p, suffix)| format!("{}{suffix}", name(p))).collect(),
            entries: Vec::new(),
            output: Some(quote! { Passive<T> }),
            results: None,
        });
    }
    // Loops without closed form add programs, fields and methods.
    let newton = newton(derivation, scope);
    // Many states are evaluated in sequence if each follows from the one before.
    let followed = reads_passive(derivation, &programs.regressor);
    let (newton_items, more) = match newton {
        Some(newton) => {
            functions.extend(newton.functions);
            (newton.items, newton.more)
        }
        None => (TokenStream::new(), ExtraItems::default()),
    };
    // The struct with its methods.
    let owner = ProgramStruct {
        derivation,
        scope,
        name: "Model",
        doc: quote! {
            /// The model for one geometry; values that depend only on the geometry are computed once.
        },
        prepares: "Prepares the model of a geometry.",
        is_public: true,
        preparation: PreparationInputs::Geometry,
        functions,
        more,
    };
    let owner = owner.tokens();
    // The function for many states differs by whether each state follows the one before.
    let of_many = if followed {
        quote! { ::modelmill_runtime::regressor_of_many!(followed); }
    } else {
        quote! { ::modelmill_runtime::regressor_of_many!(); }
    };
    quote! {
        #owner
        impl<T: Real> Default for Model<T> {
            fn default() -> Self {
                Self::new(&Geometry::default())
            }
        }
        #newton_items
        #of_many
    }
}

/// The struct `InverseDynamics`: the forces of the drives for one set of base parameters.
pub(super) fn inverse_dynamics(derivation: &Derivation, scope: &NameScope) -> TokenStream {
    let program = &derivation.programs.inverse_dynamics;
    let drives = derivation.mechanism.drives.iter();
    // The forces as the only method.
    let function = ProgramMethod {
        program,
        name: "forces",
        item: "Forces",
        doc: format!("Forces of the drives, N or N m. {}.", operation_count(program)),
        inputs: ProgramStateInputs::Motion,
        outputs: drives.map(|d| format!("f_{}", d.name)).collect(),
        entries: Vec::new(),
        output: Some(quote! { [T; N_DRIVES] }),
        results: None,
    };
    let owner = ProgramStruct {
        derivation,
        scope,
        name: "InverseDynamics",
        doc: quote! {
            /// Inverse dynamics for one geometry and one set of base parameters.
        },
        prepares: "Prepares the recursion: computes once what does not depend on the state.",
        is_public: true,
        preparation: PreparationInputs::Base,
        functions: vec![function],
        more: ExtraItems::default(),
    };
    let owner = owner.tokens();
    let of_many = if reads_passive(derivation, program) {
        quote! { ::modelmill_runtime::forces_of_many!(followed); }
    } else {
        quote! { ::modelmill_runtime::forces_of_many!(); }
    };
    quote! {
        #owner
        #of_many
    }
}

/// Whether the passive coordinates are solved for by Newton's method.
pub(super) fn is_newton(derivation: &Derivation) -> bool {
    matches!(derivation.programs.passive_position, PassivePosition::Newton(_))
}
