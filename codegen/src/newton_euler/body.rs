//! Inertia of one link in the form that fits its motion, and the wrench that moves it.

use std::collections::BTreeMap;

use super::motion::LinkMotion;
use super::{InertiaElement, InertiaFactors, JointSide, SymbolicWrench, TreeMotion};
use crate::expr::vector::{self, AxisRotation, SymbolicVector};
use crate::expr::{ExprId, Graph, Rational};
use crate::tree::KinematicTree;

/// The diagonal of the inertia, in one of two forms.
#[derive(Clone, Copy, Debug)]
pub(crate) enum InertiaDiagonal {
    /// Moments of inertia about x, y and z, kg m^2.
    Moments(SymbolicVector),
    /// Second moments of mass along x and y, kg m^2; that along z is zero.
    Flat([ExprId; 2]),
}

/// Inertia of one link about its origin, in its own axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyInertia {
    /// Mass, kg.
    pub(crate) mass: ExprId,
    /// First moment in the balance of forces, kg m.
    pub(crate) force_moment: SymbolicVector,
    /// First moment in the balance of moments, kg m.
    pub(crate) moment_moment: SymbolicVector,
    /// Diagonal of the inertia.
    pub(crate) spread: InertiaDiagonal,
    /// Products of inertia yz, xz, xy, kg m^2: in positions opposite to x, y, z.
    pub(crate) products: SymbolicVector,
}

impl BodyInertia {
    /// Collects the elements of one link.
    pub(crate) fn new(inertia: &InertiaFactors) -> Self {
        let element = |e: InertiaElement| inertia[e.index()];
        let inertia = |i| element(InertiaElement::Inertia(i));
        Self {
            mass: element(InertiaElement::Mass),
            force_moment: [0, 1, 2].map(|i| element(InertiaElement::ForceMoment(i))),
            moment_moment: [0, 1, 2].map(|i| element(InertiaElement::MomentMoment(i))),
            // Elements are stored in the order xx, xy, xz, yy, yz, zz.
            spread: InertiaDiagonal::Moments([0, 3, 5].map(inertia)),
            products: [4, 2, 1].map(inertia),
        }
    }

    /// A body without inertia.
    pub(crate) const NONE: Self = Self {
        mass: Graph::ZERO,
        force_moment: vector::ZERO,
        moment_moment: vector::ZERO,
        spread: InertiaDiagonal::Moments(vector::ZERO),
        products: vector::ZERO,
    };

    /// The body in axes from which its own axes are rotated about z by `turn`.
    pub(crate) fn rotate(&self, graph: &mut Graph, turn: &AxisRotation) -> Self {
        let (c, s) = graph.cos_sin(&turn.sum, turn.pi12);
        let force_moment = graph.rotate_out(turn, &self.force_moment);
        let moment_moment = graph.rotate_out(turn, &self.moment_moment);
        let [yz, xz, xy] = self.products;
        // The products with z rotate as a vector.
        let [xz, yz, _] = graph.rotate_out(turn, &[xz, yz, Graph::ZERO]);
        let mut turned = Self {
            mass: self.mass,
            force_moment,
            moment_moment,
            spread: self.spread,
            products: [yz, xz, xy],
        };
        // The other elements rotate by twice the angle about their mean. Second moments rotate as moments of inertia
        // do, but products of inertia are second moments with the opposite sign.
        let (xx, yy, mixed) = match self.spread {
            InertiaDiagonal::Moments([xx, yy, _]) => (xx, yy, xy),
            InertiaDiagonal::Flat([xx, yy]) => (xx, yy, graph.neg(xy)),
        };
        // A round body is the same in all directions across z.
        if xx == yy && xy == Graph::ZERO {
            return turned;
        }
        // Half the sum and half the difference of the two diagonal elements.
        let half = Rational::new(1, 2);
        let mean = graph.linear_combination([(xx, half.clone()), (yy, half.clone())]);
        let apart = graph.linear_combination([(xx, half.clone()), (yy, -&half)]);
        // Sine and cosine of twice the angle.
        let twice = graph.scale(s, &Rational::integer(2));
        let (ss, sine) = (graph.mul(twice, s), graph.mul(twice, c));
        let cosine = graph.sub(Graph::ONE, ss);
        let [ca, sm, sa, cm] =
            [(cosine, apart), (sine, mixed), (sine, apart), (cosine, mixed)].map(|(a, b)| graph.mul(a, b));
        let apart = graph.sub(ca, sm);
        let mixed = graph.add(sa, cm);
        let (xx, yy) = (graph.add(mean, apart), graph.sub(mean, apart));
        (turned.spread, turned.products[2]) = match self.spread {
            InertiaDiagonal::Moments([_, _, zz]) => (InertiaDiagonal::Moments([xx, yy, zz]), mixed),
            InertiaDiagonal::Flat(_) => (InertiaDiagonal::Flat([xx, yy]), graph.neg(mixed)),
        };
        turned
    }
}

/// Moves second moments along a joint's axis to the link that carries it. A line along the axis without mass and first
/// moment moves equally on both sides of the joint. So the forces stay the same, and one multiplication less is needed.
pub(crate) fn flatten_along_axes(
    graph: &mut Graph,
    tree: &KinematicTree,
    motion: &TreeMotion,
    bodies: &mut BTreeMap<usize, BodyInertia>,
) {
    // From the ends of the tree to the base, since a parent receives from its children.
    for i in (0..tree.links.len()).rev() {
        let link = &tree.links[i];
        let Some((axis, _)) = link.axis else {
            continue;
        };
        let Some(body) = bodies.get_mut(&i).filter(|_| motion.is_tilting(i)) else {
            continue;
        };
        let InertiaDiagonal::Moments([xx, yy, zz]) = body.spread else {
            continue;
        };
        // Second moment along an axis from the three moments of inertia.
        let half = Rational::new(1, 2);
        let mut moment = |less: ExprId, a: ExprId, b: ExprId| {
            let terms = [(a, half.clone()), (b, half.clone()), (less, -&half)];
            graph.linear_combination(terms)
        };
        let (x, y, z) = (moment(xx, yy, zz), moment(yy, xx, zz), moment(zz, xx, yy));
        body.spread = InertiaDiagonal::Flat([x, y]);
        // On the parent, a mass distribution along the axis has moments about the two other axes.
        let Some(parent) = link.parent else { continue };
        let parent = bodies.entry(parent).or_insert(BodyInertia::NONE);
        if let InertiaDiagonal::Moments(moments) = &mut parent.spread {
            for (k, moment) in moments.iter_mut().enumerate() {
                if k != axis {
                    *moment = graph.add(*moment, z);
                }
            }
        }
    }
}

/// Wrenches of all bodies, each with its link and the side of the joint on which it is given. With `turn_ends`, bodies
/// at the ends of the tree get theirs on the fixed side, because it is cheaper to rotate the inertia than the complete
/// motion.
pub(crate) fn wrenches(
    graph: &mut Graph,
    tree: &KinematicTree,
    motion: &TreeMotion,
    bodies: &BTreeMap<usize, BodyInertia>,
    turn_ends: bool,
) -> Vec<(usize, JointSide, SymbolicWrench)> {
    let mut wrenches = Vec::new();
    for (i, body) in bodies {
        // A link without children.
        let is_end = !tree.links.iter().any(|link| link.parent == Some(*i));
        let mut on_fixed_side = || {
            // Only the moments of flat bodies do not need the angular acceleration.
            let InertiaDiagonal::Flat(_) = body.spread else {
                return None;
            };
            let body = body.rotate(graph, &tree.links[*i].joint);
            let moved = motion.side_motion(graph, tree, *i, JointSide::Fixed)?;
            Some(wrench(graph, &moved, &body))
        };
        let found = if turn_ends && is_end {
            on_fixed_side().map(|wrench| (*i, JointSide::Fixed, wrench))
        } else {
            None
        };
        wrenches.push(found.unwrap_or_else(|| {
            let moved = motion.links[*i].clone();
            (*i, JointSide::Moving, wrench(graph, &moved, body))
        }));
    }
    wrenches
}

impl TreeMotion {
    /// The wrench that moves a body along with `link`, about the link's origin and in its axes.
    pub(crate) fn wrench(&self, graph: &mut Graph, link: usize, body: &BodyInertia) -> SymbolicWrench {
        wrench(graph, &self.links[link], body)
    }
}

/// Newton's and Euler's equations of one body: force in N, and moment about the origin in N m.
fn wrench(graph: &mut Graph, moved: &LinkMotion, body: &BodyInertia) -> SymbolicWrench {
    let LinkMotion {
        omega,
        alpha,
        acceleration,
        field,
        differences,
        ..
    } = moved;
    // Force: mass times the acceleration of the origin, plus the field times the first moment.
    let mut force = graph.scale_vector(body.mass, acceleration);
    for i in 0..3 {
        let swung = graph.dot(&field[i], &body.force_moment);
        force[i] = graph.add(force[i], swung);
    }
    // Moment of the accelerated origin.
    let lever = graph.cross(&body.moment_moment, acceleration);
    let off = body.products;
    let moment = std::array::from_fn(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let against = graph.neg(field[k][i]);
        let mut terms = vec![
            graph.mul(off[k], against),
            graph.mul(off[j], field[j][i]),
            graph.mul(off[i], differences[i]),
            lever[i],
        ];
        // Euler's equation for the diagonal of the inertia.
        match body.spread {
            InertiaDiagonal::Moments(diagonal) => {
                let spread = graph.sub(diagonal[k], diagonal[j]);
                let product = graph.mul(omega[j], omega[k]);
                terms.push(graph.mul(diagonal[i], alpha[i]));
                terms.push(graph.mul(spread, product));
            }
            // With second moments: moment_i = field_kj e_jj - field_jk e_kk.
            InertiaDiagonal::Flat(second) => {
                let second = [second[0], second[1], Graph::ZERO];
                terms.push(graph.mul(field[k][j], second[j]));
                let other = graph.mul(field[j][k], second[k]);
                terms.push(graph.neg(other));
            }
        }
        graph.add_all(&terms)
    });
    SymbolicWrench { force, moment }
}
