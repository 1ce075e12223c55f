//! What is published can stand alone: metadata, licences, and no file from outside a crate's own folder. Pages for contributors
//! name files that exist.
//!
//! Decision: a published crate holds what it is built from and nothing else. Tests and benchmarks read models,
//! recordings and fixtures of other crates, so they stay in the workspace (`include` in each `Cargo.toml`). A text
//! that several crates need has one owner: models and the schema belong to `model-spec`, recordings to a crate of
//! texts.

use std::fs;
use std::path::{Path, PathBuf};

/// The workspace.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn text(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Folder and manifest of every member of the workspace.
fn members() -> Vec<(PathBuf, String)> {
    let manifest = text(&root().join("Cargo.toml"));
    let line = manifest.lines().find(|line| line.starts_with("members = "));
    let names = line.expect("a list of members").split('"');
    let folders = names.skip(1).step_by(2).map(|name| root().join(name));
    folders
        .map(|folder| (folder.clone(), text(&folder.join("Cargo.toml"))))
        .collect()
}

/// Those that are published.
fn published() -> Vec<(PathBuf, String)> {
    let mut all = members();
    all.retain(|(_, manifest)| !manifest.contains("\npublish = false\n"));
    assert!(all.len() > 10, "{} crates are published", all.len());
    all
}

/// Files below a folder that end so.
fn files(folder: &Path, ending: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(&next).unwrap_or_else(|e| panic!("{}: {e}", next.display())) {
            let path = entry.expect("an entry of a folder").path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == ending) {
                found.push(path);
            }
        }
    }
    found
}

#[test]
fn every_published_crate_says_what_it_is() {
    for (folder, manifest) in published() {
        for key in [
            "description",
            "documentation",
            "readme",
            "keywords",
            "categories",
            "license.workspace",
            "repository.workspace",
            "rust-version.workspace",
        ] {
            let is_there = manifest.contains(&format!("\n{key} = "));
            assert!(is_there, "{} has no {key}", folder.display());
        }
        assert!(manifest.contains("\ninclude"), "{}", folder.display());
        assert!(folder.join("README.md").is_file(), "{}", folder.display());
    }
}

/// A manifest that builds no test program of a library or of a program would hide tests in it.
#[test]
fn crates_without_a_test_program_have_no_unit_tests() {
    let without: Vec<(PathBuf, String)> = (members().into_iter())
        .filter(|(_, manifest)| manifest.contains("\ntest = false\n"))
        .collect();
    assert!(without.len() > 3, "{} crates build no test program", without.len());
    for path in without.iter().flat_map(|(folder, _)| files(&folder.join("src"), "rs")) {
        assert!(
            !text(&path).contains("#[test]"),
            "{} has tests that nobody runs",
            path.display()
        );
    }
}

/// Whether the documentation of a library holds code that `rustdoc` would run.
fn has_documented_examples(folder: &Path) -> bool {
    let opens_code = |line: &str| {
        let comment = line
            .trim_start()
            .strip_prefix("///")
            .or(line.trim_start().strip_prefix("//!"));
        let language = comment.and_then(|comment| comment.trim_start().strip_prefix("```"));
        language.is_some_and(|language| !["text", "sql", "toml", "sh", "json"].contains(&language.trim()))
    };
    (files(&folder.join("src"), "rs").iter()).any(|file| {
        let text = text(file);
        // The same line closes a block, so blocks of another language are passed over as a whole.
        let mut is_open = false;
        text.lines().any(|line| {
            let is_fence = line
                .trim_start()
                .trim_start_matches(['/', '!'])
                .trim_start()
                .starts_with("```");
            let is_comment = line.trim_start().starts_with("//");
            if !(is_fence && is_comment) {
                return false;
            }
            is_open = !is_open;
            is_open && opens_code(line)
        })
    })
}

/// `rustdoc` reads a whole library to find its examples: where there are none, its manifest says so, and only there.
#[test]
fn documentation_is_tested_where_it_has_examples() {
    let libraries: Vec<(PathBuf, String)> = (members().into_iter())
        .filter(|(folder, _)| folder.join("src/lib.rs").exists())
        .collect();
    assert!(libraries.len() > 15, "{} libraries", libraries.len());
    for (folder, manifest) in &libraries {
        let is_untested = manifest.contains("\ndoctest = false\n");
        assert_eq!(
            is_untested,
            !has_documented_examples(folder),
            "{}: `doctest = false` belongs into the manifests of libraries without examples, and of no other",
            folder.display()
        );
    }
}

/// They are copies, since not every system that checks a repository out knows links.
#[test]
fn licences_are_those_of_the_project() {
    let folders = published().into_iter().map(|(folder, _)| folder);
    for folder in folders.chain([root().join("python")]) {
        for name in ["LICENSE-MIT", "LICENSE-APACHE"] {
            let is_same = text(&folder.join(name)) == text(&root().join(name));
            assert!(is_same, "{}: {name} is another text", folder.display());
        }
    }
}

#[test]
fn no_published_crate_takes_a_file_from_outside_its_folder() {
    let mut seen = 0;
    for (folder, _) in published() {
        for file in files(&folder, "rs") {
            let below = file.strip_prefix(&folder).expect("below the folder");
            if !below.starts_with("src") && below != Path::new("lib.rs") {
                continue;
            }
            let depth = below.components().count() - 1;
            let text = text(&file);
            let macros = ["include_str!(", "include_bytes!(", "include!("];
            for rest in macros.iter().flat_map(|one| text.split(one).skip(1)) {
                // What is put together from pieces lies where the build puts it.
                let Some(rest) = rest.trim_start().strip_prefix('"') else {
                    continue;
                };
                let path = rest.split('"').next().unwrap_or_default();
                let up = path.split('/').take_while(|part| *part == "..").count();
                assert!(up <= depth, "{} takes {path}", file.display());
                seen += 1;
            }
        }
    }
    assert!(seen > 20, "{seen} files are part of crates");
}

/// A dependency with a version would be looked for where crates are published.
#[test]
fn crates_that_are_not_published_have_no_version_to_depend_on() {
    let manifest = text(&root().join("Cargo.toml"));
    for (folder, own) in members() {
        let name = own.split("name = \"").nth(1).and_then(|rest| rest.split('"').next());
        let name = name.expect("a name");
        let line = format!("\n{name} = {{ path");
        let Some(rest) = manifest.split(&line).nth(1) else {
            continue;
        };
        let has_version = rest.lines().next().is_some_and(|line| line.contains("version"));
        let is_published = !own.contains("\npublish = false\n");
        assert_eq!(has_version, is_published, "{}", folder.display());
    }
}

/// The pages for contributors: the overview, how to contribute, and the folder of details.
fn developer_pages() -> Vec<PathBuf> {
    let mut pages = files(&root().join("docs/dev"), "md");
    assert!(pages.len() > 12, "{} pages of details", pages.len());
    pages.sort();
    pages.extend(["ARCHITECTURE.md", "CONTRIBUTING.md"].map(|name| root().join(name)));
    pages
}

/// A page without its blocks of code, which name files that a reader makes.
fn prose(page: &str) -> String {
    page.split("```").step_by(2).collect()
}

/// Words between backticks that are paths: names with a slash or an extension, and nothing that only code has.
fn paths_in_backticks(prose: &str) -> Vec<&str> {
    let is_path = |word: &&str| {
        let plain = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
        let extensions = ["rs", "md", "toml", "json", "js", "css", "py", "pyi", "sh"];
        let extension = Path::new(word).extension().and_then(|e| e.to_str());
        let is_file = extension.is_some_and(|e| extensions.contains(&e));
        !word.is_empty() && word.chars().all(plain) && (word.contains('/') || is_file)
    };
    let words = prose.split('`').skip(1).step_by(2);
    words.filter(is_path).collect()
}

/// What links lead to in the repository, without anchors.
fn link_targets(prose: &str) -> Vec<&str> {
    let rest = prose.split("](").skip(1);
    let targets = rest.filter_map(|rest| rest.split_once(')'));
    let files = targets.map(|(target, _)| target.split('#').next().unwrap_or_default());
    files.filter(|file| !file.is_empty() && !file.contains("://")).collect()
}

#[test]
fn the_overview_stays_short() {
    let bytes = text(&root().join("ARCHITECTURE.md")).len();
    assert!(bytes <= 12_000, "ARCHITECTURE.md has {bytes} bytes");
}

#[test]
fn the_overview_names_every_folder_of_the_workspace() {
    let overview = text(&root().join("ARCHITECTURE.md"));
    for (folder, _) in members() {
        let below = folder.strip_prefix(root()).expect("below the workspace");
        let top = below.iter().next().expect("a folder").to_string_lossy();
        let row = format!("\n| `{top}` | ");
        assert!(overview.contains(&row), "the code map has no row for {top}");
    }
}

#[test]
fn every_path_that_developer_pages_name_exists() {
    let mut seen = 0;
    let mut faults = Vec::new();
    for page in developer_pages() {
        let prose = prose(&text(&page));
        let here = page.with_file_name("");
        let named = paths_in_backticks(&prose).into_iter();
        let linked = link_targets(&prose).into_iter();
        let paths = named
            .map(|path| (path, root().join(path)))
            .chain(linked.map(|path| (path, here.join(path))));
        for (name, path) in paths {
            seen += 1;
            if !path.exists() {
                faults.push(format!("{}: {name}", page.display()));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(seen > 150, "{seen} paths");
}

#[test]
fn paths_are_distinguished_from_code() {
    let page = "Read `a/b.rs`, `mod.rs` and [c](../c.md#top), not `x/2 + y`, `name` or [d](https://d.org).\n\
                ```\n`no/path` [none](none.md)\n```\nAnd `e/f`.\n";
    let prose = prose(page);
    assert_eq!(paths_in_backticks(&prose), ["a/b.rs", "mod.rs", "e/f"]);
    assert_eq!(link_targets(&prose), ["../c.md"]);
}
