//! `generate`: the model as Rust source, or as a crate that brings it to C or Python.

use std::path::{Path, PathBuf};

use modelmill_codegen::{EmittedFile, emit, emit_c, emit_python, module_name};

use crate::args::{GenerateArgs, Language};
use crate::failure::{Failure, Outcome};
use crate::model;
use crate::output::{Target, refuse_dash, write};
use crate::progress::watched;
use crate::table::count;
use crate::terminal;

/// Writes the source that `cargo build` makes of the model, or the folder of a crate.
pub(crate) fn run(args: &GenerateArgs) -> Outcome {
    let more = [
        ("--dynamics", args.dynamics),
        ("--reactions", args.reactions),
        ("--self-test", args.self_test),
    ];
    if let Some((flag, _)) = more.iter().find(|(_, asked)| *asked)
        && args.language != Language::Rust
    {
        return Err(Failure::Usage(format!(
            "{flag} goes with the Rust module only; leave it out, or leave --language out"
        )));
    }
    let model = model::derive(&args.model)?;
    let writing = format!("writing the code of {}", model.name);
    let crate_files = match args.language {
        Language::Rust => None,
        Language::C => Some(watched(&writing, 0, |_| emit_c(&model.derivation))),
        Language::Python => Some(watched(&writing, 0, |_| emit_python(&model.derivation))),
    };
    if let Some(files) = crate_files {
        let Some(folder) = &args.out else {
            return Err(Failure::Usage(
                "--out names the folder of the crate".to_owned(),
            ));
        };
        write_crate(folder, &files)?;
        let what = match args.language {
            Language::Python => {
                "a Python module: build it there with `maturin build --release`, or `cargo build --release`"
            }
            _ => "a C library and its header: build it there with `cargo build --release`",
        };
        terminal::note(&format!("{}: a crate that makes {what}", folder.display()));
        return Ok(());
    }
    let target = args
        .out
        .as_ref()
        .map(|path| Target::new(path, model.files.iter().map(PathBuf::as_path)))
        .transpose()?;
    let derivation = &model.derivation;
    let fault = |error| Failure::Input(format!("{}: {error}", model.path));
    let source = watched(&writing, 0, |_| -> Outcome<String> {
        let mut emitted = emit(derivation);
        if args.dynamics {
            let dynamics = derivation.dynamics().map_err(fault)?;
            emitted = emitted.with_dynamics(derivation, &dynamics);
        }
        if args.reactions {
            let reactions = derivation.reactions().map_err(fault)?;
            emitted = emitted.with_reactions(derivation, &reactions);
        }
        if args.self_test {
            emitted = emitted.with_self_test(derivation);
        }
        Ok(emitted.file())
    })?;
    match target {
        Some(target) => {
            target.write(&source)?;
            terminal::note(&format!(
                "{}: {}, the module `{}`",
                target.path().display(),
                count(source.lines().count(), "line", "lines"),
                module_name(&model.derivation.mechanism.name)
            ));
            Ok(())
        }
        None => terminal::print(&source),
    }
}

/// The first line of a manifest that this program wrote.
const OURS: &str = "# Written by modelmill.";

/// Writes a crate with a copy of the runtime, so that the folder can go anywhere; only over a crate of the same kind.
fn write_crate(folder: &Path, files: &[EmittedFile]) -> Outcome {
    refuse_dash(folder)?;
    let manifest = folder.join("Cargo.toml");
    let ours = std::fs::read_to_string(&manifest).is_ok_and(|text| text.starts_with(OURS));
    let occupied = folder.is_file()
        || std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if occupied && !ours {
        return Err(Failure::Usage(format!(
            "--out {}: something else is there; give the name of a new folder",
            folder.display()
        )));
    }
    let runtime = modelmill_runtime::source::FILES;
    let runtime = runtime.map(|(path, text)| (format!("modelmill-runtime/{path}"), text));
    let own = files.iter().map(|f| (f.path.clone(), f.text.as_str()));
    for (path, text) in own.chain(runtime) {
        let path = folder.join(path);
        let parent = path.parent().unwrap_or(folder);
        std::fs::create_dir_all(parent).map_err(|error| {
            Failure::Input(format!(
                "folder {} cannot be made: {error}",
                parent.display()
            ))
        })?;
        write(&path, text)?;
    }
    Ok(())
}
