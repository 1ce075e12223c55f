//! Shares pairs of terms or factors that several sums or products have in common (Breuer 1969, greedy).

use std::collections::BTreeSet;
use std::collections::hash_map::Entry;

use rustc_hash::FxHashMap;

use super::flatten::{rebuild, rewrite_affected};
use super::schedule::is_fixed;
use crate::expr::{ExprId, Graph, Node, Rational};

/// Gives every pair that occurs at least twice a node of its own, most frequent pairs first.
pub(crate) fn share_pairs(graph: &Graph, roots: &[ExprId]) -> (Graph, Vec<ExprId>) {
    let (mut graph, mut roots) = graph.compacted(roots);
    let mut live = graph.len();
    let mut counts = PairCounts::default();
    // Each round replaces the most frequent pairs; new nodes may form further pairs.
    for _ in 0..200 {
        counts.update(&graph, &roots);
        let pairs = counts.most_common();
        if pairs.is_empty() {
            break;
        }
        roots = replace_pairs(&mut graph, &roots, &pairs);
        // Replaced nodes stay in the arena, so it is compacted when it has doubled.
        if graph.len() > 2 * live {
            (graph, roots) = graph.compacted(&roots);
            live = graph.len();
            counts = PairCounts::default();
        }
    }
    (graph, roots)
}

/// Two operands that occur together.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum OperandPair {
    /// Two factors of a product.
    Factors(ExprId, ExprId),
    /// Two terms of a sum, with the ratio of the second coefficient to the first.
    Terms(ExprId, ExprId, Rational),
}

impl OperandPair {
    /// The two operands.
    fn operands(&self) -> [ExprId; 2] {
        match self {
            Self::Factors(a, b) | Self::Terms(a, b, _) => [*a, *b],
        }
    }
}

/// Calls `visit` for every pair of operands of a node. Pairs of fixed operands cost nothing and are left out.
fn pairs_of(node: &Node, fixed: &[bool], mut visit: impl FnMut(OperandPair)) {
    match node {
        Node::Sum(terms) if terms.len() > 2 => {
            for (i, (a, k)) in terms.iter().enumerate() {
                for (b, m) in &terms[i + 1..] {
                    if !(fixed[a.index()] && fixed[b.index()]) {
                        visit(OperandPair::Terms(*a, *b, m * &k.recip()));
                    }
                }
            }
        }
        Node::Product(factors) if factors.len() > 2 => {
            // Only factors with exponent 1 form pairs; fixed ones are multiplied once anyway.
            let simple: Vec<_> = factors.iter().filter(|(id, n)| *n == 1 && !fixed[id.index()]).collect();
            for (i, (a, _)) in simple.iter().enumerate() {
                for (b, _) in &simple[i + 1..] {
                    visit(OperandPair::Factors(*a, *b));
                }
            }
        }
        // A sum or product of two operands is such a pair already.
        Node::Sum(terms) if terms.len() == 2 => {
            let ((a, k), (b, m)) = (&terms[0], &terms[1]);
            if !(fixed[a.index()] && fixed[b.index()]) {
                visit(OperandPair::Terms(*a, *b, m * &k.recip()));
            }
        }
        Node::Product(factors) => {
            if let [(a, 1), (b, 1)] = factors.as_slice()
                && !fixed[a.index()]
                && !fixed[b.index()]
            {
                visit(OperandPair::Factors(*a, *b));
            }
        }
        _ => {}
    }
}

/// How often each pair occurs among the nodes in use. Few nodes change from round to round, so that only those are counted
/// anew.
#[derive(Default)]
struct PairCounts {
    counts: FxHashMap<OperandPair, usize>,
    /// For each node, whether its pairs are counted.
    is_counted: Vec<bool>,
    /// For each node, whether it is known once geometry and parameters are.
    fixed: Vec<bool>,
}

impl PairCounts {
    /// Counts the pairs of the nodes that `roots` need, and of no others.
    fn update(&mut self, graph: &Graph, roots: &[ExprId]) {
        // Fixed nodes are computed once, so their pairs are not worth sharing.
        let node = |i: usize| graph.node(ExprId(u32::try_from(i).expect("graph below 4G nodes")));
        for i in self.fixed.len()..graph.len() {
            self.fixed.push(is_fixed(node(i), &self.fixed));
        }
        self.is_counted.resize(graph.len(), false);
        for (i, needed) in graph.reachable(roots).into_iter().enumerate() {
            let counts = &mut self.counts;
            match (self.is_counted[i], needed && !self.fixed[i]) {
                (false, true) => pairs_of(node(i), &self.fixed, |pair| {
                    *counts.entry(pair).or_insert(0) += 1;
                }),
                (true, false) => pairs_of(node(i), &self.fixed, |pair| {
                    if let Entry::Occupied(mut count) = counts.entry(pair) {
                        *count.get_mut() -= 1;
                        if *count.get() == 0 {
                            count.remove();
                        }
                    }
                }),
                _ => continue,
            }
            self.is_counted[i] = !self.is_counted[i];
        }
    }

    /// Pairs that occur most often and at least twice. No operand is in two of them, so that they can be replaced together.
    fn most_common(&self) -> BTreeSet<OperandPair> {
        let most = self.counts.values().copied().max().unwrap_or(0);
        if most < 2 {
            return BTreeSet::new();
        }
        let found = self.counts.iter().filter(|(_, n)| **n == most);
        let mut found: Vec<&OperandPair> = found.map(|(pair, _)| pair).collect();
        // Equal counts are ordered by the pair itself, so that the result is always the same.
        found.sort_unstable();
        // Operands of pairs that have been chosen.
        let mut taken: BTreeSet<ExprId> = BTreeSet::new();
        let fresh = found.into_iter().filter(|pair| {
            let fresh = pair.operands().iter().all(|o| !taken.contains(o));
            taken.extend(pair.operands());
            fresh
        });
        fresh.cloned().collect()
    }
}

/// Rewrites all sums and products that contain one of the pairs.
fn replace_pairs(graph: &mut Graph, roots: &[ExprId], pairs: &BTreeSet<OperandPair>) -> Vec<ExprId> {
    // No operand is in two pairs of a kind, so its first operand identifies a pair.
    let (mut terms_with, mut factors_with) = (FxHashMap::default(), FxHashMap::default());
    for pair in pairs {
        match pair {
            OperandPair::Terms(a, b, ratio) => _ = terms_with.insert(*a, (*b, ratio)),
            OperandPair::Factors(a, b) => _ = factors_with.insert(*a, *b),
        }
    }
    // Nodes without a pair are made of the same operands as before, unless those changed.
    let is_affected = |node: &Node| match node {
        Node::Sum(terms) => terms.len() > 2 && terms.iter().any(|(t, _)| terms_with.contains_key(t)),
        Node::Product(factors) => factors.len() > 2 && factors.iter().any(|(f, _)| factors_with.contains_key(f)),
        _ => false,
    };
    rewrite_affected(graph, roots, is_affected, |graph, id, node| match &node {
        Node::Sum(terms) if terms.len() > 2 => {
            // Operands in the order of nodes, so that the result does not depend on the order of terms.
            let mut firsts: Vec<ExprId> = terms.iter().map(|(t, _)| *t).collect();
            firsts.sort_unstable();
            let mut terms = terms.clone();
            for a in firsts {
                let Some((b, ratio)) = terms_with.get(&a) else {
                    continue;
                };
                let find = |id: ExprId| terms.iter().position(|(t, _)| *t == id);
                // The pair must have the same ratio of coefficients here.
                if let (Some(i), Some(j)) = (find(a), find(*b))
                    && terms.len() > 2
                    && terms[j].1 == &terms[i].1 * *ratio
                {
                    let k = terms[i].1.clone();
                    // The pair becomes one term with the coefficient of its first operand.
                    let joined = graph.sum(&[(a, Rational::ONE), (*b, (*ratio).clone())]);
                    terms.retain(|(t, _)| *t != a && t != b);
                    terms.push((joined, k));
                }
            }
            graph.sum(&terms)
        }
        Node::Product(factors) if factors.len() > 2 => {
            let mut firsts: Vec<ExprId> = factors.iter().map(|(f, _)| *f).collect();
            firsts.sort_unstable();
            let mut factors = factors.clone();
            for a in firsts {
                let Some(b) = factors_with.get(&a) else {
                    continue;
                };
                let has = |id: ExprId| factors.contains(&(id, 1));
                if factors.len() > 2 && has(a) && has(*b) {
                    // The pair becomes one factor.
                    let joined = graph.mul(a, *b);
                    factors.retain(|(f, _)| *f != a && f != b);
                    factors.push((joined, 1));
                }
            }
            graph.product(&factors)
        }
        _ => rebuild(graph, id, &node),
    })
}
