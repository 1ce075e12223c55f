//! Changes between two runs of one machine.
//!
//! Both runs share the base parameters `p` and the effects that the model lacks in both, with coefficients `s`. The
//! later run may have changes in addition, each a group of columns with its own coefficients `c`:
//!
//! ```text
//! y_0 = H_0 p + X_0 s + e_0,    y_1 = H_1 p + X_1 (s + c) + e_1
//! ```
//!
//! Columns of `X` that are combinations of those of `H`, such as those of a payload on a body of the model, have `s` =
//! 0 and are still a change in `c`.
//!
//! Rows are whitened first, drive by drive ([`AutoregressiveNoise`]), so that sums of squares count independent
//! numbers. Each run is stored as additive statistics of its rows ([`NormalEquations`]), block by block.
//! [`search_changes`] then finds the fewest changes that explain the difference of the runs. Over many runs,
//! [`change_points`] finds when values changed for good, and [`fit_jointly`] fits all runs at once with some values
//! shared and others own.

mod coloured;
mod jackknife;
mod joint;
mod moments;
mod search;
mod segments;
mod thresholds;

pub use coloured::AutoregressiveNoise;
pub use jackknife::{BlockFit, fit_blocks};
pub use joint::{JointFit, JointRun, JointValues, fit_jointly};
pub use moments::{NormalEquations, NormalSolution};
pub use search::{
    ChangeHypotheses, PossibleChange, RunPair, SearchSensitivity, SelectedChange, fit_single_change, search_changes,
    search_sensitivity, single_change_gains, within_run_spread,
};
pub use segments::{UncertainValue, change_points, weighted_mean};
