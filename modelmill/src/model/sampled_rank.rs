//! Eq. (9) at the values of the model file: the numeric rank of the regressor stacked over random states around the
//! nominal pose. It is a statement about these values and samples, in addition to the exact rank, which holds for all
//! values.
//!
//! Decision: random states have no order, while Newton's method starts from the state before. Therefore they are
//! evaluated one by one if one of them has no solution.
//!
//! Decision: a coordinate that moves the rest of the machine slowly, such as the angle of a screw, goes further and
//! faster in proportion. Over one radian of a screw the columns of the machine behind it hardly change.

use std::cmp::Ordering;

use modelmill_codegen::review::NumericRank;
use modelmill_codegen::{ModelEvaluator, MotionStates, PoseFault, PoseReason, ReductionMethod};
use modelmill_identify::estimate::measure_rank_and_condition;
use modelmill_runtime::RandomBits;
use modelmill_spec::CoordinateMotion;
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

/// Largest factor by which a slow coordinate goes further and faster. A spindle of 1 mm per turn moves a link of 1 m by
/// 1.6e-4 rad per rad. By judgement.
const LARGEST_TRAVEL: f64 = 1e4;
/// A coordinate is slow if no passive coordinate moves faster than this share of its own rate, in rad or half metres.
/// Links of equal kind move at about the same rate. By judgement.
const SLOW: f64 = 0.1;
/// Factor between the rate of a passive coordinate at the nominal pose and that at poses around it, above which the
/// nominal pose is near a fold. A four-bar linkage reaches it at 5e-4 rad from its fold: rates grow as the reciprocal
/// square root of this distance. By judgement.
const NEAR_FOLD: f64 = 30.0;
/// Number of states at which it is determined how fast each coordinate moves the others. By judgement.
const TRAVEL_SAMPLES: usize = 8;

/// Below this ratio of the last singular value that counts to the first that does not, the rank is unclear.
const SMALL_GAP: f64 = 1e3;
/// Above this condition number, the pages of equations report how clear the rank is.
const HIGH_CONDITION: f64 = 1e6;

/// A numeric rank with the figures that are needed to judge it.
pub struct SampledRank {
    /// Rank, number of states and condition number.
    pub numeric_rank: NumericRank,
    /// The smallest singular value that counts for the rank, divided by the next smaller one, or by the level of
    /// rounding if that is higher. Below about 1e3 the rank is uncertain.
    pub gap: f64,
    /// Number of random states that were left out because the model is singular or undefined there.
    pub left_out: usize,
    /// A warning if the nominal pose is near a fold of the loops.
    near_fold: Option<String>,
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
            let says = format!("the numeric rank of the regressor was not found: {reason}");
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
    let mut warnings: Vec<String> = found.near_fold.iter().cloned().collect();
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
    let near_fold = sampling.extend_travel(model, &evaluator);
    // States that Newton's method cannot follow in a row are evaluated one by one.
    sampling.draw(&evaluator, wanted)?;
    let full = match evaluator.full_regressor(&sampling.states()) {
        Ok(full) => full,
        Err(fault) if is_pose_dependent(&fault) => regressors_state_by_state(&evaluator, &mut sampling, wanted)?,
        Err(fault) => return Err(fault.to_string()),
    };
    // The condition number is that of the printed base, even if its columns are dependent at these values. Columns of
    // H_min are columns of H.
    let retained = &model.derivation.reduction.retained;
    let (found, condition) = measure_rank_and_condition(&full, retained).map_err(|error| error.to_string())?;
    Ok(SampledRank {
        numeric_rank: NumericRank {
            rank: found.rank,
            samples: wanted,
            condition,
        },
        gap: found.gap,
        left_out: sampling.left_out,
        near_fold,
    })
}

/// Whether the fault depends on the pose, so that another state may have a solution.
fn is_pose_dependent(fault: &PoseFault) -> bool {
    matches!(
        fault.reason,
        PoseReason::Singular | PoseReason::OutOfReach | PoseReason::Undefined
    )
}

/// H at states that are evaluated one by one. In a row, Newton's method would start from the state before,
/// but random states are not neighbours. A state where the mechanism is singular is replaced by another one.
///
/// Fails when as many states as wanted were left out.
fn regressors_state_by_state(
    evaluator: &ModelEvaluator<'_>,
    sampling: &mut StateSampling,
    wanted: usize,
) -> Result<DMatrix<f64>, String> {
    let mut full = Vec::new();
    while full.len() < wanted {
        match evaluator.full_regressor(&sampling.single_state(full.len())) {
            Ok(one) => full.push(one),
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
    Ok(stack_rows(&full))
}

/// Matrices of equal width, one below the other.
fn stack_rows(parts: &[DMatrix<f64>]) -> DMatrix<f64> {
    let rows: Vec<_> = parts.iter().flat_map(|part| part.row_iter()).collect();
    DMatrix::from_rows(&rows)
}

/// Positions, rates, accelerations and loads of random states that the mechanism can reach, each as columns of samples.
///
/// Fails when too few poses can be reached; the error is the reason as text.
pub(crate) fn reachable_states(model: &Model, wanted: usize) -> Result<[Vec<Vec<f64>>; 4], String> {
    let evaluator = ModelEvaluator::new(&model.derivation);
    let mut sampling = StateSampling::new(model, model.derivation.mechanism.drives.len());
    sampling.draw(&evaluator, wanted)?;
    Ok(sampling.columns)
}

/// An active coordinate and how far it goes.
struct SampledCoordinate {
    /// Nominal value, rad or m.
    nominal: f64,
    /// What counts as one: 1 rad or 0.5 m.
    unit: f64,
    /// By how much it goes further and faster, because it moves the passive coordinates slowly.
    travel: f64,
}

/// What counts as one for a coordinate: 1 rad or 0.5 m.
pub(super) fn motion_unit(motion: CoordinateMotion) -> f64 {
    if motion.is_angle() { 1.0 } else { 0.5 }
}

/// Random states that the mechanism can reach.
struct StateSampling {
    /// The active coordinates.
    active: Vec<SampledCoordinate>,
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
        let active: Vec<SampledCoordinate> = coordinates
            .filter(|c| !c.passive)
            .map(|c| SampledCoordinate {
                nominal: c.nominal,
                unit: motion_unit(c.motion),
                travel: 1.0,
            })
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

    /// Determines how much further each coordinate goes: until one of the passive coordinates moves as far as the
    /// coordinate itself would without this. Returns a warning if the nominal pose is near a fold of the loops.
    fn extend_travel(&mut self, model: &Model, evaluator: &ModelEvaluator<'_>) -> Option<String> {
        let coordinates = &model.derivation.mechanism.coordinates;
        let names = |is_passive: bool| -> Vec<&str> {
            let these = coordinates.iter().filter(|c| c.passive == is_passive);
            these.map(|c| c.name.as_str()).collect()
        };
        let mut warning = None;
        for i in 0..self.active.len() {
            let Some(speeds) = self.passive_speeds(model, evaluator, i) else {
                continue;
            };
            let fastest = speeds.iter().flatten().fold(0.0_f64, |most, x| most.max(*x));
            if fastest > 0.0 && fastest < SLOW {
                self.active[i].travel = fastest.recip().clamp(1.0, LARGEST_TRAVEL);
            }
            // The first pose is the nominal one.
            let Some((nominal, others)) = speeds.split_first().filter(|(_, others)| !others.is_empty()) else {
                continue;
            };
            let median = |p: usize| {
                let mut all: Vec<f64> = others.iter().map(|speeds| speeds[p]).collect();
                all.sort_by(f64::total_cmp);
                all[all.len() / 2]
            };
            let fold = (0..nominal.len()).find(|p| nominal[*p] > NEAR_FOLD * median(*p).max(SLOW));
            warning = warning.or_else(|| {
                let p = fold?;
                Some(format!(
                    "the nominal pose is near a fold of the loops: `{}` moves {} times as fast as `{}` there, and {} times at \
                     poses around it; small errors of the lengths change this pose much; choose another nominal pose",
                    names(true)[p],
                    significant(nominal[p], 3),
                    names(false)[i],
                    significant(median(p), 3)
                ))
            });
        }
        warning
    }

    /// How fast each passive coordinate moves if one active coordinate moves at the rate one, in rad or half metres: at
    /// the nominal pose and at random ones, because a link may be at its dead centre. `None` if the nominal pose has no
    /// rates.
    fn passive_speeds(&self, model: &Model, evaluator: &ModelEvaluator<'_>, active: usize) -> Option<Vec<Vec<f64>>> {
        let coordinates = model.derivation.mechanism.coordinates.iter();
        let units: Vec<f64> = coordinates
            .filter(|c| c.passive)
            .map(|c| motion_unit(c.motion))
            .collect();
        let n = self.active.len();
        let mut random = RandomBits::new(0x7370_696e);
        let mut rates = vec![0.0; n];
        rates[active] = self.active[active].unit;
        let zeros = vec![0.0; n.max(self.n_drives)];
        let mut speeds = Vec::new();
        for sample in 0..TRAVEL_SAMPLES {
            let reach = if sample == 0 { 0.0 } else { self.reach };
            let pose = self
                .active
                .iter()
                .map(|c| c.nominal + c.unit * reach * draw(&mut random));
            let q: Vec<f64> = pose.collect();
            let state = MotionStates {
                q: q.iter().map(std::slice::from_ref).collect(),
                qd: rates.iter().map(std::slice::from_ref).collect(),
                qdd: zeros[..n].iter().map(std::slice::from_ref).collect(),
                load: zeros[..self.n_drives].iter().map(std::slice::from_ref).collect(),
            };
            match evaluator.passive_motion(&state) {
                Ok(motion) => {
                    let rates = motion.iter().flatten().skip(units.len());
                    speeds.push(rates.zip(&units).map(|(rate, unit)| (rate / unit).abs()).collect());
                }
                Err(_) if sample == 0 => return None,
                Err(_) => {}
            }
        }
        Some(speeds)
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
                .map(|c| c.nominal + c.unit * self.reach * c.travel * draw(&mut self.random))
                .collect();
            let still = MotionStates {
                q: q.iter().map(std::slice::from_ref).collect(),
                qd: resting(n),
                qdd: resting(n),
                load: resting(self.n_drives),
            };
            // Every refused pose narrows the range around the nominal pose.
            if evaluator.check_states(&still).is_err() {
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
            for motion in &mut self.columns[1..3] {
                for (value, c) in motion
                    .iter_mut()
                    .filter_map(|column| column.last_mut())
                    .zip(&self.active)
                {
                    *value *= c.travel;
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
