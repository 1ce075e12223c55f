//! The function `self_test` of an emitted module, which compares base parameters with all parameters at random states.

use modelmill_codegen::Derivation;

use proc_macro2::{Literal, TokenStream};
use quote::quote;

use super::items::{loop_scale, nominal_values};
use super::program::{ExtraItems, PreparationInputs, ProgramMethod, ProgramStateInputs, ProgramStruct};
use crate::identifier::field_identifier;
use crate::tree::{NameScope, matrix_entry_names, uses_load};

/// The function `self_test`, and the struct with the regressor H for all products.
#[allow(clippy::too_many_lines, reason = "one text from top to bottom")]
pub(super) fn self_test(derivation: &Derivation, scope: &NameScope) -> TokenStream {
    let mechanism = &derivation.mechanism;
    let products = &derivation.reduction.products;
    let n_products = Literal::usize_unsuffixed(products.len());
    let program = &derivation.programs.full_regressor;
    // H for all products is not part of the model, so it has a struct of its own.
    let function = ProgramMethod {
        program,
        name: "all_columns",
        item: "Columns",
        doc: "H: one row per drive, one column per product of parameters.".to_owned(),
        inputs: ProgramStateInputs::Motion,
        outputs: Vec::new(),
        entries: matrix_entry_names("H", mechanism.drives.len(), products.len()),
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
        prepares: "Computes once what depends only on the geometry.",
        is_public: false,
        preparation: PreparationInputs::Geometry,
        functions: vec![function],
        more: ExtraItems::default(),
    };
    let owner = owner.tokens();
    // Names of the parameters in the struct.
    let fields: Vec<_> = mechanism.parameters.iter().map(|p| field_identifier(&p.name)).collect();
    // Values of the products p_g.
    let values = products.iter().map(|product| {
        let powers = product.0.iter();
        let factors = powers.flat_map(|(p, n)| {
            let field = &fields[*p];
            (0..*n).map(move |_| quote! { * parameters.#field })
        });
        quote! { 1.0 #(#factors)* }
    });
    let (active, _) = derivation.coordinates();
    // Lengths are scaled with the geometry, so that the states stay near the nominal pose of a larger machine.
    let has_length = active.iter().any(|i| mechanism.coordinates[*i].motion.is_length());
    let scale = loop_scale(derivation, scope).filter(|_| has_length);
    let scaled = scale.as_ref().map(|_| quote! { scale });
    let nominal = nominal_values(derivation, &active, scaled.as_ref());
    // Range of each coordinate around its nominal value.
    let self_test_reach = derivation.self_test_reaches();
    let reach = active.iter().zip(self_test_reach).map(|(i, reach)| {
        let scale = scaled.as_ref().filter(|_| mechanism.coordinates[*i].motion.is_length());
        let (scaled, reach) = (scale.map(|s| quote! { #s * }), Literal::f64_unsuffixed(reach));
        quote! { #scaled #reach }
    });
    // Rates of lengths are scaled too, so that the columns of a small machine keep comparable sizes.
    let units = active.iter().map(|i| {
        let scale = scaled.as_ref().filter(|_| mechanism.coordinates[*i].motion.is_length());
        scale.cloned().unwrap_or_else(|| quote! { 1.0 })
    });
    let scale = scale.map(|scale| quote! { let scale = #scale; });
    // Random loads if an effect depends on them.
    let load = uses_load(derivation).then(|| quote! { load: ::core::array::from_fn(|_| random.uniform(-50.0, 50.0)), });
    quote! {
        /// Number of products of parameters.
        pub const N_PRODUCTS: usize = #n_products;

        /// Compares the base parameters with all parameters at random states around the nominal pose: H and H_min must
        /// have rank [`N_BASE`], and `H p` must equal `H_min p_min`.
        ///
        /// Call it in a test of your own: `arm::self_test(&arm::Geometry::default())?;`, and for every other geometry
        /// that you use. It needs stack memory for the square of the number of products.
        ///
        /// # Errors
        /// The condition that fails, with numbers. The rank is smaller at special geometries, for example if a length
        /// is zero that is not zero in the model file.
        pub fn self_test(geometry: &Geometry<f64>) -> Result<(), ::modelmill_runtime::SelfTestError> {
            // Expressions of the scale are written for a number `T`.
            type T = f64;
            #scale
            let nominal: [f64; N_ACTIVE] = [#(#nominal),*];
            let reaches: [f64; N_ACTIVE] = [#(#reach),*];
            let units: [f64; N_ACTIVE] = [#(#units),*];
            // Both regressors for the same geometry.
            let (model, all) = (Model::new(geometry), AllColumns::new(geometry));
            let mut draw = ::modelmill_runtime::Random::new(2);
            #[allow(unused_mut)]
            let mut parameters = Parameters::<f64>::default();
            #(parameters.#fields = draw.perturb(parameters.#fields);)*
            // p_g and p_min from the same parameters.
            let products = [#(#values),*];
            let base = base_parameters(geometry, &parameters)?;
            let dynamics = InverseDynamics::new(geometry, &base);
            // The runtime draws states and compares ranks and forces.
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
