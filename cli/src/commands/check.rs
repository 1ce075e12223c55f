//! `check`: validates a model file and says what is in it.

use modelmill_codegen::{Derivation, module_name};
use modelmill_spec::{Diagnostic, DriveKind, Mechanism, Motion, Severity, Sources};
use serde_json::{Value, json};

use crate::args::CheckArgs;
use crate::failure::{Failure, Outcome};
use crate::model;
use crate::sampled_rank::{Judged, SampledRank, judged_rank};
use crate::table::count;
use crate::terminal;

/// Validates and derives the model, and prints a summary.
pub(crate) fn run(args: &CheckArgs) -> Outcome {
    if args.json && args.model.is_file() {
        // What is wrong goes to standard output as well, for editors.
        if let Err(failure) = modelmill_spec::load_file_with(&args.model, model::libraries()) {
            terminal::print_json(&json!({
                "valid": false,
                "diagnostics": diagnostics(&failure.diagnostics, &failure.sources),
            }))?;
            return Err(Failure::Rendered(
                failure.render(terminal::errors_in_colour()),
            ));
        }
    }
    let loaded = model::load(&args.model)?;
    let model = model::derive_loaded(&args.model.display().to_string(), &loaded)?;
    let summary = Summary::new(&model.derivation);
    // Without any product there is nothing whose rank could be looked at.
    let judged = if model.derivation.reduction.products.is_empty() {
        Judged {
            found: None,
            warnings: Vec::new(),
        }
    } else {
        judged_rank(&model)
    };
    for says in &judged.warnings {
        terminal::warn(&format!("{}: {says}", model.path));
    }
    let rank = judged.found.as_ref();
    if args.json {
        let mut warnings = diagnostics(&loaded.warnings, &loaded.sources);
        warnings.extend(
            model::retained_in_vain(&model.derivation)
                .into_iter()
                .map(|(k, says)| {
                    let place = loaded
                        .retain
                        .get(k)
                        .map(|span| loaded.sources.line_and_column(*span));
                    json!({
                        "severity": "warning",
                        "says": says,
                        "file": model.path,
                        "line": place.map(|p| p.0),
                        "column": place.map(|p| p.1),
                    })
                }),
        );
        warnings.extend(
            judged
                .warnings
                .iter()
                .map(|says| json!({ "severity": "warning", "says": says, "file": model.path })),
        );
        let mut object = summary.json(&model.name, &model.derivation, &warnings);
        object["numeric_rank"] = rank.map_or(Value::Null, SampledRank::json);
        return terminal::print_json(&object);
    }
    terminal::print(&summary.text(&model.name, &model.derivation, rank))
}

fn diagnostics(found: &[Diagnostic], sources: &Sources) -> Vec<Value> {
    found
        .iter()
        .map(|one| {
            let place = one.span.map(|span| {
                let (line, column) = sources.line_and_column(span);
                let file = sources.files.get(span.file);
                (file.map(|f| f.path.display().to_string()), line, column)
            });
            json!({
                "severity": match one.severity {
                    Severity::Error => "error",
                    Severity::Warning => "warning",
                },
                "says": one.message,
                "file": place.as_ref().map(|p| &p.0),
                "line": place.as_ref().map(|p| p.1),
                "column": place.as_ref().map(|p| p.2),
                "expected": one.label,
                "help": one.help,
            })
        })
        .collect()
}

/// What a model consists of.
struct Summary {
    bodies: usize,
    lumped_masses: usize,
    active: Vec<String>,
    passive: Vec<String>,
    loops: Vec<String>,
    drives: Vec<String>,
    effects: Vec<String>,
    parameters: Vec<String>,
}

impl Summary {
    fn new(derivation: &Derivation) -> Self {
        let m = &derivation.mechanism;
        let coordinates = |passive: bool| {
            let wanted = m.coordinates.iter().filter(|c| c.passive == passive);
            wanted.map(|c| c.name.clone()).collect()
        };
        Self {
            bodies: m.parts.len(),
            lumped_masses: m.lumped_masses.len(),
            active: coordinates(false),
            passive: coordinates(true),
            loops: m.loops.iter().map(|l| l.name.clone()).collect(),
            drives: m.drives.iter().map(|d| d.name.clone()).collect(),
            effects: m.effects.iter().map(|e| e.kind.clone()).collect(),
            parameters: m.parameters.iter().map(|p| p.name.clone()).collect(),
        }
    }

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
            "effects": self.effects,
            "degrees_of_freedom": self.active.len(),
            "parameters": self.parameters,
            "products": derivation.reduction.products.len(),
            "base_parameters": derivation.reduction.retained.len(),
            "diagnostics": warnings,
        })
    }

    fn text(&self, name: &str, derivation: &Derivation, rank: Option<&SampledRank>) -> String {
        let style = terminal::style();
        let m = &derivation.mechanism;
        let mut lines = vec![style.bold(&format!("{name}: sound"))];
        if let Some(title) = &m.title {
            lines.push(format!("  {title}"));
        }
        let mut line = |what: &str, text: String| lines.push(format!("  {what:<20}{text}"));
        let list = |names: &[String]| match names {
            [] => String::new(),
            names => format!(": {}", names.join(", ")),
        };
        let module = module_name(&m.name);
        let whose = if module == m.name {
            "the file's `name`"
        } else {
            "for the file's `name`, which is a word of Rust or of emitted code"
        };
        line("module", format!("{module} ({whose})"));
        line("bodies", self.bodies.to_string());
        if self.lumped_masses > 0 {
            line("lumped masses", self.lumped_masses.to_string());
        }
        let joints: Vec<String> = m
            .coordinates
            .iter()
            .map(|c| joint(c.motion, &c.name, c.passive))
            .collect();
        line("joints", format!("{}{}", joints.len(), list(&joints)));
        line(
            "loops",
            format!("{}{}", self.loops.len(), list(&self.loops)),
        );
        line(
            "actuators",
            format!("{}{}", self.drives.len(), list(&drives(m))),
        );
        line("degrees of freedom", self.active.len().to_string());
        if !self.effects.is_empty() {
            line(
                "effects",
                format!("{}{}", self.effects.len(), list(&self.effects)),
            );
        }
        line(
            "parameters",
            format!("{}{}", self.parameters.len(), list(&self.parameters)),
        );
        let reduction = &derivation.reduction;
        line(
            "p_g and p_min",
            format!(
                "{} with an effect on the actuators, {}",
                count(reduction.products.len(), "product", "products"),
                count(
                    reduction.retained.len(),
                    "base parameter",
                    "base parameters"
                ),
            ),
        );
        if let Some(rank) = rank {
            line("numeric rank", rank.text());
        }
        lines.join("\n")
    }
}

fn joint(motion: Motion, name: &str, passive: bool) -> String {
    match (motion, passive) {
        (Motion::Revolute, false) => name.to_owned(),
        (Motion::Revolute, true) => format!("{name} (passive)"),
        (Motion::Prismatic, false) => format!("{name} (prismatic)"),
        (Motion::Prismatic, true) => format!("{name} (prismatic, passive)"),
    }
}

fn drives(m: &Mechanism) -> Vec<String> {
    m.drives
        .iter()
        .map(|drive| match drive.kind {
            DriveKind::Joint(i) => format!("{} (on {})", drive.name, m.coordinates[i.0].name),
            DriveKind::Linear { from, to } => format!(
                "{} (from {} to {})",
                drive.name, m.points[from.0].name, m.points[to.0].name
            ),
        })
        .collect()
}
