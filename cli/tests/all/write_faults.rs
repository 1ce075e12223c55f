//! Every command that writes, with a disk that fails at the n-th step of writing: old files stay complete, nothing is
//! left behind, and the exit status is 1.
//!
//! A small library in C is loaded before the program (`LD_PRELOAD`). It lets the n-th call fail that creates, fills,
//! flushes or renames a partial file.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::common::{model, modelmill, run, scratch};

/// The library: calls on files that end in `.part` are counted, and that of the number `FAIL_AT` fails.
const SHIM: &str = r#"
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int ends(const char *path)
{
    size_t n = path ? strlen(path) : 0;
    return n > 5 && strcmp(path + n - 5, ".part") == 0;
}

static int is_due(int counts)
{
    static int calls;
    const char *at = getenv("FAIL_AT");
    if (!counts || !at || ++calls != atoi(at))
        return 0;
    errno = ENOSPC;
    return 1;
}

static int is_part(int fd)
{
    char link[64], path[4096];
    ssize_t n;
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    n = readlink(link, path, sizeof path - 1);
    path[n > 0 ? n : 0] = 0;
    return ends(path);
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int opened(int (*next)(const char *, int, ...), const char *path, int flags, int mode)
{
    return is_due((flags & O_CREAT) && ends(path)) ? -1 : next(path, flags, mode);
}

#define MODE(mode) int mode; va_list list; va_start(list, flags); mode = va_arg(list, int); va_end(list)

int open(const char *path, int flags, ...) { MODE(mode); return opened(NEXT(open), path, flags, mode); }
int open64(const char *path, int flags, ...) { MODE(mode); return opened(NEXT(open64), path, flags, mode); }
ssize_t write(int fd, const void *from, size_t n) { return is_due(is_part(fd)) ? -1 : NEXT(write)(fd, from, n); }
int fsync(int fd) { return is_due(is_part(fd)) ? -1 : NEXT(fsync)(fd); }
int fchmod(int fd, mode_t mode) { return is_due(is_part(fd)) ? -1 : NEXT(fchmod)(fd, mode); }
int rename(const char *from, const char *to) { return is_due(ends(from)) ? -1 : NEXT(rename)(from, to); }
"#;

/// Most steps of writing that a command of these tests needs.
const MOST_STEPS: usize = 200;

/// The compiled library; `None` without a C compiler or without this way to load it.
fn shim() -> Option<PathBuf> {
    let [source, library] = ["shim.c", "shim.so"].map(|name| PathBuf::from(scratch(&unique(name))));
    std::fs::write(&source, SHIM).unwrap();
    let made = Command::new("cc")
        .args(["-shared", "-fPIC", "-O1", "-o"])
        .args([&library, &source])
        .arg("-ldl")
        .output();
    made.is_ok_and(|made| made.status.success()).then_some(library)
}

/// A name that no other test of this run uses, since tests run at the same time.
fn unique(name: &str) -> String {
    use std::sync::atomic::{AtomicU32, Ordering};
    static COUNT: AtomicU32 = AtomicU32::new(0);
    format!("{}-{name}", COUNT.fetch_add(1, Ordering::Relaxed))
}

/// Names below a folder with the contents of files, in order.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(contents(&path));
        } else {
            let bytes = std::fs::read(&path).unwrap();
            found.push((path, bytes));
        }
    }
    found.sort();
    found
}

/// Runs a command again and again in a folder, with a fault one step later each time, until no step is left.
///
/// The command first runs without a fault, over the files that `prepare` puts into the folder, so that all outputs
/// exist; each output is then marked as old.
fn check(library: &Path, args: &[&str], prepare: &dyn Fn(&Path)) {
    let folder = PathBuf::from(scratch(&unique("faults")));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    prepare(&folder);
    let inputs = contents(&folder);
    let start = |fail_at: Option<usize>| -> Output {
        let mut command = modelmill(args);
        command.current_dir(&folder).env("LD_PRELOAD", library);
        if let Some(n) = fail_at {
            command.env("FAIL_AT", n.to_string());
        }
        command.output().unwrap()
    };
    let complete = start(None);
    let says = String::from_utf8_lossy(&complete.stderr);
    assert!(complete.status.success(), "{args:?}: {says}");
    let outputs = contents(&folder);
    assert_ne!(outputs, inputs, "{args:?} writes nothing");
    // First all outputs are new, then all exist already.
    for exist in [false, true] {
        let reset = || {
            std::fs::remove_dir_all(&folder).unwrap();
            std::fs::create_dir_all(&folder).unwrap();
            for (path, bytes) in if exist { &outputs } else { &inputs } {
                std::fs::create_dir_all(path.parent().unwrap()).unwrap();
                let is_input = inputs.iter().any(|(input, _)| input == path);
                let is_manifest = path.ends_with("Cargo.toml");
                let old: &[u8] = if is_input || is_manifest { bytes } else { b"old" };
                std::fs::write(path, old).unwrap();
            }
            if exist {
                // Edits in place have the input as output.
                for (path, bytes) in &inputs {
                    std::fs::write(path, bytes).unwrap();
                }
            }
            contents(&folder)
        };
        let mut steps = 0;
        for n in 1..=MOST_STEPS {
            let before = reset();
            let ended = start(Some(n));
            let says = String::from_utf8_lossy(&ended.stderr).into_owned();
            if ended.status.success() {
                break;
            }
            steps = n;
            assert_eq!(ended.status.code(), Some(1), "{args:?}, fault {n}: {says}");
            assert!(says.contains("cannot be written"), "{args:?}, fault {n}: {says}");
            assert_eq!(contents(&folder), before, "{args:?}, fault {n}");
        }
        assert!(steps >= 3, "{args:?} has {steps} steps of writing");
        assert!(steps < MOST_STEPS, "{args:?} never ended");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Checks commands; skipped where the library cannot be made.
fn check_all(commands: &[&[&str]], prepare: &dyn Fn(&Path)) {
    let Some(library) = shim() else {
        println!("skipped: no library can be compiled with `cc` here");
        return;
    };
    for args in commands {
        check(&library, args, prepare);
    }
}

#[test]
fn generated_code_is_written_completely_or_not_at_all() {
    let two_link = model("two_link.toml");
    let generate = |language: &'static str| -> Vec<String> {
        let args = ["generate", &two_link, "--language", language, "--out", "out"];
        args.map(str::to_owned).to_vec()
    };
    let c99 = generate("c99");
    let c99: Vec<&str> = c99.iter().map(String::as_str).collect();
    check_all(&[&["generate", &two_link, "--out", "out.rs"], &c99], &|_| {});
}

#[test]
fn files_of_models_are_written_completely_or_not_at_all() {
    let two_link = model("two_link.toml");
    let four_bar = model("four_bar.toml");
    let place = ["--at", "joint1"];
    check_all(
        &[
            &["equations", &two_link, "--out", "out.md"],
            &["check", &two_link, "--picture", "out.svg"],
            &["manual", "--out", "."],
            &["export", &two_link, "--out", "out.urdf"],
            &["atlas", &two_link, &four_bar, "--out", "."],
            &[
                "add",
                &two_link,
                "viscous_friction",
                place[0],
                place[1],
                "--out",
                "out.toml",
            ],
        ],
        &|_| {},
    );
    let copy = |folder: &Path| drop(std::fs::copy(&two_link, folder.join("own.toml")));
    check_all(
        &[&["add", "own.toml", "viscous_friction", place[0], place[1], "--in-place"]],
        &copy,
    );
}

#[test]
fn files_of_recordings_are_written_completely_or_not_at_all() {
    let [spidermill, data] = [model("spidermill.toml"), run("plain-fit.csv")];
    check_all(
        &[&["evaluate", &spidermill, "--data", &data, "--out", "out.csv"]],
        &|_| {},
    );
}
