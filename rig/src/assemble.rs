//! From the entries of rig files to a rig: variants are merged, names looked up, numbers checked.
//! All findings are collected.

use modelmill_spec::{Diagnostic, Span};
use nalgebra::{Matrix3, Vector3};

use crate::effect::{Effect, Law, Place};
use crate::file::{
    BodyEntry, CoordinateEntry, DriveEntry, EffectEntry, JointEntry, LengthEntry, LumpedMassEntry,
    Name, PointEntry, RigEntry, SensorEntry, Triple,
};
use crate::joint;
use crate::load::{fault, span};
use crate::pair::{Anchor, Pair, Shape};
use crate::pose::Pose;
use crate::rig::{Body, Coordinate, Drive, Joint, LumpedMass, Point, Rig};
use crate::sensor::{Channel, Sensors};

/// An entry with the file that it stands in.
struct Item<T> {
    file: usize,
    entry: T,
}

/// Collects findings.
#[derive(Default)]
struct Log(Vec<Diagnostic>);

impl Log {
    fn error(&mut self, span: Span, message: String, label: &str, help: &str) {
        let texts = |text: &str| Some(text.to_owned()).filter(|text| !text.is_empty());
        self.0.push(Diagnostic {
            label: label.to_owned(),
            help: texts(help).into_iter().collect(),
            ..fault(Some(span), message)
        });
    }

    fn unknown(&mut self, file: usize, name: &Name, what: &str, known: &[&str]) {
        let mut list: Vec<String> = known.iter().take(24).map(|k| format!("`{k}`")).collect();
        if known.len() > 24 {
            list.push("...".to_owned());
        }
        self.error(
            span(file, &name.span()),
            format!("there is no {what} `{}`", name.get_ref()),
            &format!("expected the name of a {what}"),
            &format!("known are {}", if list.is_empty() { "none".to_owned() } else { list.join(", ") }),
        );
    }
}

/// Makes the rig of a chain of files, the rig's own first, then what it extends.
pub(crate) fn assemble(chain: Vec<(usize, RigEntry)>) -> Result<Rig, Vec<Diagnostic>> {
    let mut log = Log::default();
    let mut files = chain.into_iter().rev();
    let Some((file, first)) = files.next() else {
        return Err(Vec::new());
    };
    let mut merged = Merged::new(file, first, &mut log);
    for (file, entry) in files {
        merged.extend(Merged::new(file, entry, &mut log));
    }
    let rig = merged.build(&mut log);
    if log.0.is_empty() {
        Ok(rig)
    } else {
        log.0.sort_by_key(|found| found.span.map(|span| (span.file, span.start)));
        Err(log.0)
    }
}

/// Entries of all files of a chain.
struct Merged {
    name: String,
    title: String,
    gravity: Option<Item<Triple>>,
    seed: Option<u64>,
    rate: Option<Item<toml::Spanned<f64>>>,
    derivatives: Option<bool>,
    bodies: Vec<Item<BodyEntry>>,
    points: Vec<Item<PointEntry>>,
    lumped_masses: Vec<Item<LumpedMassEntry>>,
    joints: Vec<Item<JointEntry>>,
    coordinates: Vec<Item<CoordinateEntry>>,
    drives: Vec<Item<DriveEntry>>,
    effects: Vec<Item<EffectEntry>>,
    encoders: Vec<Item<SensorEntry>>,
    force_sensors: Vec<Item<SensorEntry>>,
}

impl Merged {
    fn new(file: usize, entry: RigEntry, log: &mut Log) -> Self {
        if *entry.schema.get_ref() != 1 {
            log.error(
                span(file, &entry.schema.span()),
                format!("schema {} of rig files is not known", entry.schema.get_ref()),
                "expected 1",
                "write `schema = 1`",
            );
        }
        let sampling = entry.sampling.unwrap_or_default();
        Self {
            name: entry.name.into_inner(),
            title: entry.title.unwrap_or_default(),
            gravity: entry.gravity.map(|entry| Item { file, entry }),
            seed: entry.seed,
            rate: sampling.rate.map(|entry| Item { file, entry }),
            derivatives: sampling.derivatives,
            bodies: named(file, entry.body, "body", |e| Some(&e.name), log),
            points: named(file, entry.point, "point", |e| Some(&e.name), log),
            lumped_masses: named(file, entry.lumped_mass, "lumped mass", |e| e.name.as_ref(), log),
            joints: named(file, entry.joint, "joint", |e| Some(&e.name), log),
            coordinates: named(file, entry.coordinate, "coordinate", |e| Some(&e.name), log),
            drives: named(file, entry.drive, "drive", |e| Some(&e.name), log),
            effects: named(file, entry.effect, "effect", |e| e.name.as_ref(), log),
            encoders: named(file, entry.encoder, "encoder", |_| None, log),
            force_sensors: named(file, entry.force_sensor, "force sensor", |_| None, log),
        }
    }

    /// Takes over the entries of a variant.
    fn extend(&mut self, variant: Self) {
        self.name = variant.name;
        if !variant.title.is_empty() {
            self.title = variant.title;
        }
        self.gravity = variant.gravity.or(self.gravity.take());
        self.seed = variant.seed.or(self.seed);
        self.rate = variant.rate.or(self.rate.take());
        self.derivatives = variant.derivatives.or(self.derivatives);
        replace(&mut self.bodies, variant.bodies, |e| Some(&e.name));
        replace(&mut self.points, variant.points, |e| Some(&e.name));
        replace(&mut self.lumped_masses, variant.lumped_masses, |e| e.name.as_ref());
        replace(&mut self.joints, variant.joints, |e| Some(&e.name));
        replace(&mut self.coordinates, variant.coordinates, |e| Some(&e.name));
        replace(&mut self.drives, variant.drives, |e| Some(&e.name));
        replace(&mut self.effects, variant.effects, |e| e.name.as_ref());
        self.encoders.extend(variant.encoders);
        self.force_sensors.extend(variant.force_sensors);
    }

    fn build(&self, log: &mut Log) -> Rig {
        let mut rig = Rig {
            name: self.name.clone(),
            title: self.title.clone(),
            gravity: self.gravity.as_ref().map_or_else(Vector3::zeros, |g| vector(g.file, Some(&g.entry), log)),
            bodies: self.bodies.iter().map(|b| body(b, log)).collect(),
            points: Vec::new(),
            lumped_masses: Vec::new(),
            joints: Vec::new(),
            coordinates: Vec::new(),
            drives: Vec::new(),
            effects: Vec::new(),
            sensors: Sensors::default(),
            seed: self.seed.unwrap_or(0),
        };
        for point in &self.points {
            let on = body_named(&rig, point.file, &point.entry.on, log);
            let at = vector(point.file, Some(&point.entry.at), log);
            rig.points.push(Point {
                name: point.entry.name.get_ref().clone(),
                anchor: Anchor { body: on.flatten(), at },
            });
        }
        for mass in &self.lumped_masses {
            rig.lumped_masses.extend(lumped_mass(&rig, mass, log));
        }
        for entry in &self.joints {
            let joint = joint(&rig, entry, log);
            rig.joints.push(joint);
        }
        for entry in &self.coordinates {
            coordinate(&mut rig, entry, log);
        }
        for entry in &self.drives {
            drive(&mut rig, entry, log);
        }
        self.check_columns(log);
        for entry in &self.effects {
            rig.effects.extend(effect(&rig, entry, log));
        }
        rig.sensors = Sensors {
            rate: self.rate.as_ref().map(|rate| above_zero(rate.file, &rate.entry, "a sampling rate", log)),
            derivatives: self.derivatives.unwrap_or(self.encoders.is_empty()),
            encoders: channels(&self.encoders, "coordinate", self.coordinates.iter().map(|c| &c.entry.name), log),
            force_sensors: channels(&self.force_sensors, "drive", self.drives.iter().map(|d| &d.entry.name), log),
        };
        rig
    }

    /// A rig needs coordinates, as many drives, and columns that can be told apart.
    fn check_columns(&self, log: &mut Log) {
        let (n_coordinates, n_drives) = (self.coordinates.len(), self.drives.len());
        if n_coordinates == 0 || n_drives != n_coordinates {
            let drives = self.drives.last().map(|d| (d.file, d.entry.name.span()));
            let last = drives.or(self.coordinates.last().map(|c| (c.file, c.entry.name.span())));
            let (file, range) = last.unwrap_or((0, 0..0));
            log.error(
                span(file, &range),
                format!("this rig has {n_coordinates} coordinates and {n_drives} drives"),
                "",
                "give one `[[coordinate]]` and one `[[drive]]` per degree of freedom",
            );
        }
        let mut columns = vec!["t".to_owned()];
        let coordinates = self.coordinates.iter().map(|c| (c.file, &c.entry.name, true));
        let drives = self.drives.iter().map(|d| (d.file, &d.entry.name, false));
        for (file, name, is_coordinate) in coordinates.chain(drives) {
            let suffixes: &[&str] = if is_coordinate { &["", "_d", "_dd"] } else { &[""] };
            for suffix in suffixes {
                let column = format!("{}{suffix}", name.get_ref());
                if columns.contains(&column) {
                    log.error(
                        span(file, &name.span()),
                        format!("two columns of a recording would be called `{column}`"),
                        "",
                        "choose another name",
                    );
                }
                columns.push(column);
            }
        }
    }
}

/// Wraps the entries of one file; names must be words and differ.
fn named<T>(
    file: usize,
    entries: Vec<T>,
    what: &str,
    name: impl Fn(&T) -> Option<&Name>,
    log: &mut Log,
) -> Vec<Item<T>> {
    let mut seen: Vec<&str> = Vec::new();
    for found in entries.iter().filter_map(&name) {
        let text = found.get_ref().as_str();
        let is_word = text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
            && text.chars().next().is_some_and(|c| !c.is_ascii_digit());
        if !is_word || text == "base" {
            log.error(
                span(file, &found.span()),
                format!("`{}` cannot be a name", text.chars().take(60).collect::<String>()),
                "expected letters, digits and `_`, other than `base`",
                "",
            );
        }
        if seen.contains(&text) {
            log.error(
                span(file, &found.span()),
                format!("there are two entries for the {what} `{text}`"),
                "this is the second one",
                "rename or delete one of the two",
            );
        }
        seen.push(text);
    }
    entries.into_iter().map(|entry| Item { file, entry }).collect()
}

/// Entries of a variant replace those of the same name where they stand, or join them.
fn replace<T>(base: &mut Vec<Item<T>>, variant: Vec<Item<T>>, name: impl Fn(&T) -> Option<&Name>) {
    for item in variant {
        let twin = base.iter().position(|other| {
            name(&item.entry).is_some_and(|mine| name(&other.entry).is_some_and(|its| its.get_ref() == mine.get_ref()))
        });
        match twin {
            Some(at) => base[at] = item,
            None => base.push(item),
        }
    }
}

fn vector(file: usize, entry: Option<&Triple>, log: &mut Log) -> Vector3<f64> {
    let Some(entry) = entry else {
        return Vector3::zeros();
    };
    let vector = Vector3::from(*entry.get_ref());
    if !vector.iter().all(|x| x.is_finite()) {
        log.error(span(file, &entry.span()), "this is not finite".to_owned(), "expected finite numbers", "");
        return Vector3::zeros();
    }
    vector
}

fn above_zero(file: usize, entry: &toml::Spanned<f64>, what: &str, log: &mut Log) -> f64 {
    let value = *entry.get_ref();
    if value.is_finite() && value > 0.0 {
        return value;
    }
    log.error(
        span(file, &entry.span()),
        format!("{what} cannot be {value}"),
        "expected a finite number above zero",
        "",
    );
    1.0
}

fn not_negative(file: usize, entry: Option<&toml::Spanned<f64>>, what: &str, log: &mut Log) -> f64 {
    let Some(entry) = entry else {
        return 0.0;
    };
    let value = *entry.get_ref();
    if value.is_finite() && value >= 0.0 {
        return value;
    }
    log.error(
        span(file, &entry.span()),
        format!("{what} cannot be {value}"),
        "expected a finite number, not below zero",
        "",
    );
    0.0
}

fn body(item: &Item<BodyEntry>, log: &mut Log) -> Body {
    let (file, entry) = (item.file, &item.entry);
    let inertia = entry.inertia.as_ref().map_or_else(Matrix3::zeros, |spanned| {
        let i = spanned.get_ref();
        let matrix = Matrix3::new(i.xx, i.xy, i.xz, i.xy, i.yy, i.yz, i.xz, i.yz, i.zz);
        let moments = if matrix.iter().all(|x| x.is_finite()) {
            matrix.symmetric_eigenvalues()
        } else {
            Vector3::repeat(f64::NAN)
        };
        // A planar model gives zz alone, which no body has; it does no harm where only that one counts.
        if !(moments.min() >= -1e-9 * moments.amax()) {
            log.error(
                span(file, &spanned.span()),
                format!("no body has this inertia: its principal moments are {:.4}, {:.4}, {:.4}", moments[0], moments[1], moments[2]),
                "expected principal moments that are not below zero",
                "xy, xz and yz are the entries of the matrix: the negative products of inertia",
            );
        }
        matrix
    });
    Body {
        name: entry.name.get_ref().clone(),
        nominal: Pose::from_xyz_rpy(vector(file, entry.at.as_ref(), log), vector(file, entry.rpy.as_ref(), log)),
        mass: not_negative(file, entry.mass.as_ref(), "a mass", log),
        centre: vector(file, entry.centre.as_ref(), log),
        inertia,
    }
}

/// Index of a body; `Some(None)` is the base.
fn body_named(rig: &Rig, file: usize, name: &Name, log: &mut Log) -> Option<Option<usize>> {
    if name.get_ref() == "base" {
        return Some(None);
    }
    let found = rig.bodies.iter().position(|body| &body.name == name.get_ref());
    if found.is_none() {
        let mut known = vec!["base"];
        known.extend(rig.bodies.iter().map(|body| body.name.as_str()));
        log.unknown(file, name, "body", &known);
    }
    found.map(Some)
}

fn point_named(rig: &Rig, file: usize, name: &Name, log: &mut Log) -> Option<Anchor> {
    let found = rig.points.iter().find(|point| &point.name == name.get_ref());
    if found.is_none() {
        let known: Vec<&str> = rig.points.iter().map(|point| point.name.as_str()).collect();
        log.unknown(file, name, "point", &known);
    }
    found.map(|point| point.anchor)
}

fn joint_named(rig: &Rig, file: usize, name: &Name, log: &mut Log) -> Option<usize> {
    let found = rig.joints.iter().position(|joint| &joint.name == name.get_ref());
    match found {
        None => {
            let known: Vec<&str> = rig.joints.iter().map(|joint| joint.name.as_str()).collect();
            log.unknown(file, name, "joint", &known);
            None
        }
        Some(at) if rig.joints[at].motion.is_none() => {
            log.error(
                span(file, &name.span()),
                format!("the joint `{}` has no single coordinate", name.get_ref()),
                "expected a revolute or a prismatic joint",
                "",
            );
            None
        }
        found => found,
    }
}

fn lumped_mass(rig: &Rig, item: &Item<LumpedMassEntry>, log: &mut Log) -> Option<LumpedMass> {
    let (file, entry) = (item.file, &item.entry);
    let mass = not_negative(file, Some(&entry.mass), "a mass", log);
    let at = point_named(rig, file, &entry.at, log)?;
    let moment_at = match &entry.moment_at {
        None => at,
        Some(name) => point_named(rig, file, name, log)?,
    };
    if let Some(name) = entry.moment_at.as_ref().filter(|_| moment_at.body != at.body) {
        log.error(
            span(file, &name.span()),
            format!("`{}` is on another body than `{}`", name.get_ref(), entry.at.get_ref()),
            "expected a point of the same body",
            "both balances are those of one body",
        );
    }
    Some(LumpedMass { mass, at, moment_at: moment_at.at })
}

fn joint(rig: &Rig, item: &Item<JointEntry>, log: &mut Log) -> Joint {
    let (file, entry) = (item.file, &item.entry);
    let mut joint = Joint {
        name: entry.name.get_ref().clone(),
        equations: Vec::new(),
        motion: None,
    };
    let Some(kind) = joint::Kind::named(entry.kind.get_ref()) else {
        log.unknown(file, &entry.kind, "kind of joint", &joint::Kind::NAMES);
        return joint;
    };
    let [one, two] = entry.between.get_ref();
    let bodies = (body_named(rig, file, one, log), body_named(rig, file, two, log));
    let axis = entry.axis.as_ref().map_or_else(Vector3::z, |axis| vector(file, Some(axis), log));
    if !(axis.norm() > 0.0 && axis.norm().is_finite()) {
        let range = entry.axis.as_ref().map_or(0..0, toml::Spanned::span);
        log.error(span(file, &range), "this axis has no direction".to_owned(), "expected a vector other than zero", "");
        return joint;
    }
    let (Some(first), Some(second)) = bodies else {
        return joint;
    };
    if first == second {
        let range = entry.between.span();
        log.error(span(file, &range), "this joint joins a body to itself".to_owned(), "expected two bodies", "");
        return joint;
    }
    let Some([from, to]) = joint_anchors(rig, file, entry, [first, second], log) else {
        return joint;
    };
    let nominal = |body: Option<usize>| body.map_or_else(Pose::identity, |b| rig.bodies[b].nominal);
    let parts = joint::equations(kind, from, to, &axis.normalize(), [nominal(first), nominal(second)]);
    joint.equations = parts.0;
    joint.motion = parts.1;
    joint
}

/// Where the joint is on each of its bodies.
fn joint_anchors(
    rig: &Rig,
    file: usize,
    entry: &JointEntry,
    bodies: [Option<usize>; 2],
    log: &mut Log,
) -> Option<[Anchor; 2]> {
    let nominal = |body: Option<usize>| body.map_or_else(Pose::identity, |b| rig.bodies[b].nominal);
    let on = |body: Option<usize>, p_W: Vector3<f64>| {
        let pose = nominal(body);
        Anchor { body, at: pose.q_WB.inverse() * (p_W - pose.p_WB_W) }
    };
    let whole = span(file, &entry.name.span());
    match (&entry.at, &entry.points) {
        (Some(at), None) => {
            let at = vector(file, Some(at), log);
            Some(bodies.map(|body| on(body, at)))
        }
        (None, Some(points)) => {
            let names = points.get_ref();
            let anchors: Vec<Anchor> = names.iter().filter_map(|name| point_named(rig, file, name, log)).collect();
            if anchors.len() < names.len() {
                return None;
            }
            match anchors.as_slice() {
                [one] if bodies.contains(&one.body) => {
                    let pose = nominal(one.body);
                    let p_W = pose.q_WB * one.at + pose.p_WB_W;
                    Some(bodies.map(|body| if body == one.body { *one } else { on(body, p_W) }))
                }
                [one, two] if [one.body, two.body] == bodies => Some([*one, *two]),
                _ => {
                    log.error(
                        span(file, &points.span()),
                        "these points do not fit the joint's bodies".to_owned(),
                        "expected one point of either body, or one of each in the order of `between`",
                        "",
                    );
                    None
                }
            }
        }
        _ => {
            log.error(
                whole,
                "it is not clear where this joint is".to_owned(),
                "expected one of `at` and `points`",
                "`at = [x, y, z]` is in the base frame, nominal configuration; `points` names points of its bodies",
            );
            None
        }
    }
}

fn length(rig: &Rig, file: usize, entry: &LengthEntry, log: &mut Log) -> Option<Pair> {
    let from = point_named(rig, file, &entry.from, log);
    let to = point_named(rig, file, &entry.to, log);
    let pair = Pair { from: from?, to: to?, shape: Shape::Distance };
    if pair.from.body == pair.to.body {
        log.error(
            span(file, &entry.to.span()),
            "the distance of two points of one body never changes".to_owned(),
            "expected a point of another body",
            "",
        );
        return None;
    }
    Some(pair)
}

fn coordinate(rig: &mut Rig, item: &Item<CoordinateEntry>, log: &mut Log) {
    let (file, entry) = (item.file, &item.entry);
    let nominal = entry.nominal.as_ref().map(|n| *n.get_ref());
    if let Some(wrong) = entry.nominal.as_ref().filter(|n| !n.get_ref().is_finite() || entry.joint.is_none()) {
        log.error(
            span(file, &wrong.span()),
            "this nominal value means nothing".to_owned(),
            "expected a finite value of a joint's coordinate; a length follows from its points",
            "",
        );
    }
    let measures = match (&entry.joint, &entry.length) {
        (Some(name), None) => joint_named(rig, file, name, log).and_then(|joint| {
            let poses: Vec<Pose> = rig.bodies.iter().map(|body| body.nominal).collect();
            let motion = rig.joints[joint].motion.as_mut()?;
            if let Some(nominal) = nominal {
                joint::set_nominal(motion, nominal, &poses);
            }
            Some(*motion)
        }),
        (None, Some(points)) => length(rig, file, points, log),
        _ => {
            one_of(file, &entry.name, "`joint` and `length`", log);
            None
        }
    };
    rig.coordinates.extend(measures.map(|measures| Coordinate { name: entry.name.get_ref().clone(), measures }));
}

fn drive(rig: &mut Rig, item: &Item<DriveEntry>, log: &mut Log) {
    let (file, entry) = (item.file, &item.entry);
    let measures = match (&entry.joint, &entry.linear) {
        (Some(name), None) => joint_named(rig, file, name, log).and_then(|joint| rig.joints[joint].motion),
        (None, Some(points)) => length(rig, file, points, log),
        _ => {
            one_of(file, &entry.name, "`joint` and `linear`", log);
            None
        }
    };
    rig.drives.extend(measures.map(|measures| Drive { name: entry.name.get_ref().clone(), measures }));
}

fn one_of(file: usize, name: &Name, keys: &str, log: &mut Log) {
    log.error(
        span(file, &name.span()),
        format!("it is not clear what `{}` is", name.get_ref()),
        &format!("expected one of {keys}"),
        "",
    );
}

/// Kinds of model files that a rig says in another way.
const SAID_OTHERWISE: [(&str, &str); 5] = [
    ("point_mass", "a mass at a point is a `[[lumped_mass]]`: `at = \"R2m\"`, `mass = 2.0`"),
    ("rod_inertia", "a rod is a `[[body]]` with joints of its own; see model-spec/rigs/spidermill-with-rods.toml"),
    ("gravity_tilt", "tilt the vector `gravity`"),
    ("time_delay", "give the `[[force_sensor]]` a `delay`"),
    ("lumped_mass_placement", "give the `[[lumped_mass]]` a point `moment_at`"),
];

fn effect(rig: &Rig, item: &Item<EffectEntry>, log: &mut Log) -> Option<Effect> {
    let (file, entry) = (item.file, &item.entry);
    let kind = entry.kind.get_ref().as_str();
    let Some(symbols) = Law::values(kind) else {
        match SAID_OTHERWISE.iter().find(|(name, _)| *name == kind) {
            Some((_, help)) => log.error(
                span(file, &entry.kind.span()),
                format!("in a rig `{kind}` is no effect"),
                "it is part of the machine",
                help,
            ),
            None => log.unknown(file, &entry.kind, "kind of effect", &Law::KINDS),
        }
        return None;
    };
    let mut values = Vec::new();
    for (symbol, default, is_positive) in symbols {
        let given = entry.values.iter().find(|(name, _)| name.get_ref() == symbol);
        let value = match (given, default) {
            (Some((_, value)), _) if *is_positive => above_zero(file, value, &format!("`{symbol}`"), log),
            (Some((_, value)), _) => {
                if !value.get_ref().is_finite() {
                    log.error(span(file, &value.span()), "this is not finite".to_owned(), "expected a finite number", "");
                }
                *value.get_ref()
            }
            (None, Some(default)) => *default,
            (None, None) => {
                log.error(
                    span(file, &entry.kind.span()),
                    format!("`{kind}` lacks the value `{symbol}`"),
                    "",
                    &format!("write `values = {{ {symbol} = ... }}`, in SI units of the place"),
                );
                0.0
            }
        };
        values.push(value);
    }
    let known: Vec<&str> = symbols.iter().map(|(symbol, _, _)| *symbol).collect();
    for name in entry.values.keys().filter(|name| !known.contains(&name.get_ref().as_str())) {
        log.unknown(file, name, &format!("value of `{kind}`"), &known);
    }
    let law = Law::new(kind, &values)?;
    let places: Vec<Place> = entry.at.get_ref().iter().filter_map(|name| place(rig, file, name, &law, log)).collect();
    if places.len() < entry.at.get_ref().len() {
        return None;
    }
    let is_coupled = matches!(law, Law::CoupledDrive { .. });
    if places.is_empty() || (is_coupled && places.len() != 2) {
        log.error(
            span(file, &entry.at.span()),
            format!("`{kind}` does not act at this number of places"),
            if is_coupled { "expected two drives or joints" } else { "expected at least one drive or joint" },
            "",
        );
        return None;
    }
    Some(Effect { law, places })
}

/// A place of an effect: a drive, a coordinate (its joint) or a joint.
fn place(rig: &Rig, file: usize, name: &Name, law: &Law, log: &mut Log) -> Option<Place> {
    let text = name.get_ref();
    let joint = |pair: &Pair| rig.joints.iter().position(|joint| joint.motion.as_ref() == Some(pair));
    let drive = rig.drives.iter().position(|drive| &drive.name == text).map(Place::Drive);
    let coordinate = rig.coordinates.iter().find(|c| &c.name == text);
    let found = drive
        .or_else(|| coordinate.and_then(|c| joint(&c.measures)).map(Place::Joint))
        .or_else(|| {
            let joint = rig.joints.iter().position(|joint| &joint.name == text && joint.motion.is_some());
            joint.map(Place::Joint)
        });
    if found.is_none() {
        let drives = rig.drives.iter().map(|drive| drive.name.as_str());
        let coordinates = rig.coordinates.iter().map(|c| c.name.as_str());
        let joints = rig.joints.iter().filter(|j| j.motion.is_some()).map(|j| j.name.as_str());
        let known: Vec<&str> = drives.chain(coordinates).chain(joints).collect();
        log.unknown(file, name, "drive or movable joint", &known);
    }
    if law.needs_load() && matches!(found, Some(Place::Joint(_))) {
        log.error(
            span(file, &name.span()),
            "the load of a joint is not known where others hold it too".to_owned(),
            "expected a drive",
            "friction by load acts on drives",
        );
        return None;
    }
    found
}

/// One channel per name; ideal where no sensor is described. A later sensor replaces an earlier one.
fn channels<'a>(
    items: &[Item<SensorEntry>],
    what: &str,
    names: impl Iterator<Item = &'a Name>,
    log: &mut Log,
) -> Vec<Channel> {
    let names: Vec<&str> = names.map(|name| name.get_ref().as_str()).collect();
    let mut channels = vec![Channel::default(); names.len()];
    for item in items {
        let channel = channel(item, what, log);
        for name in item.entry.of.get_ref() {
            match names.iter().position(|known| known == name.get_ref()) {
                Some(at) => channels[at] = channel,
                None => log.unknown(item.file, name, what, &names),
            }
        }
    }
    channels
}

fn channel(item: &Item<SensorEntry>, what: &str, log: &mut Log) -> Channel {
    let (file, entry) = (item.file, &item.entry);
    let mut resolution = not_negative(file, entry.resolution.as_ref(), "a resolution", log);
    let ways = usize::from(entry.resolution.is_some())
        + usize::from(entry.bits.is_some())
        + usize::from(entry.current.is_some());
    if ways > 1 {
        log.error(
            span(file, &entry.of.span()),
            "this sensor has two resolutions".to_owned(),
            "",
            "give one of `resolution`, `bits` (encoders) and `current` (force sensors)",
        );
    }
    if let Some(bits) = &entry.bits {
        if what != "coordinate" || !(1..=52).contains(bits.get_ref()) {
            log.error(
                span(file, &bits.span()),
                "this number of bits means nothing here".to_owned(),
                "expected 1 to 52, of an encoder",
                "an encoder of `bits = 20` tells 2^20 angles of a turn apart",
            );
        } else {
            resolution = 2.0 * std::f64::consts::PI / (1_u64 << bits.get_ref()) as f64;
        }
    }
    if let Some(current) = &entry.current {
        if what == "coordinate" {
            log.error(
                span(file, &entry.of.span()),
                "an encoder reads no current".to_owned(),
                "",
                "`current` belongs to a `[[force_sensor]]`",
            );
        }
        resolution = above_zero(file, &current.force_per_ampere, "a force per ampere", log)
            * above_zero(file, &current.resolution, "a resolution", log);
    }
    Channel {
        noise: not_negative(file, entry.noise.as_ref(), "a noise's deviation", log),
        resolution,
        delay: not_negative(file, entry.delay.as_ref(), "a delay", log),
    }
}
