//! Asks the program for its diagnosis.

use std::ffi::OsStr;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use super::answer::Answer;

/// Runs `PROGRAM diagnose MODEL --data FIT --check CHECK --json`; the answer, or why there is none, and how long it took.
pub(crate) fn diagnose(
    program: &OsStr,
    model: &Path,
    fit: &Path,
    check: &Path,
) -> (Result<Answer, String>, Duration) {
    let start = Instant::now();
    let output = Command::new(program)
        .arg("diagnose")
        .arg(model)
        .arg("--data")
        .arg(fit)
        .arg("--check")
        .arg(check)
        .arg("--json")
        .output();
    let took = start.elapsed();
    let answer = match output {
        Err(error) => Err(format!("cannot start: {error}")),
        Ok(output) if !output.status.success() => {
            let says = String::from_utf8_lossy(&output.stderr);
            let last = says.lines().rev().find(|line| !line.trim().is_empty());
            Err(format!(
                "{}: {}",
                output.status,
                last.unwrap_or("no message")
            ))
        }
        Ok(output) => Answer::read(&String::from_utf8_lossy(&output.stdout)),
    };
    (answer, took)
}
