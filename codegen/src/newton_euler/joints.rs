//! The wrench that each joint transmits: the backward recursion with every wrench returned.

use super::backward::to_parent;
use super::rows::add_wrench;
use super::{JointSide, RecursionStyle, SymbolicWrench};
use crate::expr::Graph;
use crate::expr::vector;
use crate::tree::KinematicTree;

/// A wrench that the joints above a link must transmit, about the link's origin and in its axes.
pub(crate) struct JointLoad {
    /// The link on which it acts.
    pub(crate) link: usize,
    /// Force and moment.
    pub(crate) wrench: SymbolicWrench,
    /// The link on which its counterpart acts: joints from there to the base transmit neither of them. `None` for the
    /// base.
    pub(crate) until: Option<usize>,
}

/// The wrench that each link receives through its joint, about the link's origin and in its axes.
pub(crate) fn joint_wrenches(graph: &mut Graph, tree: &KinematicTree, loads: Vec<JointLoad>) -> Vec<SymbolicWrench> {
    let n = tree.links.len();
    // Loads with a common end are carried together.
    let mut ends: Vec<Option<usize>> = loads.iter().map(|load| load.until).collect();
    ends.sort_unstable();
    ends.dedup();
    let mut totals: Vec<Vec<Option<SymbolicWrench>>> = vec![vec![None; n]; ends.len()];
    for load in loads {
        let group = ends.binary_search(&load.until).expect("collected above");
        add_wrench(graph, &mut totals[group][load.link], load.wrench);
    }
    // Sum of all wrenches through each joint.
    let mut through: Vec<Option<SymbolicWrench>> = vec![None; n];
    for i in (0..n).rev() {
        let link = &tree.links[i];
        for (until, total) in ends.iter().zip(&mut totals) {
            // At its end link a load meets its counterpart and goes no further.
            let Some(wrench) = total[i].filter(|_| Some(i) != *until) else {
                continue;
            };
            add_wrench(graph, &mut through[i], wrench);
            if let Some(parent) = link.parent {
                let wrench = to_parent(graph, RecursionStyle::PLAIN, link, JointSide::Moving, &wrench);
                add_wrench(graph, &mut total[parent], wrench);
            }
        }
    }
    let nothing = SymbolicWrench {
        force: vector::ZERO,
        moment: vector::ZERO,
    };
    through.into_iter().map(|w| w.unwrap_or(nothing)).collect()
}
