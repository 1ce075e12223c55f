//! Reads the loop closures of a URDF from the `robot.yaml` of the collection example-parallel-robots.
//!
//! Only the part of YAML that these files use is read: keys at the start of lines, followed by lists in brackets or
//! with dashes. Unknown keys are reported.

use super::thresholds::LARGEST_CLOSURES;

/// Contents of the file.
#[derive(Debug, Default)]
pub(crate) struct ClosureFile {
    /// Loop closures.
    pub(crate) pairs: Vec<CoincidentFrames>,
    /// Names of the driven joints; empty if all are driven.
    pub(crate) drives: Vec<String>,
    /// Joints with their true kinds, which replace those of the URDF. URDF has neither ball joints nor universal
    /// joints.
    pub(crate) joints: Vec<(String, JointReplacement)>,
    /// What is not read; one sentence each.
    pub(crate) remarks: Vec<String>,
}

/// True kind of a joint that URDF cannot express.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum JointReplacement {
    /// Three rotations.
    Ball,
    /// No motion.
    Fixed,
    /// A universal joint: two hinges in sequence about these axes of its frame.
    Cross([char; 2]),
}

/// Two frames that coincide.
#[derive(Debug)]
pub(crate) struct CoincidentFrames {
    /// Names of links, or of joints whose child links are meant.
    pub(crate) ends: [String; 2],
    /// Whether the orientations coincide as well as the origins.
    pub(crate) is_full: bool,
    /// Line of the closures in the file.
    pub(crate) line: u32,
}

/// Keys that are read; others are reported.
const KNOWN_KEYS: [&str; 5] = ["closed_loop", "type", "name_mot", "joint_name", "joint_type"];

/// Reads the file; fails with the line and what was expected.
pub(crate) fn read(text: &str) -> Result<ClosureFile, String> {
    if text.len() > LARGEST_CLOSURES {
        return Err(format!("the file of closures is larger than {LARGEST_CLOSURES} bytes"));
    }
    // Lines that start with a blank, a dash or a bracket continue the value of the key before.
    let mut entries: Vec<(u32, &str, String)> = Vec::new();
    for (line, text) in (1..).zip(text.lines()) {
        // Remove comments, and skip empty lines and the start of the document.
        let text = text.split(" #").next().unwrap_or_default();
        if text.trim().is_empty() || text.starts_with('#') || text.trim() == "---" {
            continue;
        }
        if text.starts_with([' ', '\t', '-', '[', ']']) {
            if let Some((_, _, value)) = entries.last_mut() {
                value.push('\n');
                value.push_str(text);
            }
            continue;
        }
        let (key, value) = text
            .split_once(':')
            .ok_or_else(|| format!("line {line} of the file of closures: expected `key: value`, found `{text}`"))?;
        entries.push((line, key.trim(), value.to_owned()));
    }
    // Line and words of a key; no words without the key.
    let list = |key: &str| -> (u32, Vec<String>) {
        let entry = entries.iter().find(|(_, name, _)| *name == key);
        entry.map_or((0, Vec::new()), |(line, _, value)| (*line, list_words(value)))
    };
    let (line, ends) = list("closed_loop");
    let (_, kinds) = list("type");
    // The list of closures is flat after this: two names for each.
    let (pairs, rest) = ends.as_chunks::<2>();
    if !rest.is_empty() || (!kinds.is_empty() && kinds.len() != pairs.len()) {
        return Err(format!(
            "line {line} of the file of closures: expected pairs in `closed_loop`, each with its `type`"
        ));
    }
    // Drives, and joints with their true kinds.
    let mut out = ClosureFile {
        drives: list("name_mot").1,
        ..ClosureFile::default()
    };
    let (_, names) = list("joint_name");
    let (line_of_types, types) = list("joint_type");
    if names.len() != types.len() {
        return Err(format!(
            "line {line_of_types} of the file of closures: expected a `joint_type` for each `joint_name`"
        ));
    }
    for (name, kind) in names.into_iter().zip(types) {
        let becomes = match kind.to_uppercase().as_str() {
            "SPHERICAL" => JointReplacement::Ball,
            "FIXED" => JointReplacement::Fixed,
            "UJOINT_XY" => JointReplacement::Cross(['x', 'y']),
            "UJOINT_YZ" => JointReplacement::Cross(['y', 'z']),
            "UJOINT_ZX" => JointReplacement::Cross(['z', 'x']),
            _ => {
                return Err(format!(
                    "line {line_of_types} of the file of closures: expected SPHERICAL, FIXED, UJOINT_XY, UJOINT_YZ or UJOINT_ZX \
                     in `joint_type`, found `{kind}` for `{name}`"
                ));
            }
        };
        out.joints.push((name, becomes));
    }
    // Other keys get a remark.
    for (line, key, _) in &entries {
        if !KNOWN_KEYS.contains(key) {
            out.remarks
                .push(format!("line {line} of the file of closures: `{key}` is not read"));
        }
    }
    // Closures of three conditions (origins) or six (complete frames).
    for (k, ends) in pairs.iter().enumerate() {
        let is_full = match kinds.get(k).map(|kind| kind.to_lowercase()).as_deref() {
            None | Some("6d") => true,
            Some("3d") => false,
            Some(other) => {
                return Err(format!(
                    "line {line} of the file of closures: expected the type 3d or 6d, found {other}"
                ));
            }
        };
        out.pairs.push(CoincidentFrames {
            ends: ends.clone(),
            is_full,
            line,
        });
    }
    Ok(out)
}

/// All words of a list, with nested lists flattened and quotes removed.
fn list_words(text: &str) -> Vec<String> {
    text.split([',', '[', ']', '\n'])
        .map(|word| {
            let word = word.trim().trim_start_matches("- ").trim_start_matches("- ");
            word.trim().trim_matches(['\'', '"']).to_owned()
        })
        .filter(|word| !word.is_empty() && word != "-")
        .collect()
}
