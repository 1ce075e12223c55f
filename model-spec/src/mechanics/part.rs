//! Differences of one part from what the model file says of it.

use crate::build::effect_places::Scene;
use crate::diagnostic::{Diagnostic, Log};
use crate::exact::{Exact, Symbol};
use crate::kinds::ActsOn;
use crate::mechanics::{Entry, Symbols};
use crate::mechanism::{Bodies, EffectTerm, Inertial, Mechanism, Part, Place};
use crate::schema::EffectEntry;
use crate::unit::Dimension;
use crate::values::Name;

/// Differences of mass, first moment and inertia about the origin of the part's frame.
const DIFFERENCES: Symbols = &[
    ("dm", Dimension::MASS),
    ("dmx", Dimension::FIRST_MOMENT),
    ("dmy", Dimension::FIRST_MOMENT),
    ("dmz", Dimension::FIRST_MOMENT),
    ("dJxx", Dimension::INERTIA),
    ("dJxy", Dimension::INERTIA),
    ("dJxz", Dimension::INERTIA),
    ("dJyy", Dimension::INERTIA),
    ("dJyz", Dimension::INERTIA),
    ("dJzz", Dimension::INERTIA),
];

pub(crate) struct Difference;

impl Entry for Difference {
    fn words(&self) -> &'static str {
        "mass, first moments and inertia of this part alone"
    }

    fn lead(&self) -> &'static str {
        "differences of this part: "
    }

    fn on(&self) -> ActsOn {
        ActsOn::Part
    }

    fn parameters(&self) -> Symbols {
        DIFFERENCES
    }

    fn check_place(&self, name: &Name, place: Place, scene: &Scene<'_>, log: &mut Log) {
        let Place::Part(part) = place else { return };
        if !is_only_one(scene.parts, part.0) {
            log.push(
                Diagnostic::error(
                    name.span,
                    format!("several parts are called `{}`", name.text),
                )
                .label("expected the name of one part")
                .help("give the parts names of their own: `name = \"...\"` in `[[part]]`"),
            );
        } else if components(&scene.parts[part.0].inertial).is_empty() {
            log.push(
                Diagnostic::error(name.span, "this part has neither mass nor inertia")
                    .label("there is nothing that could differ"),
            );
        }
    }

    fn parameters_at(&self, place: Place, parts: &[Part]) -> Option<Vec<&'static str>> {
        let Place::Part(part) = place else {
            return None;
        };
        Some(components(&parts[part.0].inertial))
    }

    fn refuse_parameter(&self, entry: &EffectEntry, symbol: &str, those: &[&str], log: &mut Log) {
        let named = entry.parameters.iter().flat_map(|table| &table.entries);
        if let Some((key, _)) = named.into_iter().find(|(key, _)| key.name == symbol) {
            log.push(
                Diagnostic::error(key.span, format!("this part has no `{symbol}`"))
                    .label("what the part itself leaves at zero does not differ either")
                    .help(format!("here there are {}", those.join(", "))),
            );
        }
    }

    /// The differences of each part as a further part of its frame.
    fn bodies(&self, terms: &[EffectTerm], places: &[Place], scene: &Scene<'_>) -> Bodies {
        let value = |i: usize| {
            let term = terms.iter().find(|term| term.symbol == DIFFERENCES[i].0);
            term.map_or_else(Exact::zero, |term| {
                Exact::Symbol(Symbol::Parameter(term.parameter))
            })
        };
        let further = |place: &Place| {
            let Place::Part(part) = place else {
                return None;
            };
            let part = &scene.parts[part.0];
            Some(Part {
                name: part.name.clone(),
                frame: part.frame,
                inertial: Inertial::Linear {
                    mass: value(0),
                    first_moment: std::array::from_fn(|i| value(1 + i)),
                    inertia: std::array::from_fn(|i| value(4 + i)),
                },
            })
        };
        Bodies {
            parts: places.iter().filter_map(further).collect(),
            ..Bodies::default()
        }
    }

    /// Where the part shares its parameters with another one.
    fn has_effect_at(&self, mechanism: &Mechanism, place: Place) -> bool {
        let Place::Part(part) = place else {
            return false;
        };
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
fn is_only_one(parts: &[Part], part: usize) -> bool {
    let same = parts.iter().filter(|other| other.name == parts[part].name);
    same.count() == 1
}

/// The quantities that a part has, by the symbols of their differences.
fn components(inertial: &Inertial) -> Vec<&'static str> {
    let (mass, moments, inertia) = match inertial {
        Inertial::AboutCentre {
            mass,
            centre,
            inertia,
        } => (mass, centre, inertia),
        Inertial::Linear {
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

/// The parameters of mass and inertia that another part may have too.
fn shared_parameters(inertial: &Inertial) -> Vec<crate::ParameterIdx> {
    let (Inertial::AboutCentre { mass, inertia, .. } | Inertial::Linear { mass, inertia, .. }) =
        inertial;
    let mut found = Vec::new();
    for exact in std::iter::once(mass).chain(inertia) {
        exact.for_each_symbol(&mut |symbol| {
            if let Symbol::Parameter(p) = symbol {
                found.push(p);
            }
        });
    }
    found
}
