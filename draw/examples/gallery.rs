//! All models of a folder on one page: `cargo run -p modelmill-draw --example gallery -- model-spec/models > gallery.html`.

use std::path::PathBuf;

use modelmill_draw::{DrawingStyle, MechanismScene, svg};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).ok_or("give a folder of model files")?;
    let entries: Result<Vec<_>, _> = std::fs::read_dir(folder)?.collect();
    let mut files: Vec<PathBuf> = entries?.iter().map(std::fs::DirEntry::path).collect();
    files.retain(|file| file.extension().is_some_and(|e| e == "toml"));
    files.sort();
    println!(
        "<!DOCTYPE html><meta charset=\"utf-8\"><title>Mechanisms</title><style>figure{{display:inline-block;width:30em;margin:.5em}}</style>"
    );
    for file in files {
        let Ok(loaded) = modelmill_spec::load_file(&file) else {
            eprintln!("{} is no model", file.display());
            continue;
        };
        let mechanism = loaded.mechanism;
        let nominal: Vec<f64> = mechanism.coordinates.iter().map(|c| c.nominal).collect();
        let scene = MechanismScene::new(&mechanism, &nominal);
        let picture = svg(&[&scene], &scene.best_view(), &DrawingStyle::default());
        println!("<figure>{picture}<figcaption>{}</figcaption></figure>", mechanism.name);
    }
    Ok(())
}
