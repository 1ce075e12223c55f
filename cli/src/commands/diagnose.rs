//! `diagnose`: which effect the model lacks, and the evidence for it. With `--out`, the completed model is written.

use std::path::{Path, PathBuf};

use modelmill::Host;
use modelmill::diagnose::{DiagnosisFindings, DiagnosisOptions, words};
use modelmill::text::table::count;
use serde_json::json;

use crate::args::{DiagnoseArgs, ParameterSource};
use crate::failure::CommandOutcome;
use crate::flags::CommandLineWording;
use crate::output::OutputFile;
use crate::{commands, terminal};

/// Prints the missing effects, or that none is missing, or that no known effect explains the error.
pub(crate) fn run(host: &Host, args: &DiagnoseArgs) -> CommandOutcome {
    let target = target(args)?;
    // Relative paths in the file start from the folder of the target: a search takes long, so this is checked first.
    if let Some(target) = &target
        && let Ok(given) = std::fs::read_to_string(&args.diagnosis.model)
    {
        host.load_text(target.path(), &given)?;
    }
    let flags = CommandLineWording::from_args(&args.diagnosis);
    let options = DiagnosisOptions {
        fixed: args.diagnosis.fixed_parameters(),
        ..DiagnosisOptions::default()
    };
    let findings = commands::diagnose(host, &args.diagnosis, options)?;
    // The findings are printed also where the model cannot be completed.
    let written = target
        .as_ref()
        .map(|target| write_completed_model(host, &findings, target));
    let is_written = matches!(written, Some(Ok(())));
    let flags = flags.with_completion(is_written);
    if args.json {
        let mut object = findings.json(&flags);
        if let Some(target) = &target {
            object["written"] = json!(is_written.then(|| target.path().display().to_string()));
        }
        terminal::print_json(&object)?;
    } else {
        terminal::print(&findings.text(terminal::style(), &flags).join("\n"))?;
    }
    if let (Some(target), true) = (&target, is_written) {
        terminal::note(&completion_text(&findings, target.path(), &flags));
    }
    written.unwrap_or(Ok(()))
}

/// The file for the completed model, which is none of the inputs.
fn target(args: &DiagnoseArgs) -> CommandOutcome<Option<OutputFile>> {
    let given = &args.diagnosis;
    let recordings = given.data.iter().chain(&given.check);
    let mut inputs: Vec<PathBuf> = recordings.flat_map(|path| commands::files_of(path)).collect();
    inputs.push(given.model.clone());
    if let ParameterSource::Fit(path) = &given.parameters {
        inputs.push(path.clone());
    }
    let inputs = inputs.iter().map(PathBuf::as_path);
    args.out.as_ref().map(|path| OutputFile::new(path, inputs)).transpose()
}

/// Writes the model file with the effects found.
///
/// Fails if the findings do not allow to complete it, and if the text is no valid model at its target, where relative
/// paths start from another folder.
fn write_completed_model(host: &Host, findings: &DiagnosisFindings, target: &OutputFile) -> CommandOutcome {
    let text = findings.completed_model()?;
    host.load_text(target.path(), text)?;
    target.write(text)
}

/// What was written, and what to do with it.
fn completion_text(findings: &DiagnosisFindings, path: &Path, flags: &CommandLineWording) -> String {
    let path = path.display().to_string();
    let next = flags.identification_command(&path);
    let others: Vec<_> = (findings.effects_without_entry().iter())
        .map(|one| one.effect.clone())
        .collect();
    let others = if others.is_empty() {
        String::new()
    } else {
        format!("; a model file cannot contain {}", words::effects(&others))
    };
    match findings.entries_to_add().len() {
        0 => format!("{path} is written: it is the given model, without added effects{others}"),
        n => format!(
            "{path} is written: the given model with {} added{others}. Identify it next: `{next}`",
            count(n, "effect", "effects")
        ),
    }
}
