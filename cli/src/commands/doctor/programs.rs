//! Finds other programs on the search path, and reads their versions.

use std::env;
use std::ffi::OsStr;
use std::io::Read;
use std::iter;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// Longest time that a program may take to print its version. By judgement: Julia and Python take below a second when
/// their files come from a slow disk.
const VERSION_TIME: Duration = Duration::from_secs(10);

/// Time between two looks at whether a program has ended.
const POLL_TIME: Duration = Duration::from_millis(10);

/// Most bytes of a version that are read.
const MAX_VERSION_BYTES: u64 = 4096;

/// The first of several programs that the search path has. A name with a folder is looked up as it is. None if there
/// is no `PATH`.
pub(super) fn find_program(names: &[&str]) -> Option<PathBuf> {
    names.iter().find_map(|name| find_one(OsStr::new(name)))
}

/// The program that the value of an environment variable names: a name or a path, in which spaces may occur, with or
/// without arguments behind it, such as `ccache gcc`. A separator stands between several programs, of which the first
/// that exists is used.
pub(super) fn find_program_of_value(value: &str, separator: Option<char>) -> Option<PathBuf> {
    find_program_before_arguments(value).or_else(|| value.split(separator?).find_map(find_program_before_arguments))
}

/// The program of the longest start of a text, up to a space or the end, that names one.
fn find_program_before_arguments(text: &str) -> Option<PathBuf> {
    let text = text.trim();
    let ends = text.rmatch_indices(' ').map(|(end, _)| end);
    iter::once(text.len())
        .chain(ends)
        .map(|end| text[..end].trim_end())
        .filter(|start| !start.is_empty())
        .find_map(|start| find_program(&[start]))
}

/// One program on the search path.
fn find_one(name: &OsStr) -> Option<PathBuf> {
    let with_ending = |path: PathBuf| {
        // On Windows, names of programs have an ending that users leave out.
        let mut ended = path.clone().into_os_string();
        ended.push(env::consts::EXE_SUFFIX);
        [path, PathBuf::from(ended)].into_iter().find(|path| is_program(path))
    };
    if Path::new(name).components().count() > 1 {
        return with_ending(PathBuf::from(name));
    }
    env::split_paths(&env::var_os("PATH")?)
        .filter(|folder| folder.is_absolute())
        .find_map(|folder| with_ending(folder.join(name)))
}

/// Whether a path is a file that may be run.
fn is_program(path: &Path) -> bool {
    let Ok(about) = path.metadata() else { return false };
    #[cfg(unix)]
    let is_executable = std::os::unix::fs::PermissionsExt::mode(&about.permissions()) & 0o111 != 0;
    #[cfg(not(unix))]
    let is_executable = true;
    about.is_file() && is_executable
}

/// The output of a program that ends with success within [`VERSION_TIME`], else none. The program gets no input.
pub(super) fn read_output(program: &Path, arguments: &[&str]) -> Option<String> {
    let child = Command::new(program)
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .ok()?;
    let mut child = EndedChild(child);
    let pipe = child.0.stdout.take()?;
    // A version is shorter than what a pipe keeps, so the program never waits for this reader.
    let reader = thread::spawn(move || {
        let mut bytes = Vec::new();
        pipe.take(MAX_VERSION_BYTES).read_to_end(&mut bytes).map(|_| bytes)
    });
    let start = Instant::now();
    let status = loop {
        match child.0.try_wait() {
            Ok(Some(status)) => break status,
            Ok(None) if start.elapsed() < VERSION_TIME => thread::sleep(POLL_TIME),
            _ => return None,
        }
    };
    // A descendant may keep the pipe open after the program has ended.
    while !reader.is_finished() {
        if start.elapsed() > VERSION_TIME {
            return None;
        }
        thread::sleep(POLL_TIME);
    }
    let bytes = reader.join().ok()?.ok()?;
    status.success().then(|| String::from_utf8_lossy(&bytes).into_owned())
}

/// A child process that is ended and waited for wherever its reader returns.
struct EndedChild(Child);

impl Drop for EndedChild {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The first version in a text: numbers with dots, such as `1.89.0`.
pub(super) fn find_version(text: &str) -> Option<String> {
    let words = text.split(|c: char| c.is_whitespace() || "()=,".contains(c));
    words.map(|word| word.trim_start_matches('v')).find_map(|word| {
        let end = word
            .find(|c: char| !c.is_ascii_digit() && c != '.')
            .unwrap_or(word.len());
        let version = word[..end].trim_end_matches('.');
        let has_parts = version.contains('.') && version.split('.').all(|part| !part.is_empty());
        has_parts.then(|| version.to_owned())
    })
}

/// Whether a version is at least another one, number by number; missing numbers are 0.
pub(super) fn is_at_least(version: &str, least: &str) -> bool {
    let numbers = |text: &str| -> Vec<u64> { text.split('.').map(|part| part.parse().unwrap_or(0)).collect() };
    let (mut version, mut least) = (numbers(version), numbers(least));
    let length = version.len().max(least.len());
    version.resize(length, 0);
    least.resize(length, 0);
    version >= least
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_found_in_what_programs_print() {
        for (text, expected) in [
            ("rustc 1.89.0 (29483883e 2025-08-04)", Some("1.89.0")),
            ("Python 3.14.0rc2", Some("3.14.0")),
            ("cc (Debian 14.2.0-19) 14.2.0", Some("14.2.0")),
            ("Apple clang version 17.0.0 (clang-1700.0.13.3)", Some("17.0.0")),
            ("julia version 1.11.6", Some("1.11.6")),
            ("v22.4", Some("22.4")),
            ("pdfTeX 3.141592653-2.6-1.40.26 (TeX Live 2025)", Some("3.141592653")),
            ("no version", None),
            ("...", None),
            ("", None),
        ] {
            assert_eq!(find_version(text).as_deref(), expected, "{text}");
        }
    }

    #[test]
    fn versions_compare_by_numbers() {
        assert!(is_at_least("1.100", "1.89"));
        assert!(is_at_least("1.89", "1.89.0"));
        assert!(is_at_least("3.10.2", "3.10"));
        assert!(!is_at_least("3.9.18", "3.10"));
    }
}
