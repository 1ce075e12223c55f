//! Rows of a run: the base columns, and those of everything that may have changed.

use modelmill_codegen::Evaluator;
use modelmill_identify::changes::{Coloured, Moments};
use modelmill_identify::diagnose::Column;
use nalgebra::DVector;

use crate::along::{self, decimated, measured};
use crate::diagnose::numbers::regressor;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::Recording;
use crate::runs::payload::{Payloads, TEN};
use crate::stretch::Stretch;

/// Blocks of a run that decide for each other.
const BLOCKS: usize = 5;
/// Rounds of weighing the drives by what is left.
const ROUNDS: usize = 2;
/// Noise that every run is taken to have besides, as a part of a drive's effective force: no model is better.
const FLOOR: f64 = 1e-3;
/// The part by which a clock, and the rad or m by which an encoder is turned to see what that does.
const TURNED: f64 = 1e-3;

/// Where columns stand.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    pub(crate) base: usize,
    pub(crate) payloads: usize,
    pub(crate) drives: usize,
    pub(crate) coordinates: usize,
}

impl Layout {
    pub(crate) fn new(model: &Model, payloads: &Payloads) -> Self {
        Self {
            base: (0..model.base.len())
                .filter(|k| !model.is_known(*k))
                .count(),
            payloads: payloads.frames.len(),
            drives: model.drives().len(),
            coordinates: model.active().len(),
        }
    }

    pub(crate) fn payload(self, frame: usize) -> usize {
        self.base + TEN * frame
    }

    /// Dry friction of a drive, then viscous friction.
    pub(crate) fn friction(self, drive: usize) -> usize {
        self.payload(self.payloads) + 2 * drive
    }

    pub(crate) fn offset(self, drive: usize) -> usize {
        self.friction(self.drives) + drive
    }

    pub(crate) fn scale(self, drive: usize) -> usize {
        self.offset(self.drives) + drive
    }

    pub(crate) fn clock(self) -> usize {
        self.scale(self.drives)
    }

    /// The zero of a coordinate's encoder.
    pub(crate) fn zero(self, coordinate: usize) -> usize {
        self.clock() + 1 + coordinate
    }

    pub(crate) fn total(self) -> usize {
        self.zero(self.coordinates)
    }
}

/// The rows of one run.
pub(crate) struct Rows {
    layout: Layout,
    stretches: Vec<Laid>,
    /// Base parameters on which scales and clocks are built: those of the first run.
    pub(crate) values: DVector<f64>,
}

/// The rows of one stretch, drive by drive.
struct Laid {
    columns: Vec<Column>,
    /// Measured forces less those of known parameters, `[drive][sample]`.
    forces: Vec<Vec<f64>>,
    /// Which of them count.
    counts: Vec<Vec<bool>>,
}

/// A run whose rows are white: what it says, block by block.
pub(crate) struct White {
    pub(crate) layout: Layout,
    pub(crate) blocks: Vec<Moments>,
}

impl White {
    fn base_columns(&self) -> Vec<usize> {
        (0..self.layout.base).collect()
    }

    /// All blocks, of the base columns alone.
    pub(crate) fn base(&self) -> Moments {
        let mut all = Moments::new(self.layout.base);
        for block in &self.blocks {
            all.merge(&block.of(&self.base_columns()));
        }
        all
    }
}

impl Rows {
    /// The rows of a recording; `values` are base parameters of the run before, in whose place come those of this run where there
    /// is none before.
    pub(crate) fn new(
        model: &Model,
        recording: &Recording,
        payloads: &Payloads,
        values: Option<&DVector<f64>>,
    ) -> Outcome<Self> {
        let layout = Layout::new(model, payloads);
        let mut rows = Self {
            layout,
            stretches: Vec::new(),
            values: DVector::zeros(layout.base),
        };
        for stretch in &recording.stretches {
            rows.stretches.push(laid(model, stretch, payloads, layout)?);
        }
        rows.values = match values {
            Some(values) => values.clone(),
            None => rows.weighed(&(0..layout.base).collect::<Vec<usize>>())?,
        };
        for (stretch, laid) in recording.stretches.iter().zip(&mut rows.stretches) {
            let mut further = of_prediction(model, stretch, laid, &rows.values)?;
            for column in &mut further {
                leave_out(column, &laid.counts);
            }
            laid.columns.extend(further);
        }
        Ok(rows)
    }

    /// Least squares for some columns with every drive weighed by what is left on it: their values.
    fn weighed(&self, columns: &[usize]) -> Outcome<DVector<f64>> {
        let drives = 0..self.layout.drives;
        let mut deviations: Vec<f64> = drives.clone().map(|d| self.size(d, None)).collect();
        let mut values = DVector::zeros(columns.len());
        for _ in 0..=ROUNDS {
            let mut all = Moments::new(columns.len());
            for drive in drives.clone().filter(|d| deviations[*d] > 0.0) {
                let mut one = Moments::new(columns.len());
                for laid in &self.stretches {
                    let z: Vec<Option<&[f64]>> =
                        columns.iter().map(|k| laid.column(*k, drive)).collect();
                    one.add_rows(&z, &laid.forces[drive]);
                }
                let weight = deviations[drive].powi(-2);
                one.gram *= weight;
                one.rhs *= weight;
                one.total *= weight;
                all.merge(&one);
            }
            values = all.solve().values;
            let floors: Vec<f64> = drives.clone().map(|d| 1e-9 * self.size(d, None)).collect();
            deviations = drives
                .clone()
                .map(|d| self.size(d, Some((columns, &values))).max(floors[d]))
                .collect();
        }
        if values.iter().any(|x| !x.is_finite()) {
            return Err(Error::input(
                "a run has numbers that are too large to be fitted; look at its units".to_owned(),
            ));
        }
        Ok(values)
    }

    /// Effective value of a drive's force, or of what a solution leaves of it.
    fn size(&self, drive: usize, solution: Option<(&[usize], &DVector<f64>)>) -> f64 {
        let mut n = 0;
        let mut sum = 0.0;
        for laid in &self.stretches {
            let rest = laid.rest(drive, solution);
            n += rest.len();
            sum += rest.iter().map(|x| x * x).sum::<f64>();
        }
        (sum / n.max(1) as f64).sqrt()
    }

    /// How large the force of some columns is on the drive where it is largest, as a part of what that drive does.
    pub(crate) fn part(&self, columns: &[usize], values: &DVector<f64>) -> f64 {
        let of_drive = |drive: usize| {
            let mut sum = 0.0;
            for laid in &self.stretches {
                let mut force = vec![0.0; laid.samples()];
                for (k, value) in columns.iter().zip(values.iter()) {
                    for (f, z) in force
                        .iter_mut()
                        .zip(laid.column(*k, drive).unwrap_or_default())
                    {
                        *f += value * z;
                    }
                }
                sum += force.iter().map(|f| f * f).sum::<f64>();
            }
            let samples: usize = self.stretches.iter().map(Laid::samples).sum();
            let size = self.size(drive, None);
            if size > 0.0 {
                (sum / samples as f64).sqrt() / size
            } else {
                0.0
            }
        };
        (0..self.layout.drives).map(of_drive).fold(0.0, f64::max)
    }

    /// The force of some columns along all stretches, one after the other.
    pub(crate) fn force(&self, columns: &[usize], values: &DVector<f64>) -> Column {
        let of_drive = |drive: usize| {
            let of_stretch = |laid: &Laid| {
                let mut force = vec![0.0; laid.samples()];
                for (k, value) in columns.iter().zip(values.iter()) {
                    let column = laid.column(*k, drive).unwrap_or_default();
                    for (f, z) in force.iter_mut().zip(column) {
                        *f += value * z;
                    }
                }
                force
            };
            self.stretches.iter().flat_map(of_stretch).collect()
        };
        Column::new((0..self.layout.drives).map(of_drive).collect())
    }

    /// The rows with the memory of each drive's noise taken out, as sums.
    pub(crate) fn white(&self) -> Outcome<White> {
        let n = self.layout.total();
        let used: Vec<usize> = (0..n).collect();
        let values = self.weighed(&used)?;
        let mut blocks = vec![Moments::new(n); BLOCKS];
        let length: usize = self.stretches.iter().map(Laid::samples).sum();
        for drive in 0..self.layout.drives {
            let rests: Vec<Vec<f64>> = (self.stretches.iter())
                .map(|laid| laid.rest(drive, Some((&used, &values))))
                .collect();
            let pieces: Vec<(usize, std::ops::Range<usize>)> = (self.stretches.iter().enumerate())
                .flat_map(|(s, laid)| laid.pieces(drive).into_iter().map(move |piece| (s, piece)))
                .collect();
            let parts: Vec<&[f64]> = pieces
                .iter()
                .map(|(s, piece)| &rests[*s][piece.clone()])
                .collect();
            let noise = Coloured::of(&parts, FLOOR * self.size(drive, None));
            if noise.deviation == 0.0 {
                continue;
            }
            let mut before = 0;
            let mut last = 0;
            for (s, piece) in pieces {
                if s != last {
                    before += (last..s)
                        .map(|k| self.stretches[k].samples())
                        .sum::<usize>();
                    last = s;
                }
                let laid = &self.stretches[s];
                let white = |values: &[f64]| noise.whitened(&values[piece.clone()]);
                let y = white(&laid.forces[drive]);
                let z: Vec<Option<Vec<f64>>> = used
                    .iter()
                    .map(|k| laid.column(*k, drive).map(white))
                    .collect();
                // Neighbouring blocks, each of a fifth of the run.
                let block_of = |i: usize| {
                    (BLOCKS * (before + piece.start + i) / length.max(1)).min(BLOCKS - 1)
                };
                let mut start = 0;
                while start < y.len() {
                    let block = block_of(start);
                    let end = (start..y.len())
                        .find(|i| block_of(*i) != block)
                        .unwrap_or(y.len());
                    let cut: Vec<Option<&[f64]>> = z
                        .iter()
                        .map(|c| c.as_ref().map(|c| &c[start..end]))
                        .collect();
                    blocks[block].add_rows(&cut, &y[start..end]);
                    start = end;
                }
            }
        }
        Ok(White {
            layout: self.layout,
            blocks,
        })
    }
}

impl Laid {
    fn samples(&self) -> usize {
        self.forces.first().map_or(0, Vec::len)
    }

    fn column(&self, k: usize, drive: usize) -> Option<&[f64]> {
        self.columns.get(k)?.0.get(drive)?.as_deref()
    }

    /// What a solution leaves of a drive's force.
    fn rest(&self, drive: usize, solution: Option<(&[usize], &DVector<f64>)>) -> Vec<f64> {
        let mut rest = self.forces[drive].clone();
        for (k, value) in solution
            .into_iter()
            .flat_map(|(c, x)| c.iter().zip(x.iter()))
        {
            for (r, z) in rest
                .iter_mut()
                .zip(self.column(*k, drive).unwrap_or_default())
            {
                *r -= value * z;
            }
        }
        rest
    }

    /// Stretches of samples that count.
    fn pieces(&self, drive: usize) -> Vec<std::ops::Range<usize>> {
        let counts = &self.counts[drive];
        let mut pieces = Vec::new();
        let mut start = 0;
        for end in 0..=counts.len() {
            if end == counts.len() || !counts[end] {
                if end > start {
                    pieces.push(start..end);
                }
                start = end + 1;
            }
        }
        pieces
    }
}

/// Puts 0 where a sample does not count.
fn silence(values: &mut [f64], counts: &[bool]) {
    for (value, _) in values
        .iter_mut()
        .zip(counts)
        .filter(|(_, counts)| !**counts)
    {
        *value = 0.0;
    }
}

/// A column without the samples that do not count.
fn leave_out(column: &mut Column, counts: &[Vec<bool>]) {
    for (values, counts) in column.0.iter_mut().zip(counts) {
        if let Some(values) = values {
            silence(values, counts);
        }
    }
}

/// All columns of a stretch but those that are built on predicted forces.
fn laid(model: &Model, stretch: &Stretch, payloads: &Payloads, layout: Layout) -> Outcome<Laid> {
    let runs = [(stretch, false)];
    let base = regressor(&runs, &Evaluator::new(&model.derivation), model)?;
    let mut forces = measured(stretch)?;
    let mut columns = Vec::with_capacity(layout.total());
    for (k, column) in base.into_iter().enumerate() {
        if model.is_known(k) {
            for (force, known) in forces.iter_mut().zip(&column.0) {
                for (f, x) in force.iter_mut().zip(known.iter().flatten()) {
                    *f -= model.nominal[k] * x;
                }
            }
        } else {
            columns.push(column);
        }
    }
    let of_payloads = regressor(&runs, &Evaluator::new(&payloads.derivation), model)?;
    for ten in &payloads.columns {
        columns.extend(ten.map(|k| k.map(|k| of_payloads[k].clone()).unwrap_or_default()));
    }
    let evaluator = Evaluator::new(&model.derivation);
    let motion = along::columns(model, stretch, |states| evaluator.drives(states))?;
    let n = layout.drives;
    let only = |drive: usize, values: Vec<f64>| {
        let mut column = Column(vec![None; n]);
        column.0[drive] = Some(values);
        column
    };
    for drive in 0..n {
        let rate = motion[n + drive].clone();
        let sign = rate
            .iter()
            .map(|x| if *x == 0.0 { 0.0 } else { x.signum() })
            .collect();
        for values in decimated(vec![sign, rate], stretch)? {
            columns.push(only(drive, values));
        }
    }
    let samples = forces.first().map_or(0, Vec::len);
    columns.extend((0..n).map(|drive| only(drive, vec![1.0; samples])));
    // A kept sample has heard of all that its filter saw.
    let every = stretch.decimation();
    let hears_of_faults = |drive: usize, i: usize| {
        let Some(out) = stretch.run.left_out.get(drive) else {
            return false;
        };
        let around = (every * i).saturating_sub(every)..(every * (i + 1) + 1).min(out.len());
        out[around].contains(&true)
    };
    let counts = |drive: usize| -> Vec<bool> {
        let weighs = |i: usize| {
            let weights = stretch.weights.as_ref();
            weights.is_none_or(|weights| weights[i * n + drive] > 0.0)
        };
        (0..samples)
            .map(|i| weighs(i) && !hears_of_faults(drive, i))
            .collect()
    };
    let counts: Vec<Vec<bool>> = (0..n).map(counts).collect();
    for (force, counts) in forces.iter_mut().zip(&counts) {
        silence(force, counts);
    }
    for column in &mut columns {
        leave_out(column, &counts);
    }
    Ok(Laid {
        columns,
        forces,
        counts,
    })
}

/// Columns that are built on predicted forces: a scale of each drive; a clock that runs by a part slower, so that rates and
/// accelerations come out larger by once and twice that part; and each encoder with another zero.
fn of_prediction(
    model: &Model,
    stretch: &Stretch,
    laid: &Laid,
    values: &DVector<f64>,
) -> Outcome<Vec<Column>> {
    let n = laid.forces.len();
    let mut columns = Vec::new();
    let of_base: Vec<usize> = (0..values.len()).collect();
    for drive in 0..n {
        let rest = laid.rest(drive, Some((&of_base, values)));
        let mut column = Column(vec![None; n]);
        let pairs = laid.forces[drive].iter().zip(&rest);
        column.0[drive] = Some(pairs.map(|(y, r)| y - r).collect());
        columns.push(column);
    }
    let mut next = values.iter();
    let all: Vec<f64> = (0..model.base.len())
        .map(|k| {
            if model.is_known(k) {
                model.nominal[k]
            } else {
                next.next().copied().unwrap_or(0.0)
            }
        })
        .collect();
    let forces = |turned: &Stretch| {
        along::forces(model, turned, &all).and_then(|forces| decimated(forces, stretch))
    };
    // Central differences.
    let slope = |turn: &dyn Fn(&mut Stretch, f64)| -> Outcome<Column> {
        let [ahead, back] = [TURNED, -TURNED].map(|by| {
            let mut turned = stretch.clone();
            turn(&mut turned, by);
            forces(&turned)
        });
        let pairs = ahead?.into_iter().zip(back?);
        let of_drive = |(a, b): (Vec<f64>, Vec<f64>)| -> Vec<f64> {
            a.iter()
                .zip(&b)
                .map(|(a, b)| (a - b) / (2.0 * TURNED))
                .collect()
        };
        Ok(Column::new(pairs.map(of_drive).collect()))
    };
    let scaled = |values: &mut [Vec<f64>], factor: f64| {
        for x in values.iter_mut().flatten() {
            *x *= factor;
        }
    };
    columns.push(slope(&|turned, part| {
        scaled(&mut turned.run.qd, 1.0 + part);
        scaled(&mut turned.run.qdd, (1.0 + part).powi(2));
    })?);
    for coordinate in 0..stretch.run.q.len() {
        columns.push(slope(&|turned, by| {
            for q in &mut turned.run.q[coordinate] {
                *q += by;
            }
        })?);
    }
    Ok(columns)
}
