//! Closures beside a URDF: the `robot.yaml` of the collection example-parallel-robots.
//!
//! Of YAML it is keys at the start of lines with lists behind them, in brackets or behind dashes, which is what these files
//! hold; other keys are told.

/// What the file says.
#[derive(Debug, Default)]
pub(crate) struct ClosureFile {
    pub(crate) pairs: Vec<CoincidentFrames>,
    /// Joints that are driven; all where there are none.
    pub(crate) drives: Vec<String>,
    /// Joints with what they are, whatever the URDF has in their place: it knows neither balls nor crosses.
    pub(crate) joints: Vec<(String, JointReplacement)>,
    /// What is not read; one sentence each.
    pub(crate) remarks: Vec<String>,
}

/// What a joint of the URDF is in truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum JointReplacement {
    Ball,
    Fixed,
    /// Two hinges, about axes of its frame one after the other.
    Cross([char; 2]),
}

/// Two frames that coincide.
#[derive(Debug)]
pub(crate) struct CoincidentFrames {
    pub(crate) ends: [String; 2],
    /// In orientation too.
    pub(crate) is_full: bool,
    pub(crate) line: u32,
}

/// Keys that are read.
const KNOWN_KEYS: [&str; 5] = [
    "closed_loop",
    "type",
    "name_mot",
    "joint_name",
    "joint_type",
];

/// Reads the file, or says what is wrong.
pub(crate) fn read(text: &str) -> Result<ClosureFile, String> {
    let mut entries: Vec<(u32, &str, String)> = Vec::new();
    for (line, text) in (1..).zip(text.lines()) {
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
        let (key, value) = text.split_once(':').ok_or_else(|| {
            format!("line {line} of the file of closures: expected `key: value`, found `{text}`")
        })?;
        entries.push((line, key.trim(), value.to_owned()));
    }
    let list = |key: &str| -> (u32, Vec<String>) {
        let entry = entries.iter().find(|(_, name, _)| *name == key);
        entry.map_or((0, Vec::new()), |(line, _, value)| {
            (*line, list_words(value))
        })
    };
    let (line, ends) = list("closed_loop");
    let (_, kinds) = list("type");
    let (pairs, rest) = ends.as_chunks::<2>();
    if !rest.is_empty() || (!kinds.is_empty() && kinds.len() != pairs.len()) {
        return Err(format!(
            "line {line} of the file of closures: expected pairs in `closed_loop`, each with its `type`"
        ));
    }
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
    for (line, key, _) in &entries {
        if !KNOWN_KEYS.contains(key) {
            out.remarks.push(format!(
                "line {line} of the file of closures: `{key}` is not read"
            ));
        }
    }
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

/// All words of a list, nested or not.
fn list_words(text: &str) -> Vec<String> {
    text.split([',', '[', ']', '\n'])
        .map(|word| {
            let word = word
                .trim()
                .trim_start_matches("- ")
                .trim_start_matches("- ");
            word.trim().trim_matches(['\'', '"']).to_owned()
        })
        .filter(|word| !word.is_empty() && word != "-")
        .collect()
}
