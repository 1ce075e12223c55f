//! `atlas`: pictures, base parameters and counts of many mechanisms, as one table with a page for each.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Instant;

use modelmill::Host;
use modelmill::atlas;
use modelmill::picture::Drawing;

use crate::args::AtlasArgs;
use crate::failure::{Failure, Outcome};
use crate::output::{self, Target};
use crate::{commands, terminal};

/// Name of the table in its folder, and of the folder of what it links to.
const TABLE: &str = "atlas.md";
const PAGES: &str = "atlas";

/// Derives all models and writes the atlas.
pub(crate) fn run(host: &Host, args: &AtlasArgs) -> Outcome {
    let folder = args.out.join(PAGES);
    output::make_folder(&folder)?;
    let mut names = BTreeSet::new();
    let mut entries = Vec::new();
    for path in &args.models {
        let start = Instant::now();
        let model = commands::model(host, path)?;
        let seconds = start.elapsed().as_secs_f64();
        if !names.insert(model.name.clone()) {
            return Err(Failure::Input(format!(
                "{}: another model of the atlas is called `{}` too; give one of the files another name",
                path.display(),
                model.name
            )));
        }
        let entry = model.atlas(Some(seconds))?;
        let file = |ending: &str| {
            let file = folder.join(format!("{}.{ending}", model.name));
            Target::new(&file, args.models.iter().map(PathBuf::as_path))
        };
        file("svg")?.write(&model.picture(&Drawing::default(), None)?)?;
        file("md")?.write(&model.atlas_page(&entry))?;
        entries.push(entry);
    }
    let table = args.out.join(TABLE);
    Target::new(&table, args.models.iter().map(PathBuf::as_path))?.write(&atlas::page(&entries))?;
    terminal::print(&format!(
        "{} holds {}.",
        table.display(),
        modelmill::text::table::count(entries.len(), "mechanism", "mechanisms")
    ))
}
