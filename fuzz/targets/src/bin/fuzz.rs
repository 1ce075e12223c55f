//! Runs targets on mutations of their corpus for a given time, and keeps every input that fails.
//!
//! `modelmill-fuzz [--seconds N] [--seed N] [TARGET]...`; without targets all of them, each for `N` seconds.
//! `modelmill-fuzz --file FILE TARGET` reads one file, such as a failing input.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use modelmill_fuzz_targets::corpus::{read_corpus, repository};
use modelmill_fuzz_targets::mutation::{MutationNoise, mutate};
use modelmill_fuzz_targets::targets::{FuzzTarget, TARGETS};

/// Time after which a single run is given up, seconds.
const LONGEST_RUN: u64 = 120;
/// Failing inputs of a target after which it ends.
const MOST_FINDINGS: usize = 20;

/// The start of the program.
static PROGRAM_START: LazyLock<Instant> = LazyLock::new(Instant::now);
/// The second at which the present run started, counted from the start of the program.
static RUN_START: AtomicU64 = AtomicU64::new(u64::MAX);

/// What the arguments request.
struct FuzzRequest {
    seconds: u64,
    seed: u64,
    targets: Vec<FuzzTarget>,
    /// A file that is read in place of the corpus.
    file: Option<PathBuf>,
}

fn main() -> ExitCode {
    let request = match read_arguments() {
        Ok(request) => request,
        Err(fault) => {
            eprintln!("{fault}");
            return ExitCode::from(2);
        }
    };
    if let Some(file) = &request.file {
        return read_file(file, &request.targets);
    }
    watch_time();
    let mut n_findings = 0;
    for target in &request.targets {
        match run_target(target, &request) {
            Ok(n) => n_findings += n,
            Err(error) => {
                eprintln!("{}: {error}", target.name);
                return ExitCode::from(2);
            }
        }
    }
    ExitCode::from(u8::from(n_findings > 0))
}

/// Reads the arguments. Fails with one line.
fn read_arguments() -> Result<FuzzRequest, String> {
    let mut request = FuzzRequest {
        seconds: 60,
        seed: 1,
        targets: Vec::new(),
        file: None,
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        if argument == "--file" {
            request.file = Some(arguments.next().ok_or("--file needs a path")?.into());
            continue;
        }
        let mut number = || {
            let text = arguments.next().unwrap_or_default();
            text.parse::<u64>().map_err(|_| format!("{argument} needs a number"))
        };
        match argument.as_str() {
            "--seconds" => request.seconds = number()?,
            "--seed" => request.seed = number()?,
            name => {
                let found = TARGETS.iter().find(|target| target.name == name);
                let names = || TARGETS.map(|target| target.name).join(", ");
                request
                    .targets
                    .push(*found.ok_or_else(|| format!("there is no target `{name}`; there are {}", names()))?);
            }
        }
    }
    if request.targets.is_empty() {
        request.targets = TARGETS.to_vec();
    }
    Ok(request)
}

/// Reads one file by the targets, without a limit on the time of all.
fn read_file(file: &Path, targets: &[FuzzTarget]) -> ExitCode {
    let input = match std::fs::read(file) {
        Ok(input) => input,
        Err(error) => {
            eprintln!("{}: {error}", file.display());
            return ExitCode::from(2);
        }
    };
    for target in targets {
        let start = Instant::now();
        (target.run)(&input);
        println!("{}: {} bytes in {:?}", target.name, input.len(), start.elapsed());
    }
    ExitCode::SUCCESS
}

/// The folder of failing inputs.
fn findings_folder() -> PathBuf {
    repository().join("target/fuzz")
}

/// Ends the program when a single run takes too long; its input is in the file `NAME-current`.
fn watch_time() {
    LazyLock::force(&PROGRAM_START);
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_secs(1));
            let start = RUN_START.load(Ordering::Relaxed);
            if PROGRAM_START.elapsed().as_secs() > start.saturating_add(LONGEST_RUN) {
                eprintln!(
                    "a run takes more than {LONGEST_RUN} s; its input is in {}",
                    findings_folder().display()
                );
                std::process::exit(1);
            }
        }
    });
}

/// Runs one target, and returns the number of failing inputs.
fn run_target(target: &FuzzTarget, request: &FuzzRequest) -> std::io::Result<usize> {
    let folder = findings_folder();
    std::fs::create_dir_all(&folder)?;
    let current = folder.join(format!("{}-current", target.name));
    let files: Vec<Vec<u8>> = read_corpus(target)?.into_iter().map(|(_, bytes)| bytes).collect();
    let mut noise = MutationNoise::new(request.seed);
    let origin = Instant::now();
    let (mut n_runs, mut n_findings) = (0_u64, 0);
    let mut unchanged = files.iter();
    while origin.elapsed().as_secs() < request.seconds && n_findings < MOST_FINDINGS {
        // First the files as they are.
        let input = unchanged.next().cloned().unwrap_or_else(|| mutate(&files, &mut noise));
        // The input of a run that ends the program, for example by its stack, is in this file.
        std::fs::write(&current, &input)?;
        RUN_START.store(PROGRAM_START.elapsed().as_secs(), Ordering::Relaxed);
        let ended = catch_unwind(AssertUnwindSafe(|| (target.run)(&input)));
        RUN_START.store(u64::MAX, Ordering::Relaxed);
        n_runs += 1;
        if ended.is_err() {
            n_findings += 1;
            let kept = folder.join(format!("{}-{}-{n_runs}", target.name, request.seed));
            std::fs::write(&kept, &input)?;
            eprintln!("{}: input kept as {}", target.name, kept.display());
        }
    }
    std::fs::remove_file(&current)?;
    println!(
        "{}: {n_runs} runs of {} files, {n_findings} findings",
        target.name,
        files.len()
    );
    Ok(n_findings)
}
