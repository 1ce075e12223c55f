//! What joints transmit, as a struct of its own.

use modelmill_codegen::{Derivation, ReactionPrograms};
use proc_macro2::{Literal, TokenStream};
use quote::quote;

use super::items::operation_count;
use super::program::{
    ExtraItems, PreparationInputs, ProgramMethod, ProgramStateInputs, ProgramStruct,
    ResultConversion,
};
use crate::tree::NameScope;

/// The struct `Reactions` with its tables.
pub(super) fn reactions(
    derivation: &Derivation,
    scope: &NameScope,
    reactions: &ReactionPrograms,
) -> TokenStream {
    let program = &reactions.program;
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
    let joints = reactions.joints.iter().map(|joint| {
        let (force, moment) = (three(&joint.force), three(&joint.moment));
        quote! { ::modelmill_runtime::Wrench { force: #force, moment: #moment } }
    });
    let loops = reactions.loops.iter().map(|closed| three(&closed.force));
    let made = quote! { ReactionForces { joints: [#(#joints),*], loops: [#(#loops),*] } };
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
        output: Some(quote! { ReactionForces<T> }),
        results: Some(ResultConversion {
            from_type: quote! { [T; #n_outputs] },
            conversion: made,
        }),
    };
    let tables = tables(reactions);
    let owner = ProgramStruct {
        derivation,
        scope,
        name: "Reactions",
        doc: quote! {
            /// What the joints transmit, for one geometry and one set of parameters: all of them, since bearings feel what no
            /// drive feels and base parameters therefore do not hold.
            ///
            /// `None` is what equations of motion do not determine at the model file's geometry, because the mechanism is
            /// held there more often than once, such as a planar loop across its plane.
        },
        prepares: "Prepares the recursion: what does not depend on the state is computed once.",
        is_public: true,
        preparation: PreparationInputs::Parameters,
        functions: vec![function],
        more: ExtraItems::default(),
    };
    let owner = owner.tokens();
    quote! {
        #tables

        /// What the joints transmit at one state.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct ReactionForces<T> {
            /// What each of [`JOINTS`] transmits to the side away from the base, N and N m, drive and friction in it
            /// included: along the axes that the frame's steps reach behind the joint (those of the frame, if nothing
            /// follows), the moment about the origin reached there.
            pub joints: [::modelmill_runtime::Wrench<T>; N_JOINTS],
            /// For each of [`LOOPS`] the force on the side of the first point that it joins, N.
            pub loops: [[Option<T>; 3]; N_LOOPS],
        }

        #owner
    }
}

/// Names of the program's outputs: `F_upper_x`, `M_upper_z`, `F_loop_x`.
fn names(reactions: &ReactionPrograms) -> Vec<String> {
    let mut names = vec![String::new(); reactions.program.outputs.len()];
    let mut name = |letter: &str, of: &str, places: &[Option<usize>; 3]| {
        let of = of.replace(|c: char| !c.is_ascii_alphanumeric(), "_");
        for (place, axis) in places.iter().zip(["x", "y", "z"]) {
            if let Some(name) = place.and_then(|k| names.get_mut(k)) {
                *name = format!("{letter}_{of}_{axis}");
            }
        }
    };
    for joint in &reactions.joints {
        name("F", &joint.name, &joint.force);
        name("M", &joint.name, &joint.moment);
    }
    for closed in &reactions.loops {
        name("F", &closed.name, &closed.force);
    }
    names
}

fn tables(reactions: &ReactionPrograms) -> TokenStream {
    let n_joints = Literal::usize_unsuffixed(reactions.joints.len());
    let n_loops = Literal::usize_unsuffixed(reactions.loops.len());
    let joints = reactions.joints.iter().map(|joint| {
        let (name, coordinates) = (&joint.name, &joint.coordinates);
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
        /// Number of joints whose reactions are told.
        pub const N_JOINTS: usize = #n_joints;
        /// Number of loops whose forces are told.
        pub const N_LOOPS: usize = #n_loops;
        /// Joints, from the base outwards, in the order of [`ReactionForces::joints`].
        pub const JOINTS: [::modelmill_runtime::Joint; N_JOINTS] = [#(#joints),*];
        /// Loops, in the order of [`ReactionForces::loops`].
        pub const LOOPS: [::modelmill_runtime::ClosedLoop; N_LOOPS] = [#(#loops),*];
    }
}
