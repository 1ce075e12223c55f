//! A test of the base parameters that goes with the module.

use modelmill_codegen::Derivation;
use proc_macro2::{Literal, TokenStream};
use quote::quote;

use super::items::{loop_scale, nominal_values};
use super::program::{
    ExtraItems, PreparationInputs, ProgramMethod, ProgramStateInputs, ProgramStruct,
};
use crate::identifier::field_identifier;
use crate::tree::{NameScope, uses_load};

/// The function `self_test`, and the regressor of all products that it needs.
#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
pub(super) fn self_test(derivation: &Derivation, scope: &NameScope) -> TokenStream {
    let mechanism = &derivation.mechanism;
    let products = &derivation.reduction.products;
    let n_products = Literal::usize_unsuffixed(products.len());
    let program = &derivation.programs.full_regressor;
    let function = ProgramMethod {
        program,
        name: "all_columns",
        item: "Columns",
        doc: "H: one row per drive, one column per product of parameters.".to_owned(),
        inputs: ProgramStateInputs::Motion,
        outputs: Vec::new(),
        output: Some(quote! { [[T; N_PRODUCTS]; N_DRIVES] }),
        results: None,
    };
    let owner = ProgramStruct {
        derivation,
        scope,
        name: "AllColumns",
        doc: quote! {
            /// H for all products of parameters, for the self-test.
        },
        prepares: "Prepares what depends on the geometry alone.",
        is_public: false,
        preparation: PreparationInputs::Geometry,
        functions: vec![function],
        more: ExtraItems::default(),
    };
    let owner = owner.tokens();
    let fields: Vec<_> = mechanism
        .parameters
        .iter()
        .map(|p| field_identifier(&p.name))
        .collect();
    let values = products.iter().map(|product| {
        let powers = product.0.iter();
        let factors = powers.flat_map(|(p, n)| {
            let field = &fields[*p];
            (0..*n).map(move |_| quote! { * parameters.#field })
        });
        quote! { 1.0 #(#factors)* }
    });
    let (active, _) = derivation.coordinates();
    let scale = loop_scale(derivation, scope);
    let scaled = scale.as_ref().map(|_| quote! { scale });
    let nominal = nominal_values(derivation, &active, scaled.as_ref());
    let self_test_reach = derivation.self_test_reaches();
    let reach = active.iter().zip(self_test_reach).map(|(i, reach)| {
        let scale = scaled
            .as_ref()
            .filter(|_| mechanism.coordinates[*i].motion.is_length());
        let (scaled, reach) = (
            scale.map(|s| quote! { #s * }),
            Literal::f64_unsuffixed(reach),
        );
        quote! { #scaled #reach }
    });
    // Slides of a small machine are slow, so that no column is lost beside others.
    let units = active.iter().map(|i| {
        let scale = scaled
            .as_ref()
            .filter(|_| mechanism.coordinates[*i].motion.is_length());
        scale.cloned().unwrap_or_else(|| quote! { 1.0 })
    });
    let scale = scale.map(|scale| quote! { let scale = #scale; });
    let load = uses_load(derivation)
        .then(|| quote! { load: ::core::array::from_fn(|_| random.uniform(-50.0, 50.0)), });
    quote! {
        /// Number of products of parameters.
        pub const N_PRODUCTS: usize = #n_products;

        /// Holds the base parameters against all parameters at random states around the nominal pose: H and H_min have
        /// rank [`N_BASE`], and `H p = H_min p_min`.
        ///
        /// Call it in a test of your own: `arm::self_test(&arm::Geometry::default())?;`, and for every other geometry that
        /// you use. It needs room on the stack for the square of the number of products.
        ///
        /// # Errors
        /// What does not hold, in numbers. The rank is smaller at geometries that are special, as with a length of zero
        /// that is none in the model file.
        pub fn self_test(geometry: &Geometry<f64>) -> Result<(), ::modelmill_runtime::SelfTestError> {
            type T = f64;
            #scale
            let nominal: [f64; N_ACTIVE] = [#(#nominal),*];
            let reaches: [f64; N_ACTIVE] = [#(#reach),*];
            let units: [f64; N_ACTIVE] = [#(#units),*];
            let (model, all) = (Model::new(geometry), AllColumns::new(geometry));
            let mut draw = ::modelmill_runtime::Random::new(2);
            #[allow(unused_mut)]
            let mut parameters = Parameters::<f64>::default();
            #(parameters.#fields = draw.perturb(parameters.#fields);)*
            let products = [#(#values),*];
            let base = base_parameters(geometry, &parameters)?;
            let dynamics = InverseDynamics::new(geometry, &base);
            ::modelmill_runtime::self_test::<N_PRODUCTS, N_BASE>(&products, &base, |random, reach, show| {
                let state = State {
                    q: ::core::array::from_fn(|k| nominal[k] + reach * reaches[k] * random.uniform(-1.0, 1.0)),
                    qd: ::core::array::from_fn(|k| units[k] * random.uniform(-2.0, 2.0)),
                    qdd: ::core::array::from_fn(|k| units[k] * random.uniform(-8.0, 8.0)),
                    #load
                };
                let (h, h_min, forces) =
                    (all.all_columns(&state)?, model.regressor(&state)?, dynamics.forces(&state)?);
                for ((h, h_min), force) in h.iter().zip(&h_min).zip(&forces) {
                    show(h, h_min, *force);
                }
                Ok(())
            })
        }

        #owner
    }
}
