//! How many samples per second least squares takes from states in memory, and the memory that it needs beside them.
//!
//! `cargo bench -p modelmill-tests --bench estimation`. One sample is one instant of all channels: regressor from the
//! states, orthogonal reduction, solution. The same work is done by numpy in the same run, if `python3` (or what
//! `MODELMILL_PYTHON` names) has it: this program writes the model's straight-line program as numpy code, which runs
//! over blocks of states and folds them into the triangle with LAPACK's QR.
//! Times are the processor's, from `/proc/self/schedstat`, so that other programs on the machine do not count.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::time::Instant;

use modelmill_codegen::expr::{Atom, Unary};
use modelmill_codegen::{Derivation, ModelEvaluator, PoseFault, ProgramOp, StraightLineProgram};
use modelmill_identify::{LeastSquares, LeastSquaresError};
use modelmill_tests::base_parameters;
use modelmill_tests::fixtures::{derived, fixtures};
use modelmill_tests::sample::Sample;
use modelmill_tests::stream::Stream;

fn main() {
    println!(
        "{:<14} {:>9} {:>22} {:>22} {:>14} {:>10} {:>8}",
        "model", "samples", "of processor time", "of wall time", "peak memory", "numpy", "ratio"
    );
    for (name, samples, reach) in [("five_bar-tied", 1_000_000, 0.2), ("panda", 100_000, 0.25)] {
        run(name, samples, reach);
    }
}

/// One model: the tool and numpy on the same numbers.
fn run(name: &str, samples: usize, reach: f64) {
    let derivation = derived(name);
    let sample = Sample::random(&derivation.mechanism, samples, reach, &mut Stream::new(7));
    let base = base_parameters::base(&derivation, &base_parameters::nominal(&derivation.mechanism));
    let evaluator = ModelEvaluator::new(&derivation);
    let mut noise = Stream::new(8);
    let mut measured = evaluator
        .inverse_dynamics(&sample.states(), &base)
        .expect("all states are within reach");
    for y in measured.iter_mut().flatten() {
        *y += noise.between(-1.0, 1.0);
    }
    let mut best = f64::INFINITY;
    let mut best_wall = f64::INFINITY;
    let mut memory = 0.0_f64;
    let mut values = Vec::new();
    for _ in 0..5 {
        let before = reset_peak();
        let (start, wall) = (processor_seconds(), Instant::now());
        values = identify(&derivation, &sample, &measured);
        best = best.min(processor_seconds() - start);
        best_wall = best_wall.min(wall.elapsed().as_secs_f64());
        memory = memory.max(status("VmHWM:") - before);
    }
    let rate = |seconds: f64| samples as f64 / seconds / 1e6;
    let numpy = numpy(name, &derivation, &sample, &measured, &values);
    println!(
        "{name:<14} {samples:>9} {:>15.2} Msample/s {:>15.2} Msample/s {memory:>10.1} MiB {:>10} {:>8}",
        rate(best),
        rate(best_wall),
        numpy.map_or("absent".to_owned(), |seconds| format!("{:.3}", rate(seconds))),
        numpy.map_or(String::new(), |seconds| format!("{:.1}", seconds / best)),
    );
}

#[derive(Debug)]
enum Fault {
    Pose,
    Rows,
}

impl From<PoseFault> for Fault {
    fn from(_: PoseFault) -> Self {
        Self::Pose
    }
}

impl From<LeastSquaresError> for Fault {
    fn from(_: LeastSquaresError) -> Self {
        Self::Rows
    }
}

/// What is timed: from states and forces in memory to the parameters.
fn identify(derivation: &Derivation, sample: &Sample, measured: &[Vec<f64>]) -> Vec<f64> {
    let (n, drives) = (derivation.reduction.retained.len(), measured.len());
    let mut regression = LeastSquares::with_channels(n, drives);
    let mut start = 0;
    ModelEvaluator::new(derivation)
        .regressor_blocks::<Fault>(&sample.states(), |len, columns| {
            for (drive, measured) in measured.iter().enumerate() {
                let columns = &columns[drive * n..(drive + 1) * n];
                regression.add_columns(drive, columns, &measured[start..start + len])?;
            }
            start += len;
            Ok(())
        })
        .expect("all states are within reach");
    regression.solve().expect("there are rows").values
}

/// Seconds that this process has had a processor.
fn processor_seconds() -> f64 {
    let text = fs::read_to_string("/proc/self/schedstat").expect("Linux");
    let nanoseconds = text.split_whitespace().next().expect("three numbers");
    nanoseconds.parse::<f64>().expect("a number") * 1e-9
}

/// A line of `/proc/self/status`, MiB.
fn status(line: &str) -> f64 {
    let text = fs::read_to_string("/proc/self/status").expect("Linux");
    let found = text.lines().find_map(|l| l.strip_prefix(line));
    let kib = found.and_then(|l| l.split_whitespace().next()).expect("a size");
    kib.parse::<f64>().expect("a number") / 1024.0
}

/// Forgets the peak so far; returns what is in use now, MiB.
fn reset_peak() -> f64 {
    fs::write("/proc/self/clear_refs", "5").expect("Linux");
    status("VmRSS:")
}

/// Seconds that numpy takes, its answer held against ours; nothing without numpy.
fn numpy(name: &str, derivation: &Derivation, sample: &Sample, measured: &[Vec<f64>], values: &[f64]) -> Option<f64> {
    let python = std::env::var("MODELMILL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("estimation-{name}"));
    fs::create_dir_all(&folder).expect("the target folder can be written");
    let write = |file: &str, columns: &[Vec<f64>]| {
        let bytes: Vec<u8> = columns.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        fs::write(folder.join(file), bytes).expect("the target folder can be written");
    };
    write("q", &sample.q);
    write("qd", &sample.qd);
    write("qdd", &sample.qdd);
    write("measured", measured);
    fs::write(folder.join("samples"), sample.len().to_string()).expect("as above");
    fs::write(folder.join("regressor.py"), source(derivation)).expect("as above");
    let script = fixtures().join("../benches/peer/least_squares.py");
    let output = Command::new(&python)
        .arg(&script)
        .arg(&folder)
        .env("OPENBLAS_NUM_THREADS", "1")
        .output()
        .ok()?;
    if !output.status.success() {
        eprintln!("{python}: {}", String::from_utf8_lossy(&output.stderr).trim());
        return None;
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let mut numbers = text
        .split_whitespace()
        .map(|word| word.parse::<f64>().expect("numbers"));
    let seconds = numbers.next().expect("the seconds");
    for (ours, theirs) in values.iter().zip(numbers) {
        assert!(
            (ours - theirs).abs() <= 1e-7 * theirs.abs().max(1e-3),
            "{ours} and {theirs}"
        );
    }
    Some(seconds)
}

/// The regressor's straight-line program as a numpy function of blocks of states.
fn source(derivation: &Derivation) -> String {
    let program: &StraightLineProgram = &derivation.programs.regressor;
    let mechanism = &derivation.mechanism;
    let active: Vec<usize> = (0..mechanism.coordinates.len())
        .filter(|i| !mechanism.coordinates[*i].passive)
        .collect();
    let place = |i: usize| active.iter().position(|a| *a == i).expect("closed loops");
    let mut text = "import numpy as np\n\ndef regressor(q, qd, qdd):\n".to_owned();
    for (i, op) in program.ops.iter().enumerate() {
        let v = |id: &modelmill_codegen::ValueId| format!("v{}", id.index());
        let value = match op {
            ProgramOp::Number(number) => format!("{:?}", number.to_f64()),
            ProgramOp::Input(Atom::Coordinate(c)) => format!("q[{}]", place(*c)),
            ProgramOp::Input(Atom::Rate(c)) => format!("qd[{}]", place(*c)),
            ProgramOp::Input(Atom::Acceleration(c)) => format!("qdd[{}]", place(*c)),
            ProgramOp::Input(Atom::Constant(c)) => format!("{:?}", mechanism.constants[*c].value),
            ProgramOp::Input(Atom::Pi) => "np.pi".to_owned(),
            ProgramOp::Input(other) => unreachable!("no input of these models: {other:?}"),
            ProgramOp::Add(a, b) => format!("{} + {}", v(a), v(b)),
            ProgramOp::Sub(a, b) => format!("{} - {}", v(a), v(b)),
            ProgramOp::Mul(a, b) => format!("{} * {}", v(a), v(b)),
            ProgramOp::Div(a, b) => format!("{} / {}", v(a), v(b)),
            ProgramOp::Atan2(a, b) => format!("np.arctan2({}, {})", v(a), v(b)),
            ProgramOp::Neg(a) => format!("-{}", v(a)),
            ProgramOp::Sin(a) => format!("np.sin({})", v(a)),
            ProgramOp::Cos(a) => format!("np.cos({})", v(a)),
            ProgramOp::Unary(Unary::Sqrt, a) => format!("np.sqrt({})", v(a)),
            ProgramOp::Unary(Unary::Abs, a) => format!("np.abs({})", v(a)),
            ProgramOp::Unary(function, _) => {
                unreachable!("no function of these models: {function:?}")
            }
        };
        writeln!(text, "    v{i} = {value}").expect("a string");
    }
    let outputs: Vec<String> = program.outputs.iter().map(|o| format!("v{}", o.index())).collect();
    writeln!(text, "    return [{}]", outputs.join(", ")).expect("a string");
    text
}
