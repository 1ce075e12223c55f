//! Least squares over recordings: rows of the regressor are made block by block and kept only if
//! they fit a modest memory; else they are made again for every pass.

use modelmill_codegen::Evaluator;
use modelmill_identify::deviations::{Visit, autocorrelated};
use modelmill_identify::filters::decimate_table;
use modelmill_identify::{Deviations, LeastSquares, LeastSquaresError, Solution};

use crate::along::{interleaved, measured};
use crate::data::Data;
use crate::failure::{Failure, Outcome};
use crate::model::Model;
use crate::progress::{Done, watched};
use crate::table::count;

/// Numbers of the regressor that are kept between passes: 256 MB.
const KEPT: usize = 1 << 25;

/// What least squares found.
pub(crate) struct Identified {
    /// The solution.
    pub(crate) solution: Solution,
    /// What it is worth.
    pub(crate) deviations: Deviations,
    /// The base parameters that solution and deviations are about, by position.
    pub(crate) unknown: Vec<usize>,
}

/// Identifies the base parameters of a model from recordings, eq. (12). What is a number of the model file is no unknown:
/// its force is taken off the measured one.
pub(crate) fn identify(model: &Model, data: &[Data]) -> Outcome<Identified> {
    if model.base.is_empty() {
        return Err(Failure::Input(format!(
            "{}: no parameter has an effect on the drives, so there is nothing to identify",
            model.path
        )));
    }
    let (known, unknown): (Vec<usize>, Vec<usize>) =
        (0..model.base.len()).partition(|k| model.is_known(*k));
    if unknown.is_empty() {
        return Err(Failure::Input(format!(
            "{}: every base parameter is a number of the file, so there is nothing to identify; \
             declare what is unknown in [parameters]",
            model.path
        )));
    }
    let known: Vec<(usize, f64)> = known.into_iter().map(|k| (k, model.nominal[k])).collect();
    let nominal: Vec<f64> = unknown.iter().map(|k| model.nominal[*k]).collect();
    let samples: usize = data.iter().map(Data::samples).sum();
    let mut runs = data
        .iter()
        .map(|one| Rows::new(model, one, &known, &unknown))
        .collect::<Outcome<Vec<Rows<'_>>>>()?;
    let equations: usize = runs.iter().map(|run| run.measured.len()).sum();
    if equations < unknown.len() {
        return Err(Failure::Input(format!(
            "{}: {} of all drives make {} for {}; use a longer recording{}",
            data.iter()
                .map(|one| one.run.file.as_str())
                .collect::<Vec<_>>()
                .join(", "),
            count(equations / model.drives().len().max(1), "sample", "samples"),
            count(equations, "equation", "equations"),
            count(
                unknown.len(),
                "unknown base parameter",
                "unknown base parameters"
            ),
            if data.iter().any(|one| one.decimation() > 1) {
                ", or decimate less"
            } else {
                ""
            }
        )));
    }
    // One pass for the solution, two for the deviations.
    watched("identifying", 3 * samples, |done| {
        let mut regression = LeastSquares::new(unknown.len());
        for run in &mut runs {
            run.keep_if_small(done)?;
            run.show::<Failure>(done, &mut |w, y| regression.add_rows(w, y))?;
        }
        let solution = regression.solve_near(&nominal)?;
        let deviations = autocorrelated(&solution, model.drives().len(), |visit| {
            for run in &runs {
                run.show::<Failure>(done, visit)?;
            }
            Ok::<(), Failure>(())
        })?;
        Ok(Identified {
            solution,
            deviations,
            unknown: unknown.clone(),
        })
    })
}

/// The rows of one recording.
struct Rows<'a> {
    model: &'a Model,
    data: &'a Data,
    /// Columns that are known, with their parameters' values.
    known: &'a [(usize, f64)],
    /// The other columns.
    unknown: &'a [usize],
    /// Interleaved per sample, decimated.
    measured: Vec<f64>,
    kept: Option<Vec<f64>>,
}

impl<'a> Rows<'a> {
    fn new(
        model: &'a Model,
        data: &'a Data,
        known: &'a [(usize, f64)],
        unknown: &'a [usize],
    ) -> Outcome<Self> {
        Ok(Self {
            model,
            data,
            known,
            unknown,
            measured: interleaved(&measured(data)?),
            kept: None,
        })
    }

    /// Decimation needs the whole table at hand; else it is kept if it is not too large.
    fn keep_if_small(&mut self, done: &Done) -> Outcome {
        let width = self.model.base.len() * self.model.drives().len();
        let decimation = self.data.decimation();
        if decimation == 1 && self.data.samples() * width > KEPT {
            return Ok(());
        }
        let mut table = Vec::with_capacity(self.data.samples() * width);
        self.blocks::<Failure>(&mut |w| {
            done.add(w.len() / width.max(1));
            table.extend_from_slice(w);
            Ok(())
        })?;
        if decimation > 1 {
            table = decimate_table(&table, width, decimation)
                .map_err(|error| Failure::Input(format!("{}: {error}", self.data.run.file)))?;
        }
        self.kept = Some(table);
        Ok(())
    }

    /// Shows all rows with the measured values.
    fn show<E: From<Failure> + From<LeastSquaresError>>(
        &self,
        done: &Done,
        visit: &mut Visit<'_>,
    ) -> Result<(), E> {
        if let Some(table) = &self.kept {
            self.show_unknown(table, &self.measured, visit)?;
            done.add(self.data.samples());
            return Ok(());
        }
        let n = self.model.base.len();
        let mut row = 0;
        self.blocks::<E>(&mut |w| {
            let rows = w.len() / n;
            self.show_unknown(w, &self.measured[row..row + rows], visit)?;
            row += rows;
            done.add(rows / self.model.drives().len().max(1));
            Ok(())
        })
    }

    /// Shows rows of the unknown columns, with what the known ones make taken off the measured values.
    fn show_unknown(
        &self,
        w: &[f64],
        measured: &[f64],
        visit: &mut Visit<'_>,
    ) -> Result<(), LeastSquaresError> {
        if self.known.is_empty() {
            return visit(w, measured);
        }
        let mut rows = Vec::with_capacity(measured.len() * self.unknown.len());
        let mut rest = Vec::with_capacity(measured.len());
        for (row, y) in w.chunks_exact(self.model.base.len()).zip(measured) {
            rows.extend(self.unknown.iter().map(|k| row[*k]));
            rest.push(y - self.known.iter().map(|(k, p)| row[*k] * p).sum::<f64>());
        }
        visit(&rows, &rest)
    }

    /// Blocks of the regressor, row by row.
    fn blocks<E: From<Failure>>(
        &self,
        visit: &mut dyn FnMut(&[f64]) -> Result<(), E>,
    ) -> Result<(), E> {
        let evaluator = Evaluator::new(&self.model.derivation);
        let mut rows = Vec::new();
        self.data.for_each_block(self.model, |states| {
            let matrix = match evaluator.regressor(states) {
                Ok(matrix) => matrix,
                Err(fault) => return Ok(Err(fault)),
            };
            rows.clear();
            for i in 0..matrix.nrows() {
                rows.extend((0..matrix.ncols()).map(|j| matrix[(i, j)]));
            }
            visit(&rows)?;
            Ok(Ok(()))
        })
    }
}
