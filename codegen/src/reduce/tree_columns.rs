//! Columns of the inertia of the links of a tree, and relations between them from [`link_spaces`](super::link_spaces),
//! without points of motion.
//!
//! A tree of links with one joint each goes in. A relation's factors for given constants come out: the combination of
//! columns vanishes exactly if the inertia of each link, together with what its children move to it, satisfies the
//! link's own functionals, and on the last common link those of all effects.

use std::collections::BTreeSet;

use modelmill_algebra::eliminate::RowEchelonForm;
use modelmill_algebra::field::{FieldElement, MODULUS, RandomStream};

use super::link_spaces::{LinkMobility, LinkPose, LinkSpaces, PARAMETERS, SpaceDimensions, SymmetricFour};
use crate::expr::independent::SEED;
use crate::expr::{Atom, EvaluationTape, ExprId, FieldPoint, Graph};
use crate::newton_euler::{InertiaElement, InertiaFactors};
use crate::regressor::UnreducedEquations;
use crate::tree::{KinematicTree, TreeLink};

/// Largest number of draws of constants until all expressions have values.
const MOST_DRAWS: usize = 100;

/// Number of expressions of a link's pose: three axes and a position.
const POSE_SIZE: usize = 12;

/// A tree whose links move by one coordinate each, or freely, with the columns of their inertia.
pub(super) struct TreeColumns {
    /// How each link moves.
    mobilities: Vec<LinkMobility>,
    /// The parent of each link.
    parents: Vec<Option<usize>>,
    /// Index of each link's coordinate.
    coordinates: Vec<Option<usize>>,
    /// Poses of all links relative to their parents.
    poses: EvaluationTape,
    /// Gravity, then ten elements for each link of each column.
    constants: EvaluationTape,
    /// The links on which each effective column has inertia, with the position among the elements; empty for columns of
    /// other kinds.
    links: Vec<Vec<(usize, usize)>>,
    /// Dimensions of the spaces of each link for general constants.
    dimensions: Vec<SpaceDimensions>,
}

/// The spaces of all links and the inertia of all columns, for given constants.
pub(super) struct TreeValues<const P: u64> {
    spaces: Vec<LinkSpaces<P>>,
    /// The inertia of each column on each of its links.
    inertias: Vec<SymmetricFour<P>>,
}

impl TreeColumns {
    /// Prepares the links and the columns of the products in `effective`; `None` if the mechanism is not such a tree.
    pub(super) fn new(
        graph: &mut Graph,
        equations: &UnreducedEquations,
        effective: &[usize],
        stream: &mut RandomStream,
    ) -> Option<Self> {
        let loops = &equations.projection.loops;
        if !loops.closures.is_empty() || !loops.passive.is_empty() {
            return None;
        }
        let tree = &equations.tree;
        let (mobilities, coordinates) = single_joints(tree)?;
        let mut poses = Vec::with_capacity(POSE_SIZE * tree.links.len());
        for (link, coordinate) in tree.links.iter().zip(&coordinates) {
            let pose = pose_of(graph, link);
            if !depends_only_on(graph, &pose, *coordinate) {
                return None;
            }
            poses.extend(pose);
        }
        let mut constants = equations.gravity.to_vec();
        let mut links = Vec::with_capacity(effective.len());
        let mut n_inertias = 0;
        for k in effective {
            let inertias: Vec<(usize, &InertiaFactors)> =
                equations.inertia.link_inertias(&equations.products[*k]).collect();
            // Masses with different places in the two balances are not rigid bodies.
            let is_rigid = inertias.iter().all(|(_, inertia)| has_one_first_moment(inertia));
            let mut found = Vec::new();
            for (link, inertia) in inertias.iter().filter(|_| is_rigid) {
                constants.extend(inertia_elements(inertia));
                found.push((*link, n_inertias));
                n_inertias += 1;
            }
            links.push(found);
        }
        if !depends_only_on(graph, &constants, None) {
            return None;
        }
        let mut columns = Self {
            mobilities,
            parents: tree.links.iter().map(|link| link.parent).collect(),
            coordinates,
            poses: EvaluationTape::new(graph, &poses),
            constants: EvaluationTape::new(graph, &constants),
            links,
            dimensions: vec![SpaceDimensions::MOST; tree.links.len()],
        };
        // Random constants have the dimensions of general ones. Square roots of constants exist for some of them only.
        let atoms = graph.atoms(&[poses, constants].concat());
        let values = (0..MOST_DRAWS).find_map(|_| {
            let mut point = FieldPoint::<FieldElement<MODULUS>> {
                seed: stream.next_bits(),
                root_seed: stream.next_bits(),
                ..FieldPoint::default()
            };
            for atom in &atoms {
                point.values.insert(*atom, stream.next_element());
                point.angles.insert(*atom, stream.next_circle_point());
            }
            columns.evaluate(&point)
        })?;
        columns.dimensions = values.spaces.iter().map(LinkSpaces::dimensions).collect();
        Some(columns)
    }

    /// Number of base parameters of the links' inertia: the functionals that are their own, link by link.
    #[cfg(test)]
    pub(super) fn n_base_parameters(&self) -> usize {
        self.dimensions.iter().map(SpaceDimensions::n_own).sum()
    }

    /// Columns in the order in which they are tried for a relation of `column`: those of its own link first, then link by
    /// link to the base, then all others; within a link the last ones first.
    pub(super) fn nearest_first(&self, column: usize, before: &[usize]) -> Vec<usize> {
        let mut path = Vec::new();
        let mut next = self.links[column].last().map(|(link, _)| *link);
        while let Some(link) = next {
            path.push(link);
            next = self.parents[link];
        }
        let distance = |k: &usize| {
            let link = self.links[*k].last().map(|(link, _)| *link);
            let at = path.iter().position(|other| Some(*other) == link);
            at.unwrap_or(usize::MAX)
        };
        let mut sorted: Vec<(usize, usize)> = before.iter().rev().map(|k| (distance(k), *k)).collect();
        // A stable sort, so that later columns stay first.
        sorted.sort_by_key(|(distance, _)| *distance);
        sorted.into_iter().map(|(_, k)| k).collect()
    }

    /// Number of links.
    pub(super) fn n_all_links(&self) -> usize {
        self.parents.len()
    }

    /// Number of links on which some columns have inertia; `None` if one is of another kind.
    pub(super) fn n_links(&self, columns: impl Iterator<Item = usize>) -> Option<usize> {
        let mut found = BTreeSet::new();
        for k in columns {
            if self.links[k].is_empty() {
                return None;
            }
            found.extend(self.links[k].iter().map(|(link, _)| *link));
        }
        Some(found.len())
    }

    /// Spaces of the links and inertia of the columns for given constants; `None` if an expression has no value there.
    pub(super) fn evaluate<const P: u64>(&self, constants: &FieldPoint<FieldElement<P>>) -> Option<TreeValues<P>> {
        // Positions of the joints are the same for all constants. They only have to differ from each other.
        let mut stream = RandomStream::new(SEED);
        let n_poses = self.mobilities.iter().map(|mobility| mobility.n_poses()).max()?;
        let mut point = constants.clone();
        let mut sampled = Vec::with_capacity(n_poses);
        for _ in 0..n_poses {
            for i in self.coordinates.iter().flatten() {
                point.values.insert(Atom::Coordinate(*i), stream.next_element());
                point.angles.insert(Atom::Coordinate(*i), stream.next_circle_point());
            }
            sampled.push(self.poses.evaluate(&point)?);
        }
        let values = self.constants.evaluate(constants)?;
        let (gravity, elements) = values.split_at(3);
        let base = LinkSpaces::base([gravity[0], gravity[1], gravity[2]]);
        let mut spaces: Vec<LinkSpaces<P>> = Vec::with_capacity(self.parents.len());
        for (i, (mobility, parent)) in self.mobilities.iter().zip(&self.parents).enumerate() {
            let poses: Vec<LinkPose<P>> = (sampled[..mobility.n_poses()].iter())
                .map(|values| link_pose(&values[POSE_SIZE * i..]))
                .collect();
            let before = parent.map_or(&base, |parent| &spaces[parent]);
            spaces.push(before.next(*mobility, &poses, self.dimensions[i]));
        }
        let inertias = elements
            .chunks(PARAMETERS)
            .map(|x| SymmetricFour::from_inertia(x[0], [x[1], x[2], x[3]], std::array::from_fn(|i| x[4 + i])));
        Some(TreeValues {
            spaces,
            inertias: inertias.collect(),
        })
    }

    /// The factors with which `columns` add up to `column`; `None` if they do not, or in more than one way.
    pub(super) fn relation_factors<const P: u64>(
        &self,
        values: &TreeValues<P>,
        columns: &[usize],
        column: usize,
    ) -> Option<Vec<FieldElement<P>>> {
        let n = columns.len();
        // Inertia of each link per unknown factor, and for the column itself.
        let mut inertias: Vec<Option<Vec<SymmetricFour<P>>>> = vec![None; self.parents.len()];
        for (at, k) in columns.iter().chain([&column]).enumerate() {
            for (link, position) in &self.links[*k] {
                let on_link = inertias[*link].get_or_insert_with(|| vec![SymmetricFour::ZERO; n + 1]);
                on_link[at].add(&values.inertias[*position]);
            }
        }
        let top = self.common_link(columns.iter().chain([&column]));
        let order: Vec<usize> = (0..=n).collect();
        let mut echelon = RowEchelonForm::<P>::new(&order);
        // From the ends to the base, because a parent receives from its children.
        for i in (0..self.parents.len()).rev() {
            let Some(here) = inertias[i].take() else { continue };
            let space = &values.spaces[i];
            let is_top = Some(i) == top;
            let rows = if is_top {
                space.effective_rows()
            } else {
                space.own_rows().to_vec()
            };
            for functional in rows {
                let row: Vec<FieldElement<P>> = here.iter().map(|inertia| inertia.weighted(&functional)).collect();
                if row.iter().any(|x| *x != FieldElement::ZERO) {
                    echelon.insert(row);
                }
            }
            if is_top {
                break;
            }
            let Some(parent) = self.parents[i] else { continue };
            let above = inertias[parent].get_or_insert_with(|| vec![SymmetricFour::ZERO; n + 1]);
            for (sum, inertia) in above.iter_mut().zip(&here) {
                if *inertia != SymmetricFour::ZERO {
                    sum.add(&space.moved_out(inertia));
                }
            }
        }
        // A pivot in the last position is a contradiction.
        if echelon.pivots.len() != n || echelon.pivots.contains(&n) {
            return None;
        }
        (0..n).map(|k| echelon.entry(k, n)).collect()
    }

    /// The last link that carries all links of some columns; `None` for the base.
    fn common_link<'a>(&self, columns: impl Iterator<Item = &'a usize>) -> Option<usize> {
        let mut common: Option<Vec<usize>> = None;
        for (link, _) in columns.flat_map(|k| &self.links[*k]) {
            let mut path = Vec::new();
            let mut next = Some(*link);
            while let Some(i) = next {
                path.push(i);
                next = self.parents[i];
            }
            path.reverse();
            common = Some(match common {
                None => path,
                Some(so_far) => (so_far.iter().zip(&path))
                    .take_while(|(a, b)| a == b)
                    .map(|(a, _)| *a)
                    .collect(),
            });
        }
        common?.last().copied()
    }
}

/// How every link moves, and by which coordinate; `None` if a link has more than one coordinate, or a coordinate more
/// than one link.
fn single_joints(tree: &KinematicTree) -> Option<(Vec<LinkMobility>, Vec<Option<usize>>)> {
    let mut seen = BTreeSet::new();
    let mut all = (Vec::new(), Vec::new());
    for link in &tree.links {
        let (mobility, coordinate) = match (link.turns.as_slice(), link.slides.as_slice(), link.free.is_some()) {
            ([], [], true) => (LinkMobility::Free, None),
            ([], [], false) => (LinkMobility::Fixed, None),
            ([(i, 1 | -1)], [], false) => (LinkMobility::Revolute, Some(*i)),
            ([], [(i, _)], false) => (LinkMobility::Prismatic, Some(*i)),
            _ => return None,
        };
        if coordinate.is_some_and(|i| !seen.insert(i)) {
            return None;
        }
        all.0.push(mobility);
        all.1.push(coordinate);
    }
    Some(all)
}

/// The axes of a link in its parent's frame, and its position there.
fn pose_of(graph: &mut Graph, link: &TreeLink) -> Vec<ExprId> {
    let mut found = Vec::with_capacity(POSE_SIZE);
    for axis in 0..3 {
        let mut v = [Graph::ZERO; 3];
        v[axis] = Graph::ONE;
        // A free body's pose is not used.
        if link.free.is_none() {
            v = graph.rotate_out(&link.joint, &v);
            for turn in link.pre.iter().rev() {
                v = graph.rotate_out(turn, &v);
            }
        }
        found.extend(v);
    }
    found.extend(link.position);
    found
}

/// The pose of a link from its values.
fn link_pose<const P: u64>(values: &[FieldElement<P>]) -> LinkPose<P> {
    let vector = |at: usize| std::array::from_fn(|i| values[3 * at + i]);
    LinkPose {
        axes: [vector(0), vector(1), vector(2)],
        position: vector(3),
    }
}

/// Whether expressions contain constants and one coordinate only.
fn depends_only_on(graph: &Graph, roots: &[ExprId], coordinate: Option<usize>) -> bool {
    graph.atoms(roots).into_iter().all(|atom| match atom {
        Atom::Constant(_) | Atom::Pi => true,
        Atom::Coordinate(i) => Some(i) == coordinate,
        _ => false,
    })
}

/// Whether the first moments in the balances of forces and of moments are the same.
fn has_one_first_moment(inertia: &InertiaFactors) -> bool {
    (0..3).all(|i| inertia[InertiaElement::ForceMoment(i).index()] == inertia[InertiaElement::MomentMoment(i).index()])
}

/// Mass, first moments and inertia matrix of a link.
fn inertia_elements(inertia: &InertiaFactors) -> impl Iterator<Item = ExprId> {
    let first = (0..3).map(InertiaElement::ForceMoment);
    let second = (0..6).map(InertiaElement::Inertia);
    let all = std::iter::once(InertiaElement::Mass).chain(first).chain(second);
    all.map(|element| inertia[element.index()])
}
