//! Access to elements and attributes of XML. Faults name the line and the element.

use nalgebra::{Matrix3, Vector3};
use roxmltree::Node;

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
    node.document().text_pos_at(node.range().start).row
}

/// A fault with line, tag and name of its element in front.
pub(crate) fn located_message(node: &Node, fault: &str) -> String {
    let name = node
        .attribute("name")
        .map_or_else(String::new, |name| format!(" `{name}`"));
    format!("line {}, <{}>{name}: {fault}", line(node), node.tag_name().name())
}
