//! This crate's own source, for crates that are passed on in a folder of their own.

/// Path inside the crate's folder and text of every file.
pub const FILES: [(&str, &str); 25] = [
    ("Cargo.toml", MANIFEST),
    ("src/arithmetic.rs", include_str!("arithmetic.rs")),
    ("src/blocks.rs", include_str!("blocks.rs")),
    ("src/geometry.rs", include_str!("geometry.rs")),
    ("src/lanes.rs", include_str!("lanes.rs")),
    ("src/lib.rs", include_str!("lib.rs")),
    ("src/live/averages.rs", include_str!("live/averages.rs")),
    ("src/live/comparison.rs", include_str!("live/comparison.rs")),
    ("src/live/emitted.rs", include_str!("live/emitted.rs")),
    ("src/live/estimator.rs", include_str!("live/estimator.rs")),
    ("src/live/mod.rs", include_str!("live/mod.rs")),
    ("src/live/options.rs", include_str!("live/options.rs")),
    ("src/live/scatter.rs", include_str!("live/scatter.rs")),
    ("src/live/watch.rs", include_str!("live/watch.rs")),
    ("src/loops.rs", include_str!("loops.rs")),
    ("src/model.rs", include_str!("model.rs")),
    ("src/numbers.rs", include_str!("numbers.rs")),
    ("src/parallel.rs", include_str!("parallel.rs")),
    ("src/random.rs", include_str!("random.rs")),
    ("src/reactions.rs", include_str!("reactions.rs")),
    ("src/real.rs", include_str!("real.rs")),
    ("src/self_test.rs", include_str!("self_test.rs")),
    ("src/solve.rs", include_str!("solve.rs")),
    (
        "src/source.rs",
        "//! Empty in this copy: the project keeps the texts of the sources here.\n",
    ),
    ("src/wide.rs", include_str!("wide.rs")),
];

/// The manifest for use outside of the project's workspace.
const MANIFEST: &str = r#"[package]
name = "modelmill-runtime"
description = "What emitted models need at run time"
version = "0.1.0"
edition = "2024"
rust-version = "1.89"
license = "MIT OR Apache-2.0"
publish = false

[features]
std = ["dep:pulp"]
rayon = ["std", "dep:rayon"]
source = []

[dependencies]
libm = "0.2"
pulp = { version = "0.22", default-features = false, features = ["std", "x86-v3", "x86-v4"], optional = true }
rayon = { version = "1.12", optional = true }
"#;

#[cfg(test)]
mod tests {
    extern crate std;
    use std::path::Path;

    use super::*;

    #[test]
    fn no_file_is_missing() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut names = std::vec::Vec::from([std::string::String::from("Cargo.toml")]);
        for below in ["src", "src/live"] {
            for entry in std::fs::read_dir(folder.join(below)).unwrap() {
                let path = entry.unwrap().path();
                if path.is_file() {
                    let name = path.file_name().unwrap().to_str().unwrap();
                    names.push(std::format!("{below}/{name}"));
                }
            }
        }
        names.sort();
        let mut listed = FILES.map(|f| f.0).to_vec();
        listed.sort_unstable();
        assert_eq!(names, listed);
    }
}
