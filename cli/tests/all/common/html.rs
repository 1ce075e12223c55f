//! A small checker of pages: tags that match, attributes in quotes, names that are unique and exist, no way to a network.

use std::collections::BTreeSet;

const VOID: [&str; 5] = ["meta", "link", "br", "hr", "img"];

/// Panics with what is wrong.
#[track_caller]
pub(crate) fn check(page: &str) {
    assert!(page.starts_with("<!DOCTYPE html>\n<html lang="), "no doctype");
    let mut open: Vec<String> = Vec::new();
    let mut ids = BTreeSet::new();
    let mut targets = Vec::new();
    let mut rest = &page["<!DOCTYPE html>".len()..];
    while let Some(at) = rest.find('<') {
        let text = &rest[..at];
        assert!(
            !text.contains('>') || text.contains("=>"),
            "a stray `>`: {}",
            excerpt(text)
        );
        rest = &rest[at..];
        let end = end_of_tag(rest);
        let tag = &rest[1..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(
                open.pop().as_deref(),
                Some(name),
                "an end tag out of turn; open: {open:?}"
            );
            continue;
        }
        let name: String = tag.chars().take_while(char::is_ascii_alphanumeric).collect();
        assert!(!name.is_empty(), "`<` that begins no tag: {}", excerpt(tag));
        for (key, value) in attributes(&tag[name.len()..]) {
            match key {
                "id" => assert!(ids.insert(value.to_owned()), "the name {value} twice"),
                "href" if value.starts_with('#') => targets.push(value[1..].to_owned()),
                "href" => assert!(value.starts_with("data:"), "a way outside: {value}"),
                "src" | "srcset" | "action" => panic!("a way outside: {key}={value}"),
                _ => {}
            }
        }
        if name == "script" || name == "style" {
            let end = rest.find(&format!("</{name}>")).expect("an end of the script");
            let body = &rest[..end];
            for word in ["@import", "url(", "fetch(", "XMLHttpRequest", "import("] {
                assert!(!body.contains(word), "{name} uses {word}");
            }
            rest = &rest[end + name.len() + 3..];
            continue;
        }
        if !tag.ends_with('/') && !VOID.contains(&name.as_str()) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "not closed: {open:?}");
    for target in targets {
        assert!(ids.contains(&target), "no place is called {target}");
    }
    let without_names = page.replace("http://www.w3.org/", "");
    assert!(
        !without_names.contains("http:") && !without_names.contains("https:"),
        "an address"
    );
}

/// The position of the `>` that ends a tag; those in quotes are text.
fn end_of_tag(text: &str) -> usize {
    let mut quoted = false;
    let end = text.char_indices().find(|(_, c)| {
        quoted ^= *c == '"';
        *c == '>' && !quoted
    });
    end.unwrap_or_else(|| panic!("a tag without end: {}", excerpt(text))).0
}

/// `key="value"` pairs; a key alone has no value.
fn attributes(text: &str) -> Vec<(&str, &str)> {
    let mut found = Vec::new();
    let mut rest = text.trim_start().trim_end_matches('/');
    while !rest.trim().is_empty() {
        let end = rest.find(|c: char| c == '=' || c.is_whitespace()).unwrap_or(rest.len());
        let key = &rest[..end];
        rest = &rest[end..];
        if let Some(value) = rest.strip_prefix("=\"") {
            let end = value.find('"').expect("a quote that is closed");
            found.push((key, &value[..end]));
            rest = &value[end + 1..];
        } else {
            assert!(!rest.starts_with('='), "a value without quotes: {}", excerpt(text));
            found.push((key, ""));
        }
        rest = rest.trim_start();
    }
    found
}

fn excerpt(text: &str) -> String {
    text.chars().take(80).collect()
}
