//! Every command that writes, with a disk that fails at the n-th step of writing: old files stay complete, nothing is
//! left behind, and the exit status is 1. The same for a disk that fails at the n-th step of reading.
//!
//! A small library in C is loaded before the program (`LD_PRELOAD`). It lets the n-th call fail that creates, fills,
//! flushes or renames a partial file, or that reads a file of the user.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::common::{model, modelmill, run, scratch};

/// The library: calls on files that end in `.part` are counted, and that of the number `FAIL_AT` fails. Calls that read
/// files below no folder of the system are counted too, and that of the number `FAIL_READ_AT` fails.
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
static int is_read_due(int fd)
{
    static int calls;
    static const char *const system[] = {"/proc/", "/sys/", "/dev/", "/usr/", "/lib", "/etc/", "pipe:", "socket:"};
    char link[64], path[4096];
    const char *at = getenv("FAIL_READ_AT");
    ssize_t n;
    if (!at)
        return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    n = readlink(link, path, sizeof path - 1);
    path[n > 0 ? n : 0] = 0;
    for (size_t k = 0; k < sizeof system / sizeof *system; k++)
        if (strncmp(path, system[k], strlen(system[k])) == 0)
            return 0;
    if (++calls != atoi(at))
        return 0;
    errno = EIO;
    return 1;
}

ssize_t read(int fd, void *to, size_t n) { return is_read_due(fd) ? -1 : NEXT(read)(fd, to, n); }
int fsync(int fd) { return is_due(is_part(fd)) ? -1 : NEXT(fsync)(fd); }
int fchmod(int fd, mode_t mode) { return is_due(is_part(fd)) ? -1 : NEXT(fchmod)(fd, mode); }
int rename(const char *from, const char *to) { return is_due(ends(from)) ? -1 : NEXT(rename)(from, to); }
"#;

/// A step of writing of commands with one file: a step that fills the new file, and the last one, which renames it.
const SOME_STEPS: [usize; 2] = [2, 5];

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

/// A command in a folder of its own, with what it reads there and what it writes without a fault.
struct CheckedCommand<'a> {
    library: &'a Path,
    args: &'a [&'a str],
    folder: PathBuf,
    /// Files before the command.
    inputs: Vec<(PathBuf, Vec<u8>)>,
    /// Files after the command.
    outputs: Vec<(PathBuf, Vec<u8>)>,
}

impl<'a> CheckedCommand<'a> {
    /// Runs the command without a fault over the files that `prepare` puts into the folder, so that all outputs exist.
    fn new(library: &'a Path, args: &'a [&'a str], prepare: &dyn Fn(&Path)) -> Self {
        let folder = PathBuf::from(scratch(&unique("faults")));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        prepare(&folder);
        let inputs = contents(&folder);
        let mut checked = Self {
            library,
            args,
            folder,
            inputs,
            outputs: Vec::new(),
        };
        let complete = checked.start(&[]);
        let says = String::from_utf8_lossy(&complete.stderr);
        assert!(complete.status.success(), "{args:?}: {says}");
        checked.outputs = contents(&checked.folder);
        assert_ne!(checked.outputs, checked.inputs, "{args:?} writes nothing");
        checked
    }

    /// Runs the command with variables of the library.
    fn start(&self, fault: &[(&str, usize)]) -> Output {
        let mut command = modelmill(self.args);
        command.current_dir(&self.folder).env("LD_PRELOAD", self.library);
        for (name, n) in fault {
            command.env(name, n.to_string());
        }
        command.output().unwrap()
    }

    /// Puts the files before the command into the folder, and old outputs if they are to exist; returns all of them.
    fn reset(&self, exist: bool) -> Vec<(PathBuf, Vec<u8>)> {
        std::fs::remove_dir_all(&self.folder).unwrap();
        std::fs::create_dir_all(&self.folder).unwrap();
        for (path, bytes) in if exist { &self.outputs } else { &self.inputs } {
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            let is_input = self.inputs.iter().any(|(input, _)| input == path);
            let is_manifest = path.ends_with("Cargo.toml");
            let old: &[u8] = if is_input || is_manifest { bytes } else { b"old" };
            std::fs::write(path, old).unwrap();
        }
        if exist {
            // Edits in place have the input as output.
            for (path, bytes) in &self.inputs {
                std::fs::write(path, bytes).unwrap();
            }
        }
        contents(&self.folder)
    }

    /// Whether a fault shows: the command fails, says why, and leaves all files as they were. False if it succeeds.
    fn has_fault(&self, exist: bool, fault: (&str, usize), says: &str) -> bool {
        let before = self.reset(exist);
        let ended = self.start(&[fault]);
        if ended.status.success() {
            return false;
        }
        let err = String::from_utf8_lossy(&ended.stderr).into_owned();
        let args = self.args;
        assert_eq!(ended.status.code(), Some(1), "{args:?}, {fault:?}: {err}");
        assert!(err.contains(says), "{args:?}, {fault:?}: {err}");
        assert_eq!(contents(&self.folder), before, "{args:?}, {fault:?}");
        true
    }
}

/// Runs a command again and again in a folder, with a fault one step later each time, until no step is left.
fn check(library: &Path, args: &[&str], prepare: &dyn Fn(&Path)) {
    let checked = CheckedCommand::new(library, args, prepare);
    // First all outputs are new, then all exist already.
    for exist in [false, true] {
        let steps = (1..=MOST_STEPS)
            .take_while(|n| checked.has_fault(exist, ("FAIL_AT", *n), "cannot be written"))
            .count();
        assert!(steps >= 3, "{args:?} has {steps} steps of writing");
        assert!(steps < MOST_STEPS, "{args:?} never ended");
    }
    std::fs::remove_dir_all(&checked.folder).unwrap();
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

/// Commands that take longer: two faults of writing an existing file.
#[test]
fn results_of_long_commands_are_written_completely_or_not_at_all() {
    let Some(library) = shim() else {
        println!("skipped: no library can be compiled with `cc` here");
        return;
    };
    let [spidermill, fit, check] = [model("spidermill.toml"), run("plain-fit.csv"), run("plain-check.csv")];
    let [rig, plan] = ["spidermill-full.toml", "spidermill-plan.toml"].map(|name| {
        let path = crate::common::workspace("model-spec/rigs").join(name);
        path.to_str().unwrap().to_owned()
    });
    let both = crate::common::workspace("fuzz/corpus/urdf/two_link.urdf");
    for args in [
        &["identify", &spidermill, "--data", &fit, "--out", "fit.json"][..],
        &["runs", &spidermill, "--data", &fit, &check, "--out", "runs.json"],
        &["runs", &spidermill, "--data", &fit, &check, "--out", "."],
        &["verify", &spidermill, "--data", &fit, "--junit", "verify.xml"],
        &["diagnose", &spidermill, "--data", &fit, "--out", "found.toml"],
        &["report", &spidermill, "--data", &fit, "--out", "."],
        &["reduce", &rig, "--plan", &plan, "--out", "reduced.toml"],
        &["import", both.to_str().unwrap(), "--out", "imported.toml"],
        &["diff", &spidermill, &spidermill, "--picture", "both.svg"],
    ] {
        let checked = CheckedCommand::new(&library, args, &|_| {});
        for n in SOME_STEPS {
            let found = checked.has_fault(true, ("FAIL_AT", n), "cannot be written");
            assert!(found, "{args:?} has no step {n} of writing");
        }
        std::fs::remove_dir_all(&checked.folder).unwrap();
    }
}

#[test]
fn files_that_cannot_be_read_are_named_and_nothing_is_written() {
    let Some(library) = shim() else {
        println!("skipped: no library can be compiled with `cc` here");
        return;
    };
    let prepare = |folder: &Path| {
        for (from, to) in [
            (model("spidermill.toml"), "own.toml"),
            (run("plain-check.csv"), "run.csv"),
        ] {
            std::fs::copy(from, folder.join(to)).unwrap();
        }
    };
    for args in [
        &["equations", "own.toml", "--out", "out.md"][..],
        &["generate", "own.toml", "--out", "out.rs"],
        &[
            "add",
            "own.toml",
            "viscous_friction",
            "--at",
            "spindle_left",
            "--in-place",
        ],
        &["evaluate", "own.toml", "--data", "run.csv", "--out", "out.csv"],
    ] {
        let checked = CheckedCommand::new(&library, args, &prepare);
        let steps = (1..=MOST_STEPS)
            .take_while(|n| checked.has_fault(false, ("FAIL_READ_AT", *n), "Input/output error"))
            .count();
        assert!(
            (1..MOST_STEPS).contains(&steps),
            "{args:?} has {steps} steps of reading"
        );
        std::fs::remove_dir_all(&checked.folder).unwrap();
    }
}
