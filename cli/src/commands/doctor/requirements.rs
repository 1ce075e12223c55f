//! What the program and its commands need, and whether this computer has it.

use std::env;
use std::fs::{self, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};
use std::process;
use std::thread;
use std::time::{SystemTime, UNIX_EPOCH};

use modelmill::{Error, Host};
use modelmill_recordings::MODELS;

use crate::flags::FlagWording;

use super::programs::{find_program, find_program_of_value, find_version, is_at_least, read_output};

/// Whether a requirement is met.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RequirementState {
    /// It is there and works.
    Present,
    /// It is there in a version that is too old.
    Outdated,
    /// It is there and does not work.
    Fails,
    /// It is not there.
    Missing,
}

impl RequirementState {
    /// Its name in text and JSON.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Present => "present",
            Self::Outdated => "outdated",
            Self::Fails => "fails",
            Self::Missing => "missing",
        }
    }
}

/// A requirement with what this computer has.
pub(super) struct RequirementCheck {
    /// Its name.
    pub(super) name: &'static str,
    /// Whether no command works without it.
    pub(super) is_essential: bool,
    /// Whether it is met.
    pub(super) state: RequirementState,
    /// The version that was found.
    pub(super) version: Option<String>,
    /// The oldest version that suffices.
    pub(super) least_version: Option<&'static str>,
    /// Where it was found.
    pub(super) path: Option<PathBuf>,
    /// Commands that need it, and for what.
    pub(super) needed_for: Vec<&'static str>,
    /// What to do, unless the requirement is met.
    pub(super) remedy: Option<String>,
}

impl RequirementCheck {
    /// Whether the requirement is met.
    pub(super) fn is_met(&self) -> bool {
        self.state == RequirementState::Present
    }
}

/// An environment variable with the program to use.
struct ProgramVariable {
    /// Its name.
    name: &'static str,
    /// What separates several programs in its value.
    separator: Option<char>,
}

impl ProgramVariable {
    /// A variable with one program.
    const fn with_one_program(name: &'static str) -> Self {
        Self { name, separator: None }
    }
}

/// Another program that a command or its output needs.
struct ExternalProgram {
    /// The name of the requirement.
    name: &'static str,
    /// An environment variable with the program to use, which has priority.
    variable: Option<ProgramVariable>,
    /// Programs that meet the requirement; the first one on the search path is used.
    programs: &'static [&'static str],
    /// Arguments by which it prints its version. Without any it is not started: a browser would open a window.
    version_arguments: &'static [&'static str],
    /// The oldest version that suffices.
    least_version: Option<&'static str>,
    /// Commands that need it, and for what.
    needed_for: &'static [&'static str],
    /// How to get it.
    remedy: &'static str,
}

/// The programs. A new one is one entry.
const PROGRAMS: &[ExternalProgram] = &[
    ExternalProgram {
        name: "Rust compiler",
        variable: Some(ProgramVariable::with_one_program("RUSTC")),
        programs: &["rustc"],
        version_arguments: &["--version"],
        // The packages of the workspace, among them the runtime of emitted code, have one oldest version.
        least_version: Some(env!("CARGO_PKG_RUST_VERSION")),
        needed_for: &["compiling the output of `generate` for Rust, C and Python"],
        remedy: "Install Rust by https://rustup.rs, or update it with `rustup update`.",
    },
    ExternalProgram {
        name: "Cargo",
        variable: Some(ProgramVariable::with_one_program("CARGO")),
        programs: &["cargo"],
        version_arguments: &["--version"],
        least_version: Some(env!("CARGO_PKG_RUST_VERSION")),
        needed_for: &["building the output of `generate` for Rust, C and Python"],
        remedy: "Install Rust by https://rustup.rs, or update it with `rustup update`.",
    },
    ExternalProgram {
        name: "C compiler",
        variable: Some(ProgramVariable::with_one_program("CC")),
        programs: &["cc", "gcc", "clang"],
        version_arguments: &["--version"],
        least_version: None,
        needed_for: &[
            "compiling the output of `generate --language c99`",
            "`compile()` in Python",
        ],
        remedy: "Install GCC or Clang, or set CC to the compiler.",
    },
    ExternalProgram {
        name: "Python",
        variable: None,
        programs: &["python3", "python"],
        version_arguments: &["--version"],
        // `requires-python` of python/pyproject.toml.
        least_version: Some("3.10"),
        needed_for: &["the Python package", "the output of `generate --language python`"],
        remedy: "Install Python from https://www.python.org or by the system's package manager.",
    },
    ExternalProgram {
        name: "Julia",
        variable: None,
        programs: &["julia"],
        version_arguments: &["--version"],
        least_version: None,
        needed_for: &["running the output of `generate --language julia`"],
        remedy: "Install Julia from https://julialang.org.",
    },
    ExternalProgram {
        name: "LaTeX",
        variable: None,
        programs: &["lualatex", "xelatex", "pdflatex", "tectonic"],
        version_arguments: &["--version"],
        least_version: None,
        needed_for: &["typesetting the output of `equations --format latex`"],
        remedy: "Install TeX Live or Tectonic, or use `equations --format html`.",
    },
    ExternalProgram {
        name: "browser",
        variable: Some(ProgramVariable {
            name: "BROWSER",
            // Elsewhere, a colon follows the letter of a disk.
            separator: if cfg!(unix) { Some(':') } else { None },
        }),
        programs: &[
            "firefox",
            "chromium",
            "chromium-browser",
            "google-chrome",
            "microsoft-edge",
            "brave-browser",
            "xdg-open",
            "open",
            "explorer",
        ],
        version_arguments: &[],
        least_version: None,
        needed_for: &[
            "`work`",
            "reading pages of `report`, `runs`, `tour` and `equations --format html`",
        ],
        remedy: "Install a browser, or open the pages on another computer: each is one file that needs nothing else.",
    },
];

/// Checks all requirements: parts of the program first, then other programs, each in its own thread.
pub(super) fn check_all() -> Vec<RequirementCheck> {
    let mut checks = vec![check_derivation()];
    checks.extend(check_formats());
    checks.push(check_temporary_folder());
    let programs = thread::scope(|scope| {
        let running: Vec<_> = PROGRAMS
            .iter()
            .map(|program| scope.spawn(|| check_program(program)))
            .collect();
        let ended = running.into_iter().filter_map(|thread| thread.join().ok());
        ended.collect::<Vec<_>>()
    });
    let python = programs.iter().find(|check| check.name == "Python");
    let packages = check_python_packages(python);
    checks.extend(programs);
    checks.extend(packages);
    checks
}

/// Derives a bundled model, and compares its exact rank with the numeric one: the program itself works.
fn check_derivation() -> RequirementCheck {
    let fault = derive_bundled_model().err();
    RequirementCheck {
        name: "derivation",
        is_essential: true,
        state: match fault {
            None => RequirementState::Present,
            Some(_) => RequirementState::Fails,
        },
        version: Some(env!("CARGO_PKG_VERSION").to_owned()),
        least_version: None,
        path: env::current_exe().ok(),
        needed_for: vec!["all commands that read a model"],
        remedy: fault.map(|message| {
            format!("The program does not derive a bundled model correctly: {message}. Install it again, and report this if it remains.")
        }),
    }
}

/// Derives the first bundled model; the error states what is wrong with it.
fn derive_bundled_model() -> Result<(), String> {
    // A host of its own: a wrong `--library` is no fault of the program.
    let host = Host::new();
    let text_of = |error: Error| error.format_for(&FlagWording);
    let (name, text) = MODELS[0];
    let loaded = host.load_text(Path::new(name), text).map_err(text_of)?;
    let checked = host
        .derive(name, loaded)
        .and_then(|model| model.check())
        .map_err(text_of)?;
    match (&checked.rank, checked.warnings.first()) {
        (Some(_), None) => Ok(()),
        (_, Some(warning)) => Err(warning.clone()),
        (None, None) => Err("it has no base parameters".to_owned()),
    }
}

/// Formats of recordings, which are features of the build.
fn check_formats() -> Vec<RequirementCheck> {
    let formats = [
        ("Parquet files", cfg!(feature = "parquet"), "parquet"),
        ("HDF5 and MATLAB 7.3 files", cfg!(feature = "hdf5"), "hdf5"),
        ("MCAP and ROS bags", cfg!(feature = "logs"), "logs"),
    ];
    formats
        .into_iter()
        .map(|(name, is_built, feature)| RequirementCheck {
            name,
            is_essential: false,
            state: if is_built {
                RequirementState::Present
            } else {
                RequirementState::Missing
            },
            version: None,
            least_version: None,
            path: None,
            needed_for: vec!["reading recordings of this format"],
            remedy: (!is_built)
                .then(|| format!("Build the program with the feature `{feature}`, which is on by default.")),
        })
        .collect()
}

/// The folder for temporary files, which `tour` uses without `--out`.
fn check_temporary_folder() -> RequirementCheck {
    let path = env::temp_dir();
    let (state, cause) = if !path.is_dir() {
        (
            RequirementState::Missing,
            format!("There is no folder {}.", path.display()),
        )
    } else if let Err(error) = create_test_file(&path) {
        let cause = format!("No file can be created in {}: {error}.", path.display());
        (RequirementState::Fails, cause)
    } else {
        (RequirementState::Present, String::new())
    };
    RequirementCheck {
        name: "temporary folder",
        is_essential: false,
        state,
        version: None,
        least_version: None,
        path: Some(path),
        needed_for: vec!["`tour` without --out"],
        remedy: (state != RequirementState::Present).then(|| {
            format!("{cause} Use `tour --out DIR`, or set {FOLDER_VARIABLE} to a folder in which files can be created.")
        }),
    }
}

/// The environment variable of the folder for temporary files.
const FOLDER_VARIABLE: &str = if cfg!(windows) { "TMP" } else { "TMPDIR" };

/// Creates an empty file in a folder and removes it. Permissions do not show whether this user may do so, or whether
/// the disk is writable.
fn create_test_file(folder: &Path) -> io::Result<()> {
    let time = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let path = folder.join(format!("modelmill-doctor-{}-{}", process::id(), time.as_nanos()));
    OpenOptions::new().write(true).create_new(true).open(&path)?;
    fs::remove_file(&path)
}

/// Looks for one program and reads its version.
fn check_program(program: &ExternalProgram) -> RequirementCheck {
    let variable = program.variable.as_ref().and_then(|variable| {
        let value = env::var(variable.name).ok()?;
        (!value.trim().is_empty()).then_some((variable, value))
    });
    let path = match &variable {
        Some((variable, value)) => find_program_of_value(value, variable.separator),
        None => find_program(program.programs),
    };
    let mut check = RequirementCheck {
        name: program.name,
        is_essential: false,
        state: RequirementState::Missing,
        version: None,
        least_version: program.least_version,
        path,
        needed_for: program.needed_for.to_vec(),
        remedy: None,
    };
    if let Some(path) = &check.path {
        check.state = RequirementState::Present;
        if !program.version_arguments.is_empty() {
            let output = read_output(path, program.version_arguments);
            check.version = output.as_deref().and_then(find_version);
            check.state = match (&output, &check.version, program.least_version) {
                (None, ..) => RequirementState::Fails,
                (_, Some(version), Some(least)) if !is_at_least(version, least) => RequirementState::Outdated,
                _ => RequirementState::Present,
            };
        }
    }
    if !check.is_met() {
        let cause = match (&variable, &check.path, check.state) {
            (Some((variable, value)), None, _) => {
                format!(
                    "The variable {} is {}, which names no program that exists. ",
                    variable.name,
                    value.trim()
                )
            }
            (_, Some(path), RequirementState::Fails) => format!("{} does not run. ", path.display()),
            _ => String::new(),
        };
        check.remedy = Some(cause + program.remedy);
    }
    check
}

/// Packages of the Python that was found, also of an outdated one.
fn check_python_packages(python: Option<&RequirementCheck>) -> Vec<RequirementCheck> {
    let state = python.map_or(RequirementState::Missing, |check| check.state);
    let (can_run, first_step) = match state {
        RequirementState::Present => (true, ""),
        RequirementState::Outdated => (true, "Update Python first. "),
        RequirementState::Fails | RequirementState::Missing => (
            false,
            "The package was not searched, because no Python runs. Install Python first. ",
        ),
    };
    let path = python.and_then(|check| check.path.as_deref()).filter(|_| can_run);
    let packages: [(&'static str, &'static str, Vec<&'static str>, &'static str); 2] = [
        (
            "numpy in Python",
            "numpy",
            vec!["the Python package", "the output of `generate --language python`"],
            "Install it with `python3 -m pip install numpy`.",
        ),
        (
            "modelmill in Python",
            "modelmill",
            vec!["using modelmill from Python"],
            "Install it with `python3 -m pip install ./python` in a clone of the project.",
        ),
    ];
    packages
        .into_iter()
        .map(|(name, package, needed_for, remedy)| {
            // The metadata of a package are read without importing it.
            let script = format!("{VERSION_SCRIPT}print(version({package:?}))\n");
            let version = path
                .and_then(|path| read_output(path, &["-c", &script]))
                .map(|text| text.trim().to_owned())
                .filter(|text| !text.is_empty());
            let is_found = version.is_some();
            RequirementCheck {
                name,
                is_essential: false,
                state: if is_found {
                    RequirementState::Present
                } else {
                    RequirementState::Missing
                },
                version,
                least_version: None,
                path: None,
                needed_for,
                remedy: (!is_found).then(|| format!("{first_step}{remedy}")),
            }
        })
        .collect()
}

/// Python that defines `version` of a package. Before Python 3.8 the module of the standard library did not exist.
const VERSION_SCRIPT: &str = "\
try:
    from importlib.metadata import version
except ImportError:
    from pkg_resources import get_distribution
    def version(name):
        return get_distribution(name).version
";
