//! Recursive Newton-Euler equations on the tree (Luh, Walker and Paul 1980; linear in the inertial parameters as in
//! Khalil and Kleinfinger 1987).
//!
//! The forward recursion gives every link's motion in its own frame; the backward recursion carries wrenches about the
//! links' origins down to the base and reads off, at each joint, the generalised force of its coordinate.

use crate::expr::{Atom, ExprId, Graph, Rational};
use crate::tree::Tree;
use crate::vector::{self, Turn, Vector};

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

/// How the recursions treat links whose axes are parallel; all styles give the same values at different cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Style {
    /// From link to link.
    LinkByLink,
    /// Through the fixed side of the first of several parallel axes, with the sum of their angles.
    AcrossParallelAxes,
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
pub(crate) fn forward(graph: &mut Graph, tree: &Tree, gravity: &Vector, style: Style) -> Motion {
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
        let mut acceleration = tree.to_link(graph, i, &along);
        // Angular motion without the turning about z that is added below.
        let (mut omega, mut alpha, turning) = match style {
            Style::LinkByLink => {
                let (omega, alpha) = (parent.omega, parent.alpha);
                (
                    tree.to_link(graph, i, &omega),
                    tree.to_link(graph, i, &alpha),
                    link.turns.clone(),
                )
            }
            Style::AcrossParallelAxes => {
                let first = &tree.links[link.first_parallel];
                let fixed = first.parent.map_or(&base, |p| &links[p]);
                let turns: Vec<Turn> = first.pre.iter().chain([&link.absolute]).cloned().collect();
                let turned = |graph: &mut Graph, v: &Vector| {
                    turns.iter().fold(*v, |v, turn| graph.turn_in(turn, &v))
                };
                let turning = link
                    .absolute
                    .sum
                    .terms()
                    .iter()
                    .filter_map(|(atom, n)| {
                        if let Atom::Coordinate(c) = atom {
                            Some((*c, *n))
                        } else {
                            None
                        }
                    })
                    .collect();
                (
                    turned(graph, &fixed.omega),
                    turned(graph, &fixed.alpha),
                    turning,
                )
            }
        };
        let sum = |graph: &mut Graph, atom: fn(usize) -> Atom, terms: &[(usize, Rational)]| {
            let terms: Vec<_> = terms
                .iter()
                .map(|(c, k)| (graph.atom(atom(*c)), k.clone()))
                .collect();
            graph.sum(&terms)
        };
        // R'omega_parent x z rate = (omega_y, -omega_x, 0) rate
        let turning: Vec<_> = turning
            .iter()
            .map(|(c, n)| (*c, Rational::integer(i64::from(*n))))
            .collect();
        let rate = sum(graph, Atom::Rate, &turning);
        let swing = [graph.mul(omega[1], rate), graph.mul(omega[0], rate)];
        alpha[0] = graph.add(alpha[0], swing[0]);
        alpha[1] = graph.sub(alpha[1], swing[1]);
        let turn_acceleration = sum(graph, Atom::Acceleration, &turning);
        alpha[2] = graph.add(alpha[2], turn_acceleration);
        omega[2] = graph.add(omega[2], rate);
        // 2 omega x z slide_rate
        let slide = sum(graph, Atom::Rate, &link.slides);
        let twice = graph.scale(slide, &Rational::integer(2));
        let coriolis = [graph.mul(omega[1], twice), graph.mul(omega[0], twice)];
        acceleration[0] = graph.add(acceleration[0], coriolis[0]);
        acceleration[1] = graph.sub(acceleration[1], coriolis[1]);
        let slide_acceleration = sum(graph, Atom::Acceleration, &link.slides);
        acceleration[2] = graph.add(acceleration[2], slide_acceleration);
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

/// Backward recursion across parallel axes: each wrench on its own, turned to the fixed side of the first of several
/// parallel axes at once.
pub(crate) fn backward_across(
    graph: &mut Graph,
    tree: &Tree,
    n_coordinates: usize,
    wrenches: impl IntoIterator<Item = (usize, Wrench)>,
) -> Vec<ExprId> {
    let mut rows: Vec<Vec<(ExprId, Rational)>> = vec![Vec::new(); n_coordinates];
    for (start, wrench) in wrenches {
        let mut at = Some((start, wrench));
        while let Some((link, wrench)) = at {
            let (first, mut wrench) = across(graph, tree, link, wrench, &mut rows);
            at = tree.links[first].parent.map(|parent| {
                for turn in tree.links[first].pre.iter().rev() {
                    wrench.force = graph.turn_out(turn, &wrench.force);
                    wrench.moment = graph.turn_out(turn, &wrench.moment);
                }
                let lever = graph.cross(&tree.links[first].position, &wrench.force);
                wrench.moment = graph.add_vectors(&[wrench.moment, lever]);
                (parent, wrench)
            });
        }
    }
    rows.into_iter().map(|terms| graph.sum(&terms)).collect()
}

/// Reads off the generalised forces of the parallel joints from `link` up to the first, and returns that first link with
/// the wrench about its origin on the fixed side of its joint.
fn across(
    graph: &mut Graph,
    tree: &Tree,
    link: usize,
    wrench: Wrench,
    rows: &mut [Vec<(ExprId, Rational)>],
) -> (usize, Wrench) {
    let first = tree.links[link].first_parallel;
    // About z: from joint to joint, since only one component of the force is needed there.
    let (mut force, mut about_z) = (wrench.force, wrench.moment[2]);
    let mut arms: Vec<Vector> = Vec::new();
    let mut i = link;
    loop {
        let joint = &tree.links[i];
        for (coordinate, n) in &joint.turns {
            rows[*coordinate].push((about_z, Rational::integer(i64::from(*n))));
        }
        for (coordinate, k) in &joint.slides {
            rows[*coordinate].push((wrench.force[2], k.clone()));
        }
        if i == first {
            break;
        }
        force = tree.to_parent(graph, i, &force);
        let [px, py, _] = joint.position;
        let (x, y) = (graph.mul(px, force[1]), graph.mul(py, force[0]));
        about_z = graph.combine([
            (about_z, Rational::ONE),
            (x, Rational::ONE),
            (y, Rational::MINUS_ONE),
        ]);
        let parent = joint
            .parent
            .expect("a link below the first parallel one has a parent");
        let absolute = tree.links[parent].absolute.clone();
        arms.push(graph.turn_out(&absolute, &joint.position));
        i = parent;
    }
    // About x and y: at once.
    let absolute = &tree.links[link].absolute;
    let force = graph.turn_out(absolute, &wrench.force);
    let turned = graph.turn_out(absolute, &wrench.moment);
    let arm = graph.add_vectors(&arms);
    let lever = graph.cross(&arm, &force);
    let moment = [
        graph.add(turned[0], lever[0]),
        graph.add(turned[1], lever[1]),
        about_z,
    ];
    (first, Wrench { force, moment })
}
