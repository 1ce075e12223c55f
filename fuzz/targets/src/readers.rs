//! What the targets do with bytes: read them, and check what must hold for whatever was read.

use std::path::PathBuf;

use modelmill_boundary::files::MemoryFiles;
use modelmill_identify::{FitFile, ReadOptions, SignalRecording};
use modelmill_reduction::{ImportOptions, MeshFiles, import};

use crate::budget::ReaderBudget;

/// Numbers of a recording that are kept; recordings with more are refused.
const MOST_NUMBERS: usize = 1 << 18;

/// Reads a recording: its names, and all columns that can be read.
pub(crate) fn read_recording(bytes: &[u8], budget: ReaderBudget) {
    let options = ReadOptions {
        max_numbers: MOST_NUMBERS,
        ..ReadOptions::default()
    };
    budget.run(bytes, || {
        let names = SignalRecording::names_in_bytes(bytes, "fuzz");
        match SignalRecording::from_bytes(bytes, "fuzz", &options) {
            Ok(recording) => {
                assert!(names.is_ok(), "columns are read, but their names are not");
                let n = recording.samples();
                let known: Vec<String> = recording.names().map(str::to_owned).collect();
                for name in &known {
                    let column = recording.column(name);
                    assert!(
                        column.is_err() || column.is_ok_and(|column| column.len() == n),
                        "`{name}`"
                    );
                }
            }
            Err(error) => assert!(!error.to_string().is_empty(), "a fault without words"),
        }
    });
}

/// Reads a recording of the format that these first bytes identify; the input replaces all that follows.
pub(crate) fn read_recording_of(signature: &[u8], input: &[u8], budget: ReaderBudget) {
    let rest = input.get(signature.len()..).unwrap_or_default();
    read_recording(&[signature, rest].concat(), budget);
}

/// Text of bytes; what is not UTF-8 becomes a sign for that.
fn text_of(input: &[u8]) -> String {
    String::from_utf8_lossy(input).into_owned()
}

/// Checks the rendered text of a failure. Control characters of the file are replaced where it is printed.
fn check_message(text: &str) {
    assert!(!text.trim().is_empty(), "a fault without words");
}

/// Reads a robot description.
pub(crate) fn read_description(input: &[u8], budget: ReaderBudget) {
    let text = text_of(input);
    budget.run(input, || {
        if let Err(fault) = import(&text, &ImportOptions::default()) {
            assert!(!fault.to_string().is_empty(), "a fault without words");
        }
    });
}

/// Reads a mesh in each of the three formats, as the shape of a body.
pub(crate) fn read_mesh(input: &[u8], budget: ReaderBudget) {
    budget.run(input, || {
        for file in ["a.stl", "a.obj", "a.msh"] {
            for inertia in ["legacy", "exact", "shell"] {
                let robot = format!(
                    "<mujoco><asset><mesh name='a' file='{file}' inertia='{inertia}'/></asset><worldbody><body>\
                     <joint name='j' axis='0 0 1'/><geom type='mesh' mesh='a'/></body></worldbody>\
                     <actuator><motor joint='j'/></actuator></mujoco>"
                );
                let read = |_: &str| Ok(input.to_vec());
                let options = ImportOptions {
                    meshes: Some(MeshFiles(&read)),
                    ..ImportOptions::default()
                };
                if let Err(fault) = import(&robot, &options) {
                    assert!(!fault.to_string().is_empty(), "a fault without words");
                }
            }
        }
    });
}

/// Reads a file of closures next to a small robot.
pub(crate) fn read_closures(input: &[u8], budget: ReaderBudget) {
    const ROBOT: &str = "<robot name='r'><link name='a'/><link name='b'/><link name='c'/>\
        <joint name='j' type='revolute'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/>\
        <limit effort='1' velocity='1'/></joint>\
        <joint name='k' type='revolute'><parent link='b'/><child link='c'/><origin xyz='1 0 0'/><axis xyz='0 0 1'/>\
        <limit effort='1' velocity='1'/></joint></robot>";
    let text = text_of(input);
    budget.run(input, || {
        let options = ImportOptions {
            closures: Some(&text),
            ..ImportOptions::default()
        };
        _ = import(ROBOT, &options);
    });
}

/// Reads a model file without other files.
pub(crate) fn read_model(input: &[u8], budget: ReaderBudget) {
    let text = text_of(input);
    budget.run(input, || {
        match modelmill_spec::load("fuzz.toml", &text, &MemoryFiles::default()) {
            Ok(loaded) => _ = loaded.mechanism.parameters.len(),
            Err(failure) => check_message(&failure.render(false)),
        }
    });
}

/// Reads a library of kinds of effects.
pub(crate) fn read_library(input: &[u8], budget: ReaderBudget) {
    let path = PathBuf::from("fuzz.toml");
    let mut files = MemoryFiles::default();
    files.insert(&path, input.to_vec());
    let libraries = [path];
    budget.run(input, || {
        if let Err(failure) = modelmill_spec::kinds_with(&libraries, &files) {
            check_message(&failure.render(false));
        }
    });
}

/// Reads a rig without other files.
pub(crate) fn read_rig(input: &[u8], budget: ReaderBudget) {
    let text = text_of(input);
    budget.run(input, || {
        if let Err(failure) = modelmill_rig::load("fuzz.toml", &text, &MemoryFiles::default()) {
            check_message(&failure.render(false));
        }
    });
}

/// Reads a plan of a reduction.
pub(crate) fn read_plan(input: &[u8], budget: ReaderBudget) {
    let text = text_of(input);
    budget.run(input, || {
        if let Err(failure) = modelmill_reduction::plan("fuzz.toml", &text) {
            check_message(&failure.render(false));
        }
    });
}

/// Reads a fit.
pub(crate) fn read_fit(input: &[u8], budget: ReaderBudget) {
    let text = text_of(input);
    budget.run(input, || match FitFile::parse(&text, "fit.json") {
        Ok(fit) => {
            _ = fit.physical_parameters();
            let all: Vec<usize> = (0..fit.parameters.len().min(100)).collect();
            _ = fit.covariance_of(&all);
        }
        Err(error) => assert!(!error.to_string().is_empty(), "a fault without words"),
    });
}
