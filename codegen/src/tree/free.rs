//! The pose and twist of a free body, which no joint connects to anything, as expressions.
//!
//! A rotation by a quaternion (w, v) of any length is `1 + 2 (w [v]x + [v]x [v]x) / (w^2 + v'v)`. So it is a rotation
//! in a prime field as well, where quaternions are drawn without unit length, and for recorded quaternions with
//! rounding errors.
//!
//! Decision: a free body is a link without a joint. Its pose has seven coordinates and its motion six rates; only
//! the first link of a tree can be free. The forward recursion starts there with the given angular velocity,
//! angular acceleration and acceleration of the origin, and the backward recursion returns all six components of the
//! wrench. The rate of the quaternion's scalar part never occurs. Its place among the rates and in the mass matrix
//! stays (a row with a one), so that every coordinate has one index. The squared length of the quaternion joins the
//! determinants that must not vanish. Loops and drives that reach across a free body would need derivatives of
//! poses by rates; the model file is refused. A tree of n revolute joints on a free body has 10 + 7 n base
//! parameters: 220 for the 30 joints of the bundled humanoid, which the singular values of stacked regressors
//! confirm.

use modelmill_spec::{CoordinateIdx, FreeBody, TwistAxes};

use crate::expr::vector::SymbolicVector;
use crate::expr::{Atom, ExprId, Graph, Rational};
use crate::tree::KinematicTree;

/// Atoms of some coordinates, of their rates or of their accelerations; `of` chooses which.
fn coordinate_atoms<const N: usize>(
    graph: &mut Graph,
    of: fn(usize) -> Atom,
    coordinates: [CoordinateIdx; N],
) -> [ExprId; N] {
    coordinates.map(|i| graph.atom(of(i.0)))
}

/// The square of the length of a body's quaternion.
pub(crate) fn quaternion_square(graph: &mut Graph, body: &FreeBody) -> ExprId {
    let squares = coordinate_atoms(graph, Atom::Coordinate, body.quaternion).map(|x| graph.mul(x, x));
    graph.add_all(&squares)
}

/// The rotation matrix from a body's axes to those of the base, by rows.
fn rotation_matrix(graph: &mut Graph, body: &FreeBody) -> [SymbolicVector; 3] {
    let [w, x, y, z] = coordinate_atoms(graph, Atom::Coordinate, body.quaternion);
    let v = [x, y, z];
    let square = quaternion_square(graph, body);
    // 2/(w^2 + v'v)
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

/// Components in a body's axes of a vector that is given in the `axes` of a twist.
pub(crate) fn to_body(graph: &mut Graph, body: &FreeBody, axes: TwistAxes, v: &SymbolicVector) -> SymbolicVector {
    match axes {
        TwistAxes::Body => *v,
        TwistAxes::World => {
            let rows = rotation_matrix(graph, body);
            std::array::from_fn(|j| {
                let column = rows.map(|row| row[j]);
                graph.dot(&column, v)
            })
        }
    }
}

/// Components in the `axes` of a twist of a vector that is given in a body's axes.
pub(crate) fn from_body(graph: &mut Graph, body: &FreeBody, axes: TwistAxes, v: &SymbolicVector) -> SymbolicVector {
    match axes {
        TwistAxes::Body => *v,
        TwistAxes::World => rotation_matrix(graph, body).map(|row| graph.dot(&row, v)),
    }
}

/// Motion of a free body, all in its own axes.
pub(crate) struct FreeMotion {
    /// Angular velocity, rad/s.
    pub(crate) omega: SymbolicVector,
    /// Angular acceleration, rad/s^2.
    pub(crate) alpha: SymbolicVector,
    /// Acceleration of the origin minus that of gravity, m/s^2.
    pub(crate) acceleration: SymbolicVector,
}

impl FreeMotion {
    /// The motion from the body's rates and accelerations; `gravity` is in the base frame, m/s^2.
    pub(crate) fn new(graph: &mut Graph, body: &FreeBody, gravity: &SymbolicVector) -> Self {
        let [_, qx, qy, qz] = body.quaternion;
        let angular = [qx, qy, qz];
        let [omega, alpha] = [Atom::Rate as fn(usize) -> Atom, Atom::Acceleration].map(|of| {
            let given = coordinate_atoms(graph, of, angular);
            // The derivative of the angular velocity is the same in body axes and in base axes.
            to_body(graph, body, body.angular, &given)
        });
        let given = coordinate_atoms(graph, Atom::Acceleration, body.position);
        let fall = to_body(graph, body, TwistAxes::World, gravity);
        // The derivative of a velocity in body axes lacks the rotation of these axes.
        let acceleration = match body.linear {
            TwistAxes::World => to_body(graph, body, body.linear, &given),
            TwistAxes::Body => {
                let velocity = coordinate_atoms(graph, Atom::Rate, body.position);
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

impl KinematicTree {
    /// Squared lengths of the quaternions of all free bodies, which must not vanish.
    pub(crate) fn quaternion_squares(&self, graph: &mut Graph) -> Vec<ExprId> {
        let bodies = self.links.iter().filter_map(|link| link.free);
        bodies.map(|body| quaternion_square(graph, &body)).collect()
    }
}
