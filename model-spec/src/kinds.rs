//! Kinds of effects: data that say what an effect adds to the force of its place.
//!
//! A library file and the model's own `[[effect_kind]]` tables go in; checked kinds come out, and for each effect
//! the factor that multiplies each of its parameters.

use std::sync::OnceLock;

use crate::diagnostic::{Diagnostic, Log};
use crate::document;
use crate::exact::{ConstantIdx, Exact, Symbol};
use crate::kind_terms::{factors, lacking_units};
use crate::schema::{EffectKindEntry, ModelEntry};
use crate::scope::Scope;
use crate::unit::{Dimension, Unit};
use crate::values::{PlaceKind, SignName, UnitByPlace};

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

    /// The key of its units.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Force => "force",
            Self::Torque => "torque",
            Self::Mass => "point",
        }
    }

    /// The unit for it among several.
    pub(crate) fn unit(self, units: &UnitByPlace) -> Option<&Unit> {
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
