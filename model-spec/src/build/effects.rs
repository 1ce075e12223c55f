//! Effects of a file, by the kinds of the library and its own, and the products of parameters to retain.

use std::collections::BTreeMap;

use crate::build::bodies::check_unique;
use crate::build::frames::{Points, twice};
use crate::build::symbols::{Shared, Symbols};
use crate::diagnostic::{Diagnostic, Log, Span};
use crate::document::Key;
use crate::exact::{CoordinateIdx, Exact, ParameterIdx, Symbol};
use crate::finite::{self, Why};
use crate::formula::{Ast, AstKind};
use crate::kind_terms::{factors, lacking_units, unit_at};
use crate::kinds::{Carries, check, library_entries};
use crate::mechanism::{Drive, DriveIdx, DriveKind, Effect, EffectTerm, Motion, Parameter, Place};
use crate::schema::{EffectEntry, EffectKindEntry, KindParameterEntry, ModelEntry};
use crate::scope::{Sort, Wanted};
use crate::suggest;
use crate::unit::{Dimension, Unit};
use crate::values::Name;
use crate::values::{PlaceKind, SignName};

/// Reads the effects; their parameters join those of the file.
pub(super) fn effects(
    model: &ModelEntry,
    own_kinds: &[EffectKindEntry],
    symbols: &mut Symbols,
    drives: &[Drive],
    points: &Points,
    log: &mut Log,
) -> Vec<Effect> {
    let kinds = kinds(own_kinds, log);
    let entries = model.effect.iter().flat_map(|list| &list.entries);
    check_unique(
        "effect",
        entries.clone().filter_map(|entry| entry.name.as_ref()),
        log,
    );
    warn_of_twins(entries.clone(), log);
    entries
        .filter_map(|entry| effect(entry, &kinds, symbols, drives, points, log))
        .collect()
}

/// Warns of a kind that acts twice at one place with the same constants: the columns are equal, and a variant that means
/// to override an effect without a name brings this about.
fn warn_of_twins<'a>(entries: impl Iterator<Item = &'a EffectEntry>, log: &mut Log) {
    let mut seen: BTreeMap<(&str, &str), (&EffectEntry, &Name)> = BTreeMap::new();
    for entry in entries.filter(|entry| entry.constants.is_none()) {
        let Some(kind) = &entry.kind else { continue };
        for place in entry.at.iter().flat_map(|at| &at.entries) {
            let known = *seen
                .entry((&kind.text, &place.text))
                .or_insert((entry, place));
            let (first, first_place) = known;
            if std::ptr::eq(first, entry) {
                continue;
            }
            let remedy = if first.name.is_none() && first_place.span.file != place.span.file {
                "to override the effect of the extended file, give it a `name` there and here the same one"
            } else {
                "delete one of them"
            };
            log.push(
                Diagnostic::warning(
                    place.span,
                    format!("`{}` acts twice at `{}`", kind.text, place.text),
                )
                .label("the effects add up")
                .related(first_place.span, "it acts there already")
                .help(remedy),
            );
        }
    }
}

/// A kind and whether it is sound.
type Kinds<'a> = BTreeMap<&'a str, (&'a EffectKindEntry, bool)>;

fn kinds<'a>(own: &'a [EffectKindEntry], log: &mut Log) -> Kinds<'a> {
    let mut kinds: Kinds<'a> = BTreeMap::new();
    for entry in library_entries() {
        if let Some(name) = &entry.name {
            kinds.insert(&name.text, (entry, true));
        }
    }
    for entry in own {
        let before = log.n_errors();
        let Some(name) = &entry.name else { continue };
        if let Some((first, _)) = kinds.get(name.text.as_str()) {
            let first_span = first.name.as_ref().map_or(name.span, |name| name.span);
            if first_span.file == usize::MAX {
                log.push(
                    Diagnostic::error(
                        name.span,
                        format!("the library has a kind `{}` already", name.text),
                    )
                    .label("expected a new name"),
                );
            } else {
                log.push(twice("kind of effect", name, first_span));
            }
            continue;
        }
        check(entry, log);
        let complete =
            entry.parameters.is_some() && entry.expression.is_some() && entry.on.is_some();
        kinds.insert(&name.text, (entry, complete && log.n_errors() == before));
    }
    kinds
}

fn effect(
    entry: &EffectEntry,
    kinds: &Kinds<'_>,
    symbols: &mut Symbols,
    drives: &[Drive],
    points: &Points,
    log: &mut Log,
) -> Option<Effect> {
    let at = entry.at.as_ref();
    let places: Vec<Place> = at
        .iter()
        .flat_map(|at| &at.entries)
        .filter_map(|name| place(name, symbols, drives, points, log))
        .collect();
    let kind_name = entry.kind.as_ref()?;
    let Some(&(kind, is_sound)) = kinds.get(kind_name.text.as_str()) else {
        log.push(
            Diagnostic::error(
                kind_name.span,
                format!("unknown kind of effect `{}`", kind_name.text),
            )
            .label("expected a kind of the library or of this file")
            .help(suggest::advice(
                &kind_name.text,
                "kinds",
                kinds.keys().copied(),
            )),
        );
        return None;
    };
    check_parameter_names(entry, kind, log);
    let at = at?;
    if at.entries.is_empty() {
        log.push(
            Diagnostic::error(at.span, "this effect acts nowhere")
                .label("expected the name of a drive, a coordinate or a point"),
        );
        return None;
    }
    if !is_sound || places.len() != at.entries.len() {
        return None;
    }
    let carries = common_load(kind, &at.entries, &places, symbols, drives, log)?;
    let before = log.n_errors();
    let constants = constants(entry, kind, kind_name, symbols, carries, log);
    check_values(entry, kind, kind_name, symbols, log);
    let factors = factors(kind, carries, &constants, log)?;
    let places_name = at
        .entries
        .iter()
        .map(|name| name.text.as_str())
        .collect::<Vec<_>>()
        .join("_");
    let mut terms = Vec::new();
    let parameters = kind.parameters.iter().flat_map(|table| &table.entries);
    for ((key, parameter), expression) in parameters.zip(factors) {
        let unit = unit_at(parameter.unit.as_ref(), carries)?;
        terms.push(EffectTerm {
            parameter: term_parameter(entry, key, parameter, unit, &places_name, symbols, log)?,
            expression,
        });
    }
    (log.n_errors() == before).then(|| Effect {
        kind: kind_name.text.clone(),
        places,
        terms,
    })
}

/// The parameter of one term of an effect: one that the file knows, or a new one.
fn term_parameter(
    entry: &EffectEntry,
    key: &Key,
    parameter: &KindParameterEntry,
    unit: &Unit,
    places_name: &str,
    symbols: &mut Symbols,
    log: &mut Log,
) -> Option<ParameterIdx> {
    let said = entry
        .parameters
        .iter()
        .flat_map(|table| &table.entries)
        .find(|(name, _)| name.name == key.name)
        .map(|(_, said)| said);
    let named = said.and_then(|said| said.name.as_ref());
    let name = named.map_or_else(
        || format!("{}_{places_name}", key.name),
        |name| name.text.clone(),
    );
    let kind_span = entry.kind.as_ref().map_or(entry.span, |kind| kind.span);
    let span = named.map_or(kind_span, |name| name.span);
    let nominal = said.and_then(|said| said.nominal);
    let shared = symbols.share_parameter(&name, Some(unit.dimension), span, nominal, log);
    let idx = match shared {
        Shared::Known(idx) => idx,
        Shared::Faulty => return None,
        Shared::New => {
            let idx = ParameterIdx(symbols.parameters.len());
            let fine = symbols.declare_parameter(
                Parameter {
                    name,
                    nominal: nominal.map_or(0.0, |number| number.value),
                    unit: unit.text.clone(),
                    note: parameter.note.as_ref().map(|note| note.text.clone()),
                },
                Some(unit.dimension),
                span,
                nominal.map(|number| number.span),
                log,
            );
            if !fine {
                return None;
            }
            idx
        }
    };
    let nominal_span = nominal.map_or(span, |number| number.span);
    warn_of_sign(
        &symbols.parameters[idx.0],
        parameter.sign,
        nominal_span,
        log,
    );
    if let Some(meaning) = symbols.scope.get(&symbols.parameters[idx.0].name) {
        meaning.used.set(true);
    }
    Some(idx)
}

/// Warns of a nominal value whose sign makes no physical sense.
fn warn_of_sign(parameter: &Parameter, sign: Option<SignName>, span: Span, log: &mut Log) {
    let value = parameter.nominal;
    let expected = match sign {
        Some(SignName::Positive) if value < 0.0 => "positive",
        Some(SignName::Negative) if value > 0.0 => "negative",
        _ => return,
    };
    log.push(
        Diagnostic::warning(
            span,
            format!(
                "the nominal value of `{}` is {value} {}",
                parameter.name, parameter.unit
            ),
        )
        .label(format!("expected a {expected} value"))
        .help("check its sign, and whether the kind is the one that is meant"),
    );
}

fn place(
    name: &Name,
    symbols: &Symbols,
    drives: &[Drive],
    points: &Points,
    log: &mut Log,
) -> Option<Place> {
    if let Some(idx) = drives.iter().position(|drive| drive.name == name.text) {
        return Some(Place::Drive(DriveIdx(idx)));
    }
    let coordinate = symbols
        .coordinates
        .iter()
        .position(|coordinate| coordinate.name == name.text);
    if let Some(idx) = coordinate {
        return Some(Place::Coordinate(CoordinateIdx(idx)));
    }
    if let Some(idx) = points.get(&name.text) {
        return Some(Place::Point(idx));
    }
    let known: Vec<&str> = drives
        .iter()
        .map(|drive| drive.name.as_str())
        .chain(symbols.coordinates.iter().map(|one| one.name.as_str()))
        .chain(points.names())
        .collect();
    if !log.is_full() {
        let removal = log.removal(&["drive", "coordinates", "point"], &name.text);
        log.push(
            Diagnostic::error(name.span, format!("unknown place `{}`", name.text))
                .label("expected the name of a drive, a coordinate or a point")
                .removed_or(removal, || {
                    suggest::advice(&name.text, "places", known.iter().copied())
                }),
        );
    }
    None
}

/// What the places of an effect carry; they must all carry the same, and the kind must be allowed there.
fn common_load(
    kind: &EffectKindEntry,
    names: &[Name],
    places: &[Place],
    symbols: &Symbols,
    drives: &[Drive],
    log: &mut Log,
) -> Option<Carries> {
    let motion = |idx: CoordinateIdx| match symbols.coordinates.get(idx.0).map(|one| one.motion) {
        Some(Motion::Prismatic) => Carries::Force,
        Some(Motion::Revolute) | None => Carries::Torque,
    };
    let kind_name = kind.name.as_ref().map_or("", |name| name.text.as_str());
    let mut common: Option<Carries> = None;
    let mut fine = true;
    for (i, (name, place)) in names.iter().zip(places).enumerate() {
        let (sort, carries) = match place {
            Place::Drive(idx) => match drives[idx.0].kind {
                DriveKind::Joint(joint) => (PlaceKind::Drive, motion(joint)),
                DriveKind::Linear { .. } => (PlaceKind::Drive, Carries::Force),
            },
            Place::Coordinate(idx) => (PlaceKind::Coordinate, motion(*idx)),
            Place::Point(_) => (PlaceKind::Point, Carries::Mass),
        };
        let word = |sort: PlaceKind| match sort {
            PlaceKind::Drive => "a drive",
            PlaceKind::Coordinate => "a coordinate",
            PlaceKind::Point => "a point",
        };
        let allowed: Vec<PlaceKind> = kind.on.iter().flat_map(|on| on.entries.clone()).collect();
        if !allowed.contains(&sort) {
            let list: Vec<&str> = allowed.iter().map(|sort| word(*sort)).collect();
            log.push(
                Diagnostic::error(name.span, format!("`{kind_name}` cannot act here"))
                    .label(format!("this is {}", word(sort)))
                    .help(format!("`{kind_name}` acts on {}", list.join(" or "))),
            );
            fine = false;
            continue;
        }
        if !lacking_units(kind, carries).is_empty() {
            log.push(
                Diagnostic::error(name.span, format!("`{kind_name}` cannot act here"))
                    .label(if carries == Carries::Force {
                        "this place carries a force, for which the kind has no units"
                    } else {
                        "this place carries a torque, for which the kind has no units"
                    })
                    .help("give the kind's parameters and constants units for both, `{ force = ..., torque = ... }`"),
            );
            fine = false;
            continue;
        }
        if names[..i].iter().any(|other| other.text == name.text) {
            log.push(
                Diagnostic::error(name.span, format!("`{}` is listed twice", name.text))
                    .label("each place once"),
            );
            fine = false;
        }
        match common {
            Some(first) if first != carries => {
                log.push(
                    Diagnostic::error(
                        name.span,
                        "places that carry forces and torques cannot share a parameter",
                    )
                    .label("differs from the first place")
                    .help("write an `[[effect]]` for each"),
                );
                fine = false;
            }
            _ => common = Some(carries),
        }
    }
    common.filter(|_| fine)
}

/// The values of the kind's constants in this effect.
fn constants(
    entry: &EffectEntry,
    kind: &EffectKindEntry,
    kind_name: &Name,
    symbols: &Symbols,
    carries: Carries,
    log: &mut Log,
) -> Vec<(String, Exact)> {
    let known = || kind.constants.iter().flat_map(|table| &table.entries);
    for (key, _) in entry.constants.iter().flat_map(|table| &table.entries) {
        if !known().any(|(name, _)| name.name == key.name) {
            let names: Vec<&str> = known().map(|(name, _)| name.name.as_str()).collect();
            log.push(
                Diagnostic::error(key.span, format!("unknown constant `{}`", key.name))
                    .label(format!("`{}` has no such constant", kind_name.text))
                    .help(suggest::advice(
                        &key.name,
                        "constants",
                        names.iter().copied(),
                    )),
            );
        }
    }
    let mut values = Vec::new();
    for (key, constant) in known() {
        let given = entry
            .constants
            .iter()
            .flat_map(|table| &table.entries)
            .find(|(name, _)| name.name == key.name)
            .map(|(_, formula)| formula);
        let Some(formula) = given.or(constant.value.as_ref()) else {
            log.push(
                Diagnostic::error(
                    kind_name.span,
                    format!("`{}` needs a value for `{}`", kind_name.text, key.name),
                )
                .label(
                    constant
                        .note
                        .as_ref()
                        .map_or_else(|| "no value is given".to_owned(), |note| note.text.clone()),
                )
                .help(format!("add `constants = {{ {} = ... }}`", key.name)),
            );
            continue;
        };
        let dimension =
            unit_at(constant.unit.as_ref(), carries).map_or(Dimension::ONE, |unit| unit.dimension);
        let what = format!("`{}`", key.name);
        let wanted = Wanted {
            sorts: &[Sort::Constant],
            dimension,
            what: &what,
        };
        if let Some(exact) = symbols.scope.resolve(formula, wanted, log) {
            values.push((key.name.clone(), exact));
        }
    }
    values
}

/// Reports values of the constants at which the kind's expression has no finite value, such as a Stribeck speed of 0.
fn check_values(
    entry: &EffectEntry,
    kind: &EffectKindEntry,
    kind_name: &Name,
    symbols: &Symbols,
    log: &mut Log,
) {
    let given = |name: &str| {
        let own = entry
            .constants
            .iter()
            .flat_map(|table| &table.entries)
            .find(|(key, _)| key.name == name)
            .map(|(_, formula)| formula);
        own.or_else(|| {
            kind.constants
                .iter()
                .flat_map(|table| &table.entries)
                .find(|(key, _)| key.name == name)
                .and_then(|(_, constant)| constant.value.as_ref())
        })
    };
    // Values that are no numbers themselves are reported where they stand.
    let value = |name: &str| {
        finite::value(&given(name)?.ast, &|inner| symbols.scope.value(inner))
            .ok()
            .flatten()
    };
    let Some(expression) = kind.expression.as_ref() else {
        return;
    };
    let Err(fault) = finite::value(&expression.ast, &value) else {
        return;
    };
    let named = kind
        .constants
        .iter()
        .flat_map(|table| &table.entries)
        .map(|(key, _)| key.name.as_str())
        .find(|name| finite::mentions(fault.piece, name));
    let span = named
        .and_then(given)
        .map(|formula| formula.ast.span)
        .filter(|span| span.file != usize::MAX)
        .unwrap_or(kind_name.span);
    let what = named.map_or_else(
        || format!("`{}`", kind_name.text),
        |name| format!("`{name}`"),
    );
    let is_name = matches!(&fault.piece.kind, AstKind::Name(_));
    let message = match fault.why {
        Why::Divides if is_name => format!("{what} must not be zero"),
        Why::Root if is_name => format!("{what} must not be negative"),
        _ => format!(
            "with this value of {what} the effect `{}` has no finite value",
            kind_name.text
        ),
    };
    let label = match fault.why {
        Why::Divides => format!("`{}` divides by it", kind_name.text),
        Why::Root => format!("`{}` takes its root", kind_name.text),
        Why::TooLarge => "too large".to_owned(),
    };
    log.push(
        Diagnostic::error(span, message)
            .label(label)
            .help(format!("the kind adds `{}`", expression.text)),
    );
}

fn check_parameter_names(entry: &EffectEntry, kind: &EffectKindEntry, log: &mut Log) {
    let names: Vec<&str> = kind
        .parameters
        .iter()
        .flat_map(|table| &table.entries)
        .map(|(key, _)| key.name.as_str())
        .collect();
    for (key, _) in entry.parameters.iter().flat_map(|table| &table.entries) {
        if !names.contains(&key.name.as_str()) {
            log.push(
                Diagnostic::error(key.span, format!("unknown parameter `{}`", key.name))
                    .label("this kind of effect has no such parameter")
                    .help(suggest::advice(
                        &key.name,
                        "parameters",
                        names.iter().copied(),
                    )),
            );
        }
    }
}

/// Reads the products of parameters to retain.
pub(super) fn retain(
    model: &ModelEntry,
    symbols: &Symbols,
    log: &mut Log,
) -> Vec<Vec<(ParameterIdx, u32)>> {
    let mut products = Vec::new();
    for formula in model.retain.iter().flat_map(|list| &list.entries) {
        let mut powers: BTreeMap<ParameterIdx, u32> = BTreeMap::new();
        if product(&formula.ast, 1, symbols, &mut powers, log) {
            products.push(powers.into_iter().collect());
        }
    }
    products
}

fn product(
    ast: &Ast,
    exponent: u32,
    symbols: &Symbols,
    powers: &mut BTreeMap<ParameterIdx, u32>,
    log: &mut Log,
) -> bool {
    match &ast.kind {
        AstKind::Name(name) => {
            // Naming a parameter here uses nothing: it only orders what the mechanism holds.
            let was_used = symbols
                .scope
                .get(name)
                .is_some_and(|meaning| meaning.used.get());
            let Some(meaning) = symbols
                .scope
                .look_up(name, ast.span, &[Sort::Parameter], log)
            else {
                return false;
            };
            meaning.used.set(was_used);
            if let Exact::Symbol(Symbol::Parameter(idx)) = meaning.exact {
                *powers.entry(idx).or_default() += exponent;
            }
            true
        }
        AstKind::Product(factors) => {
            let mut fine = true;
            for factor in factors {
                fine &= product(factor, exponent, symbols, powers, log);
            }
            fine
        }
        AstKind::Power(base, power) if *power > 0 => product(
            base,
            exponent.saturating_mul(power.unsigned_abs()),
            symbols,
            powers,
            log,
        ),
        _ => {
            log.push(
                Diagnostic::error(ast.span, "only a product of parameters can be retained")
                    .label("expected for example `m1*dc1^2`"),
            );
            false
        }
    }
}
