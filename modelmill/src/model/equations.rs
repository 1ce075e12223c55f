//! `equations`: the reduced model for people and programs.

use modelmill_codegen::review::{PageFormat, ReducedEquations, page};
use modelmill_identify::RecordingNote;

use crate::error::Outcome;
use crate::model::Model;
use crate::model::sampled_rank::{SampledRank, judge_rank};

/// The equations of a model, written out.
#[derive(Clone, Debug)]
pub struct EquationsText {
    /// The text, in the form that was asked for.
    pub text: String,
    /// What there is to know about the numeric rank, eq. (9), beside the exact one.
    pub notes: Vec<RecordingNote>,
}

impl Model {
    /// The equations as a page for people: p_g, dependences, p_min, intermediate variables, counts of operations. Those of a
    /// long chain take seconds to write.
    ///
    /// Fails only when whoever watches stops it.
    pub fn equations(&self, format: PageFormat) -> Outcome<EquationsText> {
        let (rank, notes) = self.numeric_rank()?;
        let what = format!("writing the equations of {}", self.name);
        let text = self.host().run_job(&what, 0, |_| {
            page(
                &self.derivation,
                format,
                rank.as_ref().map(|rank| &rank.numeric_rank),
            )
        })?;
        Ok(EquationsText { text, notes })
    }

    /// The equations as one JSON object.
    ///
    /// Fails only when whoever watches stops it.
    pub fn equations_json(&self) -> Outcome<EquationsText> {
        let (rank, notes) = self.numeric_rank()?;
        let rank = rank.as_ref().map(|rank| &rank.numeric_rank);
        let mut equations = ReducedEquations::new(&self.derivation, rank);
        equations.model.clone_from(&self.name);
        Ok(EquationsText {
            text: equations.json(),
            notes,
        })
    }

    /// Eq. (9) on the file's values, with a warning where it says something else than exact reduction.
    fn numeric_rank(&self) -> Outcome<(Option<SampledRank>, Vec<RecordingNote>)> {
        let judged = judge_rank(self)?;
        let warnings = judged.warnings.iter();
        let mut notes: Vec<RecordingNote> = warnings
            .map(|says| RecordingNote::warning(format!("{}: {says}", self.path)))
            .collect();
        if let Some(says) = judged.found.as_ref().and_then(SampledRank::remark) {
            notes.push(RecordingNote::info(format!("{}: {says}", self.path)));
        }
        for note in &notes {
            self.host().note(note);
        }
        Ok((judged.found, notes))
    }
}
