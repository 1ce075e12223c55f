//! Merges a rig file and those that it extends: entries of a variant replace those of the same name or are added.

use crate::file::{
    BodyEntry, RigCoordinateEntry, RigDriveEntry, RigEffectEntry, RigEntry, RigJointEntry, RigLumpedMassEntry, RigName,
    RigPointEntry, SensorEntry, SpannedTriple,
};
use crate::load::source_span;
use crate::log::{FileItem, RigLog};

/// Entries of all files of a chain, each with its file.
pub(crate) struct MergedRig {
    /// Name of the last variant.
    pub(crate) name: String,
    /// Description in one line; empty if no file has one.
    pub(crate) title: String,
    /// Acceleration of gravity in the base frame, m/s^2.
    pub(crate) gravity: Option<FileItem<SpannedTriple>>,
    /// Seed of the noise.
    pub(crate) seed: Option<u64>,
    /// Samples per second, Hz.
    pub(crate) rate: Option<FileItem<toml::Spanned<f64>>>,
    /// Whether a recording contains rates and accelerations.
    pub(crate) derivatives: Option<bool>,
    /// Rigid bodies.
    pub(crate) bodies: Vec<FileItem<BodyEntry>>,
    /// Named points of bodies.
    pub(crate) points: Vec<FileItem<RigPointEntry>>,
    /// Masses at points of bodies.
    pub(crate) lumped_masses: Vec<FileItem<RigLumpedMassEntry>>,
    /// Joints between bodies.
    pub(crate) joints: Vec<FileItem<RigJointEntry>>,
    /// Coordinates that a trajectory prescribes.
    pub(crate) coordinates: Vec<FileItem<RigCoordinateEntry>>,
    /// Drives, one per degree of freedom.
    pub(crate) drives: Vec<FileItem<RigDriveEntry>>,
    /// Friction and other effects.
    pub(crate) effects: Vec<FileItem<RigEffectEntry>>,
    /// Encoders of coordinates.
    pub(crate) encoders: Vec<FileItem<SensorEntry>>,
    /// Force sensors of drives.
    pub(crate) force_sensors: Vec<FileItem<SensorEntry>>,
}

impl MergedRig {
    /// The entries of one file; reports wrong names and an unknown schema.
    pub(crate) fn new(file: usize, entry: RigEntry, log: &mut RigLog) -> Self {
        if *entry.schema.get_ref() != 1 {
            log.error(
                source_span(file, &entry.schema.span()),
                format!("schema {} of rig files is not known", entry.schema.get_ref()),
                "expected 1",
                "write `schema = 1`",
            );
        }
        let sampling = entry.sampling.unwrap_or_default();
        Self {
            name: entry.name.into_inner(),
            title: entry.title.unwrap_or_default(),
            gravity: entry.gravity.map(|entry| FileItem { file, entry }),
            seed: entry.seed,
            rate: sampling.rate.map(|entry| FileItem { file, entry }),
            derivatives: sampling.derivatives,
            bodies: collect_items(file, entry.body, "body", |e| Some(&e.name), log),
            points: collect_items(file, entry.point, "point", |e| Some(&e.name), log),
            lumped_masses: collect_items(file, entry.lumped_mass, "lumped mass", |e| e.name.as_ref(), log),
            joints: collect_items(file, entry.joint, "joint", |e| Some(&e.name), log),
            coordinates: collect_items(file, entry.coordinate, "coordinate", |e| Some(&e.name), log),
            drives: collect_items(file, entry.drive, "drive", |e| Some(&e.name), log),
            effects: collect_items(file, entry.effect, "effect", |e| e.name.as_ref(), log),
            // Sensors have no names of their own: a later one replaces an earlier one when channels are assembled.
            encoders: collect_items(file, entry.encoder, "encoder", |_| None, log),
            force_sensors: collect_items(file, entry.force_sensor, "force sensor", |_| None, log),
        }
    }

    /// Adds the entries of a variant.
    pub(crate) fn extend(&mut self, variant: Self) {
        // Single values of the variant replace those of the base where it states them.
        self.name = variant.name;
        if !variant.title.is_empty() {
            self.title = variant.title;
        }
        self.gravity = variant.gravity.or(self.gravity.take());
        self.seed = variant.seed.or(self.seed);
        self.rate = variant.rate.or(self.rate.take());
        self.derivatives = variant.derivatives.or(self.derivatives);
        merge_items(&mut self.bodies, variant.bodies, |e| Some(&e.name));
        merge_items(&mut self.points, variant.points, |e| Some(&e.name));
        merge_items(&mut self.lumped_masses, variant.lumped_masses, |e| e.name.as_ref());
        merge_items(&mut self.joints, variant.joints, |e| Some(&e.name));
        merge_items(&mut self.coordinates, variant.coordinates, |e| Some(&e.name));
        merge_items(&mut self.drives, variant.drives, |e| Some(&e.name));
        merge_items(&mut self.effects, variant.effects, |e| e.name.as_ref());
        // Sensors are appended; the last one for a coordinate or a drive counts.
        self.encoders.extend(variant.encoders);
        self.force_sensors.extend(variant.force_sensors);
    }
}

/// The entries of one file with its index; names must be words and must differ.
fn collect_items<T>(
    file: usize,
    entries: Vec<T>,
    what: &str,
    name: impl Fn(&T) -> Option<&RigName>,
    log: &mut RigLog,
) -> Vec<FileItem<T>> {
    let mut seen: Vec<&str> = Vec::new();
    for found in entries.iter().filter_map(&name) {
        let text = found.get_ref().as_str();
        // Names become column names and references, so they are words that do not start with a digit.
        let is_word = text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && text.chars().next().is_some_and(|c| !c.is_ascii_digit());
        if !is_word || text == "base" {
            log.error(
                source_span(file, &found.span()),
                format!("`{}` cannot be a name", text.chars().take(60).collect::<String>()),
                "expected letters, digits and `_`, other than `base`",
                "",
            );
        }
        if seen.contains(&text) {
            log.error(
                source_span(file, &found.span()),
                format!("there are two entries for the {what} `{text}`"),
                "this is the second one",
                "rename or delete one of the two",
            );
        }
        seen.push(text);
    }
    entries.into_iter().map(|entry| FileItem { file, entry }).collect()
}

/// Entries of a variant replace those of the same name at their place; the others are added.
fn merge_items<T>(base: &mut Vec<FileItem<T>>, variant: Vec<FileItem<T>>, name: impl Fn(&T) -> Option<&RigName>) {
    for item in variant {
        // Entries without a name never replace another.
        let twin = base.iter().position(|other| {
            name(&item.entry).is_some_and(|mine| name(&other.entry).is_some_and(|its| its.get_ref() == mine.get_ref()))
        });
        match twin {
            Some(at) => base[at] = item,
            None => base.push(item),
        }
    }
}
