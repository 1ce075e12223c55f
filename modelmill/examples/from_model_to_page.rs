//! From a model file and two recordings to the effect that the model lacks, the completed model file, and a page that shows
//! it all: `cargo run --release -p modelmill --example from_model_to_page`.

use std::path::Path;

use modelmill::diagnose::DiagnosisOptions;
use modelmill::identify::EstimatorOptions;
use modelmill::print::LibrarySpelling;
use modelmill::recording::RecordingOptions;
use modelmill::{Model, Outcome, report};

fn main() -> Outcome {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let model = Model::open(root.join("model-spec/models/spidermill.toml"))?;
    println!("{} base parameters, eq. (16):", model.base.len());
    for base in &model.base {
        println!("  {} = {}", base.name, base.expression);
    }

    let recordings = root.join("recordings/spidermill-mbs");
    let fit = model.recording(
        recordings.join("with-rods-fit.csv"),
        &RecordingOptions::default(),
    )?;
    let check = model.recording(
        recordings.join("with-rods-check.csv"),
        &RecordingOptions::default(),
    )?;
    let before = model.identify(&[&fit], &[&check], &EstimatorOptions::default())?;
    println!("identified: {:.2} % off on the check run", percent(&before));

    let findings = model.diagnose(&[&fit], &[&check], &DiagnosisOptions::default())?;
    for missing in &findings.missing {
        println!(
            "missing: {} at {}",
            missing.effect.kind,
            missing.effect.at.join(", ")
        );
    }

    let better = model.with_added_effects(&findings.entries)?;
    let after = better.identify(&[&fit], &[&check], &EstimatorOptions::default())?;
    println!("with it: {:.2e} % off on the check run", percent(&after));

    let folder = std::env::temp_dir();
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|error| modelmill::Error::input(error.to_string()))?;
        println!("{}", path.display());
        Ok(())
    };
    write("spidermill-completed.toml", better.text())?;
    write(
        "what-the-model-lacks.html",
        &report::page(&findings, &LibrarySpelling)?,
    )
}

/// The error on the check run relative to the measured forces, per cent.
fn percent(found: &modelmill::identify::Identification) -> f64 {
    let nrms = found.fit.check.as_ref().and_then(|check| check.nrms);
    100.0 * nrms.unwrap_or(f64::NAN)
}
