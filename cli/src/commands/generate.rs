//! `generate`: writes the model as a Rust or Julia module, as C99 sources, or as a crate that builds a C library or a
//! Python module.

use std::path::Path;

use modelmill::Host;
use modelmill::files::{DiskFiles, FileSource};
use modelmill::generate::{CodeLanguage, CodeOptions, EmittedFile, LanguageForm};
use modelmill::text::table::count;

use crate::args::GenerateArgs;
use crate::failure::{CommandFailure, CommandOutcome};
use crate::output::{OutputFile, OutputSet, refuse_dash};
use crate::{commands, terminal};

/// Writes the source that `cargo build` generates from the model, or a folder of sources, or a crate.
pub(crate) fn run(host: &Host, args: &GenerateArgs) -> CommandOutcome {
    let more = [("--reactions", args.reactions), ("--self-test", args.self_test)];
    // Some languages lack some parts of the code.
    if let Some((flag, _)) = more.iter().find(|(_, asked)| *asked)
        && !args.language.has_all()
    {
        let able = CodeLanguage::all().filter(|language| language.has_all());
        let able: Vec<&str> = able.map(CodeLanguage::name).collect();
        return Err(CommandFailure::Usage(format!(
            "{flag} is available with --language {} only; remove it, or remove --language",
            able.join(" and ")
        )));
    }
    let model = commands::model(host, &args.model)?;
    let form = args.language.form();
    let target = match (&args.out, form) {
        (Some(path), LanguageForm::Module) => Some(OutputFile::new(path, model.files())?),
        _ => None,
    };
    // The library returns files as texts; this command only decides where they go.
    let files = model.generate(&CodeOptions {
        language: args.language,
        dynamics: args.dynamics,
        reactions: args.reactions,
        self_test: args.self_test,
    })?;
    // A module goes to a file or to standard output, sources and crates go to a folder.
    let makes = match form {
        LanguageForm::Module => return write_module(target.as_ref(), &files),
        LanguageForm::Sources => {
            return write_sources(args, &model.files().collect::<Vec<&Path>>(), &files);
        }
        LanguageForm::Crate { makes } => makes,
    };
    let Some(folder) = &args.out else {
        return Err(CommandFailure::Usage(
            "--out is missing; give the folder of the crate".to_owned(),
        ));
    };
    write_crate(folder, &files)?;
    terminal::note(&format!("{}: a crate that builds {makes}", folder.display()));
    Ok(())
}

/// Writes the module to the target, or prints it.
fn write_module(target: Option<&OutputFile>, files: &[EmittedFile]) -> CommandOutcome {
    for file in files {
        let Some(target) = target else {
            return terminal::print(&file.text);
        };
        target.write(&file.text)?;
        terminal::note(&format!(
            "{}: {}, the module `{}`",
            target.path().display(),
            count(file.text.lines().count(), "line", "lines"),
            Path::new(&file.path).file_stem().unwrap_or_default().display()
        ));
    }
    Ok(())
}

/// Writes source files into the folder of `--out`; refuses to write over `inputs`.
fn write_sources(args: &GenerateArgs, inputs: &[&Path], files: &[EmittedFile]) -> CommandOutcome {
    let Some(folder) = &args.out else {
        return Err(CommandFailure::Usage(
            "--out is missing; give the folder of the sources".to_owned(),
        ));
    };
    refuse_dash("--out", folder)?;
    std::fs::create_dir_all(folder)
        .map_err(|error| CommandFailure::Input(format!("folder {} cannot be created: {error}", folder.display())))?;
    // A header beside the source of another model would compute wrong forces, so both are replaced or none.
    let mut outputs = OutputSet::default();
    for file in files {
        let target = OutputFile::new(&folder.join(&file.path), inputs.iter().copied())?;
        outputs.add(&target, file.text.as_str());
    }
    outputs.write()?;
    let names = files.iter().map(|file| file.path.as_str());
    terminal::note(&format!(
        "{}: {}",
        folder.display(),
        names.collect::<Vec<&str>>().join(" and ")
    ));
    Ok(())
}

/// The first line of each manifest that this program writes; it marks a folder that may be written over.
const MANIFEST_HEADER: &str = "# Written by modelmill.";

/// Writes a crate. A folder with other contents than an earlier crate of this program is refused.
fn write_crate(folder: &Path, files: &[EmittedFile]) -> CommandOutcome {
    refuse_dash("--out", folder)?;
    let manifest = folder.join("Cargo.toml");
    let ours = DiskFiles::default()
        .read_text(&manifest, 1 << 20)
        .is_ok_and(|text| text.starts_with(MANIFEST_HEADER));
    // A new or empty folder is accepted, and one with a manifest of this program.
    let occupied = folder.is_file() || std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    if occupied && !ours {
        return Err(CommandFailure::Usage(format!(
            "--out {}: the folder has files that modelmill did not write; give the name of a new folder",
            folder.display()
        )));
    }
    let mut outputs = OutputSet::default();
    // Files of a crate may be in subfolders, which are created as needed.
    for file in files {
        let path = folder.join(&file.path);
        let parent = path.parent().unwrap_or(folder);
        std::fs::create_dir_all(parent).map_err(|error| {
            CommandFailure::Input(format!("folder {} cannot be created: {error}", parent.display()))
        })?;
        outputs.add_path(path, file.text.as_str());
    }
    outputs.write()
}
