//! Kinds of effects: data that state what an effect adds to the force of its place.
//!
//! A library file and the model's own `[[effect_kind]]` tables go in; checked kinds come out, and for each effect
//! the factor that multiplies each of its parameters.

use std::sync::OnceLock;

use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::document;
use crate::exact::{ConstantIdx, ExactExpression, ModelSymbol, PlaceQuantity};
use crate::finite;
use crate::kind_mechanics::check_expression_or_mechanics;
use crate::kind_terms::{factors, symbols_without_unit};
use crate::mechanics::Mechanics;
use crate::schema::{EffectKindEntry, LibraryEntry, ModelEntry};
use crate::scope::FormulaScope;
use crate::unit::{ModelUnit, UnitDimension};
use crate::values::{self, SpannedText, UnitByPlace};
use crate::words::words;

/// The library of kinds that is part of the program, as TOML.
pub const LIBRARY: &str = include_str!("../library/effects.toml");

/// The load of a place, which determines the units there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PlaceLoad {
    /// A force, on a prismatic joint or a linear drive.
    Force,
    /// A torque, on a revolute joint.
    Torque,
    /// A mass, at a point.
    Mass,
    /// Anything else: a part, the base, the measured forces.
    Elsewhere,
}

impl PlaceLoad {
    /// All loads.
    pub const ALL: [Self; 4] = [Self::Force, Self::Torque, Self::Mass, Self::Elsewhere];

    /// The dimension of what the place carries.
    pub(crate) fn dimension(self) -> UnitDimension {
        match self {
            Self::Force => UnitDimension::FORCE,
            Self::Torque => UnitDimension::TORQUE,
            Self::Mass => UnitDimension::MASS,
            Self::Elsewhere => UnitDimension::ONE,
        }
    }

    /// The key of its units in a model file.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Force => "force",
            Self::Torque => "torque",
            Self::Mass => "point",
            Self::Elsewhere => "elsewhere",
        }
    }

    /// The unit for this load among units by place, if there is one.
    pub(crate) fn unit(self, units: &UnitByPlace) -> Option<&ModelUnit> {
        match self {
            Self::Force => units.force.as_ref(),
            Self::Torque => units.torque.as_ref(),
            Self::Mass => units.point.as_ref(),
            Self::Elsewhere => units.elsewhere.as_ref(),
        }
    }
}

words! {
    /// The sign that a parameter must have to make physical sense.
    #[derive(PartialOrd, Ord, Hash)]
    pub Sign as "SignName": "a sign",
    /// Not below zero, as friction and masses.
    "positive" => Positive,
    /// Not above zero.
    "negative" => Negative,
    /// Either sign is possible.
    "any" => Any,
}

words! {
    /// Where a kind may act.
    #[derive(PartialOrd, Ord, Hash)]
    pub ActsOn as "PlaceKind": "a place",
    /// A drive.
    "drive" => Drive,
    /// A joint coordinate, also a passive one.
    "coordinate" => Coordinate,
    /// A point.
    "point" => Point,
    /// A part.
    "part" => Part,
    /// The complete base, named `base`.
    "base" => Base,
    /// All measured forces, named `force`.
    "force" => Force,
}

impl ActsOn {
    /// The place with its article, for messages.
    pub fn description(self) -> &'static str {
        match self {
            Self::Drive => "a drive",
            Self::Coordinate => "a coordinate",
            Self::Point => "a point",
            Self::Part => "a part",
            Self::Base => "`base`",
            Self::Force => "`force`",
        }
    }
}

words! {
    /// How the second place of a kind moves, if the kind acts at the first place only.
    #[derive(PartialOrd, Ord, Hash)]
    pub OtherMotion as "OtherMotionName": "how a place moves",
    /// It is revolute.
    "angle" => Angle,
    /// It is prismatic, or the length of a linear drive.
    "length" => Length,
}

impl OtherMotion {
    /// The load of a place that moves in this way.
    pub fn place_load(self) -> PlaceLoad {
        match self {
            Self::Angle => PlaceLoad::Torque,
            Self::Length => PlaceLoad::Force,
        }
    }

    /// How it moves, for messages.
    pub fn description(self) -> &'static str {
        match self {
            Self::Angle => "is revolute",
            Self::Length => "is prismatic",
        }
    }
}

words! {
    /// The scale of a search range.
    #[derive(PartialOrd, Ord, Hash)]
    pub Scale as "ScaleName": "what a range is relative to",
    /// The largest rate of the place.
    "rate" => Rate,
    /// The travel of the place's coordinate: the largest value less the smallest.
    "travel" => Travel,
    /// No scale: values are in SI units.
    "one" => One,
}

/// How the value of an unknown constant is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConstantSearch {
    /// The expression is affine in it, so that its product with the parameter is a parameter itself.
    Linear,
    /// Values from `from` to `to`, times the scale, are tried.
    Range {
        /// The least value.
        from: f64,
        /// The largest value.
        to: f64,
        /// The scale that multiplies both.
        of: Scale,
    },
}

/// Description of a kind of effect: name, texts, parameters, places.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectKind {
    /// Name of the kind.
    pub name: String,
    /// One sentence that explains it.
    pub says: String,
    /// Where it may act.
    pub on: Vec<ActsOn>,
    /// What it adds, as text; empty if `mechanics` describes it.
    pub expression: String,
    /// What it does, if that is not an expression.
    pub mechanics: Option<Mechanics>,
    /// Its parameters, which identification estimates.
    pub parameters: Vec<KindParameter>,
    /// Known quantities that determine its shape.
    pub constants: Vec<KindConstant>,
    /// How many places it must have; `None` for any number.
    pub places: Option<usize>,
    /// For a kind that acts at its first place only, but whose force depends on the motion of a second one: which motion of
    /// the second place enters.
    pub other: Option<OtherMotion>,
    /// One paragraph: what it is, where it comes from, and how the error looks if a model lacks it. May be empty.
    pub explains: String,
    /// Effects it can be confused with, and the experiment that distinguishes them. May be empty.
    pub confused_with: String,
    /// A simpler kind that is a special case of this one.
    pub refines: Option<String>,
    /// True if the model file or a library of the user defines it, false for the program's library.
    pub is_own: bool,
}

/// A parameter of a kind.
#[derive(Clone, Debug, PartialEq)]
pub struct KindParameter {
    /// Its symbol in the expression.
    pub symbol: String,
    /// The sign that it must have.
    pub sign: Sign,
    /// Its unit for each quantity that the effect may add (force, torque, mass, other), as pairs. A quantity is listed only if
    /// the effect may act at a place that has it.
    pub units: Vec<(PlaceLoad, String)>,
    /// Remark; may be empty.
    pub note: String,
}

/// A known quantity of a kind.
#[derive(Clone, Debug, PartialEq)]
pub struct KindConstant {
    /// Its symbol in the expression.
    pub symbol: String,
    /// Default value as text; `None` if the effect must give one.
    pub value: Option<String>,
    /// Its unit for each quantity that the effect may add, as pairs.
    pub units: Vec<(PlaceLoad, String)>,
    /// How it is found if it is unknown; `None` if it must be known.
    pub search: Option<ConstantSearch>,
    /// Remark; may be empty.
    pub note: String,
}

/// The kinds of the library that comes with the program.
pub fn library() -> Vec<EffectKind> {
    library_entries().iter().map(|entry| describe(entry, false)).collect()
}

/// The entries of the program's library, parsed once.
pub(crate) fn library_entries() -> &'static [EffectKindEntry] {
    static ENTRIES: OnceLock<Vec<EffectKindEntry>> = OnceLock::new();
    ENTRIES.get_or_init(|| {
        // Its places are outside of the user's files; the assertion below and a test keep it free of faults.
        let mut log = DiagnosticLog::default();
        let table = document::parse_toml(LIBRARY, usize::MAX, &mut log);
        let span = crate::SourceSpan {
            file: usize::MAX,
            start: 0,
            end: 0,
        };
        // It is not a complete model, so missing entries must not be reported.
        log.syntax_broken = true;
        let entries = ModelEntry::from_table(&table, span, &mut log)
            .effect_kind
            .map_or_else(Vec::new, |list| list.entries);
        for entry in &entries {
            check_kind(entry, &mut log);
        }
        let found = log.finish();
        assert!(found.is_empty(), "the effect library is faulty: {found:?}");
        entries
    })
}

/// The kinds of a library file of the user; `file` is its index among the sources.
pub(crate) fn own_library(text: &str, file: usize, log: &mut DiagnosticLog) -> Vec<EffectKindEntry> {
    let table = document::parse_toml(text, file, log);
    let span = crate::SourceSpan { file, start: 0, end: 0 };
    LibraryEntry::from_table(&table, span, log)
        .effect_kind
        .map_or_else(Vec::new, |list| list.entries)
}

/// The public description of a kind.
pub(crate) fn describe(entry: &EffectKindEntry, is_own: bool) -> EffectKind {
    // Units are listed only for loads that the places of the kind can have.
    let units = |units: &Option<UnitByPlace>| {
        PlaceLoad::ALL
            .into_iter()
            .filter(|carries| can_carry(entry, *carries))
            .filter_map(|carries| {
                let unit = carries.unit(units.as_ref()?)?;
                Some((carries, unit.text.clone()))
            })
            .collect()
    };
    let words = |text: &Option<SpannedText>| text.as_ref().map_or_else(String::new, |t| t.text.clone());
    let parameters = entry.parameters.iter().flat_map(|table| &table.entries);
    let constants = entry.constants.iter().flat_map(|table| &table.entries);
    EffectKind {
        name: entry.name.as_ref().map_or_else(String::new, |name| name.text.clone()),
        says: words(&entry.says),
        on: entry.on.iter().flat_map(|on| &on.entries).copied().collect(),
        expression: entry
            .expression
            .as_ref()
            .map_or_else(String::new, |expression| expression.text.clone()),
        mechanics: entry.mechanics,
        places: n_places(entry),
        other: entry.other,
        parameters: parameters
            .map(|(key, parameter)| KindParameter {
                symbol: key.name.clone(),
                sign: parameter.sign.unwrap_or(Sign::Any),
                units: units(&parameter.unit),
                note: words(&parameter.note),
            })
            .collect(),
        constants: constants
            .map(|(key, constant)| KindConstant {
                symbol: key.name.clone(),
                value: constant.value.as_ref().map(|value| value.text.clone()),
                units: units(&constant.unit),
                search: constant.search.as_ref().map(search),
                note: words(&constant.note),
            })
            .collect(),
        explains: words(&entry.explains),
        confused_with: words(&entry.doubles),
        refines: entry.refines.as_ref().map(|text| text.text.clone()),
        is_own,
    }
}

/// The public form of a search entry.
fn search(entry: &values::SearchEntry) -> ConstantSearch {
    match entry {
        values::SearchEntry::Linear => ConstantSearch::Linear,
        values::SearchEntry::Range(range) => ConstantSearch::Range {
            // Missing bounds are reported by the reader of the entry.
            from: range.from.map_or(0.0, |number| number.value),
            to: range.to.map_or(0.0, |number| number.value),
            of: range.of.unwrap_or(Scale::One),
        },
    }
}

/// How many places a kind must have; `None` for any number.
pub(crate) fn n_places(entry: &EffectKindEntry) -> Option<usize> {
    match entry.mechanics {
        Some(mechanics) => mechanics.entry().n_places(),
        None => {
            // An expression that uses the motion of another place needs exactly two places.
            let expression = entry.expression.as_ref()?;
            PlaceQuantity::ALL
                .iter()
                .any(|one| one.is_other() && finite::mentions(&expression.ast, one.name()))
                .then_some(2)
        }
    }
}

/// Whether any place where the kind may act can have this load.
pub(crate) fn can_carry(entry: &EffectKindEntry, carries: PlaceLoad) -> bool {
    let mut places = entry.on.iter().flat_map(|on| &on.entries);
    places.any(|on| match on {
        ActsOn::Drive | ActsOn::Coordinate => {
            matches!(carries, PlaceLoad::Force | PlaceLoad::Torque)
        }
        ActsOn::Point => carries == PlaceLoad::Mass,
        ActsOn::Part | ActsOn::Base | ActsOn::Force => carries == PlaceLoad::Elsewhere,
    })
}

/// Checks a kind without a model: names, units for every load that it can have, linearity in its parameters.
pub(crate) fn check_kind(entry: &EffectKindEntry, log: &mut DiagnosticLog) {
    check_constant_values(entry, log);
    if !check_expression_or_mechanics(entry, log) {
        return;
    }
    if let (Some(_), Some(expression), None) = (entry.other, &entry.expression, n_places(entry)) {
        log.push(
            Diagnostic::error(
                expression.ast.span,
                "this kind declares `other` but does not use the motion of the other place",
            )
            .label("expected `other_coordinate`, `other_rate` or `other_acceleration`")
            .help("delete `other`, or use one of these names"),
        );
    }
    // Each load that has all units is checked by resolving the expression with symbols in place of constants.
    let mut acts = false;
    for carries in PlaceLoad::ALL {
        if !can_carry(entry, carries) {
            continue;
        }
        acts = true;
        let lacking = symbols_without_unit(entry, carries);
        // A kind for linear drives only needs no units for revolute joints.
        if !lacking.is_empty() {
            continue;
        }
        let placeholders: Vec<(String, ExactExpression)> = entry
            .constants
            .iter()
            .flat_map(|constants| &constants.entries)
            .enumerate()
            .map(|(i, (key, _))| {
                (
                    key.name.clone(),
                    ExactExpression::Symbol(ModelSymbol::Constant(ConstantIdx(i))),
                )
            })
            .collect();
        if factors(entry, carries, &placeholders, log).is_none() {
            return; // One report is enough; the other places have the same fault.
        }
    }
    // If every load lacks a unit, the kind could never be used.
    let nowhere = PlaceLoad::ALL
        .into_iter()
        .filter(|carries| can_carry(entry, *carries))
        .all(|carries| !symbols_without_unit(entry, carries).is_empty());
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
            .label("expected units for `force`, `torque` or `point`, as `on` requires")
            .help("for example `unit = { force = \"N s/m\", torque = \"N m s/rad\" }`"),
        );
    }
}

/// Checks the default values of constants, which must be numbers.
fn check_constant_values(entry: &EffectKindEntry, log: &mut DiagnosticLog) {
    for (_, constant) in entry.constants.iter().flat_map(|constants| &constants.entries) {
        if let Some(value) = &constant.value {
            // Names have values only inside of a model, so an empty scope is used.
            FormulaScope::default().resolve_ast(&value.ast, &[], log);
        }
    }
}
