//! Advice in messages of the libraries is data (`Remedy`), which each front end writes in its own way. So no text in
//! their sources names a flag of the program or writes an option or a command by hand.

use std::path::{Path, PathBuf};

use crate::common::workspace;

/// Crates whose messages all front ends show.
const LIBRARIES: [&str; 4] = ["model-spec/src", "identify/src", "reduction/src", "modelmill/src"];

/// The wording for callers of the library.
const RUST_WORDING: &str = "modelmill/src/print/wording.rs";

/// Rust files below a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).expect("a folder of sources") {
        let path = entry.expect("an entry of a folder").path();
        if path.is_dir() {
            found.extend(sources(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
    found
}

#[test]
fn no_library_writes_advice_by_hand() {
    let mut files = 0;
    let mut faults = Vec::new();
    for path in LIBRARIES.iter().flat_map(|folder| sources(&workspace(folder))) {
        if path.ends_with(RUST_WORDING) {
            continue;
        }
        files += 1;
        let text = std::fs::read_to_string(&path).expect("a source");
        let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        for (number, line) in text.lines().enumerate() {
            let line = line.trim();
            let is_comment = line.starts_with("//");
            let spelled = ["`--", "option `", "options `", "verb `"];
            if !is_comment && spelled.iter().any(|start| line.contains(start)) {
                faults.push(format!("{}:{}: {line}", path.display(), number + 1));
            }
        }
    }
    assert!(files > 200, "{files} sources are read");
    assert!(faults.is_empty(), "use a `Remedy`:\n{}", faults.join("\n"));
}
