//! `identify`: estimates base parameters from recordings by least squares.

use std::path::{Path, PathBuf};

use modelmill::identify::Instruments;
use modelmill::recording::{PreparedRecording, RecordingOptions, StandstillRule};
use modelmill::servo::{ServoIdentification, ServoLogs};
use modelmill::{Host, Model};

use crate::args::IdentifyArgs;
use crate::failure::{CommandFailure, CommandOutcome};
use crate::flags::FlagWording;
use crate::output::OutputFile;
use crate::{commands, terminal};

/// Estimates the parameters, prints the fit, and writes it to `--out` if given.
pub(crate) fn run(host: &Host, args: &IdentifyArgs) -> CommandOutcome {
    let model = commands::model(host, &args.model)?;
    // Instruments are files or `period=SECONDS`; only files are inputs that must not be written over.
    let files = args.estimators.instruments.iter().map(PathBuf::from);
    let instruments: Vec<PathBuf> = files.filter(|file| file.exists()).collect();
    let inputs = model
        .files()
        .chain((args.data.iter().chain(&args.check).chain(&instruments)).map(AsRef::<Path>::as_ref));
    let target = args
        .out
        .as_ref()
        .map(|path| OutputFile::new(path, inputs))
        .transpose()?;
    let mut reading = args.preparation.reading();
    let standstill = args.preparation.standstill();
    // A bound of the user belongs to the estimator, which applies it to the equations of the fit only.
    if standstill != StandstillRule::Automatic {
        reading.standstill = StandstillRule::KeepAll;
    }
    if let Some(found) = identify_from_signals(&model, args, &reading)? {
        let object = found.json(&FlagWording);
        if let Some(target) = &target {
            target.write(&format!("{object:#}\n"))?;
        }
        return if args.json {
            terminal::print_json(&object)
        } else {
            terminal::print(&found.text(terminal::style()))
        };
    }
    let [data, check] = commands::recordings(&model, [&args.data, &args.check], &reading)?;
    // The options of the estimator are separate from those for reading.
    let options = args.estimators.options(standstill);
    let reading = RecordingOptions {
        columns: args.estimators.instrument_map.clone(),
        ..reading
    };
    // Instruments from recordings are read like the data, but with columns of their own.
    let period = period(&args.estimators.instruments)?;
    let recorded = match period {
        Some(_) => Vec::new(),
        None => {
            let files: Vec<PathBuf> = args.estimators.instruments.iter().map(PathBuf::from).collect();
            let [instruments, _] = commands::recordings(&model, [&files, &[]], &reading)?;
            instruments
        }
    };
    let recorded: Vec<&PreparedRecording> = recorded.iter().collect();
    let instruments = match period {
        Some(period) => Instruments::Period(period),
        None if recorded.is_empty() => Instruments::None,
        None => Instruments::Recordings(&recorded),
    };
    let [data, check] = [&data, &check].map(|all| all.iter().collect::<Vec<_>>());
    let found = model.identify_with(&data, &instruments, &check, &options)?;
    // The file and --json have the same object.
    let object = found.json(&model, &FlagWording)?;
    if let Some(target) = &target {
        target.write(&format!("{object:#}\n"))?;
    }
    if args.json {
        return terminal::print_json(&object);
    }
    terminal::print(&found.text(&model, terminal::style(), &FlagWording))?;
    if let Some(target) = &target {
        terminal::note(&format!(
            "the fit is in {0}; use it with --parameters {0}",
            target.path().display()
        ));
    }
    Ok(())
}

/// Estimates a model with actuators from commands, currents or voltages; `None` without actuators, or if a recording has
/// forces and lacks these signals.
fn identify_from_signals(
    model: &Model,
    args: &IdentifyArgs,
    reading: &RecordingOptions,
) -> CommandOutcome<Option<ServoIdentification>> {
    let files = [&args.data, &args.check].map(|paths| paths.iter().map(|path| commands::files_of(path)).collect());
    let runs = files.each_ref().map(|files: &Vec<_>| commands::runs_of(files));
    let logs = model.prepare_servo_logs(|model, change| {
        let reading = change(reading);
        let read = |paths: &Vec<&Path>| model.read_recording(paths, &reading);
        runs.each_ref().map(|run| run.iter().map(read).collect())
    })?;
    let Some(logs) = logs else {
        return Ok(None);
    };
    // An option without effect would be taken for one that was applied.
    match ServoLogs::refuse_options(&args.estimators.given_flags()) {
        Some(says) => Err(CommandFailure::Usage(says)),
        None => Ok(Some(logs.identify()?)),
    }
}

/// The period in s of `--instruments period=SECONDS`; none if the instruments are recordings.
fn period(instruments: &[String]) -> CommandOutcome<Option<f64>> {
    let [one] = instruments else {
        return Ok(None);
    };
    let Some(seconds) = one.strip_prefix("period=") else {
        return Ok(None);
    };
    match seconds.parse::<f64>() {
        Ok(period) if period > 0.0 && period.is_finite() => Ok(Some(period)),
        _ => Err(CommandFailure::Usage(format!(
            "--instruments {one}: expected seconds, as in period=7.29"
        ))),
    }
}
