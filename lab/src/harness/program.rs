//! The tested program: arguments go in; its output comes out as text, JSON or answer.

use std::ffi::OsStr;
use std::fmt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::answer::ProgramAnswer;

/// An executable of modelmill.
pub struct TestedProgram {
    /// Path of the executable.
    path: PathBuf,
}

/// The reason why there is no answer.
#[derive(Debug)]
pub enum ProgramFault {
    /// The program could not be started; the text names it with the reason.
    NotStarted(String),
    /// The program ended with another status than 0.
    Refused {
        /// Its exit status.
        status: ExitStatus,
        /// Lines of standard error, without empty ones.
        complaint: Vec<String>,
    },
    /// The output does not have the expected format.
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
    /// All lines of the error of the program, joined to one line.
    pub fn whole_complaint(&self) -> String {
        match self {
            Self::Refused { complaint, .. } => complaint.join(" | "),
            other => other.to_string(),
        }
    }
}

impl TestedProgram {
    /// An existing executable; the path is not checked.
    pub fn new(path: &Path) -> Self {
        Self { path: path.to_owned() }
    }

    /// Builds the program of this project with the profile of the benchmark.
    ///
    /// Cargo does nothing if it is up to date.
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
            return Err("the program cannot be built; the messages of cargo above state why".to_owned());
        }
        // Cargo prints one JSON object per line; that of the program has the path of the executable.
        let said = String::from_utf8_lossy(&output.stdout);
        let mut objects = said.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        let program = objects.find_map(|said| {
            let is_it = said["target"]["name"] == "modelmill";
            said["executable"].as_str().filter(|_| is_it).map(PathBuf::from)
        });
        let path = program.ok_or("the output of cargo does not name the executable of modelmill")?;
        Ok(Self { path })
    }

    /// Runs the program and returns its standard output.
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

    /// Runs the program and returns its standard output as JSON.
    pub fn run_for_json(&self, args: &[impl AsRef<OsStr>]) -> Result<Value, ProgramFault> {
        let text = self.run(args)?;
        serde_json::from_str(&text).map_err(|error| ProgramFault::Unreadable(format!("JSON: {error}")))
    }

    /// Output of `diagnose MODEL --data FIT --check CHECK --json`, with its run time.
    pub fn diagnose_for_json(
        &self,
        model: &Path,
        fit: &[PathBuf],
        check: &[PathBuf],
    ) -> (Result<Value, ProgramFault>, Duration) {
        let mut args = vec![OsStr::new("diagnose"), model.as_os_str()];
        // An option without files is not passed.
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

    /// The scored parts of the same output for one recording each; an error is text.
    pub fn diagnose(&self, model: &Path, [fit, check]: &[PathBuf; 2]) -> (Result<ProgramAnswer, String>, Duration) {
        let (answer, took) = self.diagnose_for_json(model, std::slice::from_ref(fit), std::slice::from_ref(check));
        let answer = answer.map_err(|fault| fault.to_string());
        (answer.and_then(|value| ProgramAnswer::from_json(&value)), took)
    }
}
