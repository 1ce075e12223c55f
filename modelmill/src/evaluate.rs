//! `evaluate`: a model's forces along a recording, at its drives or in its joints.

use std::path::Path;

use modelmill_codegen::ReactionPrograms;

use crate::along;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::{self, RecordingOptions};
use crate::text::csv::csv;

/// Columns of numbers along a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingEvaluation {
    /// Times of the samples after decimation, s.
    pub time: Vec<f64>,
    /// Names and values of the columns, N or N m.
    pub columns: Vec<(String, Vec<f64>)>,
    /// Components of joint reactions that the equations of motion do not determine, since the mechanism is statically
    /// indeterminate there. Empty for forces of drives.
    pub left_out: Vec<String>,
}

impl Model {
    /// The model's forces along a recording, one column for each drive. `values` are those of the base parameters. If
    /// the model file has a `time_delay` of the force signals, it is not applied: forces are those at the time of the
    /// state.
    ///
    /// Fails when the recording lacks a position, or contains a pose that the mechanism cannot reach.
    pub fn evaluate(
        &self,
        path: impl AsRef<Path>,
        reading: &RecordingOptions,
        values: &[f64],
    ) -> Outcome<RecordingEvaluation> {
        let mut found = RecordingEvaluation::new(self.row_names(), Vec::new());
        for segment in &recording::read_as_recorded(self, path.as_ref(), reading)? {
            let forces = along::forces(self, segment, values)?;
            found.extend(&segment.time(), along::filter_and_decimate(forces, segment)?);
        }
        Ok(found)
    }

    /// Forces and moments that the joints and the cuts of loops transmit along a recording, for the parameters of the
    /// model file: one column for each component that is determined.
    ///
    /// Fails as [`Model::evaluate`] does.
    pub fn evaluate_reactions(
        &self,
        path: impl AsRef<Path>,
        reading: &RecordingOptions,
    ) -> Outcome<RecordingEvaluation> {
        let derived = self.derivation.reactions();
        let reactions = derived.map_err(|error| Error::derivation(&self.path, error))?;
        let components = reaction_components(&reactions);
        let mut found = RecordingEvaluation::new(components.determined, components.left_out);
        for segment in &recording::read_as_recorded(self, path.as_ref(), reading)? {
            found.extend(&segment.time(), along::reactions(self, segment, &reactions)?);
        }
        Ok(found)
    }
}

impl RecordingEvaluation {
    /// Named columns without samples yet.
    fn new(names: Vec<String>, left_out: Vec<String>) -> Self {
        Self {
            time: Vec::new(),
            columns: names.into_iter().map(|name| (name, Vec::new())).collect(),
            left_out,
        }
    }

    /// Appends the samples of one segment.
    fn extend(&mut self, time: &[f64], columns: Vec<Vec<f64>>) {
        self.time.extend(time);
        for ((_, whole), more) in self.columns.iter_mut().zip(columns) {
            whole.extend(more);
        }
    }

    /// The columns as text (CSV), `t` first.
    pub fn csv(&self) -> String {
        let mut columns = vec![("t", self.time.as_slice())];
        let more = self.columns.iter();
        columns.extend(more.map(|(name, values)| (name.as_str(), values.as_slice())));
        csv(&columns)
    }
}

/// Names of the components of all reactions, such as `elbow.Fx`, `elbow.Mz`, and `closure.Fx` of a loop.
pub(crate) struct ReactionComponents {
    /// Components that the equations of motion determine, in the order of the program's outputs.
    pub(crate) determined: Vec<String>,
    /// Statically indeterminate components.
    pub(crate) left_out: Vec<String>,
}

/// The names of all components, in the order in which the program returns them.
pub(crate) fn reaction_components(reactions: &ReactionPrograms) -> ReactionComponents {
    let mut found = ReactionComponents {
        determined: Vec::new(),
        left_out: Vec::new(),
    };
    let mut sort = |name: &str, kind: char, places: &[Option<usize>; 3]| {
        for (axis, place) in ['x', 'y', 'z'].into_iter().zip(places) {
            let column = format!("{name}.{kind}{axis}");
            match place {
                Some(_) => found.determined.push(column),
                None => found.left_out.push(column),
            }
        }
    };
    for joint in &reactions.joints {
        sort(&joint.name, 'F', &joint.force);
        sort(&joint.name, 'M', &joint.moment);
    }
    for closed in &reactions.loops {
        sort(&closed.name, 'F', &closed.force);
    }
    found
}
