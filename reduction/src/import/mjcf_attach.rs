//! Replaces the `<attach>` elements of an MJCF by the contents of the attached models: its text goes in, with all includes
//! expanded, and the text of one model comes out.
//!
//! Source: MuJoCo's XML reference, "body/attach" and "asset/model", and what MuJoCo 4.0 makes of such files: names and
//! classes get the prefix, the attached model keeps its own defaults and compiler settings, and elements that refer to
//! something that is not attached are left out. The settings in `<option>` are those of the outer model.
//!
//! An attached section has the attribute [`ATTACHED`], which refers to the `<compiler>` with the same value.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use modelmill_boundary::nesting::NestingLevel;
use roxmltree::{Document, Node};

use super::mjcf_defaults::MAIN_CLASS;
use super::mjcf_include::{FileReader, expand_includes, folder_of};
use super::mjcf_meshes::name_of_file;
use super::thresholds::LARGEST_DESCRIPTION;
use super::xml::{children, located_message, required_attribute};
use super::xml_budget::check_xml_budget;

/// Attribute of elements of attached models: the number of the attached model.
pub(super) const ATTACHED: &str = "modelmill-attached";
/// Attribute of the `<compiler>` of an attached model: the folder of its file relative to that of the main file.
pub(super) const FILE_FOLDER: &str = "modelmill-folder";

/// Largest depth of attached models inside attached models.
const DEEPEST: usize = 20;

/// Sections of an attached model that the outer model does not take over.
const LEFT_BEHIND: [&str; 8] = [
    "compiler",
    "option",
    "size",
    "statistic",
    "visual",
    "keyframe",
    "worldbody",
    "include",
];
/// Sections whose elements may refer to something that is not attached.
/// Those to which others refer come first.
const WITH_REFERENCES: [&str; 5] = ["tendon", "equality", "actuator", "contact", "sensor"];
/// Attributes that refer to an element by its name.
const REFERENCES: [&str; 30] = [
    "actuator",
    "body",
    "body1",
    "body2",
    "cranksite",
    "geom",
    "geom1",
    "geom2",
    "hfield",
    "instance",
    "joint",
    "joint1",
    "joint2",
    "jointinparent",
    "material",
    "mesh",
    "name",
    "objname",
    "refname",
    "refsite",
    "sidesite",
    "site",
    "site1",
    "site2",
    "slidersite",
    "target",
    "tendon",
    "tendon1",
    "tendon2",
    "texture",
];
/// Attributes that name a default class.
const CLASSES: [&str; 2] = ["class", "childclass"];

/// The text of an MJCF with included files and attached models. What was included or attached stands on the line of the
/// element that demanded it, so that line numbers in messages are those of the file itself. `read` gives the text of a
/// file by its name, relative to the folder of the description.
///
/// Text that is not XML or not MJCF is returned unchanged; the import reports its fault.
pub fn expand_other_files(text: &str, read: FileReader) -> Result<String, String> {
    AttachedModels { read, n_attached: 0 }.expand(text, "", NestingLevel::top(DEEPEST))
}

/// Reads and counts attached models.
struct AttachedModels<'a> {
    /// Gives the text of a file by its name, relative to the folder of the main file.
    read: FileReader<'a>,
    /// Number of models attached so far.
    n_attached: usize,
}

/// What is attached of a model, and under which names.
struct AttachedModel<'a, 'i> {
    /// Put before names.
    prefix: String,
    /// Put before names of classes; the prefix, unless the outer model has a class with such a name.
    class_prefix: String,
    /// Number of the attached model.
    number: usize,
    /// Folder of its file relative to that of the main file; ends with a slash or is empty.
    folder: &'a str,
    /// Its `<mujoco>`.
    root: Node<'a, 'i>,
    /// The body or frame that is attached; none attaches all of the world.
    part: Option<Node<'a, 'i>>,
    /// Names of bodies, joints, sites and the like that are not attached.
    missing: BTreeSet<&'a str>,
}

impl AttachedModels<'_> {
    /// Expands the text of one file. `folder` is its folder relative to that of the main file, and ends with a slash or is
    /// empty.
    fn expand(&mut self, text: &str, folder: &str, level: NestingLevel) -> Result<String, String> {
        let read = self.read;
        let text = expand_includes(text, &|name| read(&format!("{folder}{name}")))?;
        // Faults of the text are reported by the import.
        if !text.contains("<attach") || check_xml_budget(&text).is_err() {
            return Ok(text);
        }
        let Ok(document) = Document::parse(&text) else {
            return Ok(text);
        };
        let root = document.root_element();
        if root.tag_name().name() != "mujoco" {
            return Ok(text);
        }
        let mut files = self.model_files(&root, folder)?;
        let mut classes: BTreeSet<String> = class_names(&root).map(str::to_owned).collect();
        // The elements at their places, and the sections of the attached models.
        let (mut elements, mut sections) = (Vec::new(), String::new());
        for node in root.descendants().filter(|node| node.has_tag_name("attach")) {
            let name = required_attribute(&node, "model")?;
            let Some(file) = files.get_mut(&name) else {
                let says = format!("there is no <model> with the name `{name}` in <asset>");
                return Err(located_message(&node, &says));
            };
            let in_file = |fault: String| located_message(&node, &format!("in `{}`: {fault}", file.path));
            let inside = level.enter().map_err(|fault| in_file(fault.to_string()))?;
            // A file is expanded once, however often it is attached.
            let whole = match &file.expanded {
                Some(whole) => whole.clone(),
                None => self
                    .expand(&file.text, folder_of(&file.path), inside)
                    .map_err(in_file)?,
            };
            check_xml_budget(&whole).map_err(in_file)?;
            let inner =
                Document::parse(&whole).map_err(|fault| in_file(format!("it is not readable XML ({fault})")))?;
            let attached = self.attached_model(&node, &inner, &file.path, &classes)?;
            classes.extend(class_names(&attached.root).map(|class| format!("{}{class}", attached.class_prefix)));
            elements.push((node.range(), attached.element()));
            sections.push_str(&attached.sections());
            file.expanded = Some(whole);
            let size = text.len() + sections.len() + elements.iter().map(|(_, text)| text.len()).sum::<usize>();
            if size > LARGEST_DESCRIPTION {
                return Err(located_message(&node, "with this model the description is too large"));
            }
        }
        // Sections are added at the end of the root, on its last line.
        let mut out = String::new();
        let mut from = 0;
        for (range, element) in elements {
            out.push_str(&text[from..range.start]);
            out.push_str(&element);
            from = range.end;
        }
        let end = text[..root.range().end].rfind("</").unwrap_or(from).max(from);
        out.push_str(&text[from..end]);
        out.push_str(&sections);
        out.push_str(&text[end..]);
        Ok(out)
    }

    /// The files of `<model>` in `<asset>` by their names: that of the entry, or that in the file.
    fn model_files(&self, root: &Node, folder: &str) -> Result<BTreeMap<String, ModelFile>, String> {
        let mut out = BTreeMap::new();
        let entries = children(root, "asset").flat_map(|asset| children(&asset, "model").collect::<Vec<_>>());
        for entry in entries {
            let path = format!("{folder}{}", required_attribute(&entry, "file")?);
            let text = (self.read)(&path).map_err(|fault| located_message(&entry, &fault))?;
            let name = match entry.attribute("name") {
                Some(name) => name.to_owned(),
                None => {
                    let parsed = check_xml_budget(&text).ok().and_then(|()| Document::parse(&text).ok());
                    let name =
                        parsed.and_then(|document| document.root_element().attribute("model").map(str::to_owned));
                    name.ok_or_else(|| {
                        located_message(&entry, "neither this element nor the model in its file has a name")
                    })?
                }
            };
            let expanded = None;
            out.entry(name).or_insert(ModelFile { path, text, expanded });
        }
        Ok(out)
    }

    /// What an `<attach>` demands of a model that is read.
    fn attached_model<'a, 'i>(
        &mut self,
        node: &Node,
        inner: &'a Document<'i>,
        path: &'a str,
        classes: &BTreeSet<String>,
    ) -> Result<AttachedModel<'a, 'i>, String> {
        let Some(prefix) = node.attribute("prefix") else {
            return Err(located_message(node, "it needs the attribute `prefix`"));
        };
        let root = inner.root_element();
        if root.tag_name().name() != "mujoco" {
            return Err(located_message(
                node,
                &format!("`{path}` is no MJCF: only such models can be attached"),
            ));
        }
        // A body or a frame can be attached alone.
        let mut part = None;
        for tag in ["body", "frame"] {
            if let Some(name) = node.attribute(tag) {
                let is_it = |other: &Node| other.has_tag_name(tag) && other.attribute("name") == Some(name);
                let found = root.descendants().find(is_it);
                let fault = || located_message(node, &format!("`{path}` has no {tag} `{name}`"));
                part = Some(found.ok_or_else(fault)?);
            }
        }
        self.n_attached += 1;
        let number = self.n_attached;
        let is_taken = |class: &str| classes.contains(&format!("{prefix}{class}"));
        let class_prefix = if class_names(&root).chain([MAIN_CLASS]).any(is_taken) {
            format!("attached{number}/{prefix}")
        } else {
            prefix.to_owned()
        };
        let mut out = AttachedModel {
            prefix: prefix.to_owned(),
            class_prefix,
            number,
            folder: folder_of(path),
            root,
            part,
            missing: BTreeSet::new(),
        };
        out.find_missing();
        Ok(out)
    }
}

/// A file in `<asset>`.
struct ModelFile {
    /// Its name relative to the folder of the main file.
    path: String,
    text: String,
    /// Its text with all that it includes and attaches.
    expanded: Option<String>,
}

/// The names of all default classes.
fn class_names<'a>(root: &Node<'a, '_>) -> impl Iterator<Item = &'a str> {
    let defaults = root.descendants().filter(|node| node.has_tag_name("default"));
    defaults.filter_map(|node| node.attribute("class"))
}

impl<'a> AttachedModel<'a, '_> {
    /// Collects the names that are not attached, in the tree of bodies and in the sections that refer to it.
    fn find_missing(&mut self) {
        let Some(part) = self.part else {
            return;
        };
        let names = |node: Node<'a, '_>| -> BTreeSet<&'a str> {
            let all = node.descendants().filter(|inner| !inner.has_tag_name("key"));
            all.filter_map(|inner| inner.attribute("name")).collect()
        };
        let world = children(&self.root, "worldbody").flat_map(|world| names(world));
        let kept = names(part);
        self.missing = world.filter(|name| !kept.contains(name)).collect();
        // A tendon that is left out takes its actuators with it.
        for section in WITH_REFERENCES.iter().flat_map(|tag| children(&self.root, tag)) {
            for node in section.children().filter(Node::is_element) {
                if self.is_left_out(&node) {
                    self.missing.extend(node.attribute("name"));
                }
            }
        }
    }

    /// Whether an element, or one inside it, refers to something that is not attached.
    fn is_left_out(&self, node: &Node) -> bool {
        let refers = |inner: Node| {
            let references = inner
                .attributes()
                .filter(|a| a.name() != "name" && REFERENCES.contains(&a.name()));
            let mut values = references.map(|a| a.value());
            values.any(|name| self.missing.contains(name))
        };
        !self.missing.is_empty() && node.descendants().filter(Node::is_element).any(refers)
    }

    /// The bodies, in a frame in place of the `<attach>`.
    fn element(&self) -> String {
        let mut out = String::new();
        // The part of a model inside the attached one has the settings of that one.
        let number = match self.part.as_ref().and_then(attached_number) {
            Some(inner) => self.nested_number(inner),
            None => self.number.to_string(),
        };
        let around = self.part.and_then(|part| part.parent());
        let class = around
            .and_then(|node| node.ancestors().find_map(|node| node.attribute("childclass")))
            .unwrap_or(MAIN_CLASS);
        write_opening(&mut out, "frame", &number);
        write_attribute(&mut out, "childclass", &self.class(class));
        out.push('>');
        match self.part {
            Some(part) => self.write(&mut out, &part, None),
            None => {
                let worlds = children(&self.root, "worldbody");
                for node in worlds.flat_map(|world| world.children()).filter(Node::is_element) {
                    self.write(&mut out, &node, None);
                }
            }
        }
        out.push_str("</frame>");
        out
    }

    /// The number of a model that is attached inside this one: each copy of this one has numbers of its own.
    fn nested_number(&self, inner: &str) -> String {
        format!("{}.{inner}", self.number)
    }

    /// All other sections, with the settings of the compiler.
    fn sections(&self) -> String {
        let mut out = String::new();
        let number = self.number.to_string();
        // One main class and one compiler, also without a section of the file.
        self.write_main_class(&mut out, &[]);
        write_opening(&mut out, "compiler", &number);
        write_attribute(&mut out, FILE_FOLDER, self.folder);
        out.push_str("/>");
        for section in self.root.children().filter(Node::is_element) {
            let tag = section.tag_name().name();
            let is_own = section.attribute(ATTACHED).is_none();
            match tag {
                "default" if is_own => {
                    self.write_main_class(
                        &mut out,
                        &section.children().filter(Node::is_element).collect::<Vec<_>>(),
                    );
                    // Old files may name the main class.
                    if let Some(name) = section.attribute("class").filter(|name| *name != MAIN_CLASS) {
                        write_opening(&mut out, "default", &number);
                        write_attribute(&mut out, "class", &self.class(MAIN_CLASS));
                        out.push_str("><default");
                        write_attribute(&mut out, "class", &self.class(name));
                        out.push_str("/></default>");
                    }
                }
                "keyframe" => {
                    write_opening(&mut out, "keyframe", &number);
                    out.push_str("/>");
                }
                "compiler" => self.write(&mut out, &section, is_own.then_some(&number)),
                _ if !LEFT_BEHIND.contains(&tag) => self.write(&mut out, &section, is_own.then_some(&number)),
                _ => {}
            }
        }
        out
    }

    /// Writes a section of the main class with some elements inside.
    fn write_main_class(&self, out: &mut String, inside: &[Node]) {
        write_opening(out, "default", &self.number.to_string());
        write_attribute(out, "class", &self.class(MAIN_CLASS));
        out.push('>');
        for node in inside {
            self.write(out, node, None);
        }
        out.push_str("</default>");
    }

    /// The name of a class of this model in the outer model.
    fn class(&self, name: &str) -> String {
        format!("{}{name}", self.class_prefix)
    }

    /// Writes an element with all inside it, without line breaks. `section` is the number of the attached model for
    /// sections at the top.
    fn write(&self, out: &mut String, node: &Node, section: Option<&str>) {
        let tag = node.tag_name().name();
        let parent = node.parent().map_or("", |parent| parent.tag_name().name());
        if WITH_REFERENCES.contains(&parent) && self.is_left_out(node) {
            return;
        }
        let _ = write!(out, "<{tag}");
        let attributes = node.attributes().filter(|a| a.namespace().is_none());
        for attribute in attributes {
            let (key, value) = (attribute.name(), attribute.value());
            let renamed = match key {
                ATTACHED => self.nested_number(value),
                FILE_FOLDER => format!("{}{value}", self.folder),
                _ if CLASSES.contains(&key) => self.class(value),
                // The world has no other name.
                _ if REFERENCES.contains(&key) && value != "world" && !value.is_empty() => {
                    format!("{}{value}", self.prefix)
                }
                _ => value.to_owned(),
            };
            write_attribute(out, key, &renamed);
        }
        self.write_added_attributes(out, node, section.filter(|_| node.attribute(ATTACHED).is_none()));
        let mut inside = node.children().filter(Node::is_element).peekable();
        if inside.peek().is_none() {
            out.push_str("/>");
            return;
        }
        out.push('>');
        for child in inside {
            self.write(out, &child, None);
        }
        let _ = write!(out, "</{tag}>");
    }

    /// Attributes that an element gets because it is attached: for sections their number and folder, the main class of
    /// elements without a class, and names that would else be those of files.
    fn write_added_attributes(&self, out: &mut String, node: &Node, section: Option<&str>) {
        let tag = node.tag_name().name();
        if let Some(number) = section {
            write_attribute(out, ATTACHED, number);
            if tag == "compiler" {
                write_attribute(out, FILE_FOLDER, self.folder);
            }
        }
        let Some(parent) = node.parent() else {
            return;
        };
        let is_of_section = ["equality", "tendon", "actuator", "asset"].contains(&parent.tag_name().name());
        if is_of_section && node.attribute("class").is_none() {
            write_attribute(out, "class", &self.class(MAIN_CLASS));
        }
        if tag == "mesh" && node.attribute("name").is_none() {
            if let Some(file) = node.attribute("file") {
                let name = name_of_file(file);
                write_attribute(out, "name", &format!("{}{name}", self.prefix));
            }
        }
    }
}

/// The number of the attached model to which an element belongs; none is the main model.
pub(super) fn attached_number<'a>(node: &Node<'a, '_>) -> Option<&'a str> {
    node.ancestors().find_map(|node| node.attribute(ATTACHED))
}

/// Writes the tag and the number of an attached element, without the end of the tag.
fn write_opening(out: &mut String, tag: &str, number: &str) {
    let _ = write!(out, "<{tag}");
    write_attribute(out, ATTACHED, number);
}

/// Writes an attribute.
fn write_attribute(out: &mut String, key: &str, value: &str) {
    let _ = write!(out, " {key}=\"");
    write_escaped(out, value);
    out.push('"');
}

/// Writes the value of an attribute; line breaks become blanks, as a parser of XML reads them.
fn write_escaped(out: &mut String, value: &str) {
    for letter in value.chars() {
        match letter {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '"' => out.push_str("&quot;"),
            '\n' | '\r' | '\t' => out.push(' '),
            other => out.push(other),
        }
    }
}
