//! Replacement of nodes by expressions, rebuilt through the smart constructors.

use std::collections::BTreeMap;

use super::{ExprId, Graph, Node};

impl Graph {
    /// Rewrites each root with every key of `replacements` replaced by its value, in one pass: values are not rewritten
    /// again.
    ///
    /// Returns the new roots in the order of `roots`; nodes without a replacement below them stay the same nodes.
    pub fn substitute(&mut self, roots: &[ExprId], replacements: &BTreeMap<ExprId, ExprId>) -> Vec<ExprId> {
        if replacements.is_empty() {
            return roots.to_vec();
        }
        // Operands precede their nodes, so the new id of each operand is known when its node is rebuilt.
        let mut rewritten: Vec<ExprId> = Vec::new();
        for (i, needed) in self.reachable(roots).into_iter().enumerate() {
            let id = ExprId(u32::try_from(i).expect("graph below 4G nodes"));
            // Nodes that no root needs stay as they are.
            let value = if !needed {
                id
            } else if let Some(replacement) = replacements.get(&id) {
                *replacement
            } else {
                // Nodes are rebuilt only if an operand has changed.
                match self.node(id) {
                    Node::Sum(terms) if terms.iter().any(|(c, _)| rewritten[c.index()] != *c) => {
                        let terms: Vec<_> = terms.iter().map(|(c, k)| (rewritten[c.index()], k.clone())).collect();
                        self.sum(&terms)
                    }
                    Node::Product(factors) if factors.iter().any(|(c, _)| rewritten[c.index()] != *c) => {
                        let factors: Vec<_> = factors.iter().map(|(c, n)| (rewritten[c.index()], *n)).collect();
                        self.product(&factors)
                    }
                    Node::Unary(function, child) if rewritten[child.index()] != *child => {
                        let (function, child) = (*function, rewritten[child.index()]);
                        self.unary(function, child)
                    }
                    _ => id,
                }
            };
            rewritten.push(value);
        }
        roots.iter().map(|root| rewritten[root.index()]).collect()
    }
}
