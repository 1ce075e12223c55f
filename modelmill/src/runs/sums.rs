//! Runs of many machines of one kind as additive statistics over the same columns: sums of a day, of a machine, of
//! a fleet.
//!
//! The meaning of a column must not depend on the run: columns of scales, clocks and encoders' zeros are computed
//! with parameters that are the same for all, from reference runs ([`ReferenceFit`]). Rows are whitened by the
//! noise of their run, so that they count as independent values of variance 1 in every run.

use std::sync::Arc;

use modelmill_identify::changes::{NormalEquations, RunPair, fit_single_change, single_change_gains};
use modelmill_identify::{LeastSquaresError, RFactor};
use nalgebra::DVector;

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::PreparedRecording;
use crate::runs::layout::RunColumnLayout;
use crate::runs::payload::PayloadColumns;
use crate::runs::rows::{MeasuredMoments, RunRows};
use crate::runs::standstill::exclude_uncertain_friction;
use crate::runs::time_base::time_scaling;
use crate::runs::{FittedValue, ReferenceRun, RunAnalyser, RunChange, changes, merge_known};

/// The reference of a fleet, which is a group of machines with the same model. It contains base parameters from
/// reference runs. With these parameters, normal equations of all other runs are computed so that they can be added and
/// compared.
#[derive(Clone)]
pub struct ReferenceFit {
    /// The model of all machines.
    model: Model,
    /// Columns of loads.
    payloads: Arc<PayloadColumns>,
    /// Unknown base parameters of the reference runs.
    values: DVector<f64>,
    /// Sums over the rows of the reference runs, as measured.
    sizes: MeasuredMoments,
}

/// The statistics of one run. They are additive: the statistics of several runs are the sums of those of the single
/// runs.
#[derive(Clone, Debug, PartialEq)]
pub struct RunSums {
    /// Number of samples that were used, after decimation.
    pub samples: usize,
    /// Normal equations over all rows, each scaled so that its noise has variance 1. Columns are those of the unknown
    /// base parameters, followed by those of every possible change.
    pub total: NormalEquations,
    /// The R factor of the base columns alone, over the same rows.
    pub base: RFactor,
    /// The largest apparent change between parts of this run: the sum of squares that it explains, divided by the
    /// effective number of rows. A difference between two runs counts as a change only if it is clearly larger.
    pub within: f64,
    /// Residual of each drive relative to its force (rms over rms, 1), with base parameters fitted to this run alone.
    pub residual_ratios: Vec<f64>,
    /// Contacts and pushes, whose forces are excluded.
    pub events: Vec<RunChange>,
}

impl ReferenceFit {
    /// The reference from reference runs: parameters fitted to all of them at once, and normal equations of each drive.
    /// The latter provide the rms force of a drive, with which the force of a change is compared.
    ///
    /// Fails without runs, and when a run cannot be fitted.
    pub fn from_reference_runs(model: &Model, reference: &[&PreparedRecording]) -> Outcome<Self> {
        let mut stretches: Vec<_> = (reference.iter())
            .flat_map(|one| one.segments.iter().cloned())
            .collect();
        let Some(first) = reference.first().filter(|_| !stretches.is_empty()) else {
            return Err(Error::options(
                "there is no reference run; give one or more recordings of machines without faults",
            ));
        };
        exclude_uncertain_friction(model, &mut stretches)?;
        let payloads = PayloadColumns::new(model)?;
        // All reference runs are treated as one run.
        let rows = RunRows::new(model, &stretches, &payloads, &time_scaling(model, first), None)?;
        let values = rows.values.clone();
        let sizes = rows.sizes();
        Ok(Self {
            model: model.clone(),
            payloads: Arc::new(payloads),
            values,
            sizes,
        })
    }

    /// The same reference from its stored parts: [`ReferenceFit::values`] and [`ReferenceFit::sizes`].
    ///
    /// Fails when they belong to another model.
    pub fn from_parts(model: &Model, values: &[f64], sizes: Vec<NormalEquations>) -> Outcome<Self> {
        let payloads = PayloadColumns::new(model)?;
        let layout = RunColumnLayout::new(model, &payloads);
        let fits = |one: &NormalEquations| one.rhs.len() == layout.total();
        if values.len() != layout.base || sizes.len() != layout.drives || !sizes.iter().all(fits) {
            return Err(Error::input(format!(
                "the reference has {} parameters and sums of {} drives where {} has {} and {}; create it again with this model",
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

    /// Base parameters of the reference runs, without those known from the file.
    pub fn values(&self) -> &[f64] {
        self.values.as_slice()
    }

    /// Normal equations of each drive over the reference runs. Unlike those of [`RunSums`], their rows are not divided
    /// by the standard deviation of the noise.
    pub fn sizes(&self) -> &[NormalEquations] {
        &self.sizes.0
    }

    /// Number of columns of [`RunSums::total`].
    pub fn n_columns(&self) -> usize {
        RunColumnLayout::new(&self.model, &self.payloads).total()
    }

    /// Number of base columns, which come first.
    pub fn n_base(&self) -> usize {
        self.values.len()
    }

    /// The analysis that is the same for all runs.
    fn analyser(&self) -> RunAnalyser<'_> {
        RunAnalyser::new(&self.model, &self.payloads)
    }

    /// The additive statistics of a recording.
    ///
    /// Fails when a force was not measured, or the recording cannot be evaluated.
    pub fn sums(&self, recording: &PreparedRecording) -> Outcome<RunSums> {
        let reference = ReferenceRun {
            values: &self.values,
            // Clocks of machines differ from those of the reference runs anyway.
            time_base: None,
        };
        let run = self.analyser().analyse_run(recording, Some(reference))?;
        Ok(RunSums {
            samples: run.samples,
            total: run.white.total(),
            base: RFactor::new(&run.white.base),
            within: run.within,
            residual_ratios: run.sizes.residual_ratios(self.n_base())?,
            events: run.events,
        })
    }

    /// All base parameters from an R factor over rows of variance 1 ([`RunSums::base`]); those known from the file are
    /// included. Standard deviations assume independent rows. If the variance of the residual is larger than 1, they
    /// are increased accordingly.
    ///
    /// Fails when the R factor belongs to another model or has no rows.
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
        // Directions without information stay at the reference.
        let solved = base.solve_near(self.values()).map_err(of)?;
        let noise = Some(solved.residual_variance()).filter(|x| x.is_finite());
        let noise = noise.unwrap_or(1.0).max(1.0);
        let covariance = solved.unit_covariance();
        Ok(merge_known(&self.model, |i| FittedValue {
            value: solved.values[i],
            std: solved.determined[i].then(|| (noise * covariance[(i, i)]).sqrt()),
        }))
    }

    /// Changes of later runs relative to those before, the largest first. `within` is the difference that is expected
    /// without a change: between parts of one run ([`RunSums::within`]), or between runs that are assumed to be equal.
    pub fn changes(&self, before: &[NormalEquations], later: &[NormalEquations], within: f64) -> Vec<RunChange> {
        let bench = self.analyser();
        let runs = RunPair {
            reference: before.to_vec(),
            later: later.to_vec(),
            within_run_spread: within,
        };
        let believed = vec![true; bench.layout.drives];
        bench.identified_changes(&bench.significant_changes(&runs, &self.sizes, &believed), &self.values)
    }

    /// For every possible change, how much it alone explains of the difference between a later run and those before.
    /// The figure is the decrease of the sum of squared residuals, relative to the variance of the residual. The order
    /// of the changes is always the same.
    pub fn gains(&self, before: &[NormalEquations], later: &NormalEquations) -> Vec<f64> {
        single_change_gains(&pair_runs(before, later), &self.analyser().search)
    }

    /// Fits one change of the list of [`ReferenceFit::gains`], by its index, even if it explains nothing.
    pub fn single_change(&self, before: &[NormalEquations], later: &NormalEquations, which: usize) -> RunChange {
        let bench = self.analyser();
        let found = fit_single_change(&pair_runs(before, later), &bench.search, which);
        changes::identified_change(&self.model, &bench.possible, &found, &self.values)
    }

    /// Name of one change of the list of [`ReferenceFit::gains`], by its index; empty if there is no such index.
    pub fn name_of_change(&self, which: usize) -> String {
        self.analyser()
            .possible
            .get(which)
            .map_or_else(String::new, |possible| changes::name(&self.model, &possible.kind))
    }
}

/// The sums of earlier runs and of one later run.
fn pair_runs(before: &[NormalEquations], later: &NormalEquations) -> RunPair {
    RunPair {
        reference: before.to_vec(),
        later: vec![later.clone()],
        within_run_spread: 0.0,
    }
}
