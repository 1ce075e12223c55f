//! Kinds of actuators: what turns a command, a current or a voltage into the force of a drive. One enum, and one file
//! for each of its variants.
//!
//! A kind goes in with the gains of a file, the force of the drive as a sum of known factors and unknown gains comes
//! out. [`Mechanism::with_servo_equations`](crate::Mechanism::with_servo_equations) makes equations of motion of it.
//!
//! Decision: the force of an actuator is linear in products of gains, so that gains are parameters as masses are, and
//! the exact reduction finds what can be known of both together. Saturation and dead bands are not linear: they are known
//! numbers that change forces and signals before the equations are formed.

mod current;
mod duty;
mod equations;
mod hydraulic_cylinder;
mod position_servo;
mod velocity_servo;
mod voltage;

use crate::exact::{ExactExpression, ModelSymbol, ParameterIdx, PlaceQuantity};
use crate::formula::SourceFormula;
use crate::joint_motion::CoordinateMotion;
use crate::kinds::PlaceLoad;
use crate::mechanism::DriveIdx;
use crate::schema::ActuatorEntry;
use crate::unit::UnitDimension;
use crate::words::words;

words! {
    /// What turns a command, a current or a voltage into the force of a drive.
    pub ActuatorKind as "ActuatorKindName": "a kind of actuator",
    /// A position controller: `kp*(command - position) - kd*rate`.
    "position_servo" => PositionServo,
    /// A velocity controller: `kv*(command - rate)`.
    "velocity_servo" => VelocityServo,
    /// A motor whose current is recorded.
    "current" => Current,
    /// A motor whose voltage is recorded.
    "voltage" => Voltage,
    /// A motor with a recorded duty cycle of a known supply.
    "duty" => Duty,
    /// A cylinder with the pressures of its two chambers, or a hydraulic motor.
    "hydraulic_cylinder" => HydraulicCylinder,
}

impl ActuatorKind {
    /// All kinds, in the order of the documentation.
    pub const ALL: [Self; 6] = [
        Self::PositionServo,
        Self::VelocityServo,
        Self::Current,
        Self::Voltage,
        Self::Duty,
        Self::HydraulicCylinder,
    ];

    /// The word of model files.
    pub fn name(self) -> &'static str {
        self.entry().name()
    }

    /// The force as a formula in the words of the model file.
    pub fn formula(self) -> &'static str {
        self.entry().formula()
    }

    /// The recorded quantities, such as `command` or `current`.
    pub fn signals(self) -> &'static [&'static str] {
        self.entry().signals()
    }

    /// Whether the recorded quantity is a command, which contains no noise of the sensors.
    pub fn is_commanded(self) -> bool {
        self.entry().is_commanded()
    }

    /// The properties of the variant.
    pub(crate) fn entry(self) -> &'static dyn ActuatorKindEntry {
        match self {
            Self::PositionServo => &position_servo::PositionServo,
            Self::VelocityServo => &velocity_servo::VelocityServo,
            Self::Current => &current::CurrentDrive,
            Self::Voltage => &voltage::VoltageDrive,
            Self::Duty => &duty::DutyDrive,
            Self::HydraulicCylinder => &hydraulic_cylinder::HydraulicCylinder,
        }
    }
}

/// The properties of a kind of actuator.
pub(crate) trait ActuatorKindEntry: Sync {
    /// See [`ActuatorKind::name`].
    fn name(&self) -> &'static str;
    /// See [`ActuatorKind::formula`].
    fn formula(&self) -> &'static str;
    /// See [`ActuatorKind::signals`].
    fn signals(&self) -> &'static [&'static str];
    /// What is recorded. Commands have the unit of the drive's coordinate or of its rate.
    fn quantity(&self) -> SignalQuantity;
    /// See [`ActuatorKind::is_commanded`].
    fn is_commanded(&self) -> bool;
    /// Delay of its signals if the file gives none, s; `None` if it is estimated.
    fn usual_delay(&self) -> Option<f64> {
        None
    }
    /// The gains and constants of the kind.
    fn gains(&self) -> &'static [GainEntry];
    /// The part of the force that depends on one of [`Self::signals`], as terms. `gain` returns the gain of a key, `None` if
    /// the file omits it.
    fn terms(&self, signal: usize, gain: &dyn Fn(&str) -> Option<ActuatorGain>) -> Vec<ActuatorTerm>;
}

/// A gain or constant that a kind of actuator has.
pub(crate) struct GainEntry {
    /// Its key in the model file.
    pub(crate) key: &'static str,
    /// Whether the file must give it.
    pub(crate) is_required: bool,
    /// Whether it may be a parameter, which is estimated. Otherwise it is a number or constant.
    pub(crate) may_be_unknown: bool,
    /// Its dimension per unit of the drive's load, and per unit of the drive's coordinate to the power `per_position`.
    pub(crate) per_load: UnitDimension,
    /// Whether it is multiplied by the dimension of the load.
    pub(crate) has_load: bool,
    /// Power of the coordinate's dimension.
    pub(crate) per_position: i32,
}

impl GainEntry {
    /// Its dimension at a drive that carries a force (with positions in m) or a torque (with angles).
    pub(crate) fn dimension(&self, load: PlaceLoad) -> UnitDimension {
        let (force, position) = match load {
            PlaceLoad::Torque => (UnitDimension::TORQUE, UnitDimension::ONE),
            _ => (UnitDimension::FORCE, UnitDimension::LENGTH),
        };
        let own = self.per_load.multiplied_by(position.power(self.per_position));
        if self.has_load { own.multiplied_by(force) } else { own }
    }

    /// The formula that a file gives for it.
    pub(crate) fn formula(key: &str, entry: &ActuatorEntry) -> Option<SourceFormula> {
        let formula = match key {
            "kp" => &entry.kp,
            "kd" => &entry.kd,
            "kv" => &entry.kv,
            "torque_constant" => &entry.torque_constant,
            "ratio" => &entry.ratio,
            "efficiency" => &entry.efficiency,
            "resistance" => &entry.resistance,
            "back_emf" => &entry.back_emf,
            "supply" => &entry.supply,
            "area_a" => &entry.area_a,
            "area_b" => &entry.area_b,
            _ => return None,
        };
        formula.clone()
    }

    /// The keys of all gains.
    pub(crate) const KEYS: [&'static str; 11] = [
        "kp",
        "kd",
        "kv",
        "torque_constant",
        "ratio",
        "efficiency",
        "resistance",
        "back_emf",
        "supply",
        "area_a",
        "area_b",
    ];
}

/// A gain: a product of parameters times a known factor.
#[derive(Clone, Debug)]
pub struct ActuatorGain {
    /// The parameters with their powers, sorted; none if the gain is known.
    pub parameters: Vec<(ParameterIdx, u32)>,
    /// The known factor; an expression over constants.
    pub factor: ExactExpression,
}

impl ActuatorGain {
    /// A known number.
    pub(crate) fn unity() -> Self {
        Self {
            parameters: Vec::new(),
            factor: ExactExpression::unity(),
        }
    }

    /// The product of two gains.
    pub(crate) fn times(&self, other: &Self) -> Self {
        let mut parameters = self.parameters.clone();
        for (parameter, power) in &other.parameters {
            match parameters.iter_mut().find(|(known, _)| known == parameter) {
                Some((_, total)) => *total += power,
                None => parameters.push((*parameter, *power)),
            }
        }
        parameters.sort_unstable();
        Self {
            parameters,
            factor: ExactExpression::Product(vec![self.factor.clone(), other.factor.clone()]),
        }
    }

    /// The quotient of two gains, of which the second one is known.
    pub(crate) fn over(&self, known: &Self) -> Self {
        Self {
            parameters: self.parameters.clone(),
            factor: ExactExpression::Quotient(Box::new(self.factor.clone()), Box::new(known.factor.clone())),
        }
    }

    /// Separates an expression into parameters and a known factor; `None` if it is not such a product.
    pub(crate) fn from_expression(exact: &ExactExpression) -> Option<Self> {
        let mut is_known = true;
        exact.for_each_symbol(&mut |symbol| is_known &= !matches!(symbol, ModelSymbol::Parameter(_)));
        if is_known {
            return Some(Self {
                parameters: Vec::new(),
                factor: exact.clone(),
            });
        }
        match exact {
            ExactExpression::Symbol(ModelSymbol::Parameter(p)) => Some(Self {
                parameters: vec![(*p, 1)],
                factor: ExactExpression::unity(),
            }),
            ExactExpression::Product(factors) => factors.iter().try_fold(Self::unity(), |product, factor| {
                Some(product.times(&Self::from_expression(factor)?))
            }),
            ExactExpression::Quotient(above, below) => {
                let below = Self::from_expression(below).filter(|gain| gain.parameters.is_empty())?;
                Some(Self::from_expression(above)?.over(&below))
            }
            ExactExpression::Negative(inner) => {
                let inner = Self::from_expression(inner)?;
                Some(Self {
                    factor: ExactExpression::Negative(Box::new(inner.factor)),
                    ..inner
                })
            }
            _ => None,
        }
    }

    /// The term of the force that is this gain times a quantity.
    fn term(self, quantity: ExactExpression) -> ActuatorTerm {
        ActuatorTerm {
            parameters: self.parameters,
            factor: ExactExpression::Product(vec![self.factor, quantity]),
        }
    }
}

/// A term of the force of an actuator.
#[derive(Clone, Debug)]
pub struct ActuatorTerm {
    /// The parameters with their powers; none if the term is known.
    pub parameters: Vec<(ParameterIdx, u32)>,
    /// The factor of their product. The signal and its derivative are `other_coordinate` and `other_rate`.
    pub factor: ExactExpression,
}

/// An actuator of a file.
#[derive(Clone, Debug)]
pub struct ModelActuator {
    /// The drive whose force it makes.
    pub drive: DriveIdx,
    /// Its kind.
    pub kind: ActuatorKind,
    /// Name of the recorded signal.
    pub signal: String,
    /// Kind of motion of the signal: that of the drive's coordinate for positions, a length for all others.
    pub motion: CoordinateMotion,
    /// What the signal is.
    pub quantity: SignalQuantity,
    /// Terms of its force.
    pub terms: Vec<ActuatorTerm>,
    /// Known delay of the signal, s; `None` if it is unknown.
    pub delay: Option<f64>,
    /// Largest absolute force, N m or N; `None` without a limit.
    pub saturation: Option<f64>,
    /// Largest absolute error of position without a force, rad or m; `None` without a dead band.
    pub dead_band: Option<f64>,
    /// Largest rate at which the servo follows a command, rad/s or m/s (for a `velocity_servo` rad/s^2 or m/s^2); `None`
    /// without a limit.
    pub rate_limit: Option<f64>,
}

/// What the signal of an actuator is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignalQuantity {
    /// A position to reach, in the unit of the drive's coordinate.
    Position,
    /// A rate to reach, in the unit of the rate of the drive's coordinate.
    Rate,
    /// A current, A.
    Current,
    /// A voltage, V.
    Voltage,
    /// A share of the supply, -1 to 1.
    Share,
    /// A pressure, Pa.
    Pressure,
}

impl ModelActuator {
    /// The signal that has the same effect on a servo without a dead band: the position inside the band, and the error
    /// beyond it outside.
    pub fn effective_signal(&self, signal: f64, position: f64) -> f64 {
        if self.quantity != SignalQuantity::Position {
            return signal;
        }
        let error = signal - position;
        match self.dead_band {
            Some(band) => position + error.signum() * (error.abs() - band).max(0.0),
            None => position + error,
        }
    }

    /// Change of its force per unit of the signal, of the signal's rate, of the position and of its rate, without limits. The
    /// force of every kind is linear in these. `constant` returns the value of a constant by its index, `gain` that of the
    /// parameters of a term.
    pub fn slopes(&self, constant: &dyn Fn(usize) -> f64, gain: &dyn Fn(&ActuatorTerm) -> f64) -> [f64; 4] {
        let gains: Vec<f64> = self.terms.iter().map(gain).collect();
        let force = |states: [f64; 4]| -> f64 {
            let symbol = |symbol: ModelSymbol| match symbol {
                ModelSymbol::Constant(c) => constant(c.0),
                ModelSymbol::Place(PlaceQuantity::OtherCoordinate) => states[0],
                ModelSymbol::Place(PlaceQuantity::OtherRate) => states[1],
                ModelSymbol::Place(PlaceQuantity::Coordinate) => states[2],
                ModelSymbol::Place(PlaceQuantity::Rate) => states[3],
                _ => 0.0,
            };
            let terms = self.terms.iter().zip(&gains);
            terms.map(|(term, gain)| gain * term.factor.evaluate(&symbol)).sum()
        };
        let unit = |place: usize| std::array::from_fn(|k| if k == place { 1.0 } else { 0.0 });
        std::array::from_fn(|place| force(unit(place)))
    }

    /// Its force, N or N m, with [`Self::slopes`], dead band and saturation, at a signal, the signal's rate, a position and
    /// its rate.
    pub fn force(&self, slopes: &[f64; 4], [signal, signal_rate, position, rate]: [f64; 4]) -> f64 {
        let states = [self.effective_signal(signal, position), signal_rate, position, rate];
        let sum = slopes.iter().zip(states).map(|(slope, state)| slope * state).sum();
        self.limited_force(sum)
    }

    /// Whether its force depends on the error of a position.
    pub fn has_position_error(&self) -> bool {
        self.quantity == SignalQuantity::Position
    }

    /// A force after the saturation of the actuator.
    pub fn limited_force(&self, force: f64) -> f64 {
        self.saturation
            .map_or(force, |limit| force.clamp(-limit.abs(), limit.abs()))
    }

    /// Unit of its positions: `rad` or `m`.
    pub fn position_unit(&self) -> &'static str {
        if self.motion.is_angle() { "rad" } else { "m" }
    }
}

/// The force of an actuator in the equations of motion of a mechanism.
#[derive(Clone, Debug)]
pub struct ServoForce {
    /// The drive on which it acts.
    pub drive: DriveIdx,
    /// The coordinate that stands for its signal.
    pub signal: crate::exact::CoordinateIdx,
    /// Its terms, with the sign that they have on the side of the drive force.
    pub terms: Vec<ActuatorTerm>,
}

/// The signal.
fn signal() -> ExactExpression {
    ExactExpression::Symbol(ModelSymbol::Place(PlaceQuantity::OtherCoordinate))
}

/// The rate of the drive's coordinate.
fn rate() -> ExactExpression {
    ExactExpression::Symbol(ModelSymbol::Place(PlaceQuantity::Rate))
}

/// The difference of two quantities.
fn difference(of: ExactExpression, from: ExactExpression) -> ExactExpression {
    ExactExpression::Sum(vec![of, ExactExpression::Negative(Box::new(from))])
}

/// The force of a motor at a voltage: `constant*ratio*efficiency/resistance*(supply*signal - back_emf*ratio*rate)`.
fn motor_terms(gain: &dyn Fn(&str) -> Option<ActuatorGain>) -> Vec<ActuatorTerm> {
    let known = |key: &str| gain(key).unwrap_or_else(ActuatorGain::unity);
    let per_volt = known("torque_constant")
        .times(&known("ratio"))
        .times(&known("efficiency"))
        .over(&known("resistance"));
    let mut terms = vec![per_volt.times(&known("supply")).term(signal())];
    if let Some(back_emf) = gain("back_emf") {
        let braking = per_volt.times(&back_emf).times(&known("ratio"));
        terms.push(braking.term(ExactExpression::Negative(Box::new(rate()))));
    }
    terms
}

/// A gain that may be unknown, in units of load times `per_load` times position to `per_position`.
const fn gain(key: &'static str, is_required: bool, per_load: UnitDimension, per_position: i32) -> GainEntry {
    GainEntry {
        key,
        is_required,
        may_be_unknown: true,
        per_load,
        has_load: true,
        per_position,
    }
}

/// A constant that must be known.
const fn constant(key: &'static str, is_required: bool, dimension: UnitDimension) -> GainEntry {
    GainEntry {
        key,
        is_required,
        may_be_unknown: false,
        per_load: dimension,
        has_load: false,
        per_position: 0,
    }
}
