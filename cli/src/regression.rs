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

/// Numbers of the regressor that are kept between passes: 256 MB.
const KEPT: usize = 1 << 25;

/// What least squares found.
pub(crate) struct Identified {
    /// The solution.
    pub(crate) solution: Solution,
    /// What it is worth.
    pub(crate) deviations: Deviations,
}

/// Identifies the base parameters of a model from recordings, eq. (12).
pub(crate) fn identify(model: &Model, data: &[Data]) -> Outcome<Identified> {
    if model.base.is_empty() {
        return Err(Failure::Input(format!(
            "{}: no parameter has an effect on the drives, so there is nothing to identify",
            model.path
        )));
    }
    let samples: usize = data.iter().map(Data::samples).sum();
    let mut runs = data
        .iter()
        .map(|one| Rows::new(model, one))
        .collect::<Outcome<Vec<Rows<'_>>>>()?;
    // One pass for the solution, two for the deviations.
    watched("identifying", 3 * samples, |done| {
        let mut regression = LeastSquares::new(model.base.len());
        for run in &mut runs {
            run.keep_if_small(done)?;
            run.show::<Failure>(done, &mut |w, y| regression.add_rows(w, y))?;
        }
        let solution = regression.solve_near(&model.nominal)?;
        let deviations = autocorrelated(&solution, model.drives().len(), |visit| {
            for run in &runs {
                run.show::<Failure>(done, visit)?;
            }
            Ok::<(), Failure>(())
        })?;
        Ok(Identified {
            solution,
            deviations,
        })
    })
}

/// The rows of one recording.
struct Rows<'a> {
    model: &'a Model,
    data: &'a Data,
    /// Interleaved per sample, decimated.
    measured: Vec<f64>,
    kept: Option<Vec<f64>>,
}

impl<'a> Rows<'a> {
    fn new(model: &'a Model, data: &'a Data) -> Outcome<Self> {
        Ok(Self {
            model,
            data,
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
            visit(table, &self.measured)?;
            done.add(self.data.samples());
            return Ok(());
        }
        let n = self.model.base.len();
        let mut row = 0;
        self.blocks::<E>(&mut |w| {
            let rows = w.len() / n;
            visit(w, &self.measured[row..row + rows])?;
            row += rows;
            done.add(rows / self.model.drives().len().max(1));
            Ok(())
        })
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
