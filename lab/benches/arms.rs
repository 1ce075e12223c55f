//! Real machines from models of their bodies alone: errors before and after the effects of `diagnose`, and force noise.
//!
//! `cargo bench -p modelmill-lab --bench arms -- [--only NAME] [--program PATH]`. The recordings are in a folder next
//! to the project. A machine without recordings is reported and skipped. Figures are relative 2-norms over all drives.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use modelmill_lab::harness::{
    BenchmarkOptions, BenchmarkUsage, TestedProgram, in_project, read, run_benchmark, work_off, write,
};
use serde_json::Value;

/// A machine with its recordings.
struct Machine {
    name: &'static str,
    model: Model,
    /// Recordings, relative to `shared/data`.
    fit: &'static [&'static str],
    check: Option<&'static str>,
}

/// The model file of a machine.
enum Model {
    /// A bundled model, whose effects are removed.
    Bundled(&'static str),
    /// A model in the folder of the recordings.
    Beside(&'static str),
}

const MACHINES: [Machine; 5] = [
    Machine {
        name: "EMPS, a ball-screw axis",
        model: Model::Bundled("emps"),
        fit: &["emps/emps_train.csv"],
        check: Some("emps/emps_pulses.csv"),
    },
    Machine {
        name: "Panda, seven joints",
        model: Model::Bundled("panda"),
        fit: &["panda/fit.csv"],
        check: Some("panda/check.csv"),
    },
    Machine {
        name: "TX40, six joints",
        model: Model::Bundled("tx40"),
        fit: &["tx40/tx40_motor_5kHz.csv"],
        check: None,
    },
    Machine {
        name: "Cloos QRC350, six joints",
        model: Model::Bundled("cloos"),
        fit: &["cloos-qrc350/traj_A.csv"],
        check: Some("cloos-qrc350/traj_C.csv"),
    },
    Machine {
        name: "KUKA KR300, six joints",
        model: Model::Beside("kuka-kr300/kuka_rigid.toml"),
        fit: &["kuka-kr300/kuka_A.csv", "kuka-kr300/kuka_B.csv"],
        check: Some("kuka-kr300/kuka_C.csv"),
    },
];

const USAGE: BenchmarkUsage = BenchmarkUsage {
    line: "cargo bench -p modelmill-lab --bench arms -- [--only NAME] [--program PATH]",
    values: &[("only", "")],
    switches: &[],
    takes_folder: false,
};

fn main() -> ExitCode {
    run_benchmark(&USAGE, run)
}

fn run(options: &BenchmarkOptions) -> Result<(), String> {
    let data = in_project("../shared/data");
    let only = options.text("only");
    let machines: Vec<&Machine> = (MACHINES.iter()).filter(|one| one.name.contains(only)).collect();
    let program = options.program()?;
    // One machine at a time, because the run time is measured.
    let rows = work_off(&machines, 1, |machine, folder| {
        let mut files = machine.fit.iter().chain(&machine.check);
        if !files.all(|file| data.join(file).is_file()) {
            return Ok(format!(
                "{}: skipped, because its recordings are not in shared/data next to the project",
                machine.name
            ));
        }
        let model = match &machine.model {
            Model::Beside(path) => data.join(path),
            Model::Bundled(name) => bare(&in_project("model-spec/models"), name, folder)?,
        };
        machine.row(&program, &model, &data)
    })?;
    println!("| machine | bodies alone, fit / validation | with the effects found | effects | noise | s |");
    println!("|---|---|---|---|---|---|");
    for row in rows {
        println!("{row}");
    }
    Ok(())
}

/// Writes a model file that extends a bundled one and removes its effects.
fn bare(models: &Path, name: &str, scratch: &Path) -> Result<PathBuf, String> {
    let model = models.join(format!("{name}.toml"));
    let text = read(&model)?;
    let mut removed = Vec::new();
    let mut is_effect = false;
    for line in text.lines() {
        if line.starts_with('[') {
            is_effect = line == "[[effect]]";
        } else if let (true, Some(name)) = (is_effect, line.strip_prefix("name = \"")) {
            removed.push(format!("effect.{}", name.trim_end_matches('"')));
        }
    }
    let path = scratch.join(format!("{name}-bodies.toml"));
    let whole = model.canonicalize();
    let whole = whole.map_err(|e| format!("{}: {e}", model.display()))?;
    let whole = whole.display().to_string();
    let text = format!("schema = 1\nname = \"bodies\"\nextends = {whole:?}\nremove = {removed:?}\n");
    write(&path, &text)?;
    Ok(path)
}

impl Machine {
    /// Runs the diagnosis and returns a row of the table.
    fn row(&self, program: &TestedProgram, model: &Path, data: &Path) -> Result<String, String> {
        let fit: Vec<PathBuf> = self.fit.iter().map(|file| data.join(file)).collect();
        let check: Vec<PathBuf> = self.check.iter().map(|file| data.join(file)).collect();
        let (answer, took) = program.diagnose_for_json(model, &fit, &check);
        let answer = answer.map_err(|fault| fault.whole_complaint())?;
        let took = took.as_secs_f64();
        let steps = answer["steps"].as_array().cloned().unwrap_or_default();
        let errors = |step: Option<&Value>| {
            let [fit, check] = ["fit", "check"].map(|key| percent(step.map(|s| &s[key])));
            format!("{fit} / {check}")
        };
        Ok(format!(
            "| {} | {} | {} | {} | {} | {took:.0} |",
            self.name,
            errors(steps.first()),
            errors(steps.last()),
            answer["effects"].as_array().map_or(0, Vec::len),
            percent(Some(&answer["noise_floor"])),
        ))
    }
}

/// A share as per cent with one decimal; `-` if there is none.
fn percent(share: Option<&Value>) -> String {
    let share = share.and_then(Value::as_f64);
    share.map_or_else(|| "-".to_owned(), |share| format!("{:.1} %", 100.0 * share))
}
