//! Runs programs on one core and reads the figures that they print.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

/// Whether programs can be held on one core, and which.
pub(crate) fn core() -> Option<&'static str> {
    static CORE: OnceLock<Option<String>> = OnceLock::new();
    let found = CORE.get_or_init(|| {
        let wanted = std::env::var("MODELMILL_CORE").unwrap_or_else(|_| "0".to_owned());
        let works = Command::new("taskset").args(["-c", &wanted, "true"]).status();
        works.is_ok_and(|status| status.success()).then_some(wanted)
    });
    found.as_deref()
}

/// A program that stays on one core, if there is a way to hold it there.
pub(crate) fn pinned(program: &Path) -> Command {
    match core() {
        Some(core) => {
            let mut command = Command::new("taskset");
            command.args(["-c", core]).arg(program);
            command
        }
        None => Command::new(program),
    }
}

/// This program with other arguments.
pub(crate) fn itself(arguments: &[&str]) -> Command {
    let program = std::env::current_exe().expect("this program has a path");
    let mut command = pinned(&program);
    command.args(arguments);
    command
}

/// The lines `name TAB number` of a program; what went wrong otherwise.
pub(crate) fn figures(mut command: Command) -> Result<BTreeMap<String, f64>, String> {
    let output = command.output().map_err(|error| error.to_string())?;
    if !output.status.success() {
        let errors = String::from_utf8_lossy(&output.stderr);
        return Err(errors.lines().last().unwrap_or("no message").to_owned());
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let lines = text.lines().filter_map(|line| line.split_once('\t'));
    Ok(lines
        .filter_map(|(name, number)| Some((name.to_owned(), number.parse().ok()?)))
        .collect())
}

/// Processor time of this thread so far, ns; the clock's where the system does not tell.
pub(crate) fn processor_time() -> f64 {
    static START: OnceLock<std::time::Instant> = OnceLock::new();
    let start = START.get_or_init(std::time::Instant::now);
    // The kernel brings the figure up to date when a thread offers to stop, and else a few times in a hundredth of a second.
    std::thread::yield_now();
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let told = told.and_then(|text| text.split(' ').next()?.parse().ok());
    told.unwrap_or_else(|| start.elapsed().as_secs_f64() * 1e9)
}
