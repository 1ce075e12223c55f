//! The tables of a model file as types; readers and the JSON Schema for editors derive from them.

use std::borrow::Cow;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

use crate::diagnostic::{Diagnostic, Log, Span};
use crate::document::{Node, Value};
use crate::formula::Formula;
use crate::record::{Flag, List, Name, Named, Number, OneOrMany, Read, Text, record, wrong_type};
use crate::unit::Unit;

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
        /// Kinds of effects that this file adds to the library.
        "effect_kind" effect_kind: optional List<EffectKindEntry>,
        /// Products of parameters that should stay in the base parameters, most wanted first, such as `m1*dc1^2`.
        "retain" retain: optional List<Formula>,
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
    /// A joint, revolute or prismatic.
    JointEntry = "a joint" {
        /// Angle of a revolute joint.
        "revolute" revolute: optional Formula,
        /// Displacement of a prismatic joint.
        "prismatic" prismatic: optional Formula,
        /// Axis of the joint; z if left away.
        "axis" axis: optional AxisName,
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
        /// Where it acts: a drive, a coordinate or a point, or a list whose members share the parameters.
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
        "on" on: required OneOrMany<PlaceKind>,
        /// The force, torque or, at a point, mass that it adds: an expression in the kind's parameters,
        /// linear in them, and in `coordinate`, `rate`, `acceleration` and `load` of the place.
        "expression" expression: required Formula,
        /// Its parameters.
        "parameters" parameters: required Named<KindParameterEntry>,
        /// Quantities that give its shape and are known.
        "constants" constants: optional Named<KindConstantEntry>,
        /// One sentence that explains it.
        "says" says: required Text,
    }
}

record! {
    /// A parameter of a kind of effect.
    KindParameterEntry = "a parameter of a kind" {
        /// Its unit, or its units where the place carries a force, a torque, or a mass at a point.
        "unit" unit: required UnitByPlace,
        /// The sign that it must have to make physical sense; any if left away.
        "sign" sign: optional SignName,
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
        /// Remark.
        "note" note: optional Text,
    }
}

record! {
    /// How recordings name their columns.
    RecordingEntry = "the recording" {
        /// Our names (`t`, a coordinate, a coordinate with `_d` or `_dd`, a drive) and theirs.
        "columns" columns: optional Named<Text>,
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

/// A unit that may depend on what the place carries.
#[derive(Clone, Debug)]
pub(crate) struct UnitByPlace {
    pub(crate) force: Option<Unit>,
    pub(crate) torque: Option<Unit>,
    pub(crate) point: Option<Unit>,
}

impl Read for UnitByPlace {
    const EXPECTED: &'static str = "a unit in quotes, or units by place";
    const EXAMPLE: &'static str = "{ force = \"N\", torque = \"N m\" }";

    fn read(node: &Node, log: &mut Log) -> Option<Self> {
        match &node.value {
            Value::Text { .. } => {
                let unit = Unit::read(node, log)?;
                Some(Self {
                    force: Some(unit.clone()),
                    torque: Some(unit.clone()),
                    point: Some(unit),
                })
            }
            Value::Table(table) => {
                let table = UnitTable::from_table(table, node.span, log);
                Some(Self {
                    force: table.force,
                    torque: table.torque,
                    point: table.point,
                })
            }
            _ => wrong_type::<Self>(node, log),
        }
    }
}

impl JsonSchema for UnitByPlace {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "UnitByPlace".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let unit = generator.subschema_for::<Unit>();
        let table = generator.subschema_for::<UnitTable>();
        json_schema!({ "anyOf": [unit, table] })
    }
}

/// The version of the file format.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Version;

impl Read for Version {
    const EXPECTED: &'static str = "the version of the file format";
    const EXAMPLE: &'static str = "1";

    fn read(node: &Node, log: &mut Log) -> Option<Self> {
        let Value::Number { text, .. } = &node.value else {
            return wrong_type::<Self>(node, log);
        };
        if text != "1" {
            log.push(
                Diagnostic::error(
                    node.span,
                    format!("file format {} is not known", crate::document::quote(text)),
                )
                .label("expected 1")
                .help("a newer modelmill may read this file; this one reads `schema = 1`"),
            );
        }
        Some(Self)
    }
}

impl JsonSchema for Version {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Version".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "const": 1 })
    }
}

/// Three expressions, or two in the x-y plane.
#[derive(Clone, Debug)]
pub(crate) struct Vector {
    /// The entries; absent where one was faulty.
    pub(crate) entries: Vec<Option<Formula>>,
    pub(crate) span: Span,
}

impl Read for Vector {
    const EXPECTED: &'static str = "a vector of three expressions, or of two in the x-y plane";
    const EXAMPLE: &'static str = "[\"d1\", 0, 0]";

    fn read(node: &Node, log: &mut Log) -> Option<Self> {
        let Value::Array(array) = &node.value else {
            return wrong_type::<Self>(node, log);
        };
        if !(2..=3).contains(&array.len()) {
            log.push(
                Diagnostic::error(
                    node.span,
                    format!("this vector has {} entries", array.len()),
                )
                .label("expected x, y and z, or x and y")
                .help(format!("for example `{}`", Self::EXAMPLE)),
            );
            return None;
        }
        Some(Self {
            entries: array
                .iter()
                .map(|entry| Formula::read(entry, log))
                .collect(),
            span: node.span,
        })
    }
}

impl JsonSchema for Vector {
    fn schema_name() -> Cow<'static, str> {
        "Vector".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "x, y and z; z may be left away.",
            "type": "array",
            "items": generator.subschema_for::<Formula>(),
            "minItems": 2,
            "maxItems": 3,
        })
    }
}

/// A place of a lumped mass.
#[derive(Clone, Debug)]
pub(crate) enum Spot {
    /// A named point.
    Point(Name),
    /// A position in the frame.
    Vector(Vector),
}

impl Spot {
    pub(crate) fn span(&self) -> Span {
        match self {
            Self::Point(name) => name.span,
            Self::Vector(vector) => vector.span,
        }
    }
}

impl Read for Spot {
    const EXPECTED: &'static str = "the name of a point, or a vector";
    const EXAMPLE: &'static str = "\"R3m\"";

    fn read(node: &Node, log: &mut Log) -> Option<Self> {
        match &node.value {
            Value::Text { .. } => Name::read(node, log).map(Self::Point),
            Value::Array(_) => Vector::read(node, log).map(Self::Vector),
            _ => wrong_type::<Self>(node, log),
        }
    }
}

impl JsonSchema for Spot {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> Cow<'static, str> {
        "Spot".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let name = generator.subschema_for::<Name>();
        let vector = generator.subschema_for::<Vector>();
        json_schema!({ "anyOf": [name, vector] })
    }
}

/// The end of a parameter's name, such as `1` in `M1`.
#[derive(Clone, Debug)]
pub(crate) struct Suffix {
    pub(crate) text: String,
    pub(crate) span: Span,
}

impl Read for Suffix {
    const EXPECTED: &'static str = "the end of a name in quotes";
    const EXAMPLE: &'static str = "\"1\"";

    fn read(node: &Node, log: &mut Log) -> Option<Self> {
        let (Value::Text { text, .. }
        | Value::Number {
            text,
            is_integer: true,
        }) = &node.value
        else {
            return wrong_type::<Self>(node, log);
        };
        let fine = text.len() <= 40
            && text
                .chars()
                .all(|found| found.is_ascii_alphanumeric() || found == '_');
        if !fine {
            log.push(
                Diagnostic::error(node.span, "this cannot end a name")
                    .label("expected letters, digits and `_`, at most 40"),
            );
            return None;
        }
        Some(Self {
            text: text.clone(),
            span: node.span,
        })
    }
}

impl JsonSchema for Suffix {
    fn schema_name() -> Cow<'static, str> {
        "Suffix".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "description": "The end of a name, such as 1 in M1.",
            "anyOf": [{ "type": "string", "pattern": "^[A-Za-z0-9_]*$", "maxLength": 40 }, { "type": "integer", "minimum": 0 }],
        })
    }
}

/// Declares a type with a fixed choice of words.
macro_rules! words {
    ($(#[doc = $about:literal])* $name:ident: $expected:literal, $($word:literal => $variant:ident),*) => {
        $(#[doc = $about])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum $name {
            $(#[doc = $word] $variant),*
        }

        impl Read for $name {
            const EXPECTED: &'static str = $expected;
            const EXAMPLE: &'static str = concat!("\"", crate::record::first!($($word),*), "\"");

            fn read(node: &Node, log: &mut Log) -> Option<Self> {
                let Value::Text { text, .. } = &node.value else {
                    return wrong_type::<Self>(node, log);
                };
                match text.as_str() {
                    $($word => Some(Self::$variant),)*
                    _ => {
                        log.push(
                            Diagnostic::error(
                                node.span,
                                format!("`{}` is not {}", crate::document::quote(text), $expected),
                            )
                            .label(format!("expected one of {}", [$(concat!("`", $word, "`")),*].join(", ")))
                            .help_if(crate::suggest::nearest(text, [$($word),*])
                                .map(|near| format!("did you mean `{near}`?"))),
                        );
                        None
                    }
                }
            }
        }

        impl JsonSchema for $name {
            fn schema_name() -> Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "enum": [$($word),*] })
            }
        }
    };
}

words! {
    /// An axis with its direction.
    AxisName: "an axis",
    "x" => X, "y" => Y, "z" => Z, "-x" => MinusX, "-y" => MinusY, "-z" => MinusZ
}

words! {
    /// What a kind of effect may act on.
    PlaceKind: "a place",
    "drive" => Drive, "coordinate" => Coordinate, "point" => Point
}

words! {
    /// The sign that a parameter must have.
    SignName: "a sign",
    "positive" => Positive, "negative" => Negative, "any" => Any
}
