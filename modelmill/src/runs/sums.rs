//! Runs of many machines of one kind as sums over the same columns, so that they add: those of a day, of a machine, of a fleet.
//!
//! What a column means must not depend on the run: those of scales, clocks and encoders' zeros are built on parameters that
//! are the same for all, from reference runs ([`ReferenceFit`]). Rows are made white by each run's own noise, and count
//! independent numbers of variance 1 whichever run they came from.

use std::sync::Arc;

use modelmill_identify::changes::{
    NormalEquations, RunPair, fit_single_change, single_change_gains,
};
use modelmill_identify::{LeastSquaresError, RFactor};
use nalgebra::DVector;

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::runs::layout::RunColumnLayout;
use crate::runs::payload::PayloadColumns;
use crate::runs::rows::{MeasuredMoments, RunRows};
use crate::runs::{FittedValue, RunAnalyser, RunChange, changes, merge_known};

/// What all runs of a fleet are summed up and held against.
#[derive(Clone)]
pub struct ReferenceFit {
    model: Model,
    payloads: Arc<PayloadColumns>,
    values: DVector<f64>,
    sizes: MeasuredMoments,
}

/// One run as sums over its rows.
#[derive(Clone, Debug, PartialEq)]
pub struct RunSums {
    /// Samples that were used, after decimation.
    pub samples: usize,
    /// Sums over rows of variance 1: base columns that are no known numbers, then those of every possible change.
    pub total: NormalEquations,
    /// The triangle of the base columns alone, over the same rows.
    pub base: RFactor,
    /// By what the parts of the run differ among themselves.
    pub within: f64,
    /// What the run's own parameters leave of the force of each drive, as a part of it.
    pub residual_ratios: Vec<f64>,
    /// Contacts and pushes, whose forces are left out.
    pub events: Vec<RunChange>,
}

impl ReferenceFit {
    /// The ground that reference runs make: their parameters, fitted to all of them at once, and the size of their forces.
    ///
    /// Fails without runs, and where a run cannot be fitted.
    pub fn from_reference_runs(model: &Model, reference: &[&PreparedRecording]) -> Outcome<Self> {
        let stretches: Vec<_> = (reference.iter())
            .flat_map(|one| one.segments.iter().cloned())
            .collect();
        if stretches.is_empty() {
            return Err(Error::options(
                "there is no reference run; give one or more recordings of sound machines",
            ));
        }
        let payloads = PayloadColumns::new(model)?;
        let rows = RunRows::new(model, &stretches, &payloads, None)?;
        let values = rows.values.clone();
        let sizes = rows.sizes();
        Ok(Self {
            model: model.clone(),
            payloads: Arc::new(payloads),
            values,
            sizes,
        })
    }

    /// The same ground from what was kept of it: [`ReferenceFit::values`] and [`ReferenceFit::sizes`].
    ///
    /// Fails where they are of another model.
    pub fn from_parts(model: &Model, values: &[f64], sizes: Vec<NormalEquations>) -> Outcome<Self> {
        let payloads = PayloadColumns::new(model)?;
        let layout = RunColumnLayout::new(model, &payloads);
        let fits = |one: &NormalEquations| one.rhs.len() == layout.total();
        if values.len() != layout.base || sizes.len() != layout.drives || !sizes.iter().all(fits) {
            return Err(Error::input(format!(
                "the reference has {} parameters and sums of {} drives where {} has {} and {}; make it anew with this model",
                values.len(),
                sizes.len(),
                model.name,
                layout.base,
                layout.drives
            )));
        }
        Ok(Self {
            model: model.clone(),
            payloads: Arc::new(payloads),
            values: DVector::from_column_slice(values),
            sizes: MeasuredMoments(sizes),
        })
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Base parameters of the reference runs that are no known numbers.
    pub fn values(&self) -> &[f64] {
        self.values.as_slice()
    }

    /// Sums over the rows of each drive of the reference runs, as they were measured.
    pub fn sizes(&self) -> &[NormalEquations] {
        &self.sizes.0
    }

    /// Number of columns of [`RunSums::whole`].
    pub fn n_columns(&self) -> usize {
        RunColumnLayout::new(&self.model, &self.payloads).total()
    }

    /// Number of base columns, which stand first.
    pub fn n_base(&self) -> usize {
        self.values.len()
    }

    fn analyser(&self) -> RunAnalyser<'_> {
        RunAnalyser::new(&self.model, &self.payloads)
    }

    /// A recording as sums.
    ///
    /// Fails where a force was not measured, or the recording cannot be evaluated.
    pub fn sums(&self, recording: &PreparedRecording) -> Outcome<RunSums> {
        let run = self.analyser().analyse_run(recording, Some(&self.values))?;
        Ok(RunSums {
            samples: run.samples,
            total: run.white.total(),
            base: RFactor::new(&run.white.base),
            within: run.within,
            residual_ratios: run.sizes.residual_ratios(self.n_base())?,
            events: run.events,
        })
    }

    /// The base parameters that a triangle gives, with those of the file that are known numbers. Deviations take the rows to be
    /// independent and of variance 1, or more where they scatter more.
    ///
    /// Fails where the triangle is of another model or holds no rows.
    pub fn fit_parameters(&self, base: &RFactor) -> Outcome<Vec<FittedValue>> {
        let of = |error: LeastSquaresError| Error::input(error.to_string());
        if base.rows() == 0 {
            return Err(of(LeastSquaresError::NoRows));
        }
        if base.n_parameters() != self.n_base() {
            return Err(of(LeastSquaresError::NominalLength {
                have: base.n_parameters(),
                expected: self.n_base(),
            }));
        }
        let solved = base.solve_near(self.values()).map_err(of)?;
        let noise = Some(solved.residual_variance()).filter(|x| x.is_finite());
        let noise = noise.unwrap_or(1.0).max(1.0);
        let covariance = solved.unit_covariance();
        Ok(merge_known(&self.model, |i| FittedValue {
            value: solved.values[i],
            deviation: solved.determined[i].then(|| (noise * covariance[(i, i)]).sqrt()),
        }))
    }

    /// What later runs do not share with those before, the largest first; `within` is by what parts of one run, or runs that are
    /// taken to be alike, differ among themselves.
    pub fn changes(
        &self,
        before: &[NormalEquations],
        later: &[NormalEquations],
        within: f64,
    ) -> Vec<RunChange> {
        let bench = self.analyser();
        let runs = RunPair {
            reference: before.to_vec(),
            later: later.to_vec(),
            within_run_spread: within,
        };
        bench.identified_changes(&bench.significant_changes(&runs, &self.sizes), &self.values)
    }

    /// By how much every possible change, each with no other beside it, explains what a later run does not share with those
    /// before: sums of squares over the variance of what is left. The order is always the same.
    pub fn gains(&self, before: &[NormalEquations], later: &NormalEquations) -> Vec<f64> {
        single_change_gains(&pair_runs(before, later), &self.analyser().search)
    }

    /// One of these changes, by its place among them, whatever it explains.
    pub fn single_change(
        &self,
        before: &[NormalEquations],
        later: &NormalEquations,
        which: usize,
    ) -> RunChange {
        let bench = self.analyser();
        let found = fit_single_change(&pair_runs(before, later), &bench.search, which);
        changes::identified_change(&self.model, &bench.possible, &found, &self.values)
    }

    /// What one of these changes is called.
    pub fn name_of_change(&self, which: usize) -> String {
        self.analyser()
            .possible
            .get(which)
            .map_or_else(String::new, |possible| {
                changes::name(&self.model, &possible.kind)
            })
    }
}

fn pair_runs(before: &[NormalEquations], later: &NormalEquations) -> RunPair {
    RunPair {
        reference: before.to_vec(),
        later: vec![later.clone()],
        within_run_spread: 0.0,
    }
}
