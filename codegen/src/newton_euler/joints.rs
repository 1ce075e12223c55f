//! What each joint transmits: the backward recursion with every wrench kept.

use super::backward::to_parent;
use super::rows::join;
use super::{Side, Style, Wrench};
use crate::expr::Graph;
use crate::expr::vector;
use crate::tree::Tree;

/// A wrench that the joints above a link supply, about the link's origin and in its axes.
pub(crate) struct Load {
    pub(crate) link: usize,
    pub(crate) wrench: Wrench,
    /// The link that carries its counterpart, so that joints from there to the base feel nothing of both; `None` for the
    /// base.
    pub(crate) until: Option<usize>,
}

/// The wrench that each link gets through its joint, about the link's origin and in its axes.
pub(crate) fn joint_wrenches(graph: &mut Graph, tree: &Tree, loads: Vec<Load>) -> Vec<Wrench> {
    let n = tree.links.len();
    // Loads with a common end travel together.
    let mut ends: Vec<Option<usize>> = loads.iter().map(|load| load.until).collect();
    ends.sort_unstable();
    ends.dedup();
    let mut totals: Vec<Vec<Option<Wrench>>> = vec![vec![None; n]; ends.len()];
    for load in loads {
        let group = ends.binary_search(&load.until).expect("collected above");
        join(graph, &mut totals[group][load.link], load.wrench);
    }
    let mut through: Vec<Option<Wrench>> = vec![None; n];
    for i in (0..n).rev() {
        let link = &tree.links[i];
        for (until, total) in ends.iter().zip(&mut totals) {
            let Some(wrench) = total[i].filter(|_| Some(i) != *until) else {
                continue;
            };
            join(graph, &mut through[i], wrench);
            if let Some(parent) = link.parent {
                let wrench = to_parent(graph, Style::PLAIN, link, Side::Moving, &wrench);
                join(graph, &mut total[parent], wrench);
            }
        }
    }
    let nothing = Wrench {
        force: vector::ZERO,
        moment: vector::ZERO,
    };
    through.into_iter().map(|w| w.unwrap_or(nothing)).collect()
}
