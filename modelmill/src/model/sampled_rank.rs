//! Eq. (9) on the model file's own values: random states around the nominal pose go in, the
//! numeric rank of the stacked regressor comes out. A statement about these values and samples,
//! beside the exact one about all values.
//!
//! Decision: random states have no order, while Newton's method starts from the state before. So they are evaluated
//! one by one as soon as one of them has no solution.

use std::cmp::Ordering;

use modelmill_codegen::review::NumericRank;
use modelmill_codegen::{ModelEvaluator, MotionStates, PoseFault, PoseReason, ReductionMethod};
use modelmill_identify::estimate::{condition_number, numeric_rank};
use modelmill_runtime::RandomBits;
use nalgebra::DMatrix;

use crate::error::Outcome;
use crate::model::Model;
use crate::text::table::{count, significant};

/// Fewest random states.
const SAMPLES: usize = 40;
/// Largest step from the nominal pose, rad and m; smaller where loops would not close.
const REACH: f64 = 1.0;
/// Ranges of rates and accelerations, per s and s^2, and of loads, N or N m.
const RATE: f64 = 2.0;
const ACCELERATION: f64 = 5.0;
const LOAD: f64 = 100.0;

/// Below this ratio of the last singular value that counts to the first that does not, the rank is a matter of opinion.
const SMALL_GAP: f64 = 1e3;
/// Beyond this condition number a reader of the equations wants to know how clear the rank is.
const HIGH_CONDITION: f64 = 1e6;

/// A numeric rank with what a reader needs to judge it.
pub struct SampledRank {
    /// What the pages of equations print.
    pub numeric_rank: NumericRank,
    /// Ratio of the last singular value that counts to the first that does not, or to the level of rounding.
    pub gap: f64,
    /// How many random states were left out since the model is singular or undefined there.
    pub left_out: usize,
}

/// The numeric rank, and what is to be said about it.
pub(crate) struct RankJudgement {
    /// The rank, if one was found.
    pub found: Option<SampledRank>,
    /// Where it says something else than exact reduction, or nothing that one can rely on.
    pub warnings: Vec<String>,
}

impl SampledRank {
    /// The rank with what it stands on, in words.
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

    fn gap_text(&self) -> String {
        format!(
            "gap of {} to the next singular value",
            significant(self.gap, 2)
        )
    }

    /// What the pages of equations leave out: states that were not used, and the gap where the condition is poor.
    pub fn remark(&self) -> Option<String> {
        let is_poor = self
            .numeric_rank
            .condition
            .is_none_or(|c| c > HIGH_CONDITION);
        (self.left_out > 0 || is_poor).then(|| format!("the numeric rank is {}", self.text()))
    }

    /// The same as JSON.
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

/// The rank of H on the file's values, and in words where it says something else than exact reduction.
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
    let is_exact = matches!(
        model.derivation.reduction.method,
        ReductionMethod::Exact { .. }
    );
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
            "the numeric rank {rank} stands on a small {}; the file's values nearly tie columns, other states could give \
             another rank, and identification will find directions that are hardly determined",
            found.gap_text()
        ));
    }
    Ok(RankJudgement {
        found: Some(found),
        warnings,
    })
}

/// The rank of H on the file's values; the reason in words if there is none.
fn sampled_rank(model: &Model) -> Result<SampledRank, String> {
    let n_products = model.derivation.reduction.products.len();
    if n_products == 0 {
        return Err("no product of parameters has an effect on the drives".to_owned());
    }
    let n_drives = model.derivation.mechanism.drives.len().max(1);
    let wanted = SAMPLES.max((4 * n_products).div_ceil(n_drives));
    let evaluator = ModelEvaluator::new(&model.derivation);
    let mut sampling = StateSampling::new(model, n_drives);
    sampling.draw(&evaluator, wanted)?;
    let (full, retained) = match both_regressors(&evaluator, &sampling.states()) {
        Ok(both) => both,
        Err(fault) if is_pose_dependent(&fault) => {
            regressors_state_by_state(&evaluator, &mut sampling, wanted)?
        }
        Err(fault) => return Err(fault.to_string()),
    };
    let found = numeric_rank(&full).map_err(|error| error.to_string())?;
    // Of the base as it is printed, also where its columns are fewer in truth.
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

/// H for all products and H_min at some states.
fn both_regressors(
    evaluator: &ModelEvaluator<'_>,
    states: &MotionStates<'_>,
) -> Result<(DMatrix<f64>, DMatrix<f64>), PoseFault> {
    Ok((
        evaluator.full_regressor(states)?,
        evaluator.regressor(states)?,
    ))
}

/// Whether another pose would do.
fn is_pose_dependent(fault: &PoseFault) -> bool {
    matches!(
        fault.reason,
        PoseReason::Singular | PoseReason::OutOfReach | PoseReason::Undefined
    )
}

/// The regressors at states that are looked at each for itself: in a row, Newton's method would start from the state
/// before, and states drawn at random are no neighbours. Where the mechanism is singular another state takes the place.
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

/// Random states at which the mechanism can stand.
struct StateSampling {
    /// Nominal values and motions of the active coordinates.
    active: Vec<(f64, bool)>,
    n_drives: usize,
    random: RandomBits,
    /// Positions, rates, accelerations and loads, each as columns of samples.
    columns: [Vec<Vec<f64>>; 4],
    reach: f64,
    /// Poses at which the mechanism cannot stand.
    refused: usize,
    /// States that were left out as singular or undefined.
    left_out: usize,
}

impl StateSampling {
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

    /// Draws until there are as many states as wanted; the reason if poses are not to be found.
    fn draw(&mut self, evaluator: &ModelEvaluator<'_>, wanted: usize) -> Result<(), String> {
        let n = self.active.len();
        let zero = vec![0.0; n.max(self.n_drives)];
        let resting = |n: usize| zero[..n].iter().map(std::slice::from_ref).collect();
        while self.columns[1].first().map_or(0, Vec::len) < wanted {
            let q: Vec<f64> = self
                .active
                .iter()
                .map(|(nominal, is_angle)| {
                    let reach = if *is_angle {
                        self.reach
                    } else {
                        0.5 * self.reach
                    };
                    nominal + reach * draw(&mut self.random)
                })
                .collect();
            let still = MotionStates {
                q: q.iter().map(std::slice::from_ref).collect(),
                qd: resting(n),
                qdd: resting(n),
                load: resting(self.n_drives),
            };
            if evaluator.full_regressor(&still).is_err() {
                self.refused += 1;
                if self.refused > 20 * wanted {
                    return Err(format!(
                        "no poses were found around the nominal one at which the mechanism can stand ({} tried)",
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

    fn states(&self) -> MotionStates<'_> {
        let slices = |k: usize| self.columns[k].iter().map(Vec::as_slice).collect();
        MotionStates {
            q: slices(0),
            qd: slices(1),
            qdd: slices(2),
            load: slices(3),
        }
    }

    /// One of them.
    fn single_state(&self, sample: usize) -> MotionStates<'_> {
        let one = |k: usize| {
            let columns = self.columns[k].iter();
            columns
                .map(|column| std::slice::from_ref(&column[sample]))
                .collect()
        };
        MotionStates {
            q: one(0),
            qd: one(1),
            qdd: one(2),
            load: one(3),
        }
    }

    /// Forgets a state at which the mechanism is singular.
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
