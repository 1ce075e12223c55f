//! Diagnosis under realistic disturbances: asks the program about every case of a folder such as
//! `shared/data/spidermill-harsh`, and says how many answers were right, honest, wrong or false, and how long they took.
//!
//! `cargo bench -p modelmill-cli --bench harsh -- [FOLDER] [--only NAME] [--program PATH]`. The folder's README says what a
//! truthful answer is; without a folder the one beside the project is taken, and where there is none this says so.
//! `-- --seed N [--count 40] [--keep DIR]` draws recordings of the same kinds from a seed instead: other sizes, sides, motions
//! and noise, the same on every machine. `--keep` leaves them in a folder that can be asked about again.

mod drawn;
mod judge;
mod laws;
mod sensors;

#[path = "../hidden_effects/course.rs"]
#[allow(dead_code, reason = "another benchmark uses the rest")]
mod course;
#[path = "../hidden_effects/plant.rs"]
#[allow(dead_code, reason = "another benchmark uses the rest")]
mod plant;
#[path = "../hidden_effects/random.rs"]
#[allow(dead_code, reason = "another benchmark uses the rest")]
mod random;
#[path = "../hidden_effects/span.rs"]
mod span;

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Instant;

use serde_json::Value;

use drawn::Drawn;
use judge::{Mark, judge};
use plant::Plant;

const USAGE: &str = "cargo bench -p modelmill-cli --bench harsh -- [FOLDER] [--only NAME] [--program PATH] \
                     [--seed N [--count 40] [--keep DIR]]";

/// What the command line asks for.
struct Options {
    folder: PathBuf,
    /// Cases whose names hold this.
    only: String,
    program: PathBuf,
    /// Where cases come from if they are drawn.
    seed: Option<u64>,
    count: u64,
    /// Where drawn cases stay.
    keep: Option<PathBuf>,
}

fn main() -> ExitCode {
    let options = match Options::read(std::env::args().skip(1)) {
        Ok(options) => options,
        Err(says) => {
            eprintln!("{says}; {USAGE}");
            return ExitCode::from(2);
        }
    };
    if options.seed.is_none() && !options.folder.is_dir() {
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
            seed: None,
            count: 40,
            keep: None,
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
                "--only" => options.only = value()?,
                "--program" => options.program = PathBuf::from(value()?),
                "--seed" => options.seed = Some(number(value()?)?),
                "--count" => options.count = number(value()?)?,
                "--keep" => options.keep = Some(PathBuf::from(value()?)),
                flag if flag.starts_with("--") => return Err(format!("unknown argument `{arg}`")),
                _ => options.folder = PathBuf::from(arg),
            }
        }
        Ok(options)
    }
}

fn run(options: &Options) -> Result<(), String> {
    let scratch = std::env::temp_dir().join(format!("modelmill-harsh-{}", std::process::id()));
    write(&scratch.join("spidermill.toml"), &read(&model_file())?)?;
    write(&scratch.join("spidermill-friction.toml"), FRICTION)?;
    let mut score = Score::default();
    if let Some(seed) = options.seed {
        let specs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec");
        let plant = Plant::load(&specs)?;
        let folder = options.keep.as_ref().unwrap_or(&scratch);
        for number in 1..=options.count {
            if !drawn::name(number).contains(&options.only) {
                continue;
            }
            let case = Drawn::draw(&plant, seed, number)?;
            let place = folder.join(drawn::name(number));
            record(&case, &plant, seed, &place)?;
            score.ask(options, &scratch, &place)?;
        }
    } else {
        let entries = std::fs::read_dir(&options.folder)
            .map_err(|error| format!("{}: {error}", options.folder.display()))?;
        let mut cases: Vec<PathBuf> = entries
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.join("truth.json").is_file())
            .filter(|path| path.to_string_lossy().contains(&options.only))
            .collect();
        cases.sort();
        for case in &cases {
            score.ask(options, &scratch, case)?;
        }
    }
    std::fs::remove_dir_all(&scratch).map_err(|error| format!("{}: {error}", scratch.display()))?;
    score.tell();
    Ok(())
}

/// Viscous and Coulomb friction of both drives, which a model knows by kind and not by size.
const FRICTION: &str = r#"
schema = 1
name = "spidermill_friction"
extends = "spidermill.toml"

[[effect]]
name = "v1"
kind = "viscous_friction"
at = ["spindle_left"]

[[effect]]
name = "v2"
kind = "viscous_friction"
at = ["spindle_right"]

[[effect]]
name = "c1"
kind = "coulomb_friction"
at = ["spindle_left"]

[[effect]]
name = "c2"
kind = "coulomb_friction"
at = ["spindle_right"]
"#;

fn model_file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../model-spec/models/spidermill.toml")
}

/// Leaves the recordings of a drawn case in a folder, with what they are judged by.
fn record(case: &Drawn, plant: &Plant, seed: u64, place: &Path) -> Result<(), String> {
    let mut floors = [0.0; 2];
    for (which, file) in sensors::FILES.iter().enumerate() {
        let (csv, floor) = sensors::record(case, plant, seed, which)?;
        floors[which] = floor;
        write(&place.join(file), &csv)?;
    }
    let truth = case.truth(seed, floors);
    write(&place.join("truth.json"), &format!("{truth:#}\n"))
}

/// What answers were worth so far.
#[derive(Default)]
struct Score {
    counts: [usize; 4],
    /// s
    took: f64,
}

impl Score {
    /// Asks about the case of a folder; models lie in another.
    fn ask(&mut self, options: &Options, models: &Path, case: &Path) -> Result<(), String> {
        let path = case.join("truth.json");
        let truth: Value = serde_json::from_str(&read(&path)?)
            .map_err(|error| format!("{}: {error}", path.display()))?;
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
        self.took += took;
        let answer: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
        let mark = judge(&truth, &answer);
        self.counts[mark as usize] += 1;
        let name = case.file_name().unwrap_or_default().to_string_lossy();
        println!(
            "{:<6} {name:<28} {took:5.1} s  {}",
            mark.word(),
            judge::summary(&answer)
        );
        if mark != Mark::Right {
            println!("       {}", truth["answer"].as_str().unwrap_or_default());
        }
        Ok(())
    }

    fn tell(&self) {
        let of = |mark: Mark| self.counts[mark as usize];
        let cases: usize = self.counts.iter().sum();
        println!(
            "{} right, {} honest, {} wrong, {} false of {cases}; {:.1} s each",
            of(Mark::Right),
            of(Mark::Honest),
            of(Mark::Wrong),
            of(Mark::False),
            self.took / cases.max(1) as f64
        );
    }
}

fn read(path: &Path) -> Result<String, String> {
    std::fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))
}

/// Writes a file, in a folder that is made if need be.
fn write(path: &Path, text: &str) -> Result<(), String> {
    let folder = path.parent().unwrap_or(path);
    std::fs::create_dir_all(folder)
        .and_then(|()| std::fs::write(path, text))
        .map_err(|error| format!("{}: {error}", path.display()))
}
