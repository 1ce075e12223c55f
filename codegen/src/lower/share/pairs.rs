//! Pairs of operands of sums and products, and how often each occurs among the nodes in use.

use std::collections::BTreeSet;
use std::ops::Range;

use rustc_hash::FxHashMap;

use crate::expr::{ExprId, Graph, Node, Rational};
use crate::lower::schedule::is_fixed;

/// Two operands that occur together.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum OperandPair {
    /// Two factors of a product.
    Factors(ExprId, ExprId),
    /// Two terms of a sum, with the ratio of the second coefficient to the first.
    Terms(ExprId, ExprId, Rational),
}

impl OperandPair {
    /// The two operands.
    pub(super) fn operands(&self) -> [ExprId; 2] {
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

/// A pair in a form that is cheap to hash and to copy.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct PairKey {
    operands: [ExprId; 2],
    /// Position of the ratio of two terms in [`PairCounts::ratios`]; `None` for two factors.
    ratio: Option<u32>,
}

/// How often each pair occurs among the nodes in use.
#[derive(Default)]
pub(super) struct PairCounts {
    /// Every pair that has occurred, with its present count.
    pairs: Vec<(PairKey, u32)>,
    /// Position of each pair in `pairs`.
    positions: FxHashMap<PairKey, u32>,
    /// Every ratio of terms that has occurred; there are few.
    ratios: Vec<Rational>,
    /// Position of each ratio in `ratios`.
    ratio_positions: FxHashMap<Rational, u32>,
    /// Positions of the pairs of nodes, node after node.
    listed: Vec<u32>,
    /// For each node its part of `listed`, from the first time that it is counted.
    pairs_of_node: Vec<Option<Range<usize>>>,
    /// For each node, whether it is known once geometry and parameters are.
    fixed: Vec<bool>,
}

impl PairCounts {
    /// Counts the pairs of a node. Fixed nodes are computed once, so their pairs are not worth sharing.
    pub(super) fn add_node(&mut self, graph: &Graph, id: ExprId) {
        for i in self.fixed.len()..graph.len() {
            let node = graph.node(ExprId(u32::try_from(i).expect("graph below 4G nodes")));
            self.fixed.push(is_fixed(node, &self.fixed));
            self.pairs_of_node.push(None);
        }
        if self.fixed[id.index()] {
            return;
        }
        if self.pairs_of_node[id.index()].is_none() {
            self.list_pairs(graph, id);
        }
        for k in self.pairs_of_node[id.index()].clone().into_iter().flatten() {
            self.pairs[self.listed[k] as usize].1 += 1;
        }
    }

    /// Lists the pairs of a node, with the count zero for new ones.
    fn list_pairs(&mut self, graph: &Graph, id: ExprId) {
        let start = self.listed.len();
        let (pairs, positions, listed) = (&mut self.pairs, &mut self.positions, &mut self.listed);
        let (ratios, ratio_positions) = (&mut self.ratios, &mut self.ratio_positions);
        pairs_of(graph.node(id), &self.fixed, |pair| {
            let operands = pair.operands();
            let ratio = match pair {
                OperandPair::Factors(..) => None,
                OperandPair::Terms(_, _, ratio) => Some(*ratio_positions.entry(ratio).or_insert_with_key(|ratio| {
                    ratios.push(ratio.clone());
                    position(ratios.len() - 1)
                })),
            };
            let key = PairKey { operands, ratio };
            listed.push(*positions.entry(key).or_insert_with(|| {
                pairs.push((key, 0));
                position(pairs.len() - 1)
            }));
        });
        self.pairs_of_node[id.index()] = Some(start..self.listed.len());
    }

    /// Removes the pairs of a node that is no longer in use.
    pub(super) fn remove_node(&mut self, id: ExprId) {
        for k in self.pairs_of_node[id.index()].clone().into_iter().flatten() {
            self.pairs[self.listed[k] as usize].1 -= 1;
        }
    }

    /// Pairs that occur most often and at least twice. No operand is in two of them, so that they can be replaced
    /// together.
    pub(super) fn most_common(&self) -> BTreeSet<OperandPair> {
        let most = self.pairs.iter().map(|(_, n)| *n).max().unwrap_or(0);
        if most < 2 {
            return BTreeSet::new();
        }
        let found = self.pairs.iter().filter(|(_, n)| *n == most);
        let mut found: Vec<OperandPair> = found.map(|(key, _)| self.pair_of(key)).collect();
        // Equal counts are ordered by the pair itself, so that the result is always the same.
        found.sort_unstable();
        // Operands of pairs that have been chosen.
        let mut taken: BTreeSet<ExprId> = BTreeSet::new();
        found.retain(|pair| {
            let is_fresh = pair.operands().iter().all(|o| !taken.contains(o));
            taken.extend(pair.operands());
            is_fresh
        });
        found.into_iter().collect()
    }

    fn pair_of(&self, key: &PairKey) -> OperandPair {
        let [a, b] = key.operands;
        match key.ratio {
            None => OperandPair::Factors(a, b),
            Some(ratio) => OperandPair::Terms(a, b, self.ratios[ratio as usize].clone()),
        }
    }
}

/// A position in a list of [`PairCounts`].
fn position(index: usize) -> u32 {
    u32::try_from(index).expect("fewer than 4G pairs")
}
