//! Limits of XML that hold before it is parsed: depth of nesting, and attributes per element. One pass over the text.
//!
//! The parser compares each attribute with all others of its element, and readers of nested elements call themselves.
//! Without limits, a small file takes minutes, or uses up the stack.

use modelmill_boundary::nesting::NestingLevel;

use super::thresholds::{DEEPEST_ELEMENT, MOST_ATTRIBUTES};

/// Checks the limits. Fails with line and reason. Text that is not XML passes; the parser reports its faults.
pub(super) fn check_xml_budget(text: &str) -> Result<(), String> {
    let mut level = NestingLevel::top(DEEPEST_ELEMENT);
    let mut at = 0;
    while let Some(start) = text[at..].find('<').map(|k| at + k) {
        let fail = |says: &str| {
            let line = text[..start].matches('\n').count() + 1;
            format!("line {line}: {says}")
        };
        let rest = &text[start..];
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
struct XmlTag {
    /// Bytes from behind `<` to behind `>`.
    length: usize,
    /// Number of attributes.
    attributes: usize,
    /// Whether it is a closing tag.
    closes: bool,
    /// Whether it is the tag of an element without contents.
    is_empty: bool,
}

impl XmlTag {
    /// Reads a tag from behind its `<`.
    fn new(text: &str) -> Self {
        let mut tag = Self {
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
