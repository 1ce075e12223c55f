//! A correction of lumped masses: their moments are taken at the point of their forces.

use crate::build::effect_places::EffectTargets;
use crate::diagnostic::{Diagnostic, DiagnosticLog};
use crate::exact::{ExactExpression, ModelSymbol};
use crate::kinds::ActsOn;
use crate::mechanics::{MechanicsEntry, MechanicsSymbols};
use crate::mechanism::{EffectBodies, EffectPlace, EffectTerm, FramePoint, LumpedMass, Mechanism};
use crate::unit::UnitDimension;
use crate::values::SpannedName;

/// The entry of [`crate::Mechanics::Placement`].
pub(crate) struct PlacementMechanics;

impl MechanicsEntry for PlacementMechanics {
    fn description(&self) -> &'static str {
        "m times the moments at the point, less those at `moment_at`"
    }

    fn introduction(&self) -> &'static str {
        "the moments of lumped masses at the point where their forces act; the mass: "
    }

    fn acts_on(&self) -> ActsOn {
        ActsOn::Point
    }

    fn parameters(&self) -> MechanicsSymbols {
        &[("m", UnitDimension::MASS)]
    }

    fn n_places(&self) -> Option<usize> {
        None
    }

    fn check_place(&self, name: &SpannedName, place: EffectPlace, scene: &EffectTargets<'_>, log: &mut DiagnosticLog) {
        // The effect corrects only masses with two different places.
        if displaced_masses(place, &scene.points.points, scene.lumped_masses).is_empty() {
            log.push(
                Diagnostic::error(
                    name.span,
                    "no lumped mass here has different places for forces and for moments",
                )
                .label("expected the point at which the forces of such a mass are taken")
                .help("this effect corrects a `[[lumped_mass]]` whose `moment_at` differs from its `force_at`; for a mass that the model lacks, use `point_mass`"),
            );
        }
    }

    /// Masses at the point of the forces, minus masses whose moments are at `moment_at`. Forces cancel, and a moment
    /// remains.
    fn bodies(&self, terms: &[EffectTerm], places: &[EffectPlace], scene: &EffectTargets<'_>) -> EffectBodies {
        let mut bodies = EffectBodies::default();
        for term in terms {
            let mass = ExactExpression::Symbol(ModelSymbol::Parameter(term.parameter));
            // All lumped masses at all places of the effect share the parameter.
            let all = places
                .iter()
                .flat_map(|place| displaced_masses(*place, &scene.points.points, scene.lumped_masses));
            // The first mass has both places at the point; the second one, negative, keeps the places of the file.
            for lump in all {
                bodies.lumped_masses.push(LumpedMass {
                    mass: mass.clone(),
                    moment_at: lump.force_at.clone(),
                    ..lump.clone()
                });
                bodies.lumped_masses.push(LumpedMass {
                    mass: mass.clone(),
                    share: -lump.share.clone(),
                    ..lump.clone()
                });
            }
        }
        bodies
    }

    fn has_effect_at(&self, mechanism: &Mechanism, place: EffectPlace) -> bool {
        !displaced_masses(place, &mechanism.points, &mechanism.lumped_masses).is_empty()
    }

    /// Places with the same masses belong together, because these are shares of one mass.
    fn groups(&self, mechanism: &Mechanism, places: &[EffectPlace]) -> Option<Vec<Vec<usize>>> {
        // Groups by the list of masses at each place.
        let mut groups: Vec<(Vec<&ExactExpression>, Vec<usize>)> = Vec::new();
        for (i, place) in places.iter().enumerate() {
            // The masses whose moments are misplaced at this point.
            let lumps = displaced_masses(*place, &mechanism.points, &mechanism.lumped_masses);
            let masses: Vec<&ExactExpression> = lumps.into_iter().map(|lump| &lump.mass).collect();
            match groups.iter_mut().find(|(known, _)| *known == masses) {
                Some((_, group)) => group.push(i),
                None => groups.push((masses, vec![i])),
            }
        }
        Some(groups.into_iter().map(|(_, group)| group).collect())
    }
}

/// Lumped masses whose forces are taken at a point, and whose moments are taken at another one.
/// Such a mass is on the frame of the point, and its forces act exactly there.
fn displaced_masses<'a>(place: EffectPlace, points: &[FramePoint], all: &'a [LumpedMass]) -> Vec<&'a LumpedMass> {
    let EffectPlace::Point(point) = place else {
        return Vec::new();
    };
    let point = &points[point.0];
    let is_here = |lump: &LumpedMass| point.frame == lump.frame && point.at == lump.force_at;
    let masses = all.iter();
    masses
        .filter(|lump| is_here(lump) && lump.force_at != lump.moment_at)
        .collect()
}
