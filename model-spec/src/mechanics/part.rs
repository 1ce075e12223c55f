//! Differences of one part from its entry in the model file.
//!
//! The differences are a further part on the same frame, linear in its ten parameters.

use crate::build::effect_places::EffectTargets;
use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::exact::{ExactExpression, ModelSymbol};
use crate::kinds::ActsOn;
use crate::mechanics::{MechanicsEntry, MechanicsSymbols};
use crate::mechanism::{EffectBodies, EffectPlace, EffectTerm, Mechanism, ModelPart, PartInertia};
use crate::schema::EffectEntry;
use crate::unit::UnitDimension;
use crate::values::SpannedName;

/// Differences of mass, first moment and inertia about the origin of the part's frame.
const DIFFERENCES: MechanicsSymbols = &[
    ("dm", UnitDimension::MASS),
    ("dmx", UnitDimension::FIRST_MOMENT),
    ("dmy", UnitDimension::FIRST_MOMENT),
    ("dmz", UnitDimension::FIRST_MOMENT),
    ("dJxx", UnitDimension::INERTIA),
    ("dJxy", UnitDimension::INERTIA),
    ("dJxz", UnitDimension::INERTIA),
    ("dJyy", UnitDimension::INERTIA),
    ("dJyz", UnitDimension::INERTIA),
    ("dJzz", UnitDimension::INERTIA),
];

/// The entry of [`crate::Mechanics::Part`].
pub(crate) struct PartMechanics;

impl MechanicsEntry for PartMechanics {
    fn description(&self) -> &'static str {
        "mass, first moments and inertia of this part only"
    }

    fn introduction(&self) -> &'static str {
        "differences of this part: "
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn::Part
    }

    fn parameters(&self) -> MechanicsSymbols {
        DIFFERENCES
    }

    fn check_place(&self, name: &SpannedName, place: EffectPlace, scene: &EffectTargets<'_>, log: &mut DiagnosticLog) {
        // Only parts reach this check; other places are refused before.
        let EffectPlace::Part(part) = place else {
            return;
        };
        // Names of parts may repeat; then a name does not state which part is meant.
        if !is_only_one(scene.parts, part.0) {
            log.push(
                Diagnostic::error(name.span, format!("several parts are called `{}`", name.text))
                    .label("expected the name of one part")
                    .help("give the parts names of their own: `name = \"...\"` in `[[part]]`"),
            );
        } else if components(&scene.parts[part.0].inertial).is_empty() {
            // Without mass and inertia all differences would be exactly zero.
            log.push(
                Diagnostic::error(name.span, "this part has neither mass nor inertia")
                    .label("there is nothing that could differ"),
            );
        }
    }

    // A quantity that is exactly zero in the file stays zero, such as those of a planar body.
    fn parameters_at(&self, place: EffectPlace, parts: &[ModelPart]) -> Option<Vec<&'static str>> {
        let EffectPlace::Part(part) = place else {
            return None;
        };
        Some(components(&parts[part.0].inertial))
    }

    fn refuse_parameter(&self, entry: &EffectEntry, symbol: &str, those: &[&str], log: &mut DiagnosticLog) {
        // Only parameters that the effect names are reported; the others are left out.
        let named = entry.parameters.iter().flat_map(|table| &table.entries);
        if let Some((key, _)) = named.into_iter().find(|(key, _)| key.name == symbol) {
            log.push(
                Diagnostic::error(key.span, format!("this part has no `{symbol}`"))
                    .label("a quantity that is exactly zero in the part has no difference")
                    .help(format!("here there are {}", those.join(", "))),
            );
        }
    }

    /// The differences of each part as a further part on its frame, about the origin of that frame.
    fn bodies(&self, terms: &[EffectTerm], places: &[EffectPlace], scene: &EffectTargets<'_>) -> EffectBodies {
        // The parameter of a difference, or zero if the effect does not have it.
        let value = |i: usize| {
            let term = terms.iter().find(|term| term.symbol == DIFFERENCES[i].0);
            term.map_or_else(ExactExpression::zero, |term| {
                ExactExpression::Symbol(ModelSymbol::Parameter(term.parameter))
            })
        };
        let further = |place: &EffectPlace| {
            let EffectPlace::Part(part) = place else {
                return None;
            };
            let part = &scene.parts[part.0];
            // The further part is linear in the differences, about the origin of the frame.
            Some(ModelPart {
                name: part.name.clone(),
                frame: part.frame,
                inertial: PartInertia::Linear {
                    mass: value(0),
                    first_moment: std::array::from_fn(|i| value(1 + i)),
                    inertia: std::array::from_fn(|i| value(4 + i)),
                },
            })
        };
        EffectBodies {
            parts: places.iter().filter_map(further).collect(),
            ..EffectBodies::default()
        }
    }

    /// Only if the part shares its parameters with another one; otherwise its own parameters cover the differences.
    fn has_effect_at(&self, mechanism: &Mechanism, place: EffectPlace) -> bool {
        let EffectPlace::Part(part) = place else {
            return false;
        };
        // Another part with one of the same parameters ties the two parts together.
        let parts = &mechanism.parts;
        let own = shared_parameters(&parts[part.0].inertial);
        let mut others = parts.iter().enumerate().filter(|(i, _)| *i != part.0);
        let is_tied = others.any(|(_, other)| {
            let theirs = shared_parameters(&other.inertial);
            own.iter().any(|p| theirs.contains(p))
        });
        is_tied && is_only_one(parts, part.0)
    }
}

/// Whether no other part has the same name.
fn is_only_one(parts: &[ModelPart], part: usize) -> bool {
    let same = parts.iter().filter(|other| other.name == parts[part].name);
    same.count() == 1
}

/// The symbols of the differences that a part can have: those of its quantities that are not exactly zero.
/// Mass, moments and inertia in the order of the differences.
fn components(inertial: &PartInertia) -> Vec<&'static str> {
    let (mass, moments, inertia) = match inertial {
        PartInertia::AboutCentre { mass, centre, inertia } => (mass, centre, inertia),
        PartInertia::Linear {
            mass,
            first_moment,
            inertia,
        } => (mass, first_moment, inertia),
    };
    let values = std::iter::once(mass).chain(moments).chain(inertia);
    DIFFERENCES
        .iter()
        .zip(values)
        .filter(|(_, value)| !value.is_zero())
        .map(|((symbol, _), _)| *symbol)
        .collect()
}

/// The parameters in mass and inertia of a part, which other parts may share.
/// The centre is not included, because it describes one part only.
fn shared_parameters(inertial: &PartInertia) -> Vec<crate::ParameterIdx> {
    let (PartInertia::AboutCentre { mass, inertia, .. } | PartInertia::Linear { mass, inertia, .. }) = inertial;
    let mut found = Vec::new();
    for exact in std::iter::once(mass).chain(inertia) {
        exact.for_each_symbol(&mut |symbol| {
            if let ModelSymbol::Parameter(p) = symbol {
                found.push(p);
            }
        });
    }
    found
}
