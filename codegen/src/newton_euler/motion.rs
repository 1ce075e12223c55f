//! The forward recursion: motion of every link as expressions in coordinates, rates and accelerations.
//!
//! Decision: points on a joint's axis have the same acceleration on both sides of the joint. So one column of
//! `[alpha]x + [omega]x [omega]x` is rotated from the parent instead of computed again. For the same reason a
//! second moment of mass along the axis may belong to either side; inverse dynamics moves it to the parent, where
//! it costs nothing.

use super::{Side, Style, turn_in_all};
use crate::expr::vector::{self, Vector};
use crate::expr::{Atom, ExprId, Graph, Rational};
use crate::tree::free::FreeMotion;
use crate::tree::{Link, Tree};

/// Motion of every link in its own frame.
pub(crate) struct Motion {
    pub(super) links: Vec<LinkMotion>,
    base: LinkMotion,
    gravity: Vector,
    style: Style,
}

#[derive(Clone)]
pub(super) struct LinkMotion {
    /// Angular velocity and acceleration.
    pub(super) omega: Vector,
    pub(super) alpha: Vector,
    /// Acceleration of the origin, gravity taken off.
    pub(super) acceleration: Vector,
    /// `[alpha]x + [omega]x [omega]x`, by rows.
    pub(super) field: [Vector; 3],
    /// `omega_j^2 - omega_k^2` for cyclic i, j, k.
    pub(super) differences: Vector,
    /// Angular velocity of what carries the joint, on the fixed side of it.
    pub(super) carried: Vector,
}

impl LinkMotion {
    /// From angular velocity and acceleration, entry by entry.
    fn plain(graph: &mut Graph, omega: Vector, alpha: Vector) -> Self {
        let square = omega.map(|w| graph.mul(w, w));
        let mut field = [vector::ZERO; 3];
        let mut differences = vector::ZERO;
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            field[i][i] = graph.combine([
                (square[j], Rational::MINUS_ONE),
                (square[k], Rational::MINUS_ONE),
            ]);
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

    /// From the angular velocity, the last column of the field, and the angular acceleration about z: no square and no
    /// product of the others is needed twice, and the rest of the angular acceleration follows.
    fn from_axis_column(
        graph: &mut Graph,
        omega: Vector,
        alpha_z: ExprId,
        [xz, yz, zz]: Vector,
    ) -> Self {
        let [wx, wy, wz] = omega;
        let (x_z, y_z) = (graph.mul(wx, wz), graph.mul(wy, wz));
        let alpha = [graph.sub(y_z, yz), graph.sub(xz, x_z), alpha_z];
        let (zx, zy) = (graph.sub(x_z, alpha[1]), graph.add(y_z, alpha[0]));
        let x_y = graph.mul(wx, wy);
        let (xy, yx) = (graph.sub(x_y, alpha_z), graph.add(x_y, alpha_z));
        // omega_x^2 + omega_y^2 = -zz
        let (y_y, z_z) = (graph.mul(wy, wy), graph.mul(wz, wz));
        let across = graph.sub(y_y, z_z);
        let xx = graph.combine([(y_y, Rational::MINUS_ONE), (z_z, Rational::MINUS_ONE)]);
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

fn weighted(
    graph: &mut Graph,
    atom: fn(usize) -> Atom,
    terms: impl IntoIterator<Item = (usize, Rational)>,
) -> ExprId {
    let terms: Vec<_> = terms
        .into_iter()
        .map(|(c, k)| (graph.atom(atom(c)), k))
        .collect();
    graph.sum(&terms)
}

/// Coordinates that turn a link about its axis relative to what carries the first joint of `style`, with their factors.
fn turning(style: Style, link: &Link) -> Vec<(usize, Rational)> {
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

/// The motion of every link.
pub(crate) fn forward(graph: &mut Graph, tree: &Tree, gravity: &Vector, style: Style) -> Motion {
    let mut base = LinkMotion::plain(graph, vector::ZERO, vector::ZERO);
    base.acceleration = gravity.map(|g| graph.neg(g));
    let mut motion = Motion {
        links: Vec::new(),
        base,
        gravity: *gravity,
        style,
    };
    for i in 0..tree.links.len() {
        let link = motion.link(graph, tree, i);
        motion.links.push(link);
    }
    motion
}

impl Motion {
    fn of_link(&self, link: Option<usize>) -> &LinkMotion {
        link.map_or(&self.base, |p| &self.links[p])
    }

    fn link(&self, graph: &mut Graph, tree: &Tree, i: usize) -> LinkMotion {
        let style = self.style;
        let link = &tree.links[i];
        if let Some(body) = &link.free {
            let free = FreeMotion::new(graph, body, &self.gravity);
            let mut moved = LinkMotion::plain(graph, free.omega, free.alpha);
            moved.acceleration = free.acceleration;
            moved.carried = free.omega;
            return moved;
        }
        let first = &tree.links[style.first(tree, i)];
        let fixed = self.of_link(first.parent);
        let turn = style.turn(link);
        let carried = turn_in_all(graph, &first.pre, &fixed.omega);
        let mut omega = graph.turn_in(turn, &carried);
        let before = turn_in_all(graph, &first.pre, &fixed.alpha);
        let turning = turning(style, link);
        let rate = weighted(graph, Atom::Rate, turning.iter().cloned());
        let turn_acceleration = weighted(graph, Atom::Acceleration, turning);
        let mut moved = match first.axis {
            Some((axis, positive)) if style.axis_column => {
                let column = std::array::from_fn(|row| {
                    let entry = fixed.field[row][axis];
                    if positive { entry } else { graph.neg(entry) }
                });
                let column = turn_in_all(graph, &first.pre, &column);
                let column = graph.turn_in(turn, &column);
                omega[2] = graph.add(omega[2], rate);
                let alpha_z = graph.add(before[2], turn_acceleration);
                LinkMotion::from_axis_column(graph, omega, alpha_z, column)
            }
            _ => {
                let mut alpha = graph.turn_in(turn, &before);
                // R'omega_parent x z rate = (omega_y, -omega_x, 0) rate
                let swing = [graph.mul(omega[1], rate), graph.mul(omega[0], rate)];
                alpha[0] = graph.add(alpha[0], swing[0]);
                alpha[1] = graph.sub(alpha[1], swing[1]);
                alpha[2] = graph.add(alpha[2], turn_acceleration);
                omega[2] = graph.add(omega[2], rate);
                LinkMotion::plain(graph, omega, alpha)
            }
        };
        moved.carried = carried;
        let column = moved.field.map(|row| row[2]);
        let before = self.acceleration_before(graph, tree, i);
        let turned = graph.turn_in(&link.joint, &before);
        moved.acceleration = self.on_axis(graph, link, &turned, &column);
        // 2 omega x z slide_rate
        let slide = weighted(graph, Atom::Rate, link.slides.iter().cloned());
        let twice = graph.scale(slide, &Rational::integer(2));
        let coriolis = [
            graph.mul(moved.omega[1], twice),
            graph.mul(moved.omega[0], twice),
        ];
        let acceleration = &mut moved.acceleration;
        acceleration[0] = graph.add(acceleration[0], coriolis[0]);
        acceleration[1] = graph.sub(acceleration[1], coriolis[1]);
        let slide_acceleration = weighted(graph, Atom::Acceleration, link.slides.iter().cloned());
        acceleration[2] = graph.add(acceleration[2], slide_acceleration);
        moved
    }

    /// Acceleration of the point that a link's position leads to across its axis, on the fixed side of its joint.
    fn acceleration_before(&self, graph: &mut Graph, tree: &Tree, i: usize) -> Vector {
        let link = &tree.links[i];
        let parent = self.of_link(link.parent);
        let (across, _) = self.style.split_position(link);
        let mut there = parent.acceleration;
        for row in 0..3 {
            let moved = graph.dot(&parent.field[row], &across);
            there[row] = graph.add(there[row], moved);
        }
        turn_in_all(graph, &link.pre, &there)
    }

    /// The same along the axis on to the origin, with the column of the field that belongs to the axis.
    fn on_axis(&self, graph: &mut Graph, link: &Link, there: &Vector, column: &Vector) -> Vector {
        let (_, along) = self.style.split_position(link);
        let moved = graph.scale_vector(along, column);
        graph.add_vectors(&[*there, moved])
    }

    /// Whether a link turns about anything but a direction along its axis that stands still.
    pub(crate) fn is_tilting(&self, link: usize) -> bool {
        let [x, y, _] = self.links[link].omega;
        x != Graph::ZERO || y != Graph::ZERO
    }

    /// The moment, on the fixed side of a joint, of a body with no more than a moment of inertia of 1 about its axis:
    /// it does not depend on how far the joint has turned.
    pub(crate) fn axial_moment(&self, graph: &mut Graph, link: usize) -> Vector {
        let moved = &self.links[link];
        let [x, y, _] = moved.carried;
        let about = moved.omega[2];
        let (y_z, x_z) = (graph.mul(y, about), graph.mul(x, about));
        [y_z, graph.neg(x_z), moved.alpha[2]]
    }

    /// Motion of a link in the axes of its joint's fixed side; `None` if these are not the parent's axes in other order.
    ///
    /// Only the angular acceleration is missing in it.
    pub(super) fn on_fixed_side(
        &self,
        graph: &mut Graph,
        tree: &Tree,
        i: usize,
    ) -> Option<LinkMotion> {
        let link = &tree.links[i];
        let quarter = |t: &crate::expr::vector::Turn| t.sum.is_empty() && t.pi12 % 6 == 0;
        if !link.pre.iter().all(quarter) || !link.slides.is_empty() || link.free.is_some() {
            return None;
        }
        let parent = self.of_link(link.parent);
        let columns: [Vector; 3] = std::array::from_fn(|j| {
            let column = parent.field.map(|row| row[j]);
            turn_in_all(graph, &link.pre, &column)
        });
        let mut field: [Vector; 3] = std::array::from_fn(|row| {
            let row = columns.map(|column| column[row]);
            turn_in_all(graph, &link.pre, &row)
        });
        let mut omega = turn_in_all(graph, &link.pre, &parent.omega);
        let terms = || {
            let turns = link.turns.iter();
            turns.map(|(c, n)| (*c, Rational::integer(i64::from(*n))))
        };
        let rate = weighted(graph, Atom::Rate, terms());
        let turn_acceleration = weighted(graph, Atom::Acceleration, terms());
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
        let acceleration = self.on_axis(graph, link, &there, &column);
        Some(LinkMotion {
            omega,
            alpha: vector::ZERO,
            acceleration,
            field,
            differences,
            carried: vector::ZERO,
        })
    }

    /// The motion that a wrench on a side of a joint is computed with; `None` if there is none for that side.
    pub(super) fn at(
        &self,
        graph: &mut Graph,
        tree: &Tree,
        link: usize,
        side: Side,
    ) -> Option<LinkMotion> {
        match side {
            Side::Moving => Some(self.links[link].clone()),
            Side::Fixed => self.on_fixed_side(graph, tree, link),
        }
    }
}
