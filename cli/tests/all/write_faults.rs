//! Every command that writes, with a disk that fails at the n-th step of writing: old files stay complete, nothing is
//! left behind, and the exit status is 1. The same for a disk that fails at the n-th step of reading. A test finds
//! commands and outputs that are not among them.
//!
//! A small library in C is loaded before the program (`LD_PRELOAD`). It lets the n-th call fail that creates, fills,
//! flushes or renames a partial file, or that reads a file of the user.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::json;

use crate::common::workbench::Workbench;
use crate::common::{model, modelmill, printed, run, scratch, workspace};

/// Commands, each with outputs that no other command of these lists has. `model:`, `run:`, `rig:` and `urdf:` are bundled
/// files, `own:` is a copy of a bundled model in the folder of the command, and `fit:` a fit of a bundled model there.
///
/// With these every step of writing fails in turn.
const QUICK: [&str; 13] = [
    "generate model:two_link.toml --out out.rs",
    "generate model:two_link.toml --language c99 --out out",
    "equations model:two_link.toml --out out.md",
    "check model:two_link.toml --picture out.svg",
    "manual --out .",
    "export model:two_link.toml --out out.urdf",
    "atlas model:two_link.toml model:four_bar.toml --out .",
    "add model:two_link.toml viscous_friction --at joint1 --out out.toml",
    "add own:two_link.toml viscous_friction --at joint1 --in-place",
    "evaluate model:spidermill.toml --data run:plain-fit.csv --out out.csv",
    "excite model:two_link.toml --random 4 --starts 1 --harmonics 2 --limits q1=-1:1 --limits q1_d=2 --limits q2=-1:1 \
     --limits q2_d=2 --out trajectory.csv --figure picture.svg",
    "import urdf:two_link.urdf --out imported.toml",
    "diff model:two_link.toml model:two_link.toml --picture both.svg",
];

/// Commands that take longer: some steps of writing existing files fail.
const LONG: [&str; 13] = [
    "generate model:two_link.toml --language c --out out",
    "generate model:two_link.toml --language python --out out",
    "identify model:spidermill.toml --data run:plain-fit.csv --out fit.json",
    "adopt own:spidermill.toml fit:spidermill.toml --in-place",
    "adopt model:spidermill.toml fit:spidermill.toml --out adopted.toml",
    "runs model:spidermill.toml --data run:plain-fit.csv run:plain-check.csv --out runs.json",
    "runs model:spidermill.toml --data run:plain-fit.csv run:plain-check.csv --out .",
    "verify model:spidermill.toml --data run:plain-fit.csv --junit verify.xml --json",
    "diagnose model:spidermill.toml --data run:plain-fit.csv --out found.toml",
    "report model:spidermill.toml --data run:plain-fit.csv --out .",
    "simulate rig:spidermill-full.toml --trajectory run:plain-check.csv --out run.csv",
    "reduce rig:spidermill-full.toml --plan rig:spidermill-plan.toml --out reduced.toml",
    "reduce rig:spidermill-seventeen.toml --propose plan.toml --out model.toml",
];

/// Commands that take longest and read no files: one step of writing fails.
const LONGEST: [&str; 2] = ["tour --out .", "experiment --out . --random 10 --starts 1"];

/// Steps of writing of [`LONG`]: one that fills a new file, and one that flushes or renames it.
const SOME_STEPS: [usize; 2] = [2, 5];

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

/// The arguments of a command of these lists. Files of its own are put into its folder.
fn arguments(command: &str, folder: &Path) -> Vec<String> {
    let argument = |word: &str| match word.split_once(':') {
        Some(("model", name)) => model(name),
        Some(("run", name)) => run(name),
        Some(("rig", name)) => text(&workspace("model-spec/rigs").join(name)),
        Some(("urdf", name)) => text(&workspace("fuzz/corpus/urdf").join(name)),
        Some(("own", name)) => {
            std::fs::copy(model(name), folder.join(name)).unwrap();
            name.to_owned()
        }
        Some(("fit", name)) => {
            let fit = folder.join("own-fit.json");
            printed(&[
                "identify",
                &model(name),
                "--data",
                &run("plain-fit.csv"),
                "--out",
                &text(&fit),
            ]);
            "own-fit.json".to_owned()
        }
        _ => word.to_owned(),
    };
    command.split_whitespace().map(argument).collect()
}

fn text(path: &Path) -> String {
    path.to_str().unwrap().to_owned()
}

/// A command in a folder of its own, with what it reads there and what it writes without a fault.
struct CheckedCommand<'a> {
    library: &'a Path,
    args: Vec<String>,
    folder: PathBuf,
    /// Files before the command.
    inputs: Vec<(PathBuf, Vec<u8>)>,
    /// Files after the command.
    outputs: Vec<(PathBuf, Vec<u8>)>,
}

impl<'a> CheckedCommand<'a> {
    /// Runs a command of these lists without a fault, so that all outputs exist.
    fn new(library: &'a Path, command: &str) -> Self {
        let folder = PathBuf::from(scratch(&unique("faults")));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        let args = arguments(command, &folder);
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
        // The bundled model may fail its verification, which is no fault of the disk.
        let is_ended = complete.status.success() || command.starts_with("verify");
        assert!(is_ended, "{command}: {says}");
        checked.outputs = contents(&checked.folder);
        assert_ne!(checked.outputs, checked.inputs, "{command} writes nothing");
        checked
    }

    /// Runs the command with variables of the library.
    fn start(&self, fault: &[(&str, usize)]) -> Output {
        let args: Vec<&str> = self.args.iter().map(String::as_str).collect();
        let mut command = modelmill(&args);
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
        let args = &self.args;
        assert_eq!(ended.status.code(), Some(1), "{args:?}, {fault:?}: {err}");
        assert!(err.contains(says), "{args:?}, {fault:?}: {err}");
        assert_eq!(contents(&self.folder), before, "{args:?}, {fault:?}");
        true
    }
}

/// Runs a command again and again, with a fault one step later each time, until no step is left.
fn check_each_step(library: &Path, command: &str) {
    let checked = CheckedCommand::new(library, command);
    // First all outputs are new, then all exist already.
    for exist in [false, true] {
        let steps = (1..=MOST_STEPS)
            .take_while(|n| checked.has_fault(exist, ("FAIL_AT", *n), "cannot be written"))
            .count();
        assert!(steps >= 3, "{command} has {steps} steps of writing");
        assert!(steps < MOST_STEPS, "{command} never ended");
    }
    std::fs::remove_dir_all(&checked.folder).unwrap();
}

/// Checks some steps of a command, over existing files.
fn check_steps(library: &Path, command: &str, steps: &[usize]) {
    let checked = CheckedCommand::new(library, command);
    for n in steps {
        let found = checked.has_fault(true, ("FAIL_AT", *n), "cannot be written");
        assert!(found, "{command} has no step {n} of writing");
    }
    std::fs::remove_dir_all(&checked.folder).unwrap();
}

/// The library; without it the test is skipped.
macro_rules! shim_or_skip {
    () => {
        match shim() {
            Some(library) => library,
            None => {
                println!("skipped: no library can be compiled with `cc` here");
                return;
            }
        }
    };
}

#[test]
fn files_are_written_completely_or_not_at_all() {
    let library = shim_or_skip!();
    for command in QUICK {
        check_each_step(&library, command);
    }
}

#[test]
fn results_of_long_commands_are_written_completely_or_not_at_all() {
    let library = shim_or_skip!();
    for command in LONG {
        check_steps(&library, command, &SOME_STEPS);
    }
}

#[test]
fn results_of_the_longest_commands_are_written_completely_or_not_at_all() {
    let library = shim_or_skip!();
    for command in LONGEST {
        check_steps(&library, command, &[3]);
    }
}

/// Names of commands with the options of their outputs, from the reference that the program prints.
fn outputs_of_commands() -> Vec<(String, String)> {
    let manual = printed(&["manual"]);
    let sections: Vec<(&str, &str)> = manual
        .split("\n## ")
        .skip(1)
        .map(|section| section.split_once('\n').unwrap())
        .collect();
    let options_of = |section: &str| -> Vec<String> {
        let rows = section.lines().filter_map(|line| line.strip_prefix("| `--"));
        rows.filter(|row| {
            let (option, words) = row.split_once("` |").unwrap();
            let value = option.split_once(' ').map_or("", |(_, value)| value);
            let is_path = value.is_empty() || value.contains("FILE") || value.contains("DIR") || value.contains('.');
            let words = words.to_lowercase();
            is_path
                && ["write ", "draw ", "change the model file"]
                    .iter()
                    .any(|verb| words.contains(verb))
        })
        .map(|row| format!("--{}", row.split([' ', '`']).next().unwrap()))
        .collect()
    };
    let mut found = Vec::new();
    for (name, section) in sections
        .iter()
        .filter(|(name, _)| !name.contains(' ') && *name != "Picture")
    {
        let mut options = options_of(section);
        for (shared, group) in &sections {
            if section.contains(&format!("Also the options of [{shared}]")) {
                options.extend(options_of(group));
            }
        }
        found.extend(options.into_iter().map(|option| ((*name).to_owned(), option)));
    }
    found
}

#[test]
fn every_output_of_every_command_is_checked() {
    let outputs = outputs_of_commands();
    assert!(outputs.len() > 20, "{outputs:?}");
    let commands: Vec<Vec<&str>> = [&QUICK[..], &LONG, &LONGEST]
        .concat()
        .into_iter()
        .map(|command| command.split_whitespace().collect())
        .collect();
    for (name, option) in &outputs {
        let is_checked = commands
            .iter()
            .any(|words| words[0] == name && words.contains(&option.as_str()));
        assert!(
            is_checked,
            "no command of these lists has the output {option} of `{name}`"
        );
    }
    // Outputs that the reference describes in other words: the sources that write files.
    for file in std::fs::read_dir(workspace("cli/src/commands")).unwrap() {
        let path = file.unwrap().path();
        let source = if path.is_dir() {
            path.join("mod.rs")
        } else {
            path.clone()
        };
        let source = std::fs::read_to_string(source).unwrap();
        let name = path.file_stem().unwrap().to_str().unwrap();
        if name != "mod" && (source.contains(".write(") || source.contains("output::write")) {
            let is_checked = commands.iter().any(|words| words[0] == name);
            assert!(is_checked, "no command of these lists is `{name}`, which writes files");
        }
    }
}

/// Lets the steps of reading fail in turn, up to `most`, and returns how many faults were reported. A command may also read a
/// file once more after a fault: then its output is right.
fn count_read_faults(checked: &CheckedCommand<'_>, most: usize) -> usize {
    let mut n_faults = 0;
    let mut n_right = 0;
    for n in 1..=most {
        if checked.has_fault(false, ("FAIL_READ_AT", n), "Input/output error") {
            n_faults += 1;
            n_right = 0;
            continue;
        }
        // The atlas states how long each derivation took.
        let is_same = contents(&checked.folder) == checked.outputs || checked.args[0] == "atlas";
        assert!(is_same, "{:?}: step {n} of reading", checked.args);
        n_right += 1;
        // The step before was the last one.
        if n_right == MOST_REPEATED_READS {
            break;
        }
    }
    n_faults
}

/// Steps of reading in sequence that a command repeats after a fault.
const MOST_REPEATED_READS: usize = 12;

#[test]
fn files_that_cannot_be_read_are_named_and_nothing_is_written() {
    let library = shim_or_skip!();
    for command in QUICK.iter().filter(|command| **command != "manual --out .") {
        let checked = CheckedCommand::new(&library, command);
        let n_faults = count_read_faults(&checked, MOST_STEPS);
        assert!(
            (1..MOST_STEPS).contains(&n_faults),
            "{command} has {n_faults} steps of reading"
        );
        std::fs::remove_dir_all(&checked.folder).unwrap();
    }
}

/// The same for commands that take longer: the first steps, which fail soon.
#[test]
fn files_that_long_commands_cannot_read_are_named_and_nothing_is_written() {
    let library = shim_or_skip!();
    for command in LONG {
        let checked = CheckedCommand::new(&library, command);
        let n_faults = count_read_faults(&checked, 4);
        assert!(n_faults > 0, "{command} has no steps of reading");
        std::fs::remove_dir_all(&checked.folder).unwrap();
    }
}

/// The workbench answers that a file could not be saved, keeps the old one, and saves it the next time.
#[test]
fn a_workbench_whose_disk_fails_keeps_the_old_file() {
    let library = shim_or_skip!();
    let mut n = 0;
    loop {
        n += 1;
        let fault = [("LD_PRELOAD", text(&library)), ("FAIL_AT", n.to_string())];
        let bench = Workbench::open_with(&unique("faulty-disk"), "two_link.toml", &fault);
        let old = bench.text();
        let new = format!("# new\n{old}");
        let base = bench.view()["revision"].clone();
        assert_eq!(bench.ask("edit", &json!({ "base": base, "text": new })).0, 200);
        let (status, says) = bench.ask("save", &json!({}));
        if status == 200 {
            assert_eq!(bench.text(), new);
            break;
        }
        assert_eq!(bench.text(), old, "step {n}: {says}");
        assert!(
            says["says"].to_string().contains("nothing is saved"),
            "step {n}: {says}"
        );
        let folder = bench.model.parent().unwrap();
        assert_eq!(contents(folder).len(), 1, "step {n}");
        assert_eq!(bench.ask("save", &json!({})).0, 200, "step {n}");
        assert_eq!(bench.text(), new, "step {n}");
        assert!(n < 20, "saving never succeeds");
    }
    assert!(n > 3, "{n} steps of saving");
}
