//! Whether square roots choose between branches of the motion that can be told apart.
//!
//! A loop solved by a square root has two assembly modes. Where its radicand is no square on the variety of what was
//! solved before, both modes are one irreducible variety, and any choice of the root in the field serves. Where it is a
//! square, the variety falls apart: a parallelogram and its crossed linkage, a four-bar and its mirror image on the same
//! crank. Then the sign of the root follows from other coordinates and may even change along one branch.
//! Which is the case shows in the field: a radicand that is no square function takes square and other values alike.

use modelmill_spec::Mechanism;

use super::SEED;
use super::plan::{Plan, Unknowns, plan};
use super::poses::{MOST_DRAWS, Poses};
use crate::DeriveError;
use crate::expr::{Atom, ExprId, Graph, Node, Tape, Unary};
use crate::field::{Element, MODULUS, Stream};
use crate::projection::Projection;

/// What a square root is to those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Branch {
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
pub(crate) fn closed_form(
    graph: &mut Graph,
    mechanism: &Mechanism,
    projection: &Projection,
) -> Option<Plan> {
    let found = plan(graph, mechanism, projection, Unknowns::Passive)?;
    if found.steps.iter().all(|step| step.solved.root.is_none()) {
        return Some(found);
    }
    let poses = Poses::new(graph, mechanism, found.clone(), &projection.residual);
    let branches = of(graph, &poses, &[]).ok()?;
    (!branches.contains(&Branch::Bound)).then_some(found)
}

/// What each square root on the way to a pose is, and each of those of coordinates under `outputs`.
pub(super) fn of(
    graph: &Graph,
    poses: &Poses,
    outputs: &[ExprId],
) -> Result<Vec<Branch>, DeriveError> {
    let further = radicands(graph, outputs);
    let of_steps: usize = poses.steps.iter().map(|s| s.radicands.len()).sum();
    let mut seen: Vec<Seen> = (0..of_steps + further.len()).map(Seen::new).collect();
    let mut stream = Stream::new(SEED);
    let constants = poses.constants::<MODULUS>(&mut stream)?;
    for _ in 0..MOST_DRAWS {
        if seen.iter().all(Seen::is_settled) {
            break;
        }
        let mut point = poses.open(&constants, &mut stream);
        let mut values: Vec<Element> = Vec::new();
        // Says whether the root exists, so that what comes after it can be looked at.
        let mut note = |value: Option<Vec<Element>>| -> Option<()> {
            let value = value?[0];
            let inverses: Vec<Element> = values
                .iter()
                .map(|v| v.inverse().unwrap_or(Element::ZERO))
                .collect();
            let is_square = value.square_root().is_some();
            seen[values.len()].note(value, is_square, &inverses);
            values.push(value);
            is_square.then_some(())
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
    }
    Ok(seen.iter().map(Seen::branch).collect())
}

/// What has been seen of one radicand.
struct Seen {
    squares: usize,
    others: usize,
    /// Its ratio to each earlier radicand, as long as it has been the same at all poses.
    ratios: Vec<Option<Element>>,
}

impl Seen {
    fn new(earlier: usize) -> Self {
        Self {
            squares: 0,
            others: 0,
            ratios: vec![None; earlier],
        }
    }

    fn note(&mut self, value: Element, is_square: bool, inverses: &[Element]) {
        let first = self.squares + self.others == 0;
        if is_square {
            self.squares += 1;
        } else {
            self.others += 1;
        }
        for (ratio, inverse) in self.ratios.iter_mut().zip(inverses) {
            let now = value * *inverse;
            *ratio = if first {
                Some(now)
            } else {
                ratio.filter(|r| *r == now)
            };
        }
    }

    fn is_settled(&self) -> bool {
        (self.squares > 0 && self.others > 0) || self.squares + self.others >= ENOUGH
    }

    fn branch(&self) -> Branch {
        let mut ratios = self.ratios.iter().flatten();
        if (self.squares > 0 && self.others > 0) || self.squares + self.others < ENOUGH {
            Branch::Free
        } else if self.ratios.contains(&Some(Element::ONE)) {
            Branch::Twin
        } else if ratios.next().is_some() {
            Branch::Multiple
        } else {
            Branch::Bound
        }
    }
}

/// What roots under `outputs` are taken of, if it depends on coordinates and constants alone.
pub(super) fn radicands(graph: &Graph, outputs: &[ExprId]) -> Vec<Tape> {
    let inner = graph.nodes_of(outputs).filter_map(|node| match node {
        Node::Unary(Unary::Sqrt, inner) => Some(*inner),
        _ => None,
    });
    inner
        .filter(|inner| {
            let atoms = graph.atoms(&[*inner]);
            atoms.iter().any(|a| matches!(a, Atom::Coordinate(_)))
                && atoms
                    .iter()
                    .all(|a| matches!(a, Atom::Coordinate(_) | Atom::Constant(_) | Atom::Pi))
        })
        .map(|inner| Tape::new(graph, &[inner]))
        .collect()
}
