//! A validated mechanism: what a model file means once every name is resolved and every check has passed.
//!
//! [`crate::load`] makes it, `modelmill-codegen` consumes it. Indices point into the vectors of [`Mechanism`].

use num_rational::BigRational;

use crate::exact::{
    CoordinateIdx, ExactAngle, ExactExpression, ExactLength, ModelSymbol, ParameterIdx,
};
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
    /// One line for people.
    pub title: Option<String>,
    /// Gravity in the base frame, m/s^2; expressions over constants. A tilt among the effects has turned it already.
    pub gravity: [ExactExpression; 3],
    /// Known geometry and the like.
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
    /// Drives, one per degree of freedom; what nothing drives has its row here too.
    pub drives: Vec<ModelDrive>,
    /// Drives of a mechanism that has more of them than degrees of freedom, such as cables; then none of [`Self::drives`] is
    /// driven, and these act on all of them by their transposed Jacobian, `J' f`.
    pub shared_drives: Vec<ModelDrive>,
    /// Friction, drive inertia and the like.
    pub effects: Vec<ModelEffect>,
    /// How much later than they act the forces of recordings are read, s; zero unless an effect says otherwise.
    /// Equations and code know nothing of it: only where a model is held against a recording does it matter.
    pub force_delay: f64,
    /// Products of dynamic parameters whose columns should be retained, most wanted first;
    /// each is a product of powers of parameters.
    pub retain: Vec<Vec<(ParameterIdx, u32)>>,
    /// What planned motion must keep.
    pub limits: MotionLimits,
    /// Values of base parameters by their expressions, which take the place of those of the nominal parameters.
    pub identified_base: Vec<(String, f64)>,
    /// How recordings name their columns: ours to theirs.
    pub recording: RecordingColumns,
    /// Whether constants of the file were replaced by their values, see [`Mechanism::with_numeric_constants`].
    pub is_at_values: bool,
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
    /// True if it is an angle (unit rad) and may stand in [`Angle`].
    pub is_angle: bool,
    /// Remark of the author.
    pub note: Option<String>,
}

/// A dynamic parameter.
#[derive(Clone, Debug)]
pub struct DynamicParameter {
    /// Identifier.
    pub name: String,
    /// Nominal value in SI units; zero where the file gives none.
    pub nominal: f64,
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
    /// Angle or length.
    pub motion: CoordinateMotion,
    /// Passive coordinates follow from the loops or by a coupling; the others are independent.
    pub passive: bool,
    /// Value at the nominal pose, which chooses the assembly mode.
    /// For passive coordinates refined until the loops close.
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

/// One elementary motion from a parent frame towards its child; each acts about or along the axes reached so far.
#[derive(Clone, Debug)]
pub enum FrameStep {
    /// Rotation about an axis.
    Rotate(FrameAxis, ExactAngle),
    /// Translation along an axis.
    Translate(FrameAxis, ExactLength),
    /// Any motion at all; the only step of a frame that hangs on the base.
    Free(FreeBody),
}

/// How a body moves that hangs on nothing: by its position, a unit quaternion, and its twist.
///
/// The rates of `position` are the velocity of the frame's origin, those of the quaternion's vector part the angular velocity,
/// and accelerations are the time derivatives of these components; forces on the coordinates are the components of the
/// wrench about the frame's origin in the same axes. So they are dual to each other, whichever axes are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FreeBody {
    /// Of the origin in the base frame, m.
    pub position: [CoordinateIdx; 3],
    /// w, x, y, z: it turns components in the body's axes into those in the base's. Its length does not matter.
    pub quaternion: [CoordinateIdx; 4],
    /// In which axes velocity and force are given.
    pub linear: TwistAxes,
    /// In which axes angular velocity and moment are given.
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
    /// Parent; the base is its own.
    pub parent: FrameIdx,
    /// Elementary motions from the parent, e.g. Rx(alpha) Tx(a) Rz(theta) Tz(d) for modified DH.
    pub steps: Vec<FrameStep>,
    /// The convention the file used, for the frames table of a page.
    pub convention: FrameConvention,
}

/// How a frame was written in the file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FrameConvention {
    /// The base frame.
    Base,
    /// Rx(alpha) Tx(a) Rz(theta) Tz(d); the texts of a, alpha, d, theta.
    ModifiedDh([String; 4]),
    /// Rz(theta) Tz(d) Tx(a) Rx(alpha); the texts of a, alpha, d, theta.
    StandardDh([String; 4]),
    /// A transform, perhaps followed by a joint; as text.
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
        /// kg
        mass: ExactExpression,
        /// m
        centre: [ExactExpression; 3],
        /// kg m^2; the off-diagonal entries are elements of the inertia matrix (negative products).
        inertia: [ExactExpression; 6],
    },
    /// The ten linear parameters about the frame's origin.
    Linear {
        /// kg
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
    /// Name for people; the frame's if the file gives none.
    pub name: String,
    /// The frame that carries it.
    pub frame: FrameIdx,
    /// Its inertia.
    pub inertial: PartInertia,
}

/// A mass concentrated at a point of a frame, or at different points for the two balances of a body.
#[derive(Clone, Debug)]
pub struct LumpedMass {
    /// The mass; an expression over constants and parameters, kg.
    pub mass: ExactExpression,
    /// The share of that mass which sits here.
    pub share: BigRational,
    /// The frame that carries it.
    pub frame: FrameIdx,
    /// Where the balance of forces sees it, in the frame, m; over constants and parameters.
    pub force_at: [ExactExpression; 3],
    /// Where the balance of moments about the frame's origin sees it, in the frame, m.
    pub moment_at: [ExactExpression; 3],
}

/// A loop closed by two points that coincide.
#[derive(Clone, Debug)]
pub struct KinematicLoop {
    /// Name for people.
    pub name: String,
    /// The points.
    pub joins: [PointIdx; 2],
}

/// A coordinate that follows others, as by gears, a belt or a screw: `coordinate = sum of factor * other + offset`.
#[derive(Clone, Debug)]
pub struct CoordinateCoupling {
    /// What follows.
    pub coordinate: CoordinateIdx,
    /// What it follows, sorted, each with its factor: expressions over constants, in units of one over the other.
    pub terms: Vec<(CoordinateIdx, ExactExpression)>,
    /// An expression over constants, rad or m.
    pub offset: ExactExpression,
}

impl CoordinateCoupling {
    /// The value of what follows, rad or m.
    pub fn value(&self, value: &dyn Fn(ModelSymbol) -> f64) -> f64 {
        let terms = self.terms.iter();
        let moved =
            terms.map(|(i, factor)| factor.evaluate(value) * value(ModelSymbol::Coordinate(*i)));
        self.offset.evaluate(value) + moved.sum::<f64>()
    }
}

/// A drive.
#[derive(Clone, Debug)]
pub struct ModelDrive {
    /// Identifier; the name of its force in recordings.
    pub name: String,
    /// How it acts.
    pub kind: DriveKind,
    /// False where nothing drives the coordinate: the row of the equation of motion is there all the same, and its force is
    /// zero unless a recording has one under this name.
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
    /// On a joint coordinate, also a passive one: adds to its torque or force.
    Coordinate(CoordinateIdx),
    /// At a point: adds a mass there.
    Point(PointIdx),
    /// On a part: adds to its inertia.
    Part(PartIdx),
    /// On the base as a whole.
    Base,
    /// On the measured forces as a whole.
    Force,
}

/// An effect of the file, with its kind's expressions put in place.
#[derive(Clone, Debug)]
pub struct ModelEffect {
    /// Name of the kind.
    pub kind: String,
    /// Where it acts; its parameters are shared by all places.
    pub places: Vec<EffectPlace>,
    /// The place whose motion it has besides, where it acts at one place alone.
    pub other: Option<EffectPlace>,
    /// Mechanics of its own. Without them the effect is `sum of parameter * expression`, the same at every place: a force
    /// or torque on drives and coordinates; at points the parameter is a mass and the expression its factor.
    pub mechanics: Option<Mechanics>,
    /// Its parameters; none where the effect only has constants.
    pub terms: Vec<EffectTerm>,
    /// The values of its kind's constants by their symbols; expressions over constants.
    pub constants: Vec<(String, ExactExpression)>,
    /// Bodies that join those of the mechanism; their parameters are those of the terms.
    pub bodies: EffectBodies,
}

/// One parameter of an effect with what it multiplies.
#[derive(Clone, Debug)]
pub struct EffectTerm {
    /// Its symbol in the kind.
    pub symbol: String,
    /// The parameter, listed in [`Mechanism::parameters`] after those that the file declares.
    pub parameter: ParameterIdx,
    /// Expression over constants and [`crate::PlaceQuantity`]; 1 where it has mechanics.
    pub expression: ExactExpression,
}

/// Bodies of an effect.
#[derive(Clone, Debug, Default)]
pub struct EffectBodies {
    /// Parts.
    pub parts: Vec<ModelPart>,
    /// Lumped masses.
    pub lumped_masses: Vec<LumpedMass>,
}

/// What planned motion must keep; ranges are `[low, high]`, and what is not named is not limited.
#[derive(Clone, Debug, Default)]
pub struct MotionLimits {
    /// Of coordinates, each at most once.
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
    /// rad or m
    pub position: Option<[f64; 2]>,
    /// rad/s or m/s; contains 0.
    pub rate: Option<[f64; 2]>,
    /// rad/s^2 or m/s^2; contains 0.
    pub acceleration: Option<[f64; 2]>,
}

/// How recordings name their columns.
#[derive(Clone, Debug, Default)]
pub struct RecordingColumns {
    /// Pairs of our name (`t`, a coordinate, with `_d` or `_dd`, a drive) and theirs: a column, or a sum of columns
    /// as [`crate::read_column`] reads it.
    pub columns: Vec<(String, String)>,
    /// By what the column of a drive is multiplied to be what acts at the joint, where it measures the motor.
    pub torque: Vec<(String, f64)>,
}
