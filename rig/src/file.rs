//! The tables of a rig file as types. Places are byte ranges, from which messages compute lines and columns.
//!
//! Numbers are in SI units: m, kg, s, rad.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

/// Three numbers.
pub(crate) type SpannedTriple = Spanned<[f64; 3]>;
/// A name, with its place.
pub(crate) type RigName = Spanned<String>;

/// A rig file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigEntry {
    /// Version of the format; 1.
    pub(crate) schema: Spanned<i64>,
    /// Name of the rig.
    pub(crate) name: RigName,
    /// Description in one line.
    pub(crate) title: Option<String>,
    /// Another rig file, relative to this one: entries here replace those of the same name or are added to them.
    pub(crate) extends: Option<RigName>,
    /// Acceleration of gravity in the base frame, m/s^2.
    pub(crate) gravity: Option<SpannedTriple>,
    /// Seed of the noise.
    pub(crate) seed: Option<u64>,
    /// Sampling of the recording.
    pub(crate) sampling: Option<SamplingEntry>,
    /// Files of mass properties from a CAD program.
    #[serde(default)]
    pub(crate) mass_properties: Vec<MassPropertiesEntry>,
    #[serde(default)]
    pub(crate) body: Vec<BodyEntry>,
    #[serde(default)]
    pub(crate) point: Vec<RigPointEntry>,
    #[serde(default)]
    pub(crate) lumped_mass: Vec<RigLumpedMassEntry>,
    #[serde(default)]
    pub(crate) joint: Vec<RigJointEntry>,
    #[serde(default)]
    pub(crate) coordinate: Vec<RigCoordinateEntry>,
    #[serde(default)]
    pub(crate) drive: Vec<RigDriveEntry>,
    #[serde(default)]
    pub(crate) effect: Vec<RigEffectEntry>,
    #[serde(default)]
    pub(crate) encoder: Vec<SensorEntry>,
    #[serde(default)]
    pub(crate) force_sensor: Vec<SensorEntry>,
}

/// A file of mass properties from a CAD program: a table of bodies, or a report of one.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MassPropertiesEntry {
    /// The file, relative to this one: a table if it ends in `.csv` or `.tsv`, else a report.
    pub(crate) file: RigName,
    /// Name of the body of a report, in place of the one that the report states.
    pub(crate) body: Option<RigName>,
    /// `assembly` if all values are in the base frame in the nominal configuration, `part` if they are in the frame of
    /// the body.
    pub(crate) coordinates: RigName,
    /// `centre` or `origin`: the point of the inertia, if the file does not state it.
    pub(crate) inertia: Option<RigName>,
    /// `positive` if products are integrals of `x y dm`, `negative` if they are entries of the tensor; needed if the
    /// file does not determine it.
    pub(crate) products: Option<RigName>,
    /// Units that the file does not state.
    #[serde(default)]
    pub(crate) units: CadUnits,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// Units of values whose file states none.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct CadUnits {
    pub(crate) mass: Option<String>,
    pub(crate) length: Option<String>,
    pub(crate) inertia: Option<String>,
}

/// A rigid body, as CAD gives it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BodyEntry {
    /// Unique name.
    pub(crate) name: RigName,
    /// Origin of its frame in the base frame in the nominal configuration, m.
    pub(crate) at: Option<SpannedTriple>,
    /// Roll, pitch and yaw of its frame in the nominal configuration, rad.
    pub(crate) rpy: Option<SpannedTriple>,
    /// Mass, kg.
    pub(crate) mass: Option<Spanned<f64>>,
    /// Centre of mass in its frame, m.
    pub(crate) centre: Option<SpannedTriple>,
    /// Inertia about the centre of mass.
    pub(crate) inertia: Option<Spanned<RigInertiaEntry>>,
    #[serde(rename = "note")]
    _note: Option<String>,
}

impl BodyEntry {
    /// A body without values, named at a place of the file.
    pub(crate) fn with_name(name: RigName) -> Self {
        Self {
            name,
            at: None,
            rpy: None,
            mass: None,
            centre: None,
            inertia: None,
            _note: None,
        }
    }
}

/// Inertia about the centre of mass along the body's axes, kg m^2. Entries off the diagonal are the negative products
/// of inertia.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct RigInertiaEntry {
    pub(crate) xx: f64,
    pub(crate) yy: f64,
    pub(crate) zz: f64,
    pub(crate) xy: f64,
    pub(crate) xz: f64,
    pub(crate) yz: f64,
}

/// A named place on a body or on the base.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigPointEntry {
    /// Unique name.
    pub(crate) name: RigName,
    /// Body that carries it, or `base`.
    pub(crate) on: RigName,
    /// Place in the body's frame, m.
    pub(crate) at: SpannedTriple,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// A mass at a point.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigLumpedMassEntry {
    /// Name, by which variants replace it.
    pub(crate) name: Option<RigName>,
    /// Point where it acts in the balance of forces.
    pub(crate) at: RigName,
    /// Mass, kg.
    pub(crate) mass: Spanned<f64>,
    /// Point where it acts in the balance of moments, if that is another one.
    pub(crate) moment_at: Option<RigName>,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// A joint.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigJointEntry {
    /// Unique name.
    pub(crate) name: RigName,
    /// Kind of joint, by name.
    pub(crate) kind: RigName,
    /// The two bodies that it connects.
    pub(crate) between: Spanned<[RigName; 2]>,
    /// Place in the base frame in the nominal configuration, m.
    pub(crate) at: Option<SpannedTriple>,
    /// Alternative to `at`: one point, or one on each body in the order of `between`.
    pub(crate) points: Option<Spanned<Vec<RigName>>>,
    /// Direction in the base frame in the nominal configuration.
    pub(crate) axis: Option<SpannedTriple>,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// A coordinate that trajectories prescribe.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigCoordinateEntry {
    /// Unique name, which is that of its column.
    pub(crate) name: RigName,
    /// Joint that it measures.
    pub(crate) joint: Option<RigName>,
    /// Alternative to `joint`: the distance that it measures.
    pub(crate) length: Option<LengthEntry>,
    /// Its value in the nominal configuration, rad or m.
    pub(crate) nominal: Option<Spanned<f64>>,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// A distance of two points.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LengthEntry {
    /// First point.
    pub(crate) from: RigName,
    /// Second point.
    pub(crate) to: RigName,
}

/// A drive.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigDriveEntry {
    /// Unique name, which is that of its column.
    pub(crate) name: RigName,
    /// Joint in which it acts.
    pub(crate) joint: Option<RigName>,
    /// Alternative to `joint`: the points between which it acts.
    pub(crate) linear: Option<LengthEntry>,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// Friction or another effect.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigEffectEntry {
    /// Name, by which variants replace it.
    pub(crate) name: Option<RigName>,
    /// Kind of effect, by name.
    pub(crate) kind: RigName,
    /// Names of its places.
    pub(crate) at: Spanned<Vec<RigName>>,
    #[serde(default)]
    pub(crate) values: BTreeMap<RigName, Spanned<f64>>,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// Sampling of the recording.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SamplingEntry {
    /// Samples per second, Hz.
    pub(crate) rate: Option<Spanned<f64>>,
    /// Whether derivatives are written; by default they are if there is no encoder.
    pub(crate) derivatives: Option<bool>,
}

/// An encoder or a force sensor.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SensorEntry {
    /// Coordinates or drives that it measures.
    pub(crate) of: Spanned<Vec<RigName>>,
    /// Standard deviation of white noise, in the unit of the quantity.
    pub(crate) noise: Option<Spanned<f64>>,
    /// Smallest step of the reading, in the unit of the quantity.
    pub(crate) resolution: Option<Spanned<f64>>,
    /// Binary logarithm of the steps per revolution of an encoder.
    pub(crate) bits: Option<Spanned<u32>>,
    /// A force that is measured by a current.
    pub(crate) current: Option<CurrentEntry>,
    /// Delay of the reading, s.
    pub(crate) delay: Option<Spanned<f64>>,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// A force that is measured by a current with its own resolution.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CurrentEntry {
    /// N/A or N m/A.
    pub(crate) force_per_ampere: Spanned<f64>,
    /// A.
    pub(crate) resolution: Spanned<f64>,
}
