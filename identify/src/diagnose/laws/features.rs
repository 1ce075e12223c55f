//! The grammar of laws: products of one or two shapes of the motion or load of a place, or of the motion of another
//! place. Input: positions, rates and loads; output: lists of factors that are tried.

use super::shapes::{LawShape, LawShapeKind, LawVariable};
use crate::diagnose::column::ForceColumn;

/// A place on which a law may act, along all recordings.
#[derive(Clone, Debug, Default)]
pub struct LawSite {
    /// Name of the place.
    pub name: String,
    /// Whether it is revolute: rad and N m instead of m and N.
    pub is_angle: bool,
    /// Index of its channel, if it is a drive.
    pub channel: Option<usize>,
    /// Forces of the drives per force or torque of one at the place.
    pub drive_forces: ForceColumn,
    /// Position at every sample, m or rad.
    pub position: Vec<f64>,
    /// Rate at every sample, m/s or rad/s.
    pub rate: Vec<f64>,
    /// Acceleration at every sample, m/s^2 or rad/s^2.
    pub acceleration: Vec<f64>,
}

/// A shape applied to a variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LawFactor {
    /// The variable.
    pub variable: LawVariable,
    /// The function.
    pub shape: LawShape,
}

/// A product of shapes at a place.
#[derive(Clone, Debug, PartialEq)]
pub struct LawProduct {
    /// Index of the other place whose motion it depends on, if there is one.
    pub other: Option<usize>,
    /// One or two factors.
    pub factors: Vec<LawFactor>,
}

/// Form of a product: equal for products that differ in their constants only.
pub(crate) type ProductForm = (Option<usize>, Vec<(LawVariable, LawShapeKind)>);

impl LawProduct {
    /// Its form, without constants.
    pub(crate) fn product_form(&self) -> ProductForm {
        let of = |factor: &LawFactor| (factor.variable, factor.shape.shape_kind());
        (self.other, self.factors.iter().map(of).collect())
    }

    /// Length of its description, by which simple laws are preferred: factors, searched constants, uncommon shapes and
    /// another place.
    pub(crate) fn description_length(&self) -> usize {
        // A plain integer power counts one less than other shapes.
        let of = |factor: &LawFactor| {
            let is_plain = matches!(factor.shape, LawShape::Power { halves, .. } if halves % 2 == 0);
            1 + factor.shape.freedoms() + usize::from(!is_plain)
        };
        self.factors.iter().map(of).sum::<usize>() + usize::from(self.other.is_some())
    }

    /// Number of its parameters: two if sine and cosine are estimated separately.
    pub(crate) fn parameters(&self) -> usize {
        // Only waves have two columns, sine and cosine.
        let waves = self.factors.iter();
        let waves = waves.filter(|factor| matches!(factor.shape, LawShape::Wave { .. }));
        // Each wave doubles the number of columns.
        1 << waves.count()
    }

    /// Whether it depends on the past motion and not only on the present state.
    pub fn has_memory(&self) -> bool {
        self.factors.iter().any(|factor| factor.shape.has_memory())
    }

    /// Whether the library that comes with the program contains it, so that the diagnosis has rejected it already.
    pub(crate) fn is_in_library(&self, site: &LawSite) -> bool {
        // Laws that the library contains as effects: stiffness, damping, inertia, dry and quadratic friction, Stribeck
        // friction, periodic forces, Dahl friction, and load-dependent friction.
        match self.factors.as_slice() {
            [LawFactor { variable, shape }] => match (variable, shape) {
                (LawVariable::Position | LawVariable::Rate | LawVariable::Acceleration, shape)
                    if *shape == LawShape::LINEAR =>
                {
                    true
                }
                (LawVariable::Rate, shape) if [LawShape::SIGN, LawShape::integer_power(2, true)].contains(shape) => {
                    true
                }
                (LawVariable::Rate, LawShape::Fading { halves: 4, .. }) => true,
                (LawVariable::Position, LawShape::Wave { .. } | LawShape::Memory { curve: 1, .. }) => {
                    site.channel.is_some()
                }
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

/// Centres of local shapes, ends of hinges and zeros of powers, as shares of the travel.
const CENTRES: [f64; 7] = [0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95];
const ENDS: [f64; 6] = [0.05, 0.15, 0.28, 0.42, 0.57, 0.72];
const MIDDLES: [f64; 4] = [0.2, 0.4, 0.6, 0.8];
/// Widths of local shapes, as shares of the travel.
const WIDTHS: [f64; 3] = [0.04, 0.1, 0.25];
/// Least and largest number of waves over the travel, and the step between them at which they are distinguishable.
const WAVES: [f64; 2] = [0.4, 24.0];
const WAVE_STEP: f64 = 0.55;
/// Scales of a rate, as shares of the largest rate.
const SCALES: [f64; 6] = [0.01, 0.025, 0.06, 0.15, 0.35, 0.8];
/// Lengths of states with memory, as shares of the travel.
const LENGTHS: [f64; 7] = [0.005, 0.012, 0.03, 0.07, 0.15, 0.3, 0.6];
/// Loads at which hinges begin, as shares of the largest load.
const LOADS: [f64; 4] = [0.3, 0.5, 0.65, 0.8];

/// Factors that are tried, alone and in pairs.
#[derive(Default)]
pub(crate) struct FactorCatalog {
    /// Factors that are tried alone.
    pub(crate) single_factors: Vec<LawFactor>,
    /// Pairs of lists; every factor of one list is multiplied by every factor of the other.
    pub(crate) pairs: Vec<[Vec<LawFactor>; 2]>,
}

/// Least and largest value of a series.
pub(crate) fn range(z: &[f64]) -> [f64; 2] {
    z.iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], z| [a.min(*z), b.max(*z)])
}

/// Root mean square of a series.
fn root_mean_square(z: &[f64]) -> f64 {
    (z.iter().map(|z| z * z).sum::<f64>() / z.len().max(1) as f64).sqrt()
}

/// Factors of one variable with several shapes.
fn factors_of(variable: LawVariable, shapes: impl IntoIterator<Item = LawShape>) -> Vec<LawFactor> {
    let factor = |shape| LawFactor { variable, shape };
    shapes.into_iter().map(factor).collect()
}

/// A power with the exponent `halves / 2`.
fn half_power(halves: i32, is_odd: bool, scale: f64) -> LawShape {
    LawShape::Power { halves, is_odd, scale }
}

/// Range and largest rate of a place, from which the constants of shapes are chosen.
struct TravelExtent {
    /// Least position, m or rad.
    low: f64,
    /// Range of the position, m or rad.
    travel: f64,
    /// Largest magnitude of the rate, m/s or rad/s.
    fastest: f64,
}

impl TravelExtent {
    /// Determines the extent from positions and rates.
    fn new(position: &[f64], rate: &[f64]) -> Self {
        let [low, high] = range(position);
        Self {
            low,
            travel: high - low,
            fastest: largest_magnitude(rate),
        }
    }

    /// Position at a share of the travel.
    fn position_at(&self, part: f64) -> f64 {
        self.low + part * self.travel
    }

    /// Powers around positions in the middle of the travel.
    fn shifted_powers(&self, power: i32) -> impl Iterator<Item = LawShape> {
        MIDDLES.into_iter().map(move |part| LawShape::Shifted {
            centre: self.position_at(part),
            power,
        })
    }

    /// Hinges that begin near either end.
    fn hinge_shapes(&self, power: i32) -> impl Iterator<Item = LawShape> {
        ENDS.into_iter().flat_map(move |part| {
            // A hinge near the upper end acts upwards, one near the lower end downwards.
            let ends = [(1.0, self.position_at(1.0 - part)), (-1.0, self.position_at(part))];
            ends.map(|(side, from)| LawShape::Hinge { from, side, power })
        })
    }

    /// Waves of all pitches.
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

    /// Local shapes of some widths along the travel.
    fn local_shapes(&self, make: fn(f64, f64) -> LawShape, widths: &[f64]) -> Vec<LawShape> {
        let each = widths
            .iter()
            .flat_map(|width| CENTRES.map(move |centre| make(self.position_at(centre), width * self.travel)));
        each.collect()
    }

    /// States with memory, for all lengths: friction curves of two kinds and a dragged spring.
    fn memory_shapes(&self) -> Vec<LawShape> {
        // Dahl's and Bouc-Wen's model for all lengths.
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

    /// Smooth signs of the rate.
    fn step_shapes(&self) -> [LawShape; SCALES.len()] {
        SCALES.map(|part| step(0.0, part * self.fastest))
    }

    /// Shapes that decrease with speed; the exponent is `halves / 2`.
    fn fading_shapes(&self, halves: i32) -> [LawShape; SCALES.len()] {
        SCALES.map(|part| LawShape::Fading {
            scale: part * self.fastest,
            halves,
        })
    }
}

/// Largest absolute value of a series.
fn largest_magnitude(values: &[f64]) -> f64 {
    range(values).map(f64::abs).into_iter().fold(0.0, f64::max)
}

/// A bump; for lists of local shapes.
fn bump(centre: f64, width: f64) -> LawShape {
    LawShape::Bump { centre, width }
}

/// A detent; for lists of local shapes.
fn detent(centre: f64, width: f64) -> LawShape {
    LawShape::Detent { centre, width }
}

/// A smooth step; for lists of local shapes.
fn step(centre: f64, width: f64) -> LawShape {
    LawShape::Step { centre, width }
}

/// Factors that are tried for a place by itself, from its motion and its load, if it has one.
pub(crate) fn own_factors(position: &[f64], rate: &[f64], load: Option<&[f64]>) -> FactorCatalog {
    use LawVariable::{Acceleration, Position, Rate};
    // Ranges from which all constants are chosen.
    let extent = TravelExtent::new(position, rate);
    let scale = root_mean_square(rate);
    // Friction or damping that acts in one direction only.
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
    // Factors alone; pairs follow below.
    let mut menu = FactorCatalog::default();
    // Functions of the position: springs, stops, waves, bumps, detents and friction with memory.
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
    alone.extend(factors_of(Position, extent.local_shapes(step, &WIDTHS[..1])));
    alone.extend(factors_of(Position, extent.memory_shapes()));
    // Functions of the rate: friction and damping.
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
    // Shapes around the rate zero describe friction near a reversal.
    for make in [bump, detent] {
        let slow = SCALES.map(|part| make(0.0, part * extent.fastest));
        alone.extend(factors_of(Rate, slow));
    }
    alone.extend(factors_of(Acceleration, [LawShape::LINEAR, LawShape::MAGNITUDE]));
    // Friction, damping and mass that depend on the position.
    let ways = [
        LawShape::LINEAR,
        LawShape::SIGN,
        LawShape::MAGNITUDE,
        LawShape::integer_power(2, true),
        extent.step_shapes()[2],
        extent.step_shapes()[4],
    ];
    // Functions of the position by which these are multiplied.
    let some = [LawShape::LINEAR, LawShape::integer_power(2, false)].into_iter();
    let some = some.chain(extent.shifted_powers(2)).chain(extent.hinge_shapes(1));
    let some = some.chain(extent.local_shapes(bump, &WIDTHS[1..]));
    menu.pairs.push([factors_of(Position, some), factors_of(Rate, ways)]);
    let few = [LawShape::LINEAR, LawShape::SIGN, LawShape::MAGNITUDE];
    menu.pairs
        .push([factors_of(Position, extent.wave_shapes()), factors_of(Rate, few)]);
    menu.pairs
        .push([simple_positions(), factors_of(Acceleration, [LawShape::LINEAR])]);
    // The load is known for drives only.
    if let Some(load) = load {
        add_loads(&mut menu, &extent, load);
    }
    menu
}

/// The position and its square.
fn simple_positions() -> Vec<LawFactor> {
    let shapes = [LawShape::LINEAR, LawShape::integer_power(2, false)];
    factors_of(LawVariable::Position, shapes)
}

/// Adds factors of the load: alone, with rates and with positions.
fn add_loads(menu: &mut FactorCatalog, extent: &TravelExtent, load: &[f64]) {
    use LawVariable::{Load, Rate};
    // Scales of the load.
    let largest = largest_magnitude(load);
    let scale = root_mean_square(load);
    // Powers of the load, with and without its sign.
    let mut loads = vec![
        LawShape::LINEAR,
        LawShape::MAGNITUDE,
        LawShape::integer_power(2, false),
        LawShape::integer_power(2, true),
    ];
    loads.extend([1, 3].map(|n| half_power(n, false, scale)));
    // Loads that act only beyond a limit, in either direction.
    let cut = LOADS.into_iter().flat_map(|part| {
        [1.0, -1.0].map(|side| LawShape::Hinge {
            from: side * part * largest,
            side,
            power: 1,
        })
    });
    menu.single_factors.extend(factors_of(Load, loads.iter().copied()));
    menu.single_factors.extend(factors_of(Load, cut));
    // Load-dependent friction of all kinds.
    let mut speeds = vec![LawShape::LINEAR, LawShape::SIGN, LawShape::MAGNITUDE];
    speeds.extend(extent.step_shapes());
    speeds.extend(extent.fading_shapes(4));
    menu.pairs
        .push([factors_of(Load, loads.iter().copied()), factors_of(Rate, speeds)]);
    menu.pairs.push([factors_of(Load, loads), simple_positions()]);
}

/// Factors that are tried for the motion of another place, alone and multiplied by the own motion.
pub(crate) fn factors_with_other(own_rate: &[f64], position: &[f64], rate: &[f64], is_angle: bool) -> FactorCatalog {
    use LawVariable::{Acceleration, OtherPosition, OtherRate, Position, Rate};
    let [low, high] = range(position);
    // Scales of the constants: ranges and largest rates of both places.
    let (fastest, own_fastest) = (largest_magnitude(rate), largest_magnitude(own_rate));
    let travel = high - low;
    // Functions of the other position.
    let mut places = vec![
        LawShape::LINEAR,
        LawShape::integer_power(2, false),
        LawShape::integer_power(3, true),
    ];
    places.extend(MIDDLES.map(|part| LawShape::Shifted {
        centre: low + part * travel,
        power: 2,
    }));
    // A revolute joint may act once or twice per turn.
    if is_angle {
        // Full and half turns.
        let turns = [1.0, 0.5].map(|part| LawShape::Wave {
            pitch: part * std::f64::consts::TAU,
        });
        places.extend(turns);
    }
    // Waves over the travel of the other place.
    let waves = [0.5, 1.0, 1.6, 2.3, 3.2].map(|times| LawShape::Wave { pitch: travel / times });
    // Smooth signs of a rate.
    let steps = |fastest: f64| {
        [0.02, 0.15, 0.5].map(|part| LawShape::Step {
            centre: 0.0,
            width: part * fastest,
        })
    };
    // Functions of the other rate.
    let mut rates = vec![
        LawShape::LINEAR,
        LawShape::SIGN,
        LawShape::MAGNITUDE,
        LawShape::integer_power(2, true),
        LawShape::integer_power(2, false),
    ];
    rates.extend(steps(fastest));
    // Own motion: rates of several shapes, later also position and acceleration.
    let mut own_rates = vec![
        LawShape::LINEAR,
        LawShape::SIGN,
        LawShape::MAGNITUDE,
        LawShape::integer_power(2, true),
        LawShape::integer_power(2, false),
    ];
    own_rates.push(steps(own_fastest)[1]);
    // Alone, roots of the other rate are tried as well.
    let mut alone_rates = rates.clone();
    let scale = root_mean_square(rate);
    for n in [1, 3] {
        alone_rates.extend([true, false].map(|is_odd| half_power(n, is_odd, scale)));
    }
    // Factors of the own motion, by which those of the other place are multiplied.
    let own = || {
        let mut all = factors_of(Rate, own_rates.iter().copied());
        all.extend(factors_of(Position, [LawShape::LINEAR]));
        all.extend(factors_of(Acceleration, [LawShape::LINEAR]));
        all
    };
    // Functions of the other motion alone, then their products with the own motion and with each other.
    let mut alone = factors_of(OtherPosition, places.iter().copied().chain(waves));
    alone.extend(factors_of(OtherRate, alone_rates));
    let few = [LawShape::LINEAR, LawShape::SIGN, LawShape::MAGNITUDE];
    FactorCatalog {
        pairs: vec![
            [factors_of(OtherPosition, places[..3].iter().copied()), own()],
            [factors_of(OtherPosition, places[3..].iter().copied()), own()],
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
