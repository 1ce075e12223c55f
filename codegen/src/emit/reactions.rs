//! What joints transmit, as a struct of its own.

use proc_macro2::TokenStream;
use quote::quote;

use super::body::Body;
use super::functions::{Kind, Method, reads_passive};
use super::identifier::of_field;
use super::items::{count, input};
use crate::{Derivation, Reactions};

/// The struct `Reactions` with its tables.
pub(super) fn reactions(derivation: &Derivation, reactions: &Reactions) -> TokenStream {
    let input = input(derivation);
    let program = &reactions.program;
    let body = Body::new(program, &input);
    let (n_fixed, fixed) = (body.n_fixed(), body.fixed());
    let three = |places: &[Option<usize>; 3]| {
        let components = places.iter().map(|place| match place {
            Some(k) => {
                let value = body.output(*k);
                quote! { Some(#value) }
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
    let result = quote! { Transmitted { joints: [#(#joints),*], loops: [#(#loops),*] } };
    let model_field = reads_passive(derivation, program).then(|| quote! { model: Model<T>, });
    let model_init =
        reads_passive(derivation, program).then(|| quote! { model: Model::new(geometry), });
    let method = Method {
        name: "transmitted",
        doc: &format!(
            "Forces and moments in all joints, and the forces that close the loops. {}.",
            count(program)
        ),
        program,
        body: &body,
        kind: Kind::Single(result),
        fixed: quote! { self.fixed },
        model: quote! { self.model },
        output: quote! { Transmitted<T> },
    };
    let method = method.tokens(derivation);
    let tables = tables(reactions);
    let parameters = &derivation.mechanism.parameters;
    let names = parameters.iter().map(|p| p.name.as_str());
    let fields = parameters.iter().map(|p| of_field(&p.name));
    quote! {
        #tables

        /// What the joints transmit at one state.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Transmitted<T> {
            /// What each of [`JOINTS`] transmits to the side away from the base, N and N m, drive and friction in it
            /// included: along the axes that the frame's steps reach behind the joint (those of the frame, if nothing
            /// follows), the moment about the origin reached there.
            pub joints: [::modelmill_runtime::Wrench<T>; N_JOINTS],
            /// For each of [`LOOPS`] the force on the side of the first point that it joins, N.
            pub loops: [[Option<T>; 3]; N_LOOPS],
        }

        /// What the joints transmit, for one geometry and one set of parameters: all of them, since bearings feel what no
        /// drive feels and base parameters therefore do not hold.
        ///
        /// `None` is what equations of motion do not determine at the model file's geometry, because the mechanism is
        /// held there more often than once, such as a planar loop across its plane.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Reactions<T> {
            /// What is wrong with the geometry or the parameters.
            input: Result<(), PoseError>,
            fixed: [T; #n_fixed],
            #model_field
        }

        impl<T: Real> Reactions<T> {
            /// Prepares the recursion: what does not depend on the state is computed once.
            pub fn new(geometry: &Geometry<T>, parameters: &Parameters<T>) -> Self {
                let input = geometry
                    .check()
                    .and(check_finite::<T>(&[#(parameters.#fields),*], &[#(#names),*]));
                Self { input, fixed: { #fixed }, #model_init }
            }

            #method
        }
    }
}

fn tables(reactions: &Reactions) -> TokenStream {
    let (n_joints, n_loops) = (reactions.joints.len(), reactions.loops.len());
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
        /// Joints, from the base outwards, in the order of [`Transmitted::joints`].
        pub const JOINTS: [::modelmill_runtime::Joint; N_JOINTS] = [#(#joints),*];
        /// Loops, in the order of [`Transmitted::loops`].
        pub const LOOPS: [::modelmill_runtime::ClosedLoop; N_LOOPS] = [#(#loops),*];
    }
}
