//! The harness of benchmarks: command line, parallel processing of cases, calls of the tested program, and files.

mod cases;
mod options;
mod program;

use std::path::{Path, PathBuf};

pub use cases::{WORKERS, folder_of_case, work_off};
pub use options::{BenchmarkOptions, BenchmarkUsage, run_benchmark};
pub use program::{ProgramFault, TestedProgram};

/// A path relative to the folder of the project, such as `../shared` for a folder next to it.
pub fn in_project(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// The path of a temporary folder for this process and benchmark; the folder is not created.
pub fn scratch_folder(benchmark: &str) -> PathBuf {
    std::env::temp_dir().join(format!("modelmill-{benchmark}-{}", std::process::id()))
}

/// Reads a file; an error names it.
pub fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))
}

/// Writes a file and creates its folder if necessary; an error names the file or folder.
pub fn write(path: &Path, text: &str) -> Result<(), String> {
    make_folder(path.parent().unwrap_or(path))?;
    std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
}

/// Creates a folder with its parents; an error names it.
pub fn make_folder(path: &Path) -> Result<(), String> {
    std::fs::create_dir_all(path).map_err(|error| format!("{}: {error}", path.display()))
}

/// Removes a folder with its contents; an error names it.
pub fn remove_folder(path: &Path) -> Result<(), String> {
    std::fs::remove_dir_all(path).map_err(|error| format!("{}: {error}", path.display()))
}
