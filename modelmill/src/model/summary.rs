//! `check`: contents of a model file, and the consistency of its base parameters.

use modelmill_codegen::Derivation;
use modelmill_identify::RecordingNote;

use crate::error::Outcome;
use crate::model::Model;
use crate::model::magnitudes::ModelMagnitudes;
use crate::model::sampled_rank::{SampledRank, judge_rank};

/// The result of a check.
pub struct ModelCheck {
    /// The model.
    pub model: Model,
    /// Its contents.
    pub summary: ModelSummary,
    /// Numeric rank of the regressor over random states, eq. (9), at the values of the file. `None` if it could not be
    /// computed.
    pub rank: Option<SampledRank>,
    /// Contradictions between the numeric rank and the exact reduction.
    pub warnings: Vec<String>,
    /// Gravity, mass and size: wrong signs and units in the file are visible in these figures.
    pub magnitudes: ModelMagnitudes,
}

impl ModelCheck {
    /// Values of the file that no machine can have, such as a negative mass, as phrases. With any of them the model is
    /// not valid, although its equations are right.
    pub fn impossible_values(&self) -> Vec<&str> {
        let warnings = self.model.loaded.warnings.iter();
        let impossible = warnings.filter(|warning| warning.is_impossible);
        impossible.map(|warning| warning.message.as_str()).collect()
    }
}

impl Model {
    /// Contents of the model, by names.
    pub fn summary(&self) -> ModelSummary {
        ModelSummary::new(&self.derivation)
    }

    /// Gravity, total mass and size at the values of the file: wrong signs and units in the file are visible in these
    /// figures.
    pub fn magnitudes(&self) -> ModelMagnitudes {
        ModelMagnitudes::new(self)
    }

    /// Checks the model: its contents, and the numeric rank of its regressor (over random states) compared with the
    /// exact rank.
    ///
    /// Fails only when the listener stops the job.
    ///
    /// ```
    /// let checked = modelmill::Model::open("../model-spec/models/two_link.toml")?.check()?;
    /// assert_eq!(checked.summary.bodies, 2);
    /// assert!(checked.rank.is_some());
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn check(&self) -> Outcome<ModelCheck> {
        // Without products of parameters there is no regressor and no rank.
        let (rank, warnings) = if self.derivation.reduction.products.is_empty() {
            (None, Vec::new())
        } else {
            let judged = judge_rank(self)?;
            (judged.found, judged.warnings)
        };
        for says in &warnings {
            self.host()
                .note(&RecordingNote::warning(format!("{}: {says}", self.path)));
        }
        Ok(ModelCheck {
            model: self.clone(),
            summary: self.summary(),
            rank,
            warnings,
            magnitudes: self.magnitudes(),
        })
    }
}

/// Contents of a model.
#[derive(Clone, Debug)]
pub struct ModelSummary {
    /// Number of bodies (tables `[[part]]` of the file).
    pub bodies: usize,
    /// Number of lumped masses.
    pub lumped_masses: usize,
    /// Names of the active (independent) coordinates.
    pub active: Vec<String>,
    /// Names of the passive coordinates (determined by loop closure).
    pub passive: Vec<String>,
    /// Names of the loops.
    pub loops: Vec<String>,
    /// Names of the drives of the model file. [`Model::row_names`] has the rows of the regressor instead. The two differ
    /// if a degree of freedom has no drive, or if there are more drives than degrees of freedom, as in a cable robot.
    pub drives: Vec<String>,
    /// Names of the regressor rows without an actuator.
    pub undriven: Vec<String>,
    /// Kinds of the effects, one for each effect.
    pub effects: Vec<String>,
    /// Names of the dynamic parameters.
    pub parameters: Vec<String>,
}

impl ModelSummary {
    fn new(derivation: &Derivation) -> Self {
        let m = &derivation.mechanism;
        let coordinates = |passive: bool| {
            let wanted = m.coordinates.iter().filter(|c| c.passive == passive);
            wanted.map(|c| c.name.clone()).collect()
        };
        let drives = |is_driven: bool| -> Vec<String> {
            let wanted = m.drives.iter().filter(|d| d.is_driven == is_driven);
            wanted.map(|d| d.name.clone()).collect()
        };
        Self {
            bodies: m.parts.len(),
            lumped_masses: m.lumped_masses.len(),
            active: coordinates(false),
            passive: coordinates(true),
            loops: m.loops.iter().map(|l| l.name.clone()).collect(),
            drives: {
                let shared = m.shared_drives.iter().map(|d| d.name.clone());
                drives(true).into_iter().chain(shared).collect()
            },
            undriven: drives(false),
            effects: m.effects.iter().map(|e| e.kind.clone()).collect(),
            parameters: m.parameters.iter().map(|p| p.name.clone()).collect(),
        }
    }
}
