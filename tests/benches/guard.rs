//! Compares the cost of a fixed list of models with figures in the repository: operations per call, instructions of
//! generation and of emitted functions, size of emitted code, and peak memory of generation.
//!
//! `cargo bench -p modelmill-tests --bench guard` prints what rose or fell by more than 3 %, and fails if something
//! rose. With `-- --write` it writes the figures of this build to `tests/benches/guard.csv`. Figures of the profiles
//! `dev` and `release` stand beside each other, since `.ci/run` has a `dev` build at hand.
//! Valgrind counts instructions; without it, or with another compiler than that of the figures, these are left out,
//! and the output says so.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use modelmill_codegen::{ProgramStage, StraightLineProgram};
use modelmill_emit::{EmissionRequest, LANGUAGES};
use modelmill_tests::callgrind;
use modelmill_tests::drawn_states;
use modelmill_tests::fixtures::{derive, model};
use peak_alloc::PeakAlloc;

#[global_allocator]
static ALLOCATED: PeakAlloc = PeakAlloc;

/// Models whose operations, emitted code and peak memory are compared.
const MODELS: [&str; 10] = [
    "two_link",
    "spidermill",
    "five_bar",
    "three_rrr",
    "scara",
    "stanford",
    "puma560",
    "rx90",
    "panda",
    "gough_stewart",
];

/// Models whose generation is counted: an arm, a closed chain, and a longer arm; a minute under valgrind.
const GENERATED: [&str; 3] = ["two_link", "spidermill", "puma560"];

/// Relative rise that is reported. Counts of one build repeat to the last digit, but for peak memory; this leaves room
/// for that and for changes that move work without adding any.
const TOLERANCE: f64 = 0.03;

/// States that calls go through in turn.
const STATES: usize = 128;

/// Calls of an emitted function, and what one run more takes: the difference leaves out what a run costs.
const CALLS: [usize; 2] = [128, 640];

/// The name of the figure that says which compiler made a column of instructions.
const COMPILER: &str = "compiler";

/// A model with a figure's name.
type FigureKey = (String, String);

/// Figures of one profile.
type FigureTable = BTreeMap<FigureKey, String>;

fn main() -> ExitCode {
    // On one thread: valgrind counts the thread that calls, and peak memory depends on what runs at once.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread();
    pool.build_global().expect("nothing has run on other threads");
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [measure, name, function, calls] = arguments.as_slice()
        && measure == "--measure"
    {
        run_measured(name, function, calls.parse().expect("a number of calls"));
        return ExitCode::SUCCESS;
    }
    match compare(arguments.iter().any(|argument| argument == "--write")) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(says) => {
            eprintln!("{says}");
            ExitCode::FAILURE
        }
    }
}

/// The profile of this build.
fn profile() -> &'static str {
    if cfg!(debug_assertions) { "dev" } else { "release" }
}

/// Measures, and compares or writes. Returns whether nothing rose.
fn compare(is_written: bool) -> Result<bool, String> {
    let mut recorded = read()?;
    let compiler = compiler();
    let key = |model: &str, figure: &str| (model.to_owned(), figure.to_owned());
    let known = recorded.get(profile()).cloned().unwrap_or_default();
    if known.is_empty() && !is_written {
        println!(
            "no figures of the profile `{}` are recorded; `-- --write` records them",
            profile()
        );
        return Ok(true);
    }
    let same_compiler = known.get(&key("", COMPILER)).is_some_and(|known| *known == compiler);
    let counts_instructions = callgrind::is_available() && (is_written || same_compiler);

    let mut now = FigureTable::new();
    for name in MODELS {
        for (figure, value) in figures(name) {
            now.insert(key(name, &figure), value.to_string());
        }
    }
    if counts_instructions {
        now.insert(key("", COMPILER), compiler);
        for (name, figure, value) in instructions()? {
            now.insert(key(&name, &figure), format!("{value:.0}"));
        }
    } else if callgrind::is_available() {
        println!("instructions are left out: their figures are of another compiler than {compiler}");
    } else {
        println!("instructions are left out: valgrind is not on this machine");
    }

    if is_written {
        recorded.insert(profile().to_owned(), now);
        write(&recorded)?;
        return Ok(true);
    }
    Ok(report(&known, &now))
}

/// Prints what differs. Returns whether nothing rose.
fn report(known: &FigureTable, now: &FigureTable) -> bool {
    let number = |text: &String| text.parse::<f64>().ok();
    let mut rose = 0;
    let mut compared = 0;
    for ((model, figure), value) in now {
        let Some(value) = number(value) else { continue };
        let before = known.get(&(model.clone(), figure.clone())).and_then(number);
        compared += 1;
        let (word, before) = match before {
            None => ("is not in the file", f64::NAN),
            Some(before) if value > before * (1.0 + TOLERANCE) => ("rose", before),
            Some(before) if value < before * (1.0 - TOLERANCE) => ("fell", before),
            Some(_) => continue,
        };
        rose += usize::from(word != "fell");
        let change = 100.0 * (value / before - 1.0);
        println!("{model}: {figure} {word}: {before} -> {value} ({change:+.1} %)");
    }
    println!(
        "{compared} figures compared, {rose} above the recorded ones by more than {:.0} %",
        100.0 * TOLERANCE
    );
    if rose > 0 {
        println!("If the cost is intended, `cargo bench -p modelmill-tests --bench guard -- --write` records it.");
    }
    rose == 0
}

/// Operations per call, peak memory of generation and sizes of emitted code, bytes.
fn figures(name: &str) -> Vec<(String, usize)> {
    let mechanism = model(name);
    let before = ALLOCATED.current_usage();
    ALLOCATED.reset_peak_usage();
    let derivation = derive(&mechanism);
    let peak = ALLOCATED.peak_usage().saturating_sub(before);
    let operations = |program: &StraightLineProgram| {
        let count = program.count_operations(ProgramStage::State);
        count.add + count.mul
    };
    let mut found = vec![
        (
            "operations of H_min".to_owned(),
            operations(&derivation.programs.regressor),
        ),
        (
            "operations of inverse dynamics".to_owned(),
            operations(&derivation.programs.inverse_dynamics),
        ),
        ("peak bytes of generation".to_owned(), peak),
    ];
    let request = EmissionRequest {
        derivation: &derivation,
        dynamics: None,
        reactions: None,
        self_test: false,
    };
    for language in LANGUAGES {
        let size = language.emit_files(&request).iter().map(|file| file.text.len()).sum();
        found.push((format!("bytes of {}", language.name()), size));
    }
    found
}

/// Instructions of generation, and of each call of emitted functions: model, figure and count.
fn instructions() -> Result<Vec<(String, String, f64)>, String> {
    let mut found = Vec::new();
    for name in GENERATED {
        let count = callgrind::count_instructions(&["--measure", name, "generation", "1"])?;
        found.push((name.to_owned(), "instructions of generation".to_owned(), count));
    }
    for name in EMITTED {
        for function in ["H_min", "inverse dynamics"] {
            let [few, many] =
                CALLS.map(|calls| callgrind::count_instructions(&["--measure", name, function, &calls.to_string()]));
            let each = (many? - few?) / (CALLS[1] - CALLS[0]) as f64;
            found.push(((*name).to_owned(), format!("instructions of {function}"), each));
        }
    }
    Ok(found)
}

/// What runs under valgrind.
fn run_measured(name: &str, function: &str, calls: usize) {
    if function == "generation" {
        let mechanism = model(name);
        callgrind::repeat_calls(calls, &mut |_| {
            let derivation = derive(black_box(&mechanism));
            black_box(modelmill_emit::emit(&derivation).module());
        });
    } else {
        run_emitted(name, function, calls);
    }
}

/// Calls the functions of emitted modules at states that are drawn.
macro_rules! emitted {
    ($($model:ident $name:literal,)+) => {
        const EMITTED: &[&str] = &[$($name),+];

        fn run_emitted(name: &str, function: &str, calls: usize) {
            match name {
                $($name => {
                    use modelmill_generated::$model as module;
                    let geometry = module::Geometry::<f64>::default();
                    let model = module::Model::new(&geometry);
                    let base = module::base_parameters(&geometry, &module::Parameters::default()).expect("parameters");
                    let dynamics = module::InverseDynamics::new(&geometry, &base);
                    let states = drawn_states!(module, dynamics, &modelmill_tests::fixtures::model($name), STATES);
                    callgrind::repeat_calls(calls, &mut |k| {
                        let state = black_box(&states[k % STATES]);
                        if function == "H_min" {
                            _ = black_box(model.regressor(state));
                        } else {
                            _ = black_box(dynamics.forces(state));
                        }
                    });
                })+
                other => panic!("no model {other}"),
            }
        }
    };
}

emitted! {
    spidermill "spidermill",
    five_bar "five_bar",
    panda "panda",
}

/// The name and version of the compiler.
fn compiler() -> String {
    let output = Command::new("rustc").arg("--version").output();
    let text = output.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    text.unwrap_or_default()
}

/// The file of the figures.
fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/guard.csv")
}

/// The figures of the file by profile. A file that is not there has none.
fn read() -> Result<BTreeMap<String, FigureTable>, String> {
    let path = file();
    let mut tables: BTreeMap<String, FigureTable> = BTreeMap::new();
    if !path.exists() {
        return Ok(tables);
    }
    let place = |error: csv::Error| format!("{}: {error}", path.display());
    for record in csv::Reader::from_path(&path).map_err(place)?.records() {
        let record = record.map_err(place)?;
        let cell = |k: usize| record.get(k).unwrap_or_default().to_owned();
        tables.entry(cell(0)).or_default().insert((cell(1), cell(2)), cell(3));
    }
    Ok(tables)
}

/// Writes all figures.
fn write(tables: &BTreeMap<String, FigureTable>) -> Result<(), String> {
    let path = file();
    let place = |error: csv::Error| format!("{}: {error}", path.display());
    let mut writer = csv::Writer::from_path(&path).map_err(place)?;
    writer
        .write_record(["profile", "model", "figure", "value"])
        .map_err(place)?;
    for (profile, table) in tables {
        for ((model, figure), value) in table {
            writer.write_record([profile, model, figure, value]).map_err(place)?;
        }
    }
    writer.flush().map_err(|error| format!("{}: {error}", path.display()))
}
