//! A validated mechanism: the content of a model file after every name is resolved and every check has passed.
//!
//! [`crate::load`] builds it, `modelmill-codegen` derives equations from it. Indices point into the vectors of
//! [`Mechanism`].

use num_rational::BigRational;

use crate::actuators::{ModelActuator, ServoForce};
use crate::exact::{CoordinateIdx, ExactAngle, ExactExpression, ExactLength, ModelSymbol, ParameterIdx};
use crate::joint_motion::CoordinateMotion;
use crate::mechanics::Mechanics;

/// Index of a frame in [`Mechanism::frames`]; 0 is the base.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FrameIdx(pub usize);
/// Index of a point in [`Mechanism::points`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PointIdx(pub usize);
/// Index of a drive in [`Mechanism::drives`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DriveIdx(pub usize);
/// Index of a part in [`Mechanism::parts`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PartIdx(pub usize);

/// A mechanism whose names are resolved and whose consistency is checked.
#[derive(Clone, Debug)]
pub struct Mechanism {
    /// Name of the model; an identifier, used for the emitted module.
    pub name: String,
    /// Title of one line.
    pub title: Option<String>,
    /// Gravity in the base frame, m/s^2; expressions over constants. A tilt among the effects is included.
    pub gravity: [ExactExpression; 3],
    /// Known quantities such as geometry.
    pub constants: Vec<ModelConstant>,
    /// Dynamic parameters in the order of declaration, which orders `p_g`.
    pub parameters: Vec<DynamicParameter>,
    /// Joint coordinates in the order of declaration.
    pub coordinates: Vec<JointCoordinate>,
    /// Frames; parents come before their children, 0 is the base.
    pub frames: Vec<ModelFrame>,
    /// Named points.
    pub points: Vec<FramePoint>,
    /// Rigid bodies.
    pub parts: Vec<ModelPart>,
    /// Lumped masses.
    pub lumped_masses: Vec<LumpedMass>,
    /// Loops closed by coincident points.
    pub loops: Vec<KinematicLoop>,
    /// Coordinates that follow others; they are passive.
    pub couplings: Vec<CoordinateCoupling>,
    /// Drives, one per degree of freedom. A degree of freedom without a drive has its row here too.
    pub drives: Vec<ModelDrive>,
    /// Drives of a mechanism with more drives than degrees of freedom, such as cables. Then none of [`Self::drives`]
    /// is driven, and these act on all of them by their transposed Jacobian, `J' f`.
    pub shared_drives: Vec<ModelDrive>,
    /// Actuators, for recordings of commands, currents or voltages. They are not part of the equations, see
    /// [`Mechanism::with_servo_equations`].
    pub actuators: Vec<ModelActuator>,
    /// Forces of actuators in the equations of motion; none unless [`Mechanism::with_servo_equations`] added them.
    pub servo_forces: Vec<ServoForce>,
    /// Friction, drive inertia and the like.
    pub effects: Vec<ModelEffect>,
    /// Delay of the recorded forces relative to the motion, s; zero unless an effect defines it. Equations and code
    /// do not contain it. It matters only where a model is compared with a recording.
    pub force_delay: f64,
    /// Products of dynamic parameters whose columns should be retained, most wanted first;
    /// each is a product of powers of parameters.
    pub retain: Vec<Vec<(ParameterIdx, u32)>>,
    /// Limits of planned motions.
    pub limits: MotionLimits,
    /// Identified values of base parameters by their expressions; they replace the values from nominal parameters.
    pub identified_base: Vec<(String, f64)>,
    /// How recordings name their columns: the model's names and theirs.
    pub recording: RecordingColumns,
    /// Whether constants of the file were replaced by their values, see [`Mechanism::with_numeric_constants`].
    pub has_numeric_constants: bool,
}

/// A known quantity.
#[derive(Clone, Debug)]
pub struct ModelConstant {
    /// Identifier.
    pub name: String,
    /// Value in SI units.
    pub value: f64,
    /// Unit as printed, e.g. `m`, `rad`, `m/s^2`, `1`.
    pub unit: String,
    /// True if it is an angle (unit rad) and may be a term of an [`ExactAngle`].
    pub is_angle: bool,
    /// Remark of the author.
    pub note: Option<String>,
}

/// A dynamic parameter.
#[derive(Clone, Debug)]
pub struct DynamicParameter {
    /// Identifier.
    pub name: String,
    /// Nominal value in SI units; zero if the file gives none.
    pub nominal: f64,
    /// Whether the file gives the nominal value, which may be zero.
    pub has_nominal: bool,
    /// Unit as printed.
    pub unit: String,
    /// Remark of the author.
    pub note: Option<String>,
}

/// A joint coordinate.
#[derive(Clone, Debug)]
pub struct JointCoordinate {
    /// Identifier.
    pub name: String,
    /// Kind of motion: an angle, a length, or a component of a quaternion.
    pub motion: CoordinateMotion,
    /// True if loop closure or a coupling determines the coordinate; the others are independent.
    pub passive: bool,
    /// Value at the nominal pose, rad or m, which selects the assembly mode. Values of passive coordinates are
    /// refined until the loops close.
    pub nominal: f64,
}

/// An axis of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum FrameAxis {
    X,
    Y,
    Z,
}

/// One elementary motion from a parent frame to its child. Each acts about or along the axes that the steps before it
/// give.
#[derive(Clone, Debug)]
pub enum FrameStep {
    /// Rotation about an axis.
    Rotate(FrameAxis, ExactAngle),
    /// Translation along an axis.
    Translate(FrameAxis, ExactLength),
    /// Free motion; the only step of a frame on the base.
    Free(FreeBody),
}

impl FrameStep {
    /// Whether a coordinate changes the step.
    pub(crate) fn is_moving(&self) -> bool {
        match self {
            Self::Rotate(_, angle) => angle
                .terms
                .iter()
                .any(|(symbol, _)| matches!(symbol, ModelSymbol::Coordinate(_))),
            Self::Translate(_, length) => !length.coordinates.is_empty(),
            Self::Free(_) => true,
        }
    }
}

/// The coordinates of a free body: its position, a unit quaternion, and the axes of its twist.
///
/// The rates of `position` are the velocity of the frame's origin, and those of the quaternion's vector part are the
/// angular velocity. Accelerations are the time derivatives of these components. Forces on the coordinates are the
/// components of the wrench about the frame's origin in the same axes. So rates and forces are dual to each other in
/// any axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FreeBody {
    /// Position of the origin in the base frame, m.
    pub position: [CoordinateIdx; 3],
    /// Quaternion w, x, y, z, which transforms components in the body's axes into those in the base. Its length does
    /// not matter.
    pub quaternion: [CoordinateIdx; 4],
    /// Axes of velocity and force.
    pub linear: TwistAxes,
    /// Axes of angular velocity and moment.
    pub angular: TwistAxes,
}

/// Axes of the components of a twist or wrench.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TwistAxes {
    /// Those of the body.
    Body,
    /// Those of the base frame.
    World,
}

/// A frame in the tree.
#[derive(Clone, Debug)]
pub struct ModelFrame {
    /// Identifier; `base` for the base.
    pub name: String,
    /// Parent; that of the base is the base itself.
    pub parent: FrameIdx,
    /// Elementary motions from the parent, such as Rx(alpha) Tx(a) Rz(theta) Tz(d) for modified DH.
    pub steps: Vec<FrameStep>,
    /// The convention of the file, for the table of frames on a page.
    pub convention: FrameConvention,
}

/// The frame that carries a frame without a joint in between: the same one if it moves relative to its parent.
pub(crate) fn carrying_frame(frames: &[ModelFrame], frame: FrameIdx) -> FrameIdx {
    let mut at = frame;
    // Parents come first in the tree, so this ends at the base.
    while at != FrameIdx(0) && !frames[at.0].steps.iter().any(FrameStep::is_moving) {
        at = frames[at.0].parent;
    }
    at
}

/// How the file describes a frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FrameConvention {
    /// The base frame.
    Base,
    /// Rx(alpha) Tx(a) Rz(theta) Tz(d); the texts of a, alpha, d, theta.
    ModifiedDh([String; 4]),
    /// Rz(theta) Tz(d) Tx(a) Rx(alpha); the texts of a, alpha, d, theta.
    StandardDh([String; 4]),
    /// A transform, with or without a joint behind it; as text.
    Transform(String),
}

/// A point fixed to a frame.
#[derive(Clone, Debug)]
pub struct FramePoint {
    /// Identifier.
    pub name: String,
    /// Its frame.
    pub frame: FrameIdx,
    /// Position in that frame, m; expressions over constants.
    pub at: [ExactExpression; 3],
}

/// Inertia of a part; expressions over constants and parameters, polynomial in the parameters.
#[derive(Clone, Debug)]
pub enum PartInertia {
    /// Mass, centre of mass in the frame, and inertia about the centre (xx, xy, xz, yy, yz, zz) along the frame's axes.
    AboutCentre {
        /// Mass, kg.
        mass: ExactExpression,
        /// Centre of mass in the frame, m.
        centre: [ExactExpression; 3],
        /// Inertia about the centre, kg m^2; off the diagonal the elements of the matrix, which are negative products
        /// of inertia.
        inertia: [ExactExpression; 6],
    },
    /// The ten linear parameters about the frame's origin.
    Linear {
        /// Mass, kg.
        mass: ExactExpression,
        /// Mass times centre, kg m.
        first_moment: [ExactExpression; 3],
        /// xx, xy, xz, yy, yz, zz about the origin, kg m^2.
        inertia: [ExactExpression; 6],
    },
}

/// A rigid body on a frame.
#[derive(Clone, Debug)]
pub struct ModelPart {
    /// Name; that of the frame if the file gives none.
    pub name: String,
    /// The frame that carries it.
    pub frame: FrameIdx,
    /// Its inertia.
    pub inertial: PartInertia,
}

/// A mass concentrated at a point of a frame, or at different points in the balances of forces and of moments.
#[derive(Clone, Debug)]
pub struct LumpedMass {
    /// The mass; an expression over constants and parameters, kg.
    pub mass: ExactExpression,
    /// The share of that mass at this place.
    pub share: BigRational,
    /// The frame that carries it.
    pub frame: FrameIdx,
    /// Its place in the balance of forces, in the frame, m; over constants and parameters.
    pub force_at: [ExactExpression; 3],
    /// Its place in the balance of moments about the frame's origin, in the frame, m.
    pub moment_at: [ExactExpression; 3],
}

/// A loop closed by two points that coincide.
#[derive(Clone, Debug)]
pub struct KinematicLoop {
    /// Name, for messages.
    pub name: String,
    /// The two points that coincide.
    pub joins: [PointIdx; 2],
}

/// A coordinate that follows others, as by gears, a belt, a screw or a cam: `coordinate = sum of factor * other + offset +
/// function`.
#[derive(Clone, Debug)]
pub struct CoordinateCoupling {
    /// The coordinate that follows.
    pub coordinate: CoordinateIdx,
    /// The coordinates that it follows, sorted, each with its factor. Factors are expressions over constants; their
    /// unit is that of this coordinate over that of the other.
    pub terms: Vec<(CoordinateIdx, ExactExpression)>,
    /// The constant term, an expression over constants, rad or m.
    pub offset: ExactExpression,
    /// A function of other coordinates that is not affine, as of a cam; its coordinates are none of `terms`.
    pub function: Option<CouplingFunction>,
}

/// A coupling that is not affine, as by a cam or by gears that are not round.
#[derive(Clone, Debug)]
pub struct CouplingFunction {
    /// The function, over constants and coordinates, rad or m.
    pub value: ExactExpression,
    /// The coordinates in it, sorted.
    pub leaders: Vec<CoordinateIdx>,
    /// The interval of the table that it comes from, if it has one.
    pub table: Option<TableInterval>,
}

/// The interval that a table covers; beyond its ends the function is a straight line.
#[derive(Clone, Debug)]
pub struct TableInterval {
    /// The argument of the table, over constants and coordinates, rad or m.
    pub argument: ExactExpression,
    /// First and last argument.
    pub ends: [f64; 2],
}

impl CoordinateCoupling {
    /// The coordinates that it follows.
    pub fn leaders(&self) -> Vec<CoordinateIdx> {
        let of_function = self.function.iter().flat_map(|function| &function.leaders);
        self.terms.iter().map(|(i, _)| i).chain(of_function).copied().collect()
    }

    /// The value of the coordinate that follows, rad or m; `value` gives those of symbols.
    pub fn value(&self, value: &dyn Fn(ModelSymbol) -> f64) -> f64 {
        let terms = self.terms.iter();
        let moved = terms.map(|(i, factor)| factor.evaluate(value) * value(ModelSymbol::Coordinate(*i)));
        let function = self
            .function
            .as_ref()
            .map_or(0.0, |function| function.value.evaluate(value));
        self.offset.evaluate(value) + moved.sum::<f64>() + function
    }

    /// Its derivatives by the coordinates that it follows; `value` gives the values of symbols.
    pub fn slopes(&self, value: &dyn Fn(ModelSymbol) -> f64) -> Vec<(CoordinateIdx, f64)> {
        let terms = self.terms.iter().map(|(i, factor)| (*i, factor.evaluate(value)));
        let of_function = self.function.iter().flat_map(|function| {
            let leaders = function.leaders.iter();
            leaders.map(|i| (*i, function.value.slope(*i, value)))
        });
        terms.chain(of_function).collect()
    }
}

/// A drive.
#[derive(Clone, Debug)]
pub struct ModelDrive {
    /// Identifier; the name of its force in recordings.
    pub name: String,
    /// How it acts.
    pub kind: DriveKind,
    /// False for a degree of freedom without a drive. Its row of the equation of motion exists, and its force is zero
    /// unless a recording has a column of this name.
    pub is_driven: bool,
}

/// How a drive acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveKind {
    /// Torque or force on a coordinate.
    Joint(CoordinateIdx),
    /// Force between two points, positive when it pushes them apart.
    Linear {
        /// One end, often on the base.
        from: PointIdx,
        /// The other end.
        to: PointIdx,
    },
}

/// Where an effect acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EffectPlace {
    /// On a drive: adds to its force.
    Drive(DriveIdx),
    /// On a joint coordinate, possibly passive: adds to its torque or force.
    Coordinate(CoordinateIdx),
    /// At a point: adds a mass there.
    Point(PointIdx),
    /// On a part: adds to its inertia.
    Part(PartIdx),
    /// On the base, as a property of the complete mechanism.
    Base,
    /// On the measured forces, as a property of all recordings.
    Force,
}

/// An effect of the file with the expressions of its kind.
#[derive(Clone, Debug)]
pub struct ModelEffect {
    /// Name of the kind.
    pub kind: String,
    /// Where it acts. All places share its parameters.
    pub places: Vec<EffectPlace>,
    /// A second place whose motion it uses, if it acts at one place only.
    pub other: Option<EffectPlace>,
    /// Mechanics of its own. Without them the effect is `sum of parameter * expression`, the same at every place. It
    /// is a force or torque on drives and coordinates. At points the parameter is a mass and the expression its
    /// factor.
    pub mechanics: Option<Mechanics>,
    /// Its parameters; none if the effect has constants only.
    pub terms: Vec<EffectTerm>,
    /// The values of its kind's constants by their symbols; expressions over constants.
    pub constants: Vec<(String, ExactExpression)>,
    /// Bodies that are added to those of the mechanism; their parameters are those of the terms.
    pub bodies: EffectBodies,
}

/// One parameter of an effect with its factor.
#[derive(Clone, Debug)]
pub struct EffectTerm {
    /// Its symbol in the kind.
    pub symbol: String,
    /// The parameter, listed in [`Mechanism::parameters`] after those that the file declares.
    pub parameter: ParameterIdx,
    /// Factor of the parameter, over constants and [`crate::PlaceQuantity`]; 1 for mechanics.
    pub expression: ExactExpression,
}

/// Bodies that an effect adds.
#[derive(Clone, Debug, Default)]
pub struct EffectBodies {
    /// Rigid bodies.
    pub parts: Vec<ModelPart>,
    /// Lumped masses.
    pub lumped_masses: Vec<LumpedMass>,
}

/// Limits of planned motions. Ranges are `[low, high]`; quantities that are not listed have no limit.
#[derive(Clone, Debug, Default)]
pub struct MotionLimits {
    /// Limits of coordinates, each at most once.
    pub coordinates: Vec<(CoordinateIdx, CoordinateBounds)>,
    /// Forces of drives, N or N m.
    pub forces: Vec<(DriveIdx, [f64; 2])>,
    /// Boxes of points along the axes of the base frame, m.
    pub points: Vec<(PointIdx, [Option<[f64; 2]>; 3])>,
    /// Least singular values of the Jacobians of loops and drives stay above this share of those at the nominal pose.
    pub singularity: Option<f64>,
}

/// Limits of a coordinate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CoordinateBounds {
    /// Position, rad or m.
    pub position: Option<[f64; 2]>,
    /// Rate, rad/s or m/s; contains 0.
    pub rate: Option<[f64; 2]>,
    /// Acceleration, rad/s^2 or m/s^2; contains 0.
    pub acceleration: Option<[f64; 2]>,
}

/// How recordings name their columns.
#[derive(Clone, Debug, Default)]
pub struct RecordingColumns {
    /// Pairs of the model's name (`t`, a coordinate, with `_d` or `_dd`, a drive) and the recording's: a column, or a
    /// sum of columns as [`crate::read_column`] reads it.
    pub columns: Vec<(String, String)>,
    /// Factors from the columns of drives to the load at the joint, for columns that measure the motor.
    pub torque: Vec<(String, f64)>,
}
