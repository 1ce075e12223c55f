//! The tables of a model file as types; readers and the JSON Schema for editors derive from them.

use crate::actuators::ActuatorKind;
use crate::formula::SourceFormula;
use crate::kinds::{ActsOn, OtherMotion, Scale, Sign};
use crate::mechanics::Mechanics;
use crate::range::ValueRange;
use crate::record::{EntryList, NamedEntries, OneOrMany, record};
use crate::unit::ModelUnit;
use crate::values::{
    AxisName, BooleanFlag, FormulaVector, LumpedMassPlace, NameSuffix, QuaternionOrder, SchemaVersion, SearchEntry,
    SpannedName, SpannedNumber, SpannedText, TableRow, TwistName, UnitByPlace,
};

record! {
    /// A mechanism: its geometry, its masses, its drives and the effects that act in it.
    ModelEntry = "the model file" {
        /// Version of the file format; 1.
        "schema" schema: required SchemaVersion,
        /// Name of the model; also the name of the generated module.
        "name" name: required SpannedName,
        /// What the model is, in one line.
        "title" title: optional SpannedText,
        /// Another model file, relative to this one, of which this file is a variant:
        /// its entries are taken over, and entries here replace or join them.
        "extends" extends: optional SpannedText,
        /// Entries of the extended file that this variant drops, as `table.name`,
        /// such as `lumped_mass.platform_left`, `constants.g` or `gravity`.
        "remove" remove: optional EntryList<SpannedText>,
        /// Acceleration of gravity in the base frame, m/s^2; none if omitted.
        "gravity" gravity: optional FormulaVector,
        /// Known quantities such as geometry and gravity.
        "constants" constants: optional NamedEntries<ConstantEntry>,
        /// Dynamic parameters, which identification may estimate; their order is that of the equations.
        "parameters" parameters: optional NamedEntries<ParameterEntry>,
        /// Joint coordinates; whether one is an angle or a length follows from its use.
        "coordinates" coordinates: optional NamedEntries<CoordinateEntry>,
        /// Frames, a tree that grows from the frame `base`.
        "frame" frame: optional EntryList<FrameEntry>,
        /// Named points, each fixed to a frame.
        "point" point: optional EntryList<PointEntry>,
        /// Rigid bodies, each fixed to a frame.
        "part" part: optional EntryList<PartEntry>,
        /// Masses concentrated at a point.
        "lumped_mass" lumped_mass: optional EntryList<LumpedMassEntry>,
        /// Loops: pairs of points that coincide.
        "loop" loops: optional EntryList<LoopEntry>,
        /// Drives, one per degree of freedom.
        "drive" drive: optional EntryList<DriveEntry>,
        /// Actuators of drives, for recordings of commands, currents or voltages in place of forces.
        "actuator" actuator: optional EntryList<ActuatorEntry>,
        /// Friction, drive inertia and the like.
        "effect" effect: optional EntryList<EffectEntry>,
        /// Libraries of further kinds of effects: TOML files of `[[effect_kind]]` tables, relative to this one.
        "library" library: optional OneOrMany<SpannedText>,
        /// Kinds of effects that this file adds to the library.
        "effect_kind" effect_kind: optional EntryList<EffectKindEntry>,
        /// Products of parameters that should stay in the base parameters, most wanted first, such as `m1*dc1^2`.
        "retain" retain: optional EntryList<SourceFormula>,
        /// Limits of planned motions, which `modelmill excite` respects.
        "limits" limits: optional LimitsEntry,
        /// Identified values, which replace nominal ones; `modelmill adopt` writes them.
        "identified" identified: optional IdentifiedEntry,
        /// How recordings of this mechanism name their columns.
        "recording" recording: optional RecordingEntry,
    }
}

record! {
    /// A known quantity.
    ConstantEntry = "a constant" {
        /// Value in SI units.
        "value" value: required SpannedNumber,
        /// Unit; `rad` makes it an angle, `1` a pure number.
        "unit" unit: required ModelUnit,
        /// Remark.
        "note" note: optional SpannedText,
    }
}

record! {
    /// A dynamic parameter.
    ParameterEntry = "a parameter" {
        /// Value from CAD or a data sheet, in SI units; zero if omitted.
        "nominal" nominal: optional SpannedNumber,
        /// Unit.
        "unit" unit: required ModelUnit,
        /// Remark.
        "note" note: optional SpannedText,
    }
}

record! {
    /// A joint coordinate.
    CoordinateEntry = "a coordinate" {
        /// Value at the nominal pose, in rad or m; zero if omitted. For passive coordinates it chooses how the loops
        /// are assembled.
        "nominal" nominal: optional SpannedNumber,
        /// True if loop closure determines the coordinate; it is then not independent.
        "passive" passive: optional BooleanFlag,
        /// False if nothing drives the coordinate: its row of the equation of motion, with a force of zero, takes part in
        /// identification.
        "driven" driven: optional BooleanFlag,
        /// What the coordinate follows, by gears, a belt, a screw or a cam: an expression over other coordinates and constants,
        /// such as `"n*q1 + q0"` or `"e*(1 - cos(q1))"`.
        "follows" follows: optional SourceFormula,
        /// Points of a function of `follows`: pairs of its value and that of this coordinate, in rad or m. The function is a
        /// spline with continuous second derivatives.
        "table" table: optional EntryList<TableRow>,
        /// True if the table covers one turn of `follows` and repeats after it.
        "periodic" periodic: optional BooleanFlag,
        /// Remark.
        "note" note: optional SpannedText,
    }
}

record! {
    /// A frame of the tree, placed by one of `modified_dh`, `standard_dh` and `transform`.
    FrameEntry = "a frame" {
        /// Name.
        "name" name: required SpannedName,
        /// The parent frame, or `base`.
        "on" on: required SpannedName,
        /// Modified Denavit-Hartenberg (Khalil-Kleinfinger): Rx(alpha) Tx(a) Rz(theta) Tz(d).
        "modified_dh" modified_dh: optional DhEntry,
        /// Standard Denavit-Hartenberg: Rz(theta) Tz(d) Tx(a) Rx(alpha).
        "standard_dh" standard_dh: optional DhEntry,
        /// A fixed transform, followed by `joint` if there is one.
        "transform" transform: optional TransformEntry,
        /// The joint behind `transform`.
        "joint" joint: optional JointEntry,
        /// Remark.
        "note" note: optional SpannedText,
    }
}

record! {
    /// Denavit-Hartenberg parameters; omitted entries are zero.
    DhEntry = "a Denavit-Hartenberg row" {
        /// Length along x, m.
        "a" a: optional SourceFormula,
        /// Angle about x, rad.
        "alpha" alpha: optional SourceFormula,
        /// Length along z, m; a coordinate here makes a prismatic joint.
        "d" d: optional SourceFormula,
        /// Angle about z, rad; a coordinate here makes a revolute joint.
        "theta" theta: optional SourceFormula,
    }
}

record! {
    /// A fixed transform: the translation first, then Rz(yaw) Ry(pitch) Rx(roll).
    TransformEntry = "a transform" {
        /// Position of the frame's origin in its parent, m.
        "xyz" xyz: optional FormulaVector,
        /// Roll, pitch and yaw, rad.
        "rpy" rpy: optional FormulaVector,
    }
}

record! {
    /// A joint: exactly one of the kinds, with a name for each of its coordinates.
    JointEntry = "a joint" {
        /// Angle of a revolute joint about `axis`.
        "revolute" revolute: optional SourceFormula,
        /// Displacement of a prismatic joint along `axis`.
        "prismatic" prismatic: optional SourceFormula,
        /// Angle and displacement of a cylindrical joint, about and along `axis`.
        "cylindrical" cylindrical: optional EntryList<SourceFormula>,
        /// Two angles of a universal joint, about the first of its `axes` and then about the second, turned by the first.
        "universal" universal: optional EntryList<SourceFormula>,
        /// Three angles of a spherical joint, about its `axes` one after the other, each turned by those before.
        "spherical" spherical: optional EntryList<SourceFormula>,
        /// Six coordinates of a free body: its position along x, y and z, then three angles as those of a spherical
        /// joint; or seven, its position and a unit quaternion, of a free body, which needs no drives.
        "free" free: optional EntryList<SourceFormula>,
        /// Order of the quaternion of a free body with seven coordinates: `xyzw` or `wxyz`. It transforms components in
        /// the axes of the body into components in the axes of the base.
        "quaternion" quaternion: optional QuaternionOrder,
        /// Axes of its velocity, angular velocity, force and moment: `body`, `world`, or `mixed` for velocity and force in
        /// those of the base, angular velocity and moment in those of the body.
        "twist" twist: optional TwistName,
        /// Axis of a revolute, prismatic or cylindrical joint; z if omitted.
        "axis" axis: optional AxisName,
        /// Axes of a universal, spherical or free joint, such as `yz` or `zyx`; `xy` or `zyx` if omitted.
        "axes" axes: optional SpannedText,
    }
}

record! {
    /// A point fixed to a frame.
    PointEntry = "a point" {
        /// Name.
        "name" name: required SpannedName,
        /// The frame that carries it, or `base`.
        "on" on: required SpannedName,
        /// Position in the frame, m.
        "at" at: required FormulaVector,
        /// Remark.
        "note" note: optional SpannedText,
    }
}

record! {
    /// A rigid body: either `mass`, `centre` and `inertia` about the centre, or the `linear` parameters about the
    /// frame's origin. Omitted entries are exactly zero.
    PartEntry = "a part" {
        /// Name; that of the frame if omitted.
        "name" name: optional SpannedName,
        /// The frame that carries it.
        "on" on: required SpannedName,
        /// Mass, kg.
        "mass" mass: optional SourceFormula,
        /// Centre of mass in the frame, m.
        "centre" centre: optional FormulaVector,
        /// Inertia about the centre of mass, along the frame's axes, kg m^2.
        "inertia" inertia: optional InertiaEntry,
        /// The ten linear parameters about the frame's origin.
        "linear" linear: optional LinearEntry,
        /// Remark.
        "note" note: optional SpannedText,
    }
}

record! {
    /// Entries of an inertia matrix, kg m^2; off the diagonal the negative products of inertia.
    InertiaEntry = "an inertia" {
        /// About x.
        "xx" xx: optional SourceFormula,
        /// Between x and y.
        "xy" xy: optional SourceFormula,
        /// Between x and z.
        "xz" xz: optional SourceFormula,
        /// About y.
        "yy" yy: optional SourceFormula,
        /// Between y and z.
        "yz" yz: optional SourceFormula,
        /// About z.
        "zz" zz: optional SourceFormula,
    }
}

record! {
    /// The linear parameters of a body about its frame's origin. `all = "1"` stands for the ten parameters XX1, XY1,
    /// ..., M1, `planar = "1"` for ZZ1, MX1, MY1, M1; both declare those parameters, and bodies with the same suffix
    /// share them. Single entries replace those of the shorthand; all others are exactly zero.
    LinearEntry = "a set of linear parameters" {
        /// Suffix of ten parameters: XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M.
        "all" all: optional NameSuffix,
        /// Suffix of the four parameters of a body in the x-y plane: ZZ, MX, MY, M.
        "planar" planar: optional NameSuffix,
        /// Nominal values of the parameters that the shorthand declares.
        "nominal" nominal: optional LinearNominalEntry,
        /// Moment of inertia about x, kg m^2.
        "XX" xx: optional SourceFormula,
        /// Inertia matrix entry xy, kg m^2.
        "XY" xy: optional SourceFormula,
        /// Inertia matrix entry xz, kg m^2.
        "XZ" xz: optional SourceFormula,
        /// Moment of inertia about y, kg m^2.
        "YY" yy: optional SourceFormula,
        /// Inertia matrix entry yz, kg m^2.
        "YZ" yz: optional SourceFormula,
        /// Moment of inertia about z, kg m^2.
        "ZZ" zz: optional SourceFormula,
        /// Mass times the centre's x, kg m.
        "MX" mx: optional SourceFormula,
        /// Mass times the centre's y, kg m.
        "MY" my: optional SourceFormula,
        /// Mass times the centre's z, kg m.
        "MZ" mz: optional SourceFormula,
        /// Mass, kg.
        "M" m: optional SourceFormula,
    }
}

record! {
    /// Nominal values of linear parameters; zero if omitted.
    LinearNominalEntry = "a set of nominal values" {
        /// kg m^2
        "XX" xx: optional SpannedNumber,
        /// kg m^2
        "XY" xy: optional SpannedNumber,
        /// kg m^2
        "XZ" xz: optional SpannedNumber,
        /// kg m^2
        "YY" yy: optional SpannedNumber,
        /// kg m^2
        "YZ" yz: optional SpannedNumber,
        /// kg m^2
        "ZZ" zz: optional SpannedNumber,
        /// kg m
        "MX" mx: optional SpannedNumber,
        /// kg m
        "MY" my: optional SpannedNumber,
        /// kg m
        "MZ" mz: optional SpannedNumber,
        /// kg
        "M" m: optional SpannedNumber,
    }
}

record! {
    /// A mass concentrated at a point; it may have different places in the balances of forces and of moments.
    LumpedMassEntry = "a lumped mass" {
        /// Name, by which a variant can override it.
        "name" name: optional SpannedName,
        /// The mass, kg.
        "mass" mass: required SourceFormula,
        /// The share of that mass at this place, a rational number such as `1/2`; 1 if omitted.
        "share" share: optional SourceFormula,
        /// The frame that carries it; the point's if `at` names a point.
        "on" on: optional SpannedName,
        /// Its place: a point's name, or a position in the frame, m.
        "at" at: optional LumpedMassPlace,
        /// Its place in the balance of forces, if not `at`.
        "force_at" force_at: optional LumpedMassPlace,
        /// Its place in the balance of moments about the frame's origin, if not `at`.
        "moment_at" moment_at: optional LumpedMassPlace,
        /// Remark.
        "note" note: optional SpannedText,
    }
}

record! {
    /// A loop, closed where two points coincide.
    LoopEntry = "a loop" {
        /// Name, by which a variant can override it.
        "name" name: optional SpannedName,
        /// The two points that coincide.
        "joins" joins: optional EntryList<SpannedName>,
        /// Two frames that coincide with all their axes, in place of `joins`.
        "welds" welds: optional EntryList<SpannedName>,
    }
}

record! {
    /// A drive: the torque or force of a joint, or a force between two points.
    DriveEntry = "a drive" {
        /// Name; also that of its force in recordings.
        "name" name: required SpannedName,
        /// The coordinate that it drives.
        "joint" joint: optional SpannedName,
        /// The two points that it pushes apart.
        "linear" linear: optional LinearDriveEntry,
        /// Remark.
        "note" note: optional SpannedText,
    }
}

record! {
    /// A force between two points, positive when it pushes them apart.
    LinearDriveEntry = "a linear drive" {
        /// One end, often on the base.
        "from" from: required SpannedName,
        /// The other end.
        "to" to: required SpannedName,
    }
}

record! {
    /// What turns a command, a current or a voltage into the force of a drive. Gains are numbers or constants if they are
    /// known, and parameters if they are to be estimated.
    ActuatorEntry = "an actuator" {
        /// Name, by which a variant can override it.
        "name" name: optional SpannedName,
        /// The drive whose force it makes.
        "drive" drive: required SpannedName,
        /// `position_servo`, `velocity_servo`, `current`, `voltage`, `duty` or `hydraulic_cylinder`.
        "kind" kind: required ActuatorKind,
        /// Name of the recorded signal; that of the drive with `_command`, `_current`, `_voltage` or `_duty` if omitted. The
        /// two of a `hydraulic_cylinder` are that of the drive with `_pressure_a` and `_pressure_b`.
        "signal" signal: optional SpannedName,
        /// Position gain of a `position_servo`, N m/rad or N/m.
        "kp" kp: optional SourceFormula,
        /// Damping of a `position_servo` by the rate of the joint, N m s/rad or N s/m.
        "kd" kd: optional SourceFormula,
        /// Gain of the error of the rate of a `position_servo` or `velocity_servo`, N m s/rad or N s/m.
        "kv" kv: optional SourceFormula,
        /// Torque of the motor per current, N m/A or N/A.
        "torque_constant" torque_constant: optional SourceFormula,
        /// Turns of the motor per turn of the joint, with its sign; 1 if omitted.
        "ratio" ratio: optional SourceFormula,
        /// Share of the motor's power that reaches the joint; 1 if omitted.
        "efficiency" efficiency: optional SourceFormula,
        /// Resistance of the winding, Ohm.
        "resistance" resistance: optional SourceFormula,
        /// Voltage per rate of the motor, V s/rad or V s/m; none if omitted.
        "back_emf" back_emf: optional SourceFormula,
        /// Voltage at a duty cycle of 1, V.
        "supply" supply: optional SourceFormula,
        /// Area of the chamber of a `hydraulic_cylinder` whose pressure acts in the direction of the drive, m^2; of a
        /// hydraulic motor its displacement, m^3/rad.
        "area_a" area_a: optional SourceFormula,
        /// Area of the opposite chamber, m^2 or m^3/rad; none if omitted.
        "area_b" area_b: optional SourceFormula,
        /// Delay from the recorded signal to the force, s; estimated if omitted, 0 for a `hydraulic_cylinder`.
        "delay" delay: optional SpannedNumber,
        /// Largest absolute force of the actuator, N m or N; none if omitted.
        "saturation" saturation: optional SpannedNumber,
        /// Largest absolute error of position at which a `position_servo` makes no force, rad or m; the force follows the
        /// error beyond it. 0 if omitted.
        "dead_band" dead_band: optional SpannedNumber,
        /// Largest rate at which a `position_servo` or `velocity_servo` follows its command, in units of the command per
        /// second; none if omitted.
        "rate_limit" rate_limit: optional SpannedNumber,
        /// Remark.
        "note" note: optional SpannedText,
    }
}

record! {
    /// An effect of a kind from the library or from this file.
    EffectEntry = "an effect" {
        /// Name, by which a variant can override it.
        "name" name: optional SpannedName,
        /// Name of the kind.
        "kind" kind: required SpannedName,
        /// Where it acts: a drive, a coordinate, a point or a part, `base` or `force`, as its kind has it, or a list
        /// whose members share the parameters. Either this or `at_each` is required.
        "at" at: optional OneOrMany<SpannedName>,
        /// Where it acts with parameters of its own at each place: a list of drives, coordinates or points, or `drives`
        /// for all drives. It stands for one effect at each of them.
        "at_each" at_each: optional OneOrMany<SpannedName>,
        /// Names and nominal values of its parameters, by the kind's symbols. A parameter without a name here is
        /// called `symbol_place`.
        "parameters" parameters: optional NamedEntries<EffectParameterEntry>,
        /// Parameters of the kind that this effect does not have, such as the damping `Fv` of a coil spring.
        "without" without: optional OneOrMany<SpannedName>,
        /// Values of the kind's constants: numbers, or expressions over the constants of this file.
        "constants" constants: optional NamedEntries<SourceFormula>,
        /// Remark.
        "note" note: optional SpannedText,
    }
}

record! {
    /// A parameter of an effect.
    EffectParameterEntry = "a parameter of an effect" {
        /// Its name; a name that is declared elsewhere shares that parameter.
        "name" name: optional SpannedName,
        /// Nominal value in SI units; zero if omitted.
        "nominal" nominal: optional SpannedNumber,
    }
}

record! {
    /// A kind of effect: what it adds to the force of the place on which it acts.
    EffectKindEntry = "a kind of effect" {
        /// Name of the kind.
        "name" name: required SpannedName,
        /// The places that it may act on.
        "on" on: required OneOrMany<ActsOn>,
        /// The force, torque or, at a point, mass that it adds: an expression in the kind's parameters,
        /// linear in them, and in `coordinate`, `rate`, `acceleration` and `load` of the place. A kind that uses
        /// `other_coordinate`, `other_rate` or `other_acceleration` acts on two places, at each with the other's.
        "expression" expression: optional SourceFormula,
        /// States that it acts at the first of its two places only, with the motion of the second one, which is
        /// revolute (`angle`) or prismatic (`length`).
        "other" other: optional OtherMotion,
        /// What it does in place of an expression: a swinging `rod` along a linear drive, another `placement` of
        /// lumped masses, differences of a `part`, a `tilt` of gravity, a `delay` of the measured forces.
        "mechanics" mechanics: optional Mechanics,
        /// Its parameters.
        "parameters" parameters: optional NamedEntries<KindParameterEntry>,
        /// Quantities that give its shape and are known.
        "constants" constants: optional NamedEntries<KindConstantEntry>,
        /// One sentence that explains it.
        "says" says: required SpannedText,
        /// One paragraph: what it is, where it comes from, and how the error looks if a model lacks it.
        "explains" explains: optional SpannedText,
        /// Effects it can be confused with, and the experiment that distinguishes them.
        "doubles" doubles: optional SpannedText,
        /// A simpler kind that is a special case of it and is tried before it.
        "refines" refines: optional SpannedText,
    }
}

record! {
    /// A library of kinds of effects.
    LibraryEntry = "the library" {
        /// Kinds of effects.
        "effect_kind" effect_kind: required EntryList<EffectKindEntry>,
    }
}

record! {
    /// A parameter of a kind of effect.
    KindParameterEntry = "a parameter of a kind" {
        /// Its unit, or its units where the place carries a force, a torque, or a mass at a point.
        "unit" unit: required UnitByPlace,
        /// The sign that it must have to make physical sense; any if omitted.
        "sign" sign: optional Sign,
        /// Remark.
        "note" note: optional SpannedText,
    }
}

record! {
    /// A known quantity of a kind of effect.
    KindConstantEntry = "a constant of a kind" {
        /// Its unit, or its units where the place carries a force or a torque.
        "unit" unit: required UnitByPlace,
        /// Its value where the effect gives none; an effect must give one if this is omitted.
        "value" value: optional SourceFormula,
        /// How its value is found if it is not known: `linear` where the expression is affine in it, or a range.
        "search" search: optional SearchEntry,
        /// Remark.
        "note" note: optional SpannedText,
    }
}

record! {
    /// A range in which the value of a constant is searched.
    SearchRangeEntry = "a range to search" {
        /// The least value.
        "from" from: required SpannedNumber,
        /// The largest value.
        "to" to: required SpannedNumber,
        /// The scale of both: the largest `rate` of the place, the `travel` of its coordinate, or `one`, for values
        /// in SI units; `one` if omitted.
        "of" of: optional Scale,
    }
}

record! {
    /// Limits of planned motions; quantities that are not named have no limit.
    LimitsEntry = "the table of limits" {
        /// Limits of coordinates, by name.
        "coordinates" coordinates: optional NamedEntries<CoordinateLimitsEntry>,
        /// Limits of drives, by name.
        "drives" drives: optional NamedEntries<DriveLimitsEntry>,
        /// Boxes that points must stay in, by name.
        "points" points: optional NamedEntries<PointLimitsEntry>,
        /// Distance from singular poses, between 0 and 1: the least singular value of the loops' Jacobian by the
        /// passive coordinates, and of the drives' by the active ones, stays above this share of its value at the
        /// nominal pose.
        "singularity" singularity: optional SpannedNumber,
    }
}

record! {
    /// Limits of a coordinate; a passive one has a position only.
    CoordinateLimitsEntry = "the set of limits of a coordinate" {
        /// Angle or displacement, rad or m: `[low, high]`.
        "position" position: optional ValueRange,
        /// Rate, rad/s or m/s.
        "rate" rate: optional ValueRange,
        /// Acceleration, rad/s^2 or m/s^2.
        "acceleration" acceleration: optional ValueRange,
    }
}

record! {
    /// Limits of a drive.
    DriveLimitsEntry = "the set of limits of a drive" {
        /// Force or torque of the nominal model, N or N m.
        "force" force: required ValueRange,
    }
}

record! {
    /// A box that a point must stay in, along the axes of the base frame.
    PointLimitsEntry = "the set of limits of a point" {
        /// m
        "x" x: optional ValueRange,
        /// m
        "y" y: optional ValueRange,
        /// m
        "z" z: optional ValueRange,
    }
}

record! {
    /// Identified values. They replace nominal values.
    IdentifiedEntry = "what was identified" {
        /// Values of parameters that are physically possible.
        "parameters" parameters: optional NamedEntries<SpannedNumber>,
        /// Values of base parameters, which are combinations over several bodies.
        "base" base: optional EntryList<IdentifiedBaseEntry>,
    }
}

record! {
    /// The value of a base parameter.
    IdentifiedBaseEntry = "the value of a base parameter" {
        /// The base parameter in the parameters and constants of the file, as `modelmill check --json` has it.
        "expression" expression: required SpannedText,
        /// Value in SI units.
        "value" value: required SpannedNumber,
    }
}

record! {
    /// How recordings name their columns.
    RecordingEntry = "the recording" {
        /// The model's names (`t`, a coordinate, a coordinate with `_d` or `_dd`, a drive, a drive with `_var` for
        /// the variance of its force) and the recording's: the name of a column, or a sum of columns such as `(pos6 -
        /// pos5)/32 - pi/2`, with a unit in brackets behind it if it is not in SI units: `pos1 [deg]`.
        "columns" columns: optional NamedEntries<SpannedText>,
        /// What the columns of drives measure, where it is not what acts at the joint: by the name of the drive.
        "torque" torque: optional NamedEntries<TorqueEntry>,
    }
}

record! {
    /// What the column of a drive measures: the motor's torque or current rather than what acts at the joint.
    TorqueEntry = "what the column of a drive measures" {
        /// Turns of the motor per turn of the joint, with its sign; 1 if it is not given.
        "ratio" ratio: optional SpannedNumber,
        /// N m/A, where the column is a current.
        "constant" constant: optional SpannedNumber,
    }
}

record! {
    /// Units for each kind of load of a place.
    UnitTable = "a set of units" {
        /// Where the place carries a force.
        "force" force: optional ModelUnit,
        /// Where the place carries a torque.
        "torque" torque: optional ModelUnit,
        /// At a point.
        "point" point: optional ModelUnit,
    }
}
