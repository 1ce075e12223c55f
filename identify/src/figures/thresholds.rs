//! Thresholds of the figures: the numbers that decide which samples count and which regions of large error are
//! reported. Each states what it bounds, its unit, and how it was chosen. Numbers that only set an accuracy, a grid or
//! a size stay where they are used.

/// Share of the samples that is dropped at each end of filtered forces, where the filter has transients. By
/// judgement.
pub const TRIMMED_PART: f64 = 0.05;

/// Least excess of a region's share of the squared error over its share of the samples (1). By judgement.
pub(super) const REGION_LEAST_EXCESS: f64 = 0.15;

/// Least ratio of a region's share of the squared error to its share of the samples (1). By judgement.
pub(super) const REGION_LEAST_DENSITY: f64 = 1.5;

/// Largest number of regions that are reported of a channel. By judgement.
pub(super) const MOST_REGIONS: usize = 3;

/// Samples of each bin of a variable at least; with fewer than two such bins no region is searched. By judgement.
pub(super) const BIN_FEWEST_SAMPLES: usize = 25;

/// An interval around zero is taken if its excess is above this share of that of the best other interval (1). By
/// judgement.
pub(super) const ZERO_REGION_LEAST_SHARE: f64 = 0.9;

/// Parts of the recording; a region must be dense in most of the parts in which it has samples. By judgement.
pub(super) const RECURRENCE_PARTS: usize = 4;

/// Samples that a part must have in the region; parts with fewer are not counted. By judgement.
pub(super) const PART_FEWEST_SAMPLES: usize = 5;

/// Part of the density above 1 that is enough in a single part (1). By judgement.
pub(super) const PART_DENSITY_SHARE: f64 = 0.5;

/// Parts that must have samples in the region: one alone shows no recurrence. By definition.
pub(super) const FEWEST_PARTS: usize = 2;

/// Share of these parts in which the region must be dense (1). By judgement.
pub(super) const DENSE_PARTS_LEAST_SHARE: f64 = 0.75;

/// Below this share of its largest rate a drive is near standstill (1), where dry friction takes any value. By
/// judgement, as in the diagnosis.
pub(super) const NEAR_STANDSTILL_RATE_SHARE: f64 = 0.02;

/// Least share of the squared residual of a drive that a dependence on its rate must explain (1). By judgement.
pub(super) const RATE_TERM_LEAST_SHARE: f64 = 0.1;

/// Least ratio of a dependence on the rate to its standard deviation (1). By judgement: above the usual 3, since the
/// standard deviation itself is uncertain if there are few reversals.
pub(super) const RATE_TERM_LEAST_SIGNIFICANCE: f64 = 4.0;

/// Movements between two reversals that a drive must make: fewer show no repetition. By judgement.
pub(super) const FEWEST_MOVEMENTS: usize = 4;

/// Samples of a movement at least; shorter ones are not counted. By judgement.
pub(super) const MOVEMENT_FEWEST_SAMPLES: usize = 5;

/// Share of the movements in which the residual must agree with the dependence (1). By judgement.
pub(super) const AGREEING_MOVEMENTS_LEAST_SHARE: f64 = 0.75;

/// Below this share of its rms value an acceleration counts as zero: the speed neither rises nor falls (1). By
/// judgement.
pub(super) const STEADY_ACCELERATION_SHARE: f64 = 0.1;

/// Dry and viscous friction are indistinguishable if the other one explains at least this share of what the better one
/// explains (1). By judgement: for a sinusoidal motion it is 0.81.
pub(super) const EQUAL_TERM_LEAST_SHARE: f64 = 0.95;
