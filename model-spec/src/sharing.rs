//! Places of effects that share their parameters. A mechanism and some places go in; the other places with the same
//! parameters come out.

use crate::mechanism::{EffectPlace, Mechanism, ModelEffect};

impl Mechanism {
    /// Other places of a kind of effect that have the parameters of some places; `None` if an effect acts at one of
    /// these with parameters of its own, or if none acts there. A further effect at these places alone then has
    /// columns that the mechanism lacks: it is what they differ by.
    pub fn sharing_places(&self, kind: &str, places: &[EffectPlace]) -> Option<Vec<EffectPlace>> {
        let of_kind = || self.effects.iter().filter(|effect| effect.kind == kind);
        let mut sharing: Vec<EffectPlace> = Vec::new();
        for effect in of_kind().filter(|effect| effect.places.iter().any(|place| places.contains(place))) {
            if effect.mechanics.is_some() || effect.other.is_some() || effect.terms.is_empty() {
                return None;
            }
            let is_used = |other: &ModelEffect| {
                let mut terms = effect.terms.iter();
                terms.all(|term| other.terms.iter().any(|one| one.parameter == term.parameter))
            };
            let all = of_kind().filter(|other| is_used(other)).flat_map(|other| &other.places);
            let others: Vec<EffectPlace> = all.filter(|place| !places.contains(place)).copied().collect();
            if others.is_empty() {
                return None;
            }
            sharing.extend(others);
        }
        let mut seen = Vec::new();
        sharing.retain(|place| {
            !seen.contains(place) && {
                seen.push(*place);
                true
            }
        });
        (!sharing.is_empty()).then_some(sharing)
    }
}
