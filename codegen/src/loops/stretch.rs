//! Paths along the tree as sums of vectors, each given in a frame that a chain of turns leads to.

use modelmill_spec::{Mechanism, Point};

use crate::DeriveError;
use crate::expr::vector::{self, Turn, Vector, push_turn};
use crate::expr::{AngleSum, ExprId, Graph};
use crate::tree::Tree;
use crate::tree::expressions;

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
