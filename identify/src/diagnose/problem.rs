//! Input of a diagnosis: measured forces, the columns of the model, and the columns that candidate effects would add.

use nalgebra::DMatrix;

use super::body::AttachedBody;
use super::column::ForceColumn;
use super::constant::ConstantCorrection;
use super::disturbance::Disturbance;
use super::in_time::{ChangeInterval, ChangeShape};
use super::laws::LawSite;
use super::tilt::TiltCandidate;

/// A segment: samples without gaps in time.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleSegment {
    /// The recording it comes from.
    pub name: String,
    /// Number of samples.
    pub samples: usize,
    /// Time of the first sample, s.
    pub start: f64,
    /// Mean time between them, s.
    pub step: f64,
    /// Time between samples as recorded, before any were left out, s.
    pub recorded_step: f64,
    /// Whether it belongs to a validation run.
    pub is_check: bool,
}

/// Channels and segments of a problem; the segments of the fit come first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SampleLayout {
    /// Names of the drives.
    pub channels: Vec<String>,
    /// Segments in the order in which columns contain them.
    pub segments: Vec<SampleSegment>,
    /// Forces that were not measured, `[channel][sample]`: the values in their place are ignored. Empty if all were
    /// measured.
    pub left_out: Vec<Vec<bool>>,
}

/// Least number of blocks of a segment, however short.
const FEWEST_BLOCKS: usize = 6;

impl SampleLayout {
    /// Number of samples of each channel.
    pub fn samples(&self) -> usize {
        self.segments.iter().map(|s| s.samples).sum()
    }

    /// Number of samples of the fit, which come first.
    pub fn fit_samples(&self) -> usize {
        let fit = self.segments.iter().filter(|s| !s.is_check);
        fit.map(|s| s.samples).sum()
    }

    /// Times of all samples, s: equally spaced in each segment.
    pub fn times(&self) -> Vec<f64> {
        let of = |segment: &SampleSegment| {
            let (start, step) = (segment.start, segment.step);
            (0..segment.samples).map(move |i| start + step * i as f64)
        };
        self.segments.iter().flat_map(of).collect()
    }

    /// Whether there is a validation run.
    pub fn has_check(&self) -> bool {
        self.fit_samples() < self.samples()
    }

    /// Contiguous blocks as ranges of samples, at most `per_stretch` in each segment.
    pub fn blocks(&self, per_stretch: usize) -> Vec<std::ops::Range<usize>> {
        let mut blocks = Vec::new();
        let mut start = 0;
        for segment in &self.segments {
            // A short segment gets a few short blocks, since one block alone has no spread.
            let count = per_stretch
                .min((segment.samples / 20).max(FEWEST_BLOCKS))
                .min(segment.samples)
                .max(1);
            for k in 0..count {
                let at = |k: usize| start + k * segment.samples / count;
                blocks.push(at(k)..at(k + 1));
            }
            start += segment.samples;
        }
        blocks
    }
}

/// A kind of effect at its places, which share the parameters.
#[derive(Clone, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct LocatedEffect {
    /// Name of the kind.
    pub kind: String,
    /// Names of the places where it acts.
    pub at: Vec<String>,
}

/// The sign that an estimate must have to be physically possible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SignConstraint {
    /// Not below zero.
    Positive,
    /// Not above zero.
    Negative,
    /// Either.
    Any,
}

/// A parameter of an effect, which scales one column.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectParameter {
    /// Its symbol in the kind of effect.
    pub symbol: String,
    /// SI unit.
    pub unit: String,
    /// The sign that is physically possible.
    pub sign: SignConstraint,
}

/// The columns of an effect for one choice of its constants.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnChoice {
    /// Constants that are searched for, as (symbol, value).
    pub constants: Vec<(String, f64)>,
    /// A column for each parameter.
    pub columns: Vec<ForceColumn>,
}

/// Where the columns of an effect come from.
#[derive(Clone, Debug, PartialEq)]
pub enum ColumnSource {
    /// They are known, for each choice of the searched constants.
    Columns(Vec<ColumnChoice>),
    /// The base is tilted; the parameters are angles, rad.
    Tilt(TiltCandidate),
    /// The force signal is faulty.
    ReadingFault(ForceReadingFault),
    /// An additional body on a body of the model.
    Body(AttachedBody),
    /// A constant of the model has a wrong value; the parameter is its error.
    Constant(ConstantCorrection),
    /// They depend on the load of the drives, which the fit estimates: see [`ColumnProvider::load_dependent_columns`].
    LoadDependent,
}

/// Kind of the candidate for a clock that runs fast or slow in all recordings alike.
pub const TIME_BASE: &str = "time_base";

/// A fault of a force signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadingFaultKind {
    /// The signal is delayed; the parameter is the delay, s.
    Delayed,
    /// The signal went through a first-order low-pass; the parameter is its time constant, s.
    LowPassed,
    /// The signal is too large; the parameter is the relative error (0.1 = 10 %).
    Scaled,
}

/// A fault of a force signal and its channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ForceReadingFault {
    /// Kind of the fault.
    pub kind: ReadingFaultKind,
    /// Index of the channel; `None` if all channels have the same fault.
    pub channel: Option<usize>,
}

/// Whether a candidate is an effect or a disturbance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CandidateNature {
    /// A physical effect that the model lacks.
    Effect,
    /// A disturbance of the recordings, which is not a model error.
    Disturbance,
    /// A change of the machine or of a signal within a recording: the model is valid for a part of it only.
    ChangeInTime,
}

impl CandidateNature {
    /// Whether it is part of the recordings and not of the model.
    pub fn is_disturbance(self) -> bool {
        self != Self::Effect
    }
}

/// Selects the load-dependent candidates whose columns are requested.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LoadDependentQuery {
    /// All of them, with one value of each constant.
    All,
    /// One candidate by index, with a value of its constant if it has one.
    One(usize, Option<f64>),
}

/// Computes columns during the search.
pub trait ColumnProvider {
    /// Columns of a candidate for another value of its searched constant; `None` if they cannot be computed.
    fn columns_for_constant(&self, candidate: usize, constant: f64) -> Option<Vec<ForceColumn>>;

    /// Columns of load-dependent candidates, as (index of the candidate, columns). `load` is the force that each drive
    /// carries, N or N m.
    fn load_dependent_columns(&self, load: &ForceColumn, which: LoadDependentQuery) -> Vec<(usize, ColumnChoice)>;

    /// Places on which proposed laws may act; requested only if a residual stays unexplained.
    fn sites(&self) -> Vec<LawSite> {
        Vec::new()
    }

    /// Whether nobody needs the result any more: the search then ends early, and its result is incomplete.
    fn is_cancelled(&self) -> bool {
        false
    }
}

/// Provider for problems in which all columns are known from the start.
pub struct NoColumnProvider;

impl ColumnProvider for NoColumnProvider {
    fn columns_for_constant(&self, _: usize, _: f64) -> Option<Vec<ForceColumn>> {
        None
    }

    fn load_dependent_columns(&self, _: &ForceColumn, _: LoadDependentQuery) -> Vec<(usize, ColumnChoice)> {
        Vec::new()
    }
}

/// An effect that may be missing.
#[derive(Clone, Debug, PartialEq)]
pub struct CandidateEffect {
    /// What and where.
    pub effect: LocatedEffect,
    /// Its parameters, one per column and in the same order.
    pub parameters: Vec<EffectParameter>,
    /// Number of searched constants; they count as parameters.
    pub searched_constants: usize,
    /// Whether its forces are part of the load of the drives: masses and weight do, friction does not.
    pub is_part_of_load: bool,
    /// A simpler kind that it contains as a special case and that is preferred.
    pub refines: Option<String>,
    /// Whether it is an effect or a disturbance.
    pub nature: CandidateNature,
    /// Whether each recording has its own parameters, so that one recording cannot validate another.
    pub is_per_run: bool,
    /// Where its columns come from.
    pub source: ColumnSource,
}

/// Complete input of a diagnosis. The unit of forces is N or N m, by channel.
#[derive(Clone, Debug, Default)]
pub struct DiagnosisProblem {
    /// Channels and segments.
    pub layout: SampleLayout,
    /// Measured forces, minus those of fixed parameters.
    pub measured: ForceColumn,
    /// Forces of the fixed parameters, if there are any; already subtracted from `measured`.
    pub fixed_forces: Option<ForceColumn>,
    /// Columns of the estimated parameters.
    pub base: Vec<ForceColumn>,
    /// Prior knowledge of these parameters with mean zero: the inverse of their covariance. Without it they are
    /// unconstrained.
    pub prior: Option<DMatrix<f64>>,
    /// Which of them are part of the load of the drives.
    pub base_is_part_of_load: Vec<bool>,
    /// Friction of every drive, which is fitted when the load is estimated: rate, sign of the rate and constant of one
    /// drive after the other.
    pub friction: Vec<ForceColumn>,
    /// Candidates that the diagnosis tries.
    pub candidates: Vec<CandidateEffect>,
    /// Variables on which forces may depend, by name: positions, rates, accelerations, loads; one value per sample.
    pub variables: Vec<(String, Vec<f64>)>,
    /// Standard deviation of the white noise of each channel; for idle channels the diagnosis estimates it.
    pub noise: Vec<f64>,
    /// Channels without a force signal, since nothing drives there; empty if all have one.
    pub idle: Vec<bool>,
    /// Channels whose forces were computed from commands: no sensor adds a hum there. Empty if all were measured.
    pub without_sensor: Vec<bool>,
    /// Mean squares of the terms that cancel in each idle channel, `[channel]`, 0 for the others. The diagnosis estimates
    /// them.
    pub idle_squares: Vec<f64>,
    /// Samples that are left out, such as those of a push, `[channel][sample]`; empty if all count.
    pub left_out: Vec<Vec<bool>>,
    /// Samples next to reversals, `[channel][sample]`, which do not decide but count in figures. The diagnosis finds
    /// them.
    pub jumps: Vec<Vec<bool>>,
    /// Mean square of the forces that were removed from each channel, since they are not a function of the state.
    pub removed: Vec<f64>,
    /// The part of [`Self::removed`] that differences between recordings explain, whose sizes are estimates.
    pub removed_differences: Vec<f64>,
    /// Possible changes of the machine or of its signals within a recording.
    pub change_shapes: Vec<ChangeShape>,
    /// When the changes act that were added to the candidates, by kind and place.
    pub change_intervals: Vec<(LocatedEffect, Vec<ChangeInterval>)>,
    /// Disturbances of the recordings that are known already.
    pub disturbances: Vec<Disturbance>,
    /// Largest distance of two frames of the machine, m, which bounds plausible lengths; zero if it is unknown.
    pub size: f64,
    /// Whether only verdict, steps and effects are requested: no laws, no alternatives and no rejected candidates.
    pub effects_only: bool,
}

impl DiagnosisProblem {
    /// The problem without its columns, which need most of the memory and are not used after the diagnosis.
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
            change_shapes: Vec::new(),
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A single block has no spread, so short segments have several.
    #[test]
    fn a_short_stretch_has_several_blocks() {
        let segment = |samples| SampleSegment {
            name: String::new(),
            samples,
            start: 0.0,
            step: 0.01,
            recorded_step: 0.01,
            is_check: false,
        };
        for (samples, blocks) in [(30, 6), (90, 6), (200, 10), (5000, 12), (3, 3)] {
            let layout = SampleLayout {
                channels: Vec::new(),
                segments: vec![segment(samples)],
                left_out: Vec::new(),
            };
            let cut = layout.blocks(12);
            assert_eq!(cut.len(), blocks);
            assert!(cut.windows(2).all(|pair| pair[0].end == pair[1].start));
            assert_eq!((cut[0].start, cut[blocks - 1].end), (0, samples));
        }
    }
}
