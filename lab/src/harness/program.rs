//! The program that is asked: built, run, and its answers read.

use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::answer::ProgramAnswer;

/// A build of modelmill.
pub struct TestedProgram {
    path: PathBuf,
}

/// Why there is no answer.
#[derive(Debug)]
pub enum ProgramFault {
    /// The program did not run.
    NotStarted(String),
    /// It ended with another status than 0.
    Refused {
        /// How it ended.
        status: ExitStatus,
        /// What it printed on standard error, without empty lines.
        complaint: Vec<String>,
    },
    /// What it printed is not what is expected.
    Unreadable(String),
}

impl fmt::Display for ProgramFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotStarted(why) => write!(f, "cannot start: {why}"),
            Self::Refused { status, complaint } => {
                let last = complaint.last().map_or("no message", String::as_str);
                write!(f, "{status}: {last}")
            }
            Self::Unreadable(why) => f.write_str(why),
        }
    }
}

impl ProgramFault {
    /// All that the program says against what it was asked, in one line.
    pub fn whole_complaint(&self) -> String {
        match self {
            Self::Refused { complaint, .. } => complaint.join(" | "),
            other => other.to_string(),
        }
    }
}

impl TestedProgram {
    /// A program that is there.
    pub fn new(path: &Path) -> Self {
        Self { path: path.to_owned() }
    }

    /// The program of this project, built with the profile of the benchmark. Cargo, which runs benchmarks, does nothing if it
    /// is there already.
    pub fn build() -> Result<Self, String> {
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let mut command = Command::new(cargo);
        command.current_dir(super::in_project(""));
        command.args(["build", "-p", "modelmill-cli", "--bin", "modelmill"]);
        command.arg("--message-format=json-render-diagnostics");
        if !cfg!(debug_assertions) {
            command.arg("--release");
        }
        let output = command
            .stderr(Stdio::inherit())
            .output()
            .map_err(|error| format!("cargo: {error}"))?;
        if !output.status.success() {
            return Err("the program cannot be built".to_owned());
        }
        // Cargo says where it puts things, in one JSON object per line.
        let said = String::from_utf8_lossy(&output.stdout);
        let mut objects = said.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        let program = objects.find_map(|said| {
            let is_it = said["target"]["name"] == "modelmill";
            said["executable"].as_str().filter(|_| is_it).map(PathBuf::from)
        });
        let path = program.ok_or("cargo does not say where the program is")?;
        Ok(Self { path })
    }

    /// What the program prints.
    pub fn run(&self, args: &[impl AsRef<OsStr>]) -> Result<String, ProgramFault> {
        let output = Command::new(&self.path).args(args).output();
        let output = output.map_err(|error| ProgramFault::NotStarted(format!("{}: {error}", self.path.display())))?;
        if output.status.success() {
            return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
        }
        let complaint = String::from_utf8_lossy(&output.stderr);
        let lines = complaint.lines().filter(|line| !line.trim().is_empty());
        Err(ProgramFault::Refused {
            status: output.status,
            complaint: lines.map(str::to_owned).collect(),
        })
    }

    /// What the program prints, as JSON.
    pub fn run_for_json(&self, args: &[impl AsRef<OsStr>]) -> Result<Value, ProgramFault> {
        let text = self.run(args)?;
        serde_json::from_str(&text).map_err(|error| ProgramFault::Unreadable(format!("JSON: {error}")))
    }

    /// What `diagnose MODEL --data FIT --check CHECK --json` prints, and how long it took.
    pub fn diagnose_for_json(
        &self,
        model: &Path,
        fit: &[PathBuf],
        check: &[PathBuf],
    ) -> (Result<Value, ProgramFault>, Duration) {
        let mut args = vec![OsStr::new("diagnose"), model.as_os_str()];
        for (option, files) in [("--data", fit), ("--check", check)] {
            if !files.is_empty() {
                args.push(OsStr::new(option));
                args.extend(files.iter().map(|file| file.as_os_str()));
            }
        }
        args.push(OsStr::new("--json"));
        let start = Instant::now();
        let answer = self.run_for_json(&args);
        (answer, start.elapsed())
    }

    /// The same for one recording each, read as far as it is scored; a fault is told in words.
    pub fn diagnose(&self, model: &Path, [fit, check]: &[PathBuf; 2]) -> (Result<ProgramAnswer, String>, Duration) {
        let (answer, took) = self.diagnose_for_json(model, std::slice::from_ref(fit), std::slice::from_ref(check));
        let answer = answer.map_err(|fault| fault.to_string());
        (answer.and_then(|value| ProgramAnswer::from_json(&value)), took)
    }
}
