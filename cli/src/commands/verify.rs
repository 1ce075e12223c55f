//! `verify`: tests a model against recordings, with the causes of failures. The exit status is that of the result.

use std::path::{Path, PathBuf};

use modelmill::Host;
use modelmill::print::VerificationContext;
use modelmill::verify::{CheckState, FileFingerprint, FileRole, VerificationLimits, hash_file};

use crate::args::{ParameterSource, VerifyArgs};
use crate::failure::{CommandFailure, CommandOutcome};
use crate::flags::FlagWording;
use crate::output::OutputFile;
use crate::{commands, output, terminal};

/// Prints the checks, and writes them as JUnit XML with `--junit`.
pub(crate) fn run(host: &Host, args: &VerifyArgs) -> CommandOutcome {
    let files = inputs(args);
    let junit = junit_file(args, &files)?;
    let model = args.parameters.apply_to(host, commands::model(host, &args.model)?)?;
    let limits = match &args.limits {
        Some(path) => VerificationLimits::read(&model, path)?,
        None => VerificationLimits::default(),
    };
    let [data, _] = commands::recordings(&model, [&args.data, &[]], &args.preparation.reading())?;
    let verified = model.verify(&data.iter().collect::<Vec<_>>(), &limits)?;
    let parameters = args.parameters.name();
    let limits_file = args.limits.as_ref().map(|path| path.display().to_string());
    let mut context = VerificationContext {
        parameters: &parameters,
        limits: limits_file.as_deref(),
        inputs: &[],
        version: env!("CARGO_PKG_VERSION"),
        program_sha256: None,
    };
    // Hashes read every file once more, so that they are left out of the table.
    let inputs = if args.json {
        FileFingerprint::all(&model, files.iter().map(|(role, path)| (*role, path.as_path())))?
    } else {
        Vec::new()
    };
    if let Some(target) = &junit {
        target.write(&verified.junit(&FlagWording))?;
    }
    if args.json {
        let program = program_sha256();
        context.inputs = &inputs;
        context.program_sha256 = program.as_deref();
        terminal::print_json(&verified.json(&context, &FlagWording))?;
    } else {
        terminal::print(&verified.text(&context, terminal::style(), &FlagWording))?;
    }
    match verified.state() {
        CheckState::Pass => Ok(()),
        CheckState::Fail | CheckState::NotEvaluated => Err(CommandFailure::NotVerified),
    }
}

/// The files that are read in addition to the model.
fn inputs(args: &VerifyArgs) -> Vec<(FileRole, PathBuf)> {
    let data = args.data.iter().flat_map(|path| commands::files_of(path));
    let mut files: Vec<(FileRole, PathBuf)> = data.map(|path| (FileRole::Data, path)).collect();
    if let ParameterSource::Fit(path) = &args.parameters {
        files.push((FileRole::Fit, path.clone()));
    }
    files.extend(args.limits.clone().map(|path| (FileRole::Limits, path)));
    files
}

/// The file for JUnit XML, which is none of the inputs.
fn junit_file(args: &VerifyArgs, files: &[(FileRole, PathBuf)]) -> CommandOutcome<Option<OutputFile>> {
    let inputs = || {
        let others = files.iter().map(|(_, path)| path.as_path());
        std::iter::once(args.model.as_path()).chain(others)
    };
    let target = |path: &PathBuf| OutputFile::for_flag("--junit", path, inputs());
    args.junit.as_ref().map(target).transpose()
}

/// SHA-256 of the program file; `None` if the system does not give its path.
fn program_sha256() -> Option<String> {
    let path: PathBuf = std::env::current_exe().ok()?;
    hash_file(output::disk(), Path::new(&path)).ok().flatten()
}
