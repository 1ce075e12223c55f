//! Effects of a file, of kinds from the library and from the file itself.
//!
//! The table `effect` goes in; effects with their places, terms, constants and bodies come out. Parameters that they
//! introduce are added to those of the file.

use std::collections::{BTreeMap, BTreeSet};

use crate::build::bodies::check_unique;
use crate::build::effect_places::{EffectTargets, common_load, find_place, single_effects};
use crate::build::frames::duplicate_name;
use crate::build::symbols::{ParameterLookup, SymbolTable};
use crate::diagnostic::{Diagnostic, DiagnosticLog, SourceSpan};
use crate::document::TomlKey;
use crate::exact::{ExactExpression, ParameterIdx};
use crate::finite::{self, ValueFaultCause};
use crate::formula::FormulaAstKind;
use crate::kind_terms::{factors, unit_at};
use crate::kinds::{ActsOn, PlaceLoad, Sign, check_kind, library_entries, n_places};
use crate::mechanics::Mechanics;
use crate::mechanism::{DynamicParameter, EffectBodies, EffectPlace, EffectTerm, ModelEffect};
use crate::schema::{EffectEntry, EffectKindEntry, KindParameterEntry, ModelEntry};
use crate::scope::{FormulaRequirement, SymbolSort};
use crate::suggest;
use crate::unit::{ModelUnit, UnitDimension};
use crate::values::SpannedName;

/// Reads the effects and adds their parameters to those of the file.
/// `own_kinds` are kinds of the model file and of its libraries; those of the program are added here.
pub(super) fn effects(
    model: &ModelEntry,
    own_kinds: &[&EffectKindEntry],
    symbols: &mut SymbolTable,
    scene: &EffectTargets<'_>,
    log: &mut DiagnosticLog,
) -> Vec<ModelEffect> {
    // All kinds are checked once, before any effect uses them.
    let kinds = kinds(own_kinds, log);
    let listed = model.effect.iter().flat_map(|list| &list.entries);
    check_unique("effect", listed.clone().filter_map(|entry| entry.name.as_ref()), log);
    // An entry for each of several places stands for one effect at each of them.
    let single: Vec<EffectEntry> = listed.flat_map(|entry| single_effects(entry, scene, log)).collect();
    let entries = single.iter();
    // Effects that couple two places may share one of them with another effect.
    // For kinds with exactly two places: whether they act on both. `None` for all other kinds.
    let couples = |entry: &EffectEntry| {
        let kind = entry.kind.as_ref().and_then(|kind| kinds.get(kind.text.as_str()));
        kind.and_then(|(kind, _)| {
            let both_ways = kind.other.is_none();
            (n_places(kind) == Some(2)).then_some(both_ways)
        })
    };
    // Checks that compare effects with each other come first.
    warn_of_twins(&entries, &couples, log);
    check_single(entries.clone(), &kinds, log);
    entries
        .filter_map(|entry| effect(entry, &kinds, symbols, scene, log))
        .collect()
}

/// Reports kinds that describe one property of the complete mechanism, such as a tilt of gravity, if they occur
/// twice.
fn check_single<'a>(entries: impl Iterator<Item = &'a EffectEntry>, kinds: &KindTable<'_>, log: &mut DiagnosticLog) {
    // Kinds are compared by their mechanics, so that own kinds with other names count as equal.
    let mut seen: Vec<(Mechanics, SourceSpan)> = Vec::new();
    for name in entries.filter_map(|entry| entry.kind.as_ref()) {
        let kind = kinds.get(name.text.as_str());
        let Some(way) = kind.and_then(|(kind, _)| kind.mechanics).filter(|way| way.is_global()) else {
            continue;
        };
        match seen.iter().find(|(known, _)| *known == way) {
            Some((_, first)) => log.push(
                Diagnostic::error(name.span, format!("`{}` acts twice", name.text))
                    .label("expected only one")
                    .related(*first, "the first one")
                    .help("put both into one effect, by its constants"),
            ),
            None => seen.push((way, name.span)),
        }
    }
}

/// Warns of a kind that acts twice at one place with the same constants. Its columns are then equal. A common cause
/// is a variant that is meant to override an effect without a name. Effects that couple two places are compared by
/// both places; `couples` states whether the order of the places matters (`Some(false)`) or not (`Some(true)`).
fn warn_of_twins<'a>(
    entries: &(impl Iterator<Item = &'a EffectEntry> + Clone),
    couples: &dyn Fn(&EffectEntry) -> Option<bool>,
    log: &mut DiagnosticLog,
) {
    // Each kind at each place, with the first effect that has it.
    let mut seen: BTreeMap<(&str, Vec<&str>), (&EffectEntry, &SpannedName)> = BTreeMap::new();
    // With own constants the columns differ, so that both effects can be meant.
    for entry in entries.clone().filter(|entry| entry.constants.is_none()) {
        let Some(kind) = &entry.kind else { continue };
        let mut all: Vec<&str> = (entry.at.iter().flat_map(|at| &at.entries))
            .map(|place| place.text.as_str())
            .collect();
        let together = couples(entry);
        // Places of a symmetric coupling are sorted, so that both orders compare equal.
        if together != Some(false) {
            all.sort_unstable();
        }
        let n_keys = if together.is_some() { 1 } else { all.len() };
        // A coupling has one key, other effects have one for each place.
        for place in entry.at.iter().flat_map(|at| &at.entries).take(n_keys) {
            let key = if together.is_some() {
                all.clone()
            } else {
                vec![place.text.as_str()]
            };
            let known = *seen.entry((&kind.text, key)).or_insert((entry, place));
            let (first, first_place) = known;
            // The places of one effect are checked elsewhere. Places that share a value with others may have a second
            // effect that is their difference from it.
            if std::ptr::eq(first, entry) || together.is_none() && shares_differ(first, entry, entries) {
                continue;
            }
            // An unnamed effect of another file was probably meant to be overridden.
            let remedy = if first.name.is_none() && first_place.span.file != place.span.file {
                "to override the effect of the extended file, give both effects the same `name`"
            } else {
                "delete one of them"
            };
            log.push(
                Diagnostic::warning(place.span, format!("`{}` acts twice at `{}`", kind.text, place.text))
                    .label("the effects add up")
                    .related(first_place.span, "it acts there already")
                    .help(remedy),
            );
        }
    }
}

/// Whether the parameters of one of two effects act at all places of those of the other and at further ones: then their
/// columns differ.
fn shares_differ<'a>(
    one: &'a EffectEntry,
    other: &'a EffectEntry,
    entries: &(impl Iterator<Item = &'a EffectEntry> + Clone),
) -> bool {
    let places = |entry: &'a EffectEntry| {
        entry
            .at
            .iter()
            .flat_map(|at| &at.entries)
            .map(|place| place.text.as_str())
    };
    let name = |entry: &'a EffectEntry, key: &str| {
        let mut named = entry.parameters.iter().flat_map(|table| &table.entries);
        named
            .find(|(known, _)| known.name == key)
            .and_then(|(_, value)| value.name.as_ref())
    };
    // An effect of the same kind shares the parameters that have the same names in the file.
    let is_shared = |entry: &'a EffectEntry, other: &'a EffectEntry| {
        let keys = entry
            .parameters
            .iter()
            .flat_map(|table| &table.entries)
            .map(|(key, _)| &key.name);
        let is_kind = entry.kind.as_ref().map(|kind| &kind.text) == other.kind.as_ref().map(|kind| &kind.text);
        let mut keys = keys.peekable();
        is_kind
            && keys.peek().is_some()
            && keys.all(|key| match (name(entry, key), name(other, key)) {
                (Some(one), Some(other)) => one.text == other.text,
                _ => false,
            })
    };
    let reach = |entry: &'a EffectEntry| -> BTreeSet<&str> {
        let sharing = entries.clone().filter(|other| is_shared(entry, other));
        places(entry).chain(sharing.flat_map(places)).collect()
    };
    let [one, other] = [one, other].map(reach);
    one != other && (one.is_subset(&other) || one.is_superset(&other))
}

/// Kinds by name, each with whether it has no faults.
/// The flag is false for kinds whose own entries have errors.
type KindTable<'a> = BTreeMap<&'a str, (&'a EffectKindEntry, bool)>;

/// The kinds of the library and of the file, each checked; faults and name clashes are reported.
fn kinds<'a>(own: &[&'a EffectKindEntry], log: &mut DiagnosticLog) -> KindTable<'a> {
    // Kinds of the program are valid.
    let mut kinds: KindTable<'a> = BTreeMap::new();
    for entry in library_entries() {
        if let Some(name) = &entry.name {
            kinds.insert(&name.text, (entry, true));
        }
    }
    // Own kinds follow; a name that exists already is refused.
    for entry in own {
        let before = log.n_errors();
        let Some(name) = &entry.name else { continue };
        if let Some((first, _)) = kinds.get(name.text.as_str()) {
            let first_span = first.name.as_ref().map_or(name.span, |name| name.span);
            // Kinds of the library have no place in the user's files.
            if first_span.file == usize::MAX {
                log.push(
                    Diagnostic::error(name.span, format!("the library has a kind `{}` already", name.text))
                        .label("expected a new name"),
                );
            } else {
                log.push(duplicate_name("kind of effect", name, first_span));
            }
            continue;
        }
        // Check the kind without a model; missing entries were reported by the reader.
        check_kind(entry, log);
        // Faulty kinds stay in the table, so that their effects are not reported as unknown.
        let complete = (entry.mechanics.is_some() || entry.parameters.is_some() && entry.expression.is_some())
            && entry.on.is_some();
        kinds.insert(&name.text, (entry, complete && log.n_errors() == before));
    }
    // A kind may refine one that is declared after it, so references are checked at the end.
    for refined in own.iter().filter_map(|entry| entry.refines.as_ref()) {
        if !kinds.contains_key(refined.text.as_str()) {
            log.push(
                Diagnostic::error(refined.span, format!("unknown kind of effect `{}`", refined.text))
                    .label("expected the simpler kind that is a special case of this one")
                    .help(suggest::advice(&refined.text, "kinds", kinds.keys().copied())),
            );
        }
    }
    kinds
}

/// The diagnostic of an unknown kind of effect.
fn unknown_kind(kind: &SpannedName, kinds: &KindTable<'_>) -> Diagnostic {
    let message = format!("unknown kind of effect `{}`", kind.text);
    Diagnostic::error(kind.span, message)
        .label("expected a kind of the library or of this file")
        .help(suggest::advice(&kind.text, "kinds", kinds.keys().copied()))
}

/// Reads one effect; `None` after a fault, which is reported.
/// The kind decides which places are allowed, which parameters exist, and what multiplies each of them.
fn effect(
    entry: &EffectEntry,
    kinds: &KindTable<'_>,
    symbols: &mut SymbolTable,
    scene: &EffectTargets<'_>,
    log: &mut DiagnosticLog,
) -> Option<ModelEffect> {
    let at = entry.at.as_ref();
    let known = entry.kind.as_ref().and_then(|name| kinds.get(name.text.as_str()));
    let allowed: &[ActsOn] = known
        .and_then(|(kind, _)| kind.on.as_ref())
        .map_or(&[], |on| on.entries.as_slice());
    // Places are looked up before the kind, so that unknown names are reported even for an unknown kind.
    let mut places: Vec<EffectPlace> = at
        .iter()
        .flat_map(|at| &at.entries)
        .filter_map(|name| find_place(name, allowed, symbols, scene, log))
        .collect();
    // Without a kind nothing else can be checked.
    let kind_name = entry.kind.as_ref()?;
    let Some(&(kind, is_sound)) = known else {
        log.push(unknown_kind(kind_name, kinds));
        return None;
    };
    // Names of parameters are compared with the symbols of the kind.
    check_parameter_names(entry, kind, log);
    check_without(entry, kind, log);
    let at = at?;
    if at.entries.is_empty() {
        log.push(
            Diagnostic::error(at.span, "this effect acts nowhere")
                .label("expected the name of a drive, a coordinate or a point"),
        );
        return None;
    }
    // Faulty kinds and unknown places are reported already.
    if !is_sound || places.len() != at.entries.len() {
        return None;
    }
    let carries = common_load(kind, at, &places, symbols, scene.drives, log)?;
    // The kind and its places fit; now its constants, and the factor or the bodies of each parameter.
    let before = log.n_errors();
    let mut constants = constants(entry, kind, kind_name, symbols, carries, log);
    check_values(entry, kind, kind_name, symbols, log);
    // Expressions give one factor per parameter; mechanics check their places and give bodies.
    let shapes = match kind.mechanics {
        None => factors(kind, carries, &constants, log)?,
        Some(way) => {
            let before = log.n_errors();
            for (name, place) in at.entries.iter().zip(&places) {
                way.entry().check_place(name, *place, scene, log);
            }
            way.entry().check_places(&at.entries, &places, scene, log);
            if log.n_errors() > before {
                return None;
            }
            let entry = way.entry();
            constants = entry.named_constants(constants, kind_name, symbols, log)?;
            Vec::new()
        }
    };
    // Default names of parameters end with the names of all places.
    let places_name = at
        .entries
        .iter()
        .map(|name| name.text.as_str())
        .collect::<Vec<_>>()
        .join("_");
    // Mechanics may allow only some of their parameters at a place, such as those of a planar part.
    let own = kind.mechanics.zip(places.first());
    let own = own.and_then(|(way, place)| Some((way, way.entry().parameters_at(*place, scene.parts)?)));
    // One term per parameter of the kind, in the kind's order.
    let mut terms = Vec::new();
    let parameters = kind.parameters.iter().flat_map(|table| &table.entries);
    for (i, (key, parameter)) in parameters.enumerate() {
        // Parameters that do not exist at this place are skipped, or refused if the file names them.
        if let Some((way, those)) = &own
            && !those.contains(&key.name.as_str())
        {
            way.entry().refuse_parameter(entry, &key.name, those, log);
            continue;
        }
        if lacks(entry, &key.name) {
            continue;
        }
        let unit = unit_at(parameter.unit.as_ref(), carries)?;
        terms.push(EffectTerm {
            symbol: key.name.clone(),
            parameter: term_parameter(entry, key, parameter, unit, &places_name, symbols, log)?,
            // Terms of mechanics have the factor one.
            expression: shapes.get(i).cloned().unwrap_or_else(ExactExpression::unity),
        });
    }
    let mut bodies = EffectBodies::default();
    if let Some(way) = kind.mechanics.map(Mechanics::entry) {
        // A kind of the user's file may list the parameters in another order.
        let listed = way.parameters().iter().map(|(symbol, _)| *symbol);
        terms.sort_by_key(|term| listed.clone().position(|symbol| symbol == term.symbol));
        bodies = way.bodies(&terms, &places, scene);
    }
    // The second place of a kind with `other` is no place of action.
    let other = kind.other.and(places.get(1).copied());
    if other.is_some() {
        places.truncate(1);
    }
    // A fault in any constant or term drops the effect.
    (log.n_errors() == before).then(|| ModelEffect {
        kind: kind_name.text.clone(),
        places,
        other,
        mechanics: kind.mechanics,
        terms,
        constants,
        bodies,
    })
}

/// The parameter of one term of an effect: a parameter that the file declares, or a new one.
/// `unit` is that of the parameter at these places, and `places_name` the end of its default name.
fn term_parameter(
    entry: &EffectEntry,
    key: &TomlKey,
    parameter: &KindParameterEntry,
    unit: &ModelUnit,
    places_name: &str,
    symbols: &mut SymbolTable,
    log: &mut DiagnosticLog,
) -> Option<ParameterIdx> {
    // The entry of the file for this parameter, if there is one.
    let said = entry
        .parameters
        .iter()
        .flat_map(|table| &table.entries)
        .find(|(name, _)| name.name == key.name)
        .map(|(_, said)| said);
    // Without a name in the file the parameter is called after its symbol and its places.
    let named = said.and_then(|said| said.name.as_ref());
    let name = named.map_or_else(|| format!("{}_{places_name}", key.name), |name| name.text.clone());
    // Messages point to the name of the parameter, or to the kind if the file gives none.
    let kind_span = entry.kind.as_ref().map_or(entry.span, |kind| kind.span);
    let span = named.map_or(kind_span, |name| name.span);
    let nominal = said.and_then(|said| said.nominal);
    // A name that is declared already shares that parameter; its unit must be the same.
    let shared = symbols.share_parameter(&name, Some(unit.dimension), span, nominal, log);
    let idx = match shared {
        ParameterLookup::Known(idx) => idx,
        ParameterLookup::Faulty => return None,
        ParameterLookup::New => {
            // A new parameter starts with its nominal value, zero without one.
            let idx = ParameterIdx(symbols.parameters.len());
            let fine = symbols.declare_parameter(
                DynamicParameter {
                    name,
                    nominal: nominal.map_or(0.0, |number| number.value),
                    has_nominal: nominal.is_some(),
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
    // The sign is checked for shared parameters as well.
    let nominal_span = nominal.map_or(span, |number| number.span);
    warn_of_sign(&symbols.parameters[idx.0], parameter.sign, nominal_span, log);
    // An effect is a use of the parameter.
    if let Some(meaning) = symbols.scope.get(&symbols.parameters[idx.0].name) {
        meaning.used.set(true);
    }
    Some(idx)
}

/// Warns of a nominal value whose sign contradicts the physics of the kind.
/// `sign` is the one that the kind requires; without it nothing is reported.
fn warn_of_sign(parameter: &DynamicParameter, sign: Option<Sign>, span: SourceSpan, log: &mut DiagnosticLog) {
    // Zero is allowed for both signs: it means that no value is known.
    let value = parameter.nominal;
    let expected = match sign {
        Some(Sign::Positive) if value < 0.0 => "positive",
        Some(Sign::Negative) if value > 0.0 => "negative",
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
        .help("check its sign, and whether this kind is intended"),
    );
}

/// The values of the kind's constants in this effect: its own values, else the defaults of the kind.
///
/// Unknown and missing constants are reported.
fn constants(
    entry: &EffectEntry,
    kind: &EffectKindEntry,
    kind_name: &SpannedName,
    symbols: &SymbolTable,
    carries: PlaceLoad,
    log: &mut DiagnosticLog,
) -> Vec<(String, ExactExpression)> {
    // Unknown names first, then a value for each constant of the kind.
    let known = || kind.constants.iter().flat_map(|table| &table.entries);
    for (key, _) in entry.constants.iter().flat_map(|table| &table.entries) {
        if !known().any(|(name, _)| name.name == key.name) {
            let names: Vec<&str> = known().map(|(name, _)| name.name.as_str()).collect();
            log.push(
                Diagnostic::error(key.span, format!("unknown constant `{}`", key.name))
                    .label(format!("`{}` has no such constant", kind_name.text))
                    .help(suggest::advice(&key.name, "constants", names.iter().copied())),
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
        // A constant without any value is reported with its note as the label.
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
        // The unit of a constant depends on the load of the place.
        let dimension = unit_at(constant.unit.as_ref(), carries).map_or(UnitDimension::ONE, |unit| unit.dimension);
        let what = format!("`{}`", key.name);
        let wanted = FormulaRequirement {
            sorts: &[SymbolSort::Constant],
            dimension,
            what: &what,
        };
        if let Some(exact) = symbols.scope.resolve(formula, wanted, log) {
            values.push((key.name.clone(), exact));
        }
    }
    values
}

/// Reports values of constants at which the kind's expression is not finite, such as a Stribeck speed of 0.
/// Kinds without an expression have nothing to evaluate.
fn check_values(
    entry: &EffectEntry,
    kind: &EffectKindEntry,
    kind_name: &SpannedName,
    symbols: &SymbolTable,
    log: &mut DiagnosticLog,
) {
    // The value of the effect, else the default of the kind.
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
    // A constant without a finite value of its own is reported at that constant.
    let value = |name: &str| {
        finite::value(&given(name)?.ast, &|inner| symbols.scope.value(inner))
            .ok()
            .flatten()
    };
    let Some(expression) = kind.expression.as_ref() else {
        return;
    };
    // The innermost part of the expression that has no value.
    let Err(fault) = finite::value(&expression.ast, &value) else {
        return;
    };
    // The mark is on the constant that causes the fault, unless its value is a default of the library.
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
    let what = named.map_or_else(|| format!("`{}`", kind_name.text), |name| format!("`{name}`"));
    // The message names the constant if the faulty part is exactly that constant.
    let is_name = matches!(&fault.piece.kind, FormulaAstKind::Name(_));
    let message = match fault.cause {
        ValueFaultCause::Divides if is_name => format!("{what} must not be zero"),
        ValueFaultCause::Root if is_name => format!("{what} must not be negative"),
        _ => format!(
            "with this value of {what} the effect `{}` has no finite value",
            kind_name.text
        ),
    };
    let label = match fault.cause {
        ValueFaultCause::Divides => format!("`{}` divides by it", kind_name.text),
        ValueFaultCause::Root => format!("`{}` takes its root", kind_name.text),
        ValueFaultCause::TooLarge => "too large".to_owned(),
    };
    log.push(
        Diagnostic::error(span, message)
            .label(label)
            .help(format!("the kind adds `{}`", expression.text)),
    );
}

/// Whether an effect does not have a parameter of its kind.
fn lacks(entry: &EffectEntry, symbol: &str) -> bool {
    let mut without = entry.without.iter().flat_map(|list| &list.entries);
    without.any(|name| name.text == symbol)
}

/// Reports parameters that an effect lacks although its kind has no such parameter or needs all of them, or that it has
/// at the same time.
fn check_without(entry: &EffectEntry, kind: &EffectKindEntry, log: &mut DiagnosticLog) {
    let Some(without) = &entry.without else { return };
    let symbols = || (kind.parameters.iter().flat_map(|table| &table.entries)).map(|(key, _)| key.name.as_str());
    if kind.mechanics.is_some_and(|way| !way.entry().may_lack_parameters()) {
        log.push(
            Diagnostic::error(without.span, "this kind of effect needs all of its parameters")
                .label("expected no `without`")
                .help("delete `without`; give a parameter that is zero the nominal value 0"),
        );
        return;
    }
    for name in &without.entries {
        let mut named = entry.parameters.iter().flat_map(|table| &table.entries);
        if !symbols().any(|symbol| symbol == name.text) {
            let advice = suggest::advice(&name.text, "parameters", symbols());
            log.push(
                Diagnostic::error(name.span, format!("unknown parameter `{}`", name.text))
                    .label("this kind of effect has no such parameter")
                    .help(advice),
            );
        } else if let Some((key, _)) = named.find(|(key, _)| key.name == name.text) {
            log.push(
                Diagnostic::error(
                    key.span,
                    format!("`{}` stands in `without` and in `parameters`", name.text),
                )
                .label("this effect does not have it")
                .related(name.span, "left out here")
                .help("delete one of the two"),
            );
        }
    }
    if symbols().all(|symbol| lacks(entry, symbol)) {
        log.push(
            Diagnostic::error(without.span, "this effect has no parameter")
                .label("all parameters of the kind are left out")
                .help("delete the effect, or leave out less"),
        );
    }
}

/// Reports entries of `parameters` whose names the kind does not have.
fn check_parameter_names(entry: &EffectEntry, kind: &EffectKindEntry, log: &mut DiagnosticLog) {
    // All symbols of the kind, for the comparison and for the advice.
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
                    .help(suggest::advice(&key.name, "parameters", names.iter().copied())),
            );
        }
    }
}
