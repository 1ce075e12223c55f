//! Classes of default attributes in MJCF: an attribute of an element is its own, or that of its class, or that of the class
//! around it. Source: MuJoCo's XML reference, "default".

use roxmltree::Node;

use super::xml::{children, located_message};

/// The classes of a file.
#[derive(Default)]
pub(crate) struct MjcfDefaults<'a, 'i> {
    classes: Vec<MjcfDefaultClass<'a, 'i>>,
}

struct MjcfDefaultClass<'a, 'i> {
    name: String,
    parent: Option<usize>,
    node: Node<'a, 'i>,
}

impl<'a, 'i> MjcfDefaults<'a, 'i> {
    /// Collects the classes of a `<mujoco>` element.
    pub(crate) fn read(root: &Node<'a, 'i>) -> Result<Self, String> {
        let mut out = Self::default();
        for node in children(root, "default") {
            out.add_class(node, None)?;
        }
        Ok(out)
    }

    fn add_class(&mut self, node: Node<'a, 'i>, parent: Option<usize>) -> Result<(), String> {
        let name = match (node.attribute("class"), parent) {
            (Some(name), _) => name,
            (None, None) => "main",
            (None, Some(_)) => {
                return Err(located_message(
                    &node,
                    "a default class needs the attribute `class`",
                ));
            }
        };
        self.classes.push(MjcfDefaultClass {
            name: name.to_owned(),
            parent,
            node,
        });
        let own = self.classes.len() - 1;
        for inner in children(&node, "default") {
            self.add_class(inner, Some(own))?;
        }
        Ok(())
    }

    /// The attribute `key` of an element that stands in bodies with the class `around`.
    ///
    /// Fails where a class is named that does not exist.
    pub(crate) fn attribute(
        &self,
        node: &Node<'a, 'i>,
        around: Option<&str>,
        key: &str,
    ) -> Result<Option<&'a str>, String> {
        if let Some(value) = node.attribute(key) {
            return Ok(Some(value));
        }
        let named = node.attribute("class").or(around);
        let mut class = match named {
            None => self.classes.iter().position(|class| class.parent.is_none()),
            Some(name) => Some(
                self.classes
                    .iter()
                    .position(|class| class.name == name)
                    .ok_or_else(|| {
                        located_message(node, &format!("no default class is called `{name}`"))
                    })?,
            ),
        };
        let tag = node.tag_name().name();
        while let Some(index) = class {
            let MjcfDefaultClass { parent, node, .. } = &self.classes[index];
            // Several files joined by <include> may each have a main class.
            let found = children(node, default_tag(tag)).find_map(|node| node.attribute(key));
            if found.is_some() {
                return Ok(found);
            }
            class = *parent;
        }
        Ok(None)
    }
}

/// Elements whose defaults are read.
fn default_tag(tag: &str) -> &'static str {
    const TAGS: [&str; 14] = [
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
        "damper",
        "cylinder",
        "muscle",
        "adhesion",
    ];
    TAGS.into_iter().find(|known| *known == tag).unwrap_or("")
}
