//! Hidden effects: simulates recordings of the rig with hidden effects from a seed, runs `diagnose` on them, and prints
//! how often the answer was right.
//!
//! `cargo bench -p modelmill-lab --bench hidden_effects -- [--count 240] [--seed 1] [--only one|two|none|outside]
//! [--keep DIR] [--list] [--program PATH] [--no-diagnosis]`. Figures go to standard output, progress to standard error;
//! the same seed gives the same cases on every machine. `--keep` keeps the recordings in a folder, with `truth.json`;
//! `--list` prints what is hidden and writes no recordings; `--program` tests another build of modelmill;
//! `--no-diagnosis` runs none.

use std::path::Path;
use std::process::ExitCode;

use serde_json::{Map, Value};

use modelmill_lab::case::{HiddenCase, class_of};
use modelmill_lab::harness::{
    BenchmarkOptions, BenchmarkUsage, TestedProgram, WORKERS, folder_of_case, run_benchmark, work_off, write,
};
use modelmill_lab::judge::{self, AnswerMark, CaseClass, judge};
use modelmill_lab::outside::OutsideLaw;
use modelmill_lab::placed::PlacedEffect;
use modelmill_lab::plant::{DRIVES, SpidermillPlant};
use modelmill_lab::record;
use modelmill_lab::table::{self, CaseScore};

const USAGE: BenchmarkUsage = BenchmarkUsage {
    line: "cargo bench -p modelmill-lab --bench hidden_effects -- [--count 240] [--seed 1] \
           [--only one|two|none|outside] [--keep DIR] [--list] [--program PATH] [--no-diagnosis]",
    values: &[("count", "240"), ("seed", "1"), ("only", ""), ("keep", "")],
    switches: &["list", "no-diagnosis"],
    takes_folder: false,
};

/// Settings of a run.
struct Inquiry<'a> {
    seed: u64,
    plant: &'a SpidermillPlant,
    /// Folder in which recordings are kept.
    keep: Option<&'a Path>,
    /// Whether to print what is hidden without recordings.
    list: bool,
    /// The tested program; `None` if only recordings are written.
    program: Option<&'a TestedProgram>,
}

/// Result of a case.
struct Done {
    name: String,
    /// Entry of `truth.json`.
    truth: Value,
    line: String,
    score: Option<CaseScore>,
}

fn main() -> ExitCode {
    run_benchmark(&USAGE, run)
}

fn run(options: &BenchmarkOptions) -> Result<(), String> {
    let class = match options.text("only") {
        "" => None,
        name => {
            let class = CaseClass::ALL.into_iter().find(|class| class.name() == name);
            Some(class.ok_or_else(|| format!("there is no class `{name}`; use one, two, none or outside"))?)
        }
    };
    let numbers: Vec<u64> = (1..)
        .filter(|number| class.is_none_or(|only| class_of(*number).0 == only))
        .take(options.number("count")?)
        .collect();
    let plant = SpidermillPlant::load()?;
    let list = options.has("list");
    let program = if list || options.has("no-diagnosis") {
        None
    } else {
        Some(options.program()?)
    };
    let inquiry = Inquiry {
        seed: options.number("seed")?,
        plant: &plant,
        keep: options.path("keep"),
        list,
        program: program.as_ref(),
    };
    let done = work_off(&numbers, WORKERS, |number, folder| inquiry.one(*number, folder))?;
    if let (Some(keep), false) = (inquiry.keep, list) {
        let truths: Map<String, Value> = done.iter().map(|one| (one.name.clone(), one.truth.clone())).collect();
        let text = format!("{:#}\n", Value::Object(truths));
        write(&keep.join("truth.json"), &text)?;
    }
    if program.is_none() {
        for one in &done {
            println!("{}", one.line);
        }
        return Ok(());
    }
    let scores: Vec<CaseScore> = done.into_iter().filter_map(|one| one.score).collect();
    print!("{}", table::report(&scores, inquiry.seed));
    Ok(())
}

impl Inquiry<'_> {
    /// Draws a case, records it, runs the diagnosis and marks the answer.
    fn one(&self, number: u64, folder: &Path) -> Result<Done, String> {
        let case = HiddenCase::draw(self.plant, self.seed, number)?;
        let recording = format!(
            "{}, {}, noise {} N",
            case.repeats.word(),
            if case.full { "full states" } else { "positions only" },
            case.noise
        );
        let line = format!(
            "{:>4} {:<8}{} | error {:.2} % fit, {:.2} % validation | {recording}",
            number,
            case.class.name(),
            case.truth(),
            100.0 * case.errors[0],
            100.0 * case.errors[1]
        );
        let name = case.name();
        if self.list {
            return Ok(Done {
                name,
                truth: Value::Null,
                line,
                score: None,
            });
        }
        let place = folder_of_case(self.keep, &name, folder)?;
        let mut floor = [0.0; 2];
        let files = record::FILES.map(|file| place.join(file));
        for (which, file) in files.iter().enumerate() {
            let recorded = record::record(&case, self.seed, which)?;
            floor[which] = recorded.floor;
            write(file, &recorded.csv)?;
        }
        let doubles = if self.keep.is_some() {
            case.doubles(self.plant)?
        } else {
            Vec::new()
        };
        let truth = case.json(self.seed, floor, &doubles);
        let Some(program) = self.program else {
            return Ok(Done {
                name,
                truth,
                line,
                score: None,
            });
        };
        let (answer, took) = program.diagnose(&self.plant.model, &files);
        let (answer, mark, aliases) = match answer {
            Err(why) => (None, AnswerMark::Failed(why), [0, 0]),
            Ok(answer) => {
                let mut excess = |claims: &[PlacedEffect]| case.excess(self.plant, claims).unwrap_or(f64::INFINITY);
                let law = case.outside.as_ref().map(|outside| outside.law);
                let named = law.and_then(OutsideLaw::disturbance);
                let mark = judge(case.class, &case.placed(), named, &answer, &mut excess);
                let aliases = judge::aliases(&answer, &mut excess);
                (Some(answer), mark, aliases)
            }
        };
        let score = CaseScore {
            number,
            class: case.class,
            label: case.label.clone(),
            truth: case.truth(),
            recording,
            drive: case.outside.as_ref().map(|outside| DRIVES[outside.at]),
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
}
