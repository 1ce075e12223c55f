//! Finds the effect that a model lacks, from a model file and two recordings, and writes the completed model file and
//! a page with the findings: `cargo run --release -p modelmill --example from_model_to_page`.

use std::path::Path;

use modelmill::diagnose::DiagnosisOptions;
use modelmill::identify::EstimatorOptions;
use modelmill::print::RustWording;
use modelmill::recording::RecordingOptions;
use modelmill::{Model, Outcome, report};

fn main() -> Outcome {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let model = Model::open(root.join("model-spec/models/spidermill.toml"))?;
    println!("{} base parameters:", model.base.len());
    for base in &model.base {
        println!("  {} = {}", base.name, base.expression);
    }

    let recordings = root.join("recordings/spidermill-mbs");
    let fit = model.recording(recordings.join("with-rods-fit.csv"), &RecordingOptions::default())?;
    let check = model.recording(recordings.join("with-rods-check.csv"), &RecordingOptions::default())?;
    // Identification of the model as it is, for comparison.
    let before = model.identify(&[&fit], &[&check], &EstimatorOptions::default())?;
    println!("identified: error {:.2} % on the validation run", percent(&before));

    let findings = model.diagnose(&[&fit], &[&check], &DiagnosisOptions::default())?;
    for missing in &findings.missing {
        println!("missing: {} at {}", missing.effect.kind, missing.effect.at.join(", "));
    }

    // The completed model is derived again and fitted to the same recordings.
    let better = model.with_added_effects(&findings.entries)?;
    let after = better.identify(&[&fit], &[&check], &EstimatorOptions::default())?;
    println!("with the effect: error {:.2e} % on the validation run", percent(&after));

    let folder = std::env::temp_dir();
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|error| modelmill::Error::input(error.to_string()))?;
        println!("{}", path.display());
        Ok(())
    };
    write("spidermill-completed.toml", better.text())?;
    write("what-the-model-lacks.html", &report::page(&findings, &RustWording)?)
}

/// The error on the validation run relative to the measured forces, per cent.
fn percent(found: &modelmill::identify::Identification) -> f64 {
    let nrms = found.fit.check.as_ref().and_then(|check| check.nrms);
    100.0 * nrms.unwrap_or(f64::NAN)
}
