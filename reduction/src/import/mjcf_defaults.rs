//! Default classes of MJCF. An attribute of an element is its own, or that of its default class, or that of an
//! enclosing class. Source: MuJoCo's XML reference, "default".

use roxmltree::Node;

use super::xml::{children, located_message};

/// The default classes of a file.
#[derive(Default)]
pub(crate) struct MjcfDefaults<'a, 'i> {
    /// Classes; enclosing ones stand before those inside.
    classes: Vec<MjcfDefaultClass<'a, 'i>>,
}

/// One default class.
struct MjcfDefaultClass<'a, 'i> {
    /// Name; `main` for the outermost class.
    name: String,
    /// Index of the enclosing class.
    parent: Option<usize>,
    /// The `<default>` element with the attributes.
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

    /// Adds a class and those inside it; fails for an inner class without a name.
    fn add_class(&mut self, node: Node<'a, 'i>, parent: Option<usize>) -> Result<(), String> {
        // Only the outermost class may be without a name.
        let name = match (node.attribute("class"), parent) {
            (Some(name), _) => name,
            (None, None) => "main",
            (None, Some(_)) => {
                return Err(located_message(&node, "a default class needs the attribute `class`"));
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

    /// The attribute `key` of an element, with the default class `around` of the body if the element names none.
    ///
    /// Fails if the element names a class that does not exist.
    pub(crate) fn attribute(
        &self,
        node: &Node<'a, 'i>,
        around: Option<&str>,
        key: &str,
    ) -> Result<Option<&'a str>, String> {
        if let Some(value) = node.attribute(key) {
            return Ok(Some(value));
        }
        // The class that the element names, or that of the body, or the main class.
        let named = node.attribute("class").or(around);
        let mut class = match named {
            None => self.classes.iter().position(|class| class.parent.is_none()),
            Some(name) => Some(
                self.classes
                    .iter()
                    .position(|class| class.name == name)
                    .ok_or_else(|| located_message(node, &format!("there is no default class `{name}`")))?,
            ),
        };
        // From this class outwards, the first that has the attribute.
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
