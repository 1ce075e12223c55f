//! Beyond: recordings with faults that the other benchmarks do not draw, made by independent programs. Reads the cases
//! of a folder, runs `diagnose` on each, and prints a mark for each answer and the totals.
//!
//! A case is a folder with `model.toml`, recordings and `truth.json`, see `../shared/data/beyond/README.md`.
//! Usage: `cargo bench --bench beyond -- [FOLDER] [--only PART-OF-NAME] [--program PATH]`

mod judge;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use serde_json::Value;

use modelmill_lab::harness::{
    BenchmarkOptions, BenchmarkUsage, ProgramFault, TestedProgram, WORKERS, in_project, read, run_benchmark, work_off,
};

use judge::{FaultMark, JudgedAnswer, MARKS, judge};

const USAGE: BenchmarkUsage = BenchmarkUsage {
    line: "beyond [FOLDER] [--only PART-OF-NAME] [--program PATH]",
    values: &[("only", "")],
    switches: &[],
    takes_folder: true,
};

fn main() -> ExitCode {
    run_benchmark(&USAGE, run)
}

/// Judges all cases of the folder.
fn run(options: &BenchmarkOptions) -> Result<(), String> {
    let usual = in_project("../shared/data/beyond");
    let folder = options.folder().unwrap_or(&usual);
    let entries = std::fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut cases: Vec<PathBuf> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.join("truth.json").is_file())
        .filter(|path| path.to_string_lossy().contains(options.text("only")))
        .collect();
    cases.sort();
    let program = options.program()?;
    let judged = work_off(&cases, WORKERS, |case, _| mark_case(&program, case))?;
    for (case, one) in cases.iter().zip(&judged) {
        let word = MARKS
            .iter()
            .find(|(mark, _)| *mark == one.mark)
            .map_or("", |(_, word)| word);
        let name = case.file_name().unwrap_or_default().to_string_lossy();
        println!("{word:<6} {name:<28} {}", one.false_claims.join("; "));
    }
    let count = |mark: FaultMark| judged.iter().filter(|one| one.mark == mark).count();
    let totals: Vec<String> = MARKS
        .iter()
        .map(|(mark, word)| format!("{} {word}", count(*mark)))
        .collect();
    println!("{} of {}", totals.join(", "), judged.len());
    Ok(())
}

/// Diagnoses the case of a folder with the options of its truth.
fn mark_case(program: &TestedProgram, case: &Path) -> Result<JudgedAnswer, String> {
    let path = case.join("truth.json");
    let truth: Value = serde_json::from_str(&read(&path)?).map_err(|error| format!("{}: {error}", path.display()))?;
    let texts = |name: &str| -> Vec<String> {
        let all = truth[name].as_array().into_iter().flatten();
        all.filter_map(|one| Some(one.as_str()?.to_owned())).collect()
    };
    let mut args = vec!["diagnose".to_owned(), case.join("model.toml").display().to_string()];
    // The first file is fitted, the second one is the validation run.
    for (option, file) in ["--data", "--check"].iter().zip(texts("files")) {
        args.extend([(*option).to_owned(), case.join(file).display().to_string()]);
    }
    args.extend(texts("options"));
    args.push("--json".to_owned());
    match program.run_for_json(&args) {
        Err(fault @ ProgramFault::NotStarted(_)) => Err(fault.to_string()),
        answer => Ok(judge(&truth, answer.ok().as_ref())),
    }
}
