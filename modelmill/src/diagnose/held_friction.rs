//! Candidates for changed friction, used if the friction of the model is fixed at earlier values. Friction
//! differs from day to day; such a change is a disturbance, not a missing effect.

use modelmill_identify::diagnose::{
    CandidateEffect, CandidateNature, ColumnChoice, ColumnSource, EffectParameter, ForceColumn, LocatedEffect,
    SignConstraint,
};
use modelmill_spec::{EffectPlace, EffectTerm};

use crate::model::Model;

/// Kinds of friction whose values change from day to day.
const KINDS: [&str; 2] = ["coulomb_friction", "viscous_friction"];

/// A change of the friction that the model has, for each set of drives that share it; `base` are the columns of
/// all base parameters.
pub(crate) fn changes(model: &Model, base: &[ForceColumn]) -> Vec<CandidateEffect> {
    let effects = &model.derivation.mechanism.effects;
    let own = effects.iter().filter(|effect| KINDS.contains(&effect.kind.as_str()));
    // Dry and viscous friction at the same drives change together.
    let mut of_places: Vec<(&[EffectPlace], Vec<&EffectTerm>)> = Vec::new();
    for effect in own {
        match of_places.iter_mut().find(|(at, _)| *at == &effect.places[..]) {
            Some((_, terms)) => terms.extend(&effect.terms),
            None => of_places.push((&effect.places, effect.terms.iter().collect())),
        }
    }
    let candidates = of_places.into_iter();
    let candidates = candidates.filter_map(|(at, terms)| change(model, base, at, &terms));
    candidates.collect()
}

/// The candidate for one set of drives; `None` if a place is no drive or a term is no base parameter by itself.
fn change(model: &Model, base: &[ForceColumn], at: &[EffectPlace], terms: &[&EffectTerm]) -> Option<CandidateEffect> {
    let drive = |place: &EffectPlace| match place {
        EffectPlace::Drive(d) => Some(d.0),
        _ => None,
    };
    let drives: Vec<usize> = at.iter().map(drive).collect::<Option<_>>()?;
    let reduction = &model.derivation.reduction;
    // The column of a term is that of the base parameter that consists of its parameter alone.
    let base_of = |term: &&EffectTerm| {
        let is_its = |k: &usize| reduction.products[*k].0 == [(term.parameter.0, 1)];
        reduction.retained.iter().position(is_its)
    };
    let which: Vec<usize> = terms.iter().map(base_of).collect::<Option<_>>()?;
    // The estimate is the change of the fixed value.
    let parameter = |(term, k): (&&EffectTerm, &usize)| EffectParameter {
        symbol: format!("change of {}", term.symbol),
        unit: model.base[*k].unit.clone(),
        sign: SignConstraint::Any,
    };
    let names = model.row_names();
    Some(CandidateEffect {
        effect: LocatedEffect {
            kind: "different_runs".to_owned(),
            at: drives.iter().map(|d| names[*d].clone()).collect(),
        },
        parameters: terms.iter().zip(&which).map(parameter).collect(),
        searched_constants: 0,
        is_part_of_load: false,
        refines: None,
        nature: CandidateNature::Disturbance,
        is_per_run: false,
        source: ColumnSource::Columns(vec![ColumnChoice {
            constants: Vec::new(),
            columns: which.iter().map(|k| base[*k].clone()).collect(),
        }]),
    })
}
