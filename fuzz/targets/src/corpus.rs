//! The files from which mutations start: bundled files of the repository, and those in `fuzz/corpus`.

use std::io;
use std::path::{Path, PathBuf};

use crate::targets::FuzzTarget;

/// The root of the repository.
pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The contents of all files of a target, sorted by name. Fails when one of them cannot be read.
pub fn read_corpus(target: &FuzzTarget) -> io::Result<Vec<(PathBuf, Vec<u8>)>> {
    let root = repository();
    let mut paths = Vec::new();
    for seed in target.seeds {
        let path = root.join(seed);
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        match (name.split_once('*'), path.parent()) {
            (Some((begin, end)), Some(folder)) => {
                let fits = |path: &PathBuf| {
                    let name = path.file_name().unwrap_or_default().to_string_lossy();
                    name.starts_with(begin) && name.ends_with(end)
                };
                paths.extend(files_of(folder)?.into_iter().filter(fits));
            }
            _ => paths.push(path),
        }
    }
    let own = root.join("fuzz/corpus").join(target.name);
    if own.is_dir() {
        paths.extend(files_of(&own)?);
    }
    let read = |path: PathBuf| std::fs::read(&path).map(|bytes| (path, bytes));
    paths.into_iter().map(read).collect()
}

/// The files of a folder, sorted.
fn files_of(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_file() {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}
