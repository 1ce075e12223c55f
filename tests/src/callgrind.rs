//! Instructions that a benchmark carries out, counted by valgrind.
//!
//! A benchmark runs itself again under callgrind, with arguments that say what to do; only what happens in
//! [`repeat_calls`] is counted. The counts do not depend on the load of the machine.

use std::process::Command;

/// Whether valgrind is on this machine.
pub fn is_available() -> bool {
    Command::new("valgrind").arg("--version").output().is_ok()
}

/// Instructions inside [`repeat_calls`] in a run of this program with some arguments.
///
/// Fails with what the program or valgrind printed.
pub fn count_instructions(arguments: &[&str]) -> Result<f64, String> {
    let own = std::env::current_exe().map_err(|error| error.to_string())?;
    let output = Command::new("valgrind")
        .args([
            "--tool=callgrind",
            "--callgrind-out-file=/dev/null",
            "--toggle-collect=*repeat_calls*",
        ])
        .arg(own)
        .args(arguments)
        .output()
        .map_err(|error| format!("valgrind: {error}"))?;
    let text = String::from_utf8_lossy(&output.stderr);
    let line = text.lines().find(|line| line.contains("Collected :"));
    let count = line.and_then(|line| line.rsplit(' ').next()?.parse().ok());
    count.ok_or_else(|| format!("valgrind counted nothing: {text}"))
}

/// Calls a function with 0, 1 and so on; the only function that is counted.
#[inline(never)]
pub fn repeat_calls(calls: usize, call: &mut dyn FnMut(usize)) {
    for k in 0..calls {
        call(k);
    }
}
