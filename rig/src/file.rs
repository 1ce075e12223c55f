//! The tables of a rig file as types. Places are byte ranges, from which messages make lines and columns.
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
    pub(crate) schema: Spanned<i64>,
    pub(crate) name: RigName,
    pub(crate) title: Option<String>,
    /// Another rig file, relative to this one: entries here replace those of the same name or join them.
    pub(crate) extends: Option<RigName>,
    pub(crate) gravity: Option<SpannedTriple>,
    pub(crate) seed: Option<u64>,
    pub(crate) sampling: Option<SamplingEntry>,
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

/// A rigid body, as CAD gives it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct BodyEntry {
    pub(crate) name: RigName,
    /// Origin of its frame in the base frame, nominal configuration.
    pub(crate) at: Option<SpannedTriple>,
    /// Roll, pitch, yaw of its frame there.
    pub(crate) rpy: Option<SpannedTriple>,
    pub(crate) mass: Option<Spanned<f64>>,
    /// Centre of mass in its frame.
    pub(crate) centre: Option<SpannedTriple>,
    pub(crate) inertia: Option<Spanned<RigInertiaEntry>>,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// Inertia about the centre of mass along the body's axes; off the diagonal the negative products.
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
    pub(crate) name: RigName,
    pub(crate) on: RigName,
    /// In the body's frame.
    pub(crate) at: SpannedTriple,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// A mass at a point.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigLumpedMassEntry {
    pub(crate) name: Option<RigName>,
    pub(crate) at: RigName,
    pub(crate) mass: Spanned<f64>,
    /// Point at which the balance of moments sees it.
    pub(crate) moment_at: Option<RigName>,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// A joint.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigJointEntry {
    pub(crate) name: RigName,
    pub(crate) kind: RigName,
    pub(crate) between: Spanned<[RigName; 2]>,
    /// Place in the base frame, nominal configuration.
    pub(crate) at: Option<SpannedTriple>,
    /// Instead, one point, or one on each body in the order of `between`.
    pub(crate) points: Option<Spanned<Vec<RigName>>>,
    /// Direction in the base frame, nominal configuration.
    pub(crate) axis: Option<SpannedTriple>,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// A coordinate that trajectories prescribe.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigCoordinateEntry {
    pub(crate) name: RigName,
    pub(crate) joint: Option<RigName>,
    pub(crate) length: Option<LengthEntry>,
    /// Its value in the nominal configuration.
    pub(crate) nominal: Option<Spanned<f64>>,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// A distance of two points.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct LengthEntry {
    pub(crate) from: RigName,
    pub(crate) to: RigName,
}

/// A drive.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigDriveEntry {
    pub(crate) name: RigName,
    pub(crate) joint: Option<RigName>,
    pub(crate) linear: Option<LengthEntry>,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// Friction and the like.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RigEffectEntry {
    pub(crate) name: Option<RigName>,
    pub(crate) kind: RigName,
    pub(crate) at: Spanned<Vec<RigName>>,
    #[serde(default)]
    pub(crate) values: BTreeMap<RigName, Spanned<f64>>,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// When samples are taken.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SamplingEntry {
    /// Samples per second.
    pub(crate) rate: Option<Spanned<f64>>,
    /// Whether derivatives are written; by default they are if there is no encoder.
    pub(crate) derivatives: Option<bool>,
}

/// An encoder or a force sensor.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SensorEntry {
    pub(crate) of: Spanned<Vec<RigName>>,
    pub(crate) noise: Option<Spanned<f64>>,
    pub(crate) resolution: Option<Spanned<f64>>,
    /// Steps per turn of an encoder, as a power of two.
    pub(crate) bits: Option<Spanned<u32>>,
    /// A force that is read as a current.
    pub(crate) current: Option<CurrentEntry>,
    pub(crate) delay: Option<Spanned<f64>>,
    #[serde(rename = "note")]
    _note: Option<String>,
}

/// A force that is read as a current with a resolution of its own, A.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CurrentEntry {
    /// N/A or N m/A.
    pub(crate) force_per_ampere: Spanned<f64>,
    /// A.
    pub(crate) resolution: Spanned<f64>,
}
