//! The atlas in `docs` says what the mill finds today.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::common::{printed, scratch, workspace};

/// Those that take long to derive without optimisation are left to the command that writes the atlas.
const LONG: [&str; 6] = [
    "humanoid",
    "quadruped",
    "gough_stewart",
    "gough_stewart_tied",
    "delta",
    "delta_tied",
];

fn models() -> BTreeMap<String, PathBuf> {
    let files = std::fs::read_dir(workspace("model-spec/models")).expect("models");
    let files = files.map(|file| file.expect("a file").path());
    let models = files.filter(|path| path.extension().is_some_and(|ending| ending == "toml"));
    models
        .map(|path| {
            let name = path.file_stem().expect("a name").to_string_lossy();
            (name.into_owned(), path)
        })
        .collect()
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The lines of a table by the name of the mechanism, without the seconds.
fn rows(page: &str) -> BTreeMap<String, String> {
    let rows = page.lines().filter(|line| line.starts_with("| ![]"));
    rows.map(|line| {
        let name = line.split('`').nth(1).expect("a name");
        let cells = line.trim_end_matches(" |").rsplit_once(" | ");
        (name.to_owned(), cells.expect("cells").0.to_owned())
    })
    .collect()
}

#[test]
fn every_bundled_model_is_in_the_atlas() {
    let mut written = rows(&read(&workspace("docs/atlas.md")));
    written.retain(|_, row| !row.contains("(imported)"));
    let names: Vec<&String> = written.keys().collect();
    assert_eq!(names, models().keys().collect::<Vec<_>>());
    for name in names {
        for ending in ["svg", "md"] {
            let file = workspace(&format!("docs/atlas/{name}.{ending}"));
            assert!(file.exists(), "{}", file.display());
        }
    }
}

#[test]
fn figures_of_the_atlas_are_those_of_the_mill() {
    let out = scratch("atlas");
    let models = models();
    let short = models.iter().filter(|(name, _)| !LONG.contains(&name.as_str()));
    let paths: Vec<String> = short.map(|(_, path)| path.display().to_string()).collect();
    let mut command = vec!["atlas"];
    command.extend(paths.iter().map(String::as_str));
    command.extend(["--out", &out]);
    printed(&command);
    let out = Path::new(&out);
    let written = rows(&read(&workspace("docs/atlas.md")));
    for (name, row) in rows(&read(&out.join("atlas.md"))) {
        assert_eq!(Some(&row), written.get(&name), "write the atlas again");
        let page = format!("atlas/{name}.md");
        let found = read(&out.join(&page));
        let expected = read(&workspace("docs").join(&page));
        assert_eq!(found, expected, "{name}: write the atlas again");
    }
}

/// Robots of other people are no part of the project; where they are, the atlas says of them what the mill finds.
#[test]
fn figures_of_imported_robots_are_those_of_the_mill() {
    /// These take minutes without optimisation.
    const LONG: [&str; 3] = ["sawyer_mj", "aloha_mj", "shadow_hand_mj"];
    let robots = workspace("../shared/zoo");
    if !robots.exists() {
        eprintln!("../shared/zoo is absent: nothing is tested");
        return;
    }
    let mut written = rows(&read(&workspace("docs/atlas.md")));
    written.retain(|name, row| row.contains("(imported)") && !LONG.contains(&name.as_str()));
    assert!(!written.is_empty());
    let description = |name: &String| {
        let file = |ending: &&str| robots.join(name).join(format!("{name}.{ending}"));
        let files = ["urdf", "xml", "sdf"].iter().map(file);
        let mut found = files.filter(|file| file.exists());
        found.next().expect("a description").to_string_lossy().into_owned()
    };
    let out = scratch("atlas_of_imported");
    let files: Vec<String> = written.keys().map(description).collect();
    let mut command = vec!["atlas"];
    command.extend(files.iter().map(String::as_str));
    command.extend(["--out", &out]);
    printed(&command);
    let found = rows(&read(&Path::new(&out).join("atlas.md")));
    assert_eq!(found, written, "write the atlas again");
}

/// Titles and names of files have no meaning as Markdown.
#[test]
fn texts_of_models_are_no_markdown() {
    let text = std::fs::read_to_string(crate::common::model("two_link.toml")).unwrap();
    let hostile = "<script>alert(1)</script> [x](javascript:alert(1)) \\u001b[31m line\\nEVIL \\u202erev | `id`";
    let title = text.lines().find(|line| line.starts_with("title")).unwrap();
    let model = scratch("a_[b](c).toml");
    std::fs::write(&model, text.replacen(title, &format!("title = \"{hostile}\""), 1)).unwrap();
    let out = scratch("hostile-atlas");
    printed(&["atlas", &model, "--out", &out]);
    let table = std::fs::read_to_string(Path::new(&out).join("atlas.md")).unwrap();
    assert!(table.contains("(atlas/a_%5Bb%5D%28c%29.md)"), "{table}");
    let page = std::fs::read_to_string(Path::new(&out).join("atlas").join("a_[b](c).md")).unwrap();
    assert!(
        page.contains(r"\<script>") && page.contains(r"\[x\](javascript"),
        "{page}"
    );
    assert!(
        !page.contains(['\u{1b}', '\u{202e}']) && !page.contains("\nEVIL"),
        "{page}"
    );
}
