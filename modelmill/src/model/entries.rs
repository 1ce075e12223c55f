//! The entries of a model as pairs of a name and a text, so that two models can be compared. Each function describes
//! one group of tables of the model file.

use modelmill_spec::{
    CoordinateIdx, DriveKind, EffectPlace, ExactAngle, ExactExpression, ExactLength, FrameAxis, FrameConvention,
    FrameStep, Mechanism, ModelEffect, ModelSymbol, PartInertia, PlaceQuantity, TwistAxes,
};

/// Collects entries: pairs of a name and a text, in the order of the file.
#[derive(Default)]
struct ModelEntries(Vec<(String, String)>);

impl ModelEntries {
    /// Adds an entry. Entries of the same name get a number, by their order in the file.
    fn add(&mut self, kind: &str, name: &str, text: String) {
        let mut key = format!("{kind} {name}").trim().to_owned();
        let mut twin = 1;
        while self.0.iter().any(|(other, _)| *other == key) {
            twin += 1;
            key = format!("{kind} {name} ({twin})");
        }
        self.0.push((key, text));
    }
}

/// All entries in the order of the file, each named by its table and its own name.
pub(crate) fn entries(m: &Mechanism) -> Vec<(String, String)> {
    let mut entries = ModelEntries::default();
    quantities(m, &mut entries);
    geometry(m, &mut entries);
    bodies(m, &mut entries);
    actuation(m, &mut entries);
    entries.0
}

/// Gravity, constants, parameters and coordinates.
fn quantities(m: &Mechanism, entries: &mut ModelEntries) {
    // Values carry their units, so that a changed unit is a change.
    entries.add("gravity", "", triple(m, &m.gravity));
    for c in &m.constants {
        entries.add("constant", &c.name, format!("{} {}", c.value, c.unit));
    }
    for p in &m.parameters {
        entries.add("parameter", &p.name, format!("{} {}", p.nominal, p.unit));
    }
    for c in &m.coordinates {
        let motion = c.motion.name();
        let passive = if c.passive { ", passive" } else { "" };
        let what = format!("{motion}{passive}, nominal {}", c.nominal);
        entries.add("coordinate", &c.name, what);
    }
}

/// Frames and points.
fn geometry(m: &Mechanism, entries: &mut ModelEntries) {
    for f in &m.frames {
        // The base frame is part of every model.
        if f.convention == FrameConvention::Base {
            continue;
        }
        let steps: Vec<String> = f.steps.iter().map(|s| step(m, s)).collect();
        let steps = if steps.is_empty() {
            "no displacement".to_owned()
        } else {
            steps.join(" ")
        };
        let what = format!("on {}, {steps}", m.frames[f.parent.0].name);
        entries.add("frame", &f.name, what);
    }
    // Points are given in the axes of their frame.
    for p in &m.points {
        let what = format!("on {} at {}", m.frames[p.frame.0].name, triple(m, &p.at));
        entries.add("point", &p.name, what);
    }
}

/// Parts and lumped masses.
fn bodies(m: &Mechanism, entries: &mut ModelEntries) {
    // Both ways of giving an inertia are described as they are written.
    for p in &m.parts {
        let inertial = match &p.inertial {
            PartInertia::AboutCentre { mass, centre, inertia } => format!(
                "mass {}, centre {}, inertia about it {}",
                text(m, mass),
                triple(m, centre),
                tensor(m, inertia)
            ),
            PartInertia::Linear {
                mass,
                first_moment,
                inertia,
            } => format!(
                "mass {}, first moment {}, inertia about the origin {}",
                text(m, mass),
                triple(m, first_moment),
                tensor(m, inertia)
            ),
        };
        let what = format!("on {}, {inertial}", m.frames[p.frame.0].name);
        entries.add("part", &p.name, what);
    }
    // A lumped mass may act at different places in the two balances.
    for l in &m.lumped_masses {
        let places = if l.force_at == l.moment_at {
            format!("at {}", triple(m, &l.force_at))
        } else {
            format!(
                "at {} for the balance of forces and at {} for the balance of moments",
                triple(m, &l.force_at),
                triple(m, &l.moment_at)
            )
        };
        let frame = &m.frames[l.frame.0].name;
        let what = format!("{} of {} on {frame}, {places}", l.share, text(m, &l.mass));
        entries.add("lumped mass on", frame, what);
    }
}

/// Loops, couplings, drives, effects, retained products and columns of recordings.
fn actuation(m: &Mechanism, entries: &mut ModelEntries) {
    // Loops and couplings determine passive coordinates.
    for l in &m.loops {
        let [a, b] = l.joins.map(|p| m.points[p.0].name.clone());
        entries.add("loop", &l.name, format!("joins {a} and {b}"));
    }
    for c in &m.couplings {
        let terms = c.terms.iter();
        let terms = terms.map(|(i, factor)| format!("({})*{}", text(m, factor), m.coordinates[i.0].name));
        let offset = (!c.offset.is_zero()).then(|| text(m, &c.offset));
        let function = c.function.iter().map(|function| text(m, &function.value));
        let all: Vec<String> = terms.chain(offset).chain(function).collect();
        let name = &m.coordinates[c.coordinate.0].name;
        entries.add("coupling of", name, format!("follows {}", all.join(" + ")));
    }
    // A drive acts on a joint or between two points.
    for d in &m.drives {
        let how = match d.kind {
            DriveKind::Joint(i) => format!("on the joint {}", m.coordinates[i.0].name),
            DriveKind::Linear { from, to } => {
                format!("linear, from {} to {}", m.points[from.0].name, m.points[to.0].name)
            }
        };
        entries.add("drive", &d.name, how);
    }
    // The places belong to the name of an effect, since a kind may occur several times.
    for e in &m.effects {
        let name = format!("{} at {}", e.kind, places(m, e));
        entries.add("effect", &name, terms(m, e));
    }
    // The order of `retain` matters, so that the list is one entry.
    let retained: Vec<String> = m.retain.iter().map(|powers| product(m, powers)).collect();
    if !retained.is_empty() {
        entries.add("retain", "", retained.join(", "));
    }
    // Columns of recordings are compared as they are written.
    for (ours, theirs) in &m.recording.columns {
        entries.add("column", ours, theirs.clone());
    }
}

/// A vector as `(x, y, z)`.
fn triple(m: &Mechanism, vector: &[ExactExpression; 3]) -> String {
    let entries: Vec<String> = vector.iter().map(|e| text(m, e)).collect();
    format!("({})", entries.join(", "))
}

/// An exact expression in the names of the model.
fn text(m: &Mechanism, exact: &ExactExpression) -> String {
    exact.to_text(&|symbol| m.symbol_name(symbol).to_owned())
}

/// A product of powers of parameters, such as `m1*dc1^2`.
fn product(m: &Mechanism, powers: &[(modelmill_spec::ParameterIdx, u32)]) -> String {
    let factors: Vec<String> = powers
        .iter()
        .map(|(p, n)| match n {
            // A power of one is not written.
            1 => m.parameters[p.0].name.clone(),
            n => format!("{}^{n}", m.parameters[p.0].name),
        })
        .collect();
    factors.join("*")
}

/// The entries of an inertia that are not zero, such as `xx I1, zz I3`.
fn tensor(m: &Mechanism, inertia: &[ExactExpression; 6]) -> String {
    // Zero entries are omitted, as in the model file.
    let entries: Vec<String> = ["xx", "xy", "xz", "yy", "yz", "zz"]
        .iter()
        .zip(inertia)
        .filter(|(_, value)| !value.is_zero())
        .map(|(name, value)| format!("{name} {}", text(m, value)))
        .collect();
    if entries.is_empty() {
        "zero".to_owned()
    } else {
        entries.join(", ")
    }
}

/// One step of a frame: a rotation, a translation, or a free body.
fn step(m: &Mechanism, step: &FrameStep) -> String {
    // Rotations and translations are written as `Rz(q1)` and `Tx(L)`.
    let letter = |axis: &FrameAxis| match axis {
        FrameAxis::X => "x",
        FrameAxis::Y => "y",
        FrameAxis::Z => "z",
    };
    match step {
        FrameStep::Rotate(axis, angle) => format!("R{}({})", letter(axis), angle_text(m, angle)),
        FrameStep::Translate(axis, length) => {
            format!("T{}({})", letter(axis), length_text(m, length))
        }
        // A free body is described by its coordinates and the axes of its twist.
        FrameStep::Free(body) => {
            let names = |all: &[CoordinateIdx]| {
                let names = all.iter().map(|i| m.coordinates[i.0].name.as_str());
                names.collect::<Vec<_>>().join(", ")
            };
            let axes = |axes| match axes {
                TwistAxes::Body => "body",
                TwistAxes::World => "world",
            };
            format!(
                "free({}; w, x, y, z = {}; force in {} axes, moment in {} axes)",
                names(&body.position),
                names(&body.quaternion),
                axes(body.linear),
                axes(body.angular)
            )
        }
    }
}

/// An angle: a linear combination of symbols and of pi.
fn angle_text(m: &Mechanism, angle: &ExactAngle) -> String {
    let mut terms: Vec<String> = angle
        .terms
        .iter()
        .map(|(symbol, factor)| times(&factor.to_string(), m.symbol_name(*symbol)))
        .collect();
    // Multiples of pi are exact.
    let pi = angle.pi.to_string();
    if pi != "0" {
        terms.push(times(&pi, "pi"));
    }
    join(&terms)
}

/// A length: a linear combination of coordinates, and an offset.
fn length_text(m: &Mechanism, length: &ExactLength) -> String {
    let mut terms: Vec<String> = length
        .coordinates
        .iter()
        .map(|(i, factor)| times(&factor.to_string(), m.symbol_name(ModelSymbol::Coordinate(*i))))
        .collect();
    if !length.offset.is_zero() {
        terms.push(text(m, &length.offset));
    }
    join(&terms)
}

/// A factor times a symbol, without a factor of one.
fn times(factor: &str, what: &str) -> String {
    match factor {
        "1" => what.to_owned(),
        "-1" => format!("-{what}"),
        factor => format!("{factor}*{what}"),
    }
}

/// A sum of terms; `0` without terms.
fn join(terms: &[String]) -> String {
    if terms.is_empty() {
        return "0".to_owned();
    }
    terms.join(" + ").replace("+ -", "- ")
}

/// The names of an effect's places.
fn places(m: &Mechanism, effect: &ModelEffect) -> String {
    let names = effect.places.iter().map(|place| m.place_name(*place));
    names.collect::<Vec<_>>().join(", ")
}

/// The name of a symbol of an effect. If the effect has one place, its quantities have the names of the columns of a
/// recording.
fn symbol_name_at_place(m: &Mechanism, effect: &ModelEffect, symbol: ModelSymbol) -> String {
    // Symbols that are not those of a place have their own names.
    let (ModelSymbol::Place(quantity), [place]) = (symbol, effect.places.as_slice()) else {
        return m.symbol_name(symbol).to_owned();
    };
    // A drive on a joint is named by its coordinate, a linear drive by itself.
    let (name, position) = match place {
        EffectPlace::Coordinate(i) => (&m.coordinates[i.0].name, ""),
        EffectPlace::Drive(d) => match m.drives[d.0].kind {
            DriveKind::Joint(i) => (&m.coordinates[i.0].name, ""),
            DriveKind::Linear { .. } => (&m.drives[d.0].name, "_length"),
        },
        EffectPlace::Point(_) | EffectPlace::Part(_) | EffectPlace::Base | EffectPlace::Force => {
            return m.symbol_name(symbol).to_owned();
        }
    };
    match quantity {
        PlaceQuantity::Coordinate => format!("{name}{position}"),
        PlaceQuantity::Rate => format!("{name}_d"),
        PlaceQuantity::Acceleration => format!("{name}_dd"),
        _ => m.symbol_name(symbol).to_owned(),
    }
}

/// The force of an effect in its parameters; for effects with mechanics of their own, the names of their
/// parameters and the values of their constants.
fn terms(m: &Mechanism, effect: &ModelEffect) -> String {
    // Effects that change the mechanics have no expression.
    if effect.mechanics.is_some() {
        let names = effect.terms.iter().map(|term| {
            let parameter = &m.parameters[term.parameter.0];
            format!("{} {}", term.symbol, parameter.name)
        });
        let constants = effect.constants.iter();
        let values = constants.map(|(symbol, value)| format!("{symbol} = {}", text(m, value)));
        return names.chain(values).collect::<Vec<_>>().join(", ");
    }
    let terms: Vec<String> = effect
        .terms
        .iter()
        .map(|term| {
            let name = &m.parameters[term.parameter.0].name;
            let expression = term
                .expression
                .to_text(&|symbol| symbol_name_at_place(m, effect, symbol));
            // Expressions with blanks or quotients need brackets behind a parameter.
            match expression.as_str() {
                "1" => name.clone(),
                expression if expression.contains([' ', '/']) => format!("{name}*({expression})"),
                expression => format!("{name}*{expression}"),
            }
        })
        .collect();
    join(&terms)
}
