//! `atlas`: pictures, base parameters and counts of many mechanisms, as one table with a page for each, and as one page
//! of HTML.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

use modelmill::Host;
use modelmill::atlas::{self, AtlasEntry};
use modelmill::import::Options;
use modelmill::model::LoadedModel;
use modelmill::picture::PictureOptions;
use modelmill::report::{self, AtlasMechanism};

use crate::args::AtlasArgs;
use crate::commands::{self, import};
use crate::failure::{CommandFailure, CommandOutcome};
use crate::output::{self, OutputFile, OutputSet};
use crate::terminal;

/// Name of the table in the folder of `--out`.
const TABLE: &str = "atlas.md";
/// Name of the page with all mechanisms.
const PAGE: &str = "atlas.html";
/// Name of the folder of pictures and pages to which the table links.
const PAGES: &str = "atlas";

/// Derives all models and writes the atlas.
pub(crate) fn run(host: &Host, args: &AtlasArgs) -> CommandOutcome {
    let folder = args.out.join(PAGES);
    output::make_folder(&folder)?;
    let mut names = BTreeSet::new();
    let mut outputs = OutputSet::default();
    let mut entries = Vec::new();
    let mut mechanisms = Vec::new();
    // Derive each model for its picture and page; all files are written together at the end.
    for path in &args.models {
        let is_imported = import::is_description(path);
        let loaded = if is_imported {
            load_description(host, path)?
        } else {
            commands::load(host, path)?
        };
        let start = Instant::now();
        let model = commands::derive_model(host, &path.display().to_string(), loaded)?;
        let seconds = start.elapsed().as_secs_f64();
        // Files of the atlas have the names of the models, so these must be unique.
        if !names.insert(model.name.clone()) {
            return Err(CommandFailure::Input(format!(
                "{}: another model of the atlas is also called `{}`; give one of the files another name",
                path.display(),
                model.name
            )));
        }
        let entry = AtlasEntry {
            is_imported,
            ..model.atlas(Some(seconds))?
        };
        let file = |ending: &str| {
            let file = folder.join(format!("{}.{ending}", model.name));
            OutputFile::new(&file, args.models.iter().map(PathBuf::as_path))
        };
        // The picture is a file of its own and part of the overview page.
        let picture = model.picture(&PictureOptions::default(), None)?;
        outputs.add(&file("svg")?, picture.as_str());
        // Imported robots have no page of expressions.
        if !is_imported {
            outputs.add(&file("md")?, model.atlas_page(&entry));
        }
        entries.push(entry.clone());
        mechanisms.push(AtlasMechanism {
            entry,
            model,
            picture: picture.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1),
        });
    }
    // Table and page go into the folder itself, next to the folder of pictures.
    let target = |name: &str| OutputFile::new(&args.out.join(name), args.models.iter().map(PathBuf::as_path));
    outputs.add(&target(TABLE)?, atlas::page(&entries));
    outputs.add(&target(PAGE)?, report::atlas(&mechanisms));
    outputs.write()?;
    let table = args.out.join(TABLE);
    terminal::print(&format!(
        "{} lists {}; {} shows them on one page.",
        table.display(),
        modelmill::text::table::count(entries.len(), "mechanism", "mechanisms"),
        args.out.join(PAGE).display()
    ))
}

/// The model of a robot description, as `import` converts it without options.
fn load_description(host: &Host, path: &Path) -> CommandOutcome<LoadedModel> {
    let closures = import::closures_of(path, None);
    let imported = import::import_description(host, path, closures.as_deref(), Options::default())?;
    Ok(host.load_text(path, &imported.model)?)
}
