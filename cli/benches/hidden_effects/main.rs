//! Hidden effects: recordings with something hidden in them, made by the rig from a seed; `diagnose` looks for it, and
//! the score says how often it was right.
//!
//! `cargo bench -p modelmill-cli --bench hidden_effects -- [--count 240] [--seed 1] [--only one|two|none|outside]
//! [--keep DIR] [--list] [--program PATH] [--no-diagnosis]`. Figures go to standard output, progress to standard error;
//! the same seed gives the same cases on every machine. `--keep` leaves the recordings in a folder, with `truth.json`;
//! `--list` says what is hidden and makes no recordings; `--program` asks another build of modelmill, `--no-diagnosis`
//! nobody.
//!
//! Decision: this benchmark calls the program and not the library. It knows `diagnose` by its JSON only, and the
//! rig that makes the recordings shares no mechanics with the derivation. Sizes are drawn as the error that remains
//! after identification, so that every effect is visible; an effect that base parameters absorb is none. An effect
//! outside the library leaves more than twice the noise when all columns of the library are fitted together.

mod alternatives;
mod answer;
mod ask;
mod case;
mod columns;
mod course;
mod hidden;
mod judge;
mod outside;
mod placed;
mod plant;
mod random;
mod record;
mod span;
mod table;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use serde_json::{Map, Value};

use case::{Case, class_of};
use judge::{Class, Mark, judge};
use plant::Plant;
use table::Score;

/// Cases that run at the same time.
const WORKERS: usize = 2;
const USAGE: &str = "cargo bench -p modelmill-cli --bench hidden_effects -- [--count 240] [--seed 1] \
                     [--only one|two|none|outside] [--keep DIR] [--list] [--program PATH] [--no-diagnosis]";

/// What the command line asks for.
struct Options {
    count: usize,
    seed: u64,
    only: Option<Class>,
    /// Where recordings stay.
    keep: Option<PathBuf>,
    /// Says what is hidden and asks nobody.
    list: bool,
    /// Who is asked.
    program: PathBuf,
    /// Makes the recordings and asks nobody.
    no_diagnosis: bool,
}

/// What is known of a case in the end.
struct Done {
    name: String,
    /// Entry of `truth.json`.
    truth: Value,
    line: String,
    score: Option<Score>,
}

fn main() -> ExitCode {
    let options = match Options::read(std::env::args().skip(1)) {
        Ok(options) => options,
        Err(says) => {
            eprintln!("{says}; {USAGE}");
            return ExitCode::from(2);
        }
    };
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
        let mut options = Self {
            count: 240,
            seed: 1,
            only: None,
            keep: None,
            list: false,
            program: PathBuf::from(env!("CARGO_BIN_EXE_modelmill")),
            no_diagnosis: false,
        };
        while let Some(arg) = args.next() {
            let mut value = || args.next().ok_or_else(|| format!("{arg} lacks its value"));
            let number = |text: String| {
                let parsed: Result<u64, _> = text.parse();
                parsed.map_err(|_| format!("`{text}` is no number"))
            };
            match arg.as_str() {
                // Cargo says so to every benchmark.
                "--bench" => {}
                "--count" => {
                    let count = number(value()?)?;
                    options.count = usize::try_from(count).map_err(|_| "too many cases")?;
                }
                "--seed" => options.seed = number(value()?)?,
                "--only" => {
                    let name = value()?;
                    let class = Class::ALL.into_iter().find(|class| class.name() == name);
                    options.only =
                        Some(class.ok_or_else(|| format!("there is no class `{name}`"))?);
                }
                "--keep" => options.keep = Some(PathBuf::from(value()?)),
                "--program" => options.program = PathBuf::from(value()?),
                "--list" => options.list = true,
                "--no-diagnosis" => options.no_diagnosis = true,
                _ => return Err(format!("unknown argument `{arg}`")),
            }
        }
        Ok(options)
    }
}

fn run(options: &Options) -> Result<(), String> {
    let specs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec");
    let plant = Plant::load(&specs)?;
    let scratch = std::env::temp_dir().join(format!("modelmill-hidden-{}", std::process::id()));
    let folder = options.keep.as_ref().unwrap_or(&scratch);
    let numbers: Vec<u64> = (1..)
        .filter(|number| options.only.is_none_or(|only| class_of(*number).0 == only))
        .take(options.count)
        .collect();
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(u64, Done)>> = Mutex::new(Vec::new());
    let failed: Mutex<Option<String>> = Mutex::new(None);
    thread::scope(|scope| {
        for _ in 0..WORKERS {
            scope.spawn(|| {
                while let Some(number) = numbers.get(next.fetch_add(1, Ordering::Relaxed)) {
                    match one(options, &plant, folder, *number) {
                        Ok(one) => {
                            let mut all = lock(&done);
                            all.push((*number, one));
                            eprint!("\r{} of {} cases ", all.len(), numbers.len());
                        }
                        Err(says) => {
                            *lock(&failed) = Some(says);
                            next.store(numbers.len(), Ordering::Relaxed);
                        }
                    }
                }
            });
        }
    });
    eprintln!();
    if options.keep.is_none() && scratch.exists() {
        std::fs::remove_dir_all(&scratch)
            .map_err(|error| format!("{}: {error}", scratch.display()))?;
    }
    if let Some(says) = lock(&failed).take() {
        return Err(says);
    }
    let mut done = std::mem::take(&mut *lock(&done));
    done.sort_by_key(|(number, _)| *number);
    if options.keep.is_some() && !options.list {
        let truths: Map<String, Value> = done
            .iter()
            .map(|(_, one)| (one.name.clone(), one.truth.clone()))
            .collect();
        let text = format!("{:#}\n", Value::Object(truths));
        write(&folder.join("truth.json"), &text)?;
    }
    if options.list || options.no_diagnosis {
        for (_, one) in &done {
            println!("{}", one.line);
        }
        return Ok(());
    }
    let scores: Vec<Score> = done.into_iter().filter_map(|(_, one)| one.score).collect();
    print!("{}", table::report(&scores, options.seed));
    Ok(())
}

/// Draws a case, records it, asks for a diagnosis and marks it.
fn one(options: &Options, plant: &Plant, folder: &Path, number: u64) -> Result<Done, String> {
    let case = Case::draw(plant, options.seed, number)?;
    let recording = format!(
        "{}, {}, noise {} N",
        case.repeats.word(),
        if case.full {
            "full states"
        } else {
            "positions only"
        },
        case.noise
    );
    let line = format!(
        "{:>4} {:<8}{} | error {:.2} % fit, {:.2} % check | {recording}",
        number,
        case.class.name(),
        case.truth(),
        100.0 * case.errors[0],
        100.0 * case.errors[1]
    );
    let name = case.name();
    if options.list {
        return Ok(Done {
            name,
            truth: Value::Null,
            line,
            score: None,
        });
    }
    let place = folder.join(&name);
    std::fs::create_dir_all(&place).map_err(|error| format!("{}: {error}", place.display()))?;
    let mut floor = [0.0; 2];
    let files = record::FILES.map(|file| place.join(file));
    for (which, file) in files.iter().enumerate() {
        let recorded = record::record(&case, options.seed, which)?;
        floor[which] = recorded.floor;
        write(file, &recorded.csv)?;
    }
    let doubles = if options.keep.is_some() {
        case.doubles(plant)?
    } else {
        Vec::new()
    };
    let truth = case.json(options.seed, floor, &doubles);
    if options.no_diagnosis {
        return Ok(Done {
            name,
            truth,
            line,
            score: None,
        });
    }
    let program = options.program.as_os_str();
    let (answer, took) = ask::diagnose(program, &plant.model, &files[0], &files[1]);
    if options.keep.is_none() {
        std::fs::remove_dir_all(&place).map_err(|error| format!("{}: {error}", place.display()))?;
    }
    let (answer, mark, aliases) = match answer {
        Err(why) => (None, Mark::Failed(why), [0, 0]),
        Ok(answer) => {
            let mut excess =
                |claims: &[placed::Placed]| case.excess(plant, claims).unwrap_or(f64::INFINITY);
            let law = case.outside.as_ref().map(|outside| outside.law);
            let named = law.and_then(outside::Law::disturbance);
            let mark = judge(case.class, &case.placed(), named, &answer, &mut excess);
            let aliases = judge::aliases(&answer, &mut excess);
            (Some(answer), mark, aliases)
        }
    };
    let score = Score {
        number,
        class: case.class,
        label: case.label.clone(),
        truth: case.truth(),
        recording,
        drive: case
            .outside
            .as_ref()
            .map(|outside| plant::DRIVES[outside.at]),
        errors: case.errors,
        floor: floor[1],
        answer,
        mark,
        aliases,
        took,
    };
    Ok(Done {
        name,
        truth,
        line,
        score: Some(score),
    })
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
}

/// What a worker left; a worker that panicked has said so already.
fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex
        .lock()
        .unwrap_or_else(std::sync::PoisonError::into_inner)
}
