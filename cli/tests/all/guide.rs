//! README, guide and help are true: chapters and links exist, commands are understood, models are sound, and what is shown as
//! printed is printed.
//!
//! A block of TOML whose first line is `# NAME.toml` is a whole file of that name. A block of text right after one of commands
//! is what they print; `...` stands for what was left out.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use crate::common::markdown::Page;
use crate::common::{modelmill, printed, workspace};
use crate::skills::skill_paths;

fn guide() -> PathBuf {
    workspace("docs/guide/src")
}

/// The chapters by the names of their files, in the order of the summary.
fn chapters() -> Vec<String> {
    let summary = Page::read(&guide().join("SUMMARY.md"));
    summary.targets()
}

/// README, chapters, and pages of tasks for agents.
fn pages() -> Vec<Page> {
    let mut pages = vec![Page::read(&workspace("README.md"))];
    pages.extend(chapters().iter().map(|name| Page::read(&guide().join(name))));
    pages.extend(skill_paths().iter().map(|path| Page::read(path)));
    pages
}

/// A fresh folder below the one for what tests write.
fn fresh(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// Whether the name of a file has that ending.
fn ends_in(name: &str, ending: &str) -> bool {
    Path::new(name).extension().is_some_and(|e| e == ending)
}

/// Writes the whole files of the pages into a folder and gives their names.
fn write_files(pages: &[Page], folder: &Path) -> BTreeSet<String> {
    let mut names = BTreeSet::new();
    for block in pages.iter().flat_map(|page| &page.blocks) {
        let first = block.text.lines().next().unwrap_or_default();
        let name = first.strip_prefix("# ").filter(|name| ends_in(name, "toml"));
        if let Some(name) = name.filter(|_| block.language == "toml") {
            assert!(names.insert(name.to_owned()), "{name} is shown twice");
            fs::write(folder.join(name), &block.text).expect("written");
        }
    }
    names
}

#[test]
fn every_chapter_is_a_file_and_every_file_a_chapter() {
    let chapters = chapters();
    let listed: BTreeSet<String> = chapters.iter().cloned().collect();
    assert_eq!(listed.len(), chapters.len(), "a chapter is listed twice");
    let files: BTreeSet<String> = fs::read_dir(guide())
        .expect("the folder of the guide")
        .map(|entry| entry.expect("an entry").file_name())
        .filter_map(|name| name.into_string().ok())
        .filter(|name| ends_in(name, "md") && name != "SUMMARY.md")
        .collect();
    assert_eq!(listed, files);
}

#[test]
fn every_link_leads_somewhere() {
    let mut pages = pages();
    for name in [
        "AGENTS.md",
        "ARCHITECTURE.md",
        "CONTRIBUTING.md",
        "docs/guide/src/SUMMARY.md",
        "model-spec/README.md",
        "rig/README.md",
    ] {
        pages.push(Page::read(&workspace(name)));
    }
    let mut seen = 0;
    let mut faults = Vec::new();
    for page in &pages {
        for target in page.targets() {
            if target.contains("://") {
                continue;
            }
            seen += 1;
            let (file, anchor) = target.split_once('#').unwrap_or((&target, ""));
            let path = if file.is_empty() {
                page.path.clone()
            } else {
                page.path.with_file_name("").join(file)
            };
            let there = path.exists() && (anchor.is_empty() || Page::read(&path).anchors().contains(anchor));
            if !there {
                faults.push(format!("{}: {target}", page.path.display()));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(seen > 50, "{seen} links");
}

/// Where no file is there, a command that is understood ends with status 1, and one that is not with 2.
#[test]
fn commands_are_understood() {
    let folder = fresh("guide-without-files");
    let mut names = BTreeSet::new();
    for page in pages() {
        for mut words in page.blocks.iter().flat_map(Page::commands) {
            let name = words[0].clone();
            // These need no file.
            if ["tour", "experiment"].contains(&name.as_str()) {
                words.push("--help".to_owned());
            }
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            let output = modelmill(&words).current_dir(&folder).output();
            let output = output.expect("the program starts");
            let said = String::from_utf8_lossy(&output.stderr);
            // A mapping file is an option with a value, and a missing one is an invalid value.
            let is_missing_mapping = output.status.code() == Some(2) && said.contains("'--mapping <FILE.toml>'");
            assert!(
                (matches!(output.status.code(), Some(0 | 1)) || is_missing_mapping) && !said.contains("panicked"),
                "{}: {words:?}: {said}",
                page.path.display()
            );
            names.insert(name);
        }
    }
    let help = printed(&["help"]);
    let commands = help.split("Commands:\n").nth(1).expect("a list of commands");
    let missing: Vec<&str> = commands
        .lines()
        .take_while(|line| !line.is_empty())
        // What a command does may take more than one line.
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|name| !["help", "completions"].contains(name) && !names.contains(*name))
        .collect();
    assert!(missing.is_empty(), "no page shows {missing:?}");
}

#[test]
fn whole_models_are_sound() {
    let folder = fresh("guide-models");
    let names = write_files(&pages(), &folder);
    let mut models = 0;
    for name in &names {
        let path = folder.join(name).display().to_string();
        let text = fs::read_to_string(&path).expect("written");
        if text.contains("\nschema = 1\n") {
            assert!(printed(&["check", &path]).contains(": valid"), "{name}");
            models += 1;
        } else if text.contains("[[effect_kind]]") {
            printed(&["effects", "--library", &path]);
        } else {
            // Limits are read by the command that is shown with them.
            assert!(
                text.contains("[all_positions]"),
                "{name} is no model, library or file of limits"
            );
        }
    }
    assert!(models >= 3, "{names:?}");
}

/// Digits of rounding may differ between machines.
#[test]
fn what_is_shown_as_printed_is_printed() {
    let folder = fresh("guide");
    let pages = pages();
    write_files(&pages, &folder);
    let root = format!("{}/", workspace("").display()).replace("//", "/");
    let mut shown = 0;
    let mut faults = String::new();
    for page in &pages {
        for pair in page.blocks.windows(2) {
            let commands = Page::commands(&pair[0]);
            if commands.is_empty() || pair[1].language != "text" || !pair[1].follows {
                continue;
            }
            let mut out = String::new();
            for words in commands {
                let words: Vec<String> = words
                    .iter()
                    .map(|word| {
                        let bundled = ["model-spec/", "recordings/"];
                        let ours = bundled.iter().any(|folder| word.starts_with(folder));
                        if ours { format!("{root}{word}") } else { word.clone() }
                    })
                    .collect();
                let words: Vec<&str> = words.iter().map(String::as_str).collect();
                let output = modelmill(&words).current_dir(&folder).output();
                let output = output.expect("the program starts");
                let said = String::from_utf8_lossy(&output.stderr);
                assert!(output.status.success(), "{words:?}: {said}");
                out.push_str(&String::from_utf8_lossy(&output.stdout));
                out.push_str(&said);
            }
            let out = out.replace(&root, "");
            let mut lines = out.lines();
            for line in pair[1].text.lines() {
                if !line.is_empty() && line != "..." {
                    let found = lines.any(|other| same_words(line, other));
                    if !found {
                        // Lines are compared in their order, so the next ones would be missed too.
                        let _ = writeln!(faults, "{}: `{line}` is not in\n{out}", page.path.display());
                        break;
                    }
                }
            }
            shown += 1;
        }
    }
    assert!(faults.is_empty(), "{faults}");
    assert!(shown >= 8, "{shown} answers are shown");
}

/// Whether two lines have the same words, and numbers that are close: to a thousandth, or to the last digit where that is
/// coarser. Those near zero are rounding.
fn same_words(a: &str, b: &str) -> bool {
    let same = |a: &str, b: &str| {
        let bare = |word: &str| word.trim_end_matches(['.', ',', ';']).to_owned();
        let number = |word: &str| bare(word).parse::<f64>().ok();
        let decimals = bare(a).split_once('.').map(|(_, digits)| digits.len());
        let last_digit = decimals.map_or(0.0, |n| 0.1_f64.powi(n.try_into().unwrap_or(i32::MAX)));
        match (number(a), number(b)) {
            (Some(x), Some(y)) if x.abs() > 1e-3 => (x - y).abs() <= (1e-3 * x.abs()).max(1.1 * last_digit),
            (Some(_), Some(y)) => y.abs() < 1e-3,
            _ => a == b,
        }
    };
    let (a, b): (Vec<&str>, Vec<&str>) = (a.split_whitespace().collect(), b.split_whitespace().collect());
    a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| same(a, b))
}

/// Lines of a `Cargo.toml` name folders of this workspace and the packages that lie there.
#[test]
fn the_dependencies_that_are_shown_exist() {
    let lines: Vec<(String, String)> = pages()
        .iter()
        .flat_map(|page| &page.blocks)
        .filter(|block| block.language == "toml" && block.text.starts_with("[dependencies]"))
        .flat_map(|block| block.text.lines().map(str::to_owned).collect::<Vec<_>>())
        .filter_map(|line| {
            let (package, rest) = line.split_once(" = {")?;
            let folder = rest.split("../modelmill/").nth(1)?.split('"').next()?;
            Some((package.to_owned(), folder.to_owned()))
        })
        .collect();
    assert_eq!(lines.len(), 3, "{lines:?}");
    for (package, folder) in lines {
        let manifest = fs::read_to_string(workspace(&folder).join("Cargo.toml"))
            .unwrap_or_else(|error| panic!("{folder}: {error}"));
        assert!(
            manifest.contains(&format!("name = \"{package}\"")),
            "{folder} holds another package than {package}"
        );
    }
}

/// Examples with a path are meant for the project's root.
#[test]
fn paths_in_the_help_exist() {
    for command in [
        "check",
        "diff",
        "equations",
        "generate",
        "evaluate",
        "identify",
        "compare",
        "excite",
        "interpret",
    ] {
        let help = printed(&["help", command]);
        assert_eq!(help, printed(&[command, "--help"]));
        let paths: Vec<&str> = help
            .split_whitespace()
            .filter(|word| {
                let end = Path::new(word).extension();
                word.contains('/') && end.is_some_and(|end| end == "toml" || end == "csv")
            })
            .collect();
        assert!(!paths.is_empty(), "{command} shows no path:\n{help}");
        for path in paths {
            assert!(workspace(path).is_file(), "{command}: there is no {path}");
        }
    }
}
