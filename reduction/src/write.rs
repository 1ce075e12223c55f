//! Writes the draft of a planar model as the text of a model file, and formats numbers and texts for TOML.

use std::fmt::Write as _;

use crate::planar_draft::{DraftSymbol, DraftSymbols, PlanarDraft};

/// The text of a model file.
pub(crate) fn model_file(draft: &PlanarDraft) -> String {
    // The head of the file.
    let mut text = format!("# {}\n", draft.origin);
    let _ = writeln!(text, "schema = 1\nname = \"{}\"", draft.name);
    if !draft.title.is_empty() {
        let _ = writeln!(text, "title = {}", toml_string(&draft.title));
    }
    // Zero gravity is not written.
    if draft.gravity.iter().any(|g| g != "0") {
        let _ = writeln!(
            text,
            "gravity = [{}, {}, 0]",
            vector_value(&draft.gravity[0]),
            vector_value(&draft.gravity[1])
        );
    }
    // Constants in their order, parameters sorted by class and name.
    symbol_table(
        &mut text,
        "constants",
        "value",
        &draft.constants.0.iter().collect::<Vec<_>>(),
    );
    let mut parameters = Vec::new();
    for class in [&draft.masses, &draft.centres, &draft.inertias] {
        parameters.extend(sorted_by_name(class));
    }
    symbol_table(&mut text, "parameters", "nominal", &parameters);
    // Coordinates, then the tables that refer to them.
    text.push_str("\n[coordinates]\n");
    for coordinate in &draft.coordinates {
        let passive = if coordinate.passive { ", passive = true" } else { "" };
        let _ = writeln!(
            text,
            "{} = {{ nominal = {}{passive} }}",
            coordinate.name,
            toml_float(coordinate.nominal)
        );
    }
    frames_and_points(&mut text, draft);
    masses(&mut text, draft);
    loops_and_drives(&mut text, draft);
    text
}

/// Tables `[[frame]]` and `[[point]]`. A frame with an offset along x only is written with modified DH parameters.
fn frames_and_points(text: &mut String, draft: &PlanarDraft) {
    for frame in &draft.frames {
        let _ = writeln!(text, "\n[[frame]]\nname = \"{}\"\non = \"{}\"", frame.name, frame.on);
        // The z axis of every frame is the normal of the plane.
        let [x, y] = &frame.at;
        let _ = match (x.as_str(), y.as_str()) {
            ("0", "0") => writeln!(text, "modified_dh = {{ theta = \"{}\" }}", frame.angle),
            (x, "0") => writeln!(
                text,
                "modified_dh = {{ a = {}, theta = \"{}\" }}",
                vector_value(x),
                frame.angle
            ),
            (x, y) => writeln!(
                text,
                "transform = {{ xyz = [{}, {}, 0] }}\njoint = {{ revolute = \"{}\" }}",
                vector_value(x),
                vector_value(y),
                frame.angle
            ),
        };
        if !frame.note.is_empty() {
            let _ = writeln!(text, "note = {}", toml_string(&frame.note));
        }
    }
    for point in &draft.points {
        let _ = writeln!(
            text,
            "\n[[point]]\nname = \"{}\"\non = \"{}\"\nat = [{}, {}]",
            point.name,
            point.on,
            vector_value(&point.at[0]),
            vector_value(&point.at[1])
        );
    }
}

/// Tables `[[part]]` and `[[lumped_mass]]`.
fn masses(text: &mut String, draft: &PlanarDraft) {
    // The inertia about the centre of mass; other moments have no effect on planar motion.
    for part in &draft.parts {
        let _ = writeln!(
            text,
            "\n[[part]]\nname = \"{}\"\non = \"{}\"\nmass = \"{}\"\ncentre = [{}, {}]\ninertia = {{ zz = \"{}\" }}",
            part.name,
            part.on,
            part.mass,
            vector_value(&part.centre[0]),
            vector_value(&part.centre[1]),
            part.inertia
        );
    }
    for (name, mass, shares, at) in &draft.lumped_masses {
        let _ = writeln!(text, "\n[[lumped_mass]]\nname = \"{name}\"\nmass = \"{mass}\"");
        // A mass at one point is complete and needs no share.
        if *shares > 1 {
            let _ = writeln!(text, "share = \"1/{shares}\"");
        }
        let _ = writeln!(text, "at = \"{at}\"");
    }
}

/// Tables `[[loop]]`, `[[drive]]` and `[[effect]]`.
fn loops_and_drives(text: &mut String, draft: &PlanarDraft) {
    for (name, [one, two]) in &draft.loops {
        let _ = writeln!(text, "\n[[loop]]\nname = \"{name}\"\njoins = [\"{one}\", \"{two}\"]");
    }
    // A drive moves a coordinate, or acts between two points.
    for (name, moves) in &draft.drives {
        let _ = writeln!(text, "\n[[drive]]\nname = \"{name}\"");
        let _ = match moves {
            Ok(coordinate) => writeln!(text, "joint = \"{coordinate}\""),
            Err([from, to]) => writeln!(text, "linear = {{ from = \"{from}\", to = \"{to}\" }}"),
        };
    }
    for effect in &draft.effects {
        let places: Vec<String> = effect.at.iter().map(|at| format!("\"{at}\"")).collect();
        let _ = writeln!(
            text,
            "\n[[effect]]\nkind = \"{}\"\nat = [{}]",
            effect.kind,
            places.join(", ")
        );
        // Entries of an inline table.
        let list = |values: &[(String, f64)], wrap: fn(&str) -> String| {
            let entries: Vec<String> = values
                .iter()
                .map(|(k, v)| format!("{k} = {}", wrap(&toml_float(*v))))
                .collect();
            entries.join(", ")
        };
        let nominal = |number: &str| format!("{{ nominal = {number} }}");
        let _ = writeln!(text, "parameters = {{ {} }}", list(&effect.parameters, nominal));
        if !effect.constants.is_empty() {
            let _ = writeln!(text, "constants = {{ {} }}", list(&effect.constants, str::to_owned));
        }
    }
}

/// A table of symbols with values, units and notes; `key` is the name of the value. Nothing without symbols.
fn symbol_table(text: &mut String, name: &str, key: &str, symbols: &[&DraftSymbol]) {
    if symbols.is_empty() {
        return;
    }
    let _ = writeln!(text, "\n[{name}]");
    for symbol in symbols {
        let note = if symbol.note.is_empty() {
            String::new()
        } else {
            format!(", note = {}", toml_string(&symbol.note))
        };
        let _ = writeln!(
            text,
            "{} = {{ {key} = {}, unit = \"{}\"{note} }}",
            symbol.name,
            toml_float(symbol.value()),
            symbol.unit
        );
    }
}

/// Symbols sorted by name, with numbers in names sorted by size: m2 before m10.
fn sorted_by_name(symbols: &DraftSymbols) -> Vec<&DraftSymbol> {
    let mut sorted: Vec<&DraftSymbol> = symbols.0.iter().collect();
    sorted.sort_by_cached_key(|symbol| {
        let mut key = String::new();
        let mut digits = String::new();
        // Numbers are padded with zeros, so that they are sorted by size; the last character completes a number at the
        // end.
        for c in symbol.name.chars().chain(['\0']) {
            if c.is_ascii_digit() {
                digits.push(c);
                continue;
            }
            if !digits.is_empty() {
                let _ = write!(key, "{digits:0>20}");
                digits.clear();
            }
            key.push(c);
        }
        key
    });
    sorted
}

/// A component of a vector in TOML: a zero without quotes, or an expression in quotes.
fn vector_value(expression: &str) -> String {
    if expression == "0" {
        "0".to_owned()
    } else {
        format!("\"{expression}\"")
    }
}

/// A number in the notation of a TOML float.
pub(crate) fn toml_float(x: f64) -> String {
    format!("{x:?}")
}

/// A number with `n` significant digits, in decimal or exponential notation.
pub(crate) fn significant_digits(x: f64, n: usize) -> String {
    if x == 0.0 || !x.is_finite() {
        return format!("{x}");
    }
    // Round in exponential notation, then print the shortest decimal or exponential number.
    let rounded: f64 = format!("{x:.*e}", n.saturating_sub(1)).parse().unwrap_or(x);
    if (1e-3..1e6).contains(&rounded.abs()) {
        format!("{rounded}")
    } else {
        format!("{rounded:e}")
    }
}

/// A text as a TOML string, with escapes.
pub(crate) fn toml_string(text: &str) -> String {
    toml::Value::from(text).to_string()
}
