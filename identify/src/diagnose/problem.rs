//! What a diagnosis starts from: measured forces, the columns that the model has, and those that effects would add.

use nalgebra::DMatrix;

use super::body::AttachedBody;
use super::column::ForceColumn;
use super::constant::ConstantCorrection;
use super::disturbance::Disturbance;
use super::laws::LawSite;
use super::tilt::TiltCandidate;

/// A stretch of samples that follow each other in time.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleSegment {
    /// The recording it comes from.
    pub name: String,
    /// Number of samples.
    pub samples: usize,
    /// Mean time between them, s.
    pub step: f64,
    /// Time between samples as recorded, before any were left out, s.
    pub recorded_step: f64,
    /// Whether it belongs to the check.
    pub is_check: bool,
}

/// Channels and stretches of time, those of the fit first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SampleLayout {
    /// Names of the drives.
    pub channels: Vec<String>,
    /// Stretches in the order in which columns hold them.
    pub segments: Vec<SampleSegment>,
    /// Forces that were not measured, `[channel][sample]`: what stands in their place has no say. Empty if all were.
    pub left_out: Vec<Vec<bool>>,
}

/// Blocks that even a short stretch is cut into.
const FEWEST_BLOCKS: usize = 6;

impl SampleLayout {
    /// Samples of each channel.
    pub fn samples(&self) -> usize {
        self.segments.iter().map(|s| s.samples).sum()
    }

    /// Samples of the fit, which come first.
    pub fn fit_samples(&self) -> usize {
        let fit = self.segments.iter().filter(|s| !s.is_check);
        fit.map(|s| s.samples).sum()
    }

    /// Whether there is a recording to check on.
    pub fn has_check(&self) -> bool {
        self.fit_samples() < self.samples()
    }

    /// Contiguous blocks, about `per_stretch` in each stretch, as ranges of samples.
    pub fn blocks(&self, per_stretch: usize) -> Vec<std::ops::Range<usize>> {
        let mut blocks = Vec::new();
        let mut start = 0;
        for stretch in &self.segments {
            // Of a short stretch a few short ones: of one block nothing is learned.
            let count = per_stretch
                .min((stretch.samples / 20).max(FEWEST_BLOCKS))
                .min(stretch.samples)
                .max(1);
            for k in 0..count {
                let at = |k: usize| start + k * stretch.samples / count;
                blocks.push(at(k)..at(k + 1));
            }
            start += stretch.samples;
        }
        blocks
    }
}

/// A kind of effect at its places, which share the parameters.
#[derive(Clone, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct LocatedEffect {
    /// Name of the kind.
    pub kind: String,
    /// Where it acts.
    pub at: Vec<String>,
}

/// The sign that an estimate must have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignConstraint {
    /// Not below zero.
    Positive,
    /// Not above zero.
    Negative,
    /// Either.
    Any,
}

/// A parameter of an effect.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectParameter {
    /// Its symbol in the kind.
    pub symbol: String,
    /// SI unit.
    pub unit: String,
    /// The sign that makes physical sense.
    pub sign: SignConstraint,
}

/// The columns of an effect for one choice of its constants.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnChoice {
    /// Constants that are searched for, with their values.
    pub constants: Vec<(String, f64)>,
    /// A column for each parameter.
    pub columns: Vec<ForceColumn>,
}

/// Where the columns of an effect come from.
#[derive(Clone, Debug, PartialEq)]
pub enum ColumnSource {
    /// They are known, for each choice of the constants.
    Columns(Vec<ColumnChoice>),
    /// The base does not stand level; the parameters are angles, rad.
    Tilt(TiltCandidate),
    /// Forces are not read as they act.
    ReadingFault(ForceReadingFault),
    /// A further body on one that the model has.
    Body(AttachedBody),
    /// A number of the model is off; the parameter is by how much.
    Constant(ConstantCorrection),
    /// They depend on what the drives carry, which the fit says: see [`ColumnProvider::load_dependent_columns`].
    LoadDependent,
}

/// A way in which forces are read wrongly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadingFaultKind {
    /// Later than they act; the parameter is the delay, s.
    Delayed,
    /// Through a low-pass of first order; the parameter is its time constant, s.
    LowPassed,
    /// Larger than they are; the parameter is the part by which they are.
    Scaled,
}

/// What reads forces wrongly, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForceReadingFault {
    /// How.
    pub kind: ReadingFaultKind,
    /// The channel; `None` for all of them alike.
    pub channel: Option<usize>,
}

/// What it means for the model that a candidate is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CandidateNature {
    /// The model lacks it.
    Effect,
    /// The recordings have it, and the model lacks nothing by that.
    Disturbance,
}

/// Which candidates that depend on what the drives carry are asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadDependentQuery {
    /// All, with one value of each constant.
    All,
    /// One, with a value of its constant if it has one.
    One(usize, Option<f64>),
}

/// Columns that are made while the search goes on.
pub trait ColumnProvider {
    /// Columns of a candidate for another value of the constant that is searched for, if they can be had.
    fn columns_for_constant(&self, candidate: usize, constant: f64) -> Option<Vec<ForceColumn>>;

    /// Columns of candidates that depend on what the drives carry.
    fn load_dependent_columns(
        &self,
        load: &ForceColumn,
        which: LoadDependentQuery,
    ) -> Vec<(usize, ColumnChoice)>;

    /// Places on which laws that no library holds may act; asked where something stays unexplained.
    fn sites(&self) -> Vec<LawSite> {
        Vec::new()
    }
}

/// For problems in which all columns are known from the start.
pub struct NoColumnProvider;

impl ColumnProvider for NoColumnProvider {
    fn columns_for_constant(&self, _: usize, _: f64) -> Option<Vec<ForceColumn>> {
        None
    }

    fn load_dependent_columns(
        &self,
        _: &ForceColumn,
        _: LoadDependentQuery,
    ) -> Vec<(usize, ColumnChoice)> {
        Vec::new()
    }
}

/// An effect that may be missing.
#[derive(Clone, Debug, PartialEq)]
pub struct CandidateEffect {
    /// What and where.
    pub effect: LocatedEffect,
    /// Its parameters, one for each column.
    pub parameters: Vec<EffectParameter>,
    /// Constants that are searched for; they count as parameters.
    pub searched_constants: usize,
    /// Whether what it adds is part of what the drives carry: masses and weight, rather than friction.
    pub is_part_of_load: bool,
    /// A simpler kind that it holds as a special case and that comes before it.
    pub refines: Option<String>,
    /// Whether the model lacks it or the recordings have it.
    pub nature: CandidateNature,
    /// Whether each recording has parameters of its own, so that one cannot speak for another.
    pub is_per_run: bool,
    /// Its columns.
    pub source: ColumnSource,
}

/// Everything that a diagnosis needs to know.
#[derive(Clone, Debug, Default)]
pub struct DiagnosisProblem {
    /// Channels and stretches.
    pub layout: SampleLayout,
    /// Measured forces, without those that are known.
    pub measured: ForceColumn,
    /// Forces of the parameters that are held, if any are; already taken off `measured`.
    pub fixed_forces: Option<ForceColumn>,
    /// Columns of the parameters that are free.
    pub base: Vec<ForceColumn>,
    /// What is known of these parameters beforehand, beside that zero is expected: the inverse of their covariance. Without it
    /// they are free.
    pub prior: Option<DMatrix<f64>>,
    /// Which of them are part of what the drives carry.
    pub base_is_part_of_load: Vec<bool>,
    /// Friction of every drive by itself, beside which the load is estimated.
    pub friction: Vec<ForceColumn>,
    /// What may be missing.
    pub candidates: Vec<CandidateEffect>,
    /// Variables on which forces may depend, by name: positions, rates, accelerations, loads; one number per sample.
    pub variables: Vec<(String, Vec<f64>)>,
    /// White noise of each channel's force; that of idle channels is found by a diagnosis.
    pub noise: Vec<f64>,
    /// Channels of which no force is read, since nothing drives there; empty where all are read.
    pub idle: Vec<bool>,
    /// Samples that say nothing of the model, as those of a push, `[channel][sample]`; empty where all count.
    pub left_out: Vec<Vec<bool>>,
    /// Samples next to reversals, which do not decide but count in figures, `[channel][sample]`; a diagnosis finds them.
    pub jumps: Vec<Vec<bool>>,
    /// Squares per sample that were taken off each channel before, since they do not repeat with the state.
    pub removed: Vec<f64>,
    /// What is known to be wrong with the recordings.
    pub disturbances: Vec<Disturbance>,
    /// Whether only verdict, steps and effects are asked for: no laws, no doubles, and nothing of what was refused.
    pub effects_only: bool,
}

impl DiagnosisProblem {
    /// What was asked, without the columns: they take most of the memory, and nobody needs them once a diagnosis is made.
    #[must_use]
    pub fn without_columns(mut self) -> Self {
        for candidate in &mut self.candidates {
            candidate.source = ColumnSource::Columns(Vec::new());
        }
        Self {
            measured: ForceColumn::default(),
            fixed_forces: None,
            base: Vec::new(),
            friction: Vec::new(),
            variables: Vec::new(),
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a single block no spread over blocks can be had.
    #[test]
    fn a_short_stretch_has_several_blocks() {
        let stretch = |samples| SampleSegment {
            name: String::new(),
            samples,
            step: 0.01,
            recorded_step: 0.01,
            is_check: false,
        };
        for (samples, blocks) in [(30, 6), (90, 6), (200, 10), (5000, 12), (3, 3)] {
            let layout = SampleLayout {
                channels: Vec::new(),
                segments: vec![stretch(samples)],
                left_out: Vec::new(),
            };
            let cut = layout.blocks(12);
            assert_eq!(cut.len(), blocks);
            assert!(cut.windows(2).all(|pair| pair[0].end == pair[1].start));
            assert_eq!((cut[0].start, cut[blocks - 1].end), (0, samples));
        }
    }
}
