//! The command line of a benchmark.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;

use super::TestedProgram;

/// What a benchmark can be asked for. All of them know `--program PATH`.
pub struct BenchmarkUsage {
    /// The whole line, for who asks for something else.
    pub line: &'static str,
    /// Options with a value, and what they are without.
    pub values: &'static [(&'static str, &'static str)],
    /// Options without a value.
    pub switches: &'static [&'static str],
    /// Whether a folder may be named beside the options.
    pub takes_folder: bool,
}

/// What a command line asks for.
pub struct BenchmarkOptions {
    values: Vec<(&'static str, String)>,
    switches: Vec<&'static str>,
    folder: Option<PathBuf>,
}

/// Reads the command line of this process and runs a benchmark. Status 0 done, 1 failed, 2 wrong usage.
pub fn run_benchmark(usage: &BenchmarkUsage, run: impl FnOnce(&BenchmarkOptions) -> Result<(), String>) -> ExitCode {
    let options = match BenchmarkOptions::read(usage, std::env::args().skip(1)) {
        Ok(options) => options,
        Err(says) => {
            eprintln!("{says}; {}", usage.line);
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

impl BenchmarkOptions {
    /// Reads arguments; fails with what is not known.
    pub fn read(usage: &BenchmarkUsage, mut args: impl Iterator<Item = String>) -> Result<Self, String> {
        let known = usage.values.iter().chain(&[("program", "")]);
        let mut options = Self {
            values: known.map(|(name, usual)| (*name, (*usual).to_owned())).collect(),
            switches: Vec::new(),
            folder: None,
        };
        while let Some(arg) = args.next() {
            // Cargo says so to every benchmark.
            if arg == "--bench" {
                continue;
            }
            let Some(name) = arg.strip_prefix("--") else {
                if !usage.takes_folder || options.folder.is_some() {
                    return Err(format!("unknown argument `{arg}`"));
                }
                options.folder = Some(PathBuf::from(arg));
                continue;
            };
            if let Some(switch) = usage.switches.iter().find(|switch| **switch == name) {
                options.switches.push(switch);
                continue;
            }
            let of_name = options.values.iter_mut().find(|(known, _)| *known == name);
            let option = of_name.ok_or_else(|| format!("unknown argument `{arg}`"))?;
            option.1 = args.next().ok_or_else(|| format!("{arg} lacks its value"))?;
        }
        Ok(options)
    }

    /// The text of an option; empty where neither the command line nor the benchmark gives one.
    pub fn text(&self, name: &str) -> &str {
        let of_name = self.values.iter().find(|(known, _)| *known == name);
        of_name.map_or("", |(_, value)| value)
    }

    /// The number of an option.
    pub fn number<T: FromStr>(&self, name: &str) -> Result<T, String> {
        let text = self.text(name);
        text.parse().map_err(|_| format!("--{name}: `{text}` is no number"))
    }

    /// The path of an option that was given.
    pub fn path(&self, name: &str) -> Option<&Path> {
        Some(self.text(name)).filter(|text| !text.is_empty()).map(Path::new)
    }

    /// Whether an option without a value was given.
    pub fn has(&self, switch: &str) -> bool {
        self.switches.contains(&switch)
    }

    /// The folder beside the options.
    pub fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// Who is asked: option `program`, or the program of this project, which is built for that.
    pub fn program(&self) -> Result<TestedProgram, String> {
        match self.path("program") {
            Some(given) => Ok(TestedProgram::new(given)),
            None => TestedProgram::build(),
        }
    }
}
