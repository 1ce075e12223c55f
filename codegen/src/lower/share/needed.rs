//! The nodes that some roots need, kept up to date while roots are rewritten: few nodes change from round to round.

use crate::expr::{ExprId, Graph};

/// The nodes that roots need, with the nodes that use them.
#[derive(Default)]
pub(super) struct NeededNodes {
    /// For each node the number of its uses by roots and by needed nodes; a node without uses is not needed.
    n_uses: Vec<usize>,
    /// For each node the last entry in `users` that belongs to it.
    last_user: Vec<Option<usize>>,
    /// Nodes that have ever used another one, each with the entry before it that belongs to the same operand.
    users: Vec<(ExprId, Option<usize>)>,
    /// For each node whether it stands among the users of its operands.
    is_listed: Vec<bool>,
}

impl NeededNodes {
    /// Adds a use of a node. `visit` gets each node that becomes needed by this.
    pub(super) fn add_use(&mut self, graph: &Graph, id: ExprId, mut visit: impl FnMut(ExprId)) {
        self.n_uses.resize(graph.len(), 0);
        self.last_user.resize(graph.len(), None);
        self.is_listed.resize(graph.len(), false);
        let mut open = vec![id];
        while let Some(id) = open.pop() {
            self.n_uses[id.index()] += 1;
            if self.n_uses[id.index()] > 1 {
                continue;
            }
            visit(id);
            let is_new = !std::mem::replace(&mut self.is_listed[id.index()], true);
            graph.for_each_child(id, |child| {
                open.push(child);
                if is_new {
                    let before = self.last_user[child.index()].replace(self.users.len());
                    self.users.push((id, before));
                }
            });
        }
    }

    /// Removes a use of a node. `visit` gets each node that is no longer needed after this.
    pub(super) fn remove_use(&mut self, graph: &Graph, id: ExprId, mut visit: impl FnMut(ExprId)) {
        let mut open = vec![id];
        while let Some(id) = open.pop() {
            self.n_uses[id.index()] -= 1;
            if self.n_uses[id.index()] == 0 {
                visit(id);
                graph.for_each_child(id, |child| open.push(child));
            }
        }
    }

    /// The needed nodes that use a node.
    pub(super) fn users_of(&self, id: ExprId) -> impl Iterator<Item = ExprId> {
        let last = self.last_user.get(id.index()).copied().flatten();
        let entries = std::iter::successors(last, |entry| self.users[*entry].1);
        let users = entries.map(|entry| self.users[entry].0);
        users.filter(|user| self.n_uses[user.index()] > 0)
    }
}
