//! Names of bodies, joints and the like in an MJCF: each is given once, and elements without a name get one that is not
//! given.
//!
//! Source: MuJoCo 4.0, which refuses two elements of one kind with equal names.

use std::collections::BTreeSet;

use roxmltree::Node;

use super::mjcf_attach::{WITH_REFERENCES, named_kind};
use super::xml::{children, located_message};

/// Kinds of elements in the tree of bodies whose names are read.
const KINDS: [&str; 3] = ["body", "joint", "site"];

/// Names by their kinds.
pub(super) struct GivenNames {
    names: BTreeSet<(&'static str, String)>,
}

impl GivenNames {
    /// Collects the names of a `<mujoco>` element. Fails at the second of two equal names of one kind.
    pub(super) fn read(root: &Node) -> Result<Self, String> {
        let mut out = Self { names: BTreeSet::new() };
        for node in children(root, "worldbody").flat_map(|world| world.descendants()) {
            let tag = named_kind(node.tag_name().name());
            if let Some(kind) = KINDS.into_iter().find(|kind| *kind == tag) {
                out.add(&node, kind)?;
            }
        }
        for kind in WITH_REFERENCES {
            for section in children(root, kind) {
                for node in section.children().filter(Node::is_element) {
                    out.add(&node, kind)?;
                }
            }
        }
        Ok(out)
    }

    /// Adds the name of an element.
    fn add(&mut self, node: &Node, kind: &'static str) -> Result<(), String> {
        let Some(name) = given_name(node) else {
            return Ok(());
        };
        if self.names.insert((kind, name.to_owned())) {
            return Ok(());
        }
        let plural = match kind {
            "body" => "bodies",
            "joint" => "joints",
            "site" => "sites",
            "tendon" => "tendons",
            "equality" => "equalities",
            _ => "actuators",
        };
        let says = format!("two {plural} have the name `{name}`; rename one");
        Err(located_message(node, &says))
    }

    /// The name of an element; without one it is `wanted`, with a number if this name is taken.
    pub(super) fn name_of(&mut self, node: &Node, kind: &'static str, wanted: &str) -> String {
        if let Some(name) = given_name(node) {
            return name.to_owned();
        }
        let mut name = wanted.to_owned();
        let mut n = 1;
        while !self.names.insert((kind, name.clone())) {
            n += 1;
            name = format!("{wanted}_{n}");
        }
        name
    }
}

/// The name of an element; an empty one is none.
fn given_name<'a>(node: &Node<'a, '_>) -> Option<&'a str> {
    node.attribute("name").filter(|name| !name.is_empty())
}
