//! Whether square roots choose between branches of the motion that can be distinguished.
//!
//! A loop solved by a square root has two assembly modes. Where its radicand is no square on the variety of the loops
//! solved before, both modes are one irreducible variety, and any choice of the root in the field is valid. Where it is
//! a square, the variety splits: a parallelogram and its crossed linkage, a four-bar and its mirror image on the same
//! crank. Then the sign of the root is determined by other coordinates and may even change along one branch. The field
//! shows which case applies: a radicand that is no square function takes square and other values alike.
//!
//! Decision: branches are separated before anything is sampled. Equal radicands get the same root, that of the
//! nominal pose, so that mirrored loops stay mirrored. A radicand that is a square at forty random points is a
//! square everywhere. If it is the square of a polynomial, the polynomial replaces the root (`whole_root`); any
//! other such loop is reduced in floating point and solved by Newton's method. Whether roots are independent
//! follows from their quadratic characters: the sum of some of them is constant only if a product of their
//! radicands is a square (Kummer).

use modelmill_algebra::field::{ExtensionElement, FieldElement, FieldNumber, MODULUS, RandomStream};
use modelmill_spec::Mechanism;

use super::all::KinematicLoops;
use super::field_poses::{FieldPoseSampler, MOST_DRAWS};
use super::plan::{SolvableCoordinates, plan};
use super::solve_step::{LoopPlan, radicands};
use crate::DeriveError;
use crate::expr::independent::SEED;
use crate::expr::{ExprId, FieldPoint, Graph};

/// How a square root depends on those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RootBranch {
    /// Its sign can be chosen.
    Free,
    /// Its radicand equals an earlier one: so does the root, up to the sign that the nominal pose has.
    Twin,
    /// Its radicand is an earlier one times a constant other than 1.
    Multiple,
    /// Its sign is determined by the other coordinates in some other way.
    Bound,
}

/// After this many draws a radicand that has only been a square counts as a square function: wrong with a
/// probability of 2^-39.
const SUFFICIENT_DRAWS: usize = 40;

/// The order in which the loops give the passive coordinates in closed form, if every root keeps its sign in all of the
/// motion; `None` where the loops must be solved numerically.
pub(crate) fn closed_form_plan(graph: &mut Graph, mechanism: &Mechanism, loops: &KinematicLoops) -> Option<LoopPlan> {
    let found = plan(graph, mechanism, loops, SolvableCoordinates::Passive)?;
    if found.steps.iter().all(|step| step.solved.root.is_none()) {
        return Some(found);
    }
    // Roots whose sign is determined by the motion have no closed form with a fixed sign.
    let poses = FieldPoseSampler::new(graph, mechanism, found.clone(), &loops.residual);
    let branches = root_branches(graph, &poses, &[]).ok()?;
    (!branches.contains(&RootBranch::Bound)).then_some(found)
}

/// The kind of every square root on the way to a pose, followed by those of the roots of coordinates in `outputs`.
///
/// Poses are closed over the quadratic extension, where roots of the prime field always exist.
///
/// # Errors
/// [`DeriveError::NoPointFound`] if no constants are found for which all their functions exist.
pub(crate) fn root_branches(
    graph: &Graph,
    poses: &FieldPoseSampler,
    outputs: &[ExprId],
) -> Result<Vec<RootBranch>, DeriveError> {
    let further = radicands(graph, outputs);
    let of_steps: usize = poses.steps.iter().map(|s| s.radicands.len()).sum();
    let mut seen: Vec<RadicandStatistics> = (0..of_steps + further.len()).map(RadicandStatistics::new).collect();
    let mut stream = RandomStream::new(SEED);
    let constants = poses.draw_constants::<MODULUS>(&mut stream)?;
    let mut kept = QuadraticCharacters::default();
    for _ in 0..MOST_DRAWS {
        if (0..seen.len()).all(|k| seen[k].is_decided() || kept.is_decided(k)) {
            break;
        }
        // Coordinates of the point lie in the prime field; roots may lie in its quadratic extension.
        let mut point: FieldPoint<ExtensionElement> = poses.draw_open_point(&constants, &mut stream);
        let mut values: Vec<ExtensionElement> = Vec::new();
        // Records a radicand, and stops the walk where its root does not exist.
        let mut note = |value: Option<Vec<ExtensionElement>>| -> Option<()> {
            let value = value?[0];
            values.push(value);
            value.square_root().map(|_| ())
        };
        let mut walk = || -> Option<()> {
            for step in &poses.steps {
                for radicand in &step.radicands {
                    note(radicand.evaluate(&point))?;
                }
                step.solve(&mut point)?;
            }
            further.iter().try_for_each(|radicand| note(radicand.evaluate(&point)))
        };
        // Where a root does not exist, the radicands so far are still counted.
        let _: Option<()> = walk();
        let inverses: Vec<ExtensionElement> = values
            .iter()
            .map(|v| v.inverse().unwrap_or(ExtensionElement::ZERO))
            .collect();
        // Whether all roots so far lie in the prime field.
        let mut so_far_within = true;
        for (k, value) in values.iter().enumerate() {
            let is_within = value.im == FieldElement::ZERO;
            let is_square = if is_within {
                value.re.square_root().is_some()
            } else {
                value.square_root().is_some()
            };
            // Squares of the prime field can be distinguished there where all roots before lie in it; in the extension
            // squares can always be distinguished.
            if so_far_within || !is_within {
                seen[k].record_draw(is_square, so_far_within);
            }
            seen[k].record_ratios(*value, &inverses[..k]);
            so_far_within &= is_within && is_square;
        }
        kept.record_draw(&values);
    }
    Ok((0..seen.len())
        .map(|k| {
            if kept.is_decided(k) && kept.is_independent(k) {
                RootBranch::Free
            } else {
                seen[k].classify()
            }
        })
        .collect())
}

/// Which radicands were squares of the prime field, draw by draw, each as far as the draw reached.
///
/// Roots of functions of the independent coordinates alone are independent unless a product of some of the radicands is
/// a square, up to a sign (Kummer). Then the sum of their characters is the same at every draw.
#[derive(Default)]
struct QuadraticCharacters {
    /// Per draw and radicand: whether it was no square.
    rows: Vec<Vec<bool>>,
    /// Number of draws that reached each radicand.
    draws: Vec<usize>,
    /// Radicands that were not always in the prime field, because they depend on other roots.
    leaves: Vec<bool>,
}

impl QuadraticCharacters {
    /// Adds the radicands of one draw.
    fn record_draw(&mut self, values: &[ExtensionElement]) {
        let n = values.len().max(self.leaves.len());
        self.leaves.resize(n, false);
        self.draws.resize(n, 0);
        for (k, value) in values.iter().enumerate() {
            self.leaves[k] |= value.im != FieldElement::ZERO;
            self.draws[k] += 1;
        }
        self.rows.push(
            values
                .iter()
                .map(|v| v.im == FieldElement::ZERO && v.re.square_root().is_none())
                .collect(),
        );
    }

    /// Whether radicand `k` is a function of independent coordinates with a sufficient number of draws.
    fn is_decided(&self, k: usize) -> bool {
        self.draws.get(k).is_some_and(|n| *n >= k + SUFFICIENT_DRAWS) && !self.leaves[k]
    }

    /// Whether radicand `k` is independent of those before it, by elimination over the field with two elements.
    fn is_independent(&self, k: usize) -> bool {
        let rows: Vec<&Vec<bool>> = self.rows.iter().filter(|row| row.len() > k).collect();
        // One column per radicand, after a column of ones, which stands for a constant character.
        let mut columns: Vec<Vec<bool>> = vec![vec![true; rows.len()]];
        for j in (0..=k).filter(|j| !self.leaves[*j]) {
            let mut column: Vec<bool> = rows.iter().map(|row| row[j]).collect();
            for known in &columns {
                let pivot = known.iter().position(|x| *x);
                if pivot.is_some_and(|pivot| column[pivot]) {
                    column.iter_mut().zip(known).for_each(|(x, y)| *x ^= *y);
                }
            }
            if column.contains(&true) {
                columns.push(column);
            } else if j == k {
                return false;
            }
        }
        true
    }
}

/// Counts for one radicand over all draws.
struct RadicandStatistics {
    /// Draws at which it was a square of the prime field.
    squares: usize,
    /// Draws at which it was none.
    others: usize,
    /// Draws that reached it.
    draws: usize,
    /// Whether it was no square even in the quadratic extension.
    is_outside: bool,
    /// Its ratio to each earlier radicand, as long as the ratio is equal at all draws.
    ratios: Vec<Option<ExtensionElement>>,
}

impl RadicandStatistics {
    /// Without draws yet; `earlier` is the number of radicands before it.
    fn new(earlier: usize) -> Self {
        Self {
            squares: 0,
            others: 0,
            draws: 0,
            is_outside: false,
            ratios: vec![None; earlier],
        }
    }

    /// Counts a draw; `within` is whether all roots before it lie in the prime field.
    fn record_draw(&mut self, is_square: bool, within: bool) {
        if !within {
            self.is_outside |= !is_square;
        } else if is_square {
            self.squares += 1;
        } else {
            self.others += 1;
        }
    }

    /// Compares the ratios to earlier radicands with those of the draws before.
    fn record_ratios(&mut self, value: ExtensionElement, inverses: &[ExtensionElement]) {
        let first = self.draws == 0;
        self.draws += 1;
        for (ratio, inverse) in self.ratios.iter_mut().zip(inverses) {
            let now = value * *inverse;
            *ratio = if first { Some(now) } else { ratio.filter(|r| *r == now) };
        }
    }

    /// Whether it has been seen to be no square function.
    fn has_free_sign(&self) -> bool {
        self.is_outside || (self.squares > 0 && self.others > 0)
    }

    /// Whether further draws are of no use.
    fn is_decided(&self) -> bool {
        self.has_free_sign() || self.squares + self.others >= SUFFICIENT_DRAWS
    }

    /// The kind of the root by the draws so far.
    fn classify(&self) -> RootBranch {
        let mut ratios = self.ratios.iter().flatten();
        // A radicand that few draws reached is left to the sampling of points.
        if self.has_free_sign() || self.draws < SUFFICIENT_DRAWS {
            RootBranch::Free
        } else if self.ratios.contains(&Some(ExtensionElement::ONE)) {
            RootBranch::Twin
        } else if ratios.next().is_some() {
            RootBranch::Multiple
        } else {
            RootBranch::Bound
        }
    }
}
