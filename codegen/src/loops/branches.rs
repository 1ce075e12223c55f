//! Whether square roots choose between branches of the motion that can be told apart.
//!
//! A loop solved by a square root has two assembly modes. Where its radicand is no square on the variety of what was
//! solved before, both modes are one irreducible variety, and any choice of the root in the field serves. Where it is a
//! square, the variety falls apart: a parallelogram and its crossed linkage, a four-bar and its mirror image on the same
//! crank. Then the sign of the root follows from other coordinates and may even change along one branch.
//! Which is the case shows in the field: a radicand that is no square function takes square and other values alike.
//!
//! Decision: branches are separated before anything is sampled. Equal radicands get the same root, that of the
//! nominal pose, so that mirrored loops stay mirrored. A radicand that is a square at forty random points is a
//! square everywhere. If it is the square of a polynomial, the polynomial replaces the root (`whole_root`); any
//! other such loop is reduced in floating point and solved by Newton's method. Whether roots are independent
//! follows from their quadratic characters: the sum of some of them is constant only if a product of their
//! radicands is a square (Kummer).

use modelmill_algebra::field::{Element, Extended, MODULUS, Number, Stream};
use modelmill_spec::Mechanism;

use super::all::Loops;
use super::field_poses::{FieldPoses, MOST_DRAWS};
use super::plan::{Unknowns, plan};
use super::solve_step::{Plan, radicands};
use crate::DeriveError;
use crate::expr::independent::SEED;
use crate::expr::{ExprId, FieldPoint, Graph};

/// What a square root is to those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Branch {
    /// Its sign is free.
    Free,
    /// Its radicand equals an earlier one: so does the root, but for the sign that the nominal pose tells.
    Twin,
    /// Its radicand is an earlier one times a constant.
    Multiple,
    /// Its sign follows from the other coordinates in some other way.
    Bound,
}

/// A radicand of random values in which squares and others have not both been seen by then is a square: wrong with a
/// probability of 2^-39.
const ENOUGH: usize = 40;

/// The order in which the loops give the passive coordinates in closed form, if every root keeps its sign wherever the
/// mechanism can move; otherwise the loops must be followed.
pub(crate) fn closed_form(graph: &mut Graph, mechanism: &Mechanism, loops: &Loops) -> Option<Plan> {
    let found = plan(graph, mechanism, loops, Unknowns::Passive)?;
    if found.steps.iter().all(|step| step.solved.root.is_none()) {
        return Some(found);
    }
    let poses = FieldPoses::new(graph, mechanism, found.clone(), &loops.residual);
    let branches = branches(graph, &poses, &[]).ok()?;
    (!branches.contains(&Branch::Bound)).then_some(found)
}

/// What each square root on the way to a pose is, and each of those of coordinates under `outputs`.
///
/// Poses are closed over the quadratic extension, where roots of the prime field always exist.
pub(crate) fn branches(
    graph: &Graph,
    poses: &FieldPoses,
    outputs: &[ExprId],
) -> Result<Vec<Branch>, DeriveError> {
    let further = radicands(graph, outputs);
    let of_steps: usize = poses.steps.iter().map(|s| s.radicands.len()).sum();
    let mut seen: Vec<Seen> = (0..of_steps + further.len()).map(Seen::new).collect();
    let mut stream = Stream::new(SEED);
    let constants = poses.constants::<MODULUS>(&mut stream)?;
    let mut kept = Characters::default();
    for _ in 0..MOST_DRAWS {
        if (0..seen.len()).all(|k| seen[k].is_settled() || kept.is_settled(k)) {
            break;
        }
        let mut point: FieldPoint<Extended> = poses.open(&constants, &mut stream);
        let mut values: Vec<Extended> = Vec::new();
        // Says whether the root exists, so that what comes after it can be looked at.
        let mut note = |value: Option<Vec<Extended>>| -> Option<()> {
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
            further
                .iter()
                .try_for_each(|radicand| note(radicand.evaluate(&point)))
        };
        // Where a root does not exist the next draw goes on.
        let _: Option<()> = walk();
        let inverses: Vec<Extended> = values
            .iter()
            .map(|v| v.inverse().unwrap_or(Extended::ZERO))
            .collect();
        let mut so_far_within = true;
        for (k, value) in values.iter().enumerate() {
            let is_within = value.im == Element::ZERO;
            let is_square = if is_within {
                value.re.square_root().is_some()
            } else {
                value.square_root().is_some()
            };
            // Squares of the prime field and others are told apart where all roots before lie in it, others of the
            // extension everywhere.
            if so_far_within || !is_within {
                seen[k].note(is_square, so_far_within);
            }
            seen[k].compare(*value, &inverses[..k]);
            so_far_within &= is_within && is_square;
        }
        kept.note(&values);
    }
    Ok((0..seen.len())
        .map(|k| {
            if kept.is_settled(k) && kept.is_independent(k) {
                Branch::Free
            } else {
                seen[k].branch()
            }
        })
        .collect())
}

/// Which radicands were squares of the prime field, draw by draw, each as far as it came.
///
/// Roots of functions of the free coordinates alone are independent unless a product of some of the radicands is a
/// square, up to a sign (Kummer): then the sum of their characters is the same at every draw.
#[derive(Default)]
struct Characters {
    rows: Vec<Vec<bool>>,
    /// How many draws came as far as each radicand.
    draws: Vec<usize>,
    /// Radicands that were not always in the prime field: they depend on other roots.
    leaves: Vec<bool>,
}

impl Characters {
    fn note(&mut self, values: &[Extended]) {
        let n = values.len().max(self.leaves.len());
        self.leaves.resize(n, false);
        self.draws.resize(n, 0);
        for (k, value) in values.iter().enumerate() {
            self.leaves[k] |= value.im != Element::ZERO;
            self.draws[k] += 1;
        }
        self.rows.push(
            values
                .iter()
                .map(|v| v.im == Element::ZERO && v.re.square_root().is_none())
                .collect(),
        );
    }

    /// Whether radicand `k` is a function of free coordinates that has been seen often enough.
    fn is_settled(&self, k: usize) -> bool {
        self.draws.get(k).is_some_and(|n| *n >= k + ENOUGH) && !self.leaves[k]
    }

    /// Whether radicand `k` is independent of those before it: elimination over the field with two elements.
    fn is_independent(&self, k: usize) -> bool {
        let rows: Vec<&Vec<bool>> = self.rows.iter().filter(|row| row.len() > k).collect();
        // Radicands in columns, after one of ones.
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

/// What has been seen of one radicand.
struct Seen {
    squares: usize,
    others: usize,
    /// Draws at which it was looked at.
    draws: usize,
    /// Whether it was no square even in the extension.
    is_outside: bool,
    /// Its ratio to each earlier radicand, as long as it has been the same at all poses.
    ratios: Vec<Option<Extended>>,
}

impl Seen {
    fn new(earlier: usize) -> Self {
        Self {
            squares: 0,
            others: 0,
            draws: 0,
            is_outside: false,
            ratios: vec![None; earlier],
        }
    }

    fn note(&mut self, is_square: bool, within: bool) {
        if !within {
            self.is_outside |= !is_square;
        } else if is_square {
            self.squares += 1;
        } else {
            self.others += 1;
        }
    }

    fn compare(&mut self, value: Extended, inverses: &[Extended]) {
        let first = self.draws == 0;
        self.draws += 1;
        for (ratio, inverse) in self.ratios.iter_mut().zip(inverses) {
            let now = value * *inverse;
            *ratio = if first {
                Some(now)
            } else {
                ratio.filter(|r| *r == now)
            };
        }
    }

    fn is_free(&self) -> bool {
        self.is_outside || (self.squares > 0 && self.others > 0)
    }

    fn is_settled(&self) -> bool {
        self.is_free() || self.squares + self.others >= ENOUGH
    }

    fn branch(&self) -> Branch {
        let mut ratios = self.ratios.iter().flatten();
        // What was hardly ever reached is left to those who draw points.
        if self.is_free() || self.draws < ENOUGH {
            Branch::Free
        } else if self.ratios.contains(&Some(Extended::ONE)) {
            Branch::Twin
        } else if ratios.next().is_some() {
            Branch::Multiple
        } else {
            Branch::Bound
        }
    }
}
