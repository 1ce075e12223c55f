//! Random trees: the closed form link by link must agree with points of motion.

use std::fmt::Write;

use modelmill_algebra::field::RandomStream;
use modelmill_spec::Mechanism;

use super::dependences::DependenceStructure;
use super::relations::{ColumnRelation, TreeStructure};
use super::sample::sample_regressor;
use crate::expr::independent::SEED;
use crate::expr::{ExprId, Graph};

/// A random number below `n`.
fn below(stream: &mut RandomStream, n: usize) -> usize {
    usize::try_from(stream.next_bits() >> 33).expect("31 bits") % n
}

/// What a random tree consists of.
#[expect(
    clippy::struct_excessive_bools,
    reason = "four properties that are drawn independently"
)]
struct RandomTree {
    n: usize,
    floating: bool,
    gravity: bool,
    /// Whether each link hangs on the one before it.
    is_chain: bool,
    /// Whether axes are tilted by constants, or parallel to those of the frame.
    tilted: bool,
}

impl RandomTree {
    fn mechanism(&self, stream: &mut RandomStream) -> Mechanism {
        let gravity = if self.gravity { "[0, 0, \"-9.81\"]" } else { "[0, 0, 0]" };
        let mut text = format!("schema = 1\nname = \"tree\"\ngravity = {gravity}\n[constants]\n");
        for i in 0..self.n {
            for (k, name) in ["x", "y", "z"].iter().enumerate() {
                writeln!(text, "{name}{i} = {{ value = 0.{}, unit = \"m\" }}", 1 + (i + k) % 9).unwrap();
            }
            for (k, name) in ["a", "b"].iter().enumerate() {
                writeln!(text, "{name}{i} = {{ value = 0.{}, unit = \"rad\" }}", 2 + (i + k) % 7).unwrap();
            }
        }
        text.push_str("[coordinates]\n");
        let free = ["fx", "fy", "fz", "fw", "fa", "fb", "fc"];
        if self.floating {
            for name in free {
                writeln!(text, "{name} = {{ nominal = {} }}", i32::from(name == "fw")).unwrap();
            }
        }
        for i in 0..self.n {
            writeln!(text, "q{i} = {{ nominal = 0.{} }}", 1 + i % 9).unwrap();
        }
        let part = |text: &mut String, name: &str| {
            writeln!(text, "[[part]]\non = \"{name}\"\nlinear = {{ all = \"_{name}\" }}").unwrap();
        };
        if self.floating {
            let names = free.map(|name| format!("\"{name}\"")).join(", ");
            writeln!(text, "[[frame]]\nname = \"root\"\non = \"base\"\njoint = {{ free = [{names}], quaternion = \"wxyz\", twist = \"mixed\" }}").unwrap();
            part(&mut text, "root");
            for name in free.into_iter().filter(|name| *name != "fw") {
                writeln!(text, "[[drive]]\nname = \"t{name}\"\njoint = \"{name}\"").unwrap();
            }
        }
        let root = if self.floating { "root" } else { "base" };
        for i in 0..self.n {
            let on = match (i, self.is_chain) {
                (0, _) => root.to_owned(),
                (_, true) => format!("l{}", i - 1),
                _ => format!("l{}", below(stream, i)),
            };
            let rpy = match (self.tilted, below(stream, 3)) {
                (true, _) => format!("[\"a{i}\", \"b{i}\", 0]"),
                (_, 0) => "[\"pi/2\", 0, 0]".to_owned(),
                (_, 1) => "[0, \"-pi/2\", \"pi/4\"]".to_owned(),
                _ => "[0, 0, 0]".to_owned(),
            };
            let kind = if below(stream, 4) == 0 { "prismatic" } else { "revolute" };
            let axis = ["x", "y", "z"][below(stream, 3)];
            let sign = if below(stream, 2) == 0 { "" } else { "-" };
            writeln!(text, "[[frame]]\nname = \"l{i}\"\non = \"{on}\"\ntransform = {{ xyz = [\"x{i}\", \"y{i}\", \"z{i}\"], rpy = {rpy} }}\njoint = {{ {kind} = \"{sign}q{i}\", axis = \"{axis}\" }}").unwrap();
            part(&mut text, &format!("l{i}"));
            writeln!(text, "[[drive]]\nname = \"t{i}\"\njoint = \"q{i}\"").unwrap();
        }
        modelmill_spec::load("tree.toml", &text, &modelmill_boundary::files::MemoryFiles::default())
            .unwrap_or_else(|failure| panic!("{failure}\n{text}"))
            .mechanism
    }
}

/// The links alone give as many base parameters as points of motion, and every relation that they give is true there.
/// All dependent columns of links far from the base follow from the link before them.
fn check(tree: &RandomTree, stream: &mut RandomStream) {
    let mechanism = tree.mechanism(stream);
    let mut graph = Graph::new();
    let equations = crate::regressor::unreduced_equations(&mut graph, &mechanism).unwrap();
    let effective: Vec<usize> = (0..equations.columns.len())
        .filter(|k| equations.columns[*k].iter().any(|x| *x != Graph::ZERO))
        .collect();
    let n_drives = equations.projection.drives.len();
    let outputs: Vec<ExprId> = (0..n_drives)
        .flat_map(|d| effective.iter().map(|k| equations.columns[*k][d]).collect::<Vec<_>>())
        .collect();
    let projection = &equations.projection;
    let regressor = sample_regressor(&mut graph, &mechanism, projection, &outputs, effective.len()).unwrap();
    let structure = TreeStructure::new(&mut graph, &equations, &effective);
    let order: Vec<usize> = (0..effective.len()).collect();
    let found = DependenceStructure::find_dependences(&regressor, &structure, &order, stream).unwrap();
    let by_links = structure.columns.as_ref().expect("a tree").n_base_parameters();
    assert_eq!(by_links, found.pivots.len());
    // Each relation was compared with the columns when it was found.
    let is_closed = |r: &&ColumnRelation| r.is_in_tree || r.factors.is_some();
    let open = found.relations.iter().filter(|r| !is_closed(r)).count();
    let closed: Vec<usize> = found.relations.iter().filter(is_closed).map(|r| r.column).collect();
    assert!(
        found.dependent.iter().all(|k| closed.contains(k)),
        "{open} relations need points of motion"
    );
    let moved = found.relations.iter().filter(|r| r.factors.is_some()).count();
    if tree.floating {
        // On a body that moves freely a revolute joint has 7 base parameters and a prismatic one 4, and all others move to
        // the link before it.
        let lengths = mechanism.coordinates.iter().filter(|c| c.motion.is_length()).count();
        let n_moved = 3 * tree.n + 3 * (lengths - 3);
        assert_eq!((found.pivots.len(), moved), (10 + 10 * tree.n - n_moved, n_moved));
    } else {
        // The first links on the base have relations of their own.
        assert!(tree.n < 5 || found.dependent.is_empty() || moved > 0);
    }
}

#[test]
fn base_parameters_of_random_trees_follow_link_by_link() {
    let mut stream = RandomStream::new(SEED);
    for case in 0..48_usize {
        let tree = RandomTree {
            n: 2 + case % 6,
            floating: case % 4 == 3,
            gravity: case % 3 != 1,
            is_chain: case % 5 < 2,
            tilted: case % 2 == 0,
        };
        check(&tree, &mut stream);
    }
}
