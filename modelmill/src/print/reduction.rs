//! Reduction of a rig to a model, as JSON for scripts and as text for people.

use std::fmt::Write as _;

use modelmill_reduction::ReductionReport;
use serde_json::{Value, json};

use crate::reduce::{ProposedReduction, RigReduction};

impl RigReduction {
    /// Findings and forces as one JSON object; `out` is where the model file goes.
    pub fn json(&self, out: &str) -> Value {
        json!({
            "rig": self.rig,
            "out": out,
            "findings": findings(&self.reduction.report),
            "forces": self.forces.iter().map(|f| json!({ "drive": f.drive, "nrms": f.nrms })).collect::<Vec<_>>(),
            "poses": self.poses,
            "base_parameters": self.n_base,
        })
    }

    /// The report of the reduction and the error of each drive's force, as text for a terminal.
    pub fn text(&self) -> String {
        self.reduction.report.text() + &self.errors_text()
    }

    /// The error of each drive's force.
    fn errors_text(&self) -> String {
        let mut text = "Error - forces of the model compared with those of the rig, relative (nrms)\n".to_owned();
        for one in &self.forces {
            let _ = writeln!(text, "  {:<16}{:.1e}", one.drive, one.nrms);
        }
        text
    }
}

impl ProposedReduction {
    /// Proposal, findings and forces as one JSON object; `plan` and `out` are where plan and model go.
    pub fn json(&self, plan: &str, out: Option<&str>) -> Value {
        let mut object = self.reduced.json(out.unwrap_or_default());
        object["out"] = json!(out);
        object["plan"] = json!(plan);
        object["proposes"] = json!(self.proposes);
        object
    }

    /// The proposed reduction plan, the error of each drive's force and the number of base parameters, as text for a
    /// terminal.
    pub fn text(&self) -> String {
        let mut text = "Proposed plan\n".to_owned();
        for says in &self.proposes {
            let _ = writeln!(text, "  {says}");
        }
        text.push_str(&self.reduced.errors_text());
        let _ = writeln!(text, "Base parameters of the model: {}", self.reduced.n_base);
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
