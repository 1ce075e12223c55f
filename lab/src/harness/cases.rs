//! Cases worked off by several threads, each in a folder of its own that is gone afterwards, with progress on standard error.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;

use super::{make_folder, remove_folder, scratch_folder};

/// Cases that run at the same time where nothing is timed.
pub const WORKERS: usize = 2;

/// What `one` makes of each case, in the order of the cases; the first fault ends all. Each case has a folder.
pub fn work_off<C: Sync, D: Send>(
    cases: &[C],
    workers: usize,
    one: impl Fn(&C, &Path) -> Result<D, String> + Sync,
) -> Result<Vec<D>, String> {
    let scratch = scratch_folder("cases");
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
    // A fault of a case is told, one of cleaning up is none.
    let _ = std::fs::remove_dir_all(&scratch);
    let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
    done.sort_by_key(|(k, _)| *k);
    done.into_iter().map(|(_, made)| made).collect()
}

/// Where the recordings of a case go: where they are kept, by the name of the case, or into its folder that goes.
pub fn folder_of_case(keep: Option<&Path>, name: &str, passing: &Path) -> Result<PathBuf, String> {
    let folder = keep.map_or_else(|| passing.to_owned(), |keep| keep.join(name));
    make_folder(&folder)?;
    Ok(folder)
}
