//! In which order columns are tried as retained ones.
//!
//! Products that the file names come first, all others in the order of eq. (5). Masses at a distance from their link's
//! origin are a case of their own. Their columns are sums of the link's own ones with powers of lengths; written the other way
//! round, the link's own ones take quotients by differences, which vanish where masses coincide. So there is a second order,
//! in which such a product waits until its links' own products have been tried; it is taken where it saves such quotients.
//!
//! Decision: both orders are tried along lines in the lengths. The order of the declaration stays unless the other
//! one has fewer such quotients, because published bases are in the order of declaration.

use std::collections::BTreeMap;

use modelmill_spec::Mechanism;

use crate::expr::{ExprId, Graph, Node, Rational};
use crate::newton_euler::Inertia;
use crate::regressor::Equations;
use crate::tree::Tree;
use crate::tree::expressions::Monomial;

/// Positions among the effective products, most preferred first.
pub(super) struct Preference {
    /// In the order of eq. (5).
    pub(super) declared: Vec<usize>,
    /// Masses at a distance behind their links' own products.
    pub(super) own_first: Vec<usize>,
    /// How many of them the file names.
    pub(super) n_named: usize,
}

pub(super) fn preference(
    graph: &Graph,
    mechanism: &Mechanism,
    equations: &Equations,
    effective: &[usize],
) -> Preference {
    let product = |k: usize| &equations.products[effective[k]];
    let mut order: Vec<usize> = mechanism
        .retain
        .iter()
        .filter_map(|powers| {
            let wanted = powers.iter().fold(Monomial::default(), |m, (p, n)| {
                m.times(&Monomial(vec![(p.0, *n)]))
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
    let carried: Vec<Carried> = (0..effective.len())
        .map(|k| Carried::new(graph, equations, product(k)))
        .collect();
    let mut last_own: BTreeMap<usize, usize> = BTreeMap::new();
    for (k, one) in carried.iter().enumerate() {
        if !one.is_distant {
            last_own.extend(one.bodies.iter().map(|body| (*body, k)));
        }
    }
    let mut others: Vec<usize> = (0..effective.len())
        .filter(|k| !named.contains(k))
        .collect();
    let declared = [named.as_slice(), &others].concat();
    others.sort_by_key(|&k| {
        let one = &carried[k];
        let own = one.bodies.iter().filter_map(|body| last_own.get(body));
        let after = own.copied().max().filter(|_| one.is_distant).unwrap_or(0);
        (after.max(k), one.is_distant, k)
    });
    Preference {
        declared,
        own_first: [named.as_slice(), &others].concat(),
        n_named: named.len(),
    }
}

/// On which bodies a product has inertia.
struct Carried {
    /// Links that move relative to their parents; what hangs on them without a joint is theirs.
    bodies: Vec<usize>,
    /// Whether some of it depends on where the product sits on them.
    is_distant: bool,
}

impl Carried {
    fn new(graph: &Graph, equations: &Equations, product: &Monomial) -> Self {
        let (mut bodies, mut is_distant) = (Vec::new(), false);
        for (link, inertia) in equations.inertia.by_link(product) {
            let (body, is_at_origin) = body_of(&equations.tree, link);
            bodies.extend(body);
            is_distant |= !(is_at_origin && is_own(graph, inertia));
        }
        Self { bodies, is_distant }
    }
}

/// The moving link to which a link is fixed, and whether their origins are the same.
fn body_of(tree: &Tree, mut link: usize) -> (Option<usize>, bool) {
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

/// Whether an inertia is that of a parameter about the origin: all that it holds is one number, but for signs.
fn is_own(graph: &Graph, inertia: &Inertia) -> bool {
    let mut sizes = Vec::new();
    for factor in inertia.iter().filter(|factor| **factor != Graph::ZERO) {
        match number(graph, *factor) {
            Some(number) => sizes.push(number),
            None => return false,
        }
    }
    sizes.windows(2).all(|pair| pair[0] == pair[1])
}

/// The size of a number.
fn number(graph: &Graph, id: ExprId) -> Option<Rational> {
    match graph.node(id) {
        Node::Rational(value) if value.is_negative() => Some(-value),
        Node::Rational(value) => Some(value.clone()),
        _ => None,
    }
}
