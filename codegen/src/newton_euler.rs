//! Recursive Newton-Euler equations on the tree (Luh, Walker and Paul 1980; linear in the inertial parameters as in
//! Khalil and Kleinfinger 1987).
//!
//! The forward recursion gives every link's motion in its own frame; the backward recursion carries wrenches about the
//! links' origins down to the base and reads off, at each joint, the generalised force of its coordinate.

use crate::expr::{Atom, ExprId, Graph, Rational};
use crate::tree::Tree;
use crate::vector::{self, Vector};

/// What a link's inertia is linear in. The first moment stands twice: as the balance of forces sees it and as the
/// balance of moments sees it; the two agree except for lumped masses that are placed apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Element {
    Mass,
    ForceMoment(usize),
    MomentMoment(usize),
    /// Position in xx, xy, xz, yy, yz, zz.
    Inertia(usize),
}

/// Number of elements.
pub(crate) const ELEMENTS: usize = 13;

impl Element {
    pub(crate) fn index(self) -> usize {
        match self {
            Self::Mass => 0,
            Self::ForceMoment(i) => 1 + i,
            Self::MomentMoment(i) => 4 + i,
            Self::Inertia(i) => 7 + i,
        }
    }
}

/// Inertia of one link: a factor for every [`Element`].
pub(crate) type Inertia = [ExprId; ELEMENTS];

/// A force and a moment about the origin of a link, in the link's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wrench {
    force: Vector,
    moment: Vector,
}

/// Motion of every link in its own frame.
pub(crate) struct Motion {
    links: Vec<LinkMotion>,
}

struct LinkMotion {
    /// Angular velocity and acceleration.
    omega: Vector,
    alpha: Vector,
    /// Acceleration of the origin, gravity taken off.
    acceleration: Vector,
    /// `[alpha]x + [omega]x [omega]x`, by rows.
    field: [Vector; 3],
}

impl LinkMotion {
    fn new(graph: &mut Graph, omega: Vector, alpha: Vector, acceleration: Vector) -> Self {
        let square = omega.map(|w| graph.mul(w, w));
        let mut field = [vector::ZERO; 3];
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            field[i][i] = graph.combine([
                (square[j], Rational::MINUS_ONE),
                (square[k], Rational::MINUS_ONE),
            ]);
            let product = graph.mul(omega[i], omega[j]);
            // Entries (i, j) and (j, i) of [alpha]x are -alpha_k and alpha_k for cyclic i, j, k.
            field[i][j] = graph.sub(product, alpha[k]);
            field[j][i] = graph.add(product, alpha[k]);
        }
        Self {
            omega,
            alpha,
            acceleration,
            field,
        }
    }
}

/// Forward recursion: the motion of every link as expressions in coordinates, rates and accelerations.
pub(crate) fn forward(graph: &mut Graph, tree: &Tree, gravity: &Vector) -> Motion {
    let lifted = gravity.map(|g| graph.neg(g));
    let base = LinkMotion::new(graph, vector::ZERO, vector::ZERO, lifted);
    let mut links: Vec<LinkMotion> = Vec::new();
    for (i, link) in tree.links.iter().enumerate() {
        let parent = link.parent.map_or(&base, |p| &links[p]);
        let mut along = parent.acceleration;
        for row in 0..3 {
            let moved = graph.dot(&parent.field[row], &link.position);
            along[row] = graph.add(along[row], moved);
        }
        let (omega, alpha) = (parent.omega, parent.alpha);
        let mut omega = tree.to_link(graph, i, &omega);
        let mut alpha = tree.to_link(graph, i, &alpha);
        let mut acceleration = tree.to_link(graph, i, &along);
        let integer = |n: i32| Rational::integer(i64::from(n));
        let sum = |graph: &mut Graph, atom: fn(usize) -> Atom, terms: &[(usize, Rational)]| {
            let terms: Vec<_> = terms
                .iter()
                .map(|(c, k)| (graph.atom(atom(*c)), k.clone()))
                .collect();
            graph.sum(&terms)
        };
        // R'omega_parent x z rate = (omega_y, -omega_x, 0) rate
        let turns: Vec<_> = link.turns.iter().map(|(c, n)| (*c, integer(*n))).collect();
        let rate = sum(graph, Atom::Rate, &turns);
        let swing = [graph.mul(omega[1], rate), graph.mul(omega[0], rate)];
        alpha[0] = graph.add(alpha[0], swing[0]);
        alpha[1] = graph.sub(alpha[1], swing[1]);
        let turn_acceleration = sum(graph, Atom::Acceleration, &turns);
        alpha[2] = graph.add(alpha[2], turn_acceleration);
        // 2 omega x z slide_rate
        let slide = sum(graph, Atom::Rate, &link.slides);
        let twice = graph.scale(slide, &Rational::integer(2));
        let coriolis = [graph.mul(omega[1], twice), graph.mul(omega[0], twice)];
        acceleration[0] = graph.add(acceleration[0], coriolis[0]);
        acceleration[1] = graph.sub(acceleration[1], coriolis[1]);
        let slide_acceleration = sum(graph, Atom::Acceleration, &link.slides);
        acceleration[2] = graph.add(acceleration[2], slide_acceleration);
        omega[2] = graph.add(omega[2], rate);
        let motion = LinkMotion::new(graph, omega, alpha, acceleration);
        links.push(motion);
    }
    Motion { links }
}

impl Motion {
    /// The wrench that moves an inertia along with `link`.
    pub(crate) fn wrench(&self, graph: &mut Graph, link: usize, inertia: &Inertia) -> Wrench {
        let LinkMotion {
            omega,
            alpha,
            acceleration,
            field,
        } = &self.links[link];
        let element = |e: Element| inertia[e.index()];
        let force_moment = [0, 1, 2].map(|i| element(Element::ForceMoment(i)));
        let moment_moment = [0, 1, 2].map(|i| element(Element::MomentMoment(i)));
        let mut force = graph.scale_vector(element(Element::Mass), acceleration);
        for i in 0..3 {
            let swung = graph.dot(&field[i], &force_moment);
            force[i] = graph.add(force[i], swung);
        }
        let lever = graph.cross(&moment_moment, acceleration);
        let [xx, xy, xz, yy, yz, zz] = [0, 1, 2, 3, 4, 5].map(|i| element(Element::Inertia(i)));
        let diagonal = [xx, yy, zz];
        // Opposite off-diagonal elements: yz for x, xz for y, xy for z.
        let off = [yz, xz, xy];
        let moment = std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let spread = graph.sub(diagonal[k], diagonal[j]);
            let product = graph.mul(omega[j], omega[k]);
            let (sj, sk) = (graph.mul(omega[j], omega[j]), graph.mul(omega[k], omega[k]));
            let difference = graph.sub(sj, sk);
            let against = graph.neg(field[k][i]);
            let terms = [
                graph.mul(diagonal[i], alpha[i]),
                graph.mul(spread, product),
                graph.mul(off[k], against),
                graph.mul(off[j], field[j][i]),
                graph.mul(off[i], difference),
                lever[i],
            ];
            graph.add_all(&terms)
        });
        Wrench { force, moment }
    }
}

/// Backward recursion: generalised force of every coordinate for the given wrenches, `n_coordinates` expressions.
pub(crate) fn backward(
    graph: &mut Graph,
    tree: &Tree,
    n_coordinates: usize,
    wrenches: impl IntoIterator<Item = (usize, Wrench)>,
) -> Vec<ExprId> {
    let mut total: Vec<Option<Wrench>> = vec![None; tree.links.len()];
    let join = |graph: &mut Graph, total: &mut Option<Wrench>, wrench: Wrench| {
        *total = Some(match *total {
            None => wrench,
            Some(there) => Wrench {
                force: graph.add_vectors(&[there.force, wrench.force]),
                moment: graph.add_vectors(&[there.moment, wrench.moment]),
            },
        });
    };
    for (link, wrench) in wrenches {
        join(graph, &mut total[link], wrench);
    }
    let mut rows: Vec<Vec<(ExprId, Rational)>> = vec![Vec::new(); n_coordinates];
    for i in (0..tree.links.len()).rev() {
        let Some(Wrench { force, moment }) = total[i] else {
            continue;
        };
        let link = &tree.links[i];
        for (coordinate, n) in &link.turns {
            rows[*coordinate].push((moment[2], Rational::integer(i64::from(*n))));
        }
        for (coordinate, k) in &link.slides {
            rows[*coordinate].push((force[2], k.clone()));
        }
        if let Some(parent) = link.parent {
            let force = tree.to_parent(graph, i, &force);
            let turned = tree.to_parent(graph, i, &moment);
            let lever = graph.cross(&link.position, &force);
            let moment = graph.add_vectors(&[turned, lever]);
            join(graph, &mut total[parent], Wrench { force, moment });
        }
    }
    rows.into_iter().map(|terms| graph.sum(&terms)).collect()
}
