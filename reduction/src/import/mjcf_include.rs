//! Expands the `<include>` elements of an MJCF: its text goes in, the text with the contents of all included files
//! comes out.
//!
//! Source: MuJoCo's XML reference, "include": the children of the other file's root, each file once, with names
//! relative to the folder of the main file. MuJoCo 4 reads a file that is not there relative to the folder of the
//! including file.

use std::fmt::Write as _;

use modelmill_boundary::nesting::NestingLevel;
use roxmltree::{Document, Node};

use super::xml::{located_message, required_attribute, write_escaped};
use super::xml_budget::check_xml_budget;
use super::xml_repair::readable_xml;

/// Gives the text of a file by its name; fails with a sentence.
pub type FileReader<'a> = &'a dyn Fn(&str) -> Result<String, String>;

/// Attribute of elements that name files: the folder of the file with the element, relative to that of the main file.
pub(super) const FILE_FOLDER: &str = "modelmill-folder";

/// Largest depth of nested includes.
const DEEPEST: usize = 20;

/// The text of an MJCF with all included files, each on one line, so that line numbers in messages are those of the
/// file itself. `read` gives the text of a file by its name.
///
/// Text that is not XML or not MJCF is returned unchanged; the import reports its fault.
pub(super) fn expand_includes(text: &str, read: FileReader) -> Result<String, String> {
    expand_file(text, "", read, &mut Vec::new(), NestingLevel::top(DEEPEST))
}

/// Expands one file. `folder` is its folder relative to that of the main file, and ends with a slash or is empty. `seen`
/// are the names of the files included so far, `level` is that of nesting.
fn expand_file(
    text: &str,
    folder: &str,
    read: FileReader,
    seen: &mut Vec<String>,
    level: NestingLevel,
) -> Result<String, String> {
    // Faults of the main file are reported by the import, also of one that is too deep to be parsed.
    if check_xml_budget(text).is_err() {
        return Ok(text.to_owned());
    }
    let readable = readable_xml(text);
    let text = readable.as_ref();
    let Ok(document) = Document::parse(text) else {
        return Ok(text.to_owned());
    };
    let root = document.root_element();
    if level == NestingLevel::top(DEEPEST) && root.tag_name().name() != "mujoco" {
        return Ok(text.to_owned());
    }
    // The text between includes stays as it is.
    let mut out = String::new();
    let mut from = 0;
    for node in root.descendants() {
        if node.tag_name().name() != "include" {
            continue;
        }
        let name = required_attribute(&node, "file")?;
        let (mut place, mut other) = (name.clone(), read(&name));
        if other.is_err() && !folder.is_empty() {
            let beside = joined_path(folder, &name);
            if let Ok(text) = read(&beside) {
                (place, other) = (beside, Ok(text));
            }
        }
        if seen.contains(&place) {
            return Err(located_message(
                &node,
                &format!("`{name}` is included twice; MuJoCo permits each file once"),
            ));
        }
        let inside = level
            .enter()
            .map_err(|fault| located_message(&node, &format!("`{name}` cannot be included; {fault}")))?;
        let other = other.map_err(|fault| located_message(&node, &fault))?;
        // The other file's own includes are expanded.
        let folder_of_other = folder_of(&place).to_owned();
        seen.push(place);
        let whole = expand_file(&other, &folder_of_other, read, seen, inside)
            .map_err(|fault| located_message(&node, &format!("in `{name}`: {fault}")))?;
        check_xml_budget(&whole).map_err(|fault| located_message(&node, &format!("in `{name}`: {fault}")))?;
        let inner = Document::parse(&whole)
            .map_err(|fault| located_message(&node, &format!("`{name}` is not readable XML ({fault})")))?;
        let children = inner.root_element().children();
        let range = node.range();
        // The children of its root, without line breaks.
        out.push_str(&text[from..range.start]);
        for child in children.filter(Node::is_element) {
            push_included(&mut out, &whole, &child, &folder_of_other);
        }
        from = range.end;
    }
    out.push_str(&text[from..]);
    Ok(out)
}

/// The folder of a path, with the slash at its end; empty for a file without one.
pub(super) fn folder_of(path: &str) -> &str {
    &path[..path.rfind('/').map_or(0, |slash| slash + 1)]
}

/// Adds an element of an included file, without line breaks. A `<model>` is relative to the folder of this file, and a
/// `<mesh>` that is not found elsewhere.
fn push_included(out: &mut String, text: &str, child: &Node, folder: &str) {
    let mut from = child.range().start;
    let named = child
        .descendants()
        .filter(|node| ["model", "mesh"].contains(&node.tag_name().name()) && !node.has_attribute(FILE_FOLDER));
    for node in named.filter(|_| !folder.is_empty() && child.has_tag_name("asset")) {
        let to = node.range().start + 1 + node.tag_name().name().len();
        out.push_str(&text[from..to].replace(['\n', '\r'], " "));
        let _ = write!(out, " {FILE_FOLDER}=\"");
        write_escaped(out, folder);
        out.push('"');
        from = to;
    }
    out.push_str(&text[from..child.range().end].replace(['\n', '\r'], " "));
}

/// The path of a file whose name is relative to a folder, unless it is absolute.
pub(super) fn joined_path(folder: &str, file: &str) -> String {
    if file.starts_with('/') {
        file.to_owned()
    } else {
        format!("{folder}{file}")
    }
}
