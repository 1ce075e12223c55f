//! The harness of benchmarks: their options, cases worked off by several threads, the program that is asked, and files.

mod cases;
mod options;
mod program;

use std::path::{Path, PathBuf};

pub use cases::{WORKERS, folder_of_case, work_off};
pub use options::{BenchmarkOptions, BenchmarkUsage, run_benchmark};
pub use program::{ProgramFault, TestedProgram};

/// A path below the project's own folder, or beside it: `../shared`.
pub fn in_project(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// A fresh folder for what a benchmark writes and takes away in the end.
pub fn scratch_folder(benchmark: &str) -> PathBuf {
    std::env::temp_dir().join(format!("modelmill-{benchmark}-{}", std::process::id()))
}

/// Reads a file; a fault says which.
pub fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))
}

/// Writes a file, in a folder that is made if need be; a fault says which.
pub fn write(path: &Path, text: &str) -> Result<(), String> {
    make_folder(path.parent().unwrap_or(path))?;
    std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
}

/// Makes a folder with those above it; a fault says which.
pub fn make_folder(path: &Path) -> Result<(), String> {
    std::fs::create_dir_all(path).map_err(|error| format!("{}: {error}", path.display()))
}

/// Removes a folder with all that it holds; a fault says which.
pub fn remove_folder(path: &Path) -> Result<(), String> {
    std::fs::remove_dir_all(path).map_err(|error| format!("{}: {error}", path.display()))
}
