//! Cases worked off by several threads, in a folder of their own that is gone afterwards, and arguments of a command.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;

/// Cases that run at the same time.
const WORKERS: usize = 2;

/// What `one` makes of each case, in the order of the cases; the first fault ends all. Each case has a folder.
pub(crate) fn work_off<C: Sync, D: Send>(
    cases: &[C],
    one: impl Fn(&C, &Path) -> Result<D, String> + Sync,
) -> Result<Vec<D>, String> {
    let scratch = std::env::temp_dir().join(format!("modelmill-figures-{}", std::process::id()));
    let at = |path: &Path, error: std::io::Error| format!("{}: {error}", path.display());
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, Result<D, String>)>> = Mutex::new(Vec::new());
    let in_folder = |k: usize| {
        let folder = scratch.join(k.to_string());
        std::fs::create_dir_all(&folder).map_err(|error| at(&folder, error))?;
        let made = one(&cases[k], &folder);
        std::fs::remove_dir_all(&folder).map_err(|error| at(&folder, error))?;
        made
    };
    thread::scope(|scope| {
        for _ in 0..WORKERS {
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

/// Writes a file; a fault says which.
pub(crate) fn write(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
}

/// Options of a command, `--NAME VALUE` each: those that are known, with what they are without.
pub(crate) struct Options(Vec<(&'static str, String)>);

impl Options {
    /// Reads the arguments of the process; fails with what is not known.
    pub(crate) fn read(known: &[(&'static str, &str)]) -> Result<Self, String> {
        let mut options: Vec<(&'static str, String)> = (known.iter())
            .map(|(name, usual)| (*name, (*usual).to_owned()))
            .collect();
        let mut args = std::env::args().skip(1);
        while let Some(arg) = args.next() {
            // Cargo says so to every benchmark.
            if arg == "--bench" {
                continue;
            }
            let name = arg.strip_prefix("--").unwrap_or("");
            let Some(option) = options.iter_mut().find(|(known, _)| *known == name) else {
                let all: Vec<String> = known.iter().map(|(name, _)| format!("--{name}")).collect();
                return Err(format!(
                    "unknown argument `{arg}`; there are {}",
                    all.join(", ")
                ));
            };
            option.1 = args
                .next()
                .ok_or_else(|| format!("{arg} lacks its value"))?;
        }
        Ok(Self(options))
    }

    /// The text of an option.
    pub(crate) fn text(&self, name: &str) -> &str {
        let of = self.0.iter().find(|(known, _)| *known == name);
        of.map_or("", |(_, value)| value)
    }

    /// The number of an option.
    pub(crate) fn number<T: std::str::FromStr>(&self, name: &str) -> Result<T, String> {
        let text = self.text(name);
        text.parse()
            .map_err(|_| format!("--{name}: `{text}` is no number"))
    }

    /// Who is asked: option `program`, or the program of this build.
    pub(crate) fn program(&self) -> PathBuf {
        match self.text("program") {
            "" => PathBuf::from(env!("CARGO_BIN_EXE_modelmill")),
            given => PathBuf::from(given),
        }
    }
}
