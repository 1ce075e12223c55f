//! Effects whose kinds have mechanics of their own: rods, lumped masses placed elsewhere, untied parts, a tilted base,
//! late readings.
//!
//! An effect's places and parameters go in, bodies and turned gravity come out.

use crate::build::effect_places::Scene;
use crate::build::symbols::Symbols;
use crate::diagnostic::{Diagnostic, Log};
use crate::exact::{ConstantIdx, Exact, Function, Symbol};
use crate::kind_mechanics::PART;
use crate::mechanism::{
    Action, Constant, DriveKind, Effect, EffectTerm, Inertial, LumpedMass, Part, Place,
};
use crate::schema::EffectEntry;
use crate::scope::{Sort, meaning};
use crate::unit::Dimension;
use crate::values::{MechanicsName, Name};

/// Checks that there is something to act on at each place; `None` if not.
pub(super) fn check_places(
    way: MechanicsName,
    names: &[Name],
    places: &[Place],
    scene: &Scene<'_>,
    log: &mut Log,
) -> Option<()> {
    let before = log.n_errors();
    for (name, place) in names.iter().zip(places) {
        match (way, place) {
            (MechanicsName::Rod, Place::Drive(drive))
                if matches!(scene.drives[drive.0].kind, DriveKind::Joint(_)) =>
            {
                log.push(
                    Diagnostic::error(name.span, "a rod cannot act here")
                        .label("this drive is no line between two points")
                        .help("a rod lies along a drive with `linear = { from = ..., to = ... }`"),
                );
            }
            (MechanicsName::Placement, Place::Point(_))
                if displaced(place, scene).next().is_none() =>
            {
                log.push(
                    Diagnostic::error(
                        name.span,
                        "no lumped mass here has different places for forces and for moments",
                    )
                    .label("expected the point at which the forces of such a mass are taken")
                    .help("this effect corrects a `[[lumped_mass]]` whose `moment_at` differs from its `force_at`; for a mass that the model lacks, take `point_mass`"),
                );
            }
            (MechanicsName::Part, Place::Part(part)) => {
                let same = |other: &&Part| other.name == scene.parts[part.0].name;
                if scene.parts.iter().filter(same).count() > 1 {
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
            _ => {}
        }
    }
    (log.n_errors() == before).then_some(())
}

/// Symbols that an effect of this kind has at its place, where they depend on it.
pub(super) fn declared(
    way: Option<MechanicsName>,
    places: &[Place],
    scene: &Scene<'_>,
) -> Option<Vec<&'static str>> {
    match (way, places) {
        (Some(MechanicsName::Part), [Place::Part(part)]) => {
            Some(components(&scene.parts[part.0].inertial))
        }
        _ => None,
    }
}

/// Reports a parameter that an effect names though its part has no such quantity.
pub(super) fn refuse_undeclared(
    entry: &EffectEntry,
    symbol: &str,
    declared: &[&str],
    log: &mut Log,
) {
    let named = entry.parameters.iter().flat_map(|table| &table.entries);
    if let Some((key, _)) = named.into_iter().find(|(key, _)| key.name == symbol) {
        log.push(
            Diagnostic::error(key.span, format!("this part has no `{symbol}`"))
                .label("what the part itself leaves at zero does not differ either")
                .help(format!("here there are {}", declared.join(", "))),
        );
    }
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
    PART.iter()
        .zip(values)
        .filter(|(_, value)| !value.is_zero())
        .map(|((symbol, _), _)| *symbol)
        .collect()
}

/// Lumped masses whose forces are taken at a point, but whose moments elsewhere.
fn displaced<'a>(place: &Place, scene: &'a Scene<'_>) -> impl Iterator<Item = &'a LumpedMass> {
    let point = match place {
        Place::Point(point) => Some(&scene.points.points[point.0]),
        _ => None,
    };
    let masses = scene.lumped_masses.iter();
    masses.filter(move |lump| {
        point.is_some_and(|point| point.frame == lump.frame && point.at == lump.force_at)
            && lump.force_at != lump.moment_at
    })
}

/// What the parameters of an effect do.
pub(super) fn action(
    way: MechanicsName,
    terms: &mut [EffectTerm],
    places: &[Place],
    scene: &Scene<'_>,
) -> Action {
    match way {
        MechanicsName::Rod => {
            // A file of one's own may list them in another order.
            terms.sort_by_key(|term| ["Jr", "Sr", "mr"].iter().position(|s| *s == term.symbol));
            Action::Rod
        }
        MechanicsName::Placement => Action::Bodies {
            parts: Vec::new(),
            lumped_masses: terms
                .iter()
                .flat_map(|term| places.iter().flat_map(|place| moved(term, place, scene)))
                .collect(),
        },
        MechanicsName::Part => Action::Bodies {
            parts: places
                .iter()
                .filter_map(|place| difference(terms, place, scene))
                .collect(),
            lumped_masses: Vec::new(),
        },
        MechanicsName::Tilt => Action::Tilt,
        MechanicsName::Delay => Action::Delay,
    }
}

/// A mass where forces are taken, less one whose moments are taken elsewhere: what is left is a moment.
fn moved(term: &EffectTerm, place: &Place, scene: &Scene<'_>) -> Vec<LumpedMass> {
    let mass = Exact::Symbol(Symbol::Parameter(term.parameter));
    displaced(place, scene)
        .flat_map(|lump| {
            let here = LumpedMass {
                mass: mass.clone(),
                moment_at: lump.force_at.clone(),
                ..lump.clone()
            };
            let there = LumpedMass {
                mass: mass.clone(),
                share: -lump.share.clone(),
                ..lump.clone()
            };
            [here, there]
        })
        .collect()
}

/// The differences of a part as a further part of its frame.
fn difference(terms: &[EffectTerm], place: &Place, scene: &Scene<'_>) -> Option<Part> {
    let Place::Part(part) = place else {
        return None;
    };
    let part = &scene.parts[part.0];
    let value = |i: usize| {
        let term = terms.iter().find(|term| term.symbol == PART[i].0);
        term.map_or_else(Exact::zero, |term| {
            Exact::Symbol(Symbol::Parameter(term.parameter))
        })
    };
    Some(Part {
        name: part.name.clone(),
        frame: part.frame,
        inertial: Inertial::Linear {
            mass: value(0),
            first_moment: std::array::from_fn(|i| value(1 + i)),
            inertia: std::array::from_fn(|i| value(4 + i)),
        },
    })
}

/// The angles of a tilt, each a constant with a name: their sines and cosines stay exact, and generated code can be
/// given other ones. Zeros are left out.
pub(super) fn named_tilt(
    angles: Vec<(String, Exact)>,
    kind: &Name,
    symbols: &mut Symbols,
    log: &mut Log,
) -> Option<Vec<(String, Exact)>> {
    let mut named = Vec::new();
    for (symbol, angle) in angles {
        if angle.is_zero() {
            continue;
        }
        if angle.mentions(&|_| true) {
            named.push((symbol, angle));
            continue;
        }
        let name = format!("{symbol}_base");
        let idx = ConstantIdx(symbols.constants.len());
        let value = angle.evaluate(&|_| 0.0);
        let mut meaning = meaning(
            Sort::Constant,
            Symbol::Constant(idx),
            Some(Dimension::ONE),
            "rad",
            Some(kind.span),
        );
        meaning.value = Some(value);
        meaning.used.set(true);
        if !symbols.scope.declare(&name, meaning, log) {
            return None;
        }
        symbols.constants.push(Constant {
            name,
            value,
            unit: "rad".to_owned(),
            is_angle: true,
            note: Some("tilt of the base".to_owned()),
        });
        named.push((symbol, Exact::Symbol(Symbol::Constant(idx))));
    }
    Some(named)
}

/// Gravity in a base that stands turned by Rz(tz) Ry(ty) Rx(tx) against the one in which `gravity` was given, and how
/// much later than they act forces are read.
pub(super) fn whole(
    effects: &[Effect],
    mut gravity: [Exact; 3],
    constants: &[Constant],
) -> ([Exact; 3], f64) {
    let mut delay = 0.0;
    for effect in effects {
        let constant = |symbol: &str| {
            let found = effect.constants.iter().find(|(name, _)| name == symbol);
            found.map(|(_, value)| value)
        };
        match effect.action {
            Action::Tilt => {
                // The transposed rotations, the outermost first.
                for (symbol, [from, to]) in [("tz", [0, 1]), ("ty", [2, 0]), ("tx", [1, 2])] {
                    if let Some(angle) = constant(symbol) {
                        let [a, b] = [from, to].map(|i| gravity[i].clone());
                        let cos = Exact::Apply(Function::Cos, Box::new(angle.clone()));
                        let sin = Exact::Apply(Function::Sin, Box::new(angle.clone()));
                        gravity[from] = sum([times(&cos, &a), times(&sin, &b)]);
                        gravity[to] = sum([times(&cos, &b), negative(times(&sin, &a))]);
                    }
                }
            }
            Action::Delay => {
                let value = |symbol| match symbol {
                    Symbol::Constant(idx) => constants[idx.0].value,
                    _ => f64::NAN,
                };
                delay += constant("T").map_or(0.0, |time| time.evaluate(&value));
            }
            _ => {}
        }
    }
    (gravity, delay)
}

fn times(a: &Exact, b: &Exact) -> Exact {
    if b.is_zero() {
        return Exact::zero();
    }
    Exact::Product(vec![a.clone(), b.clone()])
}

fn negative(a: Exact) -> Exact {
    if a.is_zero() {
        return a;
    }
    Exact::Negative(Box::new(a))
}

fn sum([a, b]: [Exact; 2]) -> Exact {
    match (a.is_zero(), b.is_zero()) {
        (true, _) => b,
        (_, true) => a,
        _ => Exact::Sum(vec![a, b]),
    }
}
