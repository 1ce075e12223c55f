//! Eq. (9) at the values of the model file: the numeric rank of the regressor stacked over random states around the
//! nominal pose. It is a statement about these values and samples, in addition to the exact rank, which holds for all
//! values.
//!
//! Decision: random states have no order, while Newton's method starts from the state before. Therefore they are
//! evaluated one by one if one of them has no solution.

use std::cmp::Ordering;

use modelmill_codegen::review::NumericRank;
use modelmill_codegen::{ModelEvaluator, MotionStates, PoseFault, PoseReason, ReductionMethod};
use modelmill_identify::estimate::{condition_number, numeric_rank};
use modelmill_runtime::RandomBits;
use nalgebra::DMatrix;

use crate::error::Outcome;
use crate::model::Model;
use crate::text::table::{count, significant};

/// Smallest number of random states.
const SAMPLES: usize = 40;
/// Largest distance from the nominal pose, rad or m; reduced if loops cannot close.
const REACH: f64 = 1.0;
/// Range of rates, per s.
const RATE: f64 = 2.0;
/// Range of accelerations, per s^2.
const ACCELERATION: f64 = 5.0;
/// Range of loads, N or N m.
const LOAD: f64 = 100.0;

/// Below this ratio of the last singular value that counts to the first that does not, the rank is unclear.
const SMALL_GAP: f64 = 1e3;
/// Above this condition number, the pages of equations report how clear the rank is.
const HIGH_CONDITION: f64 = 1e6;

/// A numeric rank with the figures that are needed to judge it.
pub struct SampledRank {
    /// Rank, number of states and condition number.
    pub numeric_rank: NumericRank,
    /// Ratio of two singular values: the smallest that contributes to the rank, and the next smaller one. The level of
    /// rounding replaces the second if it is higher, or if there is no smaller one. Below about 1e3 the rank is
    /// uncertain.
    pub gap: f64,
    /// Number of random states that were left out because the model is singular or undefined there.
    pub left_out: usize,
}

/// The numeric rank, and warnings about it.
pub(crate) struct RankJudgement {
    /// The rank; `None` if sampling failed.
    pub found: Option<SampledRank>,
    /// Contradictions with the exact reduction, and reasons to doubt the rank.
    pub warnings: Vec<String>,
}

impl SampledRank {
    /// The rank with its figures, as a phrase.
    pub fn text(&self) -> String {
        let left_out = match self.left_out {
            0 => String::new(),
            n => format!(" ({n} more left out, where the model is singular or undefined)"),
        };
        let condition = self.numeric_rank.condition;
        let condition = condition.map_or_else(
            || ", condition number infinite to rounding".to_owned(),
            |c| format!(", condition number {}", significant(c, 3)),
        );
        format!(
            "{} over {}{left_out}{condition}, {}",
            self.numeric_rank.rank,
            count(self.numeric_rank.samples, "random state", "random states"),
            self.gap_text()
        )
    }

    /// The gap as a phrase.
    fn gap_text(&self) -> String {
        format!("gap of {} to the next singular value", significant(self.gap, 2))
    }

    /// A remark for the pages of equations: states that were left out, or a poor condition number; `None` otherwise.
    pub fn remark(&self) -> Option<String> {
        let is_poor = self.numeric_rank.condition.is_none_or(|c| c > HIGH_CONDITION);
        (self.left_out > 0 || is_poor).then(|| format!("the numeric rank is {}", self.text()))
    }

    /// The rank with its figures as JSON.
    pub fn json(&self) -> serde_json::Value {
        serde_json::json!({
            "rank": self.numeric_rank.rank,
            "samples": self.numeric_rank.samples,
            "left_out": self.left_out,
            "condition_number": self.numeric_rank.condition,
            "gap": self.gap.is_finite().then_some(self.gap),
        })
    }
}

/// The numeric rank of H at the file's values, with warnings if it contradicts the exact reduction.
pub(crate) fn judge_rank(model: &Model) -> Outcome<RankJudgement> {
    let message = format!("sampling {}", model.name);
    let found = match model.host().run_job(&message, 0, |_| sampled_rank(model))? {
        Ok(found) => found,
        Err(reason) => {
            let says = format!("the numeric rank of eq. (9) was not found: {reason}");
            return Ok(RankJudgement {
                found: None,
                warnings: vec![says],
            });
        }
    };
    let retained = model.base.len();
    let rank = found.numeric_rank.rank;
    let is_exact = matches!(model.derivation.reduction.method, ReductionMethod::Exact { .. });
    // A rank below or above the number of base parameters means different things for exact and numeric
    // reduction.
    let mut warnings = Vec::new();
    let undetermined = || count(retained - rank, "direction", "directions");
    match rank.cmp(&retained) {
        Ordering::Less if is_exact => warnings.push(format!(
            "with the file's values the numeric rank is {rank}, below the exact {retained} for general values; special values \
             make columns vanish or coincide, so identification will find {} undetermined",
            undetermined()
        )),
        Ordering::Greater if is_exact => warnings.push(format!(
            "the numeric rank is {rank}, above the exact {retained}; please report this model, one of them is wrong",
        )),
        Ordering::Less => warnings.push(format!(
            "{rank} of the {retained} columns that were retained numerically stand out at random states; identification will \
             find {} hardly determined",
            undetermined()
        )),
        Ordering::Greater => warnings.push(format!(
            "the numeric rank is {rank} at random states, but {retained} columns were retained numerically around the nominal \
             pose; forces away from it may lack what the others add",
        )),
        Ordering::Equal => {}
    }
    if found.gap < SMALL_GAP {
        warnings.push(format!(
            "the numeric rank {rank} is based on a small {}; the file's values make columns nearly dependent, other states could give \
             another rank, and identification will find directions that are hardly determined",
            found.gap_text()
        ));
    }
    Ok(RankJudgement {
        found: Some(found),
        warnings,
    })
}

/// The numeric rank of H at the file's values; as error the reason as text.
fn sampled_rank(model: &Model) -> Result<SampledRank, String> {
    let n_products = model.derivation.reduction.products.len();
    if n_products == 0 {
        return Err("no product of parameters has an effect on the drives".to_owned());
    }
    // The stacked regressor has at least four rows for each product.
    let n_drives = model.derivation.mechanism.drives.len().max(1);
    let wanted = SAMPLES.max((4 * n_products).div_ceil(n_drives));
    let evaluator = ModelEvaluator::new(&model.derivation);
    let mut sampling = StateSampling::new(model, n_drives);
    // States that Newton's method cannot follow in a row are evaluated one by one.
    sampling.draw(&evaluator, wanted)?;
    let (full, retained) = match both_regressors(&evaluator, &sampling.states()) {
        Ok(both) => both,
        Err(fault) if is_pose_dependent(&fault) => regressors_state_by_state(&evaluator, &mut sampling, wanted)?,
        Err(fault) => return Err(fault.to_string()),
    };
    let found = numeric_rank(&full).map_err(|error| error.to_string())?;
    // The condition number is that of the printed base, even if its columns are dependent at these values.
    let condition = condition_number(&retained).map_err(|error| error.to_string())?;
    Ok(SampledRank {
        numeric_rank: NumericRank {
            rank: found.rank,
            samples: wanted,
            condition,
        },
        gap: found.gap,
        left_out: sampling.left_out,
    })
}

/// H for all products and H_min at given states, rows interleaved by drive.
fn both_regressors(
    evaluator: &ModelEvaluator<'_>,
    states: &MotionStates<'_>,
) -> Result<(DMatrix<f64>, DMatrix<f64>), PoseFault> {
    Ok((evaluator.full_regressor(states)?, evaluator.regressor(states)?))
}

/// Whether the fault depends on the pose, so that another state may have a solution.
fn is_pose_dependent(fault: &PoseFault) -> bool {
    matches!(
        fault.reason,
        PoseReason::Singular | PoseReason::OutOfReach | PoseReason::Undefined
    )
}

/// The regressors at states that are evaluated one by one. In a row, Newton's method would start from the state before,
/// but random states are not neighbours. A state where the mechanism is singular is replaced by another one.
///
/// Fails when as many states as wanted were left out.
fn regressors_state_by_state(
    evaluator: &ModelEvaluator<'_>,
    sampling: &mut StateSampling,
    wanted: usize,
) -> Result<(DMatrix<f64>, DMatrix<f64>), String> {
    let (mut full, mut retained) = (Vec::new(), Vec::new());
    while full.len() < wanted {
        match both_regressors(evaluator, &sampling.single_state(full.len())) {
            Ok((all, few)) => {
                full.push(all);
                retained.push(few);
            }
            Err(fault) if is_pose_dependent(&fault) && sampling.left_out < wanted => {
                sampling.exclude_state(full.len());
                sampling.draw(evaluator, wanted)?;
            }
            Err(fault) if !is_pose_dependent(&fault) => return Err(fault.to_string()),
            Err(_) => {
                return Err(format!(
                    "the model is singular or undefined at {} of {} random states around the nominal pose",
                    sampling.left_out,
                    sampling.left_out + full.len()
                ));
            }
        }
    }
    Ok((stack_rows(&full), stack_rows(&retained)))
}

/// Matrices of equal width, one below the other.
fn stack_rows(parts: &[DMatrix<f64>]) -> DMatrix<f64> {
    let rows: Vec<_> = parts.iter().flat_map(|part| part.row_iter()).collect();
    DMatrix::from_rows(&rows)
}

/// Random states that the mechanism can reach.
struct StateSampling {
    /// Nominal values and motions of the active coordinates.
    active: Vec<(f64, bool)>,
    /// Number of drives, which have a load each.
    n_drives: usize,
    random: RandomBits,
    /// Positions, rates, accelerations and loads, each as columns of samples.
    columns: [Vec<Vec<f64>>; 4],
    /// Current largest distance from the nominal pose, rad; half of it for lengths, m.
    reach: f64,
    /// Number of poses that the mechanism cannot reach.
    refused: usize,
    /// Number of states that were left out as singular or undefined.
    left_out: usize,
}

impl StateSampling {
    /// Without states yet.
    fn new(model: &Model, n_drives: usize) -> Self {
        let coordinates = model.derivation.mechanism.coordinates.iter();
        let active: Vec<(f64, bool)> = coordinates
            .filter(|c| !c.passive)
            .map(|c| (c.nominal, c.motion.is_angle()))
            .collect();
        let n = active.len();
        Self {
            active,
            n_drives,
            random: RandomBits::new(0x6d69_6c6c),
            columns: [n, n, n, n_drives].map(|n| vec![Vec::new(); n]),
            reach: REACH,
            refused: 0,
            left_out: 0,
        }
    }

    /// Draws until there are as many states as wanted.
    ///
    /// Fails when too many poses cannot be reached; the error is the reason as text.
    fn draw(&mut self, evaluator: &ModelEvaluator<'_>, wanted: usize) -> Result<(), String> {
        let n = self.active.len();
        let zero = vec![0.0; n.max(self.n_drives)];
        let resting = |n: usize| zero[..n].iter().map(std::slice::from_ref).collect();
        while self.columns[1].first().map_or(0, Vec::len) < wanted {
            // A pose counts if the regressor exists there at standstill.
            let q: Vec<f64> = self
                .active
                .iter()
                .map(|(nominal, is_angle)| {
                    let reach = if *is_angle { self.reach } else { 0.5 * self.reach };
                    nominal + reach * draw(&mut self.random)
                })
                .collect();
            let still = MotionStates {
                q: q.iter().map(std::slice::from_ref).collect(),
                qd: resting(n),
                qdd: resting(n),
                load: resting(self.n_drives),
            };
            // Every refused pose narrows the range around the nominal pose.
            if evaluator.full_regressor(&still).is_err() {
                self.refused += 1;
                if self.refused > 20 * wanted {
                    return Err(format!(
                        "no poses were found around the nominal one that the mechanism can reach ({} tried)",
                        self.refused
                    ));
                }
                self.reach = (self.reach * 0.97).max(0.02);
                continue;
            }
            for (column, value) in self.columns[0].iter_mut().zip(q) {
                column.push(value);
            }
            for (set, range) in self.columns[1..].iter_mut().zip([RATE, ACCELERATION, LOAD]) {
                for column in set {
                    column.push(range * draw(&mut self.random));
                }
            }
        }
        Ok(())
    }

    /// All states.
    fn states(&self) -> MotionStates<'_> {
        let slices = |k: usize| self.columns[k].iter().map(Vec::as_slice).collect();
        MotionStates {
            q: slices(0),
            qd: slices(1),
            qdd: slices(2),
            load: slices(3),
        }
    }

    /// One state.
    fn single_state(&self, sample: usize) -> MotionStates<'_> {
        let one = |k: usize| {
            let columns = self.columns[k].iter();
            columns.map(|column| std::slice::from_ref(&column[sample])).collect()
        };
        MotionStates {
            q: one(0),
            qd: one(1),
            qdd: one(2),
            load: one(3),
        }
    }

    /// Removes a state at which the mechanism is singular, and counts it.
    fn exclude_state(&mut self, sample: usize) {
        for column in self.columns.iter_mut().flatten() {
            column.remove(sample);
        }
        self.left_out += 1;
    }
}

/// A uniform number in [-1, 1).
fn draw(random: &mut RandomBits) -> f64 {
    2.0 * random.below_one() - 1.0
}
