//! The equations as data, in the form that `modelmill equations --format json` prints.

#[cfg(any(test, feature = "json"))]
use serde::{Serialize, Serializer, ser::SerializeMap};

use super::base_parameters::{base_expression, factor_text};
use super::rank::NumericRank;
use crate::reduce::base::base_parameter_name as base_name;
use crate::{BaseReduction, Derivation, OperationCount, ProgramStage, ReductionMethod};

/// The reduction of a model in texts and counts: products, dependencies, base parameters.
#[derive(Clone, Debug)]
#[cfg_attr(any(test, feature = "json"), derive(Serialize))]
pub struct ReducedEquations {
    /// Name of the model, as its file calls it.
    pub model: String,
    /// p_g, eq. (5), in order.
    pub parameters: Vec<String>,
    /// Products whose column vanishes.
    pub without_effect: Vec<String>,
    /// Eq. (6); products without effect come last, with nothing on the right.
    pub dependencies: Vec<DependencyLine>,
    /// Sums that base parameters refer to, each after those that it needs; none unless base parameters that are written out
    /// would be too long to read.
    #[cfg_attr(
        any(test, feature = "json"),
        serde(serialize_with = "as_map", skip_serializing_if = "Vec::is_empty")
    )]
    pub sums: Vec<(String, String)>,
    /// Eq. (16).
    pub base: Vec<BaseParameterLine>,
    /// How many base parameters there are.
    pub rank: RankSummary,
    /// Operations per state.
    pub operations: ProgramOperations,
}

/// One line of eq. (6): a column as a combination of retained ones.
#[derive(Clone, Debug)]
#[cfg_attr(any(test, feature = "json"), derive(Serialize))]
pub struct DependencyLine {
    /// The product whose column it is.
    pub parameter: String,
    /// Products and their factors: retained ones, and dependent ones, which stand for their own combinations.
    #[cfg_attr(any(test, feature = "json"), serde(serialize_with = "as_map"))]
    pub equals: Vec<(String, String)>,
}

/// One line of eq. (16).
#[derive(Clone, Debug)]
#[cfg_attr(any(test, feature = "json"), derive(Serialize))]
pub struct BaseParameterLine {
    /// `p1_min`, `p2_min`, ...
    pub name: String,
    /// The product whose column is retained.
    pub retained: String,
    /// The base parameter as expanded infix text.
    pub expression: String,
}

/// Ranks of the regressor: exact and numeric.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(any(test, feature = "json"), derive(Serialize))]
pub struct RankSummary {
    /// By exact reduction, valid for generic geometry; `None` where columns were reduced numerically.
    pub exact: Option<usize>,
    /// Numeric rank of eq. (9), the regressors stacked over random states, on the file's values.
    pub numeric: Option<usize>,
    /// Number of random states in eq. (9).
    pub samples: Option<usize>,
    /// The method, where columns were reduced numerically.
    #[cfg_attr(any(test, feature = "json"), serde(skip_serializing_if = "Option::is_none"))]
    pub method: Option<NumericMethod>,
}

/// A reduction on the file's values, in floating point.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(any(test, feature = "json"), derive(Serialize))]
pub struct NumericMethod {
    /// Always `numeric`.
    pub name: &'static str,
    /// How many columns are retained.
    pub rank: usize,
    /// Why columns could not be reduced in symbols.
    pub because: String,
    /// Smallest residual of a retained column in the span of the others, relative to its size.
    pub least_kept: f64,
    /// Largest such residual of a dependent column.
    pub most_dropped: f64,
    /// Largest residual of eq. (6) for a dependent column at further states, relative to the size of its terms.
    pub residual: f64,
    /// Largest change of a constant, in rad or relative to its size, with which loops close that have more equations
    /// than needed.
    #[cfg_attr(any(test, feature = "json"), serde(skip_serializing_if = "Option::is_none"))]
    pub constant_change: Option<f64>,
}

impl NumericMethod {
    /// The method of a reduction, if it is numeric.
    pub fn from_reduction(reduction: &BaseReduction) -> Option<Self> {
        let ReductionMethod::Numeric {
            least_kept,
            most_dropped,
            residual,
            constant_change,
            because,
        } = &reduction.method
        else {
            return None;
        };
        Some(Self {
            name: "numeric",
            rank: reduction.retained.len(),
            because: because.to_string(),
            least_kept: *least_kept,
            most_dropped: *most_dropped,
            residual: *residual,
            constant_change: *constant_change,
        })
    }
}

/// Operation counts per state.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(any(test, feature = "json"), derive(Serialize))]
pub struct ProgramOperations {
    /// The regressor H_min.
    pub regressor: OperationCount,
    /// Inverse dynamics with p_min.
    pub inverse_dynamics: OperationCount,
}

/// Pairs as a JSON object, in their order.
#[cfg(any(test, feature = "json"))]
fn as_map<S: Serializer>(pairs: &[(String, String)], serializer: S) -> Result<S::Ok, S::Error> {
    // The order of the pairs is kept.
    let mut map = serializer.serialize_map(Some(pairs.len()))?;
    for (key, value) in pairs {
        map.serialize_entry(key, value)?;
    }
    map.end()
}

impl ReducedEquations {
    /// Collects texts and counts of a derivation. `numeric` adds the rank on the file's values.
    pub fn new(derivation: &Derivation, numeric: Option<&NumericRank>) -> Self {
        // The fields that the equations are printed from.
        let Derivation {
            mechanism,
            reduction,
            programs,
            ..
        } = derivation;
        // Text of the product at an index of p_g.
        let product = |k: usize| reduction.products[k].text(mechanism);
        // Retained and dependent products on the right are listed alike, retained ones first.
        let dependent = reduction.dependencies.iter().map(|line| DependencyLine {
            parameter: product(line.product),
            equals: line
                .equals
                .iter()
                .map(|(k, factor)| (reduction.retained[*k], factor))
                .chain(line.via.iter().map(|(product, factor)| (*product, factor)))
                .map(|(k, factor)| (product(k), factor_text(mechanism, factor)))
                .collect(),
        });
        let without_effect: Vec<String> = reduction.without_effect.iter().map(|m| m.text(mechanism)).collect();
        // Products without effect are lines with nothing on the right.
        let vanishing = without_effect.iter().map(|parameter| DependencyLine {
            parameter: parameter.clone(),
            equals: Vec::new(),
        });
        Self {
            model: mechanism.name.clone(),
            parameters: (0..reduction.products.len()).map(product).collect(),
            dependencies: dependent.chain(vanishing).collect(),
            // Named sums exist only where base parameters are long.
            sums: derivation.base_sums(),
            base: (0..reduction.retained.len())
                .map(|k| BaseParameterLine {
                    name: base_name(k),
                    retained: product(reduction.retained[k]),
                    expression: base_expression(derivation, k).text(),
                })
                .collect(),
            // Exact rank only if the reduction was exact.
            rank: RankSummary {
                exact: matches!(reduction.method, ReductionMethod::Exact { .. })
                    // A numeric reduction states its rank with its method, so that it is not taken for an exact one.
                    .then_some(reduction.retained.len()),
                numeric: numeric.map(|n| n.rank),
                samples: numeric.map(|n| n.samples),
                method: NumericMethod::from_reduction(reduction),
            },
            // Operations of a state; precomputed values are not counted.
            operations: ProgramOperations {
                regressor: programs.regressor.count_operations(ProgramStage::State),
                inverse_dynamics: programs.inverse_dynamics.count_operations(ProgramStage::State),
            },
            without_effect,
        }
    }

    /// As indented JSON with a line feed at the end; needs the feature `json`.
    #[cfg(any(test, feature = "json"))]
    pub fn json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("strings and counts always make JSON");
        // A text file ends with a line feed.
        text.push('\n');
        text
    }
}
