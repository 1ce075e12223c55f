//! Solves the loop closures of a description: numeric kinematics and point pairs go in. Out come the independent pairs,
//! the passive variables (determined by loop closure), and a pose at which the loops are closed.

use nalgebra::DMatrix;

use super::chain::{CoincidentPair, FrameChain, rank};

/// Gap relative to the size up to which loops count as closed.
const CLOSED: f64 = 1e-11;
/// Gap relative to the size up to which loops count as closed within the digits of the description.
const NEARLY_CLOSED: f64 = 1e-6;
/// Singular values below this share of the largest count as zero.
const ZERO_SHARE: f64 = 1e-7;
/// If loops do not close exactly, redundant equations have singular values up to this factor times the gap relative to
/// the size.
const GAP_FACTOR: f64 = 100.0;
/// A pose with passive variables of worse conditioning than this is not used as nominal pose if there is a better one.
const WELL_CONDITIONED: f64 = 1e-3;

/// Below this conditioning, another choice of passive variables is searched for.
const POORLY_CONDITIONED: f64 = 1e-2;

/// Distance by which a value may exceed its range and still counts as at its limit, rad or m.
pub(crate) const RANGE_TOLERANCE: f64 = 1e-9;
/// Number of starting poses that are tried.
const ATTEMPTS: usize = 200;
/// Number of them near the pose of the description.
const NEAR_ATTEMPTS: usize = 21;
/// If a gap of more than this share of the size remains from all of them, no other pose is tried: two points are farther apart
/// than the mechanism reaches.
const FARTHEST_CLOSING_GAP: f64 = 0.9;
/// Multiplications after which no further starting pose is tried: some seconds. Loops that close need a hundredth of it.
const WORK_LIMIT: f64 = 1e10;

/// Result of closing the loops.
pub(crate) struct LoopSolution {
    /// The pairs with at least one condition that the pairs before do not contain.
    pub(crate) pairs: Vec<CoincidentPair>,
    /// Which variables are passive, by index of the variable.
    pub(crate) passive: Vec<bool>,
    /// Values of all variables at a pose with closed loops, rad or m.
    pub(crate) values: Vec<f64>,
    /// Whether the pose is not the nearest to that of the description.
    pub(crate) is_moved: bool,
    /// The largest gap relative to the size by which points were moved to coincide, if it is above rounding.
    pub(crate) gap: Option<f64>,
    /// Number of conditions counted for each pair by itself, and number of independent conditions of all pairs.
    pub(crate) conditions: [usize; 2],
}

/// Closes loops from the values `start`. Variables with low `reluctance` should stay independent. A pose within
/// `ranges` is preferred.
///
/// Fails if the loops do not close from any of the starting poses.
pub(crate) fn close_loops(
    chain: &FrameChain,
    pairs: &[CoincidentPair],
    start: &[f64],
    ranges: &[Option<[f64; 2]>],
    reluctance: &[u8],
) -> Result<LoopSolution, String> {
    let mut noise = PoseNoise(1);
    let (mut poses, mut outside): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    let mut least = f64::INFINITY;
    let (mut work, mut n_tried) = (0.0, 0);
    // The pose of the description first, then poses around it and farther away.
    for attempt in 0..ATTEMPTS {
        let spread = match attempt {
            0 => 0.0,
            1..NEAR_ATTEMPTS => 0.1,
            NEAR_ATTEMPTS..=40 => 0.4,
            _ => 1.5,
        };
        let mut values: Vec<f64> = start
            .iter()
            .zip(ranges)
            .map(|(x, range)| {
                // Poses near the start are moved into the ranges; later ones are anywhere within them.
                let moved = x + spread * noise.next();
                match range {
                    Some([low, high]) if attempt > 40 => low + (high - low) * (0.5 + 0.5 * noise.next()),
                    Some([low, high]) if attempt > 0 => moved.clamp(*low, *high),
                    _ => moved,
                }
            })
            .collect();
        // Solve from this pose; poses outside of the ranges are used only if there are no others.
        let (gap, n_steps) = chain.close_pairs(pairs, &mut values);
        least = least.min(gap);
        n_tried += 1;
        work += n_steps as f64 * decomposition_work(3 * pairs.len(), start.len());
        if gap < NEARLY_CLOSED {
            let is_inside = values.iter().zip(ranges).all(|(x, range)| {
                range.is_none_or(|[low, high]| (low - RANGE_TOLERANCE..=high + RANGE_TOLERANCE).contains(x))
            });
            if is_inside {
                poses.push(values);
            } else {
                outside.push(values);
            }
        }
        // Six poses are enough to recognise a singular one.
        let is_hopeless = n_tried == NEAR_ATTEMPTS && least > FARTHEST_CLOSING_GAP;
        // Poses with closed loops cost little, and a singular one is recognised by several of them.
        let is_too_long = work > WORK_LIMIT && poses.is_empty() && outside.is_empty();
        if poses.len() == 6 || is_hopeless || is_too_long {
            break;
        }
    }
    if poses.is_empty() {
        outside.truncate(6);
        poses = outside;
    }
    if poses.is_empty() {
        return Err(format!(
            "its loops do not close; starting poses that were tried: {n_tried}. Gaps of at least {least:.1e} of its size remain"
        ));
    }
    // The largest rank of all poses is that of a general pose; singular poses have less.
    let ranks: Vec<usize> = poses
        .iter()
        .map(|values| independent_conditions(chain, pairs, values).0)
        .collect();
    let wanted = ranks.iter().copied().max().unwrap_or(0);
    // Of the poses with this rank, the one farthest from a singularity.
    let general = (0..poses.len())
        .filter(|k| ranks[*k] == wanted)
        .max_by(|a, b| {
            let share = |k: usize| independent_conditions(chain, pairs, &poses[k]).1;
            share(*a).total_cmp(&share(*b))
        })
        .unwrap_or(0);
    // Redundant pairs and the passive variables are determined at the general pose.
    let pairs = independent_pairs(chain, pairs, &poses[general]);
    let (_, rows, _) = chain.gaps(&pairs, &poses[general]);
    // Three rows of a pair can be dependent, for example in a planar loop.
    let by_itself = (0..pairs.len()).map(|k| rank(&rows.rows(3 * k, 3).into_owned(), ZERO_SHARE).0);
    let passive = choose_passive(&rows, reluctance, wanted);
    // How well the passive variables are determined at a pose.
    let settled = |values: &[f64]| {
        let (_, rows, _) = chain.gaps(&pairs, values);
        passive_conditioning(&rows, &passive)
    };
    // The pose nearest to the description is used, unless it is close to a singularity.
    let mut best = 0;
    if wanted > 0 && settled(&poses[0]) < WELL_CONDITIONED {
        for k in 1..poses.len() {
            if settled(&poses[k]) > 3.0 * settled(&poses[best]) {
                best = k;
            }
        }
    }
    // Close the independent pairs at the chosen pose.
    let mut values = poses.swap_remove(best);
    let (gap, _) = chain.close_pairs(&pairs, &mut values);
    let mut pairs = pairs;
    // Points that miss each other by the digits of the description are redefined to coincide.
    if gap > CLOSED {
        chain.align_pairs(&mut pairs, &values);
    }
    Ok(LoopSolution {
        pairs,
        passive,
        values,
        is_moved: best != 0,
        gap: (gap > CLOSED).then_some(gap),
        conditions: [by_itself.sum(), wanted],
    })
}

/// Multiplications of a singular value decomposition of a matrix with vectors on both sides.
fn decomposition_work(n_rows: usize, n_columns: usize) -> f64 {
    let (less, more) = (n_rows.min(n_columns) as f64, n_rows.max(n_columns) as f64);
    20.0 * less * less * more
}

/// Number of independent conditions of the pairs, and the smallest of their singular values relative to the largest.
fn independent_conditions(chain: &FrameChain, pairs: &[CoincidentPair], values: &[f64]) -> (usize, f64) {
    // Where loops do not close exactly, redundant conditions have singular values of the size of the gap.
    let (gaps, rows, size) = chain.gaps(pairs, values);
    rank(&rows, ZERO_SHARE.max(GAP_FACTOR * gaps.amax() / size))
}

/// The pairs that add a condition to the pairs before them.
fn independent_pairs(chain: &FrameChain, pairs: &[CoincidentPair], values: &[f64]) -> Vec<CoincidentPair> {
    let mut kept: Vec<CoincidentPair> = Vec::new();
    let mut n = 0;
    for pair in pairs {
        // A pair is kept if the rank increases.
        kept.push(*pair);
        let (now, _) = independent_conditions(chain, &kept, values);
        if now == n {
            kept.pop();
        }
        n = now;
    }
    kept
}

/// Chooses as many passive variables as the rank: first those with high reluctance, from the end of the description.
fn choose_passive(rows: &DMatrix<f64>, reluctance: &[u8], wanted: usize) -> Vec<bool> {
    // The sort is stable, so that equal reluctance leaves the order from the end.
    let mut order: Vec<usize> = (0..rows.ncols()).rev().collect();
    order.sort_by_key(|k| std::cmp::Reverse(reluctance[*k]));
    let mut passive = Vec::new();
    // The demand on conditioning is lowered until enough variables are found.
    for least in [1e-2, 1e-4, 1e-6] {
        let n;
        (passive, n) = select_columns(rows, &order, wanted, least);
        if n == wanted {
            break;
        }
    }
    exchange_passive(rows, reluctance, passive)
}

/// Exchanges passive and independent variables of equal reluctance while the passive ones are poorly conditioned and an
/// exchange improves this by a factor of three.
fn exchange_passive(rows: &DMatrix<f64>, reluctance: &[u8], mut passive: Vec<bool>) -> Vec<bool> {
    /// Smallest improvement for which the order of the description is changed.
    const MUCH: f64 = 3.0;
    let n = passive.len();
    let mut now = passive_conditioning(rows, &passive);
    while now < POORLY_CONDITIONED {
        // The best exchange of one pair.
        let mut best = (MUCH * now, None);
        for out in (0..n).filter(|k| passive[*k]) {
            for into in (0..n).filter(|k| !passive[*k] && reluctance[*k] == reluctance[out]) {
                let mut tried = passive.clone();
                (tried[out], tried[into]) = (false, true);
                let then = passive_conditioning(rows, &tried);
                if then > best.0 {
                    best = (then, Some(tried));
                }
            }
        }
        let (then, Some(tried)) = best else { break };
        (now, passive) = (then, tried);
    }
    passive
}

/// The smallest singular value of the passive columns relative to the largest; zero if the loops do not determine these
/// variables.
fn passive_conditioning(rows: &DMatrix<f64>, passive: &[bool]) -> f64 {
    // The Jacobian of the passive variables alone.
    let columns: Vec<_> = (0..passive.len())
        .filter(|k| passive[*k])
        .map(|k| rows.column(k).into_owned())
        .collect();
    // Closures without a condition have no passive variable.
    if columns.is_empty() {
        return 1.0;
    }
    match rank(&DMatrix::from_columns(&columns), ZERO_SHARE) {
        (n, share) if n == columns.len() => share,
        _ => 0.0,
    }
}

/// Selects columns in the given order by Gram-Schmidt: a column is taken if the part orthogonal to those before is at
/// least the share `least` of it. Returns the selection and its size.
fn select_columns(rows: &DMatrix<f64>, order: &[usize], wanted: usize, least: f64) -> (Vec<bool>, usize) {
    let mut passive = vec![false; rows.ncols()];
    // Orthonormal directions of the columns chosen so far; two passes of Gram-Schmidt keep them orthogonal to rounding.
    let scale = rows.amax().max(f64::MIN_POSITIVE);
    let mut chosen: Vec<nalgebra::DVector<f64>> = Vec::new();
    for k in order {
        let column = rows.column(*k) / scale;
        // The part of the column that is orthogonal to those chosen.
        let length = column.norm();
        let mut rest = column.into_owned();
        for _ in 0..2 {
            for direction in &chosen {
                let along = direction.dot(&rest);
                rest -= direction * along;
            }
        }
        // Columns that are almost zero are never taken.
        if chosen.len() < wanted && rest.norm() > least * length.max(1e-6) {
            chosen.push(rest.normalize());
            passive[*k] = true;
        }
    }
    (passive, chosen.len())
}

/// A generator of pseudorandom numbers between -1 and 1 (linear congruential), with the same sequence on every machine.
struct PoseNoise(u64);

impl PoseNoise {
    /// The next number.
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}
