//! What a kind of effect adds at a place: its expression with units settled, split into one factor per parameter.

use std::cell::Cell;

use crate::diagnostic::{Diagnostic, Log};
use crate::exact::{Exact, ParameterIdx, PlaceQuantity, Symbol};
use crate::kinds::{Carries, OtherMotion};
use crate::schema::EffectKindEntry;
use crate::scope::{Meaning, Scope, Sort, Wanted, meaning};
use crate::unit::{Dimension, Unit};
use crate::values::UnitByPlace;

/// Symbols of a kind that have no unit where the place carries this.
pub(crate) fn lacking_units(entry: &EffectKindEntry, carries: Carries) -> Vec<&str> {
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
        .filter(|(_, unit)| {
            unit.as_ref()
                .is_some_and(|unit| carries.unit(unit).is_none())
        })
        .map(|(key, _)| key.name.as_str())
        .collect()
}

/// The unit of a kind's parameter at a place that carries this.
pub(crate) fn unit_at(unit: Option<&UnitByPlace>, carries: Carries) -> Option<&Unit> {
    carries.unit(unit?)
}

/// What multiplies each parameter of a kind at a place, in the order of the kind's parameters.
pub(crate) fn factors(
    entry: &EffectKindEntry,
    carries: Carries,
    constants: &[(String, Exact)],
    log: &mut Log,
) -> Option<Vec<Exact>> {
    let before = log.n_errors();
    let expression = entry.expression.as_ref()?;
    let parameters = &entry.parameters.as_ref()?.entries;
    let scope = scope(entry, carries, constants, log);
    let what = format!(
        "where the place carries a {}, what this kind adds",
        if carries == Carries::Mass {
            "mass"
        } else {
            carries.name()
        }
    );
    let exact = scope.resolve(
        expression,
        Wanted {
            sorts: &[Sort::Parameter, Sort::Constant, Sort::Place],
            dimension: carries.dimension(),
            what: &what,
        },
        log,
    )?;
    for (key, _) in parameters {
        if scope
            .get(&key.name)
            .is_some_and(|meaning| !meaning.used.get())
        {
            log.push(
                Diagnostic::error(
                    key.span,
                    format!("the expression does not use `{}`", key.name),
                )
                .label("a parameter without effect")
                .help("use it in `expression`, or delete it"),
            );
        }
    }
    if log.n_errors() > before {
        return None;
    }
    let mut factors = vec![Vec::new(); parameters.len()];
    if !split(&exact, &Exact::one(), &mut factors) {
        log.push(
            Diagnostic::error(
                expression.ast.span,
                "this expression is not linear in the kind's parameters",
            )
            .label("expected a sum of terms, each with exactly one parameter as a factor")
            .help("declare what bends the curve as a constant of the kind; a term without a parameter is known and needs a parameter with a nominal value"),
        );
        return None;
    }
    Some(
        factors
            .into_iter()
            .map(|mut terms| match terms.len() {
                0 => Exact::zero(),
                1 => terms.swap_remove(0),
                _ => Exact::Sum(terms),
            })
            .collect(),
    )
}

fn scope(
    entry: &EffectKindEntry,
    carries: Carries,
    constants: &[(String, Exact)],
    log: &mut Log,
) -> Scope {
    let mut scope = Scope::default();
    let parameters = entry
        .parameters
        .iter()
        .flat_map(|parameters| &parameters.entries);
    for (i, (key, parameter)) in parameters.enumerate() {
        let unit = unit_at(parameter.unit.as_ref(), carries);
        let symbol = Symbol::Parameter(ParameterIdx(i));
        let dimension = unit.map(|unit| unit.dimension);
        scope.declare(
            &key.name,
            meaning(Sort::Parameter, symbol, dimension, "", Some(key.span)),
            log,
        );
    }
    for (key, constant) in entry
        .constants
        .iter()
        .flat_map(|constants| &constants.entries)
    {
        let unit = unit_at(constant.unit.as_ref(), carries);
        let exact = constants
            .iter()
            .find(|(name, _)| *name == key.name)
            .map_or_else(Exact::one, |(_, exact)| exact.clone());
        scope.declare(
            &key.name,
            Meaning {
                sort: Sort::Constant,
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
    let Some(own) = dimensions(carries) else {
        return scope;
    };
    let other = entry.other.map_or(carries, OtherMotion::carries);
    let other = dimensions(other).unwrap_or(own);
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
        let symbol = Symbol::Place(quantity);
        scope.declare(
            quantity.name(),
            meaning(Sort::Place, symbol, Some(dimension), "", None),
            log,
        );
    }
    scope
}

/// Dimensions of position, rate, acceleration and load of a place, where it has them.
fn dimensions(carries: Carries) -> Option<[Dimension; 4]> {
    match carries {
        Carries::Mass | Carries::Elsewhere => None,
        Carries::Force => Some([
            Dimension::LENGTH,
            Dimension::VELOCITY,
            Dimension::ACCELERATION,
            Dimension::FORCE,
        ]),
        Carries::Torque => Some([
            Dimension::ONE,
            Dimension::RATE,
            Dimension::ANGULAR_ACCELERATION,
            Dimension::TORQUE,
        ]),
    }
}

fn is_parameter(symbol: Symbol) -> bool {
    matches!(symbol, Symbol::Parameter(_))
}

/// Splits `factor * exact` into terms per parameter; false if it is not linear and homogeneous in them.
fn split(exact: &Exact, factor: &Exact, factors: &mut [Vec<Exact>]) -> bool {
    match exact {
        Exact::Symbol(Symbol::Parameter(ParameterIdx(i))) => match factors.get_mut(*i) {
            Some(terms) => {
                terms.push(factor.clone());
                true
            }
            None => false,
        },
        Exact::Sum(terms) => terms.iter().all(|term| split(term, factor, factors)),
        Exact::Negative(inner) => split(inner, &Exact::Negative(Box::new(factor.clone())), factors),
        Exact::Product(members) => {
            let (with, without): (Vec<&Exact>, Vec<&Exact>) = members
                .iter()
                .partition(|member| member.mentions(&is_parameter));
            let [linear] = with.as_slice() else {
                return false;
            };
            let mut product: Vec<Exact> = without.into_iter().cloned().collect();
            if *factor != Exact::one() {
                product.insert(0, factor.clone());
            }
            let product = match product.len() {
                0 => Exact::one(),
                1 => product.swap_remove(0),
                _ => Exact::Product(product),
            };
            split(linear, &product, factors)
        }
        Exact::Quotient(above, below) => {
            !below.mentions(&is_parameter)
                && split(
                    above,
                    &Exact::Quotient(Box::new(factor.clone()), below.clone()),
                    factors,
                )
        }
        Exact::Power(base, 1) => split(base, factor, factors),
        _ => false,
    }
}
