//! Frequent faults of XML that other readers of robots ignore: text that is not XML goes in, the same text without these
//! faults comes out. Line numbers stay.
//!
//! - `--` in a comment: comments are emptied.
//! - Blank lines before the XML declaration: they are moved behind it.
//! - No space between two attributes: a space is added.
//! - A `<!DOCTYPE>`: it is emptied. References to its entities are then refused, as MuJoCo refuses them.
//! - A prefix that no `xmlns` declares, such as `drake:`: it is declared in the root element. The prefix of macros,
//!   `xacro:`, is not, because macros must be expanded.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt::Write as _;

use roxmltree::Document;

/// Largest number of prefixes that are declared: the parser compares each attribute of the root with all others.
const MOST_PREFIXES: usize = 16;

/// The text as it is if it is XML, otherwise without the faults above.
pub(super) fn readable_xml(text: &str) -> Cow<'_, str> {
    match Document::parse(text) {
        Ok(_) => Cow::Borrowed(text),
        Err(_) => Cow::Owned(repair_xml(text)),
    }
}

/// The text without the faults above.
fn repair_xml(text: &str) -> String {
    let body = text.trim_start();
    let mut out = String::with_capacity(text.len() + 64);
    let mut prefixes = BTreeSet::new();
    // Where the name of the root element ends in the output.
    let mut root_name_end = None;
    let mut rest = body;
    while let Some(start) = rest.find('<') {
        out.push_str(&rest[..start]);
        rest = &rest[start..];
        let to = |end: &str| rest.find(end).map_or(rest.len(), |k| k + end.len());
        let length = match rest {
            _ if rest.starts_with("<!--") => to("-->"),
            _ if rest.starts_with("<![CDATA[") => to("]]>"),
            _ if rest.starts_with("<?") => to("?>"),
            _ if rest.starts_with("<!DOCTYPE") => doctype_length(rest),
            _ if rest.starts_with("<!") => to(">"),
            _ => {
                root_name_end = root_name_end.or(Some(out.len() + 1 + name_at_start(&rest[1..]).len()));
                push_tag(rest, &mut out, &mut prefixes)
            }
        };
        if rest.starts_with("<!DOCTYPE") {
            out.extend(rest[..length].matches('\n'));
        } else if rest.starts_with("<!--") {
            let lines = rest[..length].matches('\n').count();
            out.extend(["<!--", &"\n".repeat(lines), "-->"]);
        } else if rest.starts_with("<!") || rest.starts_with("<?") {
            out.push_str(&rest[..length]);
        }
        rest = &rest[length..];
    }
    out.push_str(rest);
    let mut known: BTreeSet<&str> = BTreeSet::from(["xml", "xmlns", "xacro"]);
    known.extend(body.split("xmlns:").skip(1).map(name_at_start));
    let unknown: Vec<&&str> = prefixes.difference(&known).collect();
    if let Some(end) = root_name_end.filter(|_| unknown.len() <= MOST_PREFIXES) {
        let mut declared = String::new();
        for prefix in unknown {
            let _ = write!(declared, " xmlns:{prefix}=\"{prefix}\"");
        }
        out.insert_str(end, &declared);
    }
    let declaration = out.find("?>").filter(|_| out.starts_with("<?xml"));
    let blank = &text[..text.len() - body.len()];
    out.insert_str(declaration.map_or(0, |end| end + 2), blank);
    out
}

/// The length of the `<!DOCTYPE>` at the start of a text, with the declarations in brackets.
fn doctype_length(text: &str) -> usize {
    let mut quote = None;
    let mut is_inside = false;
    let mut at = 0;
    while let Some(c) = text[at..].chars().next() {
        let skipped = [("<!--", "-->"), ("<?", "?>")];
        let skipped = skipped.iter().find(|(start, _)| text[at..].starts_with(start));
        if let Some((_, end)) = skipped.filter(|_| quote.is_none()) {
            at = text[at..].find(end).map_or(text.len(), |k| at + k + end.len());
            continue;
        }
        at += c.len_utf8();
        match (quote, c) {
            (Some(open), _) if open == c => quote = None,
            (None, '"' | '\'') => quote = Some(c),
            (None, '[') => is_inside = true,
            (None, ']') => is_inside = false,
            (None, '>') if !is_inside => break,
            _ => {}
        }
    }
    at
}

/// The name at the start of a text, up to white space or the sign that ends a name.
fn name_at_start(text: &str) -> &str {
    let end = text.find(|c: char| c.is_whitespace() || "/>=".contains(c));
    &text[..end.unwrap_or(text.len())]
}

/// Appends the tag at the start of `text` with a space between any two attributes, and collects the prefixes of its
/// names. Returns the length of the tag.
fn push_tag<'a>(text: &'a str, out: &mut String, prefixes: &mut BTreeSet<&'a str>) -> usize {
    let mut quote = None;
    let mut name_start = 1;
    let mut before = ' ';
    for (k, c) in text.char_indices() {
        match (quote, c) {
            (Some(open), _) if open == c => quote = None,
            (None, '"' | '\'') => quote = Some(c),
            (None, '>') => {
                out.push(c);
                return k + 1;
            }
            (None, ':') => {
                prefixes.insert(text[name_start..k].trim_start_matches('/'));
            }
            (None, _) if "\"'".contains(before) && c.is_alphabetic() => {
                out.push(' ');
                name_start = k;
            }
            (None, _) if c.is_whitespace() => name_start = k + c.len_utf8(),
            _ => {}
        }
        out.push(c);
        before = c;
    }
    text.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_others_ignore_is_mended_with_the_same_lines() {
        let faulty = "\n\n<?xml version=\"1.0\"?>\n<!-- a -- b\n <c:d> -->\n<robot name=\"r\"x='1 > :y'>\n<drake:joint a:b='1'/>\n<e xml:id='1'/></robot>\n";
        assert!(Document::parse(faulty).is_err());
        let mended = repair_xml(faulty);
        let document = Document::parse(&mended).unwrap();
        let root = document.root_element();
        assert_eq!(
            (root.attribute("name"), root.attribute("x")),
            (Some("r"), Some("1 > :y"))
        );
        let names: Vec<&str> = root.descendants().map(|node| node.tag_name().name()).collect();
        assert!(names.contains(&"joint"), "{mended}");
        let line = |text: &str, part: &str| text[..text.find(part).unwrap()].matches('\n').count();
        assert_eq!(line(&mended, "<robot"), line(faulty, "<robot"));
        assert_eq!(line(&mended, "<drake"), line(faulty, "<drake"));
    }

    #[test]
    fn document_types_are_emptied_with_the_same_lines() {
        for document_type in [
            "<!DOCTYPE robot>",
            "<!DOCTYPE robot SYSTEM \"a>b.dtd\">",
            "<!DOCTYPE robot [\n <!ENTITY e '>'>\n <!-- ] -->\n]>",
        ] {
            let text = format!("<?xml version=\"1.0\"?>\n{document_type}\n<robot name=\"r\"/>\n");
            assert!(Document::parse(&text).is_err());
            let mended = repair_xml(&text);
            let document = Document::parse(&mended).unwrap_or_else(|fault| panic!("{fault}: {mended}"));
            assert_eq!(document.root_element().attribute("name"), Some("r"));
            let line = |text: &str| text[..text.find("<robot").unwrap()].matches('\n').count();
            assert_eq!(line(&mended), line(&text));
        }
    }

    /// Many prefixes cost no time: none is declared, and the text stays what it was.
    #[test]
    fn only_few_prefixes_are_declared() {
        let many = |n: usize| (0..n).map(|k| format!("<p{k}:a/>")).collect::<Vec<_>>().concat();
        // One of them is declared already.
        for (n, is_readable) in [(MOST_PREFIXES + 1, true), (MOST_PREFIXES + 2, false), (100_000, false)] {
            let text = format!("<robot xmlns:p0='declared'>{}</robot>", many(n));
            assert_eq!(Document::parse(&readable_xml(&text)).is_ok(), is_readable, "{n}");
        }
    }

    #[test]
    fn other_text_stays_what_it_says() {
        for text in ["", "no XML", "<", "<a", "<a b='", "<!-- open", "<a:b/>", "<xacro:a/>"] {
            let mended = repair_xml(text);
            let (before, after) = (Document::parse(text), Document::parse(&mended));
            assert_eq!(after.is_ok(), before.is_ok() || text == "<a:b/>", "{text}: {mended}");
        }
    }
}
