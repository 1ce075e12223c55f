//! What a kind of effect adds at a place: its expression, checked for units and split into one factor per parameter.
//!
//! A kind and the load of a place go in; the factors that multiply its parameters come out.

use std::cell::Cell;

use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::exact::{ExactExpression, ModelSymbol, ParameterIdx, PlaceQuantity};
use crate::kinds::{OtherMotion, PlaceLoad};
use crate::schema::EffectKindEntry;
use crate::scope::{FormulaRequirement, FormulaScope, SymbolMeaning, SymbolSort, symbol_meaning};
use crate::unit::{ModelUnit, UnitDimension};
use crate::values::UnitByPlace;

/// Parameters and constants of a kind that have no unit for this load of a place.
///
/// Such a kind cannot act at a place with this load.
pub(crate) fn symbols_without_unit(entry: &EffectKindEntry, carries: PlaceLoad) -> Vec<&str> {
    let parameters = entry
        .parameters
        .iter()
        .flat_map(|parameters| &parameters.entries)
        .map(|(key, parameter)| (key, &parameter.unit));
    let constants = entry
        .constants
        .iter()
        .flat_map(|constants| &constants.entries)
        .map(|(key, constant)| (key, &constant.unit));
    parameters
        .chain(constants)
        // A missing unit was reported by the reader, so it does not count here.
        .filter(|(_, unit)| unit.as_ref().is_some_and(|unit| carries.unit(unit).is_none()))
        .map(|(key, _)| key.name.as_str())
        .collect()
}

/// The unit of a kind's parameter or constant for this load of a place.
pub(crate) fn unit_at(unit: Option<&UnitByPlace>, carries: PlaceLoad) -> Option<&ModelUnit> {
    carries.unit(unit?)
}

/// The factor of each parameter of a kind for this load of a place, in the order of the kind's parameters.
///
/// `constants` gives the expressions that replace the kind's constants. Faults go to the log and give `None`.
pub(crate) fn factors(
    entry: &EffectKindEntry,
    carries: PlaceLoad,
    constants: &[(String, ExactExpression)],
    log: &mut DiagnosticLog,
) -> Option<Vec<ExactExpression>> {
    // The scope has the symbols of the kind only; names of the model are not known in it.
    let before = log.n_errors();
    let expression = entry.expression.as_ref()?;
    let parameters = &entry.parameters.as_ref()?.entries;
    let scope = scope(entry, carries, constants, log);
    // The name of the expression in messages states for which load it was checked.
    let what = format!(
        "where the place carries a {}, what this kind adds",
        if carries == PlaceLoad::Mass {
            "mass"
        } else {
            carries.name()
        }
    );
    // The dimension of the expression must be that of the load.
    let exact = scope.resolve(
        expression,
        FormulaRequirement {
            sorts: &[SymbolSort::Parameter, SymbolSort::Constant, SymbolSort::Place],
            dimension: carries.dimension(),
            what: &what,
        },
        log,
    )?;
    // Resolving marked the names that the expression uses.
    for (key, _) in parameters {
        if scope.get(&key.name).is_some_and(|meaning| !meaning.used.get()) {
            log.push(
                Diagnostic::error(key.span, format!("the expression does not use `{}`", key.name))
                    .label("a parameter without effect")
                    .help("use it in `expression`, or delete it"),
            );
        }
    }
    if log.n_errors() > before {
        return None;
    }
    // Factors are valid only if the expression is a homogeneous linear function of the parameters.
    let mut factors = vec![Vec::new(); parameters.len()];
    if !split_into_factors(&exact, &ExactExpression::unity(), &mut factors) {
        // A term without a parameter, or with two of them, is not linear.
        log.push(
            Diagnostic::error(
                expression.ast.span,
                "this expression is not linear in the kind's parameters",
            )
            .label("expected a sum of terms, each with exactly one parameter as a factor")
            .help("declare nonlinear quantities as constants of the kind; multiply a known term by a parameter with a nominal value"),
        );
        return None;
    }
    Some(
        // Terms with the same parameter are added.
        factors
            .into_iter()
            .map(|mut terms| match terms.len() {
                0 => ExactExpression::zero(),
                1 => terms.swap_remove(0),
                _ => ExactExpression::Sum(terms),
            })
            .collect(),
    )
}

/// The names that the expression of a kind may use: its parameters, its constants, and the motion of its places.
///
/// `constants` gives the expressions of the kind's constants; the units of all symbols are those for this load.
fn scope(
    entry: &EffectKindEntry,
    carries: PlaceLoad,
    constants: &[(String, ExactExpression)],
    log: &mut DiagnosticLog,
) -> FormulaScope {
    let mut scope = FormulaScope::default();
    let parameters = entry.parameters.iter().flat_map(|parameters| &parameters.entries);
    // Parameters by their index in the kind, which the split uses.
    for (i, (key, parameter)) in parameters.enumerate() {
        let unit = unit_at(parameter.unit.as_ref(), carries);
        let symbol = ModelSymbol::Parameter(ParameterIdx(i));
        let dimension = unit.map(|unit| unit.dimension);
        scope.declare(
            &key.name,
            symbol_meaning(SymbolSort::Parameter, symbol, dimension, "", Some(key.span)),
            log,
        );
    }
    // Constants with the expressions of the effect.
    for (key, constant) in entry.constants.iter().flat_map(|constants| &constants.entries) {
        let unit = unit_at(constant.unit.as_ref(), carries);
        let exact = constants
            .iter()
            // A constant without an expression counts as one; the caller gives all constants of the kind.
            .find(|(name, _)| *name == key.name)
            .map_or_else(ExactExpression::unity, |(_, exact)| exact.clone());
        scope.declare(
            &key.name,
            SymbolMeaning {
                sort: SymbolSort::Constant,
                exact,
                dimension: unit.map(|unit| unit.dimension),
                unit: String::new(),
                value: None,
                declared: Some(key.span),
                used: Cell::new(false),
            },
            log,
        );
    }
    // Places with a mass, the base, and the like have no motion that an expression could use.
    let Some(own) = dimensions(carries) else {
        return scope;
    };
    // The other place has the same dimensions unless `other` states how it moves.
    let other = entry.other.map_or(carries, OtherMotion::place_load);
    let other = dimensions(other).unwrap_or(own);
    // Coordinate, rate, acceleration and load of the place, then those of the other place.
    for quantity in PlaceQuantity::ALL {
        let dimension = match quantity {
            PlaceQuantity::Coordinate => own[0],
            PlaceQuantity::Rate => own[1],
            PlaceQuantity::Acceleration => own[2],
            PlaceQuantity::Load => own[3],
            PlaceQuantity::OtherCoordinate => other[0],
            PlaceQuantity::OtherRate => other[1],
            PlaceQuantity::OtherAcceleration => other[2],
        };
        let symbol = ModelSymbol::Place(quantity);
        scope.declare(
            quantity.name(),
            symbol_meaning(SymbolSort::Place, symbol, Some(dimension), "", None),
            log,
        );
    }
    scope
}

/// Dimensions of coordinate, rate, acceleration and load of a place; `None` if it has no motion.
fn dimensions(carries: PlaceLoad) -> Option<[UnitDimension; 4]> {
    match carries {
        PlaceLoad::Mass | PlaceLoad::Elsewhere => None,
        PlaceLoad::Force => Some([
            UnitDimension::LENGTH,
            UnitDimension::VELOCITY,
            UnitDimension::ACCELERATION,
            UnitDimension::FORCE,
        ]),
        PlaceLoad::Torque => Some([
            UnitDimension::ONE,
            UnitDimension::RATE,
            UnitDimension::ANGULAR_ACCELERATION,
            UnitDimension::TORQUE,
        ]),
    }
}

/// Whether a symbol is a parameter of the kind.
fn is_parameter(symbol: ModelSymbol) -> bool {
    matches!(symbol, ModelSymbol::Parameter(_))
}

/// Splits `factor * exact` into terms per parameter; false if `exact` is not linear and homogeneous in them.
///
/// The factor of each occurrence is appended to the list of its parameter.
fn split_into_factors(exact: &ExactExpression, factor: &ExactExpression, factors: &mut [Vec<ExactExpression>]) -> bool {
    match exact {
        // A parameter by itself: the accumulated factor belongs to it.
        ExactExpression::Symbol(ModelSymbol::Parameter(ParameterIdx(i))) => match factors.get_mut(*i) {
            Some(terms) => {
                terms.push(factor.clone());
                true
            }
            None => false,
        },
        // Sums and signs are passed on to their operands.
        ExactExpression::Sum(terms) => terms.iter().all(|term| split_into_factors(term, factor, factors)),
        ExactExpression::Negative(inner) => {
            split_into_factors(inner, &ExactExpression::Negative(Box::new(factor.clone())), factors)
        }
        ExactExpression::Product(members) => {
            // Exactly one member may contain parameters; all others join the factor.
            let (with, without): (Vec<&ExactExpression>, Vec<&ExactExpression>) =
                members.iter().partition(|member| member.mentions(&is_parameter));
            let [linear] = with.as_slice() else {
                return false;
            };
            let mut product: Vec<ExactExpression> = without.into_iter().cloned().collect();
            if *factor != ExactExpression::unity() {
                product.insert(0, factor.clone());
            }
            let product = match product.len() {
                0 => ExactExpression::unity(),
                1 => product.swap_remove(0),
                _ => ExactExpression::Product(product),
            };
            split_into_factors(linear, &product, factors)
        }
        // Divisors join the factor and must be free of parameters.
        ExactExpression::Quotient(above, below) => {
            !below.mentions(&is_parameter)
                && split_into_factors(
                    above,
                    &ExactExpression::Quotient(Box::new(factor.clone()), below.clone()),
                    factors,
                )
        }
        ExactExpression::Power(base, 1) => split_into_factors(base, factor, factors),
        _ => false,
    }
}
