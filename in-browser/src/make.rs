//! Builds the page: compiles the workbench to WebAssembly and writes it into one file with the bundled models.
//!
//! Decision: a page from a disk has no server that could set a policy. So it declares its own: no connections, and
//! workers and WebAssembly only from itself.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use modelmill_workbench::{PageBundle, standalone_page};

/// The target of the compiler for the workbench.
pub const TARGET: &str = "wasm32-unknown-unknown";

/// The root folder of the workspace.
fn workspace_root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Why the compiler cannot build for WebAssembly, with a remedy; `None` if it can.
pub fn missing_target() -> Option<String> {
    let asked = ["--print", "target-libdir", "--target", TARGET];
    let output = Command::new("rustc").args(asked).output().ok();
    let library = output.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    let is_there = library.is_some_and(|path| !path.is_empty() && Path::new(&path).is_dir());
    (!is_there).then(|| format!("the compiler has no target {TARGET}; run `rustup target add {TARGET}` first"))
}

/// Compiles the workbench in a profile that the workspace defines, into the folder `builds`; returns the path of the module.
///
/// Fails with a sentence if the compiler fails.
pub fn build_module(profile: &str, builds: &Path) -> Result<PathBuf, String> {
    if let Some(lacks) = missing_target() {
        return Err(lacks);
    }
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let status = Command::new(cargo)
        .args(["build", "--locked", "--package", env!("CARGO_PKG_NAME"), "--lib"])
        .args(["--target", TARGET, "--profile", profile, "--target-dir"])
        .arg(builds)
        .current_dir(workspace_root())
        .status()
        .map_err(|error| format!("cargo cannot be run: {error}"))?;
    if !status.success() {
        return Err(format!(
            "the workbench cannot be compiled for {TARGET}; see the messages of the compiler above"
        ));
    }
    let name = format!("{}.wasm", env!("CARGO_CRATE_NAME"));
    Ok(builds.join(TARGET).join(profile).join(name))
}

/// All bundled models, and the recordings of the robot with rods, which its model lacks.
///
/// Fails with a sentence if a file cannot be read.
pub fn load_bundle() -> Result<PageBundle, String> {
    let text = |path: &Path| fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()));
    let folder = workspace_root().join("model-spec/models");
    let entries = fs::read_dir(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.retain(|path| path.extension().is_some_and(|e| e == "toml"));
    paths.sort();
    let mut bundle = PageBundle::default();
    for path in paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        bundle.models.push((name.into_owned(), text(&path)?));
    }
    for (name, is_check) in [("with-rods-fit.csv", false), ("with-rods-check.csv", true)] {
        let text = text(&workspace_root().join("recordings/spidermill-mbs").join(name))?;
        let model = "spidermill.toml".to_owned();
        bundle.recordings.push((model, name.to_owned(), text, is_check));
    }
    Ok(bundle)
}

/// The page with a module inside.
///
/// Fails with a sentence if a file cannot be read.
pub fn build_page(module: &Path) -> Result<String, String> {
    let module = fs::read(module).map_err(|error| format!("{}: {error}", module.display()))?;
    Ok(standalone_page(&strip_custom_sections(&module), &load_bundle()?))
}

/// A module without its custom sections, which contain names and lines for debuggers. A module consists of eight bytes
/// and then sections, each with a byte for its kind (0: custom) and its length in LEB128 (WebAssembly core
/// specification 2.0, 5.5.2).
fn strip_custom_sections(module: &[u8]) -> Vec<u8> {
    let (head, mut rest) = module.split_at(8.min(module.len()));
    let mut kept = head.to_vec();
    while let [kind, after @ ..] = rest {
        let digits = 1 + after.iter().take_while(|byte| **byte >= 0x80).count();
        let digits = digits.min(after.len());
        let length = (after[..digits].iter().rev()).fold(0, |n, byte| n << 7 | usize::from(byte & 0x7f));
        let end = rest.len().min(1 + digits + length);
        if *kind != 0 {
            kept.extend(&rest[..end]);
        }
        rest = &rest[end..];
    }
    kept
}
