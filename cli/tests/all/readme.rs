//! What the README and the help show works as it stands.

use std::path::Path;

use crate::common::{printed, workspace};

/// Blocks of a language in the README, in order.
fn blocks(language: &str) -> Vec<String> {
    let text = std::fs::read_to_string(workspace("README.md")).expect("a README");
    text.split("```")
        .skip(1)
        .step_by(2)
        .filter_map(|block| block.strip_prefix(&format!("{language}\n")))
        .map(str::to_owned)
        .collect()
}

#[test]
fn the_model_and_the_variant_of_the_readme_are_whole() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("readme");
    std::fs::create_dir_all(&folder).expect("a folder");
    let files: Vec<String> = blocks("toml")
        .iter()
        .filter(|block| block.starts_with("schema = 1"))
        .zip(["arm.toml", "arm-with-payload.toml"])
        .map(|(block, name)| {
            let path = folder.join(name);
            std::fs::write(&path, block).expect("written");
            path.display().to_string()
        })
        .collect();
    let [arm, variant] = files.as_slice() else {
        panic!("the README shows a model and a variant, not {files:?}");
    };
    assert!(printed(&["check", arm]).contains("sound"));
    let changes = printed(&["diff", arm, variant]);
    assert!(
        changes.contains("- parameter m2: 1.5 kg")
            && changes.contains("+ effect coulomb_friction at elbow"),
        "{changes}"
    );
}

/// The lines of `Cargo.toml` name folders of this workspace and the packages that lie there.
#[test]
fn the_dependencies_of_the_readme_exist() {
    let lines: Vec<(String, String)> = blocks("toml")
        .iter()
        .filter(|block| block.starts_with("[dependencies]"))
        .flat_map(|block| block.lines().map(str::to_owned).collect::<Vec<_>>())
        .filter_map(|line| {
            let (package, rest) = line.split_once(" = {")?;
            let folder = rest.split("../modelmill/").nth(1)?.split('"').next()?;
            Some((package.to_owned(), folder.to_owned()))
        })
        .collect();
    assert_eq!(lines.len(), 2, "{lines:?}");
    for (package, folder) in lines {
        let manifest = std::fs::read_to_string(workspace(&folder).join("Cargo.toml"))
            .unwrap_or_else(|error| panic!("{folder}: {error}"));
        assert!(
            manifest.contains(&format!("name = \"{package}\"")),
            "{folder} holds another package than {package}"
        );
    }
}

/// What `diagnose` prints on the bundled recordings stands in the README; digits of rounding may differ between machines.
#[test]
fn what_the_readme_says_of_the_rods_is_printed() {
    let command = blocks("sh")
        .into_iter()
        .find(|block| block.starts_with("modelmill diagnose"))
        .expect("the command");
    let paths = command.replace('\\', " ");
    let args: Vec<String> = paths
        .split_whitespace()
        .skip(1)
        .map(|word| {
            if word.contains('/') {
                workspace(word).display().to_string()
            } else {
                word.to_owned()
            }
        })
        .collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let printed = printed(&args);
    let shown = blocks("text")
        .into_iter()
        .find(|block| block.starts_with("The model lacks"))
        .expect("the answer");
    let words =
        |line: &str| -> Vec<String> { line.split_whitespace().map(str::to_owned).collect() };
    let same = |a: &str, b: &str| {
        let number = |word: &str| word.trim_end_matches(['.', ',', ';']).parse::<f64>().ok();
        match (number(a), number(b)) {
            (Some(x), Some(y)) if x.abs() > 1e-3 => (x - y).abs() <= 1e-3 * x.abs(),
            (Some(_), Some(y)) => y.abs() < 1e-3,
            _ => a == b,
        }
    };
    for line in shown.lines().filter(|line| !line.is_empty()) {
        let wanted = words(line);
        let found = printed.lines().any(|other| {
            let other = words(other);
            other.len() == wanted.len() && wanted.iter().zip(&other).all(|(a, b)| same(a, b))
        });
        assert!(found, "`{line}` of the README is not in\n{printed}");
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
