//! `equations`: the reduced model as a page or as JSON.

use modelmill_codegen::review::{CutFreeError, PageFormat, ReducedEquations, balance_page, page};
use modelmill_identify::RecordingNote;

use crate::error::{Error, Outcome};
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

    /// The balances of forces and of moments of a part that is cut free: Newton's and Euler's equations of the body that
    /// carries it, with the reactions of its joints, its weight, drives and effects.
    ///
    /// Fails if no part and no frame has this name, or if it does not move; the message lists the parts.
    ///
    /// ```
    /// use modelmill::Model;
    /// use modelmill::model::PageFormat;
    ///
    /// let arm = Model::open("../model-spec/models/two_link.toml")?;
    /// let parts = arm.balances("no such part", PageFormat::Text).expect_err("unknown").to_string();
    /// assert!(parts.contains("choose one of"));
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn balances(&self, part: &str, format: PageFormat) -> Outcome<String> {
        let what = format!("writing the balances of {part}");
        let written = self
            .host()
            .run_job(&what, 0, |_| balance_page(&self.derivation, part, format))?;
        written.map_err(|error| match error {
            CutFreeError::Derivation(error) => Error::derivation(&self.path, error),
            other => Error::input(format!("{}: {other}", self.path)),
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
