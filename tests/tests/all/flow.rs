//! References between the folders of a crate run one way: a folder uses only those that stand before it in the table of
//! docs/dev/order-of-folders.md.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// A source file: its path below `src`, with `/` between folders, and its text.
type Source = (String, String);

#[test]
fn no_folder_uses_one_that_stands_after_it() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let text = fs::read_to_string(root.join("docs/dev/order-of-folders.md")).expect("the page is there");
    let orders = orders(&text);
    assert!(orders.len() > 1, "the table of order-of-folders.md is read");
    let faults: Vec<String> = orders
        .iter()
        .flat_map(|(folder, order)| {
            let faults = faults(order, &sources(&root.join(folder)));
            faults.into_iter().map(move |fault| format!("{folder}: {fault}"))
        })
        .collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// The table: for every folder of sources, its parts in the order in which they may use each other.
fn orders(page: &str) -> BTreeMap<String, Vec<String>> {
    let section = page.split("# The order of folders\n").nth(1).unwrap_or_default();
    let section = section.split("\n#").next().unwrap_or_default();
    let in_ticks = |cell: &str| -> Vec<String> {
        let words = cell.split('`').skip(1).step_by(2);
        words.map(String::from).collect()
    };
    section
        .lines()
        .filter_map(|line| {
            let cells: Vec<&str> = line.split('|').collect();
            let [_, folder, parts, ..] = cells.as_slice() else {
                return None;
            };
            Some((in_ticks(folder).pop()?, in_ticks(parts)))
        })
        .collect()
}

/// All Rust files below a folder.
fn sources(folder: &Path) -> Vec<Source> {
    let mut found = Vec::new();
    let mut open: Vec<PathBuf> = vec![folder.to_path_buf()];
    while let Some(next) = open.pop() {
        let entries = fs::read_dir(&next).unwrap_or_else(|e| panic!("{}: {e}", next.display()));
        for entry in entries {
            let path = entry.expect("an entry of a folder").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let below = path.strip_prefix(folder).expect("below the folder");
                let parts: Vec<_> = below.iter().map(|p| p.to_string_lossy()).collect();
                let text = fs::read_to_string(&path).expect("a source file");
                found.push((parts.join("/"), text));
            }
        }
    }
    found.sort();
    found
}

/// What is wrong with the flow of some sources: references that run back, and parts that the order does not know.
fn faults(order: &[String], sources: &[Source]) -> Vec<String> {
    let place = |part: &str| order.iter().position(|o| o == part);
    let root = sources.iter().find(|(path, _)| path == "lib.rs");
    let root = tokens(root.map_or("", |(_, text)| text));
    let exports = exports(&root);
    let for_tests = for_tests(sources);
    let is_test = |path: &str| {
        for_tests
            .iter()
            .any(|t| path == format!("{t}.rs") || path.starts_with(&format!("{t}/")))
    };
    let of_crate: Vec<&Source> = sources
        .iter()
        .filter(|(path, _)| !["lib.rs", "main.rs"].contains(&path.as_str()) && !is_test(path))
        .collect();
    let present: BTreeSet<&str> = of_crate.iter().map(|(path, _)| part_of(path)).collect();
    let mut faults = Vec::new();
    for part in &present {
        if place(part).is_none() {
            faults.push(format!("`{part}` has no place in the order"));
        }
    }
    for part in order.iter().filter(|o| !present.contains(o.as_str())) {
        faults.push(format!("`{part}` of the order is not there"));
    }
    for (path, text) in of_crate {
        let from = part_of(path);
        for name in names_of_the_root(path, &tokens(text)) {
            let to = match exports.get(&name) {
                Some(part) => part.as_str(),
                None => name.as_str(),
            };
            match (place(from), place(to)) {
                (Some(a), Some(b)) if b > a => {
                    faults.push(format!("{path} uses `{name}` of `{to}`, which stands after `{from}`"));
                }
                // What another crate owns may come through the root; what the root itself defines may not be used below.
                (_, None) if !exports.contains_key(&name) => {
                    faults.push(format!("{path} uses `{name}`, which the root of the crate defines"));
                }
                _ => {}
            }
        }
    }
    faults.dedup();
    faults
}

/// The first folder of a path, or the file itself where it stands in none.
fn part_of(path: &str) -> &str {
    let first = path.split('/').next().unwrap_or(path);
    first.strip_suffix(".rs").unwrap_or(first)
}

/// Words and signs of a text without comments and without modules for tests.
fn tokens(text: &str) -> Vec<String> {
    let mut lines = Vec::new();
    let mut all = text.lines();
    while let Some(line) = all.next() {
        if line == "#[cfg(test)]" {
            // By the layout of rustfmt a module of a file ends with a brace at the margin.
            let opens = all.next().is_some_and(|next| next.ends_with('{'));
            if opens {
                all.by_ref().find(|line| *line == "}");
            }
            continue;
        }
        lines.push(line.split("//").next().unwrap_or_default());
    }
    let code = lines.join("\n");
    let mut tokens: Vec<String> = Vec::new();
    let mut in_word = false;
    for c in code.chars() {
        let is_word = c.is_alphanumeric() || c == '_';
        if is_word && in_word {
            tokens.last_mut().expect("a word has begun").push(c);
        } else if !c.is_whitespace() {
            tokens.push(c.into());
        }
        in_word = is_word;
    }
    tokens
}

/// Paths, without their ending, of modules that are there for tests only.
fn for_tests(sources: &[Source]) -> Vec<String> {
    let mut found = Vec::new();
    for (path, text) in sources {
        let folder = match path.rsplit_once('/') {
            Some((folder, _)) => format!("{folder}/"),
            None => String::new(),
        };
        let lines: Vec<&str> = text.lines().collect();
        for pair in lines.windows(2).filter(|pair| pair[0] == "#[cfg(test)]") {
            let name = pair[1].rsplit("mod ").next().and_then(|n| n.strip_suffix(';'));
            found.extend(name.map(|name| format!("{folder}{name}")));
        }
    }
    found
}

/// Names that the root of a crate hands on, with the part or the crate that each comes from.
fn exports(root: &[String]) -> BTreeMap<String, String> {
    let mut exports = BTreeMap::new();
    for (i, _) in root.iter().enumerate().filter(|(_, t)| *t == "use") {
        let end = root[i..].iter().position(|t| t == ";").map_or(root.len(), |n| i + n);
        let path = &root[i + 1..end];
        for (k, token) in path.iter().enumerate() {
            let next = path.get(k + 1).map(String::as_str);
            if matches!(next, None | Some("," | "}")) && token != "}" && token != "," {
                exports.insert(token.clone(), path[0].clone());
            }
        }
    }
    exports
}

/// The names that a file takes from the root of its crate: what follows `crate::`, and `super::` as far as it leads there.
fn names_of_the_root(path: &str, tokens: &[String]) -> Vec<String> {
    let depth = path.split('/').filter(|part| *part != "mod.rs").count();
    let is = |i: usize, what: &str| tokens.get(i).is_some_and(|t| t == what);
    let mut names = Vec::new();
    let mut i = 0;
    while i < tokens.len() {
        let mut up = 0;
        while is(i + 3 * up, "super") && is(i + 3 * up + 1, ":") && is(i + 3 * up + 2, ":") {
            up += 1;
        }
        let follows = if tokens[i] == "crate" && is(i + 1, ":") && is(i + 2, ":") {
            i + 3
        } else if up > 0 && up >= depth {
            i + 3 * up
        } else {
            i += 1 + 3 * up.saturating_sub(1);
            continue;
        };
        i = follows;
        if !is(i, "{") {
            names.extend(tokens.get(i).cloned());
            continue;
        }
        let mut open = 0;
        loop {
            match tokens.get(i).map(String::as_str) {
                Some("{") => open += 1,
                Some("}") => open -= 1,
                None => break,
                _ => {}
            }
            if open == 1 && (is(i, "{") || is(i, ",")) && !is(i + 1, "}") {
                names.extend(tokens.get(i + 1).cloned());
            }
            i += 1;
            if open == 0 {
                break;
            }
        }
    }
    names
}

/// A made crate in two folders and a file, with one more file.
fn made(more: Source) -> Vec<String> {
    let order = ["base", "middle", "top"].map(String::from);
    let file = |path: &str, text: &str| (path.to_owned(), text.to_owned());
    let sources = [
        file(
            "lib.rs",
            "mod base;\nmod middle;\nmod top;\npub use other_crate::Alien;\npub use top::{Roof, inner::Tile};\nfn of_root() {}\n",
        ),
        file("base/mod.rs", "pub fn ground() {}\n"),
        file(
            "middle/mod.rs",
            "use crate::base::{self, ground};\nuse crate::Alien;\n#[cfg(test)]\nmod tests;\n",
        ),
        file("middle/tests.rs", "use crate::top::Roof;\n"),
        file(
            "top.rs",
            "use crate::{base, middle::{rooms, doors}};\nuse super::base::ground;\n",
        ),
        more,
    ];
    faults(&order, &sources)
}

#[test]
fn a_made_reference_that_runs_back_is_found() {
    let told = |path: &str, text: &str| made((path.to_owned(), text.to_owned()));
    let nothing: Vec<String> = Vec::new();
    assert_eq!(told("base/inner.rs", "fn f() {}\n"), nothing);
    for back in [
        "use crate::top::Roof;\n",
        "use crate::Tile;\n",
        "use crate::{base, top::{inner, Roof}};\n",
        "fn f() { let x = crate::Roof::new(); }\n",
        "use super::super::top::Roof;\n",
        "pub(in crate::top) fn f() {}\n",
    ] {
        assert_eq!(told("middle/inner.rs", back).len(), 1, "{back}");
        assert_eq!(told("base/inner.rs", back).len(), 1, "{back}");
    }
    assert_eq!(told("middle/inner.rs", "fn f() { crate::of_root(); }\n").len(), 1);
    assert_eq!(told("stray/mod.rs", "").len(), 1);
    let silent = "// use crate::top::Roof;\nuse super::tests;\n#[cfg(test)]\nmod tests {\n    use crate::top;\n}\n";
    assert_eq!(told("base/inner.rs", silent), nothing);
}

#[test]
fn the_order_is_read_from_its_table() {
    let page = "# The order of folders\n\nWords.\n\n| sources | order |\n|---|---|\n| `one/src` | `a`, `b` |\n\n## B\n| `two/src` | `c` |\n";
    let read = orders(page);
    assert_eq!(read.len(), 1);
    assert_eq!(read["one/src"], ["a", "b"]);
}
