//! Exact scalars and angles as a model file writes them: `"-pi/2"`, `"1/2"`, `"2*r3 + d4"`.
//!
//! They are trees over the symbols of a file, made by `parser` and `scope`. Nothing here is rounded.

use num_rational::BigRational;

/// Index of a constant in [`crate::Mechanism::constants`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ConstantIdx(pub usize);
/// Index of a dynamic parameter in [`crate::Mechanism::parameters`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ParameterIdx(pub usize);
/// Index of a coordinate in [`crate::Mechanism::coordinates`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CoordinateIdx(pub usize);

/// A quantity of its place that an effect may use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PlaceQuantity {
    /// The length or angle of the actuator, or the joint coordinate itself.
    Coordinate,
    /// Its first time derivative.
    Rate,
    /// Its second time derivative.
    Acceleration,
    /// The force or torque at the place, without those of effects.
    Load,
    /// The coordinate of the other one of two places.
    OtherCoordinate,
    /// The rate of the other one of two places.
    OtherRate,
    /// The acceleration of the other one of two places.
    OtherAcceleration,
}

impl PlaceQuantity {
    /// All quantities.
    pub const ALL: [Self; 7] = [
        Self::Coordinate,
        Self::Rate,
        Self::Acceleration,
        Self::Load,
        Self::OtherCoordinate,
        Self::OtherRate,
        Self::OtherAcceleration,
    ];

    /// Its name in expressions.
    pub fn name(self) -> &'static str {
        match self {
            Self::Coordinate => "coordinate",
            Self::Rate => "rate",
            Self::Acceleration => "acceleration",
            Self::Load => "load",
            Self::OtherCoordinate => "other_coordinate",
            Self::OtherRate => "other_rate",
            Self::OtherAcceleration => "other_acceleration",
        }
    }

    /// Whether it belongs to the other one of two places.
    pub fn is_other(self) -> bool {
        matches!(self, Self::OtherCoordinate | Self::OtherRate | Self::OtherAcceleration)
    }
}

/// A name of the model file, resolved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ModelSymbol {
    /// Known geometry, gravity and the like.
    Constant(ConstantIdx),
    /// A dynamic parameter, which identification may estimate.
    Parameter(ParameterIdx),
    /// A joint coordinate.
    Coordinate(CoordinateIdx),
    /// A quantity of the place on which an effect acts.
    Place(PlaceQuantity),
}

/// Functions that may stand in an exact expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ExactFunction {
    /// Sine of an angle.
    Sin,
    /// Cosine of an angle.
    Cos,
    /// Square root.
    Sqrt,
    /// Absolute value.
    Abs,
    /// Sign: -1, 0 or 1.
    Sign,
    /// Hyperbolic tangent.
    Tanh,
    /// Exponential.
    Exp,
}

/// An exact expression over the symbols of a model file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ExactExpression {
    /// A rational number; decimals such as `0.316` are rationals too.
    Rational(BigRational),
    /// The number pi.
    Pi,
    /// A named quantity.
    Symbol(ModelSymbol),
    /// Sum of the operands.
    Sum(Vec<ExactExpression>),
    /// Product of the operands.
    Product(Vec<ExactExpression>),
    /// First operand over the second.
    Quotient(Box<ExactExpression>, Box<ExactExpression>),
    /// The operand with the opposite sign.
    Negative(Box<ExactExpression>),
    /// Integer power with an exponent of magnitude at most 16.
    Power(Box<ExactExpression>, i32),
    /// A function of the operand.
    Apply(ExactFunction, Box<ExactExpression>),
}

/// An angle whose sine and cosine are exact, in rad: `pi` times a coefficient, plus integer multiples of symbols.
///
/// The coefficient is a multiple of 1/12, so that the sine and cosine of the fixed part lie in Q(sqrt 2, sqrt 3).
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ExactAngle {
    /// Coefficient of pi.
    pub pi: BigRational,
    /// Constants (unit rad) and revolute coordinates with their integer factors; sorted, without zeros.
    pub terms: Vec<(ModelSymbol, i32)>,
}

/// A length that is linear in prismatic coordinates, in m.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExactLength {
    /// The constant part; an expression over constants only.
    pub offset: ExactExpression,
    /// Prismatic coordinates with their rational factors; sorted, without zeros.
    pub coordinates: Vec<(CoordinateIdx, BigRational)>,
}
