//! Parallel processing of cases: cases and a function go in; results in the order of the cases come out.
//!
//! Each case has its own temporary folder. Progress goes to standard error.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;

use super::{make_folder, remove_folder, scratch_folder};

/// Number of cases that run at the same time in benchmarks without timing.
pub const WORKERS: usize = 2;

/// Calls `one` for each case with a temporary folder, and returns the results in the order of the cases.
///
/// The first error stops the remaining cases and is returned.
pub fn work_off<C: Sync, D: Send>(
    cases: &[C],
    workers: usize,
    one: impl Fn(&C, &Path) -> Result<D, String> + Sync,
) -> Result<Vec<D>, String> {
    let scratch = scratch_folder("cases");
    // Number of the next case, and results so far with the numbers of their cases.
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, Result<D, String>)>> = Mutex::new(Vec::new());
    let in_folder = |k: usize| {
        let folder = scratch.join(k.to_string());
        make_folder(&folder)?;
        let made = one(&cases[k], &folder);
        remove_folder(&folder)?;
        made
    };
    thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                loop {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    if k >= cases.len() {
                        break;
                    }
                    let made = in_folder(k);
                    // After an error no thread starts another case.
                    if made.is_err() {
                        next.store(cases.len(), Ordering::Relaxed);
                    }
                    let mut all = done.lock().unwrap_or_else(PoisonError::into_inner);
                    all.push((k, made));
                    eprint!("\r{} of {} ", all.len(), cases.len());
                }
            });
        }
    });
    eprintln!();
    // A temporary folder that cannot be removed is not an error of the benchmark.
    let _ = std::fs::remove_dir_all(&scratch);
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(k, _)| *k);
    done.into_iter().map(|(_, made)| made).collect()
}

/// Creates the folder for the recordings of a case: a folder in `keep` with its name, or the temporary one, `passing`.
pub fn folder_of_case(keep: Option<&Path>, name: &str, passing: &Path) -> Result<PathBuf, String> {
    let folder = keep.map_or_else(|| passing.to_owned(), |keep| keep.join(name));
    make_folder(&folder)?;
    Ok(folder)
}
