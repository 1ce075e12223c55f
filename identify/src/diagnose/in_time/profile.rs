//! Time profiles over the blocks of a recording: by how much a change acts in each block.

/// Blocks at either end of a recording in which no change begins or ends: too few samples would show it.
const FEWEST_BLOCKS: usize = 3;

/// A change that acts completely or not at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TimeProfile {
    /// First block in which it acts.
    pub(super) begin: usize,
    /// First block in which it does not act any more; `None` if it lasts to the end.
    pub(super) end: Option<usize>,
}

impl TimeProfile {
    /// All steps that last to the end of a recording with some blocks.
    pub(super) fn steps(blocks: usize) -> impl Iterator<Item = Self> {
        let last = blocks.saturating_sub(FEWEST_BLOCKS - 1);
        (FEWEST_BLOCKS..last).map(|begin| Self { begin, end: None })
    }

    /// All intervals within a recording with some blocks.
    pub(super) fn intervals(blocks: usize) -> impl Iterator<Item = Self> {
        let last = blocks.saturating_sub(FEWEST_BLOCKS - 1);
        // A coarse grid is enough: times are refined to samples afterwards.
        (1..last).step_by(2).flat_map(move |begin| {
            let ends = (begin + 2..=last).step_by(2);
            ends.map(move |end| Self { begin, end: Some(end) })
        })
    }

    /// Searched constants: a change that lasts has one searched time, one that ends has two. Each is the best of as many
    /// times as there are effective samples: as for the best of many candidates, this costs twice their logarithm.
    pub(super) fn searched_constants(self) -> usize {
        if self.end.is_some() { 4 } else { 2 }
    }

    /// 1 for blocks in which it acts, 0 for the others.
    pub(super) fn values(self, blocks: usize) -> Vec<f64> {
        let acts = |b: usize| b >= self.begin && self.end.is_none_or(|end| b < end);
        (0..blocks).map(|b| f64::from(u8::from(acts(b)))).collect()
    }
}

/// Slow changes over a recording: a ramp, and two that come to rest.
pub(super) fn slow_profiles(blocks: usize) -> [Vec<f64>; 3] {
    let share = |b: usize| (b as f64 + 0.5) / blocks as f64;
    let decay = |constant: f64| (0..blocks).map(|b| (-share(b) / constant).exp()).collect();
    [(0..blocks).map(|b| share(b) - 0.5).collect(), decay(0.1), decay(0.3)]
}
