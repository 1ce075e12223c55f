//! Output of `check`: contents of a model file as JSON and as text for people, and the errors of an invalid
//! file as JSON.

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Message, Remedy, plain};
use modelmill_codegen::review::NumericMethod;
use modelmill_codegen::{BaseReduction, Derivation, ReductionMethod};
use modelmill_emit::module_name;
use modelmill_spec::{
    CoordinateMotion, Diagnostic, DiagnosticSeverity, DriveKind, LoadFailure, LoadedModel, Mechanism, SourceFiles,
};
use serde_json::{Value, json};

use crate::model::{ModelCheck, ModelSummary, SampledRank, ineffective_retained};
use crate::print::RemedyWording;
use crate::text::TerminalStyle;
use crate::text::table::{count, significant};

impl ModelCheck {
    /// Contents of the model as one JSON object, with all warnings.
    pub fn json(&self, wording: &dyn RemedyWording) -> Value {
        let model = &self.model;
        let loaded = &model.loaded;
        let mut warnings = self::warnings(loaded, wording);
        // Warnings of the derivation come after those of the file: retained products that the reduction could not
        // use.
        let in_vain = ineffective_retained(&model.derivation).into_iter();
        warnings.extend(in_vain.map(|(k, says)| {
            let span = loaded.retain.get(k);
            let place = span.map(|span| loaded.sources.line_and_column(*span));
            json!({
                "severity": "warning",
                "says": says,
                "file": model.path,
                "line": place.map(|p| p.0),
                "column": place.map(|p| p.1),
            })
        }));
        // A reduction for one geometry and a rank that is uncertain.
        let caution = model.derivation.reduction.method.caution();
        let judged = caution.iter().chain(&self.warnings);
        warnings.extend(judged.map(|says| json!({ "severity": "warning", "says": says, "file": model.path })));
        let mut object = self.summary.json(&model.name, &model.derivation, &warnings);
        object["valid"] = json!(self.impossible_values().is_empty());
        object["magnitudes"] = self.magnitudes.json();
        object["numeric_rank"] = self.rank.as_ref().map_or(Value::Null, SampledRank::json);
        object["next"] = json!(self.next_step().map(|step| step.format_for(wording)));
        object
    }

    /// Validity, contents and magnitudes of the model as text for a terminal. Unlike the JSON, it contains no warnings
    /// and no next step.
    pub fn text(&self, style: TerminalStyle) -> String {
        let model = &self.model;
        let headline = style.bold(&format!("{}: {}", plain(&model.name), plain(&self.validity())));
        let contents = self.summary.text(&model.derivation);
        [headline, contents, self.magnitudes_text()].join("\n")
    }

    /// Whether the model is valid, and otherwise why not, as a phrase.
    fn validity(&self) -> String {
        match self.impossible_values().as_slice() {
            [] => "valid".to_owned(),
            [only] => format!("not valid: {only}"),
            [first, others @ ..] => format!("not valid: {first} ({} more above)", others.len()),
        }
    }

    /// Figures at the values of the file: gravity, mass, size and rank.
    fn magnitudes_text(&self) -> String {
        let mass = self
            .magnitudes
            .total_mass
            .map(|mass| format!("{} kg", significant(mass, 4)));
        let lines = [
            ("gravity", Some(self.magnitudes.gravity_text())),
            ("total mass", mass),
            ("size", self.magnitudes.extent_text()),
            ("numeric rank", self.rank.as_ref().map(SampledRank::text)),
        ];
        let lines: Vec<String> = lines
            .into_iter()
            .filter_map(|(what, text)| Some(format!("  {what:<20}{}", text?)))
            .collect();
        lines.join("\n")
    }

    /// The same for people, with the next step.
    pub fn text_with_next_step(&self, style: TerminalStyle, wording: &dyn RemedyWording) -> String {
        let text = self.text(style);
        match self.next_step() {
            Some(step) => format!("{text}\n\n{}", step.format_for(wording)),
            None => text,
        }
    }

    /// The next step: estimate the base parameters if nominal values are missing, otherwise compare the model with a
    /// recording. `None` if the model has no base parameters or no drives, or if values are impossible.
    pub fn next_step(&self) -> Option<Message> {
        let model = &self.model;
        if model.base.is_empty() || model.row_names().is_empty() || !self.impossible_values().is_empty() {
            return None;
        }
        let excite = Remedy::command(CommandName::Excite);
        Some(if (0..model.base.len()).all(|k| model.has_values(k)) {
            message!(
                "Next: {} compares the forces of the model with those of a recording, and finds what the model lacks; {} plans a \
                 motion for one.",
                Remedy::command(CommandName::Diagnose),
                excite
            )
        } else {
            message!(
                "The file does not give all values of the base parameters. Next: {} estimates them from a recording; {} plans a \
                 motion for one.",
                Remedy::command(CommandName::Identify),
                excite
            )
        })
    }
}

/// The reason (`says`) why a valid model cannot be used, as one JSON object. `path` is the path of the model file.
pub fn refusal(says: &str, path: &str) -> Value {
    json!({
        "valid": false,
        "diagnostics": [{ "severity": "error", "says": says, "file": path }],
    })
}

/// Errors of an invalid model file, as one JSON object.
pub fn faults(failure: &LoadFailure, wording: &dyn RemedyWording) -> Value {
    json!({
        "valid": false,
        "diagnostics": diagnostics(&failure.diagnostics, &failure.sources, wording),
    })
}

/// Warnings of a valid model file, each as a JSON object.
pub fn warnings(loaded: &LoadedModel, wording: &dyn RemedyWording) -> Vec<Value> {
    diagnostics(&loaded.warnings, &loaded.sources, wording)
}

/// Diagnostics of a model file as JSON, with file, line and column where they are known.
fn diagnostics(found: &[Diagnostic], sources: &SourceFiles, wording: &dyn RemedyWording) -> Vec<Value> {
    found
        .iter()
        .map(|one| {
            // Files that are included have their own path.
            let place = one.span.map(|span| {
                let (line, column) = sources.line_and_column(span);
                let file = sources.files.get(span.file);
                (file.map(|f| f.path.display().to_string()), line, column)
            });
            json!({
                "severity": match one.severity {
                    DiagnosticSeverity::Error => "error",
                    DiagnosticSeverity::Warning => "warning",
                },
                "says": one.message,
                "file": place.as_ref().map(|p| &p.0),
                "line": place.as_ref().map(|p| p.1),
                "column": place.as_ref().map(|p| p.2),
                "expected": one.label,
                "help": one.help.iter().map(|help| help.format_for(wording)).collect::<Vec<_>>(),
            })
        })
        .collect()
}

impl ModelSummary {
    /// Contents as one JSON object; `warnings` are those of file and derivation.
    fn json(&self, name: &str, derivation: &Derivation, warnings: &[Value]) -> Value {
        json!({
            "model": name,
            "module": module_name(&derivation.mechanism.name),
            "valid": true,
            "title": derivation.mechanism.title,
            "bodies": self.bodies,
            "lumped_masses": self.lumped_masses,
            "joints": { "active": self.active, "passive": self.passive },
            "loops": self.loops,
            "actuators": self.drives,
            "undriven": self.undriven,
            "effects": self.effects,
            "degrees_of_freedom": derivation.mechanism.drives.len(),
            "parameters": self.parameters,
            "products": derivation.reduction.products.len(),
            "base_parameters": derivation.reduction.retained.len(),
            "reduction": reduction(&derivation.reduction),
            "diagnostics": warnings,
        })
    }

    /// Contents as lines of text, each with a name in front; lists are omitted if they are empty.
    fn text(&self, derivation: &Derivation) -> String {
        let m = &derivation.mechanism;
        let mut lines = Vec::new();
        if let Some(title) = &m.title {
            lines.push(format!("  {}", plain(title)));
        }
        // Each line begins with what it counts, padded to one width.
        let mut line = |what: &str, text: String| lines.push(format!("  {what:<20}{text}"));
        let list = |names: &[String]| match names {
            [] => String::new(),
            names => format!(": {}", names.join(", ")),
        };
        // Emitted code cannot use a reserved word as the name of a module.
        let module = module_name(&m.name);
        let whose = if module == m.name {
            "the file's `name`"
        } else {
            "instead of the file's `name`, which is a reserved word of Rust or of emitted code"
        };
        line("module", format!("{module} ({whose})"));
        line("bodies", self.bodies.to_string());
        // Most models have none.
        if self.lumped_masses > 0 {
            line("lumped masses", self.lumped_masses.to_string());
        }
        // Joints are named with their motion, since most are revolute.
        let joints: Vec<String> = m
            .coordinates
            .iter()
            .map(|c| joint(c.motion, &c.name, c.passive))
            .collect();
        line("joints", format!("{}{}", joints.len(), list(&joints)));
        line("loops", format!("{}{}", self.loops.len(), list(&self.loops)));
        line("actuators", format!("{}{}", self.drives.len(), list(&drives(m, true))));
        // Forces of redundant drives are not unique; their projections on the independent coordinates are.
        if !m.shared_drives.is_empty() {
            let rows: Vec<&str> = m.drives.iter().map(|row| row.name.as_str()).collect();
            line(
                "redundant drives",
                format!(
                    "{} drives for {}: the force of each drive is not unique. The equations, regressors and base \
                     parameters are those of their generalised force J' f along the independent coordinates: {}",
                    m.shared_drives.len(),
                    count(m.drives.len(), "degree of freedom", "degrees of freedom"),
                    rows.join(", ")
                ),
            );
        } else if !self.undriven.is_empty() {
            line(
                "undriven",
                format!("{}{}", self.undriven.len(), list(&drives(m, false))),
            );
        }
        // Each row of the equations belongs to one degree of freedom.
        line("degrees of freedom", m.drives.len().to_string());
        if !self.effects.is_empty() {
            line("effects", format!("{}{}", self.effects.len(), list(&self.effects)));
        }
        line(
            "parameters",
            format!("{}{}", self.parameters.len(), list(&self.parameters)),
        );
        // Numbers of products and of their combinations that can be identified.
        let reduction = &derivation.reduction;
        line(
            "p_g and p_min",
            format!(
                "{} of parameters with an effect on the drives, {} (combinations that can be identified)",
                count(reduction.products.len(), "product", "products"),
                count(reduction.retained.len(), "base parameter", "base parameters"),
            ),
        );
        // A reduction for one geometry only is stated, since its base is not general.
        match reduction.method {
            ReductionMethod::Numeric { .. } => {
                line("reduced", "numerically, for the values of this file only".to_owned());
            }
            ReductionMethod::Exact { at_values: true, .. } => {
                line("reduced", "exactly, for the values of this file only".to_owned());
            }
            ReductionMethod::Exact { .. } | ReductionMethod::Unreduced => {}
        }
        lines.join("\n")
    }
}

/// How columns were reduced to a base.
fn reduction(reduction: &BaseReduction) -> Value {
    match NumericMethod::from_reduction(reduction) {
        Some(method) => json!(method),
        None => json!({
            "name": "exact",
            "at_values": matches!(reduction.method, ReductionMethod::Exact { at_values: true, .. }),
        }),
    }
}

/// Name of a joint, with its motion if it is not revolute, and `passive`.
fn joint(motion: CoordinateMotion, name: &str, passive: bool) -> String {
    let unusual = (motion != CoordinateMotion::Revolute).then(|| motion.name());
    let remarks: Vec<&str> = unusual.into_iter().chain(passive.then_some("passive")).collect();
    if remarks.is_empty() {
        return name.to_owned();
    }
    format!("{name} ({})", remarks.join(", "))
}

/// Drives with the joint or the points between which they act, either the actuated or the undriven ones.
fn drives(m: &Mechanism, is_driven: bool) -> Vec<String> {
    // Drives beyond the degrees of freedom are listed with the others.
    let shared = m.shared_drives.iter();
    m.drives
        .iter()
        .chain(shared)
        .filter(|drive| drive.is_driven == is_driven)
        .map(|drive| match drive.kind {
            DriveKind::Joint(i) => format!("{} (on {})", drive.name, m.coordinates[i.0].name),
            DriveKind::Linear { from, to } => format!(
                "{} (from {} to {})",
                drive.name, m.points[from.0].name, m.points[to.0].name
            ),
        })
        .collect()
}
