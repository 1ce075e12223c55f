//! Names the elements and attributes of a description that are neither read nor known to have no effect on a model.
//!
//! Each format has a table of its elements. A description often contains extensions of one program, and an extension
//! may contain a mass, a closure or a rotor: so what stands in no table gets a remark.

mod mjcf;
mod sdf;
mod urdf;

use std::collections::BTreeMap;

use roxmltree::{Document, Node};

use super::mjcf_attach::ATTACHED;
use super::mjcf_include::FILE_FOLDER;
use super::xml::line;

/// An element and what may stand in it. Words are separated by blanks. A word `name=a,b` is without effect only if the
/// value is one of those after the equals sign.
struct ElementRule {
    /// Tag, or `parent/tag` where elements of one tag differ.
    element: &'static str,
    /// Attributes that are read or have no effect.
    attributes: &'static str,
    /// Elements inside that are read. An element without a rule has only text.
    inner: &'static str,
    /// Elements inside that have no effect, with all that they contain.
    ignored: &'static str,
}

/// The extension of Drake in URDF and SDF. Both kinds of names of a body are checked by the reader of closures.
const BALL_CONSTRAINT: ElementRule = ElementRule {
    element: "ball_constraint",
    attributes: "name",
    inner: "",
    ignored: "ball_constraint_body_A ball_constraint_body_B ball_constraint_p_AP ball_constraint_p_BQ",
};

/// An element or attribute that is not read, with the first place and the number of places.
struct UnreadItem {
    /// The words of the remark after the line.
    text: String,
    line: u32,
    n_places: usize,
}

/// All of them in the order of the file, with their places by text.
#[derive(Default)]
struct UnreadItems {
    items: Vec<UnreadItem>,
    by_text: BTreeMap<String, usize>,
}

impl UnreadItems {
    /// Counts an item; the first of its text is added.
    fn add(&mut self, text: String, line: u32) {
        if let Some(k) = self.by_text.get(&text) {
            self.items[*k].n_places += 1;
            return;
        }
        self.by_text.insert(text.clone(), self.items.len());
        self.items.push(UnreadItem {
            text,
            line,
            n_places: 1,
        });
    }
}

/// One remark for each kind of element and attribute that is not read. The root element determines the format.
pub(super) fn unread_remarks(document: &Document) -> Vec<String> {
    let root = document.root_element();
    let rules: &[ElementRule] = match root.tag_name().name() {
        "robot" => &urdf::RULES,
        "mujoco" => &mjcf::RULES,
        _ => &sdf::RULES,
    };
    let mut found = UnreadItems::default();
    collect_unread(&root, rules, &mut found);
    let remarks = found.items.iter().map(|item| {
        let places = match item.n_places {
            1 => String::new(),
            n => format!(" ({n} places)"),
        };
        format!(
            "line {}, {}{places}: not read; if it changes the motion or the forces, add it to the model by hand",
            item.line, item.text
        )
    });
    remarks.collect()
}

/// Collects what is not read of an element and of those inside it.
fn collect_unread(node: &Node, rules: &[ElementRule], found: &mut UnreadItems) {
    let tag = node.tag_name().name();
    let rule = rule_of(node, rules);
    for attribute in node
        .attributes()
        .filter(|a| ![ATTACHED, FILE_FOLDER].contains(&a.name()))
    {
        if !rule.is_some_and(|rule| has_word(rule.attributes, attribute.name(), attribute.value())) {
            found.add(format!("`{}` of <{tag}>", attribute.name()), line(node));
        }
    }
    let mut inside = Vec::new();
    for child in node.children().filter(Node::is_element) {
        let (name, text) = (child.tag_name().name(), child.text().unwrap_or_default());
        let is_in = |words: fn(&ElementRule) -> &'static str| rule.is_some_and(|r| has_word(words(r), name, text));
        if is_in(|rule| rule.inner) {
            inside.push(child);
        } else if !is_in(|rule| rule.ignored) {
            found.add(format!("<{name}> in <{tag}>"), line(&child));
        }
    }
    for child in inside {
        collect_unread(&child, rules, found);
    }
}

/// The rule of an element: that for its parent's tag and its own, or that for its own tag.
fn rule_of<'a>(node: &Node, rules: &'a [ElementRule]) -> Option<&'a ElementRule> {
    let tag = node.tag_name().name();
    let in_parent = node
        .parent()
        .map(|parent| format!("{}/{tag}", parent.tag_name().name()));
    let find = |element: &str| rules.iter().find(|rule| rule.element == element);
    in_parent.and_then(|element| find(&element)).or_else(|| find(tag))
}

/// Whether a list has a name, with a value without effect if the list restricts it.
fn has_word(words: &str, name: &str, value: &str) -> bool {
    words.split_whitespace().any(|word| match word.split_once('=') {
        None => word == name,
        Some((known, values)) => known == name && values.split(',').any(|x| x == value.trim()),
    })
}
