//! The grammar of laws: products of one or two shapes of what a place does, carries, or sees another place do.

use super::shapes::{LawShape, LawShapeKind, LawVariable};
use crate::diagnose::column::ForceColumn;

/// A place on which a law may act, along all recordings.
#[derive(Clone, Debug, Default)]
pub struct LawSite {
    /// Its name.
    pub name: String,
    /// Whether it turns: rad and N m rather than m and N.
    pub is_angle: bool,
    /// The drive that it is, if it is one.
    pub channel: Option<usize>,
    /// What the drives must supply for a force or torque of one there.
    pub drive_forces: ForceColumn,
    /// m or rad
    pub position: Vec<f64>,
    /// m/s or rad/s
    pub rate: Vec<f64>,
    /// m/s^2 or rad/s^2
    pub acceleration: Vec<f64>,
}

/// A shape of a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LawFactor {
    /// What of.
    pub variable: LawVariable,
    /// Which function.
    pub shape: LawShape,
}

/// A product of shapes at a place.
#[derive(Clone, Debug, PartialEq)]
pub struct LawProduct {
    /// The other place that it has variables of, by number.
    pub other: Option<usize>,
    /// One or two.
    pub factors: Vec<LawFactor>,
}

/// What products have in common that differ in their constants alone.
pub(crate) type ProductForm = (Option<usize>, Vec<(LawVariable, LawShapeKind)>);

impl LawProduct {
    pub(crate) fn product_form(&self) -> ProductForm {
        let of = |factor: &LawFactor| (factor.variable, factor.shape.shape_kind());
        (self.other, self.factors.iter().map(of).collect())
    }

    /// How much it takes to write it down: factors, constants that are sought, parameters.
    pub(crate) fn description_length(&self) -> usize {
        let of = |factor: &LawFactor| {
            let is_plain =
                matches!(factor.shape, LawShape::Power { halves, .. } if halves % 2 == 0);
            1 + factor.shape.freedoms() + usize::from(!is_plain)
        };
        self.factors.iter().map(of).sum::<usize>() + usize::from(self.other.is_some())
    }

    /// Parameters that it is multiplied by: two where sine and cosine stand side by side.
    pub(crate) fn parameters(&self) -> usize {
        let waves = self.factors.iter();
        let waves = waves.filter(|factor| matches!(factor.shape, LawShape::Wave { .. }));
        1 << waves.count()
    }

    /// Whether it depends on the way there.
    pub fn has_memory(&self) -> bool {
        self.factors.iter().any(|factor| factor.shape.has_memory())
    }

    /// Whether the library that comes with the program has it, so that a diagnosis has refused it already.
    pub(crate) fn is_in_library(&self, site: &LawSite) -> bool {
        match self.factors.as_slice() {
            [LawFactor { variable, shape }] => match (variable, shape) {
                (LawVariable::Position | LawVariable::Rate | LawVariable::Acceleration, shape)
                    if *shape == LawShape::LINEAR =>
                {
                    true
                }
                (LawVariable::Rate, shape)
                    if [LawShape::SIGN, LawShape::integer_power(2, true)].contains(shape) =>
                {
                    true
                }
                (LawVariable::Rate, LawShape::Fading { halves: 4, .. }) => true,
                (
                    LawVariable::Position,
                    LawShape::Wave { .. } | LawShape::Memory { curve: 1, .. },
                ) => site.channel.is_some(),
                _ => false,
            },
            [load, way] => {
                load.variable == LawVariable::Load
                    && load.shape == LawShape::MAGNITUDE
                    && way.variable == LawVariable::Rate
                    && way.shape == LawShape::SIGN
            }
            _ => false,
        }
    }
}

/// Places along which waves, bumps and stops are looked for, as parts of the travel.
const CENTRES: [f64; 7] = [0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95];
const ENDS: [f64; 6] = [0.05, 0.15, 0.28, 0.42, 0.57, 0.72];
const MIDDLES: [f64; 4] = [0.2, 0.4, 0.6, 0.8];
/// Widths of what is near a place, as parts of the travel.
const WIDTHS: [f64; 3] = [0.04, 0.1, 0.25];
/// Waves over the travel: up to so many, by steps that tell them apart.
const WAVES: [f64; 2] = [0.4, 24.0];
const WAVE_STEP: f64 = 0.55;
/// Scales of a rate, as parts of the largest.
const SCALES: [f64; 6] = [0.01, 0.025, 0.06, 0.15, 0.35, 0.8];
/// Lengths over which a state remembers, as parts of the travel.
const LENGTHS: [f64; 7] = [0.005, 0.012, 0.03, 0.07, 0.15, 0.3, 0.6];
/// Parts of the largest load.
const LOADS: [f64; 4] = [0.3, 0.5, 0.65, 0.8];

/// Shapes that are tried of each variable, alone and as factors.
#[derive(Default)]
pub(crate) struct FactorCatalog {
    /// Alone.
    pub(crate) single_factors: Vec<LawFactor>,
    /// Pairs of lists of which every pair is tried.
    pub(crate) pairs: Vec<[Vec<LawFactor>; 2]>,
}

/// Least and largest value.
pub(crate) fn range(z: &[f64]) -> [f64; 2] {
    z.iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], z| {
            [a.min(*z), b.max(*z)]
        })
}

/// Root of the mean square.
fn root_mean_square(z: &[f64]) -> f64 {
    (z.iter().map(|z| z * z).sum::<f64>() / z.len().max(1) as f64).sqrt()
}

fn factors_of(variable: LawVariable, shapes: impl IntoIterator<Item = LawShape>) -> Vec<LawFactor> {
    let factor = |shape| LawFactor { variable, shape };
    shapes.into_iter().map(factor).collect()
}

fn half_power(halves: i32, is_odd: bool, scale: f64) -> LawShape {
    LawShape::Power {
        halves,
        is_odd,
        scale,
    }
}

/// How far a place travels and how fast, of which shapes have their sizes.
struct TravelExtent {
    low: f64,
    travel: f64,
    fastest: f64,
}

impl TravelExtent {
    fn new(position: &[f64], rate: &[f64]) -> Self {
        let [low, high] = range(position);
        Self {
            low,
            travel: high - low,
            fastest: largest_magnitude(rate),
        }
    }

    fn position_at(&self, part: f64) -> f64 {
        self.low + part * self.travel
    }

    fn shifted_powers(&self, power: i32) -> impl Iterator<Item = LawShape> {
        MIDDLES.into_iter().map(move |part| LawShape::Shifted {
            centre: self.position_at(part),
            power,
        })
    }

    fn hinge_shapes(&self, power: i32) -> impl Iterator<Item = LawShape> {
        ENDS.into_iter().flat_map(move |part| {
            let ends = [
                (1.0, self.position_at(1.0 - part)),
                (-1.0, self.position_at(part)),
            ];
            ends.map(|(side, from)| LawShape::Hinge { from, side, power })
        })
    }

    fn wave_shapes(&self) -> Vec<LawShape> {
        let mut waves = Vec::new();
        let mut times = WAVES[0];
        while times < WAVES[1] {
            waves.push(LawShape::Wave {
                pitch: self.travel / times,
            });
            times += WAVE_STEP;
        }
        waves
    }

    fn local_shapes(&self, make: fn(f64, f64) -> LawShape, widths: &[f64]) -> Vec<LawShape> {
        let each = widths.iter().flat_map(|width| {
            CENTRES.map(move |centre| make(self.position_at(centre), width * self.travel))
        });
        each.collect()
    }

    fn memory_shapes(&self) -> Vec<LawShape> {
        let curves = [1, 2].into_iter().flat_map(|curve| {
            LENGTHS.map(move |part| LawShape::Memory {
                length: part * self.travel,
                curve,
            })
        });
        let slips = LENGTHS.map(|part| LawShape::Slip {
            width: 0.6 * part * self.travel,
        });
        curves.chain(slips).collect()
    }

    fn step_shapes(&self) -> [LawShape; SCALES.len()] {
        SCALES.map(|part| step(0.0, part * self.fastest))
    }

    fn fading_shapes(&self, halves: i32) -> [LawShape; SCALES.len()] {
        SCALES.map(|part| LawShape::Fading {
            scale: part * self.fastest,
            halves,
        })
    }
}

fn largest_magnitude(values: &[f64]) -> f64 {
    range(values).map(f64::abs).into_iter().fold(0.0, f64::max)
}

fn bump(centre: f64, width: f64) -> LawShape {
    LawShape::Bump { centre, width }
}

fn detent(centre: f64, width: f64) -> LawShape {
    LawShape::Detent { centre, width }
}

fn step(centre: f64, width: f64) -> LawShape {
    LawShape::Step { centre, width }
}

/// What is tried of a place by itself.
pub(crate) fn own_factors(position: &[f64], rate: &[f64], load: Option<&[f64]>) -> FactorCatalog {
    use LawVariable::{Acceleration, Position, Rate};
    let extent = TravelExtent::new(position, rate);
    let scale = root_mean_square(rate);
    let directions = [1.0, -1.0].map(|side| LawShape::Hinge {
        from: 0.0,
        side,
        power: 1,
    });
    let powers = [
        LawShape::LINEAR,
        LawShape::integer_power(2, false),
        LawShape::integer_power(3, true),
    ];
    let mut menu = FactorCatalog::default();
    let alone = &mut menu.single_factors;
    alone.extend(factors_of(Position, powers));
    alone.extend(factors_of(
        Position,
        extent.shifted_powers(2).chain(extent.shifted_powers(3)),
    ));
    alone.extend(factors_of(
        Position,
        extent.hinge_shapes(1).chain(extent.hinge_shapes(2)),
    ));
    alone.extend(factors_of(Position, extent.wave_shapes()));
    alone.extend(factors_of(Position, extent.local_shapes(bump, &WIDTHS)));
    alone.extend(factors_of(Position, extent.local_shapes(detent, &WIDTHS)));
    alone.extend(factors_of(
        Position,
        extent.local_shapes(step, &WIDTHS[..1]),
    ));
    alone.extend(factors_of(Position, extent.memory_shapes()));
    let speeds = [
        LawShape::SIGN,
        LawShape::LINEAR,
        LawShape::MAGNITUDE,
        LawShape::integer_power(2, true),
        LawShape::integer_power(2, false),
        LawShape::integer_power(3, true),
        half_power(1, true, scale),
        half_power(1, false, scale),
        half_power(3, true, scale),
        half_power(3, false, scale),
        half_power(5, true, scale),
    ];
    alone.extend(factors_of(Rate, speeds));
    alone.extend(factors_of(Rate, extent.step_shapes()));
    alone.extend(factors_of(Rate, directions));
    for halves in [1, 2, 4] {
        alone.extend(factors_of(Rate, extent.fading_shapes(halves)));
    }
    for make in [bump, detent] {
        let slow = SCALES.map(|part| make(0.0, part * extent.fastest));
        alone.extend(factors_of(Rate, slow));
    }
    alone.extend(factors_of(
        Acceleration,
        [LawShape::LINEAR, LawShape::MAGNITUDE],
    ));
    // Friction and damping that differ from place to place, and mass that does.
    let ways = [
        LawShape::LINEAR,
        LawShape::SIGN,
        LawShape::MAGNITUDE,
        LawShape::integer_power(2, true),
        extent.step_shapes()[2],
        extent.step_shapes()[4],
    ];
    let some = [LawShape::LINEAR, LawShape::integer_power(2, false)].into_iter();
    let some = some
        .chain(extent.shifted_powers(2))
        .chain(extent.hinge_shapes(1));
    let some = some.chain(extent.local_shapes(bump, &WIDTHS[1..]));
    menu.pairs
        .push([factors_of(Position, some), factors_of(Rate, ways)]);
    let few = [LawShape::LINEAR, LawShape::SIGN, LawShape::MAGNITUDE];
    menu.pairs.push([
        factors_of(Position, extent.wave_shapes()),
        factors_of(Rate, few),
    ]);
    menu.pairs.push([
        simple_positions(),
        factors_of(Acceleration, [LawShape::LINEAR]),
    ]);
    if let Some(load) = load {
        add_loads(&mut menu, &extent, load);
    }
    menu
}

fn simple_positions() -> Vec<LawFactor> {
    let shapes = [LawShape::LINEAR, LawShape::integer_power(2, false)];
    factors_of(LawVariable::Position, shapes)
}

/// What is tried of a load, by itself, with rates and with positions.
fn add_loads(menu: &mut FactorCatalog, extent: &TravelExtent, load: &[f64]) {
    use LawVariable::{Load, Rate};
    let largest = largest_magnitude(load);
    let scale = root_mean_square(load);
    let mut loads = vec![
        LawShape::LINEAR,
        LawShape::MAGNITUDE,
        LawShape::integer_power(2, false),
        LawShape::integer_power(2, true),
    ];
    loads.extend([1, 3].map(|n| half_power(n, false, scale)));
    let cut = LOADS.into_iter().flat_map(|part| {
        [1.0, -1.0].map(|side| LawShape::Hinge {
            from: side * part * largest,
            side,
            power: 1,
        })
    });
    menu.single_factors
        .extend(factors_of(Load, loads.iter().copied()));
    menu.single_factors.extend(factors_of(Load, cut));
    let mut speeds = vec![LawShape::LINEAR, LawShape::SIGN, LawShape::MAGNITUDE];
    speeds.extend(extent.step_shapes());
    speeds.extend(extent.fading_shapes(4));
    menu.pairs.push([
        factors_of(Load, loads.iter().copied()),
        factors_of(Rate, speeds),
    ]);
    menu.pairs
        .push([factors_of(Load, loads), simple_positions()]);
}

/// What is tried of another place, alone and with what the place does by itself.
pub(crate) fn factors_with_other(
    own_rate: &[f64],
    position: &[f64],
    rate: &[f64],
    is_angle: bool,
) -> FactorCatalog {
    use LawVariable::{Acceleration, OtherPosition, OtherRate, Position, Rate};
    let [low, high] = range(position);
    let (fastest, own_fastest) = (largest_magnitude(rate), largest_magnitude(own_rate));
    let travel = high - low;
    let mut places = vec![
        LawShape::LINEAR,
        LawShape::integer_power(2, false),
        LawShape::integer_power(3, true),
    ];
    places.extend(MIDDLES.map(|part| LawShape::Shifted {
        centre: low + part * travel,
        power: 2,
    }));
    if is_angle {
        let turns = [1.0, 0.5].map(|part| LawShape::Wave {
            pitch: part * std::f64::consts::TAU,
        });
        places.extend(turns);
    }
    let waves = [0.5, 1.0, 1.6, 2.3, 3.2].map(|times| LawShape::Wave {
        pitch: travel / times,
    });
    let steps = |fastest: f64| {
        [0.02, 0.15, 0.5].map(|part| LawShape::Step {
            centre: 0.0,
            width: part * fastest,
        })
    };
    let mut rates = vec![
        LawShape::LINEAR,
        LawShape::SIGN,
        LawShape::MAGNITUDE,
        LawShape::integer_power(2, true),
        LawShape::integer_power(2, false),
    ];
    rates.extend(steps(fastest));
    let mut own_rates = vec![
        LawShape::LINEAR,
        LawShape::SIGN,
        LawShape::MAGNITUDE,
        LawShape::integer_power(2, true),
        LawShape::integer_power(2, false),
    ];
    own_rates.push(steps(own_fastest)[1]);
    let mut alone_rates = rates.clone();
    let scale = root_mean_square(rate);
    for n in [1, 3] {
        alone_rates.extend([true, false].map(|is_odd| half_power(n, is_odd, scale)));
    }
    let own = || {
        let mut all = factors_of(Rate, own_rates.iter().copied());
        all.extend(factors_of(Position, [LawShape::LINEAR]));
        all.extend(factors_of(Acceleration, [LawShape::LINEAR]));
        all
    };
    let mut alone = factors_of(OtherPosition, places.iter().copied().chain(waves));
    alone.extend(factors_of(OtherRate, alone_rates));
    let few = [LawShape::LINEAR, LawShape::SIGN, LawShape::MAGNITUDE];
    FactorCatalog {
        pairs: vec![
            [
                factors_of(OtherPosition, places[..3].iter().copied()),
                own(),
            ],
            [
                factors_of(OtherPosition, places[3..].iter().copied()),
                own(),
            ],
            [factors_of(OtherRate, rates.iter().copied()), own()],
            [
                factors_of(OtherPosition, places[..2].iter().copied()),
                factors_of(OtherRate, rates),
            ],
            [factors_of(OtherPosition, waves), factors_of(OtherRate, few)],
        ],
        single_factors: alone,
    }
}
