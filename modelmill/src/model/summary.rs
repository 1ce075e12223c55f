//! `check`: what a model file holds, and how sound its base is.

use modelmill_codegen::Derivation;
use modelmill_identify::RecordingNote;

use crate::error::Outcome;
use crate::model::Model;
use crate::model::sampled_rank::{SampledRank, judge_rank};

/// A model that was looked over.
pub struct ModelCheck {
    /// The model.
    pub model: Model,
    /// What it consists of.
    pub summary: ModelSummary,
    /// Eq. (9) on the file's values, where it has an answer.
    pub rank: Option<SampledRank>,
    /// Where the numeric rank says something else than exact reduction.
    pub warnings: Vec<String>,
}

impl Model {
    /// What the model consists of.
    pub fn summary(&self) -> ModelSummary {
        ModelSummary::new(&self.derivation)
    }

    /// Looks the model over: what it consists of, and its rank in numbers beside the exact one.
    ///
    /// Fails only when whoever watches stops it.
    pub fn check(&self) -> Outcome<ModelCheck> {
        // Without any product there is nothing whose rank could be looked at.
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
        })
    }
}

/// What a model consists of.
#[derive(Clone, Debug)]
pub struct ModelSummary {
    /// Parts.
    pub bodies: usize,
    /// Lumped masses.
    pub lumped_masses: usize,
    /// Active coordinates.
    pub active: Vec<String>,
    /// Passive coordinates.
    pub passive: Vec<String>,
    /// Loops.
    pub loops: Vec<String>,
    /// Drives.
    pub drives: Vec<String>,
    /// Rows on which no drive acts.
    pub undriven: Vec<String>,
    /// Kinds of the effects.
    pub effects: Vec<String>,
    /// Dynamic parameters.
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
