//! The grammar of laws: products of one or two shapes of what a place does, carries, or sees another place do.

use super::shapes::{Shape, Sort, Variable};
use crate::diagnose::column::Column;

/// A place on which a law may act, along all recordings.
#[derive(Clone, Debug, Default)]
pub struct Site {
    /// Its name.
    pub name: String,
    /// Whether it turns: rad and N m rather than m and N.
    pub is_angle: bool,
    /// The drive that it is, if it is one.
    pub channel: Option<usize>,
    /// What the drives must supply for a force or torque of one there.
    pub force: Column,
    /// m or rad
    pub position: Vec<f64>,
    /// m/s or rad/s
    pub rate: Vec<f64>,
    /// m/s^2 or rad/s^2
    pub acceleration: Vec<f64>,
}

/// A shape of a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factor {
    /// What of.
    pub variable: Variable,
    /// Which function.
    pub shape: Shape,
}

/// A product of shapes at a place.
#[derive(Clone, Debug, PartialEq)]
pub struct Product {
    /// The other place that it has variables of, by number.
    pub other: Option<usize>,
    /// One or two.
    pub factors: Vec<Factor>,
}

/// What products have in common that differ in their constants alone.
pub(crate) type Skeleton = (Option<usize>, Vec<(Variable, Sort)>);

impl Product {
    pub(crate) fn skeleton(&self) -> Skeleton {
        let of = |factor: &Factor| (factor.variable, factor.shape.sort());
        (self.other, self.factors.iter().map(of).collect())
    }

    /// How much it takes to write it down: factors, constants that are sought, parameters.
    pub(crate) fn size(&self) -> usize {
        let of = |factor: &Factor| {
            let is_plain = matches!(factor.shape, Shape::Power { halves, .. } if halves % 2 == 0);
            1 + factor.shape.freedoms() + usize::from(!is_plain)
        };
        self.factors.iter().map(of).sum::<usize>() + usize::from(self.other.is_some())
    }

    /// Parameters that it is multiplied by: two where sine and cosine stand side by side.
    pub(crate) fn parameters(&self) -> usize {
        let waves = self.factors.iter();
        let waves = waves.filter(|factor| matches!(factor.shape, Shape::Wave { .. }));
        1 << waves.count()
    }

    /// Whether it depends on the way there.
    pub fn remembers(&self) -> bool {
        self.factors.iter().any(|factor| factor.shape.remembers())
    }

    /// Whether the library that comes with the program has it, so that a diagnosis has refused it already.
    pub(crate) fn is_known(&self, site: &Site) -> bool {
        match self.factors.as_slice() {
            [Factor { variable, shape }] => match (variable, shape) {
                (Variable::Position | Variable::Rate | Variable::Acceleration, shape)
                    if *shape == Shape::LINEAR =>
                {
                    true
                }
                (Variable::Rate, shape) if [Shape::SIGN, Shape::whole(2, true)].contains(shape) => {
                    true
                }
                (Variable::Rate, Shape::Fading { halves: 4, .. }) => true,
                (Variable::Position, Shape::Wave { .. } | Shape::Memory { curve: 1, .. }) => {
                    site.channel.is_some()
                }
                _ => false,
            },
            [load, way] => {
                load.variable == Variable::Load
                    && load.shape == Shape::MAGNITUDE
                    && way.variable == Variable::Rate
                    && way.shape == Shape::SIGN
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
pub(crate) struct Menu {
    /// Alone.
    pub(crate) alone: Vec<Factor>,
    /// Pairs of lists of which every pair is tried.
    pub(crate) pairs: Vec<[Vec<Factor>; 2]>,
}

/// Least and largest value.
pub(crate) fn range(z: &[f64]) -> [f64; 2] {
    z.iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], z| {
            [a.min(*z), b.max(*z)]
        })
}

/// Root of the mean square.
fn usual(z: &[f64]) -> f64 {
    (z.iter().map(|z| z * z).sum::<f64>() / z.len().max(1) as f64).sqrt()
}

fn of(variable: Variable, shapes: impl IntoIterator<Item = Shape>) -> Vec<Factor> {
    let factor = |shape| Factor { variable, shape };
    shapes.into_iter().map(factor).collect()
}

fn halves(halves: i32, is_odd: bool, scale: f64) -> Shape {
    Shape::Power {
        halves,
        is_odd,
        scale,
    }
}

/// How far a place travels and how fast, of which shapes have their sizes.
struct Extent {
    low: f64,
    travel: f64,
    fastest: f64,
}

impl Extent {
    fn new(position: &[f64], rate: &[f64]) -> Self {
        let [low, high] = range(position);
        Self {
            low,
            travel: high - low,
            fastest: largest(rate),
        }
    }

    fn at(&self, part: f64) -> f64 {
        self.low + part * self.travel
    }

    fn shifted(&self, power: i32) -> impl Iterator<Item = Shape> {
        MIDDLES.into_iter().map(move |part| Shape::Shifted {
            centre: self.at(part),
            power,
        })
    }

    fn beyond(&self, power: i32) -> impl Iterator<Item = Shape> {
        ENDS.into_iter().flat_map(move |part| {
            let ends = [(1.0, self.at(1.0 - part)), (-1.0, self.at(part))];
            ends.map(|(side, from)| Shape::Beyond { from, side, power })
        })
    }

    fn waves(&self) -> Vec<Shape> {
        let mut waves = Vec::new();
        let mut times = WAVES[0];
        while times < WAVES[1] {
            waves.push(Shape::Wave {
                pitch: self.travel / times,
            });
            times += WAVE_STEP;
        }
        waves
    }

    fn near(&self, make: fn(f64, f64) -> Shape, widths: &[f64]) -> Vec<Shape> {
        let each = widths.iter().flat_map(|width| {
            CENTRES.map(move |centre| make(self.at(centre), width * self.travel))
        });
        each.collect()
    }

    fn memories(&self) -> Vec<Shape> {
        let curves = [1, 2].into_iter().flat_map(|curve| {
            LENGTHS.map(move |part| Shape::Memory {
                length: part * self.travel,
                curve,
            })
        });
        let slips = LENGTHS.map(|part| Shape::Slip {
            width: 0.6 * part * self.travel,
        });
        curves.chain(slips).collect()
    }

    fn steps(&self) -> [Shape; SCALES.len()] {
        SCALES.map(|part| step(0.0, part * self.fastest))
    }

    fn fading(&self, halves: i32) -> [Shape; SCALES.len()] {
        SCALES.map(|part| Shape::Fading {
            scale: part * self.fastest,
            halves,
        })
    }
}

fn largest(values: &[f64]) -> f64 {
    range(values).map(f64::abs).into_iter().fold(0.0, f64::max)
}

fn bump(centre: f64, width: f64) -> Shape {
    Shape::Bump { centre, width }
}

fn detent(centre: f64, width: f64) -> Shape {
    Shape::Detent { centre, width }
}

fn step(centre: f64, width: f64) -> Shape {
    Shape::Step { centre, width }
}

/// What is tried of a place by itself.
pub(crate) fn own(position: &[f64], rate: &[f64], load: Option<&[f64]>) -> Menu {
    use Variable::{Acceleration, Position, Rate};
    let extent = Extent::new(position, rate);
    let scale = usual(rate);
    let directions = [1.0, -1.0].map(|side| Shape::Beyond {
        from: 0.0,
        side,
        power: 1,
    });
    let powers = [Shape::LINEAR, Shape::whole(2, false), Shape::whole(3, true)];
    let mut menu = Menu::default();
    let alone = &mut menu.alone;
    alone.extend(of(Position, powers));
    alone.extend(of(Position, extent.shifted(2).chain(extent.shifted(3))));
    alone.extend(of(Position, extent.beyond(1).chain(extent.beyond(2))));
    alone.extend(of(Position, extent.waves()));
    alone.extend(of(Position, extent.near(bump, &WIDTHS)));
    alone.extend(of(Position, extent.near(detent, &WIDTHS)));
    alone.extend(of(Position, extent.near(step, &WIDTHS[..1])));
    alone.extend(of(Position, extent.memories()));
    let speeds = [
        Shape::SIGN,
        Shape::LINEAR,
        Shape::MAGNITUDE,
        Shape::whole(2, true),
        Shape::whole(2, false),
        Shape::whole(3, true),
        halves(1, true, scale),
        halves(1, false, scale),
        halves(3, true, scale),
        halves(3, false, scale),
        halves(5, true, scale),
    ];
    alone.extend(of(Rate, speeds));
    alone.extend(of(Rate, extent.steps()));
    alone.extend(of(Rate, directions));
    for halves in [1, 2, 4] {
        alone.extend(of(Rate, extent.fading(halves)));
    }
    for make in [bump, detent] {
        let slow = SCALES.map(|part| make(0.0, part * extent.fastest));
        alone.extend(of(Rate, slow));
    }
    alone.extend(of(Acceleration, [Shape::LINEAR, Shape::MAGNITUDE]));
    // Friction and damping that differ from place to place, and mass that does.
    let ways = [
        Shape::LINEAR,
        Shape::SIGN,
        Shape::MAGNITUDE,
        Shape::whole(2, true),
        extent.steps()[2],
        extent.steps()[4],
    ];
    let some = [Shape::LINEAR, Shape::whole(2, false)].into_iter();
    let some = some.chain(extent.shifted(2)).chain(extent.beyond(1));
    let some = some.chain(extent.near(bump, &WIDTHS[1..]));
    menu.pairs.push([of(Position, some), of(Rate, ways)]);
    let few = [Shape::LINEAR, Shape::SIGN, Shape::MAGNITUDE];
    menu.pairs
        .push([of(Position, extent.waves()), of(Rate, few)]);
    menu.pairs
        .push([simple_positions(), of(Acceleration, [Shape::LINEAR])]);
    if let Some(load) = load {
        add_loads(&mut menu, &extent, load);
    }
    menu
}

fn simple_positions() -> Vec<Factor> {
    let shapes = [Shape::LINEAR, Shape::whole(2, false)];
    of(Variable::Position, shapes)
}

/// What is tried of a load, by itself, with rates and with positions.
fn add_loads(menu: &mut Menu, extent: &Extent, load: &[f64]) {
    use Variable::{Load, Rate};
    let largest = largest(load);
    let scale = usual(load);
    let mut loads = vec![
        Shape::LINEAR,
        Shape::MAGNITUDE,
        Shape::whole(2, false),
        Shape::whole(2, true),
    ];
    loads.extend([1, 3].map(|n| halves(n, false, scale)));
    let cut = LOADS.into_iter().flat_map(|part| {
        [1.0, -1.0].map(|side| Shape::Beyond {
            from: side * part * largest,
            side,
            power: 1,
        })
    });
    menu.alone.extend(of(Load, loads.iter().copied()));
    menu.alone.extend(of(Load, cut));
    let mut speeds = vec![Shape::LINEAR, Shape::SIGN, Shape::MAGNITUDE];
    speeds.extend(extent.steps());
    speeds.extend(extent.fading(4));
    menu.pairs
        .push([of(Load, loads.iter().copied()), of(Rate, speeds)]);
    menu.pairs.push([of(Load, loads), simple_positions()]);
}

/// What is tried of another place, alone and with what the place does by itself.
pub(crate) fn with_other(own_rate: &[f64], position: &[f64], rate: &[f64], is_angle: bool) -> Menu {
    use Variable::{Acceleration, OtherPosition, OtherRate, Position, Rate};
    let [low, high] = range(position);
    let (fastest, own_fastest) = (largest(rate), largest(own_rate));
    let travel = high - low;
    let mut places = vec![Shape::LINEAR, Shape::whole(2, false), Shape::whole(3, true)];
    places.extend(MIDDLES.map(|part| Shape::Shifted {
        centre: low + part * travel,
        power: 2,
    }));
    if is_angle {
        let turns = [1.0, 0.5].map(|part| Shape::Wave {
            pitch: part * std::f64::consts::TAU,
        });
        places.extend(turns);
    }
    let waves = [0.5, 1.0, 1.6, 2.3, 3.2].map(|times| Shape::Wave {
        pitch: travel / times,
    });
    let steps = |fastest: f64| {
        [0.02, 0.15, 0.5].map(|part| Shape::Step {
            centre: 0.0,
            width: part * fastest,
        })
    };
    let mut rates = vec![
        Shape::LINEAR,
        Shape::SIGN,
        Shape::MAGNITUDE,
        Shape::whole(2, true),
        Shape::whole(2, false),
    ];
    rates.extend(steps(fastest));
    let mut own_rates = vec![
        Shape::LINEAR,
        Shape::SIGN,
        Shape::MAGNITUDE,
        Shape::whole(2, true),
        Shape::whole(2, false),
    ];
    own_rates.push(steps(own_fastest)[1]);
    let mut alone_rates = rates.clone();
    let scale = usual(rate);
    for n in [1, 3] {
        alone_rates.extend([true, false].map(|is_odd| halves(n, is_odd, scale)));
    }
    let own = || {
        let mut all = of(Rate, own_rates.iter().copied());
        all.extend(of(Position, [Shape::LINEAR]));
        all.extend(of(Acceleration, [Shape::LINEAR]));
        all
    };
    let mut alone = of(OtherPosition, places.iter().copied().chain(waves));
    alone.extend(of(OtherRate, alone_rates));
    let few = [Shape::LINEAR, Shape::SIGN, Shape::MAGNITUDE];
    Menu {
        pairs: vec![
            [of(OtherPosition, places[..3].iter().copied()), own()],
            [of(OtherPosition, places[3..].iter().copied()), own()],
            [of(OtherRate, rates.iter().copied()), own()],
            [
                of(OtherPosition, places[..2].iter().copied()),
                of(OtherRate, rates),
            ],
            [of(OtherPosition, waves), of(OtherRate, few)],
        ],
        alone,
    }
}
