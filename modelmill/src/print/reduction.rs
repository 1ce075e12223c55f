//! Reduction of a rig to a model, as JSON for scripts and as text for people.

use std::fmt::Write as _;

use modelmill_reduction::ReductionReport;
use serde_json::{Value, json};

use crate::reduce::RigReduction;

impl RigReduction {
    /// Findings and forces as one JSON object; `out` is where the model file goes.
    pub fn json(&self, out: &str) -> Value {
        json!({
            "rig": self.rig,
            "out": out,
            "findings": findings(&self.reduction.report),
            "forces": self.forces.iter().map(|f| json!({ "drive": f.drive, "nrms": f.nrms })).collect::<Vec<_>>(),
            "poses": self.poses,
        })
    }

    /// The same as text: the report of the reduction, and the error of each drive's force.
    pub fn text(&self) -> String {
        let mut text = self.reduction.report.text();
        text.push_str("Error - forces of the model compared with those of the rig, relative (nrms)\n");
        for one in &self.forces {
            let _ = writeln!(text, "  {:<16}{:.1e}", one.drive, one.nrms);
        }
        text
    }
}

/// Findings of the reduction as JSON, with the sizes that led to each.
fn findings(report: &ReductionReport) -> Vec<Value> {
    let findings = report.findings.iter();
    findings
        .map(|finding| {
            let sizes: Vec<Value> = finding
                .sizes
                .iter()
                .map(|size| json!({ "of": size.quantity, "value": size.value, "unit": size.unit, "is_felt": size.is_significant() }))
                .collect();
            json!({ "step": finding.step, "about": finding.about, "says": finding.says, "sizes": sizes })
        })
        .collect()
}
