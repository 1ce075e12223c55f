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

use super::mjcf_copies::expand_copies;
use super::mjcf_defaults::MAIN_CLASS;
use super::mjcf_include::{FILE_FOLDER, FileReader, expand_includes, folder_of, joined_path};
use super::mjcf_meshes::name_of_file;
use super::mjcf_of_urdf::mjcf_of_urdf;
use super::thresholds::LARGEST_DESCRIPTION;
use super::xml::{children, located_message, write_escaped};
use super::xml_budget::check_xml_budget;
use super::xml_repair::readable_xml;

/// Attribute of elements of attached models: the number of the attached model.
pub(super) const ATTACHED: &str = "modelmill-attached";

/// Largest depth of attached models inside attached models.
const DEEPEST: usize = 20;

/// Most bytes of models that are parsed for attachment, all together: each `<attach>` parses its model again.
const MOST_PARSED: usize = 8 * LARGEST_DESCRIPTION;

/// Sections of an attached model that the outer model does not take over, or that have no effect on a model.
const LEFT_BEHIND: [&str; 10] = [
    "compiler",
    "contact",
    "include",
    "keyframe",
    "option",
    "sensor",
    "size",
    "statistic",
    "visual",
    "worldbody",
];
/// Sections whose elements may refer to something that is not attached. Those to which others refer come first.
pub(super) const WITH_REFERENCES: [&str; 3] = ["tendon", "equality", "actuator"];
/// Attributes that refer to an element by its name, with the kind of this element.
pub(super) const REFERENCES: [(&str, &str); 25] = [
    ("actuator", "actuator"),
    ("body", "body"),
    ("body1", "body"),
    ("body2", "body"),
    ("cranksite", "site"),
    ("geom", "geom"),
    ("geom1", "geom"),
    ("geom2", "geom"),
    ("hfield", "hfield"),
    ("instance", "instance"),
    ("joint", "joint"),
    ("joint1", "joint"),
    ("joint2", "joint"),
    ("jointinparent", "joint"),
    ("material", "material"),
    ("mesh", "mesh"),
    ("refsite", "site"),
    ("sidesite", "site"),
    ("site", "site"),
    ("site1", "site"),
    ("site2", "site"),
    ("slidersite", "site"),
    ("tendon", "tendon"),
    ("tendon1", "tendon"),
    ("tendon2", "tendon"),
];
/// Name of a model without a name, from MuJoCo.
const UNNAMED_MODEL: &str = "MuJoCo Model";
/// Attributes that name a default class.
const CLASSES: [&str; 2] = ["class", "childclass"];

/// The text of an MJCF with included files and attached models. What was included or attached stands on the line of the
/// element that demanded it, so that line numbers in messages are those of the file itself. `read` gives the text of a
/// file by its name, relative to the folder of the description.
///
/// Text that is not XML or not MJCF is returned unchanged; the import reports its fault.
pub fn expand_other_files(text: &str, read: FileReader) -> Result<String, String> {
    let mut models = AttachedModels {
        read,
        n_attached: 0,
        n_parsed: 0,
        expanded: BTreeMap::new(),
        unfinished: Vec::new(),
    };
    models.expand(text, "", NestingLevel::top(DEEPEST))
}

/// Reads and counts attached models.
struct AttachedModels<'a> {
    /// Gives the text of a file by its name, relative to the folder of the main file.
    read: FileReader<'a>,
    /// Number of models attached so far.
    n_attached: usize,
    /// Number of bytes parsed so far.
    n_parsed: usize,
    /// Texts of files with all that they include and attach, by their paths relative to the main file.
    expanded: BTreeMap<String, String>,
    /// Paths of the files that are being expanded.
    unfinished: Vec<String>,
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
    /// Name of the body that all of the world becomes; none if its elements are attached without a body.
    world_body: Option<String>,
    /// Bodies, joints, sites and the like that are not attached: kind and name.
    missing: BTreeSet<(&'a str, &'a str)>,
}

impl AttachedModels<'_> {
    /// Expands the text of one file. `folder` is its folder relative to that of the main file, and ends with a slash or is
    /// empty.
    fn expand(&mut self, text: &str, folder: &str, level: NestingLevel) -> Result<String, String> {
        let read = self.read;
        let text = expand_includes(text, &|name| read(&joined_path(folder, name)))?;
        let text = self.expand_models(text, folder, level)?;
        Ok(expand_copies(&text)?.into_owned())
    }

    /// Expands the models that a text attaches.
    fn expand_models(&mut self, text: String, folder: &str, level: NestingLevel) -> Result<String, String> {
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
        let paths = self.model_paths(&root, folder)?;
        let mut classes: BTreeSet<String> = class_names(&root).map(str::to_owned).collect();
        classes.insert(MAIN_CLASS.to_owned());
        // The elements at their places, and the sections of the attached models.
        let (mut elements, mut sections) = (Vec::new(), String::new());
        let mut size = text.len();
        for node in root.descendants().filter(|node| node.has_tag_name("attach")) {
            // Parts of the same model are copied afterwards.
            let Some(name) = node.attribute("model") else {
                continue;
            };
            let Some(path) = paths.get(name) else {
                let says = format!("there is no <model> with the name `{name}` in <asset>");
                return Err(located_message(&node, &says));
            };
            let whole = self.expanded_file(&node, path, level)?;
            let in_file = |fault: String| located_message(&node, &format!("in `{path}`: {fault}"));
            self.n_parsed += whole.len();
            if self.n_parsed > MOST_PARSED {
                return Err(located_message(&node, "the attached models are too large together"));
            }
            let inner =
                Document::parse(&whole).map_err(|fault| in_file(format!("it is not readable XML ({fault})")))?;
            let attached = self.attached_model(&node, &inner, path, &classes)?;
            let own = class_names(&attached.root).chain([MAIN_CLASS]);
            classes.extend(own.map(|class| attached.class(class)));
            let (element, of_sections) = (attached.element(), attached.sections());
            size += element.len() + of_sections.len();
            if size > LARGEST_DESCRIPTION {
                return Err(located_message(&node, "with this model the description is too large"));
            }
            elements.push((node.range(), element));
            sections.push_str(&of_sections);
        }
        // Sections are added at the end of the root, on its last line.
        let mut out = String::new();
        let mut from = 0;
        for (range, element) in elements {
            out.push_str(&text[from..range.start]);
            out.push_str(&element);
            out.extend(text[range.clone()].matches('\n'));
            from = range.end;
        }
        let end = text[..root.range().end].rfind("</").unwrap_or(from).max(from);
        out.push_str(&text[from..end]);
        out.push_str(&sections);
        out.push_str(&text[end..]);
        Ok(out)
    }

    /// The text of an attached file with all that it includes and attaches. A file is expanded once, however often it is
    /// attached.
    fn expanded_file(&mut self, node: &Node, path: &str, level: NestingLevel) -> Result<String, String> {
        if let Some(whole) = self.expanded.get(path) {
            return Ok(whole.clone());
        }
        if self.unfinished.iter().any(|one| one == path) {
            return Err(located_message(node, &format!("`{path}` attaches itself")));
        }
        let in_file = |fault: String| located_message(node, &format!("in `{path}`: {fault}"));
        let inside = level.enter().map_err(|fault| in_file(fault.to_string()))?;
        let text = (self.read)(path).map_err(|fault| located_message(node, &fault))?;
        self.unfinished.push(path.to_owned());
        let whole = self.expand(&text, folder_of(path), inside).map_err(in_file)?;
        self.unfinished.pop();
        let whole = match Document::parse(&whole) {
            Ok(document) if document.root_element().has_tag_name("robot") => {
                mjcf_of_urdf(&document, path).map_err(in_file)?
            }
            _ => whole,
        };
        check_xml_budget(&whole).map_err(in_file)?;
        self.expanded.insert(path.to_owned(), whole.clone());
        Ok(whole)
    }

    /// The paths of `<model>` in `<asset>` by their names: that of the entry, or that in the file. Entries of an included
    /// file are relative to its folder.
    fn model_paths(&mut self, root: &Node, folder: &str) -> Result<BTreeMap<String, String>, String> {
        let mut out = BTreeMap::new();
        let entries = children(root, "asset").flat_map(|asset| children(&asset, "model").collect::<Vec<_>>());
        for entry in entries {
            let Some(file) = entry.attribute("file") else {
                let says =
                    "it needs the attribute `file`; to attach a part of this model, leave `model` of <attach> out";
                return Err(located_message(&entry, says));
            };
            let of_include = entry.attribute(FILE_FOLDER).unwrap_or_default();
            let path = joined_path(folder, &joined_path(of_include, file));
            let name = match entry.attribute("name") {
                Some(name) => name.to_owned(),
                None => {
                    let text = (self.read)(&path).map_err(|fault| located_message(&entry, &fault))?;
                    self.n_parsed += text.len();
                    if self.n_parsed > MOST_PARSED {
                        return Err(located_message(&entry, "the attached models are too large together"));
                    }
                    let readable = check_xml_budget(&text).ok().map(|()| readable_xml(&text));
                    let parsed = readable.as_deref().and_then(|text| Document::parse(text).ok());
                    // A URDF has its name in another attribute.
                    let name = parsed.and_then(|document| {
                        let root = document.root_element();
                        let key = if root.has_tag_name("robot") { "name" } else { "model" };
                        root.attribute(key).map(str::to_owned)
                    });
                    name.unwrap_or_else(|| UNNAMED_MODEL.to_owned())
                }
            };
            out.entry(name).or_insert(path);
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
            let says = format!(
                "`{path}` is neither MJCF nor URDF; other formats are not attached: save the complete model with MuJoCo (mj_saveLastXML)"
            );
            return Err(located_message(node, &says));
        }
        // A body or a frame can be attached alone.
        if node.attribute("body").is_some() && node.attribute("frame").is_some() {
            return Err(located_message(node, "it has `body` and `frame`; give one of them"));
        }
        let (mut part, mut world_body) = (None, None);
        for tag in ["body", "frame"] {
            if let Some(name) = node.attribute(tag) {
                if (tag, name) == ("body", "world") {
                    world_body = Some(format!("{prefix}world"));
                    continue;
                }
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
            world_body,
            missing: BTreeSet::new(),
        };
        out.find_missing();
        Ok(out)
    }
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
        let names = |node: Node<'a, '_>| -> BTreeSet<(&'a str, &'a str)> {
            let named = |inner: Node<'a, '_>| Some((named_kind(inner.tag_name().name()), inner.attribute("name")?));
            node.descendants().filter_map(named).collect()
        };
        let world = children(&self.root, "worldbody").flat_map(names);
        let kept = names(part);
        self.missing = world.filter(|name| !kept.contains(name)).collect();
        // A tendon that is left out takes its actuators with it.
        for section in WITH_REFERENCES.iter().flat_map(|tag| children(&self.root, tag)) {
            for node in section.children().filter(Node::is_element) {
                if let Some(name) = node.attribute("name").filter(|_| self.is_left_out(&node)) {
                    self.missing.insert((section.tag_name().name(), name));
                }
            }
        }
    }

    /// Whether an element, or one inside it, refers to something that is not attached.
    fn is_left_out(&self, node: &Node) -> bool {
        let refers = |inner: Node| {
            let mut references = inner
                .attributes()
                .filter_map(|a| Some((referred_kind(a.name())?, a.value())));
            references.any(|one| self.missing.contains(&one))
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
                if let Some(name) = &self.world_body {
                    out.push_str("<body");
                    write_attribute(&mut out, "name", name);
                    out.push('>');
                }
                let worlds = children(&self.root, "worldbody");
                for node in worlds.flat_map(|world| world.children()).filter(Node::is_element) {
                    self.write(&mut out, &node, None);
                }
                out.push_str(if self.world_body.is_some() { "</body>" } else { "" });
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
                // Meshes of files that the attached file includes.
                FILE_FOLDER if tag == "mesh" && attached_number(node).is_none() => joined_path(self.folder, value),
                _ if CLASSES.contains(&key) => self.class(value),
                // The world has no other name.
                _ if referred_kind(key) == Some("body") && value == "world" => value.to_owned(),
                _ if (key == "name" || referred_kind(key).is_some()) && !value.is_empty() => {
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
        if let ("mesh", None, Some(file)) = (tag, node.attribute("name"), node.attribute("file")) {
            let name = name_of_file(file);
            write_attribute(out, "name", &format!("{}{name}", self.prefix));
        }
    }
}

/// The kind of element to which an attribute refers; `None` if it does not refer to one.
fn referred_kind(key: &str) -> Option<&'static str> {
    REFERENCES
        .iter()
        .find(|(attribute, _)| *attribute == key)
        .map(|(_, kind)| *kind)
}

/// The kind of elements with a tag in the tree of bodies.
pub(super) fn named_kind(tag: &str) -> &str {
    match tag {
        "freejoint" => "joint",
        tag => tag,
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
pub(super) fn write_attribute(out: &mut String, key: &str, value: &str) {
    let _ = write!(out, " {key}=\"");
    write_escaped(out, value);
    out.push('"');
}
