//! Diagnosis under realistic disturbances: runs the program on every case of a folder such as
//! `shared/data/spidermill-harsh`. Prints how many answers were right, honest, wrong or false, and the run time.
//!
//! `cargo bench -p modelmill-lab --bench harsh -- [FOLDER] [--only NAME] [--program PATH]`. The folder's README
//! defines a truthful answer. Without the argument, the folder next to the project is used; the benchmark reports if it
//! does not exist. `-- --seed N [--count 40] [--keep DIR]` draws recordings of the same kinds from a seed instead, with
//! other sizes, sides, motions and noise, the same on every machine. `--keep` keeps them in a folder for later calls.

mod drawn;
mod judge;
mod laws;
mod sensors;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use modelmill_lab::harness::{
    BenchmarkOptions, BenchmarkUsage, ProgramFault, TestedProgram, in_project, read, remove_folder, run_benchmark,
    scratch_folder, write,
};
use modelmill_lab::plant::SpidermillPlant;
use modelmill_lab::record::FILES;
use serde_json::Value;

use drawn::Drawn;
use judge::{Mark, judge};

const USAGE: BenchmarkUsage = BenchmarkUsage {
    line: "cargo bench -p modelmill-lab --bench harsh -- [FOLDER] [--only NAME] [--program PATH] \
           [--seed N [--count 40] [--keep DIR]]",
    values: &[("only", ""), ("seed", ""), ("count", "40"), ("keep", "")],
    switches: &[],
    takes_folder: true,
};

fn main() -> ExitCode {
    run_benchmark(&USAGE, run)
}

fn run(options: &BenchmarkOptions) -> Result<(), String> {
    let beside = in_project("../shared/data/spidermill-harsh");
    let folder = options.folder().unwrap_or(&beside);
    let is_drawn = !options.text("seed").is_empty();
    if !is_drawn && !folder.is_dir() {
        println!("{}: no such folder; give the folder as an argument", folder.display());
        return Ok(());
    }
    let program = options.program()?;
    let only = options.text("only");
    let scratch = scratch_folder("harsh");
    write(&scratch.join("spidermill.toml"), &read(&model_file())?)?;
    write(&scratch.join("spidermill-friction.toml"), FRICTION)?;
    let mut score = Score::default();
    if is_drawn {
        let seed = options.number("seed")?;
        let plant = SpidermillPlant::load()?;
        let folder = options.path("keep").unwrap_or(&scratch);
        for number in 1..=options.number("count")? {
            if !drawn::name(number).contains(only) {
                continue;
            }
            let case = Drawn::draw(&plant, seed, number)?;
            let place = folder.join(drawn::name(number));
            record(&case, &plant, seed, &place)?;
            score.ask(&program, &scratch, &place)?;
        }
    } else {
        let entries = std::fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        let mut cases: Vec<PathBuf> = entries
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.join("truth.json").is_file())
            .filter(|path| path.to_string_lossy().contains(only))
            .collect();
        cases.sort();
        for case in &cases {
            score.ask(&program, &scratch, case)?;
        }
    }
    remove_folder(&scratch)?;
    score.tell();
    Ok(())
}

/// A model file with viscous and Coulomb friction of both drives, without values.
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

/// The model file of the SpiderMill.
fn model_file() -> PathBuf {
    in_project("model-spec/models/spidermill.toml")
}

/// Writes the recordings of a drawn case into a folder, with the truth by which answers are judged.
fn record(case: &Drawn, plant: &SpidermillPlant, seed: u64, place: &Path) -> Result<(), String> {
    let mut floors = [0.0; 2];
    for (which, file) in FILES.iter().enumerate() {
        let (csv, floor) = sensors::record(case, plant, seed, which)?;
        floors[which] = floor;
        write(&place.join(file), &csv)?;
    }
    let truth = case.truth(seed, floors);
    write(&place.join("truth.json"), &format!("{truth:#}\n"))
}

/// Number of answers per mark, and total run time.
#[derive(Default)]
struct Score {
    /// Number of answers by [`Mark`].
    counts: [usize; 4],
    /// Total run time, s.
    took: f64,
}

impl Score {
    /// Diagnoses the case of a folder and prints its mark; `models` is the folder of the models.
    fn ask(&mut self, program: &TestedProgram, models: &Path, case: &Path) -> Result<(), String> {
        let path = case.join("truth.json");
        let truth: Value =
            serde_json::from_str(&read(&path)?).map_err(|error| format!("{}: {error}", path.display()))?;
        let model = truth["model"].as_str().unwrap_or("spidermill");
        let model = models.join(format!("{model}.toml"));
        let [fit, check] = FILES.map(|file| [case.join(file)]);
        let (answer, took) = program.diagnose_for_json(&model, &fit, &check);
        let answer = match answer {
            Err(fault @ ProgramFault::NotStarted(_)) => return Err(fault.to_string()),
            // A failed diagnosis counts as an empty answer.
            answer => answer.unwrap_or_default(),
        };
        let took = took.as_secs_f64();
        self.took += took;
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

    /// Prints the totals.
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
