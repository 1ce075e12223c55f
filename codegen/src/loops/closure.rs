//! Loops: the vector equation that closes each of them, in a frame in which it is as simple as it can be.

use modelmill_spec::{FrameIdx, Mechanism, Point};

use crate::DeriveError;
use crate::expr::vector::{self, Turn, Vector, push_turn};
use crate::expr::{AngleSum, Atom, ExprId, Graph};
use crate::loops::parallelogram::Relation;
use crate::loops::spatial;
use crate::tree::Tree;
use crate::tree::expressions;

/// A loop cut open at two points that must coincide.
#[derive(Clone, Debug)]
pub(crate) struct Closure {
    /// Name for people.
    pub(crate) name: String,
    /// Difference of the two positions in the plane of the loop (2) or in the frame of its root (3); all zero.
    pub(crate) residual: Vec<ExprId>,
    /// How many of these are independent of each other and of those of loops before.
    pub(crate) n_independent: usize,
    /// The same as a chain of vectors turned about one axis, if the loop is planar.
    pub(crate) chain: Option<Vec<Leg>>,
    /// Equations that hold where it closes, each without one or another of its coordinates; empty if all loops are
    /// planar.
    pub(crate) equations: Vec<ExprId>,
    /// Relations that solve it outright; empty if there are none.
    pub(crate) relations: Vec<Relation>,
    /// Coordinates on which it depends, sorted.
    pub(crate) coordinates: Vec<usize>,
}

/// A vector of a planar chain, turned by `angle + pi12 * pi/12`.
#[derive(Clone, Debug)]
pub(crate) struct Leg {
    pub(crate) angle: AngleSum,
    pub(crate) pi12: i32,
    pub(crate) vector: [ExprId; 2],
}

/// A stretch of a path: a vector given in a frame that `turns` lead to.
#[derive(Clone)]
pub(crate) struct Stretch {
    pub(crate) turns: Vec<Turn>,
    pub(crate) vector: Vector,
}

/// Position of a point in a frame up its tree, as stretches: `start` turns stand in front of all.
pub(crate) fn stretches(tree: &Tree, links: &[usize], start: &[Turn], at: &Vector) -> Vec<Stretch> {
    let mut turns = start.to_vec();
    let mut path = Vec::new();
    for &i in links {
        let link = &tree.links[i];
        path.push(Stretch {
            turns: turns.clone(),
            vector: link.position,
        });
        for turn in link.pre.iter().chain([&link.joint]) {
            push_turn(&mut turns, turn);
        }
    }
    path.push(Stretch { turns, vector: *at });
    path.retain(|stretch| stretch.vector != vector::ZERO);
    path
}

/// The fixed rotations from the root of a path to the axis of its first turning joint; `None` if nothing turns.
pub(crate) fn fixed_turns(tree: &Tree, links: &[usize]) -> Option<Vec<Turn>> {
    let mut turns = Vec::new();
    for &i in links {
        let link = &tree.links[i];
        for turn in &link.pre {
            push_turn(&mut turns, turn);
        }
        if !link.turns.is_empty() {
            return Some(turns);
        }
        push_turn(&mut turns, &link.joint);
    }
    None
}

pub(crate) fn sum_of(graph: &mut Graph, path: &[Stretch]) -> Vector {
    let vectors: Vec<Vector> = path
        .iter()
        .map(|stretch| {
            let mut v = stretch.vector;
            for turn in stretch.turns.iter().rev() {
                v = graph.turn_out(turn, &v);
            }
            v
        })
        .collect();
    graph.add_vectors(&vectors)
}

pub(crate) fn point_at(graph: &mut Graph, point: &Point) -> Result<Vector, DeriveError> {
    Ok([
        expressions::expression(graph, &point.at[0])?,
        expressions::expression(graph, &point.at[1])?,
        expressions::expression(graph, &point.at[2])?,
    ])
}

/// Position of a point in the base frame.
pub(crate) fn position_in_base(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &Tree,
    point: usize,
) -> Result<Vector, DeriveError> {
    let point = &mechanism.points[point];
    let at = point_at(graph, point)?;
    let path = stretches(tree, &tree.path(tree.link_of(point.frame)), &[], &at);
    Ok(sum_of(graph, &path))
}

/// The paths of two points from the frame that both hang on, and the points' positions in their own frames.
pub(crate) struct Between<'a> {
    pub(crate) paths: [&'a [usize]; 2],
    pub(crate) at: [Vector; 2],
}

impl Between<'_> {
    /// The vector from the second point to the first as stretches, in the common frame turned by `start`.
    pub(crate) fn stretches(&self, graph: &mut Graph, tree: &Tree, start: &[Turn]) -> Vec<Stretch> {
        let [first, second] = [0, 1].map(|i| stretches(tree, self.paths[i], start, &self.at[i]));
        let mut path = first;
        for mut stretch in second {
            stretch.vector = stretch.vector.map(|x| graph.neg(x));
            path.push(stretch);
        }
        path
    }
}

/// Turns the other way, in the opposite order.
pub(crate) fn inverse(turns: &[Turn]) -> Vec<Turn> {
    turns
        .iter()
        .rev()
        .map(|t| Turn {
            axis: t.axis,
            sum: AngleSum::NONE.plus(&t.sum, -1),
            pi12: -t.pi12,
        })
        .collect()
}

/// The square of the distance of two points, written in the frame between them in which it is simplest: along a slide
/// it is the square of one length.
pub(crate) fn distance_squared(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &Tree,
    points: [usize; 2],
) -> Result<ExprId, DeriveError> {
    let points = points.map(|i| &mechanism.points[i]);
    let at = [point_at(graph, points[0])?, point_at(graph, points[1])?];
    let paths = points.map(|p| tree.path(tree.link_of(p.frame)));
    let common = (paths[0].iter().zip(&paths[1]))
        .take_while(|(x, y)| x == y)
        .count();
    let between = Between {
        paths: [&paths[0][common..], &paths[1][common..]],
        at,
    };
    let mut best: Option<(usize, ExprId)> = None;
    let mut try_frame = |graph: &mut Graph, turns: &[Turn]| {
        let path = between.stretches(graph, tree, &inverse(turns));
        let along = sum_of(graph, &path);
        let square = graph.dot(&along, &along);
        let size = graph.nodes_of(&[square]).count();
        if best.is_none_or(|(least, _)| size < least) {
            best = Some((size, square));
        }
    };
    try_frame(graph, &[]);
    for path in between.paths {
        let mut turns = Vec::new();
        for &i in path {
            let link = &tree.links[i];
            for turn in link.pre.iter().chain([&link.joint]) {
                push_turn(&mut turns, turn);
                try_frame(graph, &turns);
            }
        }
    }
    let (_, square) = best.expect("the common frame was tried");
    Ok(square)
}

/// The closure of every loop of the mechanism.
pub(crate) fn closures(
    graph: &mut Graph,
    mechanism: &Mechanism,
    tree: &Tree,
) -> Result<Vec<Closure>, DeriveError> {
    let paths: Vec<[Vec<usize>; 2]> = mechanism
        .loops
        .iter()
        .map(|l| {
            let [a, b] = l.joins.map(|p| {
                let frame: FrameIdx = mechanism.points[p.0].frame;
                tree.path(tree.link_of(frame))
            });
            let common = a.iter().zip(&b).take_while(|(x, y)| x == y).count();
            [a[common..].to_vec(), b[common..].to_vec()]
        })
        .collect();
    let mut all = Vec::new();
    for (l, [pa, pb]) in mechanism.loops.iter().zip(&paths) {
        let [a, b] = l.joins.map(|p| &mechanism.points[p.0]);
        // What stands still before the first turning joint leads into the plane of the loop, if it has one.
        let into = fixed_turns(tree, pa)
            .or_else(|| fixed_turns(tree, pb))
            .unwrap_or_default();
        let between = Between {
            paths: [pa, pb],
            at: [point_at(graph, a)?, point_at(graph, b)?],
        };
        let path = between.stretches(graph, tree, &inverse(&into));
        all.push((close(graph, l.name.clone(), &path), between));
    }
    // Planar loops among spatial ones may have to be solved together with them.
    let is_spatial = all.iter().any(|(closure, _)| closure.chain.is_none());
    Ok(all
        .into_iter()
        .map(|(mut closure, between)| {
            if is_spatial {
                closure.equations = spatial::equations(graph, tree, &between);
            }
            closure
        })
        .collect())
}

fn close(graph: &mut Graph, name: String, path: &[Stretch]) -> Closure {
    let total = sum_of(graph, path);
    let mut chain = Some(Vec::new());
    for stretch in path {
        // Fixed rotations at the inner end are applied, which leaves one turn about the normal of a planar loop.
        let (mut turns, mut vector) = (stretch.turns.as_slice(), stretch.vector);
        while let [rest @ .., last] = turns
            && last.sum.is_empty()
        {
            vector = graph.turn_out(last, &vector);
            turns = rest;
        }
        let turn = match turns {
            [] => None,
            [turn] if turn.axis == modelmill_spec::Axis::Z => Some(turn),
            _ => {
                chain = None;
                break;
            }
        };
        let (angle, pi12) = turn.map_or((AngleSum::NONE, 0), |t| (t.sum.clone(), t.pi12));
        if let Some(legs) = &mut chain
            && vector[..2] != [Graph::ZERO; 2]
        {
            legs.push(Leg {
                angle,
                pi12,
                vector: [vector[0], vector[1]],
            });
        }
    }
    if total[2] != Graph::ZERO {
        chain = None;
    }
    let residual: Vec<ExprId> = total.into_iter().filter(|r| *r != Graph::ZERO).collect();
    let coordinates = coordinates_of(graph, &residual);
    Closure {
        name,
        n_independent: residual.len(),
        residual,
        chain,
        equations: Vec::new(),
        relations: Vec::new(),
        coordinates,
    }
}

/// Coordinates on which some expressions depend.
pub(crate) fn coordinates_of(graph: &Graph, roots: &[ExprId]) -> Vec<usize> {
    let atoms = graph.atoms(roots);
    atoms
        .into_iter()
        .filter_map(|atom| {
            if let Atom::Coordinate(i) = atom {
                Some(i)
            } else {
                None
            }
        })
        .collect()
}
