//! What a page or a notebook does with the library, without a disk, a terminal or threads.

use std::path::PathBuf;
use std::sync::Arc;

use modelmill::diagnose::Question;
use modelmill::files::Memory;
use modelmill::identify::Estimation;
use modelmill::recording::Reading;
use modelmill::{Host, Outcome};
use serde_json::{Value, json};

const MODEL: &str = include_str!("../../../model-spec/models/spidermill.toml");
const FIT: &[u8] = include_bytes!("../../../recordings/spidermill-mbs/with-rods-fit.csv");
const CHECK: &[u8] = include_bytes!("../../../recordings/spidermill-mbs/with-rods-check.csv");

/// Derives the bundled robot, identifies it and looks for what it lacks; all files come from memory. Numbers in SI units.
///
/// Fails where the library does.
pub fn answer() -> Outcome<Value> {
    let files = Memory::default()
        .with("spidermill.toml", MODEL)
        .with("fit.csv", FIT)
        .with("check.csv", CHECK);
    let host = Host::new().with_files(Arc::new(files));
    let model = host.model("spidermill.toml")?;
    let [fit, check] = ["fit.csv", "check.csv"]
        .map(|file| model.recording(PathBuf::from(file), &Reading::default()));
    let (fit, check) = (fit?, check?);
    let identified = model.identify(&[&fit], &[&check], &Estimation::default())?;
    let findings = model.diagnose(&[&fit], &[&check], &Question::default())?;

    let base = model.base.iter();
    let base: Vec<Value> = base
        .map(|base| json!({ "name": base.name, "expression": base.expression }))
        .collect();
    let parameters = identified.fit.parameters.iter();
    let parameters: Vec<Value> = parameters
        .map(|p| json!({ "name": p.name, "value": p.value, "std": p.std }))
        .collect();
    let missing = findings.missing.iter().map(|missing| {
        let estimates = missing.estimates.iter();
        let estimates: Vec<Value> = estimates
            .map(|e| json!({ "name": e.name, "value": e.value }))
            .collect();
        json!({ "kind": missing.effect.kind, "at": missing.effect.at, "estimates": estimates })
    });
    let missing: Vec<Value> = missing.collect();
    let ladder = findings.diagnosis.ladder.iter();
    let ladder: Vec<f64> = ladder.map(|rung| rung.check).collect();
    Ok(json!({
        "base": base,
        "condition_number": identified.fit.condition_number,
        "parameters": parameters,
        "check": identified.fit.check.as_ref().and_then(|check| check.nrms),
        "verdict": format!("{:?}", findings.diagnosis.verdict),
        "missing": missing,
        "ladder": ladder,
    }))
}

#[cfg(target_family = "wasm")]
pub mod exports {
    //! What the host calls by name.
    use std::sync::OnceLock;

    static ANSWER: OnceLock<String> = OnceLock::new();

    fn text() -> &'static str {
        ANSWER.get_or_init(|| match super::answer() {
            Ok(answer) => answer.to_string(),
            Err(error) => format!("{error}"),
        })
    }

    /// Where the answer begins in memory: JSON, or the words of an error.
    #[unsafe(no_mangle)]
    pub extern "C" fn answer_start() -> *const u8 {
        text().as_ptr()
    }

    /// Its length in bytes.
    #[unsafe(no_mangle)]
    pub extern "C" fn answer_length() -> usize {
        text().len()
    }
}
