//! The four steps in a row: a rig and a plan go in, the text of a model file and the report come out.

use modelmill_rig::{Anchor, Failure, Log, Rig, fault, span};
use nalgebra::Vector2;

use crate::draft::{Draft, DraftCoordinate, DraftEffect, DraftPart, DraftPoint, Frame, rounded};
use crate::drive::{Contact, check_linear};
use crate::names::Names;
use crate::part::{Part, lump, residuals, substitute};
use crate::plan::{Name, PartEntry, Plan};
use crate::planar::{Flat, check_group, out_of_plane};
use crate::report::{Report, Size};
use crate::samples::{Moment, Plane, Samples};
use crate::write::{digits, model_file};

/// What a reduction gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Reduction {
    /// The text of the model file.
    pub model: String,
    /// What was assumed.
    pub report: Report,
}

/// Rates out of the plane, gaps of joints and changes of shifts above this are no rounding.
const TOLERANCE: f64 = 1e-6;
/// Lengths and angles below this are zero.
const ZERO: f64 = 1e-12;

/// Reduces a rig by a plan.
///
/// Fails with every fault of the plan, each with its place: unknown names, bodies that are forgotten or used twice,
/// bodies that leave the plane, joints that do not meet.
pub fn reduce(rig: &Rig, plan: &Plan) -> Result<Reduction, Failure> {
    let mut log = Log::default();
    let outcome = run(rig, plan, &mut log);
    match outcome {
        Some((draft, report)) if log.0.is_empty() => {
            let model = model_file(&draft);
            // What comes out is a sound model file, or the plan asks for something that is none.
            let path = format!("{}.toml (reduced)", draft.name);
            let none = &mut |_: &std::path::Path| Err(std::io::Error::other("nothing is extended"));
            modelmill_spec::load(&path, &model, none)?;
            Ok(Reduction { model, report })
        }
        _ => {
            log.0.sort_by_key(|found| found.span.map(|span| span.start));
            Err(Failure {
                diagnostics: log.0,
                sources: plan.sources.clone(),
            })
        }
    }
}

fn run(rig: &Rig, plan: &Plan, log: &mut Log) -> Option<(Draft, Report)> {
    let entry = &plan.entry;
    let names = Names::new(rig, entry, log);
    let plane = Plane::new(entry.plane.at, entry.plane.normal, entry.plane.x);
    let samples = match Samples::new(rig, entry.samples.number, entry.samples.range) {
        Ok(samples) if samples.moments.len() >= 4 => samples,
        Ok(samples) => {
            let says = format!(
                "{} of {} sampled poses are out of the rig's reach; lower `range` in `[samples]`",
                samples.n_out_of_reach, entry.samples.number
            );
            log.0.push(fault(None, says));
            return None;
        }
        Err(error) => {
            log.0
                .push(fault(None, format!("the rig does not stand: {error}")));
            return None;
        }
    };
    let mut work = Work {
        names,
        plane,
        samples,
        parts: Vec::new(),
        draft: Draft {
            name: entry.name.get_ref().clone(),
            title: entry.title.clone().unwrap_or_default(),
            origin: format!("Reduced from the rig {} by modelmill reduce.", rig.name),
            ..Draft::default()
        },
        report: Report::default(),
        used: Vec::new(),
        wholes: Vec::new(),
    };
    work.planar_reduction(log);
    if !log.0.is_empty() {
        return None;
    }
    work.parts(log);
    if !log.0.is_empty() {
        return None;
    }
    work.lumped_masses(log);
    work.check_equation_1();
    work.loops(log);
    work.drives(log);
    work.effects();
    work.nothing_is_forgotten(log);
    work.check_constants(log);
    let draft = work.draft;
    let mut report = work.report;
    for symbols in [
        &draft.masses,
        &draft.centres,
        &draft.inertias,
        &draft.constants,
    ] {
        symbols.report_ties(&mut report);
    }
    Some((draft, report))
}

/// A reduction in the making.
struct Work<'a> {
    names: Names<'a>,
    plane: Plane,
    samples: Samples,
    parts: Vec<Part>,
    draft: Draft,
    report: Report,
    /// Groups that have a place in the model.
    used: Vec<String>,
    /// What each part of the draft stands for, in words and exactly.
    wholes: Vec<(String, Flat)>,
}

impl Work<'_> {
    /// Step 1.
    fn planar_reduction(&mut self, log: &mut Log) {
        let rig = self.names.rig;
        let out = out_of_plane(&self.plane, &self.samples);
        if out.is_nan() || out > TOLERANCE {
            log.0.push(fault(
                None,
                format!(
                    "bodies leave the plane at up to {} m/s or rad/s; give the plane of motion in `[plane]`, or model \
                     this rig in space",
                    digits(out, 3)
                ),
            ));
        }
        let reach = match self.samples.n_out_of_reach {
            0 => String::new(),
            n => format!(" ({n} more are out of reach)"),
        };
        let poses = self.samples.moments.len();
        self.report.add(
            1,
            "motion",
            format!("all bodies stay in the plane at {poses} sampled poses{reach}"),
            vec![Size::new("largest rate out of it", out, "m/s or rad/s")],
        );
        let across = self.plane.normal.dot(&rig.gravity);
        let flat = self.plane.flat(&rig.gravity);
        self.report.add(
            1,
            "gravity",
            "acts in the plane",
            vec![Size::new("across it", across, "m/s^2")],
        );
        self.draft.gravity = match (flat.x.abs() > ZERO, flat.y.abs() > ZERO) {
            (false, false) => ["0", "0"].map(str::to_owned),
            (true, true) => [("gx", flat.x), ("gy", flat.y)]
                .map(|(name, value)| self.gravity_constant(name, value)),
            (true, false) => [
                signed(self.gravity_constant("g", flat.x.abs()), flat.x),
                "0".to_owned(),
            ],
            (false, true) => [
                "0".to_owned(),
                signed(self.gravity_constant("g", flat.y.abs()), flat.y),
            ],
        };
        for (name, bodies) in &self.names.groups {
            check_group(
                rig,
                name,
                bodies,
                &self.plane,
                &self.samples,
                &mut self.report,
            );
        }
    }

    fn gravity_constant(&mut self, name: &str, value: f64) -> String {
        self.draft
            .constants
            .stand_for(name, "m/s^2", "acceleration of gravity", "gravity", value);
        name.to_owned()
    }

    /// Step 2, parts.
    fn parts(&mut self, log: &mut Log) {
        let plan = self.names.plan;
        for entry in &plan.part {
            if self
                .parts
                .iter()
                .any(|part| &part.name == entry.name.get_ref())
            {
                log.error(
                    span(0, &entry.name.span()),
                    "there are two parts of this name".to_owned(),
                    "",
                    "rename one",
                );
            }
            if let Some(part) = self.part(entry, log) {
                self.parts.push(part);
                self.frame(entry, log);
                self.body(entry, log);
            }
        }
        if plan.part.is_empty() {
            log.error(
                span(0, &plan.name.span()),
                "this plan has no part".to_owned(),
                "",
                "write a `[[part]]` for each body that the model is to have",
            );
        }
    }

    /// A part hung where it belongs.
    fn part(&self, entry: &PartEntry, log: &mut Log) -> Option<Part> {
        let names = &self.names;
        let mut used = self.used.clone();
        let bodies = names.bodies(entry.groups.get_ref(), &mut used, log);
        let parent = match entry.on.get_ref().as_str() {
            "base" => None,
            on => {
                let known: Vec<&str> = self
                    .parts
                    .iter()
                    .map(|part| part.name.as_str())
                    .chain(["base"])
                    .collect();
                let found = self.parts.iter().position(|part| part.name == on);
                if found.is_none() {
                    log.unknown(0, &entry.on, "part above this one", &known);
                    return None;
                }
                found
            }
        };
        let [at, from, to] = [&entry.at, &entry.from, &entry.to].map(|name| names.point(name, log));
        let (at, from, to) = (at?, from?, to?);
        let lead = *bodies.first()?;
        let carrier = parent.map(|parent| self.parts[parent].bodies[0]);
        for (name, anchor, body) in [
            (&entry.at, at, carrier),
            (&entry.from, from, Some(lead)),
            (&entry.to, to, Some(lead)),
        ] {
            if anchor.body != body {
                let wanted = body.map_or("the base", |b| names.rig.bodies[b].name.as_str());
                log.error(
                    span(0, &name.span()),
                    format!("`{}` is not on {wanted}", name.get_ref()),
                    "expected a point of this body",
                    "`at` is on what carries the part, `from` and `to` are on the first body of its first group",
                );
                return None;
            }
        }
        let mut part = Part {
            name: entry.name.get_ref().clone(),
            bodies,
            parent,
            joint: [at, from],
            to,
            shift: Vector2::zeros(),
        };
        let length = (from.at - to.at).norm();
        if length < 1e-9 {
            log.error(
                span(0, &entry.to.span()),
                "this part has no length".to_owned(),
                "expected another point than `from`",
                "",
            );
            return None;
        }
        // What the model moves in the plane: the carrier's own shift, and the gap at the joint.
        let carried = parent.map_or_else(Vector2::zeros, |parent| self.parts[parent].shift);
        let gap = |moment: &Moment| {
            self.plane.place(&moment.place(&at)) - self.plane.place(&moment.place(&from)) + carried
        };
        part.shift = gap(&self.samples.nominal);
        let strays = self
            .samples
            .largest(|moment| (gap(moment) - part.shift).norm());
        if strays > TOLERANCE || strays.is_nan() {
            log.error(
                span(0, &entry.from.span()),
                format!(
                    "`{}` does not hang at `{}`: their distance changes by {} m",
                    part.name,
                    entry.at.get_ref(),
                    digits(strays, 3)
                ),
                "expected a place that keeps its distance to `at`",
                "",
            );
            return None;
        }
        Some(part)
    }

    /// Frame and coordinate of the part that was added last.
    fn frame(&mut self, entry: &PartEntry, log: &mut Log) {
        let Some(part) = self.parts.last().cloned() else {
            return;
        };
        let carrier = part.parent.map(|parent| self.parts[parent].clone());
        let (plane, samples) = (self.plane, &self.samples);
        let angle = |moment: &Moment| {
            let of = |part: &Part| {
                part.nominal_angle(&plane, samples) + part.turned(moment, &plane, samples)
            };
            of(&part) - carrier.as_ref().map_or(0.0, of)
        };
        let coordinate = entry.coordinate.get_ref();
        let nominal = wrapped(angle(&samples.nominal));
        let active = self
            .names
            .rig
            .coordinates
            .iter()
            .position(|c| &c.name == coordinate);
        let mut expression = coordinate.clone();
        if let Some(k) = active {
            let strays = |sign: f64| {
                samples.largest(|moment| {
                    wrapped(
                        angle(moment)
                            - nominal
                            - sign * (moment.state.q[k] - samples.nominal.state.q[k]),
                    )
                })
            };
            let [ahead, back] = [1.0, -1.0].map(strays);
            if ahead.min(back) > TOLERANCE {
                log.error(
                    span(0, &entry.coordinate.span()),
                    format!(
                        "`{coordinate}` of the rig is not the angle of `{}`",
                        part.name
                    ),
                    "expected the coordinate of its joint",
                    "another name makes a passive coordinate",
                );
            }
            let sign = if ahead <= back { 1.0 } else { -1.0 };
            let value = samples.nominal.state.q[k];
            let offset = wrapped(nominal - sign * value);
            expression = format!(
                "{}{coordinate}{}",
                if sign < 0.0 { "-" } else { "" },
                self.angle_offset(coordinate, offset)
            );
            self.draft.coordinates.push(DraftCoordinate {
                name: coordinate.clone(),
                nominal: rounded(value),
                passive: false,
            });
        } else {
            let nominal = (nominal * 1e6).round() / 1e6;
            self.draft.coordinates.push(DraftCoordinate {
                name: coordinate.clone(),
                nominal,
                passive: true,
            });
        }
        let (on, local) = match &carrier {
            None => (
                "base".to_owned(),
                plane.place(&self.samples.nominal.place(&part.joint[0])),
            ),
            Some(carrier) => (
                carrier.name.clone(),
                carrier.local(&part.joint[0], &plane, &self.samples),
            ),
        };
        let at = self.components(entry.at.get_ref(), &local);
        if part.shift.norm() > ZERO {
            let says = format!(
                "is shifted by ({}, {}) m to `{}`, which changes no force",
                digits(part.shift.x, 6),
                digits(part.shift.y, 6),
                entry.at.get_ref()
            );
            self.report.add(2, &part.name, says, Vec::new());
        }
        self.draft.frames.push(Frame {
            name: part.name.clone(),
            on,
            at,
            angle: expression,
            note: entry.note.clone().unwrap_or_default(),
        });
    }

    /// A constant angle behind a coordinate, as an expression with its sign.
    fn angle_offset(&mut self, coordinate: &str, offset: f64) -> String {
        if offset.abs() < 1e-9 {
            return String::new();
        }
        let twelfths = offset / (std::f64::consts::PI / 12.0);
        if (twelfths - twelfths.round()).abs() < 1e-9 {
            let sign = if twelfths < 0.0 { '-' } else { '+' };
            return format!(" {sign} {}*pi/12", twelfths.round().abs());
        }
        let name = format!("{coordinate}_offset");
        self.draft.constants.stand_for(
            &name,
            "rad",
            "from the rig's zero to the part's axis",
            &name,
            offset,
        );
        format!(" + {name}")
    }

    /// Expressions of a point's components: constants of the plan, or constants of their own.
    fn components(&mut self, point: &str, at: &Vector2<f64>) -> [String; 2] {
        let mut expressions = ["x", "y"].map(str::to_owned);
        for (axis, value) in expressions.iter_mut().zip([at.x, at.y]) {
            let what = format!("{point}.{axis}");
            if value.abs() < ZERO {
                "0".clone_into(axis);
                continue;
            }
            let named = self
                .names
                .plan
                .constants
                .iter()
                .find(|(_, c)| c.is.iter().any(|is| is.get_ref() == &what));
            let own = format!("{point}_{axis}");
            let (name, note) = match named {
                Some((name, constant)) => (
                    name.get_ref().clone(),
                    constant.note.clone().unwrap_or_default(),
                ),
                None => (own, String::new()),
            };
            let symbol = self
                .draft
                .constants
                .0
                .iter()
                .find(|symbol| symbol.name == name);
            if symbol.is_none_or(|symbol| symbol.stands_for.iter().all(|(known, _)| known != &what))
            {
                self.draft
                    .constants
                    .stand_for(&name, "m", &note, &what, value);
            }
            *axis = name;
        }
        expressions
    }

    /// Mass properties of the part that was added last.
    fn body(&mut self, entry: &PartEntry, log: &mut Log) {
        let Some(part) = self.parts.last() else {
            return;
        };
        self.used.extend(
            entry
                .groups
                .get_ref()
                .iter()
                .map(|name| name.get_ref().clone()),
        );
        let name = part.name.clone();
        let whole = substitute(
            self.names.rig,
            part,
            &self.plane,
            &self.samples,
            &mut self.report,
        );
        let drops = match entry.off_axis.as_ref().map(|s| s.get_ref().as_str()) {
            None | Some("keep") => false,
            Some("drop") => true,
            Some(_) => {
                let range = entry.off_axis.as_ref().map_or(0..0, toml::Spanned::span);
                log.error(
                    span(0, &range),
                    "this is no way to treat an offset".to_owned(),
                    "expected `keep` or `drop`",
                    "",
                );
                false
            }
        };
        let symbols = &entry.symbols;
        let symbol = |given: &Option<String>, prefix: &str| {
            given.clone().unwrap_or_else(|| format!("{prefix}_{name}"))
        };
        let about = |what: &str| format!("{what} of {}", entry.note.as_deref().unwrap_or(&name));
        let (mass, centre, across, inertia) = (
            symbol(&symbols.mass, "m"),
            symbol(&symbols.centre, "c"),
            symbol(&symbols.off_axis, "e"),
            symbol(&symbols.inertia, "I"),
        );
        let draft = &mut self.draft;
        draft
            .masses
            .stand_for(&mass, "kg", &about("mass"), &name, whole.mass);
        draft.inertias.stand_for(
            &inertia,
            "kg m^2",
            &about("inertia about the centre of mass"),
            &name,
            whole.inertia,
        );
        let mut components = ["0", "0"].map(str::to_owned);
        if whole.centre.x.abs() > ZERO {
            draft.centres.stand_for(
                &centre,
                "m",
                &about("centre of mass along the axis"),
                &name,
                whole.centre.x,
            );
            components[0] = centre;
        }
        if whole.centre.y.abs() > ZERO && !drops {
            draft.centres.stand_for(
                &across,
                "m",
                &about("centre of mass beside the axis"),
                &name,
                whole.centre.y,
            );
            components[1] = across;
        }
        let groups: Vec<&str> = entry
            .groups
            .get_ref()
            .iter()
            .map(|group| group.get_ref().as_str())
            .collect();
        let says = format!(
            "= {}: mass {} kg, centre ({}, {}) m, inertia {} kg m^2",
            groups.join(" + "),
            digits(whole.mass, 8),
            digits(whole.centre.x, 8),
            digits(
                if whole.centre.y.abs() > ZERO {
                    whole.centre.y
                } else {
                    0.0
                },
                8
            ),
            digits(whole.inertia, 8)
        );
        self.wholes.push((says, whole));
        draft.parts.push(DraftPart {
            name: format!("{name}_body"),
            on: name,
            mass,
            centre: components,
            inertia,
        });
    }

    /// Eq. (1) for every part, once all parts that share a symbol have given it their values.
    fn check_equation_1(&mut self) {
        let draft = &self.draft;
        for (part, (says, whole)) in draft.parts.iter().zip(&self.wholes) {
            let value = |expression: &String| match expression.as_str() {
                "0" => 0.0,
                name => draft.centres.value(name),
            };
            let said = Flat {
                mass: draft.masses.value(&part.mass),
                centre: Vector2::new(value(&part.centre[0]), value(&part.centre[1])),
                inertia: draft.inertias.value(&part.inertia),
            };
            self.report.add(2, &part.on, says, residuals(whole, &said));
        }
    }

    /// Step 2, lumped masses.
    fn lumped_masses(&mut self, log: &mut Log) {
        let plan = self.names.plan;
        for entry in &plan.lumped_mass {
            let bodies = self
                .names
                .bodies(entry.groups.get_ref(), &mut self.used, log);
            let points: Vec<(String, Anchor)> = entry
                .at
                .get_ref()
                .iter()
                .filter_map(|name| self.model_point(name, log))
                .collect();
            if bodies.is_empty() || points.len() < entry.at.get_ref().len() {
                continue;
            }
            if points.is_empty() {
                log.error(
                    span(0, &entry.at.span()),
                    "this mass is nowhere".to_owned(),
                    "expected at least one point",
                    "",
                );
                continue;
            }
            let name = entry.name.get_ref();
            let anchors: Vec<Anchor> = points.iter().map(|(_, anchor)| *anchor).collect();
            let (plane, samples) = (&self.plane, &self.samples);
            let mass = lump(
                self.names.rig,
                name,
                &bodies,
                &anchors,
                plane,
                samples,
                &mut self.report,
            );
            let symbol = entry.symbol.clone().unwrap_or_else(|| format!("m_{name}"));
            let note = entry
                .note
                .clone()
                .unwrap_or_else(|| format!("mass of {name}"));
            self.draft
                .masses
                .stand_for(&symbol, "kg", &note, name, mass);
            for (point, _) in &points {
                let one = if points.len() == 1 {
                    name.clone()
                } else {
                    format!("{name}_{point}")
                };
                self.draft
                    .lumped_masses
                    .push((one, symbol.clone(), points.len(), point.clone()));
            }
        }
    }

    /// A point of the model, declared when it is first used.
    fn model_point(&mut self, name: &Name, log: &mut Log) -> Option<(String, Anchor)> {
        let anchor = self.names.point(name, log)?;
        let part = self.names.owner(&self.parts, &anchor, name, log).ok()?;
        let contact = self.contact(&anchor, part);
        self.declare(name.get_ref(), contact);
        Some((name.get_ref().clone(), anchor))
    }

    fn contact(&self, anchor: &Anchor, part: Option<usize>) -> Contact {
        let at = match part {
            None => self.plane.place(&self.samples.nominal.place(anchor)),
            Some(part) => self.parts[part].local(anchor, &self.plane, &self.samples),
        };
        Contact { part, at }
    }

    fn declare(&mut self, name: &str, contact: Contact) {
        if self.draft.points.iter().any(|point| point.name == name) {
            return;
        }
        let on = contact
            .part
            .map_or("base".to_owned(), |part| self.parts[part].name.clone());
        let at = self.components(name, &contact.at);
        self.draft.points.push(DraftPoint {
            name: name.to_owned(),
            on,
            at,
        });
    }

    fn loops(&mut self, log: &mut Log) {
        let plan = self.names.plan;
        for entry in &plan.loops {
            let [one, two] = &entry.joins;
            let ends = (self.model_point(one, log), self.model_point(two, log));
            let (Some((first, a)), Some((second, b))) = ends else {
                continue;
            };
            let places = [a, b].map(|anchor| {
                let part = self
                    .parts
                    .iter()
                    .position(|part| part.bodies.first() == anchor.body.as_ref());
                self.contact(&anchor, part)
            });
            let gap = self.samples.largest(|moment| {
                let [p, r] = places
                    .map(|place| place.place(&self.parts, moment, &self.plane, &self.samples));
                (p - r).norm()
            });
            if gap > TOLERANCE || gap.is_nan() {
                log.error(
                    span(0, &two.span()),
                    format!(
                        "the loop `{}` does not close: its points are up to {} m apart",
                        entry.name.get_ref(),
                        digits(gap, 3)
                    ),
                    "expected a place that stays at the first point, once parts are shifted",
                    "",
                );
            }
            self.report.add(
                2,
                entry.name.get_ref(),
                format!("closes where {first} meets {second}"),
                vec![Size::new("gap", gap, "m")],
            );
            self.draft
                .loops
                .push((entry.name.get_ref().clone(), [first, second]));
        }
    }

    /// Step 4.
    fn drives(&mut self, log: &mut Log) {
        let (rig, plan) = (self.names.rig, self.names.plan);
        let known: Vec<&str> = rig.drives.iter().map(|drive| drive.name.as_str()).collect();
        for entry in plan
            .drive
            .iter()
            .filter(|entry| !known.contains(&entry.name.get_ref().as_str()))
        {
            log.unknown(0, &entry.name, "drive of the rig", &known);
        }
        for (d, drive) in rig.drives.iter().enumerate() {
            let entry = plan
                .drive
                .iter()
                .find(|entry| entry.name.get_ref() == &drive.name);
            let here = entry.map_or_else(|| &plan.name, |entry| &entry.name);
            let Some(ends) = rig.ends_of_drive(d) else {
                let coordinate = rig
                    .coordinate_of_drive(d)
                    .map(|c| rig.coordinates[c].name.clone());
                let active = coordinate.filter(|name| {
                    self.draft
                        .coordinates
                        .iter()
                        .any(|c| &c.name == name && !c.passive)
                });
                match active {
                    Some(coordinate) => {
                        self.report
                            .add(4, &drive.name, format!("turns {coordinate}"), Vec::new());
                        self.draft.drives.push((drive.name.clone(), Ok(coordinate)));
                    }
                    None => log.error(
                        span(0, &here.span()),
                        format!(
                            "the joint of the drive `{}` is the joint of no part",
                            drive.name
                        ),
                        "",
                        "give the part that hangs in this joint the joint's coordinate",
                    ),
                }
                continue;
            };
            let on_axis = entry.is_some_and(|entry| entry.contact_on_axis);
            let mut contacts = Vec::new();
            let mut names = Vec::new();
            for end in ends {
                let Some(name) = self.names.point_name(&end) else {
                    continue;
                };
                let named = Name::new(here.span(), name.clone());
                let Ok(part) = self.names.owner(&self.parts, &end, &named, log) else {
                    continue;
                };
                let mut contact = self.contact(&end, part);
                if on_axis {
                    contact = contact.on_axis();
                }
                self.declare(&name, contact);
                contacts.push(contact);
                names.push(name);
            }
            if let (&[from, to], [one, two]) = (contacts.as_slice(), names.as_slice()) {
                let (plane, samples) = (&self.plane, &self.samples);
                check_linear(
                    rig,
                    d,
                    ends,
                    [from, to],
                    &self.parts,
                    plane,
                    samples,
                    &mut self.report,
                );
                self.draft
                    .drives
                    .push((drive.name.clone(), Err([one.clone(), two.clone()])));
            }
        }
    }

    /// Effects at drives go over into the model; others are left out and named.
    fn effects(&mut self) {
        let rig = self.names.rig;
        for effect in &rig.effects {
            let (kind, values) = effect.law.described();
            let drive = |place: &modelmill_rig::Place| match place {
                modelmill_rig::Place::Drive(d) => {
                    rig.drives.get(*d).map(|drive| drive.name.clone())
                }
                _ => None,
            };
            let at: Vec<String> = effect.places.iter().filter_map(drive).collect();
            let library = modelmill_spec::library();
            let known = library.iter().find(|known| known.name == kind);
            let Some(known) = known.filter(|_| at.len() == effect.places.len()) else {
                self.report.add(
                    4,
                    kind,
                    "acts in the rig and is left out of the model",
                    Vec::new(),
                );
                continue;
            };
            let is_parameter = |symbol: &str| known.parameters.iter().any(|p| p.symbol == symbol);
            let (parameters, constants) = values
                .into_iter()
                .map(|(symbol, value)| (symbol.to_owned(), value))
                .partition(|(symbol, _)| is_parameter(symbol));
            self.report.add(
                4,
                kind,
                format!("at {} as in the rig", at.join(", ")),
                Vec::new(),
            );
            self.draft.effects.push(DraftEffect {
                kind: kind.to_owned(),
                at,
                parameters,
                constants,
            });
        }
    }

    /// Every group is in the model, or left out by name.
    fn nothing_is_forgotten(&mut self, log: &mut Log) {
        let (rig, plan) = (self.names.rig, self.names.plan);
        let left = self.names.bodies(&plan.leave_out, &mut self.used, log);
        for body in left {
            let solid = crate::planar::solid(rig, body);
            self.report.add(
                2,
                &rig.bodies[body].name,
                "is left out",
                vec![
                    Size::new("mass", solid.mass, "kg"),
                    Size::new("inertia", solid.inertia.amax(), "kg m^2"),
                ],
            );
        }
        let forgotten: Vec<&str> = self
            .names
            .groups
            .iter()
            .map(|(name, _)| name.as_str())
            .filter(|name| self.used.iter().all(|used| used != name))
            .collect();
        if !forgotten.is_empty() {
            log.error(
                span(0, &plan.name.span()),
                format!("the plan forgets {}", forgotten.join(", ")),
                "",
                "put each into a `[[part]]` or a `[[lumped_mass]]`, or name it in `leave_out`",
            );
        }
        let split = rig
            .lumped_masses
            .iter()
            .filter(|lumped| lumped.at.at != lumped.moment_at);
        for lumped in split {
            let about = lumped
                .at
                .body
                .map_or("base", |body| rig.bodies[body].name.as_str());
            let says = "has a mass that moments see elsewhere; the model has it at one place";
            self.report.add(
                2,
                about,
                says,
                vec![Size::new(
                    "moved by",
                    (lumped.at.at - lumped.moment_at).norm(),
                    "m",
                )],
            );
        }
    }

    /// Constants of the plan must stand for something.
    fn check_constants(&self, log: &mut Log) {
        for is in self
            .names
            .plan
            .constants
            .values()
            .flat_map(|constant| &constant.is)
        {
            let symbols = &self.draft.constants.0;
            if !symbols.iter().any(|symbol| {
                symbol
                    .stands_for
                    .iter()
                    .any(|(what, _)| what == is.get_ref())
            }) {
                let known: Vec<&str> = symbols
                    .iter()
                    .flat_map(|s| s.stands_for.iter().map(|(what, _)| what.as_str()))
                    .collect();
                log.unknown(0, is, "quantity of the model", &known);
            }
        }
    }
}

fn signed(name: String, value: f64) -> String {
    if value < 0.0 {
        format!("-{name}")
    } else {
        name
    }
}

/// An angle within half a turn.
fn wrapped(angle: f64) -> f64 {
    let turn = 2.0 * std::f64::consts::PI;
    angle - turn * (angle / turn).round()
}
