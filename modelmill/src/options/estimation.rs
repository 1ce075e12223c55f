//! The options of the estimation of parameters.

use crate::identify::{EquationWeights, EstimateRefinement, EstimatorOptions};
use crate::options::{ChoiceValue, DeclaredOptions, OptionDeclaration, OptionKind, is_positive};

impl DeclaredOptions for EstimatorOptions {
    const HEADING: &'static str = "Estimation";

    fn declarations() -> &'static [OptionDeclaration<Self>] {
        DECLARATIONS
    }
}

const POSITIVE: &str = "expected a positive number such as 1.345 or 0.2";

const DECLARATIONS: &[OptionDeclaration<EstimatorOptions>] = &[
    OptionDeclaration {
        name: "weights",
        flag: "weights",
        placeholder: "WEIGHTS",
        help: "How equations are weighted",
        excludes: &[],
        kind: OptionKind::Choice {
            values: &[
                ChoiceValue {
                    name: "auto",
                    flag: "auto",
                    help: "`channels` if the drives have different units or if cut-off and decimation are chosen \
                           automatically, else `none`",
                    set: |options| options.weights = EquationWeights::Automatic,
                },
                ChoiceValue {
                    name: "none",
                    flag: "none",
                    help: "Equal weights",
                    set: |options| options.weights = EquationWeights::None,
                },
                ChoiceValue {
                    name: "channels",
                    flag: "channels",
                    help: "Equations of each drive divided by the standard deviation of its residuals, iterated",
                    set: |options| options.weights = EquationWeights::Channels,
                },
                ChoiceValue {
                    name: "variance",
                    flag: "variance",
                    help: "Each equation divided by the standard deviation of its force, from the columns `DRIVE_var`",
                    set: |options| options.weights = EquationWeights::Variance,
                },
            ],
        },
    },
    OptionDeclaration {
        name: "robust",
        flag: "robust",
        placeholder: "BOUND",
        help: "Huber's robust estimate: residuals beyond this many standard deviations (estimated from their median) \
               get a lower weight; 1.345 is usual",
        excludes: &[],
        kind: OptionKind::Number {
            set: |options, bound| options.robust = Some(bound),
            is_valid: is_positive,
            expected: POSITIVE,
            implied: Some("1.345"),
        },
    },
    OptionDeclaration {
        name: "prior",
        flag: "prior",
        placeholder: "SIGMA",
        help: "Nominal values as soft constraints, with this relative standard deviation of each product of parameters",
        excludes: &[],
        kind: OptionKind::Number {
            set: |options, sigma| options.refinement = EstimateRefinement::Prior(sigma),
            is_valid: is_positive,
            expected: POSITIVE,
            implied: None,
        },
    },
    OptionDeclaration {
        name: "physical",
        flag: "physical",
        placeholder: "",
        help: "Allow only physically possible parameters (positive definite pseudo-inertias); what the recordings do \
               not determine is as near to the nominal values as possible. Also returns every physical parameter",
        excludes: &["prior", "essential"],
        kind: OptionKind::Switch {
            set: |options| options.refinement = EstimateRefinement::Physical,
        },
    },
    OptionDeclaration {
        name: "essential",
        flag: "essential",
        placeholder: "",
        help: "Remove base parameters that the recordings do not support, one by one, as long as the residual does \
               not rise significantly (Wald test)",
        excludes: &["prior"],
        kind: OptionKind::Switch {
            set: |options| options.refinement = EstimateRefinement::Essential,
        },
    },
];
