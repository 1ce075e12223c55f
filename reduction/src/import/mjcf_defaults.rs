//! Default classes of MJCF. An attribute of an element is its own, or that of its default class, or that of an
//! enclosing class. Source: MuJoCo's XML reference, "default".

use std::collections::BTreeMap;

use roxmltree::Node;

use super::xml::{children, located_message};

/// The default classes of a file. Names and attributes are looked up in tables, because every attribute of every element
/// may come from a class.
#[derive(Default)]
pub(crate) struct MjcfDefaults<'a> {
    /// Classes; enclosing ones stand before those inside.
    classes: Vec<MjcfDefaultClass<'a>>,
    /// The first class of each name.
    by_name: BTreeMap<&'a str, usize>,
}

/// One default class.
struct MjcfDefaultClass<'a> {
    /// Index of the enclosing class.
    parent: Option<usize>,
    /// Values by tag and attribute; the first element with the attribute counts.
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

    /// Adds a class and those inside it; fails for an inner class without a name.
    fn add_class(&mut self, node: Node<'a, '_>, parent: Option<usize>) -> Result<(), String> {
        // Only the outermost class may be without a name.
        let name = match (node.attribute("class"), parent) {
            (Some(name), _) => name,
            (None, None) => "main",
            (None, Some(_)) => {
                return Err(located_message(&node, "a default class needs the attribute `class`"));
            }
        };
        let mut values = BTreeMap::new();
        for element in node.children().filter(Node::is_element) {
            for attribute in element.attributes().filter(|a| a.namespace().is_none()) {
                let key = (element.tag_name().name(), attribute.name());
                values.entry(key).or_insert(attribute.value());
            }
        }
        let own = self.classes.len();
        self.classes.push(MjcfDefaultClass { parent, values });
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
        // The class that the element names, or that of the body, or the main class, which is the first one.
        let named = node.attribute("class").or(around);
        let mut class = match named {
            None => (!self.classes.is_empty()).then_some(0),
            Some(name) => Some(
                *self
                    .by_name
                    .get(name)
                    .ok_or_else(|| located_message(node, &format!("there is no default class `{name}`")))?,
            ),
        };
        // From this class outwards, the first that has the attribute.
        let tag = default_tag(node.tag_name().name());
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
fn default_tag(tag: &str) -> &'static str {
    const TAGS: [&str; 17] = [
        "joint",
        "geom",
        "site",
        "equality",
        "tendon",
        "general",
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
    TAGS.into_iter().find(|known| *known == tag).unwrap_or("")
}
