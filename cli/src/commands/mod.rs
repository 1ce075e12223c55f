//! One file per command, and the functions that they share: reading models and recordings, and running a diagnosis.

pub(crate) mod add;
pub(crate) mod adopt;
pub(crate) mod atlas;
pub(crate) mod check;
pub(crate) mod compare;
pub(crate) mod completions;
pub(crate) mod diagnose;
pub(crate) mod diff;
pub(crate) mod doctor;
pub(crate) mod effects;
pub(crate) mod equations;
pub(crate) mod evaluate;
pub(crate) mod excite;
#[cfg(feature = "experiment")]
pub(crate) mod experiment;
pub(crate) mod export;
pub(crate) mod generate;
pub(crate) mod identify;
pub(crate) mod import;
pub(crate) mod interpret;
pub(crate) mod manual;
pub(crate) mod recordings;
pub(crate) mod reduce;
pub(crate) mod report;
pub(crate) mod runs;
pub(crate) mod simulate;
pub(crate) mod tour;
pub(crate) mod verify;
#[cfg(feature = "workbench")]
pub(crate) mod work;

use std::path::{Path, PathBuf};

use modelmill::diagnose::{DiagnosisFindings, DiagnosisOptions, FixedParameters};
use modelmill::files::{DiskFiles, FileSource, PathKind};
use modelmill::model::LoadedModel;
use modelmill::recording::{PreparedRecording, RecordingOptions};
use modelmill::simulate::LoadedRig;
use modelmill::{Host, Model};

use crate::args::{DiagnosisArgs, ParameterSource};
use crate::failure::{CommandFailure, CommandOutcome};
use crate::flags::FlagWording;
use crate::terminal;

/// Reads and derives a model file; warnings go to standard error.
pub(crate) fn model(host: &Host, path: &Path) -> CommandOutcome<Model> {
    derive_model(host, &path.display().to_string(), load(host, path)?)
}

/// Derives a model that was read from `path`; warnings go to standard error.
pub(crate) fn derive_model(host: &Host, path: &str, loaded: LoadedModel) -> CommandOutcome<Model> {
    let model = host.derive(path, loaded)?;
    for note in &model.notes {
        terminal::remark(note);
    }
    Ok(model)
}

/// Reads a model file; warnings go to standard error.
pub(crate) fn load(host: &Host, path: &Path) -> CommandOutcome<LoadedModel> {
    let loaded = load_quietly(host, path)?;
    if !loaded.warnings.is_empty() {
        let text = loaded.render_for(terminal::is_stderr_coloured(), &FlagWording);
        terminal::print_to_stderr(text.trim_end());
    }
    Ok(loaded)
}

/// Reads a rig file; remarks about its mass properties go to standard error.
pub(crate) fn rig(host: &Host, path: &Path) -> CommandOutcome<LoadedRig> {
    let loaded = host.rig(path)?;
    print_remarks(&loaded);
    Ok(loaded)
}

/// Prints the remarks about a rig to standard error.
pub(crate) fn print_remarks(loaded: &LoadedRig) {
    if !loaded.remarks.is_empty() {
        let text = loaded.render_remarks(terminal::is_stderr_coloured(), &FlagWording);
        terminal::print_to_stderr(text.trim_end());
    }
}

/// Reads a model file without printing its warnings. If the path is no file, the error lists model files nearby.
pub(crate) fn load_quietly(host: &Host, path: &Path) -> CommandOutcome<LoadedModel> {
    if path.is_dir() {
        return Err(CommandFailure::Input(format!(
            "{} is a folder; a model file is expected{}",
            path.display(),
            nearby_models_hint(path)
        )));
    }
    // The error lists model files nearby, because a wrong folder is the usual reason.
    if !path.exists() {
        return Err(CommandFailure::Input(format!(
            "there is no file {}; the path of a model file (TOML) is expected{}{}",
            path.display(),
            if path == Path::new("-") {
                " (/dev/stdin is standard input)"
            } else {
                ""
            },
            nearby_models_hint(path)
        )));
    }
    Ok(host.load(path)?)
}

/// The files of one run: a path, or several with `+` between them.
pub(crate) fn files_of(path: &Path) -> Vec<PathBuf> {
    match path.to_str() {
        // A file whose name contains a plus is one file.
        Some(text) if text.contains('+') && !path.exists() => text.split('+').map(PathBuf::from).collect(),
        _ => vec![path.to_owned()],
    }
}

/// Reads the recordings of a fit and of its validation, with a common preparation. Their remarks go to standard error
/// as they come up.
pub(crate) fn recordings(
    model: &Model,
    [fit, check]: [&[PathBuf]; 2],
    reading: &RecordingOptions,
) -> CommandOutcome<[Vec<PreparedRecording>; 2]> {
    let files = [fit, check].map(|paths| paths.iter().map(|path| files_of(path)).collect::<Vec<_>>());
    let [fit, check] = [&files[0], &files[1]].map(|files| runs_of(files));
    let mut read = [Vec::new(), Vec::new()];
    for (read, all) in read
        .iter_mut()
        .zip(model.prepare_recordings_with_signals([&fit, &check], reading))
    {
        for recording in all {
            read.push(recording?);
        }
    }
    Ok(read)
}

/// The files of each run, as the library expects them.
pub(crate) fn runs_of(files: &[Vec<PathBuf>]) -> Vec<Vec<&Path>> {
    let each = files.iter();
    each.map(|files| files.iter().map(PathBuf::as_path).collect()).collect()
}

/// Runs the diagnosis of the command line: reads model and recordings, then searches for missing effects.
pub(crate) fn diagnose(
    host: &Host,
    args: &DiagnosisArgs,
    options: DiagnosisOptions,
) -> CommandOutcome<DiagnosisFindings> {
    let model = args.parameters.apply_to(host, self::model(host, &args.model)?)?;
    let reading = args.preparation.reading();
    // All recordings are prepared together at their full rate. The search needs fewer samples of long ones.
    let mut read = [Vec::new(), Vec::new()];
    for (read, all) in read
        .iter_mut()
        .zip(recordings(&model, [&args.data, &args.check], &reading)?)
    {
        for one in all {
            read.push(one.for_diagnosis(&model)?);
        }
    }
    let [fit, check] = read;
    let [fit, check] = [&fit, &check].map(|all| all.iter().collect::<Vec<_>>());
    Ok(model.diagnose(&fit, &check, &options)?)
}

impl DiagnosisArgs {
    /// Which parameters are fixed. With the values of a fit all are: the question is what changed since the fit, and
    /// estimated parameters would absorb the change.
    pub(crate) fn fixed_parameters(&self) -> FixedParameters {
        let is_fit = matches!(self.parameters, ParameterSource::Fit(_));
        if self.held || is_fit {
            FixedParameters::All
        } else {
            FixedParameters::Known
        }
    }
}

/// Model files near a path that is no model file, as a clause for the end of a message.
fn nearby_models_hint(path: &Path) -> String {
    let own = if path.is_dir() {
        path
    } else {
        path.parent().unwrap_or(Path::new(""))
    };
    // The folder of the path first, then the usual folders of a project, then the current one.
    let folders = [own, Path::new("models"), Path::new("model-spec/models"), Path::new("")];
    for folder in folders {
        let here = if folder.as_os_str().is_empty() {
            Path::new(".")
        } else {
            folder
        };
        let mut found: Vec<String> = std::fs::read_dir(here)
            .into_iter()
            .flatten()
            .flatten()
            .map(|entry| folder.join(entry.file_name()))
            .filter(|file| is_model(file))
            .map(|file| file.display().to_string())
            .collect();
        if found.is_empty() {
            continue;
        }
        found.sort();
        // A long list is cut off.
        let more = found.len().saturating_sub(24);
        found.truncate(24);
        let more = if more > 0 {
            format!("\n  and {more} more")
        } else {
            String::new()
        };
        return format!("; model files nearby:\n  {}{more}", found.join("\n  "));
    }
    "; `modelmill tour` shows an example".to_owned()
}

/// Whether a file looks like a model: TOML with a line `schema = ...`.
fn is_model(path: &Path) -> bool {
    let disk = DiskFiles::default();
    path.extension().is_some_and(|e| e == "toml")
        && disk.kind(path) == PathKind::File
        && disk.read_text(path, 1 << 20).is_ok_and(|text| {
            text.lines()
                .filter_map(|line| line.split_once('='))
                .any(|(key, _)| key.trim() == "schema")
        })
}
