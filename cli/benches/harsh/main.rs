//! Diagnosis under realistic disturbances: asks the program about every case of a folder such as
//! `shared/data/spidermill-harsh`, and says how many answers were right, honest, wrong or false, and how long they took.
//!
//! `cargo bench -p modelmill-cli --bench harsh -- [FOLDER] [--only NAME] [--program PATH]`. The folder's README says what a
//! truthful answer is; without a folder the one beside the project is taken, and where there is none this says so.

mod judge;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Instant;

use serde_json::Value;

use judge::{Mark, judge};

const USAGE: &str =
    "cargo bench -p modelmill-cli --bench harsh -- [FOLDER] [--only NAME] [--program PATH]";

/// What the command line asks for.
struct Options {
    folder: PathBuf,
    /// Cases whose names hold this.
    only: String,
    program: PathBuf,
}

fn main() -> ExitCode {
    let options = match Options::read(std::env::args().skip(1)) {
        Ok(options) => options,
        Err(says) => {
            eprintln!("{says}; {USAGE}");
            return ExitCode::from(2);
        }
    };
    if !options.folder.is_dir() {
        println!("{}: no such folder", options.folder.display());
        return ExitCode::SUCCESS;
    }
    match run(&options) {
        Ok(()) => ExitCode::SUCCESS,
        Err(says) => {
            eprintln!("{says}");
            ExitCode::FAILURE
        }
    }
}

impl Options {
    fn read(mut args: impl Iterator<Item = String>) -> Result<Self, String> {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut options = Self {
            folder: here.join("../../shared/data/spidermill-harsh"),
            only: String::new(),
            program: PathBuf::from(env!("CARGO_BIN_EXE_modelmill")),
        };
        while let Some(arg) = args.next() {
            let mut value = || args.next().ok_or_else(|| format!("{arg} lacks its value"));
            match arg.as_str() {
                // Cargo says so to every benchmark.
                "--bench" => {}
                "--only" => options.only = value()?,
                "--program" => options.program = PathBuf::from(value()?),
                flag if flag.starts_with("--") => return Err(format!("unknown argument `{arg}`")),
                _ => options.folder = PathBuf::from(arg),
            }
        }
        Ok(options)
    }
}

fn run(options: &Options) -> Result<(), String> {
    let at = |path: &Path, error: std::io::Error| format!("{}: {error}", path.display());
    let entries = std::fs::read_dir(&options.folder).map_err(|e| at(&options.folder, e))?;
    let mut cases: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.join("truth.json").is_file())
        .filter(|path| path.to_string_lossy().contains(&options.only))
        .collect();
    cases.sort();
    // A model that extends another lies beside it.
    let models = std::env::temp_dir().join(format!("modelmill-harsh-{}", std::process::id()));
    std::fs::create_dir_all(&models).map_err(|e| at(&models, e))?;
    let plain = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/models/spidermill.toml");
    let friction = options.folder.join("model-friction.toml");
    for (from, name) in [
        (&plain, "spidermill.toml"),
        (&friction, "spidermill-friction.toml"),
    ] {
        let text = std::fs::read(from).map_err(|e| at(from, e))?;
        std::fs::write(models.join(name), text).map_err(|e| at(from, e))?;
    }
    let mut counts = [0; 4];
    let mut total = 0.0;
    for case in &cases {
        let path = case.join("truth.json");
        let text = std::fs::read_to_string(&path).map_err(|e| at(&path, e))?;
        let truth: Value =
            serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))?;
        let model = truth["model"].as_str().unwrap_or("spidermill");
        let start = Instant::now();
        let output = Command::new(&options.program)
            .arg("diagnose")
            .arg(models.join(format!("{model}.toml")))
            .arg("--data")
            .arg(case.join("fit.csv"))
            .arg("--check")
            .arg(case.join("check.csv"))
            .arg("--json")
            .output()
            .map_err(|error| format!("{}: {error}", options.program.display()))?;
        let took = start.elapsed().as_secs_f64();
        total += took;
        let answer: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
        let mark = judge(&truth, &answer);
        counts[mark as usize] += 1;
        let name = case.file_name().unwrap_or_default().to_string_lossy();
        println!(
            "{:<6} {name:<24} {took:5.1} s  {}",
            mark.word(),
            judge::summary(&answer)
        );
    }
    std::fs::remove_dir_all(&models).map_err(|e| at(&models, e))?;
    let of = |mark: Mark| counts[mark as usize];
    println!(
        "{} right, {} honest, {} wrong, {} false of {}; {:.1} s each",
        of(Mark::Right),
        of(Mark::Honest),
        of(Mark::Wrong),
        of(Mark::False),
        cases.len(),
        total / cases.len().max(1) as f64
    );
    Ok(())
}
