//! The order in which columns are tried as retained ones.
//!
//! Products that the file names come first, all others in the order of eq. (5). Masses at a distance from their link's
//! origin are a special case. Their columns are sums of the link's own columns with powers of lengths. The link's own
//! columns, written by those, have quotients by differences of lengths, which vanish where masses coincide. So there is
//! a second order, in which such a product comes after its links' own products. It is used if it avoids such quotients.
//!
//! Decision: both orders are tried along lines in the lengths. The order of the declaration is used unless the other
//! one has fewer such quotients, because published bases are in the order of declaration.

use std::collections::BTreeMap;

use modelmill_spec::Mechanism;

use crate::expr::{ExprId, Graph, Node, Rational};
use crate::newton_euler::InertiaFactors;
use crate::regressor::UnreducedEquations;
use crate::tree::KinematicTree;
use crate::tree::expressions::ParameterMonomial;

/// Two orders of the effective products, by position, most preferred first.
pub(super) struct RetentionPreference {
    /// In the order of eq. (5).
    pub(super) declared: Vec<usize>,
    /// Masses at a distance come after their links' own products.
    pub(super) own_first: Vec<usize>,
    /// Number of products that the file names; they come first in both orders.
    pub(super) n_named: usize,
}

/// The orders of preference for the products in `effective`.
pub(super) fn retention_preference(
    graph: &Graph,
    mechanism: &Mechanism,
    equations: &UnreducedEquations,
    effective: &[usize],
) -> RetentionPreference {
    let product = |k: usize| &equations.products[effective[k]];
    // Products that the file names, as far as they have an effect, each once.
    let mut order: Vec<usize> = mechanism
        .retain
        .iter()
        .filter_map(|powers| {
            let wanted = powers.iter().fold(ParameterMonomial::default(), |m, (p, n)| {
                m.times(&ParameterMonomial(vec![(p.0, *n)]))
            });
            (0..effective.len()).find(|k| *product(*k) == wanted)
        })
        .collect();
    let mut named = Vec::with_capacity(order.len());
    for k in order.drain(..) {
        if !named.contains(&k) {
            named.push(k);
        }
    }
    // The bodies of every product, and the last own product of every body.
    let carried: Vec<ProductBodies> = (0..effective.len())
        .map(|k| ProductBodies::new(graph, equations, product(k)))
        .collect();
    let mut last_own: BTreeMap<usize, usize> = BTreeMap::new();
    for (k, one) in carried.iter().enumerate() {
        if !one.is_distant {
            last_own.extend(one.bodies.iter().map(|body| (*body, k)));
        }
    }
    let mut others: Vec<usize> = (0..effective.len()).filter(|k| !named.contains(k)).collect();
    let declared = [named.as_slice(), &others].concat();
    // A distant product comes after the last own product of all its bodies.
    others.sort_by_key(|&k| {
        let one = &carried[k];
        let own = one.bodies.iter().filter_map(|body| last_own.get(body));
        let after = own.copied().max().filter(|_| one.is_distant).unwrap_or(0);
        (after.max(k), one.is_distant, k)
    });
    RetentionPreference {
        declared,
        own_first: [named.as_slice(), &others].concat(),
        n_named: named.len(),
    }
}

/// The bodies on which a product has inertia.
struct ProductBodies {
    /// Links that move relative to their parents; links without a joint belong to these.
    bodies: Vec<usize>,
    /// Whether some of its inertia depends on its place on them.
    is_distant: bool,
}

impl ProductBodies {
    /// Collects the bodies of all links with inertia of this product.
    fn new(graph: &Graph, equations: &UnreducedEquations, product: &ParameterMonomial) -> Self {
        let (mut bodies, mut is_distant) = (Vec::new(), false);
        for (link, inertia) in equations.inertia.link_inertias(product) {
            let (body, is_at_origin) = body_of(&equations.tree, link);
            bodies.extend(body);
            is_distant |= !(is_at_origin && is_direct_parameter(graph, inertia));
        }
        Self { bodies, is_distant }
    }
}

/// The moving link to which a link is fixed, and whether their origins are the same.
fn body_of(tree: &KinematicTree, mut link: usize) -> (Option<usize>, bool) {
    let mut is_at_origin = true;
    loop {
        let here = &tree.links[link];
        if here.is_moving() {
            return (Some(link), is_at_origin);
        }
        is_at_origin &= here.position == [Graph::ZERO; 3];
        match here.parent {
            Some(parent) => link = parent,
            None => return (None, is_at_origin),
        }
    }
}

/// Whether an inertia is that of a parameter about the origin: all its elements are one number up to signs.
fn is_direct_parameter(graph: &Graph, inertia: &InertiaFactors) -> bool {
    let mut sizes = Vec::new();
    for factor in inertia.iter().filter(|factor| **factor != Graph::ZERO) {
        match number_magnitude(graph, *factor) {
            Some(number) => sizes.push(number),
            None => return false,
        }
    }
    sizes.windows(2).all(|pair| pair[0] == pair[1])
}

/// The magnitude of a number; `None` for other expressions.
fn number_magnitude(graph: &Graph, id: ExprId) -> Option<Rational> {
    match graph.node(id) {
        Node::Rational(value) if value.is_negative() => Some(-value),
        Node::Rational(value) => Some(value.clone()),
        _ => None,
    }
}
