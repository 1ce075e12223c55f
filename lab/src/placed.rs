//! Effects by kind and place, as truth, answers and aliases name them, and when two sets of them say the same.

use std::collections::BTreeSet;

/// A kind at its places.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlacedEffect {
    /// Kind, as in `cli.md`.
    pub kind: String,
    /// Places; one effect on both drives lists both.
    pub at: Vec<String>,
}

impl PlacedEffect {
    /// A kind at places that are named.
    pub fn new(kind: &str, at: &[&str]) -> Self {
        Self {
            kind: kind.to_owned(),
            at: at.iter().map(|place| (*place).to_owned()).collect(),
        }
    }
}

impl std::fmt::Display for PlacedEffect {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}@{}", self.kind, self.at.join("+"))
    }
}

/// Kinds that hold another one at the same place: with one of their values at zero they are it.
pub const HOLDS: [(&str, &str); 2] = [
    ("directional_viscous_friction", "viscous_friction"),
    ("spring", "force_offset"),
];

/// A kind at one place.
pub type EffectAtom = (String, String);

/// What a set of effects says, kind by place, so that two ways of saying the same thing are equal.
///
/// One effect on both drives and one for each are alike. Offset and Coulomb friction make Coulomb friction that differs
/// by direction, exactly. Viscous friction beside the directional one, and an offset beside a spring whose rest is not
/// known, add nothing.
pub fn atoms<'a>(effects: impl IntoIterator<Item = &'a PlacedEffect>) -> BTreeSet<EffectAtom> {
    let mut atoms = BTreeSet::new();
    for effect in effects {
        for place in &effect.at {
            let mut put = |kind: &str| atoms.insert((kind.to_owned(), place.clone()));
            if effect.kind == "directional_coulomb_friction" {
                put("coulomb_friction");
                put("force_offset");
            } else {
                put(&effect.kind);
            }
        }
    }
    for (more, less) in HOLDS {
        let places: Vec<String> = atoms
            .iter()
            .filter(|(kind, _)| kind == more)
            .map(|(_, place)| place.clone())
            .collect();
        for place in places {
            atoms.remove(&(less.to_owned(), place));
        }
    }
    atoms
}
