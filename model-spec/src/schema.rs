//! The tables of a model file as types; readers and the JSON Schema for editors derive from them.

use crate::formula::Formula;
use crate::kinds::{ActsOn, OtherMotion, Scale, Sign};
use crate::mechanics::Mechanics;
use crate::range::Range;
use crate::record::{List, Named, OneOrMany, record};
use crate::unit::Unit;
use crate::values::{
    AxisName, Flag, Name, Number, QuaternionOrder, Search, Spot, Suffix, Text, TwistName,
    UnitByPlace, Vector, Version,
};

record! {
    /// A mechanism: its geometry, its masses, its drives and the effects that act in it.
    ModelEntry = "the model file" {
        /// Version of the file format; 1.
        "schema" schema: required Version,
        /// Name of the model; also the name of the generated module.
        "name" name: required Name,
        /// What the model is, in one line.
        "title" title: optional Text,
        /// Another model file, relative to this one, of which this file is a variant:
        /// its entries are taken over, and entries here replace or join them.
        "extends" extends: optional Text,
        /// Entries of the extended file that this variant drops, as `table.name`,
        /// such as `lumped_mass.platform_left`, `constants.g` or `gravity`.
        "remove" remove: optional List<Text>,
        /// Acceleration of gravity in the base frame, m/s^2; none if left away.
        "gravity" gravity: optional Vector,
        /// Known quantities: geometry, gravity and the like.
        "constants" constants: optional Named<ConstantEntry>,
        /// Dynamic parameters, which identification may find; their order orders the equations.
        "parameters" parameters: optional Named<ParameterEntry>,
        /// Joint coordinates; whether one is an angle or a length follows from its use.
        "coordinates" coordinates: optional Named<CoordinateEntry>,
        /// Frames, a tree that grows from the frame `base`.
        "frame" frame: optional List<FrameEntry>,
        /// Named points, each fixed to a frame.
        "point" point: optional List<PointEntry>,
        /// Rigid bodies, each fixed to a frame.
        "part" part: optional List<PartEntry>,
        /// Masses concentrated at a point.
        "lumped_mass" lumped_mass: optional List<LumpedMassEntry>,
        /// Loops: pairs of points that coincide.
        "loop" loops: optional List<LoopEntry>,
        /// Drives, one per degree of freedom.
        "drive" drive: optional List<DriveEntry>,
        /// Friction, drive inertia and the like.
        "effect" effect: optional List<EffectEntry>,
        /// Libraries of further kinds of effects: TOML files of `[[effect_kind]]` tables, relative to this one.
        "library" library: optional OneOrMany<Text>,
        /// Kinds of effects that this file adds to the library.
        "effect_kind" effect_kind: optional List<EffectKindEntry>,
        /// Products of parameters that should stay in the base parameters, most wanted first, such as `m1*dc1^2`.
        "retain" retain: optional List<Formula>,
        /// What planned motion must keep: `modelmill excite` obeys it.
        "limits" limits: optional LimitsEntry,
        /// What was identified, in the place of nominal values: `modelmill adopt` writes it.
        "identified" identified: optional IdentifiedEntry,
        /// How recordings of this mechanism name their columns.
        "recording" recording: optional RecordingEntry,
    }
}

record! {
    /// A known quantity.
    ConstantEntry = "a constant" {
        /// Value in SI units.
        "value" value: required Number,
        /// Unit; `rad` makes it an angle, `1` a pure number.
        "unit" unit: required Unit,
        /// Remark.
        "note" note: optional Text,
    }
}

record! {
    /// A dynamic parameter.
    ParameterEntry = "a parameter" {
        /// Value from CAD or a data sheet, in SI units; zero if left away.
        "nominal" nominal: optional Number,
        /// Unit.
        "unit" unit: required Unit,
        /// Remark.
        "note" note: optional Text,
    }
}

record! {
    /// A joint coordinate.
    CoordinateEntry = "a coordinate" {
        /// Value at the nominal pose, in rad or m; zero if left away.
        /// For passive coordinates it chooses how the loops are assembled.
        "nominal" nominal: optional Number,
        /// True if the coordinate follows from the loops; no drive holds it.
        "passive" passive: optional Flag,
        /// False if nothing drives the coordinate: its row of the equation of motion, with a force of zero, takes part in
        /// identification.
        "driven" driven: optional Flag,
        /// What the coordinate follows, by gears, a belt or a screw: a sum of other coordinates, each times constants, and of
        /// constants, such as `"n*q1 + q0"`.
        "follows" follows: optional Formula,
        /// Remark.
        "note" note: optional Text,
    }
}

record! {
    /// A frame of the tree, placed by one of `modified_dh`, `standard_dh` and `transform`.
    FrameEntry = "a frame" {
        /// Name.
        "name" name: required Name,
        /// The parent frame, or `base`.
        "on" on: required Name,
        /// Modified Denavit-Hartenberg (Khalil-Kleinfinger): Rx(alpha) Tx(a) Rz(theta) Tz(d).
        "modified_dh" modified_dh: optional DhEntry,
        /// Standard Denavit-Hartenberg: Rz(theta) Tz(d) Tx(a) Rx(alpha).
        "standard_dh" standard_dh: optional DhEntry,
        /// A fixed transform, followed by `joint` if there is one.
        "transform" transform: optional TransformEntry,
        /// The joint behind `transform`.
        "joint" joint: optional JointEntry,
        /// Remark.
        "note" note: optional Text,
    }
}

record! {
    /// Denavit-Hartenberg parameters; what is left away is zero.
    DhEntry = "a Denavit-Hartenberg row" {
        /// Length along x, m.
        "a" a: optional Formula,
        /// Angle about x, rad.
        "alpha" alpha: optional Formula,
        /// Length along z, m; a coordinate here makes a prismatic joint.
        "d" d: optional Formula,
        /// Angle about z, rad; a coordinate here makes a revolute joint.
        "theta" theta: optional Formula,
    }
}

record! {
    /// A fixed transform: the translation first, then Rz(yaw) Ry(pitch) Rx(roll).
    TransformEntry = "a transform" {
        /// Position of the frame's origin in its parent, m.
        "xyz" xyz: optional Vector,
        /// Roll, pitch and yaw, rad.
        "rpy" rpy: optional Vector,
    }
}

record! {
    /// A joint: exactly one of the kinds, with a name for each of its coordinates.
    JointEntry = "a joint" {
        /// Angle of a revolute joint about `axis`.
        "revolute" revolute: optional Formula,
        /// Displacement of a prismatic joint along `axis`.
        "prismatic" prismatic: optional Formula,
        /// Angle and displacement of a cylindrical joint, about and along `axis`.
        "cylindrical" cylindrical: optional List<Formula>,
        /// Two angles of a universal joint, about the first of its `axes` and then about the second, turned by the first.
        "universal" universal: optional List<Formula>,
        /// Three angles of a spherical joint, about its `axes` one after the other, each turned by those before.
        "spherical" spherical: optional List<Formula>,
        /// Six coordinates of a free body: its position along x, y and z, then three angles as those of a spherical
        /// joint; or seven, its position and a unit quaternion, of a body that hangs on nothing and needs no drives.
        "free" free: optional List<Formula>,
        /// Order of the quaternion of a free body with seven coordinates: `xyzw` or `wxyz`. It turns the body's axes into those
        /// of the base.
        "quaternion" quaternion: optional QuaternionOrder,
        /// Axes of its velocity, angular velocity, force and moment: `body`, `world`, or `mixed` for velocity and force in
        /// those of the base, angular velocity and moment in those of the body.
        "twist" twist: optional TwistName,
        /// Axis of a revolute, prismatic or cylindrical joint; z if left away.
        "axis" axis: optional AxisName,
        /// Axes of a universal, spherical or free joint, such as `yz` or `zyx`; `xy` or `zyx` if left away.
        "axes" axes: optional Text,
    }
}

record! {
    /// A point fixed to a frame.
    PointEntry = "a point" {
        /// Name.
        "name" name: required Name,
        /// The frame that carries it, or `base`.
        "on" on: required Name,
        /// Position in the frame, m.
        "at" at: required Vector,
        /// Remark.
        "note" note: optional Text,
    }
}

record! {
    /// A rigid body: either `mass`, `centre` and `inertia` about the centre, or the `linear` parameters
    /// about the frame's origin. What is left away is exactly zero.
    PartEntry = "a part" {
        /// Name; the frame's if left away.
        "name" name: optional Name,
        /// The frame that carries it.
        "on" on: required Name,
        /// Mass, kg.
        "mass" mass: optional Formula,
        /// Centre of mass in the frame, m.
        "centre" centre: optional Vector,
        /// Inertia about the centre of mass, along the frame's axes, kg m^2.
        "inertia" inertia: optional InertiaEntry,
        /// The ten linear parameters about the frame's origin.
        "linear" linear: optional LinearEntry,
        /// Remark.
        "note" note: optional Text,
    }
}

record! {
    /// Entries of an inertia matrix, kg m^2; off the diagonal the negative products of inertia.
    InertiaEntry = "an inertia" {
        /// About x.
        "xx" xx: optional Formula,
        /// Between x and y.
        "xy" xy: optional Formula,
        /// Between x and z.
        "xz" xz: optional Formula,
        /// About y.
        "yy" yy: optional Formula,
        /// Between y and z.
        "yz" yz: optional Formula,
        /// About z.
        "zz" zz: optional Formula,
    }
}

record! {
    /// The linear parameters of a body about its frame's origin.
    /// `all = "1"` stands for the ten parameters XX1, XY1, ..., M1, `planar = "1"` for ZZ1, MX1, MY1, M1;
    /// both declare those parameters, and bodies with the same suffix share them.
    /// Single entries replace what the shorthand says; what neither names is exactly zero.
    LinearEntry = "a set of linear parameters" {
        /// Suffix of ten parameters: XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M.
        "all" all: optional Suffix,
        /// Suffix of the four parameters of a body in the x-y plane: ZZ, MX, MY, M.
        "planar" planar: optional Suffix,
        /// Nominal values of the parameters that the shorthand declares.
        "nominal" nominal: optional LinearNominalEntry,
        /// Moment of inertia about x, kg m^2.
        "XX" xx: optional Formula,
        /// Inertia matrix entry xy, kg m^2.
        "XY" xy: optional Formula,
        /// Inertia matrix entry xz, kg m^2.
        "XZ" xz: optional Formula,
        /// Moment of inertia about y, kg m^2.
        "YY" yy: optional Formula,
        /// Inertia matrix entry yz, kg m^2.
        "YZ" yz: optional Formula,
        /// Moment of inertia about z, kg m^2.
        "ZZ" zz: optional Formula,
        /// Mass times the centre's x, kg m.
        "MX" mx: optional Formula,
        /// Mass times the centre's y, kg m.
        "MY" my: optional Formula,
        /// Mass times the centre's z, kg m.
        "MZ" mz: optional Formula,
        /// Mass, kg.
        "M" m: optional Formula,
    }
}

record! {
    /// Nominal values of linear parameters; zero if left away.
    LinearNominalEntry = "a set of nominal values" {
        /// kg m^2
        "XX" xx: optional Number,
        /// kg m^2
        "XY" xy: optional Number,
        /// kg m^2
        "XZ" xz: optional Number,
        /// kg m^2
        "YY" yy: optional Number,
        /// kg m^2
        "YZ" yz: optional Number,
        /// kg m^2
        "ZZ" zz: optional Number,
        /// kg m
        "MX" mx: optional Number,
        /// kg m
        "MY" my: optional Number,
        /// kg m
        "MZ" mz: optional Number,
        /// kg
        "M" m: optional Number,
    }
}

record! {
    /// A mass concentrated at a point; the balances of forces and of moments may see it at different places.
    LumpedMassEntry = "a lumped mass" {
        /// Name, by which a variant can override it.
        "name" name: optional Name,
        /// The mass, kg.
        "mass" mass: required Formula,
        /// The share of that mass which sits here, a rational number such as `1/2`; 1 if left away.
        "share" share: optional Formula,
        /// The frame that carries it; the point's if `at` names a point.
        "on" on: optional Name,
        /// Where it sits: a point's name, or a position in the frame, m.
        "at" at: optional Spot,
        /// Where the balance of forces sees it, if not `at`.
        "force_at" force_at: optional Spot,
        /// Where the balance of moments about the frame's origin sees it, if not `at`.
        "moment_at" moment_at: optional Spot,
        /// Remark.
        "note" note: optional Text,
    }
}

record! {
    /// A loop, closed where two points coincide.
    LoopEntry = "a loop" {
        /// Name, by which a variant can override it.
        "name" name: optional Name,
        /// The two points.
        "joins" joins: required List<Name>,
    }
}

record! {
    /// A drive: the torque or force of a joint, or a force between two points.
    DriveEntry = "a drive" {
        /// Name; also that of its force in recordings.
        "name" name: required Name,
        /// The coordinate that it drives.
        "joint" joint: optional Name,
        /// The two points that it pushes apart.
        "linear" linear: optional LinearDriveEntry,
        /// Remark.
        "note" note: optional Text,
    }
}

record! {
    /// A force between two points, positive when it pushes them apart.
    LinearDriveEntry = "a linear drive" {
        /// One end, often on the base.
        "from" from: required Name,
        /// The other end.
        "to" to: required Name,
    }
}

record! {
    /// An effect of a kind from the library or from this file.
    EffectEntry = "an effect" {
        /// Name, by which a variant can override it.
        "name" name: optional Name,
        /// Name of the kind.
        "kind" kind: required Name,
        /// Where it acts: a drive, a coordinate, a point or a part, `base` or `force`, as its kind has it, or a list
        /// whose members share the parameters.
        "at" at: required OneOrMany<Name>,
        /// Names and nominal values of its parameters, by the kind's symbols.
        /// A parameter is called `symbol_place` if nothing is said.
        "parameters" parameters: optional Named<EffectParameterEntry>,
        /// Values of the kind's constants: numbers, or expressions over the constants of this file.
        "constants" constants: optional Named<Formula>,
        /// Remark.
        "note" note: optional Text,
    }
}

record! {
    /// A parameter of an effect.
    EffectParameterEntry = "a parameter of an effect" {
        /// Its name; a name that is declared elsewhere shares that parameter.
        "name" name: optional Name,
        /// Nominal value in SI units; zero if left away.
        "nominal" nominal: optional Number,
    }
}

record! {
    /// A kind of effect: what it adds to the force of the place on which it acts.
    EffectKindEntry = "a kind of effect" {
        /// Name of the kind.
        "name" name: required Name,
        /// The places that it may act on.
        "on" on: required OneOrMany<ActsOn>,
        /// The force, torque or, at a point, mass that it adds: an expression in the kind's parameters,
        /// linear in them, and in `coordinate`, `rate`, `acceleration` and `load` of the place. A kind that uses
        /// `other_coordinate`, `other_rate` or `other_acceleration` acts on two places, at each with the other's.
        "expression" expression: optional Formula,
        /// That it acts at the first of its two places alone, with the motion of the second, which turns (`angle`) or slides
        /// (`length`).
        "other" other: optional OtherMotion,
        /// What it does in place of an expression: a swinging `rod` along a linear drive, another `placement` of
        /// lumped masses, differences of a `part`, a `tilt` of gravity, a `delay` of the measured forces.
        "mechanics" mechanics: optional Mechanics,
        /// Its parameters.
        "parameters" parameters: optional Named<KindParameterEntry>,
        /// Quantities that give its shape and are known.
        "constants" constants: optional Named<KindConstantEntry>,
        /// One sentence that explains it.
        "says" says: required Text,
        /// One paragraph: what it is, where it comes from, and how an error that it leaves looks.
        "explains" explains: optional Text,
        /// What it is easily taken for, and which experiment tells them apart.
        "doubles" doubles: optional Text,
        /// A simpler kind that it holds as a special case and is looked for before it.
        "refines" refines: optional Text,
    }
}

record! {
    /// A library of kinds of effects.
    LibraryEntry = "the library" {
        /// Kinds of effects.
        "effect_kind" effect_kind: required List<EffectKindEntry>,
    }
}

record! {
    /// A parameter of a kind of effect.
    KindParameterEntry = "a parameter of a kind" {
        /// Its unit, or its units where the place carries a force, a torque, or a mass at a point.
        "unit" unit: required UnitByPlace,
        /// The sign that it must have to make physical sense; any if left away.
        "sign" sign: optional Sign,
        /// Remark.
        "note" note: optional Text,
    }
}

record! {
    /// A known quantity of a kind of effect.
    KindConstantEntry = "a constant of a kind" {
        /// Its unit, or its units where the place carries a force or a torque.
        "unit" unit: required UnitByPlace,
        /// Its value where the effect gives none; an effect must give one if this is left away.
        "value" value: optional Formula,
        /// How its value is found where it is not known: `linear` where the expression is affine in it, or a range.
        "search" search: optional Search,
        /// Remark.
        "note" note: optional Text,
    }
}

record! {
    /// A range in which the value of a constant is searched.
    SearchRangeEntry = "a range to search" {
        /// The least value.
        "from" from: required Number,
        /// The largest value.
        "to" to: required Number,
        /// What both are multiples of: the largest `rate` of the place, the `travel` of its coordinate, or `one`,
        /// for values in SI units; `one` if left away.
        "of" of: optional Scale,
    }
}

record! {
    /// What planned motion must keep; what is not named is not limited.
    LimitsEntry = "the table of limits" {
        /// Limits of coordinates, by name.
        "coordinates" coordinates: optional Named<CoordinateLimitsEntry>,
        /// Limits of drives, by name.
        "drives" drives: optional Named<DriveLimitsEntry>,
        /// Boxes that points must stay in, by name.
        "points" points: optional Named<PointLimitsEntry>,
        /// Distance from singular poses, between 0 and 1: the least singular value of the loops' Jacobian by the
        /// passive coordinates, and of the drives' by the active ones, stays above this share of its value at the
        /// nominal pose.
        "singularity" singularity: optional Number,
    }
}

record! {
    /// Limits of a coordinate; a passive one has a position only.
    CoordinateLimitsEntry = "the set of limits of a coordinate" {
        /// Angle or displacement, rad or m: `[low, high]`.
        "position" position: optional Range,
        /// Rate, rad/s or m/s.
        "rate" rate: optional Range,
        /// Acceleration, rad/s^2 or m/s^2.
        "acceleration" acceleration: optional Range,
    }
}

record! {
    /// Limits of a drive.
    DriveLimitsEntry = "the set of limits of a drive" {
        /// Force or torque of the nominal model, N or N m.
        "force" force: required Range,
    }
}

record! {
    /// A box that a point must stay in, along the axes of the base frame.
    PointLimitsEntry = "the set of limits of a point" {
        /// m
        "x" x: optional Range,
        /// m
        "y" y: optional Range,
        /// m
        "z" z: optional Range,
    }
}

record! {
    /// What was identified. It takes the place of nominal values.
    IdentifiedEntry = "what was identified" {
        /// Values of parameters, which bodies can have.
        "parameters" parameters: optional Named<Number>,
        /// Values of base parameters, which say nothing of single bodies.
        "base" base: optional List<IdentifiedBaseEntry>,
    }
}

record! {
    /// The value of a base parameter.
    IdentifiedBaseEntry = "the value of a base parameter" {
        /// The base parameter in the parameters and constants of the file, as `modelmill check --json` has it.
        "expression" expression: required Text,
        /// Value in SI units.
        "value" value: required Number,
    }
}

record! {
    /// How recordings name their columns.
    RecordingEntry = "the recording" {
        /// Our names (`t`, a coordinate, a coordinate with `_d` or `_dd`, a drive, a drive with `_var` for the
        /// variance of its force) and theirs: the name of a column,
        /// or a sum of columns such as `(pos6 - pos5)/32 - pi/2`, with a unit in brackets behind it if it is not in
        /// SI units: `pos1 [deg]`.
        "columns" columns: optional Named<Text>,
        /// What the columns of drives measure, where it is not what acts at the joint: by the name of the drive.
        "torque" torque: optional Named<TorqueEntry>,
    }
}

record! {
    /// What the column of a drive measures: the motor's torque or current rather than what acts at the joint.
    TorqueEntry = "what the column of a drive measures" {
        /// Turns of the motor for one of the joint, with its sign; 1 if it is not given.
        "ratio" ratio: optional Number,
        /// N m/A, where the column is a current.
        "constant" constant: optional Number,
    }
}

record! {
    /// Units by what the place carries.
    UnitTable = "a set of units" {
        /// Where the place carries a force.
        "force" force: optional Unit,
        /// Where the place carries a torque.
        "torque" torque: optional Unit,
        /// At a point.
        "point" point: optional Unit,
    }
}
