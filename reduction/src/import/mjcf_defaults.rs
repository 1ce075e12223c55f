//! Default classes of MJCF. An attribute of an element is its own, or that of its default class, or that of an
//! enclosing class. Source: MuJoCo's XML reference, "default".
//!
//! A class copies the enclosing one where it stands: a later section at the top adds to the main class, and not to the
//! classes of earlier sections. All kinds of actuators share one set of defaults, and so do both kinds of tendons and all
//! kinds of equalities.

use std::collections::BTreeMap;

use roxmltree::Node;

use super::mjcf_attach::ATTACHED;
use super::xml::{children, located_message};

/// Name of the outermost class.
pub(super) const MAIN_CLASS: &str = "main";

/// The default classes of a file. Names and attributes are looked up in tables, because every attribute of every element
/// may come from a class.
#[derive(Default)]
pub(crate) struct MjcfDefaults<'a> {
    /// Classes; enclosing ones stand before those inside.
    classes: Vec<MjcfDefaultClass<'a>>,
    /// The first class of each name; the last state of the main class.
    by_name: BTreeMap<&'a str, usize>,
}

/// One default class.
struct MjcfDefaultClass<'a> {
    /// Index of the enclosing class; for a later state of the main class, the state before.
    parent: Option<usize>,
    /// Values by group of elements and attribute; the last element with the attribute counts.
    values: BTreeMap<(&'a str, &'a str), &'a str>,
}

impl<'a> MjcfDefaults<'a> {
    /// Collects the classes of a `<mujoco>` element.
    pub(crate) fn read(root: &Node<'a, '_>) -> Result<Self, String> {
        let mut out = Self::default();
        for node in children(root, "default") {
            out.add_class(node, None)?;
        }
        Ok(out)
    }

    /// Adds a class and those inside it; fails for an inner class without a name. Sections at the top are states of the main
    /// class.
    fn add_class(&mut self, node: Node<'a, '_>, enclosing: Option<usize>) -> Result<(), String> {
        // Only the outermost class may be without a name.
        let name = match (node.attribute("class"), enclosing) {
            (Some(name), _) => name,
            (None, None) => MAIN_CLASS,
            (None, Some(_)) => {
                return Err(located_message(&node, "a default class needs the attribute `class`"));
            }
        };
        // The main class that a section at the top continues.
        let main = if node.has_attribute(ATTACHED) { name } else { MAIN_CLASS };
        let parent = enclosing.or(self.by_name.get(main).copied());
        let mut values = BTreeMap::new();
        for element in node.children().filter(Node::is_element) {
            for attribute in element.attributes().filter(|a| a.namespace().is_none()) {
                let key = (shared_defaults(element.tag_name().name()), attribute.name());
                values.insert(key, attribute.value());
            }
        }
        let own = self.classes.len();
        self.classes.push(MjcfDefaultClass { parent, values });
        if enclosing.is_none() {
            self.by_name.insert(main, own);
        }
        self.by_name.entry(name).or_insert(own);
        for inner in children(&node, "default") {
            self.add_class(inner, Some(own))?;
        }
        Ok(())
    }

    /// The attribute `key` of an element, with the default class `around` of the body if the element names none.
    ///
    /// Fails if the element names a class that does not exist.
    pub(crate) fn attribute(
        &self,
        node: &Node<'a, '_>,
        around: Option<&str>,
        key: &str,
    ) -> Result<Option<&'a str>, String> {
        if let Some(value) = node.attribute(key) {
            return Ok(Some(value));
        }
        // The class that the element names, or that of the body, or the main class.
        let named = node.attribute("class").or(around);
        let mut class = match named {
            None => self.by_name.get(MAIN_CLASS).copied(),
            Some(name) => Some(
                *self
                    .by_name
                    .get(name)
                    .ok_or_else(|| located_message(node, &format!("there is no default class `{name}`")))?,
            ),
        };
        // From this class outwards, the first that has the attribute.
        let tag = default_tag(node);
        while let Some(index) = class {
            let MjcfDefaultClass { parent, values } = &self.classes[index];
            if let Some(found) = values.get(&(tag, key)) {
                return Ok(Some(*found));
            }
            class = *parent;
        }
        Ok(None)
    }
}

/// The tag under which a class has the defaults of an element; empty for elements whose defaults are not read.
fn default_tag<'a>(node: &Node<'a, '_>) -> &'a str {
    // A joint of an equality or of a tendon is no joint of a body.
    let section = node.parent().map_or("", |parent| parent.tag_name().name());
    match (section, node.tag_name().name()) {
        ("equality" | "tendon" | "actuator", _) => section_defaults(section),
        ("fixed" | "spatial", _) => "",
        (_, tag @ ("joint" | "geom" | "site")) | ("asset", tag @ "mesh") => tag,
        _ => "",
    }
}

/// The name under which the elements of a section share their defaults.
fn section_defaults(section: &str) -> &'static str {
    match section {
        "equality" => "equality",
        "tendon" => "tendon",
        _ => "general",
    }
}

/// The name under which an element of a class has its attributes: that of the section for all kinds of actuators.
fn shared_defaults(tag: &str) -> &str {
    const ACTUATORS: [&str; 11] = [
        "motor",
        "position",
        "velocity",
        "intvelocity",
        "orientation",
        "pid",
        "dcmotor",
        "damper",
        "cylinder",
        "muscle",
        "adhesion",
    ];
    if ACTUATORS.contains(&tag) {
        section_defaults("actuator")
    } else {
        tag
    }
}
