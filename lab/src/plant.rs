//! The simulated machine: the complete SpiderMill as a rig, and its reduced model, which is diagnosed.

use std::path::PathBuf;

use modelmill_boundary::files::DiskFiles;
use modelmill_codegen::{Derivation, ModelEvaluator, MotionStates};
use modelmill_rig::{Rig, RigEffect, RigMotion, RigPlace, RigState, RigTracker, ScalarMotion};
use modelmill_spec::MotionLimits;

use crate::course::DrawnCourse;
use crate::harness::in_project;

/// The rig of the bundled recordings with joints and points that the model names in addition.
///
/// The joints are gamma1 and gamma2, the angles of the couplers relative to the cranks. Joints may be redundant.
const RIG: &str = r#"
schema = 1
name = "spidermill_hidden"
extends = "spidermill-full.toml"

[[joint]]
name = "gamma1"
kind = "revolute"
between = ["G8", "G9"]
points = ["R2m", "G9_upper"]

[[joint]]
name = "gamma2"
kind = "revolute"
between = ["G11", "G10"]
points = ["R4m", "G10_upper"]

[[point]]
name = "R3m_right"
on = "G4"
at = [0, 0, 0]

[[point]]
name = "G9_middle"
on = "G9"
at = [0.5, 0, 0]

[[point]]
name = "G10_middle"
on = "G10"
at = [0.5, 0, 0]
"#;

/// The rig and its reduced model.
pub struct SpidermillPlant {
    /// The rig without effects.
    pub rig: Rig,
    /// The model under diagnosis.
    pub derivation: Derivation,
    /// Path of the model file.
    pub model: PathBuf,
}

/// Names of the drives, in the order of rig and model.
pub const DRIVES: [&str; 2] = ["spindle_left", "spindle_right"];

impl SpidermillPlant {
    /// Loads both from the bundled files; fails if rig and model have different drives.
    pub fn load() -> Result<Self, String> {
        let specs = in_project("model-spec");
        // The rig extends a bundled one, so its path is in the same folder.
        let path = specs.join("rigs").join("hidden.toml");
        let rig = modelmill_rig::load(&path.to_string_lossy(), RIG, &DiskFiles::default())
            .map_err(|failure| failure.render(false))?
            .rig;
        let model = specs.join("models").join("spidermill.toml");
        let loaded = modelmill_spec::load_file(&model).map_err(|failure| failure.render(false))?;
        let derivation = modelmill_codegen::derive(&loaded.mechanism).map_err(|error| error.to_string())?;
        let of_model = derivation.mechanism.drives.iter().map(|d| d.name.as_str());
        let of_rig = rig.drives.iter().map(|d| d.name.as_str());
        if !of_model.eq(DRIVES) || !of_rig.eq(DRIVES) {
            return Err("rig and model have different drives".to_owned());
        }
        Ok(Self { rig, derivation, model })
    }

    /// Limits of the motions, from the model file.
    pub fn limits(&self) -> &MotionLimits {
        &self.derivation.mechanism.limits
    }
}

/// The rig along a motion: the motion of all bodies at given times, from which forces with any effects are computed.
///
/// A column of forces has samples times drives rows, drives innermost.
pub struct PlantMotion {
    /// The rig without effects.
    rig: Rig,
    /// Times of the samples, s.
    pub times: Vec<f64>,
    /// Prescribed coordinates with derivatives at each time.
    pub states: Vec<RigState>,
    /// Motion of all bodies at each time.
    motions: Vec<RigMotion>,
    /// Forces without effects, N.
    pub plain: Vec<f64>,
}

impl PlantMotion {
    /// Moves the rig along a course at the given times, s; fails if the rig cannot follow.
    pub fn new(rig: &Rig, course: &DrawnCourse, times: Vec<f64>) -> Result<Self, String> {
        let states: Vec<RigState> = times.iter().map(|t| course.state_at(*t)).collect();
        let mut tracker = RigTracker::new(rig).map_err(|error| error.to_string())?;
        let motions = states
            .iter()
            .map(|state| tracker.follow(state))
            .collect::<Result<Vec<RigMotion>, _>>()
            .map_err(|error| error.to_string())?;
        let mut along = Self {
            rig: rig.clone(),
            times,
            states,
            motions,
            plain: Vec::new(),
        };
        along.plain = along.forces(&[])?;
        Ok(along)
    }

    /// The rig without effects.
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// Forces of the drives with effects, N.
    pub fn forces(&self, effects: &[RigEffect]) -> Result<Vec<f64>, String> {
        let mut rig = self.rig.clone();
        rig.effects = effects.to_vec();
        let mut rows = Vec::with_capacity(DRIVES.len() * self.motions.len());
        for motion in &self.motions {
            rows.extend(modelmill_rig::forces(&rig, motion).map_err(|error| error.to_string())?);
        }
        Ok(rows)
    }

    /// Change of the forces by effects, relative to the rig without effects, N.
    pub fn added(&self, effects: &[RigEffect]) -> Result<Vec<f64>, String> {
        let with = self.forces(effects)?;
        Ok(with.iter().zip(&self.plain).map(|(a, b)| a - b).collect())
    }

    /// Change of the forces by one effect when others are present, N.
    pub fn added_beside(&self, others: &[RigEffect], effect: RigEffect) -> Result<Vec<f64>, String> {
        let without = self.forces(others)?;
        let with = self.forces(&[others, &[effect]].concat())?;
        Ok(with.iter().zip(&without).map(|(a, b)| a - b).collect())
    }

    /// Length (m), rate and acceleration of a drive at each time.
    pub fn of_drive(&self, drive: usize) -> Vec<ScalarMotion> {
        self.of_place(RigPlace::Drive(drive)).unwrap_or_default()
    }

    /// The same for any place; `None` if the place has no motion.
    pub fn of_place(&self, place: RigPlace) -> Option<Vec<ScalarMotion>> {
        let at = |motion| modelmill_rig::place_motion(&self.rig, place, motion);
        self.motions.iter().map(at).collect()
    }

    /// Columns of the regressor for the base parameters of the model, samples times drives.
    pub fn base(&self, derivation: &Derivation) -> Result<Vec<Vec<f64>>, String> {
        // The evaluator takes one column per coordinate.
        let column = |of: fn(&RigState) -> &Vec<f64>, k: usize| -> Vec<f64> {
            self.states.iter().map(|state| of(state)[k]).collect()
        };
        let all =
            |of: fn(&RigState) -> &Vec<f64>| -> Vec<Vec<f64>> { (0..DRIVES.len()).map(|k| column(of, k)).collect() };
        let [q, qd, qdd] = [all(|s| &s.q), all(|s| &s.qd), all(|s| &s.qdd)];
        let states = MotionStates {
            q: slices(&q),
            qd: slices(&qd),
            qdd: slices(&qdd),
            load: Vec::new(),
        };
        let matrix = ModelEvaluator::new(derivation)
            .regressor(&states)
            .map_err(|fault| format!("{fault:?}"))?;
        Ok((0..matrix.ncols())
            .map(|k| matrix.column(k).iter().copied().collect())
            .collect())
    }
}

/// The columns as slices.
fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
}
