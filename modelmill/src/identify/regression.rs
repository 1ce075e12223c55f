//! Least squares over recordings. Rows of the regressor are computed block by block and kept if they fit a moderate
//! memory; otherwise they are computed again for every pass.

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, Remedy};
use modelmill_codegen::{ModelEvaluator, MotionStates, PoseFault};
use modelmill_identify::estimate::{EstimateOptions, RowVisitor, RowWeighting, estimate, estimate_with_instruments};
use modelmill_identify::{FilterError, LeastSquaresError, ParameterUncertainty, RegressionSolution, decimate_table};

use crate::along::{included_forces, interleave};
use crate::error::{Error, Outcome};
use crate::identify::options::{EquationWeights, EstimatorOptions};
use crate::identify::refine::{RefinementResult, refine};
use crate::model::Model;
use crate::progress::JobHandle;
use crate::segment::RecordingSegment;
use crate::segment::variances;
use crate::text::table::count;

/// Largest number of regressor entries that are kept between passes: 32 MB; above, computing again is faster than
/// memory.
const KEPT: usize = 1 << 22;

/// Decimated samples to either side beyond which the filter of the decimation has no influence: its slowest pole has
/// decayed by a factor of 1e9 there.
const REACH: usize = 120;

/// The estimate and its statistics.
pub struct RegressionEstimate {
    /// The solution.
    pub solution: RegressionSolution,
    /// Standard deviations, covariance and effective numbers of samples.
    pub uncertainty: ParameterUncertainty,
    /// Indices of the base parameters that solution and uncertainty refer to.
    pub unknown: Vec<usize>,
    /// Weights of the rows, if any were used.
    pub weighting: Option<RowWeighting>,
    /// Result of the refinement.
    pub refined: RefinementResult,
    /// Statistics of the instruments, if any were used.
    pub instruments: Option<InstrumentStatistics>,
}

/// Statistics of instrumental variables in addition to the solution.
pub struct InstrumentStatistics {
    /// The smallest canonical correlation between instruments and regressor, 0 to 1.
    pub strength: f64,
    /// The least-squares solution of the same rows, for comparison.
    pub least_squares: Vec<f64>,
}

/// Identifies the base parameters of a model from recordings, eq. (12). Base parameters that contain only constants and
/// numbers are known ([`Model::is_known`]). They are not estimated; their force is subtracted from the measured one.
/// `instruments` has one segment for each of `data`, or none.
///
/// Fails when nothing is unknown, and as [`Model::identify`] does.
pub fn identify(
    model: &Model,
    data: &[RecordingSegment],
    instruments: &[RecordingSegment],
    args: &EstimatorOptions,
) -> Outcome<RegressionEstimate> {
    if model.base.is_empty() {
        return Err(Error::input(format!(
            "{}: no parameter has an effect on the drives, so there is nothing to identify",
            model.path
        )));
    }
    // Known parameters are subtracted, the others are estimated.
    let (known, unknown): (Vec<usize>, Vec<usize>) = (0..model.base.len()).partition(|k| model.is_known(*k));
    if unknown.is_empty() {
        return Err(Error::input(format!(
            "{}: every base parameter is a number of the file, so there is nothing to identify; \
             declare what is unknown in [parameters]",
            model.path
        )));
    }
    let known: Vec<(usize, f64)> = known.into_iter().map(|k| (k, model.values[k])).collect();
    let nominal: Vec<f64> = unknown.iter().map(|k| model.values[*k]).collect();
    let samples: usize = data.iter().map(RecordingSegment::samples).sum();
    // Each segment becomes a source of rows.
    let mut runs = data
        .iter()
        .enumerate()
        .map(|(k, one)| RegressionRows::new(model, one, instruments.get(k), &known, &unknown, args.weights))
        .collect::<Outcome<Vec<RegressionRows<'_>>>>()?;
    check_equation_count(data, &runs, unknown.len(), model)?;
    check_forces_nonzero(data, &runs)?;
    // Plain least squares: one pass for the solution, two for the uncertainty. The number of passes with reweighting
    // is unknown.
    let by_channel = args.weights == EquationWeights::Channels;
    let reweighted = by_channel || args.robust.is_some();
    let passes = if reweighted { 0 } else { 3 };
    model.host().run_job("identifying", passes * samples, |job| {
        // Rows are kept in memory if they are few, so that later passes are fast.
        for run in &mut runs {
            run.keep_if_small(job)?;
        }
        let channels = model.row_names().len();
        // The estimator requests the rows in several passes.
        let show = |visit: &mut RowVisitor<'_>| -> Outcome {
            runs.iter().try_for_each(|run| run.visit_rows::<Error>(job, visit))
        };
        // Instrumental variables have their own estimator and no refinement.
        if !instruments.is_empty() {
            let found = estimate_with_instruments(unknown.len(), channels, show)?;
            return Ok(RegressionEstimate {
                solution: found.solution,
                uncertainty: found.uncertainty,
                unknown: unknown.clone(),
                weighting: None,
                refined: RefinementResult::Nothing,
                instruments: Some(InstrumentStatistics {
                    strength: found.strength,
                    least_squares: found.least_squares.values,
                }),
            });
        }
        // Weights by drive and robust weights are iterated by the estimator.
        let options = EstimateOptions {
            by_channel,
            huber: args.robust,
            ..EstimateOptions::default()
        };
        // Least squares, then the refinement of its reduced rows.
        let mut found = estimate(&nominal, channels, &options, show)?;
        let refined = refine(model, &mut found, &unknown, &nominal, args.refinement)?;
        let weighting = found.weighting;
        let is_weighted = weighting.by_channel || weighting.huber.is_some();
        Ok(RegressionEstimate {
            solution: found.solution,
            uncertainty: found.uncertainty,
            unknown: unknown.clone(),
            weighting: is_weighted.then_some(weighting),
            refined,
            instruments: None,
        })
    })?
}

/// Fails when there are fewer equations than unknown parameters.
fn check_equation_count(
    data: &[RecordingSegment],
    runs: &[RegressionRows<'_>],
    unknown: usize,
    model: &Model,
) -> Outcome {
    let equations: usize = runs.iter().map(|run| run.measured.len()).sum();
    if equations >= unknown {
        return Ok(());
    }
    Err(Error::input(format!(
        "{}: {} of all drives make {} for {}; use a longer recording{}",
        data.iter()
            .map(|one| one.run.file.as_str())
            .collect::<Vec<_>>()
            .join(", "),
        count(equations / model.row_names().len().max(1), "sample", "samples"),
        count(equations, "equation", "equations"),
        count(unknown, "unknown base parameter", "unknown base parameters"),
        if data.iter().any(|one| one.decimation() > 1) {
            ", or decimate less"
        } else {
            ""
        }
    )))
}

/// Fails when all measured forces are zero: parameters of zero would fit them exactly.
fn check_forces_nonzero(data: &[RecordingSegment], runs: &[RegressionRows<'_>]) -> Outcome {
    let is_idle = |run: &RegressionRows<'_>| run.measured.iter().all(|force| *force == 0.0);
    if !runs.iter().all(is_idle) {
        return Ok(());
    }
    let files: Vec<&str> = data.iter().map(|one| one.run.file.as_str()).collect();
    Err(Error::input(zero_force_message(&files.join(", "))))
}

/// The error of recordings whose measured forces are all zero.
pub fn zero_force_message(files: &str) -> Message {
    message!(
        "{files}: the measured forces are zero throughout, so that there is nothing to explain; record the forces of the \
         drives, or name their columns with {}",
        Remedy::option(OptionName::Columns)
    )
}

/// The rows of one segment: the regressor of the instruments, if there are any, and of the recording itself.
struct RegressionRows<'a> {
    /// The model whose regressor is evaluated.
    model: &'a Model,
    /// The states and forces.
    data: &'a RecordingSegment,
    /// The segment of instruments with the same times.
    instruments: Option<&'a RecordingSegment>,
    /// Known columns with the values of their parameters.
    known: &'a [(usize, f64)],
    /// Unknown columns.
    unknown: &'a [usize],
    /// Measured forces, interleaved per sample, decimated.
    measured: Vec<f64>,
    /// Weights of the rows, if they are not 1.
    factors: Option<Vec<f64>>,
    /// All rows in memory, if they are few enough or decimated.
    kept: Option<Vec<f64>>,
}

impl<'a> RegressionRows<'a> {
    /// Prepares the forces and weights of a segment; fails if variances are requested and missing.
    fn new(
        model: &'a Model,
        data: &'a RecordingSegment,
        instruments: Option<&'a RecordingSegment>,
        known: &'a [(usize, f64)],
        unknown: &'a [usize],
        weights: EquationWeights,
    ) -> Outcome<Self> {
        let drives = model.row_names();
        // Weights from variances need a variance for every drive.
        let spread = if weights == EquationWeights::Variance {
            let Some(variance) = &data.variance else {
                let columns: Vec<String> = drives.iter().map(|d| format!("`{}`", variances::column(d))).collect();
                let weights = |value: &str| Remedy::option(OptionName::Weights).with_value(value);
                return Err(Error::input(message!(
                    "{}: {} needs the variance of every drive's force, in the columns {}; name yours \
                     with {}, or use {}",
                    data.run.file,
                    weights("variance"),
                    columns.join(", "),
                    Remedy::option(OptionName::Columns),
                    weights("channels")
                )));
            };
            Some(variances::factors(variance, &data.run, &drives, data.decimation())?)
        } else {
            None
        };
        let factors = combined_factors(spread, data.weights.as_deref());
        Ok(Self {
            model,
            data,
            instruments,
            known,
            unknown,
            measured: interleave(&included_forces(data)?),
            factors,
            kept: None,
        })
    }

    /// Number of entries of a row, including known columns.
    fn width(&self) -> usize {
        self.model.base.len() * (1 + usize::from(self.instruments.is_some()))
    }

    /// Computes all rows once and keeps them, if they are few enough or decimated: decimation needs neighbouring rows.
    fn keep_if_small(&mut self, job: &JobHandle) -> Outcome {
        // Without decimation, rows that are too many are computed again in each pass.
        let width = self.width() * self.model.row_names().len();
        let decimation = self.data.decimation();
        let samples = self.data.samples();
        if decimation == 1 && samples * width > KEPT {
            return Ok(());
        }
        let mut kept = Vec::with_capacity(samples.div_ceil(decimation) * width);
        let mut window = DecimationWindow {
            first: 0,
            next: 0,
            table: Vec::new(),
        };
        let reach = REACH * decimation;
        let longest = (KEPT / width.max(1)).max(6 * reach);
        let failed = |error| Error::input(format!("{}: {error}", self.data.run.file));
        self.blocks::<Error>(&mut |w| {
            job.add(w.len() / width.max(1));
            if decimation == 1 {
                kept.extend_from_slice(w);
                return Ok(());
            }
            // Rows are decimated in windows, so that only a part of them is in memory at a time.
            window.table.extend_from_slice(w);
            let have = window.table.len() / width;
            if have > longest {
                window
                    .decimate(width, decimation, have - reach, &mut kept)
                    .map_err(failed)?;
                window.drop_passed_rows(width, decimation, reach);
            }
            Ok(())
        })?;
        // The last window ends with the segment.
        if decimation > 1 {
            let have = window.table.len() / width;
            window.decimate(width, decimation, have, &mut kept).map_err(failed)?;
        }
        self.kept = Some(kept);
        Ok(())
    }

    /// Passes all rows with the measured values to `visit`.
    fn visit_rows<E: From<Error> + From<LeastSquaresError>>(
        &self,
        job: &JobHandle,
        visit: &mut RowVisitor<'_>,
    ) -> Result<(), E> {
        if let Some(table) = &self.kept {
            self.visit_unknown(table, 0, visit)?;
            job.add(self.data.samples());
            return Ok(());
        }
        // Blocks are weighted and split as the kept table would be.
        let mut row = 0;
        self.blocks::<E>(&mut |w| {
            let rows = w.len() / self.width();
            self.visit_unknown(w, row, visit)?;
            row += rows;
            job.add(rows / self.model.row_names().len().max(1));
            Ok(())
        })
    }

    /// Passes weighted rows of the unknown columns to `visit`, with the force of known columns subtracted from the
    /// measured values; `first` is the index of the first row.
    fn visit_unknown(&self, w: &[f64], first: usize, visit: &mut RowVisitor<'_>) -> Result<(), LeastSquaresError> {
        // The measured forces and weights of these rows.
        let at = first..first + w.len() / self.width();
        let measured = &self.measured[at.clone()];
        let factors = self.factors.as_ref().map(|factors| &factors[at]);
        if self.known.is_empty() && factors.is_none() {
            return visit(w, measured);
        }
        // Rows of the instruments and of the recording are joined; each part has all columns of the
        // model.
        let n = self.model.base.len();
        let mut rows = Vec::with_capacity(w.len());
        let mut rest = Vec::with_capacity(measured.len());
        for (i, (row, y)) in w.chunks_exact(self.width()).zip(measured).enumerate() {
            // Known columns are dropped from the row, and their force from the measured value.
            let factor = factors.map_or(1.0, |factors| factors[i]);
            for part in row.chunks_exact(n) {
                rows.extend(self.unknown.iter().map(|k| factor * part[*k]));
            }
            // The recording's own regressor comes last.
            let own = &row[self.width() - n..];
            rest.push(factor * (y - self.known.iter().map(|(k, p)| own[*k] * p).sum::<f64>()));
        }
        visit(&rows, &rest)
    }

    /// Passes blocks of the regressor to `visit`, row by row; each row of the instruments is followed by that of the
    /// recording.
    fn blocks<E: From<Error>>(&self, visit: &mut dyn FnMut(&[f64]) -> Result<(), E>) -> Result<(), E> {
        let evaluator = ModelEvaluator::new(&self.model.derivation);
        let drives = self.model.row_names().len();
        let width = self.width();
        let (mut rows, mut start) = (Vec::new(), 0);
        self.data.for_each_block(self.model, |states| {
            rows.clear();
            rows.resize(states.len() * drives * width, 0.0);
            // The states of the instruments have the same indices as those of the recording.
            if let Some(instruments) = self.instruments {
                let theirs = instruments.states(start, start + states.len());
                fill(&evaluator, &theirs, drives, width, 0, &mut rows)
                    .map_err(|fault| instruments.pose_error(self.model, fault, start))?;
            }
            start += states.len();
            let place = width - self.model.base.len();
            if let Err(fault) = fill(&evaluator, states, drives, width, place, &mut rows) {
                return Ok(Err(fault));
            }
            // Rows of excluded forces are zero, as the forces are.
            let first = start - states.len();
            for (d, out) in self.data.run.left_out.iter().enumerate() {
                for (i, _) in (out[first..start].iter().enumerate()).filter(|(_, out)| **out) {
                    rows[(i * drives + d) * width..][..width].fill(0.0);
                }
            }
            visit(&rows)?;
            Ok(Ok(()))
        })
    }
}

/// Consecutive rows during their decimation: all of them, unless they are too many for memory.
struct DecimationWindow {
    /// The first sample of the table, one of those that are kept.
    first: usize,
    /// The first sample that is not yet decimated.
    next: usize,
    /// Rows from `first` on.
    table: Vec<f64>,
}

impl DecimationWindow {
    /// Decimates the rows before `end`, counted from the first sample of the table, and appends them to `kept`.
    fn decimate(
        &mut self,
        width: usize,
        decimation: usize,
        end: usize,
        kept: &mut Vec<f64>,
    ) -> Result<(), FilterError> {
        // The complete table is decimated, and the part that is final is appended.
        let short = decimate_table(&self.table, width, decimation)?;
        while self.next < self.first + end {
            let at = (self.next - self.first) / decimation * width;
            kept.extend_from_slice(&short[at..at + width]);
            self.next += decimation;
        }
        Ok(())
    }

    /// Drops rows that the filter no longer needs for later samples.
    fn drop_passed_rows(&mut self, width: usize, decimation: usize, reach: usize) {
        let from = self.next.saturating_sub(reach).max(self.first) / decimation * decimation;
        self.table.drain(..(from - self.first) * width);
        self.first = from;
    }
}

/// Weights of the rows from both variances and excluded equations.
fn combined_factors(spread: Option<Vec<f64>>, weights: Option<&[f64]>) -> Option<Vec<f64>> {
    match (spread, weights) {
        (Some(spread), Some(weights)) => Some(spread.iter().zip(weights).map(|(s, w)| s * w).collect()),
        (spread, weights) => spread.or_else(|| weights.map(<[f64]>::to_vec)),
    }
}

/// Writes the regressor of some states into rows of `width` entries, starting at entry `place` of each.
fn fill(
    evaluator: &ModelEvaluator<'_>,
    states: &MotionStates<'_>,
    drives: usize,
    width: usize,
    place: usize,
    rows: &mut [f64],
) -> Result<(), PoseFault> {
    let mut first = 0;
    evaluator.regressor_blocks(states, |len, columns| {
        // Columns are ordered by drive; rows are ordered by sample and drive.
        let n = columns.len() / drives.max(1);
        for (k, column) in columns.iter().enumerate() {
            let at = first * width + (k / n) * width + place + k % n;
            for (slot, value) in rows[at..].iter_mut().step_by(drives * width).zip(*column) {
                *slot = *value;
            }
        }
        first += len * drives;
        Ok(())
    })
}
