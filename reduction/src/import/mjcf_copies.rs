//! Replaces the `<replicate>` elements of an MJCF, and each `<attach>` of a part of the same model, by copies: the text of
//! one file goes in, the same text with copies in place of these elements comes out.
//!
//! Source: MuJoCo's XML reference, "replicate" and "body/attach", and what MuJoCo 4.0 makes of such files. Copy `k` of a
//! `<replicate>` is rotated by `k` times `euler`. It is one `offset` away from the copy before it, in the axes of that copy.
//! A part of the same model is attached as the text before the `<attach>` describes it. Tendons, equalities and actuators
//! that refer to a copied element are copied too.
//!
//! Decision: MuJoCo 4.0 drops an equality or an actuator that refers to one element inside a `<replicate>` and to one
//! outside, without a message, or refuses it, depending on the order of the bodies. Here it is refused.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::ops::Range;

use modelmill_boundary::nesting::NestingLevel;
use nalgebra::Vector3;
use roxmltree::{Document, Node};

use super::mjcf_attach::{ATTACHED, REFERENCES, WITH_REFERENCES, named_kind, write_attribute};
use super::mjcf_compiler::{CompilerSettings, MjcfCompiler};
use super::mjcf_defaults::MAIN_CLASS;
use super::thresholds::{
    DEEPEST_ELEMENT, LARGEST_DESCRIPTION, MOST_NAMED_ELEMENTS, MOST_XML_NODES, ROUNDING_OF_ROTATION,
};
use super::xml::{children, exact_numbers, located_message, required_attribute, vector};
use super::xml_budget::check_xml_budget;

/// Kinds of elements in the tree of bodies to which tendons, equalities and actuators refer, and tendons.
const COPIED_KINDS: [&str; 5] = ["body", "joint", "site", "geom", "tendon"];

/// Most comparisons in searches for names, some seconds. By judgement: published models need less than a hundredth of them.
const MOST_STEPS: usize = 5_000_000;

/// What is wrong if the copies do not fit into a description.
const TOO_LARGE: &str = "with these copies the description is too large";

/// The text with copies in place of `<replicate>` and of `<attach>` without a model. Copies stand on the line of the
/// element that demands them, so that line numbers in messages are those of the file.
///
/// Text that is not XML or not MJCF is returned unchanged; the import reports its fault.
pub(super) fn expand_copies(text: &str) -> Result<Cow<'_, str>, String> {
    if !(text.contains("<replicate") || text.contains("<attach")) || check_xml_budget(text).is_err() {
        return Ok(Cow::Borrowed(text));
    }
    let Ok(document) = Document::parse(text) else {
        return Ok(Cow::Borrowed(text));
    };
    let root = document.root_element();
    let demands = |node: &Node| node.has_tag_name("replicate") || is_own_part(node);
    let n_demands = root.descendants().filter(demands).count();
    if !root.has_tag_name("mujoco") || n_demands == 0 {
        return Ok(Cow::Borrowed(text));
    }
    if n_demands > MOST_NAMED_ELEMENTS {
        return Err(format!(
            "the description has more than {MOST_NAMED_ELEMENTS} elements that copy others; write some of them out"
        ));
    }
    let settings = CompilerSettings::read(&root)?;
    let mut tree = CopiedTree {
        settings: settings.main_settings(),
        has_defaults: children(&root, "default").next().is_some(),
        elements: vec![CopiedElement::new("worldbody")],
        n_bytes: 0,
        n_nodes: 0,
        n_steps: 0,
        operations: Vec::new(),
        replaced: Vec::new(),
    };
    for world in children(&root, "worldbody") {
        let level = NestingLevel::top(DEEPEST_ELEMENT);
        tree.add_inside(&world, WORLD, (level, ReplicationState::Outside))?;
    }
    tree.copy_references(&root)?;
    Ok(Cow::Owned(tree.into_text(text)))
}

/// Whether an element attaches a part of the same model.
fn is_own_part(node: &Node) -> bool {
    node.has_tag_name("attach") && node.attribute("model").is_none()
}

/// Index of the world among the elements.
const WORLD: usize = 0;

/// An element with its copies in it.
struct CopiedElement {
    tag: String,
    attributes: Vec<(String, String)>,
    /// Indices of the elements inside.
    inside: Vec<usize>,
}

/// How the name of a copy follows from that of the element.
#[derive(Clone)]
enum CopyName {
    Prefix(String),
    Suffix(String),
}

/// Which elements are copied, and under which names.
struct CopyOperation<'a, 'i> {
    /// The element that demands the copies.
    demanded_by: Node<'a, 'i>,
    /// Kinds and names of the copied elements.
    names: BTreeSet<(String, String)>,
    /// The names of the copies.
    copies: Vec<CopyName>,
}

/// A tendon, equality or actuator of the text with its copies.
struct CopiedEntry<'a, 'i> {
    node: Node<'a, 'i>,
    copies: Vec<usize>,
    is_changed: bool,
}

/// Whether an element is inside a `<replicate>`.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ReplicationState {
    Inside,
    Outside,
}

/// The tree of bodies with all copies, and what they replace in the text.
struct CopiedTree<'s, 'a, 'i> {
    /// The unit of angles and the sequence of Euler angles.
    settings: &'s MjcfCompiler,
    /// Whether the file has default classes.
    has_defaults: bool,
    elements: Vec<CopiedElement>,
    /// Bytes of all elements.
    n_bytes: usize,
    /// Number of all elements and attributes.
    n_nodes: usize,
    /// Number of steps of searches for names.
    n_steps: usize,
    /// In the order in which names change.
    operations: Vec<CopyOperation<'a, 'i>>,
    /// Ranges of the text with the elements in their place.
    replaced: Vec<(Range<usize>, Vec<usize>)>,
}

/// A part of the tree with what is valid around it.
struct FoundPart {
    element: usize,
    class: Option<String>,
    attached: Option<String>,
}

impl CopiedElement {
    fn new(tag: &str) -> Self {
        Self {
            tag: tag.to_owned(),
            attributes: Vec::new(),
            inside: Vec::new(),
        }
    }

    fn attribute(&self, key: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|(own, _)| own == key);
        found.map(|(_, value)| value.as_str())
    }
}

impl CopyName {
    fn apply(&self, name: &str) -> String {
        match self {
            Self::Prefix(prefix) => format!("{prefix}{name}"),
            Self::Suffix(suffix) => format!("{name}{suffix}"),
        }
    }
}

impl<'a, 'i> CopiedTree<'_, 'a, 'i> {
    /// Adds an element; `node` is that of the text to which it belongs.
    fn add(&mut self, node: &Node, element: CopiedElement) -> Result<usize, String> {
        let of_attributes = element
            .attributes
            .iter()
            .map(|(key, value)| key.len() + value.len() + 4);
        self.n_bytes += element.tag.len() + 5 + of_attributes.sum::<usize>();
        self.n_nodes += 1 + element.attributes.len();
        if self.n_bytes > LARGEST_DESCRIPTION || self.n_nodes > MOST_XML_NODES {
            return Err(located_message(node, TOO_LARGE));
        }
        self.elements.push(element);
        Ok(self.elements.len() - 1)
    }

    /// Counts steps of a search.
    fn spend_steps(&mut self, node: &Node, n: usize) -> Result<(), String> {
        self.n_steps += n;
        if self.n_steps > MOST_STEPS {
            return Err(located_message(
                node,
                "the description has too many copies and references to them",
            ));
        }
        Ok(())
    }

    /// Adds an element of the text without those inside it.
    fn add_node(&mut self, node: &Node) -> Result<usize, String> {
        let attributes = node.attributes().filter(|a| a.namespace().is_none());
        let mut element = CopiedElement::new(node.tag_name().name());
        element.attributes = attributes
            .map(|a| (a.name().to_owned(), a.value().to_owned()))
            .collect();
        self.add(node, element)
    }

    /// Adds the elements inside `node` to the element `own`, with all copies.
    fn add_inside(
        &mut self,
        node: &Node<'a, 'i>,
        own: usize,
        (level, state): (NestingLevel, ReplicationState),
    ) -> Result<(), String> {
        let inner = level
            .enter()
            .map_err(|fault| located_message(node, &fault.to_string()))?;
        for child in node.children().filter(Node::is_element) {
            let copies = if child.has_tag_name("replicate") {
                self.replicate(&child, inner)?
            } else if is_own_part(&child) {
                vec![self.attach_own_part(&child, inner)?]
            } else {
                let index = self.add_node(&child)?;
                self.elements[own].inside.push(index);
                self.add_inside(&child, index, (inner, state))?;
                continue;
            };
            if state == ReplicationState::Outside {
                self.replaced.push((child.range(), copies.clone()));
            }
            self.elements[own].inside.extend(copies);
        }
        Ok(())
    }

    /// The copies that a `<replicate>` demands, each in a frame.
    fn replicate(&mut self, node: &Node<'a, 'i>, level: NestingLevel) -> Result<Vec<usize>, String> {
        let demanded = required_attribute(node, "count")?;
        let count: usize = demanded
            .trim()
            .parse()
            .map_err(|_| located_message(node, "expected a number of copies in `count`"))?;
        if let Some(part) = find_part_of_body(node) {
            let says = format!(
                "<{}> cannot be copied alone: it belongs to the body around <replicate>",
                part.tag_name().name()
            );
            return Err(located_message(&part, &says));
        }
        let three = |key: &str| node.attribute(key).map(|text| exact_numbers::<3>(node, key, text));
        let euler = three("euler").transpose()?.unwrap_or_default();
        let offset = vector(three("offset").transpose()?.unwrap_or_default());
        let original = self.add(node, CopiedElement::new("frame"))?;
        self.add_inside(node, original, (level, ReplicationState::Inside))?;
        let size = self.elements.len() - original;
        self.spend_steps(node, size)?;
        if count.saturating_mul(size) > MOST_XML_NODES {
            return Err(located_message(node, TOO_LARGE));
        }
        let names = self.collect_names(original);
        let width = count.to_string().len();
        let (mut copies, mut frames, mut place) = (Vec::new(), Vec::new(), Vector3::zeros());
        for k in 0..count {
            #[expect(
                clippy::cast_precision_loss,
                reason = "far fewer than 2^52 copies fit into a description"
            )]
            let turned = euler.map(|angle| angle * k as f64);
            let mut frame = CopiedElement::new("frame");
            let childclass = node.attribute("childclass");
            frame
                .attributes
                .extend(childclass.map(|class| ("childclass".to_owned(), class.to_owned())));
            for (key, values) in [("pos", place.into()), ("euler", turned)] {
                if values.iter().any(|x| *x != 0.0) {
                    let [x, y, z] = values;
                    frame.attributes.push((key.to_owned(), format!("{x:?} {y:?} {z:?}")));
                }
            }
            let index = self.add(node, frame)?;
            let name = CopyName::Suffix(format!("{}{k:0width$}", node.attribute("sep").unwrap_or_default()));
            self.copy_inside(node, original, index, &name)?;
            frames.push(index);
            copies.push(name);
            let step: Vector3<f64> = self.settings.euler_rotation(turned) * offset;
            place += step.map(|x| {
                if x.abs() <= ROUNDING_OF_ROTATION * offset.norm() {
                    0.0
                } else {
                    x
                }
            });
        }
        self.operations.push(CopyOperation {
            demanded_by: *node,
            names,
            copies,
        });
        Ok(frames)
    }

    /// The copy of a body or frame of this model, in a frame.
    fn attach_own_part(&mut self, node: &Node<'a, 'i>, level: NestingLevel) -> Result<usize, String> {
        let prefix = required_attribute(node, "prefix")?;
        let (tag, name) = match (node.attribute("body"), node.attribute("frame")) {
            (Some(name), None) => ("body", name),
            (None, Some(name)) => ("frame", name),
            _ => {
                let says = "it needs `body` or `frame`, or the attribute `model` for a part of another model";
                return Err(located_message(node, says));
            }
        };
        self.spend_steps(node, self.elements.len())?;
        let found = if (tag, name) == ("body", "world") {
            Some(FoundPart {
                element: WORLD,
                class: None,
                attached: None,
            })
        } else {
            self.find_part(WORLD, (tag, name), (None, None))
        };
        let Some(part) = found else {
            let mut says =
                format!("there is no {tag} `{name}` before this element, and MuJoCo attaches what stands before it");
            if node.ancestors().any(|outer| outer.has_tag_name("replicate")) {
                says += "; what stands inside the same <replicate> cannot be attached here: write its copies out";
            }
            return Err(located_message(node, &says));
        };
        let mut inner = level.enter();
        for _ in 0..self.count_levels(part.element) {
            inner = inner.and_then(NestingLevel::enter);
        }
        inner.map_err(|fault| located_message(node, &fault.to_string()))?;
        let name = CopyName::Prefix(prefix);
        let mut frame = CopiedElement::new("frame");
        // The defaults around the part count, and not those around its copy.
        if self.has_defaults {
            let class = part.class.unwrap_or_else(|| MAIN_CLASS.to_owned());
            frame.attributes.push(("childclass".to_owned(), class));
        }
        frame
            .attributes
            .extend(part.attached.map(|number| (ATTACHED.to_owned(), number)));
        let names = self.collect_names(part.element);
        let copy = self.copy(node, part.element, &name)?;
        frame.inside.push(copy);
        let frame = self.add(node, frame)?;
        self.operations.push(CopyOperation {
            demanded_by: *node,
            names,
            copies: vec![name],
        });
        Ok(frame)
    }

    /// Finds a body or frame by its name inside an element.
    fn find_part(
        &self,
        around: usize,
        wanted: (&str, &str),
        (class, attached): (Option<&str>, Option<&str>),
    ) -> Option<FoundPart> {
        let element = &self.elements[around];
        if (element.tag.as_str(), element.attribute("name")) == (wanted.0, Some(wanted.1)) {
            return Some(FoundPart {
                element: around,
                class: class.map(str::to_owned),
                attached: attached.map(str::to_owned),
            });
        }
        let here = (
            element.attribute("childclass").or(class),
            element.attribute(ATTACHED).or(attached),
        );
        let mut inside = element.inside.iter();
        inside.find_map(|inner| self.find_part(*inner, wanted, here))
    }

    /// Number of levels inside an element.
    fn count_levels(&self, element: usize) -> usize {
        let inside = self.elements[element].inside.iter();
        inside.map(|inner| 1 + self.count_levels(*inner)).max().unwrap_or(0)
    }

    /// Kinds and names of an element and of those inside it.
    fn collect_names(&self, element: usize) -> BTreeSet<(String, String)> {
        let mut out = BTreeSet::new();
        let mut waiting = vec![element];
        while let Some(index) = waiting.pop() {
            let element = &self.elements[index];
            if let Some(name) = element.attribute("name") {
                out.insert((named_kind(&element.tag).to_owned(), name.to_owned()));
            }
            waiting.extend(&element.inside);
        }
        out
    }

    /// Copies an element with those inside it; the world becomes a body.
    fn copy(&mut self, node: &Node, from: usize, name: &CopyName) -> Result<usize, String> {
        let mut copied = CopiedElement::new(&self.elements[from].tag);
        copied.attributes.clone_from(&self.elements[from].attributes);
        if from == WORLD {
            "body".clone_into(&mut copied.tag);
            copied.attributes.push(("name".to_owned(), "world".to_owned()));
        }
        for (_, value) in copied
            .attributes
            .iter_mut()
            .filter(|(key, value)| key == "name" && !value.is_empty())
        {
            *value = name.apply(value);
        }
        let index = self.add(node, copied)?;
        self.copy_inside(node, from, index, name)?;
        Ok(index)
    }

    /// Copies the elements inside `from` into `to`.
    fn copy_inside(&mut self, node: &Node, from: usize, to: usize, name: &CopyName) -> Result<(), String> {
        for inner in self.elements[from].inside.clone() {
            let copied = self.copy(node, inner, name)?;
            self.elements[to].inside.push(copied);
        }
        Ok(())
    }

    /// Copies the tendons, equalities and actuators that refer to copied elements.
    fn copy_references(&mut self, root: &Node<'a, 'i>) -> Result<(), String> {
        let mut entries = Vec::new();
        // Tendons come first, since others refer to them.
        for section in WITH_REFERENCES.iter().flat_map(|tag| children(root, tag)) {
            for node in section.children().filter(Node::is_element) {
                let element = self.add_node(&node)?;
                for inner in node.children().filter(Node::is_element) {
                    let index = self.add_node(&inner)?;
                    self.elements[element].inside.push(index);
                }
                entries.push(CopiedEntry {
                    node,
                    copies: vec![element],
                    is_changed: false,
                });
            }
        }
        for mut operation in std::mem::take(&mut self.operations) {
            for entry in &mut entries {
                let mut after = Vec::with_capacity(entry.copies.len());
                for element in std::mem::take(&mut entry.copies) {
                    match self.copy_reference(&entry.node, element, &mut operation)? {
                        None => after.push(element),
                        Some(copies) => {
                            after.extend(copies);
                            entry.is_changed = true;
                        }
                    }
                }
                entry.copies = after;
            }
        }
        let changed = entries.into_iter().filter(|entry| entry.is_changed);
        self.replaced
            .extend(changed.map(|entry| (entry.node.range(), entry.copies)));
        Ok(())
    }

    /// The copies of a tendon, equality or actuator after an operation; none if it has no reference to what is
    /// copied.
    fn copy_reference(
        &mut self,
        node: &Node,
        element: usize,
        operation: &mut CopyOperation,
    ) -> Result<Option<Vec<usize>>, String> {
        let inside = &self.elements[element].inside;
        let compared = inside.iter().map(|index| 1 + self.elements[*index].attributes.len());
        let compared = 1 + self.elements[element].attributes.len() + compared.sum::<usize>();
        self.spend_steps(node, compared)?;
        let is_tendon = node.parent().is_some_and(|section| section.has_tag_name("tendon"));
        let all = std::iter::once(element).chain(self.elements[element].inside.iter().copied());
        let mut references = Vec::new();
        for (key, value) in all.flat_map(|index| &self.elements[index].attributes) {
            if let Some(kind) = copied_kind(key).filter(|_| value != "world") {
                references.push((kind.to_owned(), value.clone()));
            }
        }
        let Some((_, inner)) = references.iter().find(|one| operation.names.contains(*one)) else {
            return Ok(None);
        };
        let is_replicate = operation.demanded_by.has_tag_name("replicate");
        let mut out = if is_replicate { vec![] } else { vec![element] };
        let outer = references.iter().find(|one| !operation.names.contains(*one));
        if let Some((_, outer)) = outer.filter(|_| !is_tendon) {
            if is_replicate {
                let says = format!(
                    "it refers to `{inner}` inside of <replicate> and to `{outer}` outside of it, and MuJoCo drops such an \
                     element without a message; write the copies of the bodies out, each with an element of its own"
                );
                return Err(located_message(node, &says));
            }
            // As in an attached model, what refers to something that is not attached is left out.
            return Ok(Some(out));
        }
        for name in &operation.copies {
            let copied = self.copy_renamed(node, element, operation, name)?;
            for inner in self.elements[element].inside.clone() {
                let index = self.copy_renamed(node, inner, operation, name)?;
                self.elements[copied].inside.push(index);
            }
            out.push(copied);
        }
        // Others that refer to this tendon are copied too.
        if let Some(name) = self.elements[element].attribute("name").filter(|_| is_tendon) {
            operation.names.insert(("tendon".to_owned(), name.to_owned()));
        }
        Ok(Some(out))
    }

    /// A copy of an element, without those inside it, with the names of copied elements.
    fn copy_renamed(
        &mut self,
        node: &Node,
        from: usize,
        operation: &CopyOperation,
        name: &CopyName,
    ) -> Result<usize, String> {
        let mut copied = CopiedElement::new(&self.elements[from].tag);
        copied.attributes.clone_from(&self.elements[from].attributes);
        for (key, value) in &mut copied.attributes {
            let refers =
                copied_kind(key).is_some_and(|kind| operation.names.contains(&(kind.to_owned(), value.clone())));
            if !value.is_empty() && (refers || key == "name") {
                *value = name.apply(value);
            }
        }
        self.add(node, copied)
    }

    /// The text with all copies, on the same number of lines.
    fn into_text(mut self, text: &str) -> String {
        self.replaced.sort_by_key(|(range, _)| range.start);
        let mut out = String::new();
        let mut from = 0;
        for (range, copies) in &self.replaced {
            out.push_str(&text[from..range.start]);
            for copy in copies {
                self.write(&mut out, *copy);
            }
            out.extend(text[range.clone()].matches('\n'));
            from = range.end;
        }
        out.push_str(&text[from..]);
        out
    }

    /// Writes an element with those inside it.
    fn write(&self, out: &mut String, index: usize) {
        let element = &self.elements[index];
        out.extend(["<", &element.tag]);
        for (key, value) in &element.attributes {
            write_attribute(out, key, value);
        }
        out.push('>');
        for inner in &element.inside {
            self.write(out, *inner);
        }
        out.extend(["</", &element.tag, ">"]);
    }
}

/// An element inside a `<replicate>` that a body has once. Frames have no body.
fn find_part_of_body<'a, 'i>(node: &Node<'a, 'i>) -> Option<Node<'a, 'i>> {
    node.children().find_map(|child| match child.tag_name().name() {
        "joint" | "freejoint" | "inertial" => Some(child),
        "frame" | "replicate" => find_part_of_body(&child),
        _ => None,
    })
}

/// The kind of element that can be copied, to which an attribute of a tendon, equality or actuator refers.
fn copied_kind(key: &str) -> Option<&'static str> {
    let (_, kind) = REFERENCES.iter().find(|(attribute, _)| *attribute == key)?;
    Some(*kind).filter(|kind| COPIED_KINDS.contains(kind))
}
