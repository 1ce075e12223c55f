//! Every effect that may be missing, as the entry that `add` would write, in variants of the model: their derivation gives
//! the columns of all.
//!
//! Decision: a candidate is the entry that `add` would write, and its columns come from the derivation of that
//! entry. So there is no second definition of an effect, and effect kinds of a user's own library are tried like
//! all others.

use modelmill_codegen::{Derivation, Guard, Monomial};
use modelmill_spec::{
    AddedEffect, Constant, ConstantValue, Effect, EffectKind, Mechanics, Mechanism, Scale, Search,
    Sign,
};

use crate::error::{Error, Outcome};
use crate::model::Model;

use super::places::{Spot, fits, sets, spots};

/// Values of a constant that are tried where the search has no scale of its own.
const TRIED: usize = 15;
/// Values of a rate that are tried.
const RATES: usize = 14;
/// Wavelengths that are tried at most.
const WAVES: usize = 120;

/// An effect as one entry of a model file.
pub(crate) struct Single {
    pub kind: usize,
    pub spots: Vec<Spot>,
    pub sort: Sort,
    /// Symbols of its parameters with their positions among those of its variant.
    pub parameters: Vec<(String, usize)>,
    /// Symbols of constants that are searched for, with their names in the variant and how.
    pub constants: Vec<(String, String, Search)>,
    /// Symbols of constants whose values are given.
    pub given: Vec<(String, f64)>,
}

impl Single {
    /// The symbol of the constant whose value is tried.
    pub(crate) fn range(&self) -> Option<&str> {
        let is_range = |c: &&(String, String, Search)| matches!(c.2, Search::Range { .. });
        let found = self.constants.iter().find(is_range);
        found.map(|(symbol, _, _)| symbol.as_str())
    }
}

/// A candidate: entries whose columns add up, since they share their parameters.
pub(crate) struct Entry {
    pub singles: Vec<usize>,
}

/// A kind that is a change of the model rather than columns of its own.
pub(crate) struct Change {
    pub kind: usize,
    pub spot: Spot,
}

/// All candidates of a model, derived.
pub(crate) struct Candidates {
    pub kinds: Vec<EffectKind>,
    pub singles: Vec<Single>,
    pub entries: Vec<Entry>,
    /// Effects whose constants are known.
    pub known: Derivation,
    /// Effects with constants that are searched for, whose columns are evaluated again and again.
    pub searched: Derivation,
    /// Effects that depend on what the drives carry.
    pub carried: Derivation,
    /// The base columns as functions of a tilt about x, y and z, whose constants are the last three; with its kind.
    pub tilt: Option<(Change, Derivation)>,
    /// A delay of the forces.
    pub delay: Option<Change>,
}

/// How often the columns of an effect are evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sort {
    /// Once.
    Known,
    /// For every value of a constant.
    Searched,
    /// Whenever a fit says anew what the drives carry.
    Carried,
}

/// Derives all candidates of a model.
pub(crate) fn candidates(model: &Model) -> Outcome<Candidates> {
    let loaded = &model.loaded;
    let mechanism = &loaded.mechanism;
    let all = spots(mechanism);
    let mut singles: Vec<Single> = Vec::new();
    let mut entries = Vec::new();
    let mut variants: [Variant; 3] = Default::default();
    let (mut tilt, mut delay) = (None, None);
    for (k, kind) in loaded.kinds.iter().enumerate() {
        let fitting: Vec<&Spot> = all
            .iter()
            .filter(|spot| fits(mechanism, kind, spot))
            .filter(|spot| kind.places == Some(2) || !has(mechanism, kind, &[*spot]))
            .collect();
        if let Some(mechanics @ (Mechanics::Tilt | Mechanics::Delay)) = kind.mechanics {
            if let Some(spot) = fitting.first() {
                let change = Change {
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
        // What must be known and is not cannot be tried.
        if kind
            .constants
            .iter()
            .any(|c| c.search.is_none() && c.value.is_none())
        {
            continue;
        }
        let first = singles.len();
        let (places, sums) = sets(mechanism, kind, &fitting, &all);
        for spots in places {
            if kind.places == Some(2) && has(mechanism, kind, &spots) {
                continue;
            }
            let single = single(k, kind, &spots, singles.len(), &[]);
            variants[single.sort as usize].add(mechanism, kind, &single, singles.len());
            singles.push(single);
        }
        for sum in sums {
            entries.push(Entry {
                singles: sum.iter().map(|i| first + i).collect(),
            });
        }
    }
    let own = mechanism.effects.len();
    let [known, searched, carried] = variants;
    let known = known.derive(model, own, &mut singles)?;
    let searched = searched.derive(model, own, &mut singles)?;
    let carried = carried.derive(model, own, &mut singles)?;
    let tilt = match tilt {
        Some(change) => Some((change, tilted(model)?)),
        None => None,
    };
    Ok(Candidates {
        kinds: loaded.kinds.clone(),
        singles,
        entries,
        known,
        searched,
        carried,
        tilt,
        delay,
    })
}

/// Whether the model has the effect at all of some places already.
fn has(mechanism: &Mechanism, kind: &EffectKind, spots: &[&Spot]) -> bool {
    let holds = |effect: &Effect| {
        let has =
            |spot: &&Spot| effect.places.contains(&spot.place) || effect.other == Some(spot.place);
        spots.iter().all(has)
    };
    let mut effects = mechanism.effects.iter();
    effects.any(|effect| effect.kind == kind.name && holds(effect))
}

/// A kind at its places; constants that are given are not searched for.
pub(crate) fn single(
    k: usize,
    kind: &EffectKind,
    spots: &[&Spot],
    number: usize,
    given: &[(String, f64)],
) -> Single {
    let is_open = |symbol: &str| given.iter().all(|(known, _)| known != symbol);
    let open = kind.constants.iter().filter(|c| is_open(&c.symbol));
    let searched = open.filter_map(|c| {
        let name = format!("candidate{number}_{}", c.symbol);
        Some((c.symbol.clone(), name, c.search?))
    });
    let constants: Vec<_> = searched.collect();
    let is_range = |c: &(String, String, Search)| c.2 != Search::Linear;
    Single {
        sort: if uses_load(kind) {
            Sort::Carried
        } else if constants.iter().any(is_range) {
            Sort::Searched
        } else {
            Sort::Known
        },
        kind: k,
        spots: spots.iter().copied().cloned().collect(),
        parameters: Vec::new(),
        constants,
        given: given.to_vec(),
    }
}

/// Whether the expression of a kind names the load of its place.
pub(crate) fn uses_load(kind: &EffectKind) -> bool {
    let mut words = kind
        .expression
        .split(|c: char| !c.is_alphanumeric() && c != '_');
    words.any(|word| word == "load")
}

/// The model with effects besides.
#[derive(Default)]
pub(crate) struct Variant {
    constants: Vec<Constant>,
    effects: Vec<AddedEffect>,
    /// Which candidates it holds, in order.
    singles: Vec<usize>,
}

impl Variant {
    pub(crate) fn add(
        &mut self,
        mechanism: &Mechanism,
        kind: &EffectKind,
        single: &Single,
        number: usize,
    ) {
        self.singles.push(number);
        let place = single.spots[0].place;
        let at_place = (kind.mechanics).and_then(|one| one.parameters_at(mechanism, place));
        let has = |symbol: &str| {
            at_place
                .as_ref()
                .is_none_or(|those| those.contains(&symbol))
        };
        let symbols = kind.parameters.iter().map(|p| &p.symbol);
        let searched = (single.constants.iter())
            .map(|(symbol, name, _)| (symbol.clone(), ConstantValue::Named(name.clone())));
        let given = (single.given.iter())
            .map(|(symbol, value)| (symbol.clone(), ConstantValue::Number(*value)));
        self.effects.push(AddedEffect {
            kind: kind.name.clone(),
            at: single.spots.iter().map(|spot| spot.name.clone()).collect(),
            parameters: symbols
                .filter(|symbol| has(symbol))
                .map(|symbol| (symbol.clone(), format!("candidate{number}_{symbol}")))
                .collect(),
            constants: searched.chain(given).collect(),
        });
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
    pub(crate) fn derive(
        self,
        model: &Model,
        own: usize,
        singles: &mut [Single],
    ) -> Outcome<Derivation> {
        let mechanism = &model.loaded.with(&self.constants, &self.effects)?;
        let mut wanted = Vec::new();
        for (number, effect) in self.singles.iter().zip(&mechanism.effects[own..]) {
            let terms = effect.terms.iter();
            singles[*number].parameters = terms
                .map(|term| (term.symbol.clone(), term.parameter.0))
                .collect();
            wanted.extend(effect.terms.iter().map(|term| term.parameter.0));
        }
        let is_wanted =
            |product: &Monomial| product.0.iter().any(|(p, n)| *n == 1 && wanted.contains(p));
        let mut derivation = modelmill_codegen::derive_columns(mechanism, &is_wanted)
            .map_err(|error| Error::derivation(&model.path, error))?;
        // One candidate without a finite value somewhere must not stop the others: who looks at the columns leaves it out.
        let guards = &mut derivation.programs.regressor.guards;
        guards.retain(|guard| !matches!(guard, Guard::Finite(_)));
        Ok(derivation)
    }
}

/// The base columns of a model as functions of a tilt of its base.
pub(crate) fn tilted(model: &Model) -> Outcome<Derivation> {
    let names = ["tx", "ty", "tz"].map(|t| (t.to_owned(), format!("candidate_{t}")));
    let constants = names
        .each_ref()
        .map(|(_, name)| named_constant(name, 0.0, "rad"));
    let tilt = AddedEffect {
        kind: "gravity_tilt".to_owned(),
        at: vec!["base".to_owned()],
        constants: names
            .map(|(t, name)| (t, ConstantValue::Named(name)))
            .to_vec(),
        ..AddedEffect::default()
    };
    let variant = model.loaded.with(&constants, &[tilt])?;
    let reduction = &model.derivation.reduction;
    let base: Vec<&Monomial> = reduction
        .retained
        .iter()
        .map(|k| &reduction.products[*k])
        .collect();
    let is_base = |product: &Monomial| base.contains(&product);
    modelmill_codegen::derive_columns(&variant, &is_base)
        .map_err(|error| Error::derivation(&model.path, error))
}

fn named_constant(name: &str, value: f64, unit: &str) -> Constant {
    Constant {
        name: name.to_owned(),
        value,
        unit: unit.to_owned(),
        is_angle: unit == "rad",
        note: None,
    }
}

/// Values that are tried for the constant that a candidate searches for, given the largest rate and the travel of its place;
/// one where there is none.
pub(crate) fn grid(single: &Single, [rate, travel]: [f64; 2]) -> Vec<f64> {
    for (_, _, search) in &single.constants {
        let Search::Range { from, to, of } = *search else {
            continue;
        };
        let evenly = |count: usize, low: f64, high: f64| -> Vec<f64> {
            let at = |k: usize| low + (high - low) * k as f64 / (count - 1) as f64;
            (0..count).map(at).collect()
        };
        let scale = match of {
            Scale::Rate => rate,
            Scale::Travel => travel,
            Scale::One => 1.0,
        };
        if scale <= 0.0 {
            continue;
        }
        return match of {
            // Waves differ by how often they fit into the travel.
            Scale::Travel if from > 0.0 => {
                // So many that neighbours differ by less than half a wave over the travel.
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
pub(crate) fn sign(sign: Sign) -> modelmill_identify::diagnose::Sign {
    use modelmill_identify::diagnose::Sign as Known;
    match sign {
        Sign::Positive => Known::Positive,
        Sign::Negative => Known::Negative,
        Sign::Any => Known::Any,
    }
}
