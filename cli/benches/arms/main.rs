//! Real machines from their bodies alone: how far the error falls with what `diagnose` finds, beside the noise of the forces.
//!
//! `cargo bench -p modelmill-cli --bench arms -- [--only NAME] [--program PATH]`. The recordings lie beside the project and are
//! not copied; a machine without them is left out, with a word. Figures are relative 2-norms over all drives.

use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::time::Instant;

use serde_json::Value;

/// A machine with its recordings.
struct Machine {
    name: &'static str,
    model: Model,
    /// Below `shared/data`.
    fit: &'static [&'static str],
    check: Option<&'static str>,
}

enum Model {
    /// A bundled one, whose effects are taken out.
    Bundled(&'static str),
    /// One that lies with the recordings.
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

fn main() -> ExitCode {
    match run(std::env::args().skip(1)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(says) => {
            eprintln!("{says}");
            ExitCode::FAILURE
        }
    }
}

fn run(mut args: impl Iterator<Item = String>) -> Result<(), String> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (mut only, mut program) = (
        String::new(),
        PathBuf::from(env!("CARGO_BIN_EXE_modelmill")),
    );
    while let Some(arg) = args.next() {
        let mut value = || args.next().ok_or_else(|| format!("{arg} lacks its value"));
        match arg.as_str() {
            // Cargo says so to every benchmark.
            "--bench" => {}
            "--only" => only = value()?,
            "--program" => program = PathBuf::from(value()?),
            _ => {
                return Err(format!(
                    "unknown argument `{arg}`; [--only NAME] [--program PATH]"
                ));
            }
        }
    }
    let data = here.join("../../shared/data");
    let scratch = std::env::temp_dir().join(format!("modelmill-arms-{}", std::process::id()));
    std::fs::create_dir_all(&scratch).map_err(|e| format!("{}: {e}", scratch.display()))?;
    println!("| machine | bodies alone, fit / check | with what is found | effects | noise | s |");
    println!("|---|---|---|---|---|---|");
    for machine in MACHINES.iter().filter(|one| one.name.contains(&only)) {
        let mut files = machine.fit.iter().chain(&machine.check);
        if !files.all(|file| data.join(file).is_file()) {
            println!(
                "{}: there are no recordings beside the project",
                machine.name
            );
            continue;
        }
        let model = match &machine.model {
            Model::Beside(path) => data.join(path),
            Model::Bundled(name) => bare(&here.join("../model-spec/models"), name, &scratch)?,
        };
        println!("{}", machine.row(&program, &model, &data)?);
    }
    std::fs::remove_dir_all(&scratch).map_err(|e| format!("{}: {e}", scratch.display()))
}

/// A bundled model without its effects, as a file that extends it.
fn bare(models: &Path, name: &str, scratch: &Path) -> Result<PathBuf, String> {
    let model = models.join(format!("{name}.toml"));
    let text = std::fs::read_to_string(&model).map_err(|e| format!("{}: {e}", model.display()))?;
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
    let text =
        format!("schema = 1\nname = \"bodies\"\nextends = {whole:?}\nremove = {removed:?}\n");
    std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
    Ok(path)
}

impl Machine {
    /// Asks the program, and tells what came of it as a row of a table.
    fn row(&self, program: &Path, model: &Path, data: &Path) -> Result<String, String> {
        let mut command = Command::new(program);
        command.arg("diagnose").arg(model).arg("--data");
        command.args(self.fit.iter().map(|file| data.join(file)));
        if let Some(check) = self.check {
            command.arg("--check").arg(data.join(check));
        }
        let start = Instant::now();
        let output = command.arg("--json").output();
        let output = output.map_err(|e| format!("{}: {e}", program.display()))?;
        let took = start.elapsed().as_secs_f64();
        let answer: Value = serde_json::from_slice(&output.stdout)
            .map_err(|_| String::from_utf8_lossy(&output.stderr).into_owned())?;
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

fn percent(share: Option<&Value>) -> String {
    let share = share.and_then(Value::as_f64);
    share.map_or_else(|| "-".to_owned(), |share| format!("{:.1} %", 100.0 * share))
}
