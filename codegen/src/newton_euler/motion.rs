//! The forward recursion: motion of every link as expressions in coordinates, rates and accelerations.
//!
//! Decision: points on a joint's axis have the same acceleration on both sides of the joint. So one column of
//! `[alpha]x + [omega]x [omega]x` is rotated from the parent instead of computed again. For the same reason a
//! second moment of mass along the axis may belong to either side; inverse dynamics moves it to the parent, where
//! it costs nothing.

use super::{JointSide, RecursionStyle, rotate_into_inner};
use crate::expr::vector::{self, SymbolicVector};
use crate::expr::{Atom, ExprId, Graph, Rational};
use crate::tree::free::FreeMotion;
use crate::tree::{KinematicTree, TreeLink};

/// Motion of every link, in its own frame.
pub(crate) struct TreeMotion {
    /// Motion by link.
    pub(super) links: Vec<LinkMotion>,
    /// Motion of the base: at standstill, with the acceleration of free fall reversed.
    base: LinkMotion,
    /// Acceleration of gravity in the base frame, m/s^2.
    gravity: SymbolicVector,
    /// How the recursion is written.
    style: RecursionStyle,
}

/// Motion of one link, in the axes of its own frame.
#[derive(Clone)]
pub(super) struct LinkMotion {
    /// Angular velocity, rad/s.
    pub(super) omega: SymbolicVector,
    /// Angular acceleration, rad/s^2.
    pub(super) alpha: SymbolicVector,
    /// Acceleration of the origin minus that of gravity, m/s^2.
    pub(super) acceleration: SymbolicVector,
    /// `[alpha]x + [omega]x [omega]x`, by rows, 1/s^2: it maps a position in the link to its acceleration relative to
    /// the origin.
    pub(super) field: [SymbolicVector; 3],
    /// `omega_j^2 - omega_k^2` for cyclic i, j, k, 1/s^2.
    pub(super) differences: SymbolicVector,
    /// Angular velocity of the part that carries the joint, on the fixed side of the joint, rad/s.
    pub(super) carried: SymbolicVector,
}

impl LinkMotion {
    /// Computes the field from angular velocity and acceleration, entry by entry. The acceleration of the origin is
    /// zero.
    fn from_angular_motion(graph: &mut Graph, omega: SymbolicVector, alpha: SymbolicVector) -> Self {
        // The diagonal of [omega]x [omega]x is minus the sum of the two other squares.
        let square = omega.map(|w| graph.mul(w, w));
        let mut field = [vector::ZERO; 3];
        let mut differences = vector::ZERO;
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            field[i][i] =
                graph.linear_combination([(square[j], Rational::MINUS_ONE), (square[k], Rational::MINUS_ONE)]);
            differences[i] = graph.sub(square[j], square[k]);
            let product = graph.mul(omega[i], omega[j]);
            // Entries (i, j) and (j, i) of [alpha]x are -alpha_k and alpha_k for cyclic i, j, k.
            field[i][j] = graph.sub(product, alpha[k]);
            field[j][i] = graph.add(product, alpha[k]);
        }
        Self {
            omega,
            alpha,
            acceleration: vector::ZERO,
            field,
            differences,
            carried: vector::ZERO,
        }
    }

    /// Computes the field from the angular velocity, its last column, and the angular acceleration about z. No square
    /// and no product is computed twice, and the other components of the angular acceleration are determined by the
    /// column.
    fn from_axis_column(
        graph: &mut Graph,
        omega: SymbolicVector,
        alpha_z: ExprId,
        [xz, yz, zz]: SymbolicVector,
    ) -> Self {
        let [wx, wy, wz] = omega;
        // The last column is (omega_x omega_z + alpha_y, omega_y omega_z - alpha_x, ...).
        let (x_z, y_z) = (graph.mul(wx, wz), graph.mul(wy, wz));
        let alpha = [graph.sub(y_z, yz), graph.sub(xz, x_z), alpha_z];
        let (zx, zy) = (graph.sub(x_z, alpha[1]), graph.add(y_z, alpha[0]));
        let x_y = graph.mul(wx, wy);
        let (xy, yx) = (graph.sub(x_y, alpha_z), graph.add(x_y, alpha_z));
        // omega_x^2 + omega_y^2 = -zz
        let (y_y, z_z) = (graph.mul(wy, wy), graph.mul(wz, wz));
        let across = graph.sub(y_y, z_z);
        let xx = graph.linear_combination([(y_y, Rational::MINUS_ONE), (z_z, Rational::MINUS_ONE)]);
        let yy = graph.add(zz, across);
        let differences = [across, graph.sub(zz, xx), graph.sub(xx, yy)];
        Self {
            omega,
            alpha,
            acceleration: vector::ZERO,
            field: [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]],
            differences,
            carried: vector::ZERO,
        }
    }
}

/// A linear combination of coordinates, rates or accelerations, which `atom` chooses.
fn weighted_sum(
    graph: &mut Graph,
    atom: fn(usize) -> Atom,
    terms: impl IntoIterator<Item = (usize, Rational)>,
) -> ExprId {
    let terms: Vec<_> = terms.into_iter().map(|(c, k)| (graph.atom(atom(c)), k)).collect();
    graph.sum(&terms)
}

/// Coordinates that rotate a link about its axis relative to the part that carries the first joint of `style`, with
/// their factors.
fn rotating_coordinates(style: RecursionStyle, link: &TreeLink) -> Vec<(usize, Rational)> {
    let rational = |(c, n): (usize, i32)| (c, Rational::integer(i64::from(n)));
    if !style.across_parallel_axes {
        return link.turns.iter().copied().map(rational).collect();
    }
    let terms = link.absolute.sum.terms().iter();
    terms
        .filter_map(|(atom, n)| {
            if let Atom::Coordinate(c) = atom {
                Some(rational((*c, *n)))
            } else {
                None
            }
        })
        .collect()
}

/// The motion of every link as expressions in coordinates, rates and accelerations. `gravity` is in the base frame,
/// m/s^2.
pub(crate) fn forward_recursion(
    graph: &mut Graph,
    tree: &KinematicTree,
    gravity: &SymbolicVector,
    style: RecursionStyle,
) -> TreeMotion {
    // An upward acceleration of the base replaces the weight of all bodies.
    let mut base = LinkMotion::from_angular_motion(graph, vector::ZERO, vector::ZERO);
    base.acceleration = gravity.map(|g| graph.neg(g));
    let mut motion = TreeMotion {
        links: Vec::new(),
        base,
        gravity: *gravity,
        style,
    };
    for i in 0..tree.links.len() {
        let link = motion.derive_link_motion(graph, tree, i);
        motion.links.push(link);
    }
    motion
}

impl TreeMotion {
    /// The motion of a link, or of the base for `None`.
    fn motion_of_link(&self, link: Option<usize>) -> &LinkMotion {
        link.map_or(&self.base, |p| &self.links[p])
    }

    /// The motion of link `i` from that of its parent.
    fn derive_link_motion(&self, graph: &mut Graph, tree: &KinematicTree, i: usize) -> LinkMotion {
        let style = self.style;
        let link = &tree.links[i];
        // A free body has its twist as coordinates and needs no recursion.
        if let Some(body) = &link.free {
            let free = FreeMotion::new(graph, body, &self.gravity);
            let mut moved = LinkMotion::from_angular_motion(graph, free.omega, free.alpha);
            moved.acceleration = free.acceleration;
            moved.carried = free.omega;
            return moved;
        }
        // Angular motion of the part that carries the first joint, in the axes of that joint.
        let first = &tree.links[style.first_rotated_link(tree, i)];
        let fixed = self.motion_of_link(first.parent);
        let turn = style.joint_rotation(link);
        let carried = rotate_into_inner(graph, &first.pre, &fixed.omega);
        let mut omega = graph.rotate_in(turn, &carried);
        let before = rotate_into_inner(graph, &first.pre, &fixed.alpha);
        // Rates of all joints from there on add up about the common z axis.
        let turning = rotating_coordinates(style, link);
        let rate = weighted_sum(graph, Atom::Rate, turning.iter().cloned());
        let turn_acceleration = weighted_sum(graph, Atom::Acceleration, turning);
        let mut moved = match first.axis {
            // The joint is along an axis of its parent's frame, so that column of the field is already known.
            Some((axis, positive)) if style.axis_column => {
                let column = std::array::from_fn(|row| {
                    let entry = fixed.field[row][axis];
                    if positive { entry } else { graph.neg(entry) }
                });
                let column = rotate_into_inner(graph, &first.pre, &column);
                let column = graph.rotate_in(turn, &column);
                omega[2] = graph.add(omega[2], rate);
                let alpha_z = graph.add(before[2], turn_acceleration);
                LinkMotion::from_axis_column(graph, omega, alpha_z, column)
            }
            _ => {
                let mut alpha = graph.rotate_in(turn, &before);
                // R'omega_parent x z rate = (omega_y, -omega_x, 0) rate
                let swing = [graph.mul(omega[1], rate), graph.mul(omega[0], rate)];
                alpha[0] = graph.add(alpha[0], swing[0]);
                alpha[1] = graph.sub(alpha[1], swing[1]);
                alpha[2] = graph.add(alpha[2], turn_acceleration);
                omega[2] = graph.add(omega[2], rate);
                LinkMotion::from_angular_motion(graph, omega, alpha)
            }
        };
        moved.carried = carried;
        // Acceleration of the origin: along the parent's frame, across the joint, then along the axis.
        let column = moved.field.map(|row| row[2]);
        let before = self.acceleration_before(graph, tree, i);
        let turned = graph.rotate_in(&link.joint, &before);
        moved.acceleration = self.acceleration_along_axis(graph, link, &turned, &column);
        // 2 omega x z slide_rate
        let slide = weighted_sum(graph, Atom::Rate, link.slides.iter().cloned());
        let twice = graph.scale(slide, &Rational::integer(2));
        let coriolis = [graph.mul(moved.omega[1], twice), graph.mul(moved.omega[0], twice)];
        let acceleration = &mut moved.acceleration;
        acceleration[0] = graph.add(acceleration[0], coriolis[0]);
        // Acceleration of the prismatic joint along z.
        acceleration[1] = graph.sub(acceleration[1], coriolis[1]);
        let slide_acceleration = weighted_sum(graph, Atom::Acceleration, link.slides.iter().cloned());
        acceleration[2] = graph.add(acceleration[2], slide_acceleration);
        moved
    }

    /// Acceleration, on the fixed side of the joint, of the point that is reached before the offset along the joint's
    /// axis.
    fn acceleration_before(&self, graph: &mut Graph, tree: &KinematicTree, i: usize) -> SymbolicVector {
        let link = &tree.links[i];
        let parent = self.motion_of_link(link.parent);
        let (across, _) = self.style.split_position(link);
        let mut there = parent.acceleration;
        for row in 0..3 {
            let moved = graph.dot(&parent.field[row], &across);
            there[row] = graph.add(there[row], moved);
        }
        rotate_into_inner(graph, &link.pre, &there)
    }

    /// Acceleration of the origin from that of the point before the offset along the axis. `column` is the column of
    /// the field that belongs to the axis.
    fn acceleration_along_axis(
        &self,
        graph: &mut Graph,
        link: &TreeLink,
        there: &SymbolicVector,
        column: &SymbolicVector,
    ) -> SymbolicVector {
        let (_, along) = self.style.split_position(link);
        let moved = graph.scale_vector(along, column);
        graph.add_vectors(&[*there, moved])
    }

    /// Whether a link rotates other than about its own z axis.
    pub(crate) fn is_tilting(&self, link: usize) -> bool {
        let [x, y, _] = self.links[link].omega;
        x != Graph::ZERO || y != Graph::ZERO
    }

    /// The moment, on the fixed side of a joint, of a body whose only inertia is a moment of inertia of 1 about the
    /// joint's axis. It does not depend on the angle of the joint.
    pub(crate) fn axial_moment(&self, graph: &mut Graph, link: usize) -> SymbolicVector {
        let moved = &self.links[link];
        let [x, y, _] = moved.carried;
        let about = moved.omega[2];
        let (y_z, x_z) = (graph.mul(y, about), graph.mul(x, about));
        [y_z, graph.neg(x_z), moved.alpha[2]]
    }

    /// Motion of a link in the axes of its joint's fixed side; `None` if these axes are not a permutation of the
    /// parent's axes.
    ///
    /// The angular acceleration is left zero in it, so only flat bodies can be used with it.
    pub(super) fn fixed_side_motion(&self, graph: &mut Graph, tree: &KinematicTree, i: usize) -> Option<LinkMotion> {
        let link = &tree.links[i];
        // Rotations by quarter turns only exchange axes.
        let quarter = |t: &crate::expr::vector::AxisRotation| t.sum.is_empty() && t.pi12 % 6 == 0;
        if !link.pre.iter().all(quarter) || !link.slides.is_empty() || link.free.is_some() {
            return None;
        }
        let parent = self.motion_of_link(link.parent);
        // The parent's field in the axes of the joint: columns, then rows.
        let columns: [SymbolicVector; 3] = std::array::from_fn(|j| {
            let column = parent.field.map(|row| row[j]);
            rotate_into_inner(graph, &link.pre, &column)
        });
        let mut field: [SymbolicVector; 3] = std::array::from_fn(|row| {
            let row = columns.map(|column| column[row]);
            rotate_into_inner(graph, &link.pre, &row)
        });
        let mut omega = rotate_into_inner(graph, &link.pre, &parent.omega);
        let terms = || {
            let turns = link.turns.iter();
            turns.map(|(c, n)| (*c, Rational::integer(i64::from(*n))))
        };
        let rate = weighted_sum(graph, Atom::Rate, terms());
        let turn_acceleration = weighted_sum(graph, Atom::Acceleration, terms());
        // The joint adds its rate and acceleration about z to the field.
        let twice = graph.scale(rate, &Rational::integer(2));
        for j in 0..2 {
            let swing = graph.mul(twice, omega[j]);
            field[2][j] = graph.add(field[2][j], swing);
        }
        field[0][1] = graph.sub(field[0][1], turn_acceleration);
        field[1][0] = graph.add(field[1][0], turn_acceleration);
        let across = graph.sub(field[0][0], field[1][1]);
        let before = omega[2];
        omega[2] = graph.add(before, rate);
        // (omega_z + rate)^2 - omega_z^2
        let both = graph.add(before, omega[2]);
        let more = graph.mul(rate, both);
        for j in 0..2 {
            field[j][j] = graph.sub(field[j][j], more);
        }
        let differences = [
            graph.sub(field[1][1], field[2][2]),
            graph.sub(field[2][2], field[0][0]),
            across,
        ];
        let column = field.map(|row| row[2]);
        let there = self.acceleration_before(graph, tree, i);
        let acceleration = self.acceleration_along_axis(graph, link, &there, &column);
        Some(LinkMotion {
            omega,
            alpha: vector::ZERO,
            acceleration,
            field,
            differences,
            carried: vector::ZERO,
        })
    }

    /// The motion with which a wrench on one side of a joint is computed; `None` if it is not available on that side.
    pub(super) fn side_motion(
        &self,
        graph: &mut Graph,
        tree: &KinematicTree,
        link: usize,
        side: JointSide,
    ) -> Option<LinkMotion> {
        match side {
            JointSide::Moving => Some(self.links[link].clone()),
            JointSide::Fixed => self.fixed_side_motion(graph, tree, link),
        }
    }
}
