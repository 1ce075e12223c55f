//! A run as sums over its rows. Rows are computed piece by piece, so that memory is needed only for its states and
//! for one piece of its columns.

use std::ops::Range;

use modelmill_identify::LeastSquares;
use modelmill_identify::changes::{AutoregressiveNoise, NormalEquations};
use nalgebra::DVector;

use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::runs::columns::{SegmentRows, TimeScaling};
use crate::runs::layout::RunColumnLayout;
use crate::runs::payload::PayloadColumns;
use crate::runs::thresholds::NOISE_FLOOR_SHARE;
use crate::segment::RecordingSegment;

/// Number of blocks of a run for cross-validation.
pub(crate) const BLOCKS: usize = 8;
/// Number of iterations of the weights from residuals.
const ROUNDS: usize = 2;
/// Largest number of samples of a piece, after decimation.
const PIECE: usize = 4096;
/// Runs of up to this many pieces keep their columns; longer ones compute them again in each pass.
const KEPT: usize = 2;

/// The rows of one run.
pub(crate) struct RunRows<'a> {
    /// The model.
    model: &'a Model,
    /// Columns of loads.
    payloads: &'a PayloadColumns,
    /// The segments in pieces.
    pieces: Vec<RecordingSegment>,
    /// The derivatives of each coordinate that depend on the clock.
    scaling: Vec<TimeScaling>,
    /// Columns of all pieces, if they are kept.
    kept: Option<Vec<SegmentRows>>,
    /// Base parameters with which the columns of scales and clocks are computed: those of the first run.
    pub(crate) values: DVector<f64>,
    /// Sums over the rows of each drive as measured.
    sums: Vec<NormalEquations>,
}

/// Sums over white rows of a run.
pub(crate) struct WhitenedRun {
    /// Block by block, over all drives.
    pub(crate) blocks: Vec<NormalEquations>,
    /// Drive by drive, over the complete run.
    pub(crate) drives: Vec<NormalEquations>,
    /// The base columns alone, over all drives, as an R factor, which keeps the digits that sums of products lose.
    pub(crate) base: LeastSquares,
}

impl WhitenedRun {
    /// Sums over the complete run.
    pub(crate) fn total(&self) -> NormalEquations {
        let mut whole = NormalEquations::new(self.blocks[0].rhs.len());
        for block in &self.blocks {
            whole.merge(block);
        }
        whole
    }
}

impl<'a> RunRows<'a> {
    /// The rows of segments. `values` are the base parameters of the first run; `None` for the first run, which
    /// uses its own.
    ///
    /// Fails when a pose has no solution, a force was not measured, or values are too large for a fit.
    pub(crate) fn new(
        model: &'a Model,
        segments: &[RecordingSegment],
        payloads: &'a PayloadColumns,
        scaling: &[TimeScaling],
        values: Option<&DVector<f64>>,
    ) -> Outcome<Self> {
        let layout = RunColumnLayout::new(model, payloads);
        let pieces: Vec<RecordingSegment> = (segments.iter()).flat_map(|stretch| stretch.pieces(PIECE)).collect();
        // The first run is fitted with its base columns alone.
        let values = match values {
            Some(values) => values.clone(),
            None => {
                let mut sums = vec![NormalEquations::new(layout.base); layout.drives];
                for piece in &pieces {
                    add_rows(&mut sums, &SegmentRows::base_columns(model, piece)?);
                }
                weighted_least_squares(&sums)?
            }
        };
        let mut rows = Self {
            model,
            payloads,
            pieces,
            scaling: scaling.to_vec(),
            kept: None,
            values,
            sums: Vec::new(),
        };
        if rows.pieces.len() <= KEPT {
            let laid = rows.pieces.iter().map(|piece| rows.segment_rows(piece));
            rows.kept = Some(laid.collect::<Outcome<_>>()?);
        }
        // The sums over all columns need one pass over the pieces.
        let mut sums = vec![NormalEquations::new(layout.total()); layout.drives];
        rows.visit(|laid| {
            add_rows(&mut sums, laid);
            Ok(())
        })?;
        rows.sums = sums;
        Ok(rows)
    }

    /// All columns of a piece.
    fn segment_rows(&self, piece: &RecordingSegment) -> Outcome<SegmentRows> {
        SegmentRows::all_columns(self.model, piece, self.payloads, &self.values, &self.scaling)
    }

    /// Calls `look` with the columns of each piece.
    fn visit(&self, mut look: impl FnMut(&SegmentRows) -> Outcome) -> Outcome {
        match &self.kept {
            Some(kept) => kept.iter().try_for_each(look),
            None => (self.pieces.iter()).try_for_each(|piece| look(&self.segment_rows(piece)?)),
        }
    }

    /// Sums over the rows as measured.
    pub(crate) fn sizes(self) -> MeasuredMoments {
        MeasuredMoments(self.sums)
    }

    /// The force of some columns along the run, drive by drive, N or N m.
    pub(crate) fn force(&self, columns: &[usize], values: &DVector<f64>) -> Outcome<Vec<Vec<f64>>> {
        let mut forces: Vec<Vec<f64>> = vec![Vec::new(); self.sums.len()];
        self.visit(|laid| {
            for (drive, all) in forces.iter_mut().enumerate() {
                let start = all.len();
                all.resize(start + laid.samples(), 0.0);
                for (k, value) in columns.iter().zip(values.iter()) {
                    let column = laid.column(*k, drive).unwrap_or_default();
                    for (f, z) in all[start..].iter_mut().zip(column) {
                        *f += value * z;
                    }
                }
            }
            Ok(())
        })?;
        Ok(forces)
    }

    /// Sums over the rows after a filter that whitens each drive's noise.
    ///
    /// Fails when values are too large for a fit.
    pub(crate) fn whitened_run(&self) -> Outcome<WhitenedRun> {
        let layout = RunColumnLayout::new(self.model, self.payloads);
        let columns = layout.total();
        // Stage 1: the residual of each drive, in ranges without gaps.
        let values = weighted_least_squares(&self.sums)?;
        let mut rests: Vec<Vec<Vec<f64>>> = vec![Vec::new(); self.sums.len()];
        self.visit(|laid| {
            for (drive, rests) in rests.iter_mut().enumerate() {
                let rest = laid.residual(drive, &values);
                rests.extend(laid.pieces(drive).into_iter().map(|some| rest[some].to_vec()));
            }
            Ok(())
        })?;
        // Stage 2: an autoregressive model of each drive's residual.
        let noise = |(rests, sums): (&Vec<Vec<f64>>, &NormalEquations)| {
            let rests: Vec<&[f64]> = rests.iter().map(Vec::as_slice).collect();
            AutoregressiveNoise::from_residual(&rests, NOISE_FLOOR_SHARE * effective_value(sums, sums.total))
        };
        let noise: Vec<AutoregressiveNoise> = rests.iter().zip(&self.sums).map(noise).collect();
        let length: usize = (self.pieces.iter())
            .map(|piece| piece.samples().div_ceil(piece.decimation()))
            .sum();
        // Stage 3: sums over the filtered rows.
        let mut white = WhitenedRun {
            blocks: vec![NormalEquations::new(columns); BLOCKS],
            drives: vec![NormalEquations::new(columns); self.sums.len()],
            base: LeastSquares::with_channels(layout.base, layout.drives),
        };
        let mut before = 0;
        let zeros = [0.0; TOGETHER];
        self.visit(|laid| {
            for (drive, noise) in noise.iter().enumerate().filter(|(_, n)| n.standard_deviation > 0.0) {
                // The filter restarts after each gap.
                for some in laid.pieces(drive) {
                    // Blocks are consecutive in time, the same part of the run for all drives.
                    let blocks = RowBlocks {
                        first: before + some.start,
                        length,
                    };
                    whiten(laid, drive, some, noise, columns, blocks, |block, z, y| {
                        let mut sums = NormalEquations::new(columns);
                        sums.add_rows(z, y);
                        white.blocks[block].merge(&sums);
                        white.drives[drive].merge(&sums);
                        let z = z[..layout.base].iter();
                        let z: Vec<&[f64]> = z.map(|column| column.unwrap_or(&zeros[..y.len()])).collect();
                        white.base.add_columns(drive, &z, y).map_err(|error| {
                            Error::input(format!("the rows of {}: {error}", drive_name(self.model, drive)))
                        })
                    })?;
                }
            }
            before += laid.samples();
            Ok(())
        })?;
        Ok(white)
    }
}

/// Sums over the rows of each drive as measured.
#[derive(Clone)]
pub(crate) struct MeasuredMoments(pub(crate) Vec<NormalEquations>);

impl MeasuredMoments {
    /// The relative residual of each drive with the best base parameters; `base` is the number of base columns,
    /// which come first.
    pub(crate) fn residual_ratios(&self, base: usize) -> Outcome<Vec<f64>> {
        let base: Vec<usize> = (0..base).collect();
        let sums: Vec<NormalEquations> = self.0.iter().map(|one| one.select_columns(&base)).collect();
        let values = weighted_least_squares(&sums)?;
        let part = |one: &NormalEquations| {
            if one.total > 0.0 {
                (one.residual_squares(&values) / one.total).sqrt()
            } else {
                0.0
            }
        };
        Ok(sums.iter().map(part).collect())
    }

    /// Shares of the forces that remain with the best values of some columns: base parameters, and effects of the drives
    /// that the model may lack. With as many columns as rows nothing remains, so that columns are counted.
    pub(crate) fn unexplained_shares(&self, columns: &[usize]) -> Outcome<UnexplainedShares> {
        let sums: Vec<NormalEquations> = self.0.iter().map(|one| one.select_columns(columns)).collect();
        let values = weighted_least_squares(&sums)?;
        let own = columns.len() as f64 / sums.len().max(1) as f64;
        let share = |one: &NormalEquations| {
            // A drive without force or without rows shows nothing.
            if one.total <= 0.0 {
                return 1.0;
            }
            let counted = one.rows as f64 / (one.rows as f64 - own).max(1.0);
            (counted * one.residual_squares(&values) / one.total).sqrt().min(1.0)
        };
        Ok(UnexplainedShares(sums.iter().map(share).collect()))
    }

    /// The rms force of some columns relative to the force of each drive.
    pub(crate) fn force_fractions(&self, columns: &[usize], values: &DVector<f64>) -> Vec<f64> {
        let of_drive = |sums: &NormalEquations| {
            let force = values.dot(&(sums.select_columns(columns).gram * values));
            if sums.total > 0.0 {
                (force.max(0.0) / sums.total).sqrt()
            } else {
                0.0
            }
        };
        self.0.iter().map(of_drive).collect()
    }
}

/// For each drive the share of its rms force that no parameters explain (1).
#[derive(Clone, Debug)]
pub(crate) struct UnexplainedShares(pub(crate) Vec<f64>);

/// The name of a drive.
fn drive_name(model: &Model, drive: usize) -> String {
    model.row_names()[drive].clone()
}

/// Number of rows that are processed at once.
const TOGETHER: usize = 256;

/// The blocks of consecutive rows of a range.
#[derive(Clone, Copy)]
struct RowBlocks {
    /// Index of the first row of the range within the run.
    first: usize,
    /// Number of rows of the run.
    length: usize,
}

impl RowBlocks {
    /// The block of a row of the range, and the first row of the range that belongs to a later block.
    fn find_block(self, row: usize) -> (usize, usize) {
        let length = self.length.max(1);
        let block = (BLOCKS * (self.first + row) / length).min(BLOCKS - 1);
        let end = ((block + 1) * length).div_ceil(BLOCKS);
        // The last block also has rows that rounding has left.
        let end = if block == BLOCKS - 1 { usize::MAX } else { end };
        (block, end.saturating_sub(self.first))
    }
}

/// Calls `show` with whitened rows of a range of samples, column by column, in groups of at most [`TOGETHER`] rows
/// that belong to one block, with the index of the block.
fn whiten(
    laid: &SegmentRows,
    drive: usize,
    some: Range<usize>,
    noise: &AutoregressiveNoise,
    columns: usize,
    blocks: RowBlocks,
    mut show: impl FnMut(usize, &[Option<&[f64]>], &[f64]) -> Outcome,
) -> Outcome {
    // The same filter is applied to force and columns.
    let white = |values: &[f64]| noise.whiten(&values[some.clone()]);
    let y = white(&laid.forces[drive]);
    let z: Vec<Option<Vec<f64>>> = (0..columns).map(|k| laid.column(k, drive).map(white)).collect();
    let mut start = 0;
    while start < y.len() {
        // The block is that of each row. With that of a group, a short run would lie in one block, and nothing would
        // remain when this is left out.
        let (block, block_end) = blocks.find_block(start);
        let rows = start..(start + TOGETHER).min(y.len()).min(block_end);
        start = rows.end;
        let z: Vec<Option<&[f64]>> = z
            .iter()
            .map(|column| column.as_ref().map(|column| &column[rows.clone()]))
            .collect();
        show(block, &z, &y[rows])?;
    }
    Ok(())
}

/// Adds the rows of a segment to the sums of each drive.
fn add_rows(sums: &mut [NormalEquations], laid: &SegmentRows) {
    for (drive, sums) in sums.iter_mut().enumerate() {
        let columns = 0..sums.rhs.len();
        let z: Vec<Option<&[f64]>> = columns.map(|k| laid.column(k, drive)).collect();
        sums.add_rows(&z, &laid.forces[drive]);
    }
}

/// The rms value over the rows of a drive, from a sum of squares.
fn effective_value(sums: &NormalEquations, squares: f64) -> f64 {
    (squares / sums.rows.max(1) as f64).sqrt()
}

/// Least squares with each drive weighted by its residual.
fn weighted_least_squares(sums: &[NormalEquations]) -> Outcome<DVector<f64>> {
    let mut deviations: Vec<f64> = sums.iter().map(|one| effective_value(one, one.total)).collect();
    let floors: Vec<f64> = deviations.iter().map(|size| 1e-6 * size).collect();
    let mut values = DVector::zeros(0);
    // Weights start from the forces and are then computed from the residuals.
    for _ in 0..=ROUNDS {
        let mut all = NormalEquations::new(sums.first().map_or(0, |one| one.rhs.len()));
        for (one, std) in sums.iter().zip(&deviations) {
            if *std > 0.0 {
                all.merge(&one.scale_weight(std.powi(-2)));
            }
        }
        values = all.solve().values;
        if values.iter().any(|x| !x.is_finite()) {
            return Err(Error::input(
                "a run has numbers that are too large for a fit; check its units".to_owned(),
            ));
        }
        let left = sums
            .iter()
            .map(|one| effective_value(one, one.residual_squares(&values)));
        deviations = left.zip(&floors).map(|(d, floor)| d.max(*floor)).collect();
    }
    Ok(values)
}
