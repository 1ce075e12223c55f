//! Random mechanisms, built as values without a model file; the same seed makes the same mechanism.

mod free;
mod planar_loop;
mod tree;

pub use free::hung_free;
pub use planar_loop::{planar_loop, regularity_at};
pub use tree::tree;

use modelmill_spec::{
    ConstantIdx, CoordinateIdx, CoordinateMotion, DriveIdx, DriveKind, DynamicParameter, EffectBodies, EffectPlace,
    EffectTerm, ExactExpression, ExactFunction, ExactLength, FrameAxis, FrameConvention, FrameIdx, FramePoint,
    FrameStep, JointCoordinate, LumpedMass, Mechanism, ModelConstant, ModelDrive, ModelEffect, ModelFrame, ModelPart,
    ModelSymbol, MotionLimits, ParameterIdx, PartInertia, PlaceQuantity, PointIdx, RecordingColumns,
};
use nalgebra::{Matrix3, Vector3};
use num_rational::BigRational;

use crate::mechanics::{Numbers, along};
use crate::stream::Stream;

/// What a random mechanism may hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matter {
    /// Whole rigid bodies on every frame whose nominal values some real body could have, and nothing else.
    Physical,
    /// Bodies with missing entries, ties, centres of mass, lumped masses placed once or twice, effects.
    Anything,
    /// Anything, more lumped masses, and constants that are zero, quarter turns, or those of others, to the last digit or
    /// nearly.
    Special,
}

/// A mechanism in the making.
struct Draft {
    stream: Stream,
    matter: Matter,
    mechanism: Mechanism,
}

const ZERO: fn() -> ExactExpression = || number(0);

fn number(value: i64) -> ExactExpression {
    ExactExpression::Rational(BigRational::from_integer(value.into()))
}

fn ratio(numerator: i64, denominator: i64) -> BigRational {
    BigRational::new(numerator.into(), denominator.into())
}

/// Index as a number for [`Stream::below`] choices.
fn small(n: usize) -> i64 {
    i64::try_from(n).expect("a small number")
}

impl Draft {
    fn new(kind: &str, seed: u64, matter: Matter) -> Self {
        let base = ModelFrame {
            name: "base".to_owned(),
            parent: FrameIdx(0),
            steps: Vec::new(),
            convention: FrameConvention::Base,
        };
        Self {
            stream: Stream::new(seed),
            matter,
            mechanism: Mechanism {
                name: format!("{kind}_{seed}"),
                title: None,
                gravity: [ZERO(), ZERO(), ZERO()],
                constants: Vec::new(),
                parameters: Vec::new(),
                coordinates: Vec::new(),
                frames: vec![base],
                points: Vec::new(),
                parts: Vec::new(),
                lumped_masses: Vec::new(),
                loops: Vec::new(),
                couplings: Vec::new(),
                drives: Vec::new(),
                shared_drives: Vec::new(),
                actuators: Vec::new(),
                servo_forces: Vec::new(),
                effects: Vec::new(),
                force_delay: 0.0,
                identified_base: Vec::new(),
                retain: Vec::new(),
                limits: MotionLimits::default(),
                recording: RecordingColumns::default(),
                has_numeric_constants: false,
            },
        }
    }

    fn constant(&mut self, prefix: &str, value: f64, unit: &str) -> ConstantIdx {
        let i = self.mechanism.constants.len();
        let value = self.value(value, unit);
        self.mechanism.constants.push(ModelConstant {
            name: format!("{prefix}{i}"),
            value,
            unit: unit.to_owned(),
            is_angle: unit == "rad",
            note: None,
        });
        ConstantIdx(i)
    }

    /// The value that was drawn for a constant, or a special one in its place.
    fn value(&mut self, drawn: f64, unit: &str) -> f64 {
        const GAPS: [f64; 8] = [0.0, 0.0, 2e-16, 1e-14, 1e-12, 1e-9, 1e-6, 1e-3];
        if self.matter != Matter::Special || drawn == 0.0 {
            return drawn;
        }
        let gap = *self.stream.pick(&GAPS);
        let others = self.mechanism.constants.iter();
        let others: Vec<f64> = (others.filter(|c| c.unit == unit)).map(|c| c.value).collect();
        match self.stream.below(10) {
            0..4 if !others.is_empty() => {
                let other = *self.stream.pick(&others);
                other + gap * other.abs()
            }
            4 => 0.0,
            5 if unit == "rad" => std::f64::consts::FRAC_PI_2 * (1.0 + gap),
            _ => drawn,
        }
    }

    fn length(&mut self, low: f64, high: f64) -> ExactExpression {
        let value = self.stream.either_side(low, high);
        ExactExpression::Symbol(ModelSymbol::Constant(self.constant("l", value, "m")))
    }

    fn parameter(&mut self, prefix: &str, nominal: f64) -> ParameterIdx {
        let i = self.mechanism.parameters.len();
        self.mechanism.parameters.push(DynamicParameter {
            name: format!("{prefix}{i}"),
            nominal,
            has_nominal: true,
            unit: "1".to_owned(),
            note: None,
        });
        ParameterIdx(i)
    }

    fn symbol(&mut self, prefix: &str, nominal: f64) -> ExactExpression {
        ExactExpression::Symbol(ModelSymbol::Parameter(self.parameter(prefix, nominal)))
    }

    fn coordinate(&mut self, motion: CoordinateMotion) -> CoordinateIdx {
        let i = self.mechanism.coordinates.len();
        let nominal = if motion.is_angle() {
            self.stream.between(-3.0, 3.0)
        } else {
            self.stream.between(0.2, 1.2)
        };
        self.mechanism.coordinates.push(JointCoordinate {
            name: format!("q{i}"),
            motion,
            passive: false,
            nominal,
        });
        CoordinateIdx(i)
    }

    fn frame(&mut self, parent: FrameIdx, steps: Vec<FrameStep>) -> FrameIdx {
        let i = self.mechanism.frames.len();
        self.mechanism.frames.push(ModelFrame {
            name: format!("frame{i}"),
            parent,
            steps,
            convention: FrameConvention::Transform("random".to_owned()),
        });
        FrameIdx(i)
    }

    fn point(&mut self, frame: FrameIdx, at: [ExactExpression; 3]) -> PointIdx {
        let i = self.mechanism.points.len();
        self.mechanism.points.push(FramePoint {
            name: format!("point{i}"),
            frame,
            at,
        });
        PointIdx(i)
    }

    /// A point at random symbolic components in some of the three directions.
    fn place(&mut self, planar: bool) -> [ExactExpression; 3] {
        std::array::from_fn(|i| {
            if (planar && i == 2) || self.stream.chance(0.3) {
                ZERO()
            } else {
                self.length(0.1, 0.6)
            }
        })
    }

    /// Gravity of random constants, along one axis of the plane or none, or anywhere.
    fn gravity(&mut self, planar: bool) {
        let choice = self.stream.below(4);
        for i in 0..3 {
            let along = match choice {
                0 => false,
                1 => i == 1,
                2 => i == if planar { 0 } else { 2 },
                _ => !(planar && i == 2),
            };
            if along {
                let value = self.stream.either_side(3.0, 10.0);
                let symbol = self.constant("g", value, "m/s^2");
                self.mechanism.gravity[i] = ExactExpression::Symbol(ModelSymbol::Constant(symbol));
            }
        }
    }

    /// A body with all its linear parameters (those that matter in the plane) and values of a real body.
    fn whole_body(&mut self, planar: bool) -> PartInertia {
        let mut mass = 0.0;
        let mut moment = Vector3::zeros();
        let mut inertia = Matrix3::zeros();
        for _ in 0..5 {
            let m = self.stream.between(0.3, 2.0);
            let mut at = Vector3::from_fn(|_, _| self.stream.between(-0.4, 0.4));
            if planar {
                at[2] = 0.0;
            }
            mass += m;
            moment += m * at;
            inertia += m * (at.norm_squared() * Matrix3::identity() - at * at.transpose());
        }
        let mut entry = |name: &str, value: f64, matters: bool| {
            if matters { self.symbol(name, value) } else { ZERO() }
        };
        let inertia = [
            entry("XX", inertia[(0, 0)], !planar),
            entry("XY", inertia[(0, 1)], !planar),
            entry("XZ", inertia[(0, 2)], !planar),
            entry("YY", inertia[(1, 1)], !planar),
            entry("YZ", inertia[(1, 2)], !planar),
            entry("ZZ", inertia[(2, 2)], true),
        ];
        let first_moment = [
            entry("MX", moment[0], true),
            entry("MY", moment[1], true),
            entry("MZ", moment[2], !planar),
        ];
        PartInertia::Linear {
            mass: entry("M", mass, true),
            first_moment,
            inertia,
        }
    }

    /// A body whose entries may be missing, or that is given by its centre of mass.
    fn any_body(&mut self, planar: bool) -> PartInertia {
        if self.stream.chance(0.3) {
            let mass = {
                let value = self.stream.between(0.5, 4.0);
                self.symbol("m", value)
            };
            let centre = std::array::from_fn(|i| match self.stream.below(3) {
                _ if planar && i == 2 => ZERO(),
                0 => ZERO(),
                1 => self.length(0.1, 0.4),
                _ => {
                    let value = self.stream.either_side(0.1, 0.4);
                    self.symbol("c", value)
                }
            });
            let inertia = std::array::from_fn(|i| {
                if (planar && i != 5) || self.stream.chance(0.4) {
                    ZERO()
                } else {
                    let value = self.stream.between(0.05, 0.5);
                    self.symbol("I", value)
                }
            });
            return PartInertia::AboutCentre { mass, centre, inertia };
        }
        let mut inertial = self.whole_body(planar);
        if self.stream.chance(0.4)
            && let PartInertia::Linear {
                first_moment, inertia, ..
            } = &mut inertial
        {
            for entry in first_moment.iter_mut().chain(inertia) {
                if self.stream.chance(0.4) {
                    *entry = ZERO();
                }
            }
        }
        inertial
    }

    /// Bodies on all frames from `first` on.
    fn bodies(&mut self, first: usize, planar: bool, matter: Matter) {
        for frame in first..self.mechanism.frames.len() {
            let inertial = if matter == Matter::Physical {
                self.whole_body(planar)
            } else if self.stream.chance(0.15) {
                continue;
            } else if !self.mechanism.parts.is_empty() && self.stream.chance(0.2) {
                let tied = self.stream.below(self.mechanism.parts.len());
                self.mechanism.parts[tied].inertial.clone()
            } else {
                self.any_body(planar)
            };
            self.mechanism.parts.push(ModelPart {
                name: format!("part{frame}"),
                frame: FrameIdx(frame),
                inertial,
            });
        }
        if self.mechanism.parts.is_empty() {
            let inertial = self.whole_body(planar);
            let frame = FrameIdx(self.mechanism.frames.len() - 1);
            let name = "part".to_owned();
            self.mechanism.parts.push(ModelPart { name, frame, inertial });
        }
    }

    /// Up to two lumped masses, or six; half of them are seen elsewhere by the balance of moments.
    fn lumps(&mut self, planar: bool) {
        let most = if self.matter == Matter::Special { 7 } else { 3 };
        for _ in 0..self.stream.below(most) {
            let frame = FrameIdx(1 + self.stream.below(self.mechanism.frames.len() - 1));
            let value = self.stream.between(0.5, 3.0);
            let mass = self.symbol("ml", value);
            let force_at = self.place(planar);
            let moment_at = if self.stream.chance(0.5) {
                force_at.clone()
            } else {
                self.place(planar)
            };
            let share = ratio(1 + small(self.stream.below(3)), 2);
            self.mechanism.lumped_masses.push(LumpedMass {
                mass,
                share,
                frame,
                force_at,
                moment_at,
            });
        }
    }

    /// Drives on the active coordinates: at the joint, or now and then between two points across it.
    fn drives(&mut self, across: &[(CoordinateIdx, FrameIdx)], planar: bool) {
        for (coordinate, frame) in across {
            if self.mechanism.coordinates[coordinate.0].passive {
                continue;
            }
            let kind = if self.stream.chance(0.2) {
                let parent = self.mechanism.frames[frame.0].parent;
                let [mut from, mut to] = [self.place(planar), self.place(planar)];
                // Points on the joint's axis would not move it.
                for (point, low) in [(&mut from, 0.8), (&mut to, 0.3)] {
                    point[0] = self.length(low, low + 0.5);
                    point[1] = self.length(low, low + 0.5);
                }
                DriveKind::Linear {
                    from: self.point(parent, from),
                    to: self.point(*frame, to),
                }
            } else {
                DriveKind::Joint(*coordinate)
            };
            let name = format!("drive{}", self.mechanism.drives.len());
            self.mechanism.drives.push(ModelDrive {
                name,
                kind,
                is_driven: true,
            });
        }
    }

    /// Whether every drive moves with its joint at the nominal pose.
    fn drives_move(&self) -> bool {
        let mechanism = &self.mechanism;
        let nominal: Vec<f64> = mechanism.coordinates.iter().map(|c| c.nominal).collect();
        let numbers = Numbers::new(mechanism, Vec::new());
        let active = (0..nominal.len()).filter(|i| !mechanism.coordinates[*i].passive);
        active
            .enumerate()
            .all(|(d, i)| numbers.drives(&along(&nominal, i))[d].0[1].abs() > 0.2)
    }

    /// Up to three effects of the usual kinds.
    fn effects(&mut self) {
        for _ in 0..self.stream.below(4) {
            if self.stream.chance(0.2) {
                let frame = FrameIdx(1 + self.stream.below(self.mechanism.frames.len() - 1));
                let planar = !self.mechanism.loops.is_empty();
                let at = self.place(planar);
                let point = self.point(frame, at);
                let value = self.stream.between(0.2, 1.0);
                let parameter = self.parameter("dm", value);
                self.effect("point_mass", vec![EffectPlace::Point(point)], parameter, number(1));
                continue;
            }
            let symbol = |quantity| ExactExpression::Symbol(ModelSymbol::Place(quantity));
            let sign = ExactExpression::Apply(ExactFunction::Sign, Box::new(symbol(PlaceQuantity::Rate)));
            let on_drive = self.stream.chance(0.6);
            let choices = [
                ("viscous_friction", symbol(PlaceQuantity::Rate)),
                ("coulomb_friction", sign.clone()),
                ("drive_inertia", symbol(PlaceQuantity::Acceleration)),
                ("force_offset", number(1)),
                if on_drive {
                    // A coordinate carries no load of its own.
                    let friction = ExactExpression::Product(vec![symbol(PlaceQuantity::Load), sign]);
                    ("load_friction", friction)
                } else {
                    ("spring", symbol(PlaceQuantity::Coordinate))
                },
            ];
            let (kind, expression) = self.stream.pick(&choices).clone();
            let count = 1 + self.stream.below(2);
            let mut places: Vec<EffectPlace> = Vec::new();
            for _ in 0..count {
                let place = if on_drive {
                    EffectPlace::Drive(DriveIdx(self.stream.below(self.mechanism.drives.len())))
                } else {
                    let i = self.stream.below(self.mechanism.coordinates.len());
                    EffectPlace::Coordinate(CoordinateIdx(i))
                };
                if !places.contains(&place) {
                    places.push(place);
                }
            }
            let value = self.stream.between(0.2, 2.0);
            let parameter = self.parameter("e", value);
            self.effect(kind, places, parameter, expression);
        }
    }

    fn effect(&mut self, kind: &str, places: Vec<EffectPlace>, parameter: ParameterIdx, expression: ExactExpression) {
        self.mechanism.effects.push(ModelEffect {
            kind: kind.to_owned(),
            places,
            other: None,
            mechanics: None,
            terms: vec![EffectTerm {
                symbol: "p".to_owned(),
                parameter,
                expression,
            }],
            constants: Vec::new(),
            bodies: EffectBodies::default(),
        });
    }
}

/// Moves along an axis by an offset and a coordinate.
fn slide(axis: FrameAxis, offset: ExactExpression, coordinate: CoordinateIdx) -> FrameStep {
    FrameStep::Translate(
        axis,
        ExactLength {
            offset,
            coordinates: vec![(coordinate, ratio(1, 1))],
        },
    )
}

/// Moves along an axis by an offset.
fn shift(axis: FrameAxis, offset: ExactExpression) -> FrameStep {
    FrameStep::Translate(
        axis,
        ExactLength {
            offset,
            coordinates: Vec::new(),
        },
    )
}
