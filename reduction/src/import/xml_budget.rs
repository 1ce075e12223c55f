//! Limits of XML that hold before it is parsed: depth of nesting, attributes per element, and numbers of tags and of links.
//! One pass over the text.
//!
//! The parser compares each attribute with all others of its element, and readers of nested elements call themselves.
//! Without limits, a small file takes minutes, uses up the stack, or takes a hundred times its size in memory.

use modelmill_boundary::nesting::NestingLevel;

use super::thresholds::{DEEPEST_ELEMENT, MOST_ATTRIBUTES, MOST_LINKS, MOST_XML_NODES};

/// Checks the limits. Fails with line and reason. Text that is not XML passes; the parser reports its faults.
pub(super) fn check_xml_budget(text: &str) -> Result<(), String> {
    let mut level = NestingLevel::top(DEEPEST_ELEMENT);
    let (mut nodes, mut links) = (0, 0);
    let mut at = 0;
    while let Some(start) = text[at..].find('<').map(|k| at + k) {
        let fail = |says: &str| {
            let line = text[..start].matches('\n').count() + 1;
            format!("line {line}: {says}")
        };
        let rest = &text[start..];
        nodes += 1;
        if nodes > MOST_XML_NODES {
            return Err(fail(&format!(
                "the text has more than {MOST_XML_NODES} tags, comments and attributes"
            )));
        }
        // Tags in comments and in plain text are no elements.
        if let Some(end) = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>"), ("<!", ">")]
            .iter()
            .find(|(begin, _)| rest.starts_with(begin))
            .map(|(begin, end)| rest[begin.len()..].find(end).map(|k| begin.len() + k + end.len()))
        {
            at = end.map_or(text.len(), |end| start + end);
            continue;
        }
        let tag = XmlTag::new(&rest[1..]);
        if tag.attributes > MOST_ATTRIBUTES {
            return Err(fail(&format!("an element has more than {MOST_ATTRIBUTES} attributes")));
        }
        nodes += tag.attributes;
        links += usize::from(["link", "body"].contains(&tag.name));
        if links > MOST_LINKS {
            return Err(fail(&format!(
                "the description has more than {MOST_LINKS} links or bodies"
            )));
        }
        if tag.closes {
            level = level.leave();
        } else if !tag.is_empty {
            level = level
                .enter()
                .map_err(|_| fail(&format!("elements are nested more than {DEEPEST_ELEMENT} levels deep")))?;
        }
        at = start + 1 + tag.length;
    }
    Ok(())
}

/// A tag of XML.
struct XmlTag<'a> {
    /// Its name; that of a closing tag begins with a slash.
    name: &'a str,
    /// Bytes from behind `<` to behind `>`.
    length: usize,
    /// Number of attributes.
    attributes: usize,
    /// Whether it is a closing tag.
    closes: bool,
    /// Whether it is the tag of an element without contents.
    is_empty: bool,
}

impl<'a> XmlTag<'a> {
    /// Reads a tag from behind its `<`.
    fn new(text: &'a str) -> Self {
        let name = text.split(|c: char| c.is_whitespace() || c == '>').next().unwrap_or("");
        let mut tag = Self {
            // The slash of an element without contents is at its end.
            name: name.strip_suffix('/').unwrap_or(name),
            length: text.len(),
            attributes: 0,
            closes: text.starts_with('/'),
            is_empty: false,
        };
        let mut quote = None;
        let mut before = 0;
        for (k, byte) in text.bytes().enumerate() {
            match (quote, byte) {
                (Some(open), _) if open == byte => quote = None,
                (None, b'"' | b'\'') => {
                    quote = Some(byte);
                    tag.attributes += 1;
                }
                (None, b'>') => {
                    tag.length = k + 1;
                    tag.is_empty = before == b'/' && !tag.closes;
                    break;
                }
                // Anything else, and all characters of a text in quotes.
                _ => {}
            }
            before = byte;
        }
        tag
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_and_attributes_are_limited_with_their_place() {
        let nested = |n: usize| format!("<a>\n{}{}</a>", "<b x='>'>".repeat(n), "</b>".repeat(n));
        assert_eq!(check_xml_budget(&nested(DEEPEST_ELEMENT - 1)), Ok(()));
        let fault = check_xml_budget(&nested(DEEPEST_ELEMENT)).unwrap_err();
        assert!(fault.starts_with("line 2: elements are nested more than"), "{fault}");
        let wide = |n: usize| format!("<a>\n<b {}/></a>", "x=\"1\" ".repeat(n));
        assert_eq!(check_xml_budget(&wide(MOST_ATTRIBUTES)), Ok(()));
        let fault = check_xml_budget(&wide(MOST_ATTRIBUTES + 1)).unwrap_err();
        assert!(fault.starts_with("line 2: an element has more than"), "{fault}");
    }

    #[test]
    fn numbers_of_tags_and_links_are_limited_with_their_place() {
        let many = |part: &str, n: usize| format!("<a>\n{}</a>", part.repeat(n));
        for (part, nodes, says) in [
            ("<b/>", 1, "more than 500000 tags"),
            ("<!---->", 1, "more than 500000 tags"),
            ("<?b?>", 1, "more than 500000 tags"),
            ("<b x='1' y='2'/>", 3, "more than 500000 tags"),
        ] {
            assert_eq!(
                check_xml_budget(&many(part, (MOST_XML_NODES - 2) / nodes)),
                Ok(()),
                "{part}"
            );
            let fault = check_xml_budget(&many(part, MOST_XML_NODES / nodes + 1)).unwrap_err();
            assert!(fault.starts_with("line 2: ") && fault.contains(says), "{fault}");
        }
        for part in ["<link/>", "<body name='b'/>", "<link></link>", "<body\n/>"] {
            assert_eq!(check_xml_budget(&many(part, MOST_LINKS)), Ok(()), "{part}");
            let fault = check_xml_budget(&many(part, MOST_LINKS + 1)).unwrap_err();
            assert!(fault.contains("more than 30000 links or bodies"), "{fault}");
        }
    }

    #[test]
    fn only_elements_count() {
        let deep = "<b>".repeat(2 * DEEPEST_ELEMENT);
        for text in [
            format!("<a><!-- {deep} --></a>"),
            format!("<a><![CDATA[{deep}]]></a>"),
            format!("<?x {deep}?><a/>"),
            format!("<a x=\"{deep}\"/>"),
            "<b/>".repeat(2 * DEEPEST_ELEMENT),
            "<b></b>".repeat(2 * DEEPEST_ELEMENT),
            "no XML < at all".to_owned(),
        ] {
            assert_eq!(check_xml_budget(&text), Ok(()), "{text:.40}");
        }
    }
}
