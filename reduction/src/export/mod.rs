//! Exports a model as a robot description of other programs, URDF or MJCF; the inverse of [`import`](fn@crate::import).
//!
//! A mechanism with the nominal values of its parameters goes in, text and remarks come out. `tree` merges frames that
//! move together into links, with joints between them; `inertia` adds up masses and inertias of links; `mjcf` and
//! `urdf` write the text. A remark reports everything that a format cannot express. If the description would give other
//! forces without a remark, export fails.

mod friction;
mod inertia;
mod mjcf;
mod tree;
mod urdf;

use std::fmt;

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Message, OptionName, Remedy};
use modelmill_spec::{ExactExpression, Mechanism};

/// A format of robot descriptions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DescriptionFormat {
    /// The format of ROS: trees without loops.
    Urdf,
    /// The format of MuJoCo: loops, linear drives as tendons, inertia of drives, springs.
    Mjcf,
}

impl DescriptionFormat {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Urdf, Self::Mjcf];

    /// Its name in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Urdf => "urdf",
            Self::Mjcf => "mjcf",
        }
    }

    /// The format for the ending of a file name, without the dot.
    pub fn from_extension(ending: &str) -> Option<Self> {
        match ending {
            "urdf" => Some(Self::Urdf),
            "xml" | "mjcf" => Some(Self::Mjcf),
            _ => None,
        }
    }
}

/// A robot description of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct DescriptionExport {
    /// Its text.
    pub text: String,
    /// What the format lacks or states differently; one sentence each.
    pub remarks: Vec<Message>,
}

/// Why a model cannot be exported in a format: one sentence with a remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExportError(String);

impl fmt::Display for ExportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ExportError {}

/// The mechanism with the identified values of base parameters that are single parameters of effects as nominal values.
/// Parameters of bodies are left out: a body needs all ten of them from one source.
fn with_identified_parameters(mechanism: &Mechanism) -> Mechanism {
    let mut mechanism = mechanism.clone();
    for (expression, value) in mechanism.identified_base.clone() {
        if let Some(p) = mechanism.effect_parameter(&expression) {
            let parameter = &mut mechanism.parameters[p.0];
            (parameter.nominal, parameter.has_nominal) = (value, true);
        }
    }
    mechanism
}

/// Writes a mechanism with its nominal values as a robot description.
///
/// Fails if a coordinate moves its joints only by ratios other than one, or a mass has different places in the balances
/// of forces and of moments.
pub fn export(mechanism: &Mechanism, format: DescriptionFormat) -> Result<DescriptionExport, ExportError> {
    let mut remarks = Vec::new();
    let mechanism = &with_identified_parameters(mechanism);
    // With loops, bodies are drawn at the nominal pose, where loops are closed; without loops at zero.
    let at: Vec<f64> = match format {
        DescriptionFormat::Mjcf if !mechanism.loops.is_empty() => {
            mechanism.coordinates.iter().map(|c| c.nominal).collect()
        }
        _ => vec![0.0; mechanism.coordinates.len()],
    };
    // Links and joints, then inertias of the links, which simulators check.
    let mut tree = tree::link_tree(mechanism, &at)?;
    tree.followed = followed_coordinates(mechanism, &mut remarks);
    let mut bodies = inertia::bodies(mechanism, &tree)?;
    inertia::complete_inertias(&tree, &mut bodies, &mut remarks);
    inertia::report_impossible(&tree, &bodies, &mut remarks);
    // Values of base parameters cannot be distributed to bodies.
    if mechanism
        .identified_base
        .iter()
        .any(|(expression, _)| mechanism.effect_parameter(expression).is_none())
    {
        remarks.push(message!(
            "some values under `[identified]` are those of parameters of bodies or sums of them, which do not determine complete \
             bodies, so bodies have their nominal values. For a description of the real machine, identify with {} and write the fit with {}",
            Remedy::option(OptionName::Physical),
            Remedy::command(CommandName::Adopt)
        ));
    }
    let friction = friction::passive_effects(mechanism, format, &mut remarks);
    let text = match format {
        DescriptionFormat::Urdf => urdf::write(mechanism, &tree, &bodies, &friction, &mut remarks),
        DescriptionFormat::Mjcf => mjcf::write(mechanism, &tree, &bodies, &friction, &at, &mut remarks),
    };
    Ok(DescriptionExport { text, remarks })
}

/// A coordinate that follows a single other one.
#[derive(Clone, Debug)]
struct FollowedCoordinate {
    /// Index of the coordinate.
    coordinate: usize,
    /// Index of the coordinate that it follows.
    leader: usize,
    /// Factor of the leader.
    factor: f64,
    /// Constant part, rad or m.
    offset: f64,
}

/// Couplings to a single coordinate, with numeric values. Formats have no others, so a remark reports them.
fn followed_coordinates(mechanism: &Mechanism, remarks: &mut Vec<Message>) -> Vec<FollowedCoordinate> {
    let value = |exact: &ExactExpression| exact.evaluate(&|symbol| mechanism.symbol_nominal(symbol));
    let mut found = Vec::new();
    for coupling in &mechanism.couplings {
        // Both formats know couplings to one joint only.
        if coupling.function.is_some() {
            remarks.push(message!(
                "`{}` follows others by a function, which the format cannot express; it is independent in the description",
                mechanism.coordinates[coupling.coordinate.0].name
            ));
        } else if let [(of, factor)] = &coupling.terms[..] {
            found.push(FollowedCoordinate {
                coordinate: coupling.coordinate.0,
                leader: of.0,
                factor: value(factor),
                offset: value(&coupling.offset),
            });
        } else {
            remarks.push(message!(
                "`{}` follows several joints, which the format cannot express; it is independent in the description",
                mechanism.coordinates[coupling.coordinate.0].name
            ));
        }
    }
    found
}

/// Numbers separated by spaces, with all digits.
fn number_list(values: &[f64]) -> String {
    let words: Vec<String> = values.iter().map(|x| number_text(*x)).collect();
    words.join(" ")
}

/// A number with all digits; magnitudes below 1e-15 are rounding and become zero.
fn number_text(value: f64) -> String {
    if value.abs() < 1e-15 {
        return "0".to_owned();
    }
    // Integers without a decimal point.
    if value.fract() == 0.0 && value.abs() < 1e15 {
        return format!("{value:.0}");
    }
    format!("{value:?}")
}
