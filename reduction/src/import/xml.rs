//! Access to elements and attributes of XML. Faults name the line and the element.

use std::cell::RefCell;
use std::marker::PhantomData;

use nalgebra::{Matrix3, Vector3};
use roxmltree::{Document, Node};

/// The first child element with a tag, in any namespace.
pub(crate) fn child<'a, 'i>(of: &Node<'a, 'i>, tag: &str) -> Option<Node<'a, 'i>> {
    of.children()
        .find(|node| node.has_tag_name(tag) || node.tag_name().name() == tag)
}

/// All child elements with a tag, in any namespace.
pub(crate) fn children<'a, 'i>(
    of: &Node<'a, 'i>,
    tag: &'static str,
) -> impl Iterator<Item = Node<'a, 'i>> + use<'a, 'i> {
    of.children().filter(move |node| node.tag_name().name() == tag)
}

/// The first child element with a tag; fails without one.
pub(crate) fn required_child<'a, 'i>(of: &Node<'a, 'i>, tag: &str) -> Result<Node<'a, 'i>, String> {
    child(of, tag).ok_or_else(|| located_message(of, &format!("it needs <{tag}>")))
}

/// The text of an attribute; fails without it.
pub(crate) fn required_attribute(of: &Node, key: &str) -> Result<String, String> {
    let text = of.attribute(key);
    text.map(str::to_owned)
        .ok_or_else(|| located_message(of, &format!("it needs the attribute `{key}`")))
}

/// Finite numbers of a text, separated by white space; `key` names the text in the error.
pub(crate) fn numbers(of: &Node, key: &str, text: &str) -> Result<Vec<f64>, String> {
    let parsed: Option<Vec<f64>> = text
        .split_whitespace()
        .map(|part| part.parse().ok().filter(|x: &f64| x.is_finite()))
        .collect();
    parsed.ok_or_else(|| located_message(of, &format!("expected finite numbers in `{key}`")))
}

/// Exactly `N` finite numbers of a text.
pub(crate) fn exact_numbers<const N: usize>(of: &Node, key: &str, text: &str) -> Result<[f64; N], String> {
    let found = numbers(of, key, text)?;
    let n = found.len();
    found
        .try_into()
        .map_err(|_| located_message(of, &format!("expected {N} numbers in `{key}`, found {n}")))
}

/// An attribute with one finite number.
pub(crate) fn number_attribute(of: &Node, key: &str) -> Result<f64, String> {
    let text = required_attribute(of, key)?;
    exact_numbers(of, key, &text).map(|[x]| x)
}

/// An attribute with three finite numbers.
pub(crate) fn three_numbers(of: &Node, key: &str) -> Result<[f64; 3], String> {
    exact_numbers(of, key, &required_attribute(of, key)?)
}

/// The symmetric matrix with the entries xx, yy, zz, xy, xz, yz.
pub(crate) fn symmetric([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> Matrix3<f64> {
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// Three numbers as a vector.
pub(crate) fn vector(of: [f64; 3]) -> Vector3<f64> {
    Vector3::from(of)
}

/// The line of an element in its file, from 1.
pub(crate) fn line(node: &Node) -> u32 {
    let (text, start) = (node.document().input_text(), node.range().start);
    LINE_STARTS.with_borrow(|table| match table {
        Some(table) if std::ptr::eq(table.text, text) => table.line(start),
        // The parser counts from the start of the text.
        _ => node.document().text_pos_at(start).row,
    })
}

thread_local! {
    /// The lines of the document that this thread reads.
    static LINE_STARTS: RefCell<Option<LineStarts>> = const { RefCell::new(None) };
}

/// Where the lines of a text start. The text is compared by its address, and is never read through it.
struct LineStarts {
    text: *const str,
    starts: Vec<usize>,
}

impl LineStarts {
    /// The line of a position, from 1.
    fn line(&self, at: usize) -> u32 {
        let line = self.starts.partition_point(|start| *start <= at);
        u32::try_from(line).unwrap_or(u32::MAX)
    }
}

/// While this value exists, [`line()`] looks up lines of the document in a table. Without it, each call would count the
/// lines from the start of the text, and a file of `n` elements would take the time `n^2`.
pub(crate) struct LineTable<'a, 'i>(PhantomData<&'a Document<'i>>);

impl<'a, 'i> LineTable<'a, 'i> {
    /// Makes the table of a document, which replaces that of another document.
    pub(crate) fn install(document: &'a Document<'i>) -> Self {
        let text = document.input_text();
        let behind = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        let starts = std::iter::once(0).chain(behind.map(|(at, _)| at + 1)).collect();
        LINE_STARTS.set(Some(LineStarts { text, starts }));
        Self(PhantomData)
    }
}

impl Drop for LineTable<'_, '_> {
    fn drop(&mut self) {
        LINE_STARTS.set(None);
    }
}

/// A fault with line, tag and name of its element in front.
pub(crate) fn located_message(node: &Node, fault: &str) -> String {
    let name = node
        .attribute("name")
        .map_or_else(String::new, |name| format!(" `{name}`"));
    format!("line {}, <{}>{name}: {fault}", line(node), node.tag_name().name())
}

/// Writes the value of an attribute; line breaks become blanks, as a parser of XML reads them.
pub(super) fn write_escaped(out: &mut String, value: &str) {
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
