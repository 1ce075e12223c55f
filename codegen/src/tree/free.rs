//! The pose and twist of a body that hangs on nothing, as expressions.
//!
//! A rotation by a quaternion (w, v) of any length is `1 + 2 (w [v]x + [v]x [v]x) / (w^2 + v'v)`; so it stays one in a prime
//! field, where no unit quaternions are drawn, and rounding of a recorded one does no harm.
//!
//! Decision: a free body is a link without a joint. Its pose has seven coordinates and its motion six rates; only
//! the first link of a tree can be free. The forward recursion starts there with the given angular velocity,
//! angular acceleration and acceleration of the origin, and the backward recursion leaves all six components of the
//! wrench. The rate of the quaternion's scalar part never occurs. Its place among the rates and in the mass matrix
//! stays (a row with a one), so that every coordinate has one index. The squared length of the quaternion joins the
//! determinants that must not vanish. Loops and drives that reach across a free body would need derivatives of
//! poses by rates; the model file is refused. A tree of n revolute joints on a free body has 10 + 7 n base
//! parameters: 220 for the 30 joints of the bundled humanoid, which the singular values of stacked regressors
//! confirm.

use modelmill_spec::{CoordinateIdx, FreeBody, TwistAxes};

use crate::expr::vector::Vector;
use crate::expr::{Atom, ExprId, Graph, Rational};
use crate::tree::Tree;

/// Atoms of coordinates, of their rates or of their accelerations.
fn atoms<const N: usize>(
    graph: &mut Graph,
    of: fn(usize) -> Atom,
    coordinates: [CoordinateIdx; N],
) -> [ExprId; N] {
    coordinates.map(|i| graph.atom(of(i.0)))
}

/// The square of the length of a body's quaternion.
pub(crate) fn square(graph: &mut Graph, body: &FreeBody) -> ExprId {
    let squares = atoms(graph, Atom::Coordinate, body.quaternion).map(|x| graph.mul(x, x));
    graph.add_all(&squares)
}

/// The rotation from a body's axes to the base's, by rows.
fn rotation(graph: &mut Graph, body: &FreeBody) -> [Vector; 3] {
    let [w, x, y, z] = atoms(graph, Atom::Coordinate, body.quaternion);
    let v = [x, y, z];
    let square = square(graph, body);
    let inverse = graph.product(&[(square, -1)]);
    let twice = graph.scale(inverse, &Rational::integer(2));
    let scaled = v.map(|x| graph.mul(twice, x));
    let by_w = scaled.map(|x| graph.mul(x, w));
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            if i == j {
                let (a, b) = ((i + 1) % 3, (i + 2) % 3);
                let (a, b) = (graph.mul(scaled[a], v[a]), graph.mul(scaled[b], v[b]));
                let both = graph.add(a, b);
                return graph.sub(Graph::ONE, both);
            }
            // [v]x has -v_k at (i, j) and v_k at (j, i) for cyclic i, j, k.
            let k = 3 - i - j;
            let product = graph.mul(scaled[i.min(j)], v[i.max(j)]);
            if (i + 1) % 3 == j {
                graph.sub(product, by_w[k])
            } else {
                graph.add(product, by_w[k])
            }
        })
    })
}

/// Components in a body's axes of a vector that a twist gives in `axes`.
pub(crate) fn to_body(graph: &mut Graph, body: &FreeBody, axes: TwistAxes, v: &Vector) -> Vector {
    match axes {
        TwistAxes::Body => *v,
        TwistAxes::World => {
            let rows = rotation(graph, body);
            std::array::from_fn(|j| {
                let column = rows.map(|row| row[j]);
                graph.dot(&column, v)
            })
        }
    }
}

/// Components in the axes of a twist of a vector given in a body's.
pub(crate) fn from_body(graph: &mut Graph, body: &FreeBody, axes: TwistAxes, v: &Vector) -> Vector {
    match axes {
        TwistAxes::Body => *v,
        TwistAxes::World => rotation(graph, body).map(|row| graph.dot(&row, v)),
    }
}

/// Angular velocity, angular acceleration and acceleration of the origin less that of free fall, all in the body's axes.
pub(crate) struct FreeMotion {
    pub(crate) omega: Vector,
    pub(crate) alpha: Vector,
    pub(crate) acceleration: Vector,
}

impl FreeMotion {
    pub(crate) fn new(graph: &mut Graph, body: &FreeBody, gravity: &Vector) -> Self {
        let [_, qx, qy, qz] = body.quaternion;
        let angular = [qx, qy, qz];
        let [omega, alpha] = [Atom::Rate as fn(usize) -> Atom, Atom::Acceleration].map(|of| {
            let given = atoms(graph, of, angular);
            // The angular velocity does not change in its own axes, so both sides see the same derivative.
            to_body(graph, body, body.angular, &given)
        });
        let given = atoms(graph, Atom::Acceleration, body.position);
        let fall = to_body(graph, body, TwistAxes::World, gravity);
        let acceleration = match body.linear {
            TwistAxes::World => to_body(graph, body, body.linear, &given),
            TwistAxes::Body => {
                let velocity = atoms(graph, Atom::Rate, body.position);
                let carried = graph.cross(&omega, &velocity);
                graph.add_vectors(&[given, carried])
            }
        };
        Self {
            omega,
            alpha,
            acceleration: graph.sub_vectors(&acceleration, &fall),
        }
    }
}

impl Tree {
    /// What must not vanish so that the orientations of all free bodies exist.
    pub(crate) fn squares(&self, graph: &mut Graph) -> Vec<ExprId> {
        let bodies = self.links.iter().filter_map(|link| link.free);
        bodies.map(|body| square(graph, &body)).collect()
    }
}
