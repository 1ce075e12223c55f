//! Names that can be searched for: a type has a name that no other type has, and no name is a bare participle or a bare
//! preposition. The rules are those of docs/dev/style.md.
//!
//! Files are read as text: sources of all crates without tests, benchmarks and generated code.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Names that several types may have, because Rust programs call such things so.
const CONVENTIONAL: [&str; 6] = ["Error", "Options", "Builder", "Iter", "Result", "Config"];

/// Words that say nothing alone: a reader has to know of what, by what or from what.
const BARE: [&str; 45] = [
    "told", "untold", "said", "says", "tell", "tells", "found", "made", "left", "asked", "given", "taken", "kept",
    "felt", "seen", "tried", "moved", "carried", "judged", "named", "drawn", "held", "written", "going", "now", "one",
    "of", "by", "at", "on", "in", "with", "as", "beside", "besides", "between", "apart", "alike", "whole", "what",
    "who", "where", "how", "so", "than",
];

/// Folders whose names are not looked at.
const SKIPPED: [&str; 7] = [
    "target",
    ".git",
    "tests",
    "benches",
    "fixtures",
    "test_data",
    "generated",
];

/// A definition: its name, and file and line.
type Definition = (String, String);

/// Types and functions that a file defines before its tests.
fn definitions(text: &str, file: &str) -> [Vec<Definition>; 2] {
    let mut found = [Vec::new(), Vec::new()];
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    for (number, line) in lines.iter().enumerate() {
        // Tests are the last module of a file.
        let next = lines.get(number + 1).copied().unwrap_or_default();
        if line.starts_with("#[cfg(test)]") && next.starts_with("mod ") && next.contains('{') {
            break;
        }
        if line.starts_with("//") {
            continue;
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        for pair in words.windows(2) {
            let kind = match pair[0] {
                "struct" | "enum" | "trait" | "union" => 0,
                "fn" => 1,
                _ => continue,
            };
            let is_part = |c: char| c.is_alphanumeric() || c == '_';
            let name: String = pair[1].chars().take_while(|c| is_part(*c)).collect();
            // Templates of emitted code have their names elsewhere.
            if name.is_empty() {
                continue;
            }
            found[kind].push((name, format!("{file}:{}", number + 1)));
        }
    }
    found
}

/// Definitions of types and of functions in all sources of the project.
fn all_definitions() -> [Vec<Definition>; 2] {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut all = [Vec::new(), Vec::new()];
    let mut open: Vec<PathBuf> = vec![root.clone()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).expect("a folder of the project") {
            let path = entry.expect("an entry of a folder").path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().to_string();
            if path.is_dir() {
                if !SKIPPED.contains(&name.as_str()) && !name.starts_with('.') {
                    open.push(path);
                }
            } else if path.extension().is_some_and(|e| e == "rs") && name != "tests.rs" && !name.ends_with("_tests.rs")
            {
                let text = fs::read_to_string(&path).expect("a source file");
                let file = path.strip_prefix(&root).unwrap_or(&path).display().to_string();
                for (kind, defined) in definitions(&text, &file).into_iter().enumerate() {
                    all[kind].extend(defined);
                }
            }
        }
    }
    assert!(all[0].len() > 1000 && all[1].len() > 5000, "the sources are read");
    all
}

#[test]
fn every_type_has_a_name_of_its_own() {
    let [types, _] = all_definitions();
    let mut places: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (name, place) in types {
        places.entry(name).or_default().push(place);
    }
    let twins: Vec<String> = places
        .into_iter()
        .filter(|(name, places)| places.len() > 1 && !CONVENTIONAL.contains(&name.as_str()))
        .map(|(name, places)| format!("{name}: {}", places.join(", ")))
        .collect();
    assert!(
        twins.is_empty(),
        "these names stand for several types; call all but one otherwise:\n{}",
        twins.join("\n")
    );
}

#[test]
fn no_name_is_a_bare_participle_or_preposition() {
    let bare: Vec<String> = all_definitions()
        .into_iter()
        .flatten()
        .filter(|(name, _)| BARE.contains(&name.to_lowercase().as_str()))
        .map(|(name, place)| format!("{name}: {place}"))
        .collect();
    assert!(
        bare.is_empty(),
        "a type is a noun and a function a verb phrase, see docs/dev/style.md; rename:\n{}",
        bare.join("\n")
    );
}

#[test]
fn definitions_are_seen_and_those_of_tests_are_not() {
    let text = "/// A struct of comments.\npub(crate) struct Told;\nimpl<T> X for Told {\n    pub fn of(self) {}\n}\n#[cfg(test)]\nmod tests { struct Hidden; }\n";
    let [types, functions] = definitions(text, "x.rs");
    assert_eq!(types, [("Told".to_string(), "x.rs:2".to_string())]);
    assert_eq!(functions, [("of".to_string(), "x.rs:4".to_string())]);
}
