//! Shares pairs of terms or factors that several sums or products have in common (Breuer 1969, greedy).
//!
//! Decision: uses and counts of pairs are updated for the nodes that a round changes. A round changes few nodes, and
//! visits of the complete graph in each round took a fifth of the derivation of a platform with six legs.

mod needed;
mod pairs;

use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

use rustc_hash::FxHashMap;

use self::needed::NeededNodes;
use self::pairs::{OperandPair, PairCounts};
use super::flatten::{rebuild, replace_operands};
use crate::expr::{ExprId, Graph, Node, Rational};

/// Largest number of rounds in each of which the most frequent pairs are replaced. By judgement.
const MOST_ROUNDS: usize = 200;

/// Gives every pair that occurs at least twice a node of its own, most frequent pairs first.
pub(crate) fn share_pairs(graph: &Graph, roots: &[ExprId]) -> (Graph, Vec<ExprId>) {
    let mut sharing = PairSharing::new(graph, roots);
    // Each round replaces the most frequent pairs; new nodes may form further pairs.
    for _ in 0..MOST_ROUNDS {
        let pairs = sharing.counts.most_common();
        if pairs.is_empty() {
            break;
        }
        sharing.replace_pairs(&pairs);
        // Replaced nodes stay in the arena, so it is compacted when it has doubled.
        if sharing.graph.len() > 2 * sharing.n_compacted {
            sharing = PairSharing::new(&sharing.graph, &sharing.roots);
        }
    }
    (sharing.graph, sharing.roots)
}

/// Expressions whose pairs are shared, with what a round needs to know of them.
struct PairSharing {
    graph: Graph,
    roots: Vec<ExprId>,
    /// Number of nodes when the graph was compacted.
    n_compacted: usize,
    needed: NeededNodes,
    counts: PairCounts,
}

impl PairSharing {
    /// Compacts a graph and counts all pairs.
    fn new(graph: &Graph, roots: &[ExprId]) -> Self {
        let (graph, roots) = graph.compacted(roots);
        let (mut needed, mut counts) = (NeededNodes::default(), PairCounts::default());
        for root in &roots {
            needed.add_use(&graph, *root, |id| counts.add_node(&graph, id));
        }
        Self {
            n_compacted: graph.len(),
            graph,
            roots,
            needed,
            counts,
        }
    }

    /// Replaces a root, and updates uses and counts.
    fn replace_root(&mut self, position: usize, by: ExprId) {
        let root = std::mem::replace(&mut self.roots[position], by);
        let (graph, counts) = (&self.graph, &mut self.counts);
        // The new root first, so that nodes that both need stay as they are.
        self.needed.add_use(graph, by, |id| counts.add_node(graph, id));
        self.needed.remove_use(graph, root, |id| counts.remove_node(id));
    }

    /// Rewrites all sums and products that contain one of the pairs.
    fn replace_pairs(&mut self, pairs: &BTreeSet<OperandPair>) {
        let pairs = PairsByOperand::new(pairs);
        // Nodes that contain a pair, and those above them whose operands change; operands come first.
        let mut open: BinaryHeap<Reverse<ExprId>> = BinaryHeap::new();
        for first in pairs.first_operands() {
            let users = self.needed.users_of(first);
            open.extend(users.filter(|user| pairs.is_in(self.graph.node(*user))).map(Reverse));
        }
        let mut replaced: FxHashMap<ExprId, ExprId> = FxHashMap::default();
        let mut last = None;
        while let Some(Reverse(id)) = open.pop() {
            // A node is listed once for each changed operand.
            if last.replace(id) == Some(id) {
                continue;
            }
            let node = replace_operands(self.graph.node(id), |operand| {
                *replaced.get(&operand).unwrap_or(&operand)
            });
            let by = pairs.replace(&mut self.graph, id, &node);
            if by != id {
                replaced.insert(id, by);
                open.extend(self.needed.users_of(id).map(Reverse));
            }
        }
        for position in 0..self.roots.len() {
            if let Some(by) = replaced.get(&self.roots[position]) {
                self.replace_root(position, *by);
            }
        }
    }
}

/// Pairs that are replaced together. No operand is in two pairs of a kind, so its first operand identifies a pair.
struct PairsByOperand<'a> {
    /// The second term and the ratio of the coefficients, by the first term.
    terms: FxHashMap<ExprId, (ExprId, &'a Rational)>,
    /// The second factor, by the first one.
    factors: FxHashMap<ExprId, ExprId>,
}

impl<'a> PairsByOperand<'a> {
    fn new(pairs: &'a BTreeSet<OperandPair>) -> Self {
        let (mut terms, mut factors) = (FxHashMap::default(), FxHashMap::default());
        for pair in pairs {
            match pair {
                OperandPair::Terms(a, b, ratio) => _ = terms.insert(*a, (*b, ratio)),
                OperandPair::Factors(a, b) => _ = factors.insert(*a, *b),
            }
        }
        Self { terms, factors }
    }

    fn first_operands(&self) -> impl Iterator<Item = ExprId> {
        self.terms.keys().chain(self.factors.keys()).copied()
    }

    /// Whether a node may contain a pair. Other nodes stay as they are unless their operands change.
    fn is_in(&self, node: &Node) -> bool {
        match node {
            Node::Sum(terms) => terms.len() > 2 && terms.iter().any(|(t, _)| self.terms.contains_key(t)),
            Node::Product(factors) => factors.len() > 2 && factors.iter().any(|(f, _)| self.factors.contains_key(f)),
            _ => false,
        }
    }

    /// The node with each pair in it as one operand.
    fn replace(&self, graph: &mut Graph, id: ExprId, node: &Node) -> ExprId {
        match node {
            Node::Sum(terms) if terms.len() > 2 => {
                // Operands in the order of nodes, so that the result does not depend on the order of terms.
                let mut firsts: Vec<ExprId> = terms.iter().map(|(t, _)| *t).collect();
                firsts.sort_unstable();
                let mut terms = terms.clone();
                for a in firsts {
                    let Some((b, ratio)) = self.terms.get(&a) else {
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
                    let Some(b) = self.factors.get(&a) else {
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
            _ => rebuild(graph, id, node),
        }
    }
}
