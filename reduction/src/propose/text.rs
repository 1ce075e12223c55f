//! The text of a proposed plan: parts, loops and lumped masses with what each assumes as comments. Symbols are shared
//! where their values are equal.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use modelmill_rig::{BodyAnchor, Rig};

use super::joints::{HingePlace, ProposedMechanism};
use super::motion::ClassifiedMotion;
use super::thresholds::{SAME_MOTION, SAME_VALUE, SAMPLES, SIMILAR_VALUE};
use crate::names::find_rig_point;
use crate::planar_draft::PlanarDraft;
use crate::report::ReductionReport;
use crate::write::significant_digits;

/// Names that the plan gives to places of the rig: the model's name, and the rig's.
struct PlaceNames<'a> {
    rig: &'a Rig,
    names: Vec<(BodyAnchor, String, String)>,
}

impl PlaceNames<'_> {
    /// The model's name of a place: that of a point of the rig, else of the joint.
    fn name(&mut self, place: &HingePlace) -> String {
        let joint = self.rig.joints[place.joint].name.clone();
        let on = place
            .anchor
            .body
            .map_or("base", |body| self.rig.bodies[body].name.as_str());
        self.name_of(&place.anchor, &joint, &format!("{joint}@{on}"))
    }

    /// The name of an anchor, made from `stem` if no point of the rig is there; `written` is how a plan refers to it.
    fn name_of(&mut self, anchor: &BodyAnchor, stem: &str, written: &str) -> String {
        if let Some(point) = self.rig.points.iter().find(|point| &point.anchor == anchor) {
            return point.name.clone();
        }
        if let Some((_, name, _)) = self.names.iter().find(|(known, ..)| known == anchor) {
            return name.clone();
        }
        let is_taken = |name: &str| {
            self.rig.points.iter().any(|point| point.name == name)
                || self.names.iter().any(|(_, known, _)| known == name)
        };
        let (mut n, mut name) = (1, stem.to_owned());
        while is_taken(&name) {
            n += 1;
            name = format!("{stem}_{n}");
        }
        self.names.push((*anchor, name.clone(), written.to_owned()));
        name
    }
}

/// Names of shared symbols: of each part's mass, centre, distance of the centre from the axis and inertia; of each lumped
/// mass; and constants with what they stand for.
#[derive(Debug, Default)]
pub(super) struct SharedSymbols {
    /// The part or lumped mass and the kind of its symbol, with the symbol.
    parameters: BTreeMap<(String, &'static str), String>,
    /// Constants: names and quantities.
    constants: Vec<(String, Vec<String>)>,
    /// Symbols that could be shared, each with the error of sharing it.
    similar: Vec<String>,
}

impl SharedSymbols {
    /// Finds equal values in a draft whose symbols are all separate.
    pub(super) fn new(rig: &Rig, draft: &PlanarDraft) -> Self {
        let mut shared = Self::default();
        let mut taken: Vec<String> = rig.coordinates.iter().map(|c| c.name.clone()).collect();
        taken.extend(rig.drives.iter().map(|drive| drive.name.clone()));
        taken.extend(draft.coordinates.iter().map(|c| c.name.clone()));
        let bodies = draft_bodies(draft);
        for (k, body) in bodies.iter().enumerate() {
            let twin = bodies[..k].iter().find(|other| other.is_alike(body));
            for (kind, prefix, value) in body.values() {
                // The twin's symbol, unless the sign of the distance from the axis differs.
                let is_shared = |twin: &&DraftBody| kind != "off_axis" || is_equal(twin.off_axis, value);
                let known = twin
                    .filter(is_shared)
                    .and_then(|twin| shared.symbol(&twin.name, kind).cloned());
                let symbol = known.unwrap_or_else(|| free_name(prefix, &mut taken));
                shared.parameters.insert((body.name.clone(), kind), symbol);
            }
        }
        for (kind, unit) in [("mass", "kg"), ("centre", "m"), ("inertia", "kg m^2")] {
            let values: Vec<(String, f64)> = bodies
                .iter()
                .flat_map(|body| body.values().into_iter().map(|value| (body.name.clone(), value)))
                .filter(|(_, (known, ..))| *known == kind)
                .map(|(name, (.., value))| (name, value))
                .collect();
            shared.similar.extend(similar_values(kind, &values, unit));
        }
        // Lengths: only those that stand for several quantities get a new name.
        let lengths: Vec<(String, f64)> = draft
            .constants
            .0
            .iter()
            .filter(|symbol| symbol.unit == "m")
            .flat_map(|symbol| symbol.stands_for.iter().cloned())
            .collect();
        for (names, _) in equal_values(&lengths).into_iter().filter(|(names, _)| names.len() > 1) {
            shared.constants.push((free_name("l", &mut taken), names));
        }
        shared.similar.extend(similar_values("length", &lengths, "m"));
        shared
    }

    /// The symbol of a part or lumped mass.
    fn symbol(&self, of: &str, kind: &'static str) -> Option<&String> {
        self.parameters.get(&(of.to_owned(), kind))
    }

    /// Sets of parts and masses that share symbols, for a message.
    pub(super) fn ties(&self) -> Vec<String> {
        let mut by_symbol: BTreeMap<&String, Vec<&str>> = BTreeMap::new();
        for ((of, _), symbol) in &self.parameters {
            by_symbol.entry(symbol).or_default().push(of);
        }
        let shared = by_symbol.into_iter().filter(|(_, of)| of.len() > 1);
        shared
            .map(|(symbol, of)| format!("{symbol} ({})", of.join(", ")))
            .collect()
    }
}

/// Values of a part or lumped mass of a draft.
struct DraftBody {
    name: String,
    mass: f64,
    /// Absent for a lumped mass.
    inertia: Option<f64>,
    centre: f64,
    off_axis: f64,
}

impl DraftBody {
    /// Whether two parts have equal values, or are mirror images of each other; or two lumped masses are equal. Single
    /// values can agree by chance, so that all of them must.
    fn is_alike(&self, other: &Self) -> bool {
        let inertias = match (self.inertia, other.inertia) {
            (Some(one), Some(two)) => is_equal(one, two),
            (None, None) => true,
            _ => false,
        };
        inertias
            && self.mass != 0.0
            && is_equal(self.mass, other.mass)
            && is_equal(self.centre, other.centre)
            && is_equal(self.off_axis.abs(), other.off_axis.abs())
    }

    /// Kinds of its symbols with their prefixes and values.
    fn values(&self) -> Vec<(&'static str, &'static str, f64)> {
        let mut values = vec![("mass", "m", self.mass)];
        if let Some(inertia) = self.inertia {
            values.extend([
                ("centre", "c", self.centre),
                ("off_axis", "e", self.off_axis),
                ("inertia", "I", inertia),
            ]);
        }
        // What is zero has no symbol.
        values.retain(|(kind, _, value)| !matches!(*kind, "centre" | "off_axis") || *value != 0.0);
        values
    }
}

/// The parts and lumped masses of a draft whose symbols are all separate.
fn draft_bodies(draft: &PlanarDraft) -> Vec<DraftBody> {
    let centre = |symbol: &String| match symbol.as_str() {
        "0" => 0.0,
        name => draft.centres.value(name),
    };
    let mut bodies: Vec<DraftBody> = draft
        .parts
        .iter()
        .map(|part| DraftBody {
            name: part.on.clone(),
            mass: draft.masses.value(&part.mass),
            inertia: Some(draft.inertias.value(&part.inertia)),
            centre: centre(&part.centre[0]),
            off_axis: centre(&part.centre[1]),
        })
        .collect();
    let masses = draft.masses.0.iter().flat_map(|symbol| &symbol.stands_for);
    for (name, mass) in masses {
        if bodies.iter().all(|body| &body.name != name) {
            bodies.push(DraftBody {
                name: name.clone(),
                mass: *mass,
                inertia: None,
                centre: 0.0,
                off_axis: 0.0,
            });
        }
    }
    bodies
}

/// Whether two values are equal up to the digits of a CAD program.
fn is_equal(one: f64, two: f64) -> bool {
    (one - two).abs() <= SAME_VALUE * one.abs().max(two.abs())
}

/// A name with the first free number.
fn free_name(prefix: &str, taken: &mut Vec<String>) -> String {
    let (mut n, mut name) = (1, format!("{prefix}1"));
    while taken.contains(&name) {
        n += 1;
        name = format!("{prefix}{n}");
    }
    taken.push(name.clone());
    name
}

/// Values in sets of equal ones, each with its first value, in the order in which they occur.
fn equal_values(values: &[(String, f64)]) -> Vec<(Vec<String>, f64)> {
    let mut sets: Vec<(Vec<String>, f64)> = Vec::new();
    for (name, value) in values {
        match sets
            .iter_mut()
            .find(|(_, known)| (known - value).abs() <= SAME_VALUE * known.abs())
        {
            Some((names, _)) => names.push(name.clone()),
            None => sets.push((vec![name.clone()], *value)),
        }
    }
    sets
}

/// Sets of values that are similar, each pair with what sharing a symbol would hide.
fn similar_values(kind: &str, values: &[(String, f64)], unit: &str) -> Vec<String> {
    let sets = equal_values(values);
    let mut found = Vec::new();
    for (i, (names, value)) in sets.iter().enumerate() {
        for (others, other) in &sets[i + 1..] {
            let difference = (value - other).abs();
            if difference <= SIMILAR_VALUE * value.abs().max(other.abs()) {
                found.push(format!(
                    "{kind} of {} and {}: the difference is {} {unit} ({} %)",
                    names.join(", "),
                    others.join(", "),
                    significant_digits(difference, 3),
                    significant_digits(100.0 * difference / value.abs().max(other.abs()), 2)
                ));
            }
        }
    }
    found
}

/// The text of a plan. `shared` are symbols for equal values, and `report` the sizes of the assumptions, once known.
pub(super) fn plan_text(
    rig: &Rig,
    motion: &ClassifiedMotion,
    mechanism: &ProposedMechanism,
    known: Option<(&SharedSymbols, &ReductionReport)>,
) -> String {
    let mut places = PlaceNames { rig, names: Vec::new() };
    let body_name = |body: usize| rig.bodies[body].name.clone();
    let mut tables = String::new();
    for part in &mechanism.parts {
        let name = body_name(part.lead);
        let members = &motion.families[part.family];
        let mut groups = vec![format!("\"{name}\"")];
        groups.extend(
            members
                .iter()
                .filter(|b| **b != part.lead)
                .map(|b| format!("\"{}\"", rig.bodies[*b].name)),
        );
        let at = places.name(&part.joint[0]);
        let from = places.name(&part.joint[1]);
        let to = axis_end(rig, motion, mechanism, part.lead, &part.joint[1].anchor, &mut places);
        let on = part
            .carrier
            .map_or_else(|| "base".to_owned(), |k| body_name(mechanism.parts[k].lead));
        let coordinate = match part.coordinate {
            Some(k) => rig.coordinates[k].name.clone(),
            None => passive_name(rig, &name),
        };
        tables.push('\n');
        write_remarks(&mut tables, known, &name);
        let _ = writeln!(
            tables,
            "[[part]]\nname = \"{name}\"\ngroups = [{}]\non = \"{on}\"\nat = \"{at}\"\nfrom = \"{from}\"\nto = \
             \"{to}\"\ncoordinate = \"{coordinate}\"",
            groups.join(", ")
        );
        if let Some((shared, _)) = known {
            let kinds = ["mass", "centre", "off_axis", "inertia"];
            let symbols: Vec<String> = kinds
                .into_iter()
                .filter_map(|kind| {
                    shared
                        .symbol(&name, kind)
                        .map(|symbol| format!("{kind} = \"{symbol}\""))
                })
                .collect();
            let _ = writeln!(tables, "symbols = {{ {} }}", symbols.join(", "));
        }
    }
    for mass in &mechanism.lumped_masses {
        let names: Vec<String> = mass.bodies.iter().map(|body| body_name(*body)).collect();
        let at: Vec<String> = mass
            .at
            .iter()
            .map(|place| format!("\"{}\"", places.name(place)))
            .collect();
        tables.push('\n');
        write_remarks(&mut tables, known, &names[0]);
        let _ = writeln!(
            tables,
            "[[lumped_mass]]\nname = \"{}\"\ngroups = [\"{}\"]\nat = [{}]",
            names[0],
            names.join("\", \""),
            at.join(", ")
        );
        if let Some(symbol) = known.and_then(|(shared, _)| shared.symbol(&names[0], "mass")) {
            let _ = writeln!(tables, "symbol = \"{symbol}\"");
        }
    }
    for pair in &mechanism.loops {
        let joins: Vec<String> = pair.iter().map(|place| places.name(place)).collect();
        let name = &rig.joints[pair[1].joint].name;
        let _ = writeln!(
            tables,
            "\n[[loop]]\nname = \"{name}\"\njoins = [\"{}\", \"{}\"]",
            joins[0], joins[1]
        );
    }
    let mut text = heading(rig, motion, mechanism);
    text.push_str(&tables);
    if !places.names.is_empty() {
        text.push_str("\n# Places of joints: the model's name, and JOINT@BODY.\n[points]\n");
        for (_, name, written) in &places.names {
            let _ = writeln!(text, "{name} = \"{written}\"");
        }
    }
    if let Some((shared, _)) = known {
        write_shared(&mut text, shared);
    }
    text
}

/// The tables before those of the parts.
fn heading(rig: &Rig, motion: &ClassifiedMotion, mechanism: &ProposedMechanism) -> String {
    let plane = &motion.plane;
    let triple = |v: &nalgebra::Vector3<f64>| format!("[{:?}, {:?}, {:?}]", v.x + 0.0, v.y + 0.0, v.z + 0.0);
    let mut text = format!(
        "# Proposed by modelmill from the motion of the rig {}. Edit names, groups and symbols;\n# `modelmill reduce` measures \
         the error of each statement.\nschema = 1\nname = \"{}_reduced\"\n",
        rig.name,
        word_of(&rig.name)
    );
    if !mechanism.left_out.is_empty() {
        let names: Vec<&str> = mechanism
            .left_out
            .iter()
            .map(|body| rig.bodies[*body].name.as_str())
            .collect();
        let _ = writeln!(
            text,
            "# These bodies do not move, or no revolute joint connects them to a part.\nleave_out = [\"{}\"]",
            names.join("\", \"")
        );
    }
    let _ = writeln!(
        text,
        "\n[plane]\nat = {}\nnormal = {}\nx = {}\n\n[samples]\nnumber = {SAMPLES}\nrange = {:?}",
        triple(&plane.at),
        triple(&plane.normal),
        triple(&plane.x),
        motion.range
    );
    text
}

/// Constants that stand for equal lengths, and symbols that could be shared.
fn write_shared(text: &mut String, shared: &SharedSymbols) {
    if !shared.constants.is_empty() {
        text.push_str("\n# Equal lengths. Other lengths get names of their own.\n[constants]\n");
        for (name, of) in &shared.constants {
            let _ = writeln!(text, "{name} = {{ is = [\"{}\"] }}", of.join("\", \""));
        }
    }
    if !shared.similar.is_empty() {
        text.push_str("\n# Similar values. If they share a symbol, the model has fewer parameters, and this error:\n");
        for says in &shared.similar {
            let _ = writeln!(text, "# {says}");
        }
    }
}

/// What a part or lumped mass assumes, as comments.
fn write_remarks(text: &mut String, known: Option<(&SharedSymbols, &ReductionReport)>, about: &str) {
    let Some((_, report)) = known else { return };
    for finding in report.findings.iter().filter(|f| f.step == 2 && f.about == about) {
        let sizes: Vec<String> = finding
            .sizes
            .iter()
            .filter(|size| size.is_significant())
            .map(ToString::to_string)
            .collect();
        // The sum of eq. (1) assumes nothing.
        if finding.says.starts_with("= ") {
            continue;
        }
        let error = if sizes.is_empty() || finding.says.ends_with("change no force") {
            "exact".to_owned()
        } else {
            sizes.join(", ")
        };
        let _ = writeln!(text, "# {}: {error}", finding.says);
    }
}

/// The end of a part's longitudinal axis: the farthest place where it meets another part or carries a mass, else where a
/// drive acts, else any point, else its centre of mass.
fn axis_end(
    rig: &Rig,
    motion: &ClassifiedMotion,
    mechanism: &ProposedMechanism,
    lead: usize,
    from: &BodyAnchor,
    places: &mut PlaceNames<'_>,
) -> String {
    let is_here = |anchor: &BodyAnchor| anchor.body == Some(lead);
    let distance = |anchor: &BodyAnchor| (motion.place(anchor) - motion.place(from)).norm();
    let joints = mechanism.parts.iter().map(|part| part.joint[0]);
    let masses = mechanism.lumped_masses.iter().flat_map(|mass| mass.at.iter().copied());
    let loops = mechanism.loops.iter().flatten().copied();
    let farthest = joints
        .chain(masses)
        .chain(loops)
        .filter(|place| is_here(&place.anchor) && distance(&place.anchor) > SAME_MOTION)
        .max_by(|a, b| distance(&a.anchor).total_cmp(&distance(&b.anchor)));
    if let Some(place) = farthest {
        return places.name(&place);
    }
    let ends = (0..rig.drives.len())
        .filter_map(|drive| rig.ends_of_drive(drive))
        .flatten();
    let points = rig.points.iter().map(|point| point.anchor);
    let other = ends
        .chain(points)
        .find(|anchor| is_here(anchor) && distance(anchor) > SAME_MOTION);
    let name = rig.bodies[lead].name.clone();
    let written = format!("centre@{name}");
    let anchor = other.or_else(|| find_rig_point(rig, &written));
    anchor.map_or_else(String::new, |anchor| {
        places.name_of(&anchor, &format!("{name}_centre"), &written)
    })
}

/// The name of a passive coordinate that no coordinate of the rig has.
fn passive_name(rig: &Rig, part: &str) -> String {
    let name = format!("q_{part}");
    if rig.coordinates.iter().any(|c| c.name == name) {
        format!("{name}_passive")
    } else {
        name
    }
}

/// A name as a word.
fn word_of(name: &str) -> String {
    name.chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '_' })
        .collect()
}
