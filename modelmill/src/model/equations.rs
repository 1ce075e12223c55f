//! `equations`: the reduced model as a page or as JSON.

use modelmill_codegen::review::{PageFormat, ReducedEquations, page};
use modelmill_identify::RecordingNote;

use crate::error::Outcome;
use crate::model::Model;
use crate::model::sampled_rank::{SampledRank, judge_rank};

/// The equations of a model as text.
#[derive(Clone, Debug)]
pub struct EquationsText {
    /// The text, in the requested format.
    pub text: String,
    /// Notes on the numeric rank of the regressor, eq. (9), compared with the exact rank.
    pub notes: Vec<RecordingNote>,
}

impl Model {
    /// The equations as a page: parameter products p_g, linear dependencies of the regressor columns, base parameters
    /// p_min, straight-line programs and numbers of operations. For a long chain this takes seconds.
    ///
    /// Fails only when the listener stops the job.
    ///
    /// ```
    /// use modelmill::Model;
    /// use modelmill::model::PageFormat;
    ///
    /// let arm = Model::open("../model-spec/models/two_link.toml")?;
    /// assert!(arm.equations(PageFormat::Markdown)?.text.contains("p1_min"));
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn equations(&self, format: PageFormat) -> Outcome<EquationsText> {
        let (rank, notes) = self.numeric_rank()?;
        let what = format!("writing the equations of {}", self.name);
        let text = self.host().run_job(&what, 0, |_| {
            page(&self.derivation, format, rank.as_ref().map(|rank| &rank.numeric_rank))
        })?;
        Ok(EquationsText { text, notes })
    }

    /// The equations as one JSON object.
    ///
    /// Fails only when the listener stops the job.
    pub fn equations_json(&self) -> Outcome<EquationsText> {
        let (rank, notes) = self.numeric_rank()?;
        let rank = rank.as_ref().map(|rank| &rank.numeric_rank);
        let mut equations = ReducedEquations::new(&self.derivation, rank);
        // The JSON names the model by its file, not by the mechanism.
        equations.model.clone_from(&self.name);
        Ok(EquationsText {
            text: equations.json(),
            notes,
        })
    }

    /// The numeric rank, eq. (9), at the file's values, with a warning if it contradicts the exact reduction. `None`
    /// if it was not found. The notes are also passed to the listener.
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
