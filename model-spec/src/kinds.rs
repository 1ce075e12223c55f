//! Kinds of effects: data that say what an effect adds to the force of its place.
//!
//! A library file and the model's own `[[effect_kind]]` tables go in; checked kinds come out, and for each effect
//! the factor that multiplies each of its parameters.

use std::cell::Cell;
use std::sync::OnceLock;

use crate::diagnostic::{Diagnostic, Log};
use crate::document;
use crate::exact::{ConstantIdx, Exact, ParameterIdx, PlaceQuantity, Symbol};
use crate::schema::{EffectKindEntry, ModelEntry, PlaceKind, SignName, UnitByPlace};
use crate::scope::{Meaning, Scope, Sort, Wanted, meaning};
use crate::unit::{Dimension, Unit};

/// The library of kinds as the program brings it along.
pub const LIBRARY: &str = include_str!("../library/effects.toml");

/// What a place carries, which settles the units there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Carries {
    /// A force, on a prismatic joint or a linear drive.
    Force,
    /// A torque, on a revolute joint.
    Torque,
    /// A mass, at a point.
    Mass,
}

impl Carries {
    /// The dimension of what the place carries.
    pub(crate) fn dimension(self) -> Dimension {
        match self {
            Self::Force => Dimension::FORCE,
            Self::Torque => Dimension::TORQUE,
            Self::Mass => Dimension::MASS,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Force => "force",
            Self::Torque => "torque",
            Self::Mass => "point",
        }
    }

    fn unit(self, units: &UnitByPlace) -> Option<&Unit> {
        match self {
            Self::Force => units.force.as_ref(),
            Self::Torque => units.torque.as_ref(),
            Self::Mass => units.point.as_ref(),
        }
    }
}

/// The sign that a parameter must have to make physical sense.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Sign {
    /// Not below zero, as friction and masses.
    Positive,
    /// Not above zero.
    Negative,
    /// Either.
    Any,
}

/// Where a kind may act.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ActsOn {
    /// A drive.
    Drive,
    /// A joint coordinate, also a passive one.
    Coordinate,
    /// A point.
    Point,
}

/// A kind of effect, for people and programs that choose among them.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectKind {
    /// Name of the kind.
    pub name: String,
    /// One sentence that explains it.
    pub says: String,
    /// Where it may act.
    pub on: Vec<ActsOn>,
    /// What it adds, as text.
    pub expression: String,
    /// Its parameters.
    pub parameters: Vec<KindParameter>,
    /// Quantities that give its shape.
    pub constants: Vec<KindConstant>,
    /// True if the model file defines it, false if the library does.
    pub is_own: bool,
}

/// A parameter of a kind.
#[derive(Clone, Debug, PartialEq)]
pub struct KindParameter {
    /// Its symbol in the expression.
    pub symbol: String,
    /// The sign that it must have.
    pub sign: Sign,
    /// Units by what the place carries; only where the kind may act.
    pub units: Vec<(Carries, String)>,
}

/// A known quantity of a kind.
#[derive(Clone, Debug, PartialEq)]
pub struct KindConstant {
    /// Its symbol in the expression.
    pub symbol: String,
    /// Value as text where the effect gives none; `None` if the effect must give one.
    pub value: Option<String>,
    /// Units by what the place carries.
    pub units: Vec<(Carries, String)>,
}

/// The kinds of the library that comes with the program.
pub fn library() -> Vec<EffectKind> {
    library_entries()
        .iter()
        .map(|entry| describe(entry, false))
        .collect()
}

/// The tables of the library.
pub(crate) fn library_entries() -> &'static [EffectKindEntry] {
    static ENTRIES: OnceLock<Vec<EffectKindEntry>> = OnceLock::new();
    ENTRIES.get_or_init(|| {
        // The library is no file of the user's: its places lie outside the sources, and a test keeps it sound.
        let mut log = Log::default();
        let table = document::parse(LIBRARY, usize::MAX, &mut log);
        let span = crate::Span {
            file: usize::MAX,
            start: 0,
            end: 0,
        };
        log.syntax_broken = true; // It is no whole model, so nothing is missing.
        let entries = ModelEntry::from_table(&table, span, &mut log)
            .effect_kind
            .map_or_else(Vec::new, |list| list.entries);
        for entry in &entries {
            check(entry, &mut log);
        }
        let found = log.finish();
        assert!(found.is_empty(), "the effect library is faulty: {found:?}");
        entries
    })
}

/// A kind as other crates see it.
pub(crate) fn describe(entry: &EffectKindEntry, is_own: bool) -> EffectKind {
    let units = |units: &Option<UnitByPlace>| {
        [Carries::Force, Carries::Torque, Carries::Mass]
            .into_iter()
            .filter(|carries| may_carry(entry, *carries))
            .filter_map(|carries| {
                let unit = carries.unit(units.as_ref()?)?;
                Some((carries, unit.text.clone()))
            })
            .collect()
    };
    EffectKind {
        name: entry
            .name
            .as_ref()
            .map_or_else(String::new, |name| name.text.clone()),
        says: entry
            .says
            .as_ref()
            .map_or_else(String::new, |says| says.text.clone()),
        on: entry
            .on
            .iter()
            .flat_map(|on| &on.entries)
            .map(|on| match on {
                PlaceKind::Drive => ActsOn::Drive,
                PlaceKind::Coordinate => ActsOn::Coordinate,
                PlaceKind::Point => ActsOn::Point,
            })
            .collect(),
        expression: entry
            .expression
            .as_ref()
            .map_or_else(String::new, |expression| expression.text.clone()),
        parameters: entry
            .parameters
            .iter()
            .flat_map(|parameters| &parameters.entries)
            .map(|(key, parameter)| KindParameter {
                symbol: key.name.clone(),
                sign: match parameter.sign {
                    Some(SignName::Positive) => Sign::Positive,
                    Some(SignName::Negative) => Sign::Negative,
                    Some(SignName::Any) | None => Sign::Any,
                },
                units: units(&parameter.unit),
            })
            .collect(),
        constants: entry
            .constants
            .iter()
            .flat_map(|constants| &constants.entries)
            .map(|(key, constant)| KindConstant {
                symbol: key.name.clone(),
                value: constant.value.as_ref().map(|value| value.text.clone()),
                units: units(&constant.unit),
            })
            .collect(),
        is_own,
    }
}

fn may_carry(entry: &EffectKindEntry, carries: Carries) -> bool {
    entry
        .on
        .iter()
        .flat_map(|on| &on.entries)
        .any(|on| match on {
            PlaceKind::Drive | PlaceKind::Coordinate => carries != Carries::Mass,
            PlaceKind::Point => carries == Carries::Mass,
        })
}

/// Checks a kind by itself: names, units at every place where it may act, linearity in its parameters.
pub(crate) fn check(entry: &EffectKindEntry, log: &mut Log) {
    let mut acts = false;
    for carries in [Carries::Force, Carries::Torque, Carries::Mass] {
        if !may_carry(entry, carries) {
            continue;
        }
        acts = true;
        let lacking = lacking_units(entry, carries);
        // A kind for linear drives alone need not say what it would be on a joint that turns.
        if !lacking.is_empty() {
            continue;
        }
        let placeholders: Vec<(String, Exact)> = entry
            .constants
            .iter()
            .flat_map(|constants| &constants.entries)
            .enumerate()
            .map(|(i, (key, _))| {
                (
                    key.name.clone(),
                    Exact::Symbol(Symbol::Constant(ConstantIdx(i))),
                )
            })
            .collect();
        if factors(entry, carries, &placeholders, log).is_none() {
            return; // One report is enough; the other places have the same fault.
        }
    }
    let nowhere = [Carries::Force, Carries::Torque, Carries::Mass]
        .into_iter()
        .filter(|carries| may_carry(entry, *carries))
        .all(|carries| !lacking_units(entry, carries).is_empty());
    if acts
        && nowhere
        && let Some((key, _)) = entry
            .parameters
            .iter()
            .flat_map(|parameters| &parameters.entries)
            .find(|(_, parameter)| parameter.unit.is_some())
    {
        log.push(
            Diagnostic::error(
                key.span,
                format!("the unit of `{}` fits no place of this kind", key.name),
            )
            .label("expected units for `force`, `torque` or `point`, as `on` asks for")
            .help("for example `unit = { force = \"N s/m\", torque = \"N m s/rad\" }`"),
        );
    }
    check_constant_values(entry, log);
}

fn check_constant_values(entry: &EffectKindEntry, log: &mut Log) {
    for (_, constant) in entry
        .constants
        .iter()
        .flat_map(|constants| &constants.entries)
    {
        if let Some(value) = &constant.value {
            // Values of the library may only be numbers; names mean something in a model only.
            Scope::default().walk(&value.ast, &[], log);
        }
    }
}

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
                declared: Some(key.span),
                used: Cell::new(false),
            },
            log,
        );
    }
    let places = match carries {
        Carries::Mass => return scope,
        Carries::Force => [
            Dimension::LENGTH,
            Dimension::VELOCITY,
            Dimension::ACCELERATION,
            Dimension::FORCE,
        ],
        Carries::Torque => [
            Dimension::ONE,
            Dimension::RATE,
            Dimension::ANGULAR_ACCELERATION,
            Dimension::TORQUE,
        ],
    };
    let quantities = [
        PlaceQuantity::Coordinate,
        PlaceQuantity::Rate,
        PlaceQuantity::Acceleration,
        PlaceQuantity::Load,
    ];
    for (quantity, dimension) in quantities.into_iter().zip(places) {
        scope.declare(
            crate::print::place_name(quantity),
            meaning(
                Sort::Place,
                Symbol::Place(quantity),
                Some(dimension),
                "",
                None,
            ),
            log,
        );
    }
    scope
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
