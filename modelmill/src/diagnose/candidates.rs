//! All candidates: every kind of the library at every possible place, as entries that `add` would write. They
//! are derived together in three variants of the model, which give their columns.
//!
//! Decision: a candidate is the entry that `add` would write, and its columns come from the derivation of that
//! entry. So there is no second definition of an effect, and effect kinds of a user's own library are tried like
//! all others.

use std::collections::BTreeSet;

use modelmill_codegen::{Derivation, ParameterMonomial, PoseGuard};
use modelmill_spec::{
    AddedEffect, ConstantSearch, ConstantValue, EffectKind, Mechanics, Mechanism, ModelConstant, ModelEffect, Scale,
    Sign,
};

use crate::error::{Error, Outcome};
use crate::model::Model;

use super::constants::ClaimedConstant;
use super::places::{CandidatePlace, candidate_places, is_applicable, place_sets};

/// Values of a constant that are tried on an even grid.
const TRIED: usize = 15;
/// Values of a positive constant that are tried on a logarithmic grid.
const RATES: usize = 14;
/// Wavelengths that are tried at most for a periodic effect.
const WAVES: usize = 120;

/// An effect as one entry of a model file.
pub(crate) struct SingleCandidate {
    /// Index of its kind.
    pub kind: usize,
    /// Its places.
    pub spots: Vec<CandidatePlace>,
    /// How often its columns are evaluated.
    pub sort: EvaluationFrequency,
    /// Symbols of its parameters with their positions among those of its variant.
    pub parameters: Vec<(String, usize)>,
    /// Symbols of constants that are searched for, with their names in the variant and how.
    pub constants: Vec<(String, String, ConstantSearch)>,
    /// Symbols of constants whose values are given.
    pub given: Vec<(String, f64)>,
}

impl SingleCandidate {
    /// The symbol of the constant whose value is tried.
    pub(crate) fn range(&self) -> Option<&str> {
        let is_range = |c: &&(String, String, ConstantSearch)| matches!(c.2, ConstantSearch::Range { .. });
        let found = self.constants.iter().find(is_range);
        found.map(|(symbol, _, _)| symbol.as_str())
    }
}

/// A candidate: the sum of entries that share their parameters.
pub(crate) struct CandidateEntry {
    /// Indices of the entries.
    pub singles: Vec<usize>,
}

/// A kind that changes the model instead of adding columns: tilt or delay.
pub(crate) struct ChangeCandidate {
    /// Index of the kind.
    pub kind: usize,
    /// Its place.
    pub spot: CandidatePlace,
}

/// All candidates of a model, derived.
pub(crate) struct DerivedCandidates {
    /// Kinds of the libraries.
    pub kinds: Vec<EffectKind>,
    /// Effects as single entries of a model file.
    pub singles: Vec<SingleCandidate>,
    /// Candidates, each the sum of single entries.
    pub entries: Vec<CandidateEntry>,
    /// Effects whose constants are known.
    pub known: Derivation,
    /// Effects with constants that are searched for; their columns are evaluated for each value.
    pub searched: Derivation,
    /// Effects that depend on the load of the drives, such as load-dependent friction.
    pub load_dependent: Derivation,
    /// The base columns as functions of a tilt about x, y and z, whose constants are the last three; with its kind.
    pub tilt: Option<(ChangeCandidate, Derivation)>,
    /// A delay of the forces.
    pub delay: Option<ChangeCandidate>,
    /// Errors of constants that an earlier search claims: columns of effects are evaluated with those of the model
    /// file, but not those of a tilted base.
    pub constant_errors: Vec<ClaimedConstant>,
}

impl DerivedCandidates {
    /// The values of a derivation's constants with the claimed errors.
    pub(super) fn constant_values(&self, derivation: &Derivation) -> Vec<f64> {
        let error = |name: &str| {
            let claim = self.constant_errors.iter().find(|claim| claim.name == name);
            claim.map_or(0.0, |claim| claim.value)
        };
        let constants = derivation.mechanism.constants.iter();
        constants
            .map(|constant| constant.value + error(&constant.name))
            .collect()
    }
}

/// How often the columns of an effect are evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum EvaluationFrequency {
    /// Once.
    Known,
    /// For every value of a constant.
    Searched,
    /// Again after each fit, since they depend on the load of the drives.
    LoadDependent,
}

/// Derives all candidates of a model.
///
/// Fails when the derivation of a candidate fails.
pub(crate) fn candidates(model: &Model) -> Outcome<DerivedCandidates> {
    let loaded = &model.loaded;
    let mechanism = &loaded.mechanism;
    let all = candidate_places(mechanism);
    let mut singles: Vec<SingleCandidate> = Vec::new();
    let mut entries = Vec::new();
    let mut variants: [CandidateVariant; 3] = Default::default();
    let (mut tilt, mut delay) = (None, None);
    for (k, kind) in loaded.kinds.iter().enumerate() {
        let fitting: Vec<&CandidatePlace> = all
            .iter()
            .filter(|spot| is_applicable(mechanism, kind, spot))
            // Effects that the model has already are no candidates, unless their values are shared with other places;
            // pairs are checked below.
            .filter(|spot| {
                let is_shared = || mechanism.sharing_places(&kind.name, &[spot.place]).is_some();
                kind.places == Some(2) || !has_effect(mechanism, kind, &[*spot]) || is_shared()
            })
            .collect();
        // Tilt and delay change all columns of the model, so they are derived separately.
        if let Some(mechanics @ (Mechanics::Tilt | Mechanics::Delay)) = kind.mechanics {
            if let Some(spot) = fitting.first() {
                let change = ChangeCandidate {
                    kind: k,
                    spot: (*spot).clone(),
                };
                match mechanics {
                    Mechanics::Tilt => tilt = Some(change),
                    _ => delay = Some(change),
                }
            }
            continue;
        }
        // A kind with a constant that is neither known nor searched for cannot be tried.
        if kind.constants.iter().any(|c| c.search.is_none() && c.value.is_none()) {
            continue;
        }
        // Sums refer to the single entries of this kind by their position after the earlier ones.
        let first = singles.len();
        let (places, sums) = place_sets(mechanism, kind, &fitting, &all);
        for spots in places {
            if kind.places == Some(2) && has_effect(mechanism, kind, &spots) {
                continue;
            }
            let single = single_candidate(k, kind, &spots, singles.len(), &[]);
            variants[single.sort as usize].add(mechanism, kind, &single, singles.len());
            singles.push(single);
        }
        for sum in sums {
            entries.push(CandidateEntry {
                singles: sum.iter().map(|i| first + i).collect(),
            });
        }
    }
    // Effects of the model itself come first in the derivation of each variant.
    let own = mechanism.effects.len();
    let [known, searched, carried] = variants;
    let known = known.derive(model, own, &mut singles)?;
    let searched = searched.derive(model, own, &mut singles)?;
    let carried = carried.derive(model, own, &mut singles)?;
    let tilt = match tilt {
        Some(change) => Some((change, derive_tilt(model)?)),
        None => None,
    };
    Ok(DerivedCandidates {
        kinds: loaded.kinds.clone(),
        singles,
        entries,
        known,
        searched,
        load_dependent: carried,
        tilt,
        delay,
        constant_errors: Vec::new(),
    })
}

/// Whether the model has the effect at all of some places already.
fn has_effect(mechanism: &Mechanism, kind: &EffectKind, spots: &[&CandidatePlace]) -> bool {
    let holds = |effect: &ModelEffect| {
        let has = |spot: &&CandidatePlace| effect.places.contains(&spot.place) || effect.other == Some(spot.place);
        spots.iter().all(has)
    };
    // An effect counts as present only if it acts at all of the places.
    let mut effects = mechanism.effects.iter();
    effects.any(|effect| effect.kind == kind.name && holds(effect))
}

/// A kind at its places; constants that are given are not searched for.
pub(crate) fn single_candidate(
    k: usize,
    kind: &EffectKind,
    spots: &[&CandidatePlace],
    number: usize,
    given: &[(String, f64)],
) -> SingleCandidate {
    // Constants with a value are not searched for.
    let is_open = |symbol: &str| given.iter().all(|(known, _)| known != symbol);
    let open = kind.constants.iter().filter(|c| is_open(&c.symbol));
    let searched = open.filter_map(|c| {
        let name = format!("candidate{number}_{}", c.symbol);
        Some((c.symbol.clone(), name, c.search?))
    });
    let constants: Vec<_> = searched.collect();
    let is_range = |c: &(String, String, ConstantSearch)| c.2 != ConstantSearch::Linear;
    SingleCandidate {
        // The most expensive kind of evaluation that an effect needs decides.
        sort: if is_load_dependent(kind) {
            EvaluationFrequency::LoadDependent
        } else if constants.iter().any(is_range) {
            EvaluationFrequency::Searched
        } else {
            EvaluationFrequency::Known
        },
        kind: k,
        spots: spots.iter().copied().cloned().collect(),
        parameters: Vec::new(),
        constants,
        given: given.to_vec(),
    }
}

/// Whether the expression of a kind names the load of its place.
pub(crate) fn is_load_dependent(kind: &EffectKind) -> bool {
    let mut words = kind.expression.split(|c: char| !c.is_alphanumeric() && c != '_');
    words.any(|word| word == "load")
}

/// The model with further effects.
#[derive(Default)]
pub(crate) struct CandidateVariant {
    /// Constants of the effects, with names of their own.
    constants: Vec<ModelConstant>,
    /// The effects.
    effects: Vec<AddedEffect>,
    /// Indices of their single entries, in the same order.
    singles: Vec<usize>,
}

impl CandidateVariant {
    /// Adds an entry as candidate `number`; its parameters and constants get names with that number.
    pub(crate) fn add(&mut self, mechanism: &Mechanism, kind: &EffectKind, single: &SingleCandidate, number: usize) {
        self.singles.push(number);
        let place = single.spots[0].place;
        // Mechanics have only those parameters that act at the place.
        let at_place = (kind.mechanics).and_then(|one| one.parameters_at(mechanism, place));
        let has = |symbol: &str| at_place.as_ref().is_none_or(|those| those.contains(&symbol));
        // Names are unique by the number of the candidate.
        let symbols = kind.parameters.iter().map(|p| &p.symbol);
        let searched =
            (single.constants.iter()).map(|(symbol, name, _)| (symbol.clone(), ConstantValue::Named(name.clone())));
        let given = (single.given.iter()).map(|(symbol, value)| (symbol.clone(), ConstantValue::Number(*value)));
        self.effects.push(AddedEffect {
            kind: kind.name.clone(),
            at: single.spots.iter().map(|spot| spot.name.clone()).collect(),
            parameters: symbols
                .filter(|symbol| has(symbol))
                .map(|symbol| (symbol.clone(), format!("candidate{number}_{symbol}")))
                .collect(),
            constants: searched.chain(given).collect(),
        });
        // Searched constants start at 1; their value is set for each evaluation.
        for (symbol, name, _) in &single.constants {
            let constant = kind.constants.iter().find(|c| c.symbol == *symbol);
            let carries = single.spots[0].carries;
            let unit = constant
                .and_then(|c| c.units.iter().find(|(c, _)| *c == carries))
                .map_or("1", |(_, unit)| unit.as_str());
            self.constants.push(named_constant(name, 1.0, unit));
        }
    }

    /// Derives the columns of its effects alone; `own` effects of the model come before them.
    ///
    /// Fails when the file rejects an effect, or when the derivation fails.
    pub(crate) fn derive(self, model: &Model, own: usize, singles: &mut [SingleCandidate]) -> Outcome<Derivation> {
        let mechanism = &model.loaded.with_additions(&self.constants, &self.effects)?;
        let mut wanted = Vec::new();
        // The derivation numbers parameters anew, so that their indices are stored here.
        for (number, effect) in self.singles.iter().zip(&mechanism.effects[own..]) {
            let terms = effect.terms.iter();
            singles[*number].parameters = terms.map(|term| (term.symbol.clone(), term.parameter.0)).collect();
            wanted.extend(effect.terms.iter().map(|term| term.parameter.0));
        }
        // Only columns of the candidates are derived; those of the model exist already.
        let is_wanted = |product: &ParameterMonomial| product.0.iter().any(|(p, n)| *n == 1 && wanted.contains(p));
        let mut derivation = modelmill_codegen::derive_columns(mechanism, &is_wanted)
            .map_err(|error| Error::derivation(&model.path, error))?;
        // One candidate without a finite value must not stop the others: it is left out when its columns are checked.
        let guards = &mut derivation.programs.regressor.guards;
        guards.retain(|guard| !matches!(guard, PoseGuard::Finite(_)));
        Ok(derivation)
    }
}

/// The columns of all parameters of a model as functions of a tilt of its base.
///
/// Fails when the derivation fails.
pub(crate) fn derive_tilt(model: &Model) -> Outcome<Derivation> {
    let names = ["tx", "ty", "tz"].map(|t| (t.to_owned(), format!("candidate_{t}")));
    let constants = names.each_ref().map(|(_, name)| named_constant(name, 0.0, "rad"));
    let tilt = AddedEffect {
        kind: "gravity_tilt".to_owned(),
        at: vec!["base".to_owned()],
        constants: names.map(|(t, name)| (t, ConstantValue::Named(name))).to_vec(),
        ..AddedEffect::default()
    };
    let variant = model.loaded.with_additions(&constants, &[tilt])?;
    // The tilt changes gravity in all columns, also in those that have no effect or are dependent while the base is level.
    let reduction = &model.derivation.reduction;
    let own: BTreeSet<&ParameterMonomial> = reduction.products.iter().chain(&reduction.without_effect).collect();
    let is_own = |product: &ParameterMonomial| own.contains(product);
    modelmill_codegen::derive_columns(&variant, &is_own).map_err(|error| Error::derivation(&model.path, error))
}

/// A constant of a variant.
fn named_constant(name: &str, value: f64, unit: &str) -> ModelConstant {
    ModelConstant {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
        is_angle: unit == "rad",
        note: None,
    }
}

/// Values that are tried for the constant of a candidate, for a largest rate (per s) and a travel of its place;
/// one value without such a constant.
pub(crate) fn grid(single: &SingleCandidate, [rate, travel]: [f64; 2]) -> Vec<f64> {
    for (_, _, search) in &single.constants {
        let ConstantSearch::Range { from, to, of } = *search else {
            continue;
        };
        let evenly = |count: usize, low: f64, high: f64| -> Vec<f64> {
            let at = |k: usize| low + (high - low) * k as f64 / (count - 1) as f64;
            (0..count).map(at).collect()
        };
        // A range may be relative to the motion of the place.
        let scale = match of {
            Scale::Rate => rate,
            Scale::Travel => travel,
            Scale::One => 1.0,
        };
        if scale <= 0.0 {
            continue;
        }
        return match of {
            // The grid is even in the number of waves per travel, since that is what distinguishes them.
            Scale::Travel if from > 0.0 => {
                // Neighbours differ by less than 0.4 waves over the travel, so that no wavelength is missed
                // between them.
                let (few, many) = (1.0 / to, 1.0 / from);
                let count = (2..WAVES).find(|n| (many - few) / (*n as f64) < 0.4);
                let waves = evenly(count.unwrap_or(WAVES), few, many);
                waves.into_iter().map(|times| scale / times).collect()
            }
            _ if from > 0.0 => {
                let logs = evenly(RATES, (scale * from).ln(), (scale * to).ln());
                logs.into_iter().map(f64::exp).collect()
            }
            _ => evenly(TRIED, scale * from, scale * to),
        };
    }
    vec![1.0]
}

/// The sign of a kind's parameter, as the search knows it.
pub(crate) fn sign(sign: Sign) -> modelmill_identify::diagnose::SignConstraint {
    use modelmill_identify::diagnose::SignConstraint as Known;
    match sign {
        Sign::Positive => Known::Positive,
        Sign::Negative => Known::Negative,
        Sign::Any => Known::Any,
    }
}
