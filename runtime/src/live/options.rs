//! Options of a watch: times in seconds, and their conversion to samples and blocks.

use crate::Real;

/// Options of a watch; all times in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Samples per second, Hz.
    pub rate: f64,
    /// Time over which samples are averaged, s.
    pub block: f64,
    /// Memory of the window, s: older samples count less by a factor e per such time. A change is detected some of
    /// these times after it occurred.
    pub window: f64,
    /// Memory of the reference and of the differences between windows, s.
    pub memory: f64,
    /// Time that the watch learns before it judges, s: a third of it the noise, the rest the differences between
    /// windows. The motion should be the usual one of the machine.
    pub learning: f64,
    /// Mean time between false alarms, s, for which thresholds are computed under random noise.
    pub false_alarm_interval: f64,
}

impl Options {
    /// Blocks of 20 ms, a window of 2 s, a memory of 10 minutes, one minute to learn, a false alarm in 100 hours.
    #[must_use]
    pub const fn at_rate(samples_per_second: f64) -> Self {
        Self {
            rate: samples_per_second,
            block: 0.02,
            window: 2.0,
            memory: 600.0,
            learning: 60.0,
            false_alarm_interval: 360_000.0,
        }
    }
}

/// The options converted to samples, blocks and shares.
#[derive(Clone, Copy, Debug)]
pub(super) struct WatchSchedule<T> {
    /// Samples of a block.
    pub(super) block: u32,
    /// Blocks between two comparisons.
    pub(super) interval: u32,
    /// Blocks of each drive from which its noise is learned.
    pub(super) noise: u32,
    /// Blocks from which the scatter of windows is learned.
    pub(super) scatter: u32,
    /// Successive comparisons in which the same parameter must have changed most before the change counts as steady.
    pub(super) steady: u32,
    /// Factor on the rows of the window after each block: the root of the factor on its information.
    pub(super) window_root: T,
    /// The same for the reference.
    pub(super) memory_root: T,
    /// Factor on the sums over windows after each comparison.
    pub(super) scatter_share: T,
    /// Non-overlapping windows per comparison: a memory of tau averages over 2 tau.
    pub(super) per_comparison: T,
    /// One over the number of samples in a block.
    pub(super) per_sample: T,
    /// Number of windows in the memory of the reference.
    pub(super) windows: T,
    /// Gain that chance alone does not reach within the requested time between false alarms, if the dispersion is
    /// known.
    pub(super) limit: T,
}

impl<T: Real> WatchSchedule<T> {
    pub(super) fn new(options: &Options, n_base: usize) -> Self {
        let rate = options.rate.max(1e-6);
        let block = positive_count(options.block * rate);
        let block_time = f64::from(block) / rate;
        let window = options.window.max(block_time);
        let memory = options.memory.max(10.0 * window);
        let learning = options.learning.max(10.0 * window) / block_time;
        // A comparison takes one step per parameter, so it needs at least as many samples.
        let samples = (window / 6.0 * rate).max(n_base as f64 + 2.0);
        let interval = positive_count(samples / f64::from(block));
        let interval_time = f64::from(interval) * block_time;
        let root = |memory: f64, dt: f64| T::from_f64(libm::exp(-0.5 * dt / memory));
        // Number of nearly independent tests between two false alarms: two in each window, for each parameter.
        let tests = 2.0 * n_base.max(1) as f64 * (options.false_alarm_interval / window).max(1.0);
        Self {
            block,
            interval,
            noise: positive_count(learning / 3.0),
            scatter: positive_count(learning * 2.0 / 3.0),
            steady: positive_count(window / interval_time),
            window_root: root(window, block_time),
            memory_root: root(memory, block_time),
            scatter_share: root(0.5 * memory, interval_time),
            per_comparison: T::from_f64(interval_time / (2.0 * window)),
            per_sample: T::from_f64(1.0 / f64::from(block)),
            windows: T::from_f64(memory / window),
            limit: T::from_f64(2.0 * libm::log(tests)),
        }
    }
}

/// Rounds to a number of samples or blocks, at least one.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn positive_count(x: f64) -> u32 {
    // NaN becomes one.
    libm::round(x.clamp(1.0, 1e9)).max(1.0) as u32
}
