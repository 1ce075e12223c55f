//! Step 2 of the reduction: adds parts to the draft, with frame, coordinate, mass, centre and inertia, and point masses
//! with their points.

use modelmill_rig::{BodyAnchor, RigLog, source_span};
use nalgebra::Vector2;

use crate::alike::RotationSum;
use crate::drive::ContactPlace;
use crate::part::{SubstitutionPart, lump_mass, part_residuals, substitute};
use crate::plan::{PlanName, PlanPartEntry};
use crate::planar::PlanarBody;
use crate::planar_draft::{DraftCoordinate, DraftFrame, DraftPart, DraftPoint, round_to_12_digits};
use crate::reduce::{ReductionState, ZERO};
use crate::samples::MotionSample;
use crate::tolerance::{angle_tolerance, distance_tolerance};
use crate::write::significant_digits;

impl ReductionState<'_> {
    /// Step 2, parts: adds each part of the plan with its frame and body.
    pub(crate) fn parts(&mut self, log: &mut RigLog) {
        // A part may be carried by parts before it only, so that one pass is enough.
        let plan = self.names.plan;
        for entry in &plan.part {
            if self.parts.iter().any(|part| &part.name == entry.name.get_ref()) {
                log.error(
                    source_span(0, &entry.name.span()),
                    "two parts have this name".to_owned(),
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
                source_span(0, &plan.name.span()),
                "this plan has no part".to_owned(),
                "",
                "write a `[[part]]` for each body of the model",
            );
        }
    }

    /// Resolves a part and its shift. Reports points on wrong bodies, a part without length, and a joint that does not
    /// coincide up to a constant shift.
    pub(crate) fn part(&self, entry: &PlanPartEntry, log: &mut RigLog) -> Option<SubstitutionPart> {
        // Bodies of the part, and the part that carries it.
        let names = &self.names;
        let mut used = self.used_groups.clone();
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
                    log.unknown_name(0, &entry.on, "part before this one", &known);
                    return None;
                }
                found
            }
        };
        // Its joint and the end of its axis, each on the right body.
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
                    source_span(0, &name.span()),
                    format!("`{}` is not on {wanted}", name.get_ref()),
                    "expected a point of this body",
                    "`at` is a point of the carrier, `from` and `to` are points of the first body of its first group",
                );
                return None;
            }
        }
        let mut part = SubstitutionPart {
            name: entry.name.get_ref().clone(),
            bodies,
            parent,
            joint: [at, from],
            to,
            shift: Vector2::zeros(),
        };
        // Without a length the axis has no direction.
        let length = (from.at - to.at).norm();
        if length < 1e-9 {
            log.error(
                source_span(0, &entry.to.span()),
                "this part has no length".to_owned(),
                "expected another point than `from`",
                "",
            );
            return None;
        }
        // The shift of a part is the shift of its carrier plus the gap at the joint, which must be constant.
        let carried = parent.map_or_else(Vector2::zeros, |parent| self.parts[parent].shift);
        let gap = |moment: &MotionSample| {
            self.plane.plane_position(&moment.place(&at)) - self.plane.plane_position(&moment.place(&from)) + carried
        };
        part.shift = gap(&self.samples.nominal);
        // The gap changes along the samples if the points are no joint.
        let strays = self.samples.largest(|moment| (gap(moment) - part.shift).norm());
        if strays > distance_tolerance(self.names.rig) || strays.is_nan() {
            log.error(
                source_span(0, &entry.from.span()),
                format!(
                    "`{}` is not connected at `{}`: their distance changes by {} m",
                    part.name,
                    entry.at.get_ref(),
                    significant_digits(strays, 3)
                ),
                "expected a point with a constant distance to `at`",
                "",
            );
            return None;
        }
        Some(part)
    }

    /// Adds frame and coordinate of the last part. A coordinate with a name of the rig is active and must be the angle
    /// of the part up to sign and offset; others are passive.
    pub(crate) fn frame(&mut self, entry: &PlanPartEntry, log: &mut RigLog) {
        let Some(mut part) = self.parts.last().cloned() else {
            return;
        };
        // A part that rotates as another one gets the direction of its axes, so that no angle between them remains.
        let coordinate = entry.coordinate.get_ref();
        let active = self.names.rig.coordinates.iter().position(|c| &c.name == coordinate);
        let same = if active.is_none() {
            self.find_same_rotation(&part)
        } else {
            None
        };
        if let Some(other) = same {
            part.to = self.axis_end_along(&part, other);
            if let Some(last) = self.parts.last_mut() {
                last.to = part.to;
            }
        }
        let carrier = part.parent.map(|parent| self.parts[parent].clone());
        let (plane, samples) = (self.plane, &self.samples);
        // Angle of the part relative to its carrier.
        let angle = |moment: &MotionSample| {
            let of = |part: &SubstitutionPart| {
                part.nominal_angle(&plane, samples) + part.rotation_angle(moment, &plane, samples)
            };
            of(&part) - carrier.as_ref().map_or(0.0, of)
        };
        let nominal = wrap_angle(angle(&samples.nominal));
        let mut expression = coordinate.clone();
        let carried = part
            .parent
            .map_or_else(RotationSum::default, |parent| self.rotations[parent].clone());
        let mut rotation = carried.plus(coordinate, 1);
        if let Some(k) = active {
            // Largest difference between the angle and the coordinate of the rig, for each sign.
            let strays = |sign: f64| {
                samples.largest(|moment| {
                    wrap_angle(angle(moment) - nominal - sign * (moment.state.q[k] - samples.nominal.state.q[k]))
                })
            };
            // The coordinate may count in either direction.
            let [ahead, back] = [1.0, -1.0].map(strays);
            if ahead.min(back) > angle_tolerance(self.names.rig, part.bodies[0]) {
                log.error(
                    source_span(0, &entry.coordinate.span()),
                    format!("`{coordinate}` of the rig is not the angle of `{}`", part.name),
                    "expected the coordinate of its joint",
                    "a name that the rig does not have gives a passive coordinate",
                );
            }
            // The angle as sign, coordinate and constant offset.
            let sign = if ahead <= back { 1.0 } else { -1.0 };
            let value = samples.nominal.state.q[k];
            let offset = wrap_angle(nominal - sign * value);
            expression = format!(
                "{}{coordinate}{}",
                if sign < 0.0 { "-" } else { "" },
                self.angle_offset(coordinate, offset)
            );
            rotation = carried.plus(coordinate, if sign < 0.0 { -1 } else { 1 });
            self.nominal.insert(coordinate.clone(), value);
            self.draft.coordinates.push(DraftCoordinate {
                name: coordinate.clone(),
                nominal: round_to_12_digits(value),
                passive: false,
            });
        } else if let Some(other) = same {
            rotation = self.rotation_of(other);
            expression = self.tied_angle(&part, other, coordinate, nominal, &carried);
        } else {
            self.nominal.insert(coordinate.clone(), nominal);
            // A passive coordinate is determined by the loops, so that its nominal value can be rounded.
            let nominal = (nominal * 1e6).round() / 1e6;
            self.draft.coordinates.push(DraftCoordinate {
                name: coordinate.clone(),
                nominal,
                passive: true,
            });
        }
        self.rotations.push(rotation);
        // Position of the joint in the carrier, or in the plane.
        let (on, local) = match &carrier {
            None => (
                "base".to_owned(),
                plane.plane_position(&self.samples.nominal.place(&part.joint[0])),
            ),
            Some(carrier) => (
                carrier.name.clone(),
                carrier.local_position(&part.joint[0], &plane, &self.samples),
            ),
        };
        let at = self.components(entry.at.get_ref(), &local);
        // The model has no gap at the joint, so that the part is shifted.
        if part.shift.norm() > ZERO {
            let says = format!(
                "is shifted by ({}, {}) m to `{}`, which changes no force",
                significant_digits(part.shift.x, 6),
                significant_digits(part.shift.y, 6),
                entry.at.get_ref()
            );
            self.report.add(2, &part.name, says, Vec::new());
        }
        self.draft.frames.push(DraftFrame {
            name: part.name.clone(),
            on,
            at,
            angle: expression,
            note: entry.note.clone().unwrap_or_default(),
        });
    }

    /// A constant angle after a coordinate, as an expression with its sign: empty, a multiple of pi/12, or a constant.
    pub(crate) fn angle_offset(&mut self, coordinate: &str, offset: f64) -> String {
        if offset.abs() < 1e-9 {
            return String::new();
        }
        // Multiples of 15 degrees are exact.
        let twelfths = offset / (std::f64::consts::PI / 12.0);
        if (twelfths - twelfths.round()).abs() < 1e-9 {
            let sign = if twelfths < 0.0 { '-' } else { '+' };
            return format!(" {sign} {}*pi/12", twelfths.round().abs());
        }
        let name = format!("{coordinate}_offset");
        self.draft
            .constants
            .add_value(&name, "rad", "from the rig's zero to the part's axis", &name, offset);
        format!(" + {name}")
    }

    /// Expressions of a point's components: zero, a constant of the plan, or a new constant.
    pub(crate) fn components(&mut self, point: &str, at: &Vector2<f64>) -> [String; 2] {
        let mut expressions = ["x", "y"].map(str::to_owned);
        for (axis, value) in expressions.iter_mut().zip([at.x, at.y]) {
            // The quantity for which a constant of the plan can stand, such as `A.x`.
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
                Some((name, constant)) => (name.get_ref().clone(), constant.note.clone().unwrap_or_default()),
                None => (own, String::new()),
            };
            // A constant can stand for several quantities; each is added once.
            let symbol = self.draft.constants.0.iter().find(|symbol| symbol.name == name);
            if symbol.is_none_or(|symbol| symbol.stands_for.iter().all(|(known, _)| known != &what)) {
                self.draft.constants.add_value(&name, "m", &note, &what, value);
            }
            *axis = name;
        }
        expressions
    }

    /// Adds the body of the last part, with symbols for mass, centre and inertia.
    pub(crate) fn body(&mut self, entry: &PlanPartEntry, log: &mut RigLog) {
        let Some(part) = self.parts.last() else {
            return;
        };
        // These groups are in the model now.
        self.used_groups
            .extend(entry.groups.get_ref().iter().map(|name| name.get_ref().clone()));
        let name = part.name.clone();
        // Exact values of the part, eq. (1).
        let whole = substitute(self.names.rig, part, &self.plane, &self.samples, &mut self.report);
        // Whether the plan leaves out the component of the centre across the axis.
        let drops = match entry.off_axis.as_ref().map(|s| s.get_ref().as_str()) {
            None | Some("keep") => false,
            Some("drop") => true,
            Some(_) => {
                let range = entry.off_axis.as_ref().map_or(0..0, toml::Spanned::span);
                log.error(
                    source_span(0, &range),
                    "the value of `off_axis` is unknown".to_owned(),
                    "expected `keep` or `drop`",
                    "",
                );
                false
            }
        };
        let about = |what: &str| format!("{what} of {}", entry.note.as_deref().unwrap_or(&name));
        // Symbols with their values; parts may share a symbol.
        let [mass, centre, across, inertia] = symbols_of(entry);
        let draft = &mut self.draft;
        draft.masses.add_value(&mass, "kg", &about("mass"), &name, whole.mass);
        draft.inertias.add_value(
            &inertia,
            "kg m^2",
            &about("inertia about the centre of mass"),
            &name,
            whole.inertia,
        );
        // Components of the centre that are zero get no symbol.
        let mut components = ["0", "0"].map(str::to_owned);
        if whole.centre.x.abs() > ZERO {
            draft.centres.add_value(
                &centre,
                "m",
                &about("centre of mass along the axis"),
                &name,
                whole.centre.x,
            );
            components[0] = centre;
        }
        if whole.centre.y.abs() > ZERO && !drops {
            draft.centres.add_value(
                &across,
                "m",
                &about("centre of mass across the axis"),
                &name,
                whole.centre.y,
            );
            components[1] = across;
        }
        // The exact values go into the report with the residuals of eq. (1).
        let groups: Vec<&str> = entry
            .groups
            .get_ref()
            .iter()
            .map(|group| group.get_ref().as_str())
            .collect();
        let says = format!(
            "= {}: mass {} kg, centre ({}, {}) m, inertia {} kg m^2",
            groups.join(" + "),
            significant_digits(whole.mass, 8),
            significant_digits(whole.centre.x, 8),
            significant_digits(
                if whole.centre.y.abs() > ZERO {
                    whole.centre.y
                } else {
                    0.0
                },
                8
            ),
            significant_digits(whole.inertia, 8)
        );
        self.part_totals.push((says, whole));
        draft.parts.push(DraftPart {
            name: format!("{name}_body"),
            on: name,
            mass,
            centre: components,
            inertia,
        });
    }

    /// Reports the residuals of eq. (1) for every part. This is possible only when all parts that share a symbol have
    /// added their values.
    pub(crate) fn check_equation_1(&mut self) {
        let draft = &self.draft;
        for (part, (says, whole)) in draft.parts.iter().zip(&self.part_totals) {
            let value = |expression: &String| match expression.as_str() {
                "0" => 0.0,
                name => draft.centres.value(name),
            };
            let said = PlanarBody {
                mass: draft.masses.value(&part.mass),
                centre: Vector2::new(value(&part.centre[0]), value(&part.centre[1])),
                inertia: draft.inertias.value(&part.inertia),
            };
            self.report.add(2, &part.on, says, part_residuals(whole, &said));
        }
    }

    /// Step 2, lumped masses: replaces groups by point masses in equal shares.
    pub(crate) fn lumped_masses(&mut self, log: &mut RigLog) {
        let plan = self.names.plan;
        for entry in &plan.lumped_mass {
            let bodies = self.names.bodies(entry.groups.get_ref(), &mut self.used_groups, log);
            let points: Vec<(String, BodyAnchor)> = entry
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
                    source_span(0, &entry.at.span()),
                    "this mass has no point".to_owned(),
                    "expected at least one point",
                    "",
                );
                continue;
            }
            let name = entry.name.get_ref();
            // The mass of the groups, with a report of what the point masses neglect.
            let anchors: Vec<BodyAnchor> = points.iter().map(|(_, anchor)| *anchor).collect();
            let (plane, samples) = (&self.plane, &self.samples);
            let mass = lump_mass(
                self.names.rig,
                name,
                &bodies,
                &anchors,
                plane,
                samples,
                &mut self.report,
            );
            let symbol = entry.symbol.clone().unwrap_or_else(|| format!("m_{name}"));
            let note = entry.note.clone().unwrap_or_else(|| format!("mass of {name}"));
            self.draft.masses.add_value(&symbol, "kg", &note, name, mass);
            // Equal shares of the mass at each point.
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

    /// Name and anchor of a point of the model; adds the point to the draft at its first use. None after a fault.
    pub(crate) fn model_point(&mut self, name: &PlanName, log: &mut RigLog) -> Option<(String, BodyAnchor)> {
        let anchor = self.names.point(name, log)?;
        // The part that carries the point, and the position there.
        let part = self.names.owner(&self.parts, &anchor, name, log).ok()?;
        let contact = self.contact_place(&anchor, part);
        self.declare(name.get_ref(), contact);
        Some((name.get_ref().clone(), anchor))
    }

    /// The position of an anchor in the frame of its part, or in the plane.
    pub(crate) fn contact_place(&self, anchor: &BodyAnchor, part: Option<usize>) -> ContactPlace {
        let at = match part {
            None => self.plane.plane_position(&self.samples.nominal.place(anchor)),
            Some(part) => self.parts[part].local_position(anchor, &self.plane, &self.samples),
        };
        ContactPlace { part, at }
    }

    /// Adds a point to the draft, unless it is there already.
    pub(crate) fn declare(&mut self, name: &str, contact: ContactPlace) {
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
}

/// Symbols of a part: mass, centre along and across its axis, inertia. Without a name in the plan they are made from
/// the part's name.
fn symbols_of(entry: &PlanPartEntry) -> [String; 4] {
    let symbols = &entry.symbols;
    let all = [
        (&symbols.mass, "m"),
        (&symbols.centre, "c"),
        (&symbols.off_axis, "e"),
        (&symbols.inertia, "I"),
    ];
    all.map(|(given, prefix)| {
        given
            .clone()
            .unwrap_or_else(|| format!("{prefix}_{}", entry.name.get_ref()))
    })
}

/// An angle between -pi and pi.
fn wrap_angle(angle: f64) -> f64 {
    let turn = 2.0 * std::f64::consts::PI;
    angle - turn * (angle / turn).round()
}
