//! What is different between two runs of one machine.
//!
//! Both runs share the base parameters `p` and whatever else the model lacks in both, with coefficients `s`; the later one may
//! have changes besides, each a group of columns with coefficients `c` of its own:
//!
//! ```text
//! y_0 = H_0 p + X_0 s + e_0,    y_1 = H_1 p + X_1 (s + c) + e_1
//! ```
//!
//! Columns of `X` that are combinations of those of `H`, as a payload's are of a body's own, leave `s` at 0 and are a change in
//! `c` all the same.
//!
//! Rows are made white first, drive by drive ([`AutoregressiveNoise`]), so that sums of squares count independent numbers, and each run
//! is kept as sums over its rows ([`NormalEquations`]), block by block. [`search`] then finds the fewest changes that explain what
//! the runs do not share. Over many runs, [`segments`] finds when values changed and stayed changed, and [`joint`] fits all runs
//! at once with some values shared and others each run's own.

mod coloured;
mod joint;
mod moments;
mod search;
mod segments;

pub use coloured::AutoregressiveNoise;
pub use joint::{JointFit, JointRun, JointValues, fit_jointly};
pub use moments::{NormalEquations, NormalSolution};
pub use search::{
    ChangeHypotheses, PossibleChange, RunPair, SelectedChange, fit_single_change, search_changes,
    single_change_gains, within_run_spread,
};
pub use segments::{UncertainValue, change_points, weighted_mean};
