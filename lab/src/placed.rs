//! Effects by kind and place, as truth, answers and aliases name them, and the equivalence of two sets of them.

use std::collections::BTreeSet;

/// A kind at its places.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlacedEffect {
    /// Kind, as named in `cli.md`.
    pub kind: String,
    /// Places; one effect on both drives lists both.
    pub at: Vec<String>,
}

impl PlacedEffect {
    /// A kind at named places.
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

/// Pairs of kinds at one place: the first contains the second as a special case.
pub const HOLDS: [(&str, &str); 2] = [
    ("directional_viscous_friction", "viscous_friction"),
    ("spring", "force_offset"),
];

/// A kind at one place.
pub type EffectAtom = (String, String);

/// The kinds of a set of effects at each place, in a form in which equivalent sets are equal.
///
/// One effect on both drives equals one effect on each. Directional Coulomb friction is exactly Coulomb friction with
/// an offset. Viscous friction adds nothing to its directional form, and an offset adds nothing to a spring.
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
    // A kind that another one at the same place contains is removed.
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
