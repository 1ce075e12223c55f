//! The command line of a benchmark: usage and arguments go in; typed options come out.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;

use super::TestedProgram;

/// Options that a benchmark accepts, in addition to `--program PATH`.
pub struct BenchmarkUsage {
    /// Usage line, which is printed after wrong arguments.
    pub line: &'static str,
    /// Options with a value, each with its default.
    pub values: &'static [(&'static str, &'static str)],
    /// Options without a value.
    pub switches: &'static [&'static str],
    /// Whether a folder is accepted as an argument without an option.
    pub takes_folder: bool,
}

/// Options of one call.
pub struct BenchmarkOptions {
    /// Options with their values, given or default.
    values: Vec<(&'static str, String)>,
    /// Given options without a value.
    switches: Vec<&'static str>,
    /// The folder, if one is given.
    folder: Option<PathBuf>,
}

/// Reads the command line of this process and runs a benchmark. Exit status: 0 success, 1 failure, 2 wrong usage.
pub fn run_benchmark(usage: &BenchmarkUsage, run: impl FnOnce(&BenchmarkOptions) -> Result<(), String>) -> ExitCode {
    let options = match BenchmarkOptions::read(usage, std::env::args().skip(1)) {
        Ok(options) => options,
        Err(says) => {
            eprintln!("{says}; usage: {}", usage.line);
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
    /// Reads arguments; fails for an unknown argument or a missing value, and names it.
    pub fn read(usage: &BenchmarkUsage, mut args: impl Iterator<Item = String>) -> Result<Self, String> {
        let known = usage.values.iter().chain(&[("program", "")]);
        let mut options = Self {
            values: known.map(|(name, usual)| (*name, (*usual).to_owned())).collect(),
            switches: Vec::new(),
            folder: None,
        };
        while let Some(arg) = args.next() {
            // Cargo passes this flag to every benchmark.
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
            option.1 = args.next().ok_or_else(|| format!("{arg} needs a value"))?;
        }
        Ok(options)
    }

    /// The text of an option; empty if it is not given and has no default.
    pub fn text(&self, name: &str) -> &str {
        let of_name = self.values.iter().find(|(known, _)| *known == name);
        of_name.map_or("", |(_, value)| value)
    }

    /// The number of an option; fails if its text is not a number.
    pub fn number<T: FromStr>(&self, name: &str) -> Result<T, String> {
        let text = self.text(name);
        text.parse().map_err(|_| format!("--{name}: `{text}` is not a number"))
    }

    /// The path of an option; `None` if its text is empty.
    pub fn path(&self, name: &str) -> Option<&Path> {
        Some(self.text(name)).filter(|text| !text.is_empty()).map(Path::new)
    }

    /// Whether an option without a value is given.
    pub fn has(&self, switch: &str) -> bool {
        self.switches.contains(&switch)
    }

    /// The folder of the command line; `None` if there is none.
    pub fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// The tested program: the one of option `program`, or that of this project, which is then built.
    pub fn program(&self) -> Result<TestedProgram, String> {
        match self.path("program") {
            Some(given) => Ok(TestedProgram::new(given)),
            None => TestedProgram::build(),
        }
    }
}
