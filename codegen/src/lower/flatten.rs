//! Flattens nested sums and products that are used only once, so that the following passes see all their operands.

use rustc_hash::FxHashMap;

use super::schedule::fixed_nodes;
use crate::expr::{ExprId, Graph, Node};

/// Number of uses of each node by `roots` and by nodes that these need.
pub(crate) fn use_counts(graph: &Graph, roots: &[ExprId]) -> Vec<usize> {
    // Roots count as uses.
    let mut uses = vec![0; graph.len()];
    for root in roots {
        uses[root.index()] += 1;
    }
    for (i, needed) in graph.reachable(roots).into_iter().enumerate() {
        if needed {
            graph.for_each_child(ExprId(u32::try_from(i).expect("graph below 4G nodes")), |child| {
                uses[child.index()] += 1;
            });
        }
    }
    uses
}

/// Rewrites every needed node, operands first. `rule` gets a node with rewritten operands and returns its replacement.
pub(crate) fn rewrite(
    graph: &mut Graph,
    roots: &[ExprId],
    mut rule: impl FnMut(&mut Graph, ExprId, Node) -> ExprId,
) -> Vec<ExprId> {
    let mut new: Vec<Option<ExprId>> = vec![None; graph.len()];
    let rewritten = |new: &[Option<ExprId>], id: ExprId| new[id.index()].expect("children come first");
    for (i, needed) in graph.reachable(roots).into_iter().enumerate() {
        if !needed {
            continue;
        }
        let id = ExprId(u32::try_from(i).expect("graph below 4G nodes"));
        let node = replace_operands(graph.node(id), |operand| rewritten(&new, operand));
        // The rule may replace the node by anything of equal value.
        let value = rule(graph, id, node);
        new[i] = Some(value);
    }
    roots.iter().map(|root| rewritten(&new, *root)).collect()
}

/// A node with its operands replaced.
pub(crate) fn replace_operands(node: &Node, new: impl Fn(ExprId) -> ExprId) -> Node {
    match node {
        Node::Sum(terms) => Node::Sum(terms.iter().map(|(c, k)| (new(*c), k.clone())).collect()),
        Node::Product(factors) => Node::Product(factors.iter().map(|(c, n)| (new(*c), *n)).collect()),
        Node::Unary(f, c) => Node::Unary(*f, new(*c)),
        leaf => leaf.clone(),
    }
}

/// Builds a node by the constructors that simplify; `id` is the node itself if it has no operands.
pub(crate) fn rebuild(graph: &mut Graph, id: ExprId, node: &Node) -> ExprId {
    match node {
        Node::Sum(terms) => graph.sum(terms),
        Node::Product(factors) => graph.product(factors),
        Node::Unary(f, c) => graph.unary(*f, *c),
        _ => id,
    }
}

/// Merges sums into sums and products into products where the inner one is used once. Fixed nodes stay as they are.
pub(crate) fn flatten(graph: &mut Graph, roots: &[ExprId]) -> Vec<ExprId> {
    let uses = use_counts(graph, roots);
    let fixed = fixed_nodes(graph, roots);
    // The rule sees rewritten operands; whether they are used once is known of the nodes that they came from.
    let mut once: FxHashMap<ExprId, bool> = FxHashMap::default();
    rewrite(graph, roots, |graph, id, node| {
        // Whether an operand may be merged into its user.
        let open =
            |graph: &Graph, child: ExprId| once.get(&child).copied().unwrap_or(false) && graph.node(child).is_open();
        let value = match &node {
            Node::Sum(terms) => {
                // The factor of an inner sum is multiplied into its terms.
                let mut flat = Vec::new();
                for (child, k) in terms {
                    let (base, inner_k) = graph.split_factor(*child);
                    match graph.node(base) {
                        Node::Sum(inner) if open(graph, base) || open(graph, *child) => {
                            let k = &inner_k * k;
                            flat.extend(inner.iter().map(|(c, m)| (*c, m * &k)));
                        }
                        _ => flat.push((*child, k.clone())),
                    }
                }
                graph.sum(&flat)
            }
            Node::Product(factors) => {
                // The exponent of an inner product is multiplied into those of its factors.
                let mut flat = Vec::new();
                for (child, n) in factors {
                    match graph.node(*child) {
                        Node::Product(inner) if open(graph, *child) => {
                            flat.extend(inner.iter().map(|(c, m)| (*c, m * n)));
                        }
                        _ => flat.push((*child, *n)),
                    }
                }
                graph.product(&flat)
            }
            _ => rebuild(graph, id, &node),
        };
        let single = uses[id.index()] == 1 && !fixed.get(id.index()).copied().unwrap_or(false);
        // A value that replaces several nodes is used more than once.
        once.entry(value).and_modify(|o| *o = false).or_insert(single);
        value
    })
}
