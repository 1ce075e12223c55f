//! A model as a robot description of other programs, URDF or MJCF: the way back of [`import`](fn@crate::import).
//!
//! A mechanism with the nominal values of its parameters goes in. `tree` makes one link of all frames that move as one, with
//! joints between links; `inertia` adds up what they carry; `mjcf` and `urdf` write both down. What a format cannot say is a
//! remark, never dropped; what would give other forces without a word is an error.

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
    /// Of ROS: trees without loops.
    Urdf,
    /// Of MuJoCo: loops, linear drives as tendons, inertia of drives, springs.
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

    /// The format that an ending of a file's name (without the dot) stands for.
    pub fn from_extension(ending: &str) -> Option<Self> {
        match ending {
            "urdf" => Some(Self::Urdf),
            "xml" | "mjcf" => Some(Self::Mjcf),
            _ => None,
        }
    }
}

/// A robot description that was made of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct DescriptionExport {
    /// Its text.
    pub text: String,
    /// What the format does not say, or says otherwise.
    pub remarks: Vec<Message>,
}

/// Why a model cannot be written down in a format.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExportError(String);

impl fmt::Display for ExportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for ExportError {}

/// Writes a mechanism with its nominal values as a robot description.
///
/// Fails where a joint moves in a way that the format does not know, or a mass sits at different places for the balances of
/// forces and of moments.
pub fn export(
    mechanism: &Mechanism,
    format: DescriptionFormat,
) -> Result<DescriptionExport, ExportError> {
    let mut remarks = Vec::new();
    // Closed loops are shown as they stand; the zeros of a tree are its own.
    let at: Vec<f64> = match format {
        DescriptionFormat::Mjcf if !mechanism.loops.is_empty() => {
            mechanism.coordinates.iter().map(|c| c.nominal).collect()
        }
        _ => vec![0.0; mechanism.coordinates.len()],
    };
    let mut tree = tree::link_tree(mechanism, &at)?;
    tree.followed = followed_coordinates(mechanism, &mut remarks);
    let mut bodies = inertia::bodies(mechanism, &tree)?;
    inertia::complete_inertias(&tree, &mut bodies, &mut remarks);
    inertia::report_impossible(&tree, &bodies, &mut remarks);
    if !mechanism.identified_base.is_empty() {
        remarks.push(message!(
            "the values under `[identified]` are those of base parameters, which say nothing of single bodies: bodies have \
             their nominal values here; identify with {} and let {} write that fit for a description of the real machine",
            Remedy::option(OptionName::Physical),
            Remedy::command(CommandName::Adopt)
        ));
    }
    let friction = friction::passive_effects(mechanism, format, &mut remarks);
    let text = match format {
        DescriptionFormat::Urdf => urdf::write(mechanism, &tree, &bodies, &friction, &mut remarks),
        DescriptionFormat::Mjcf => {
            mjcf::write(mechanism, &tree, &bodies, &friction, &at, &mut remarks)
        }
    };
    Ok(DescriptionExport { text, remarks })
}

/// A coordinate that follows a single other one.
#[derive(Clone, Debug)]
struct FollowedCoordinate {
    coordinate: usize,
    leader: usize,
    factor: f64,
    offset: f64,
}

/// Couplings that formats have; those to several coordinates they have not, which is said.
fn followed_coordinates(
    mechanism: &Mechanism,
    remarks: &mut Vec<Message>,
) -> Vec<FollowedCoordinate> {
    let value =
        |exact: &ExactExpression| exact.evaluate(&|symbol| mechanism.symbol_nominal(symbol));
    let mut found = Vec::new();
    for coupling in &mechanism.couplings {
        if let [(of, factor)] = &coupling.terms[..] {
            found.push(FollowedCoordinate {
                coordinate: coupling.coordinate.0,
                leader: of.0,
                factor: value(factor),
                offset: value(&coupling.offset),
            });
        } else {
            remarks.push(message!(
                "`{}` follows several joints, which the format has no word for: it moves by itself",
                mechanism.coordinates[coupling.coordinate.0].name
            ));
        }
    }
    found
}

/// Numbers with spaces between them, each with as many digits as it needs.
fn number_list(values: &[f64]) -> String {
    let words: Vec<String> = values.iter().map(|x| number_text(*x)).collect();
    words.join(" ")
}

/// A number with as many digits as it needs; rounding below 1e-15 is zero.
fn number_text(value: f64) -> String {
    if value.abs() < 1e-15 {
        return "0".to_owned();
    }
    if value.fract() == 0.0 && value.abs() < 1e15 {
        return format!("{value:.0}");
    }
    format!("{value:?}")
}
