//! Plain C99 of a model, compiled for any processor of its kind as the Rust is, and timed one state at a time.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use modelmill_codegen::Derivation;
use modelmill_emit::{EmissionRequest, LANGUAGES};

use crate::models::{Motion, STATES};

/// What the page calls it.
pub(crate) const C99: &str = "C99";

/// The program and the file of states that it reads; what went wrong otherwise. `forces` are those of the emitted Rust.
pub(crate) fn compiled(
    derivation: &Derivation,
    motion: &Motion,
    forces: &[Vec<f64>],
) -> Result<(PathBuf, PathBuf), String> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c99");
    let fault = |error: std::io::Error| format!("{}: {error}", folder.display());
    std::fs::create_dir_all(&folder).map_err(fault)?;
    let language = LANGUAGES.iter().find(|l| l.name() == "c99");
    let language = language.ok_or("there is no language c99")?;
    let files = language.emit_files(&EmissionRequest {
        derivation,
        dynamics: None,
        reactions: None,
        self_test: false,
    });
    let mut header = String::new();
    let mut sources = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/page/peer/c99.c")];
    for file in files {
        let path = folder.join(&file.path);
        std::fs::write(&path, file.text).map_err(fault)?;
        match file.path.strip_suffix(".h") {
            Some(name) => name.clone_into(&mut header),
            None => sources.push(path),
        }
    }
    let mut table = String::new();
    for i in 0..STATES {
        let columns = [&motion.q, &motion.qd, &motion.qdd].into_iter().flatten();
        for column in columns.chain(forces) {
            _ = write!(table, "{:e} ", column[i]);
        }
        table.push('\n');
    }
    let states = folder.join(format!("{header}.txt"));
    std::fs::write(&states, table).map_err(fault)?;
    let program = folder.join(&header);
    let output = Command::new("cc")
        .args(["-std=c99", "-O3", "-DNDEBUG", "-I"])
        .arg(&folder)
        .arg(format!("-DHEADER=\"{header}.h\""))
        .arg(format!("-DNAME(x)={header}_##x"))
        .arg(format!("-DUPPER(x)={}_##x", header.to_uppercase()))
        .args(&sources)
        .args(["-lm", "-o"])
        .arg(&program)
        .output()
        .map_err(|error| format!("cc: {error}"))?;
    if output.status.success() {
        return Ok((program, states));
    }
    let errors = String::from_utf8_lossy(&output.stderr);
    let first = errors.lines().find(|line| line.contains("error"));
    Err(first.unwrap_or("no message").to_owned())
}
