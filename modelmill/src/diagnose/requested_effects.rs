//! An effect that the user names, such as `coulomb_friction@motor:Fc=25.9`: it is derived like a candidate.
//! Output are its columns along recordings.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::diagnose::{CandidateEffect, ColumnChoice, ColumnSource, ForceColumn, LocatedEffect};
use modelmill_spec::edit::NewEffect;
use modelmill_spec::{ActsOn, ConstantSearch, DriveKind, EffectKind, EffectPlace, Mechanics, Mechanism};

use crate::error::{Error, Outcome};
use crate::model::Model;

use super::candidates::{
    CandidateEntry, CandidateVariant, ChangeCandidate, DerivedCandidates, derive_tilt, is_load_dependent,
    single_candidate,
};
use super::columns::{candidate_columns, load_dependent_columns};
use super::places::{CandidatePlace, candidate_places};
use crate::regressors::{SegmentList, regressor};

/// An effect by its name, with values of its parameters and constants.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedEffect {
    /// Kind and places.
    pub effect: LocatedEffect,
    /// Values by the symbols of the kind, SI units.
    pub values: Vec<(String, f64)>,
}

impl NamedEffect {
    /// Reads `KIND@PLACE,PLACE:NAME=VALUE:NAME=VALUE`, values in SI units.
    ///
    /// Fails with a message that gives the expected form.
    ///
    /// ```
    /// use modelmill::diagnose::NamedEffect;
    ///
    /// let effect = NamedEffect::parse("coulomb_friction@motor:Fc=25.9").unwrap();
    /// assert_eq!(effect.effect.kind, "coulomb_friction");
    /// assert_eq!(effect.values, [("Fc".to_owned(), 25.9)]);
    /// ```
    pub fn parse(text: &str) -> Result<Self, String> {
        let expected = || {
            "expected KIND@PLACE, such as coulomb_friction@motor. Write several places with commas, and values after colons: \
             coulomb_friction@motor:Fc=25.9"
                .to_owned()
        };
        // Kind and places come before the first colon, values after it.
        let mut parts = text.split(':');
        let (kind, places) = parts
            .next()
            .and_then(|effect| effect.split_once('@'))
            .ok_or_else(expected)?;
        let at: Vec<String> = places.split(',').map(|place| place.trim().to_owned()).collect();
        if kind.trim().is_empty() || at.iter().any(String::is_empty) {
            return Err(expected());
        }
        if let Some(twice) = (0..at.len()).find(|k| at[..*k].contains(&at[*k])) {
            return Err(format!("the place `{}` is given twice", at[twice]));
        }
        let mut values: Vec<(String, f64)> = Vec::new();
        for part in parts {
            let (symbol, value) = part.split_once('=').ok_or_else(expected)?;
            let symbol = symbol.trim();
            let value = match value.trim().parse::<f64>() {
                Ok(value) if value.is_finite() => value,
                _ => return Err(format!("`{}` is not a finite number", value.trim())),
            };
            if values.iter().any(|(known, _)| known == symbol) {
                return Err(format!("`{symbol}` is given two values"));
            }
            values.push((symbol.to_owned(), value));
        }
        Ok(Self {
            effect: LocatedEffect {
                kind: kind.trim().to_owned(),
                at,
            },
            values,
        })
    }
}

/// How constants without a given value are determined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ConstantPolicy {
    /// They are searched for.
    Searched,
    /// They have the default value of the library.
    Usual,
}

/// A named effect with its derivation.
pub(crate) struct ChosenEffect {
    /// What the user named.
    pub named: NamedEffect,
    /// Its kind.
    pub kind: EffectKind,
    /// Its derivation, in the form of candidates.
    candidates: DerivedCandidates,
}

/// Derives a named effect.
///
/// Fails, as `add` would, if kind, place or value is unknown or the model has the effect already.
pub(crate) fn derive_effect(model: &Model, named: &NamedEffect, constants: ConstantPolicy) -> Outcome<ChosenEffect> {
    let loaded = &model.loaded;
    check_effect(model, named)?;
    let mechanism = &loaded.mechanism;
    let kind_is = |kind: &&EffectKind| kind.name == named.effect.kind;
    let kind = loaded.kinds.iter().find(kind_is).cloned();
    let kind = kind.ok_or_else(|| Error::input(format!("unknown kind {:?}", named.effect)))?;
    if kind.mechanics == Some(Mechanics::Delay) {
        return Err(Error::input(format!(
            "`{}` only delays all forces and adds none, so no motion can be planned that makes its force large. Record fast and \
             slow passages, and reversals at high acceleration",
            kind.name
        )));
    }
    let all = candidate_places(mechanism);
    // Stage 1: find the places by their names.
    let of_kind = named.effect.at.iter().enumerate().map(|(k, place)| {
        // The second place of a kind is only an argument of its expression; the effect does not act there.
        let moves =
            |one: &&CandidatePlace| one.name == *place && matches!(one.sort, ActsOn::Drive | ActsOn::Coordinate);
        match all.iter().find(moves) {
            Some(other) if k > 0 && kind.other.is_some() => Ok(other.clone()),
            _ => find_place(mechanism, &kind, &all, place),
        }
    });
    let places: Vec<CandidatePlace> = of_kind.collect::<Outcome<_>>()?;
    // Stage 2: one entry, or one for each place, in the variant that its evaluation needs.
    let mut singles = Vec::new();
    let mut variants: [CandidateVariant; 3] = Default::default();
    let mut tilt = None;
    let mut entries = Vec::new();
    if kind.mechanics == Some(Mechanics::Tilt) {
        let change = ChangeCandidate {
            kind: 0,
            spot: places[0].clone(),
        };
        tilt = Some((change, derive_tilt(model)?));
    } else {
        let given = fixed_constants(&kind, named, constants)?;
        let all: Vec<EffectPlace> = places.iter().map(|spot| spot.place).collect();
        let grouped = kind.mechanics.and_then(|one| one.groups(mechanism, &all));
        // A kind for two places, or a mechanics that joins places, is one entry for all of them.
        let joined = kind.places.is_some() || grouped.is_some();
        let together = if joined { places.len() } else { 1 };
        for group in places.chunks(together) {
            let group: Vec<&CandidatePlace> = group.iter().collect();
            let one = single_candidate(0, &kind, &group, singles.len(), &given);
            variants[one.sort as usize].add(mechanism, &kind, &one, singles.len());
            singles.push(one);
        }
        entries.push(CandidateEntry {
            singles: (0..singles.len()).collect(),
        });
    }
    // Stage 3: derive the variants; those without effects are empty.
    let own = mechanism.effects.len();
    let [known, searched, carried] = variants;
    Ok(ChosenEffect {
        candidates: DerivedCandidates {
            kinds: vec![kind.clone()],
            known: known.derive(model, own, &mut singles)?,
            searched: searched.derive(model, own, &mut singles)?,
            load_dependent: carried.derive(model, own, &mut singles)?,
            singles,
            entries,
            tilt,
            delay: None,
            constant_errors: Vec::new(),
        },
        named: named.clone(),
        kind,
    })
}

/// Fails for what `add` would refuse: an unknown kind, place or symbol, or an effect that the model has.
fn check_effect(model: &Model, named: &NamedEffect) -> Outcome {
    // The same edit that `add` would make detects all faults.
    let kinds = &model.loaded.kinds;
    let mut effect = NewEffect {
        kind: named.effect.kind.clone(),
        at: named.effect.at.clone(),
        ..NewEffect::default()
    };
    if let Some(kind) = kinds.iter().find(|kind| kind.name == effect.kind) {
        let constants: Vec<&str> = kind.constants.iter().map(|c| c.symbol.as_str()).collect();
        let parameters = kind.parameters.iter().map(|p| p.symbol.as_str());
        let known: Vec<&str> = parameters.chain(constants.iter().copied()).collect();
        for (symbol, value) in &named.values {
            if !known.contains(&symbol.as_str()) {
                return Err(Error::input(format!(
                    "`{}` has no parameter or constant `{symbol}`; it has {}",
                    kind.name,
                    known.join(", ")
                )));
            }
            if constants.contains(&symbol.as_str()) {
                effect.constants.push((symbol.clone(), *value));
            }
        }
        // A constant without a value is searched for later, so any value will do for this check.
        for one in kind.constants.iter().filter(|c| c.value.is_none()) {
            if effect.constants.iter().all(|(symbol, _)| *symbol != one.symbol) {
                effect.constants.push((one.symbol.clone(), 1.0));
            }
        }
    }
    // The edit is only tried; its result is not used.
    model.host().edit(&model.path, model.text(), &effect)?;
    Ok(())
}

/// The place of a kind by its name.
///
/// Fails when the kind has no effect at the place; the message names the drive if the name is that of its
/// joint.
fn find_place(mechanism: &Mechanism, kind: &EffectKind, all: &[CandidatePlace], name: &str) -> Outcome<CandidatePlace> {
    // The kind must be able to act at the place.
    let suits = |spot: &&CandidatePlace| spot.name == name && kind.on.contains(&spot.sort);
    if let Some(spot) = all.iter().find(suits) {
        return Ok(spot.clone());
    }
    // A joint with a drive has the name of the drive.
    let drive = mechanism.drives.iter().find(|drive| match drive.kind {
        DriveKind::Joint(i) => mechanism.coordinates[i.0].name == name,
        DriveKind::Linear { .. } => false,
    });
    let advice = match drive {
        Some(drive) if kind.on.contains(&ActsOn::Drive) => format!(
            "this is the joint of the drive `{}`; name the drive instead",
            drive.name
        ),
        _ => "it has no effect there".to_owned(),
    };
    Err(Error::input(format!("`{}` at `{name}`: {advice}", kind.name)))
}

/// Constants with a value: given ones and, if none are searched for, default ones. Constants that enter
/// linearly, such as the neutral position of a spring, are always estimated with the parameters.
///
/// Fails when a constant has neither a value nor a default.
fn fixed_constants(kind: &EffectKind, named: &NamedEffect, constants: ConstantPolicy) -> Outcome<Vec<(String, f64)>> {
    let mut given = Vec::new();
    for constant in &kind.constants {
        if constant.search == Some(ConstantSearch::Linear) {
            continue;
        }
        let stated = named.values.iter().find(|(symbol, _)| *symbol == constant.symbol);
        // Defaults of the library are texts, which may be expressions.
        let usual = constant.value.as_ref().and_then(|text| text.parse::<f64>().ok());
        match (stated, constants, constant.search, usual) {
            (Some((_, value)), ..) => given.push((constant.symbol.clone(), *value)),
            (None, ConstantPolicy::Usual, Some(_), Some(value)) => {
                given.push((constant.symbol.clone(), value));
            }
            (None, ConstantPolicy::Searched, Some(_), _) | (None, _, None, Some(_)) => {}
            (None, ..) => {
                return Err(Error::input(format!(
                    "`{}` has no default value of `{symbol}`; give one with {}@{}:{symbol}=VALUE",
                    kind.name,
                    kind.name,
                    named.effect.at.join(","),
                    symbol = constant.symbol
                )));
            }
        }
    }
    Ok(given)
}

impl ChosenEffect {
    /// The effect along recordings, with its columns for each value of a constant that is searched for; `None`
    /// if all columns are zero. `load` is the force that the drives transmit, N or N m.
    ///
    /// Fails when the effect has no finite value at some samples, or a pose has no solution.
    pub(crate) fn candidate(
        &self,
        model: &Model,
        all: &SegmentList<'_>,
        load: &ForceColumn,
    ) -> Outcome<Option<(CandidateEffect, Vec<ColumnChoice>)>> {
        // There is a single candidate, the chosen effect.
        let mut made = candidate_columns(&self.candidates, model, all)?;
        let grids = std::mem::take(&mut made.grids);
        if let Some(effect) = made.undefined.first() {
            return Err(Error::input(format!(
                "`{}` at {} has no finite value at some samples of the motion. Check the quotients, roots and exponentials of \
                 its expression",
                effect.kind,
                effect.at.join(", ")
            )));
        }
        let Some(candidate) = made.candidates.into_iter().next() else {
            return Ok(None);
        };
        // Effects without searched constants have one choice.
        let only = |columns: Vec<ForceColumn>| {
            vec![ColumnChoice {
                constants: Vec::new(),
                columns,
            }]
        };
        let choices = match &candidate.source {
            ColumnSource::Columns(choices) => choices.clone(),
            ColumnSource::LoadDependent => {
                let tried = |single: usize| grids[single].clone();
                let made = load_dependent_columns(&self.candidates, model, all, load, None, &tried)?;
                made.into_iter().next().map_or_else(Vec::new, |(_, choices)| choices)
            }
            // A tilt has one column for each axis: the change of all base columns times their nominal values.
            ColumnSource::Tilt(tilt) => {
                let level = vec![0.0; tilt.axes.len()];
                let sum = |direction: [f64; 3]| {
                    let mut sum = ForceColumn(vec![None; model.row_names().len()]);
                    for (share, change) in direction.iter().zip(&tilt.components) {
                        for (nominal, change) in model.values.iter().zip(&change.base) {
                            sum.add(share * nominal, change);
                        }
                    }
                    sum
                };
                only(tilt.directions(&level).into_iter().map(sum).collect())
            }
            ColumnSource::ReadingFault(_) | ColumnSource::Body(_) | ColumnSource::Constant(_) => Vec::new(),
        };
        Ok(Some((candidate, choices)))
    }

    /// Whether its columns depend on the nominal values of the model.
    pub(crate) fn needs_nominal(&self) -> bool {
        self.candidates.tilt.is_some() || is_load_dependent(&self.kind)
    }
}

/// Columns of the base parameters to estimate, the load of the nominal bodies, and the force of the known parameters.
///
/// Fails when a pose has no solution.
pub(crate) fn base_columns(
    model: &Model,
    all: &SegmentList<'_>,
) -> Outcome<(Vec<ForceColumn>, ForceColumn, ForceColumn)> {
    let every = regressor(all, &ModelEvaluator::new(&model.derivation), model)?;
    let none = ForceColumn(vec![None; model.row_names().len()]);
    // The load is the force of all bodies; the known force is subtracted before a fit.
    let (mut load, mut known) = (none.clone(), none);
    let mut free = Vec::new();
    // Bodies make the load; effects such as friction do not.
    for (k, column) in every.into_iter().enumerate() {
        if !model.is_effect(k) {
            load.add(model.values[k], &column);
        }
        if model.is_known(k) {
            known.add(model.values[k], &column);
        } else {
            free.push(column);
        }
    }
    let samples = all.iter().map(|(one, _)| one.time().len()).sum();
    // Drives without load have zeros, so that load-dependent effects can be evaluated.
    for channel in &mut load.0 {
        channel.get_or_insert_with(|| vec![0.0; samples]);
    }
    Ok((free, load, known))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn effects_are_read_and_nonsense_is_refused() {
        let read = NamedEffect::parse("stribeck_friction@a,b:Fs=15:vs=-2e-2").unwrap();
        assert_eq!(read.effect.kind, "stribeck_friction");
        assert_eq!(read.effect.at, ["a", "b"]);
        let values = [("Fs".to_owned(), 15.0), ("vs".to_owned(), -0.02)];
        assert_eq!(read.values, values);
        for text in [
            "spring",
            "@a",
            "spring@",
            "spring@a,",
            "spring@a,a",
            "spring@a:k",
            "spring@a:k=x",
            "spring@a:k=nan",
            "spring@a:k=1:k=2",
        ] {
            assert!(NamedEffect::parse(text).is_err(), "{text}");
        }
    }
}
