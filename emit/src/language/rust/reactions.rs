//! The struct `Reactions` of an emitted module: forces and moments that joints and loops transmit.

use modelmill_codegen::{Derivation, ReactionPrograms};
use proc_macro2::{Literal, TokenStream};
use quote::quote;

use super::items::operation_count;
use super::program::{
    ExtraItems, PreparationInputs, ProgramMethod, ProgramStateInputs, ProgramStruct, ResultConversion,
};
use crate::tree::NameScope;

/// The struct `Reactions`, its result type and its tables of joints and loops.
pub(super) fn reactions(derivation: &Derivation, scope: &NameScope, reactions: &ReactionPrograms) -> TokenStream {
    let program = &reactions.program;
    // Components of a vector; those that are not determined are `None`.
    let three = |places: &[Option<usize>; 3]| {
        let components = places.iter().map(|place| match place {
            Some(k) => {
                let k = Literal::usize_unsuffixed(*k);
                quote! { Some(found[#k]) }
            }
            None => quote! { None },
        });
        quote! { [#(#components),*] }
    };
    // One wrench per joint, one force per loop.
    let joints = reactions.joints.iter().map(|joint| {
        let (force, moment) = (three(&joint.force), three(&joint.moment));
        quote! { ::modelmill_runtime::Wrench { force: #force, moment: #moment } }
    });
    let loops = reactions.loops.iter().map(|closed| three(&closed.force));
    let made = quote! { ReactionForces { joints: [#(#joints),*], loops: [#(#loops),*] } };
    // The program returns one array, which the method sorts into joints and loops.
    let n_outputs = Literal::usize_unsuffixed(program.outputs.len());
    let function = ProgramMethod {
        program,
        name: "transmitted",
        item: "Wrenches",
        doc: format!(
            "Forces and moments in all joints, and the forces that close the loops. {}.",
            operation_count(program)
        ),
        inputs: ProgramStateInputs::Motion,
        outputs: names(reactions),
        entries: Vec::new(),
        output: Some(quote! { ReactionForces<T> }),
        results: Some(ResultConversion {
            from_type: quote! { [T; #n_outputs] },
            conversion: made,
        }),
    };
    // Names, axes and counts as constants.
    let tables = tables(reactions);
    let owner = ProgramStruct {
        derivation,
        scope,
        name: "Reactions",
        doc: quote! {
            /// Forces and moments that the joints transmit, for one geometry and one set of parameters. All parameters
            /// are needed: bearings carry loads that no drive carries, and that base parameters therefore do not
            /// contain.
            ///
            /// `None` is a component that the equations of motion do not determine at the model file's geometry,
            /// because the mechanism is statically indeterminate there, such as a planar loop across its plane.
        },
        prepares: "Prepares the recursion: computes once what does not depend on the state.",
        is_public: true,
        preparation: PreparationInputs::Parameters,
        functions: vec![function],
        more: ExtraItems::default(),
    };
    let owner = owner.tokens();
    quote! {
        #tables

        /// Forces and moments that the joints transmit at one state.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct ReactionForces<T> {
            /// Force and moment that each of [`JOINTS`] transmits to the side away from the base, N and N m, including
            /// its drive and friction. They are in the axes that the frame's steps reach after the joint (those of the
            /// frame, if no step follows); the moment is about the origin reached there.
            pub joints: [::modelmill_runtime::Wrench<T>; N_JOINTS],
            /// For each of [`LOOPS`] the force on the side of its first point, N.
            pub loops: [[Option<T>; 3]; N_LOOPS],
        }

        #owner
    }
}

/// Names of the program's outputs: `F_upper_x`, `M_upper_z`, `F_loop_x`.
fn names(reactions: &ReactionPrograms) -> Vec<String> {
    let mut names = vec![String::new(); reactions.program.outputs.len()];
    let mut name = |letter: &str, of: &str, places: &[Option<usize>; 3]| {
        // Names of joints may have characters that a variable cannot have.
        let of = of.replace(|c: char| !c.is_ascii_alphanumeric(), "_");
        for (place, axis) in places.iter().zip(["x", "y", "z"]) {
            if let Some(name) = place.and_then(|k| names.get_mut(k)) {
                *name = format!("{letter}_{of}_{axis}");
            }
        }
    };
    // Force and moment of each joint.
    for joint in &reactions.joints {
        name("F", &joint.name, &joint.force);
        name("M", &joint.name, &joint.moment);
    }
    // The force of each loop.
    for closed in &reactions.loops {
        name("F", &closed.name, &closed.force);
    }
    names
}

/// Constants of the module: names, coordinates and axes of joints and loops.
fn tables(reactions: &ReactionPrograms) -> TokenStream {
    let n_joints = Literal::usize_unsuffixed(reactions.joints.len());
    let n_loops = Literal::usize_unsuffixed(reactions.loops.len());
    let joints = reactions.joints.iter().map(|joint| {
        let (name, coordinates) = (&joint.name, &joint.coordinates);
        // The axis of the joint as a letter.
        let axis = ['x', 'y', 'z'][joint.axis as usize];
        quote! {
            ::modelmill_runtime::Joint { name: #name, coordinates: &[#(#coordinates),*], axis: #axis }
        }
    });
    let loops = reactions.loops.iter().map(|closed| {
        let (name, axes) = (&closed.name, &closed.axes);
        quote! { ::modelmill_runtime::ClosedLoop { name: #name, axes: #axes } }
    });
    quote! {
        /// Number of joints whose reactions are computed.
        pub const N_JOINTS: usize = #n_joints;
        /// Number of loops whose forces are computed.
        pub const N_LOOPS: usize = #n_loops;
        /// Joints, from the base outwards, in the order of [`ReactionForces::joints`].
        pub const JOINTS: [::modelmill_runtime::Joint; N_JOINTS] = [#(#joints),*];
        /// Loops, in the order of [`ReactionForces::loops`].
        pub const LOOPS: [::modelmill_runtime::ClosedLoop; N_LOOPS] = [#(#loops),*];
    }
}
