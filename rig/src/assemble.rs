//! Assembles a rig from merged entries: names are resolved and numbers are checked. All errors are collected.

use modelmill_spec::Diagnostic;
use nalgebra::{Matrix3, Vector3};

use crate::assemble_sensors::channels;
use crate::effect::RigEffect;
use crate::effect_by_name::EffectPart;
use crate::file::{
    BodyEntry, LengthEntry, RigCoordinateEntry, RigDriveEntry, RigEffectEntry, RigEntry, RigJointEntry,
    RigLumpedMassEntry, RigName,
};
use crate::joint;
use crate::load::source_span;
use crate::log::{FileItem, RigLog, above_zero, not_negative, vector};
use crate::merge::MergedRig;
use crate::pair::{BodyAnchor, PairFunction, PairQuantity};
use crate::pose::BodyPose;
use crate::rig::{Rig, RigBody, RigCoordinate, RigDrive, RigJoint, RigLumpedMass, RigPoint};
use crate::sensor::RigSensors;

/// Assembles the rig of a chain of files, the rig's own first, then those that it extends.
///
/// Fails with all errors, in the order of their places.
pub(crate) fn assemble(chain: Vec<(usize, RigEntry)>) -> Result<Rig, Vec<Diagnostic>> {
    let mut log = RigLog::default();
    // The last file of the chain is the base of the others.
    let mut files = chain.into_iter().rev();
    let Some((file, first)) = files.next() else {
        return Err(Vec::new());
    };
    let mut merged = MergedRig::new(file, first, &mut log);
    for (file, entry) in files {
        merged.extend(MergedRig::new(file, entry, &mut log));
    }
    let rig = build(&merged, &mut log);
    if log.0.is_empty() {
        Ok(rig)
    } else {
        // In the order of the files, and of the places in each file.
        log.0
            .sort_by_key(|found| found.span.map(|span| (span.file, span.start)));
        Err(log.0)
    }
}

/// The rig of merged entries, with errors in the log.
fn build(merged: &MergedRig, log: &mut RigLog) -> Rig {
    // Bodies first, since points name them; joints, coordinates, drives and effects then name what precedes.
    let mut rig = Rig {
        name: merged.name.clone(),
        title: merged.title.clone(),
        gravity: merged
            .gravity
            .as_ref()
            .map_or_else(Vector3::zeros, |g| vector(g.file, Some(&g.entry), log)),
        bodies: merged.bodies.iter().map(|b| body(b, log)).collect(),
        points: Vec::new(),
        lumped_masses: Vec::new(),
        joints: Vec::new(),
        coordinates: Vec::new(),
        drives: Vec::new(),
        effects: Vec::new(),
        sensors: RigSensors::default(),
        seed: merged.seed.unwrap_or(0),
        gap_tolerance: 0.0,
    };
    for point in &merged.points {
        // A point on an unknown body is attached to the base, so that its name still exists.
        let on = find_body(&rig, point.file, &point.entry.on, log);
        let at = vector(point.file, Some(&point.entry.at), log);
        rig.points.push(RigPoint {
            name: point.entry.name.get_ref().clone(),
            anchor: BodyAnchor {
                body: on.unwrap_or(None),
                at,
            },
        });
    }
    for mass in &merged.lumped_masses {
        rig.lumped_masses.extend(lumped_mass(&rig, mass, log));
    }
    for entry in &merged.joints {
        let joint = joint(&rig, entry, log);
        rig.joints.push(joint);
    }
    for entry in &merged.coordinates {
        coordinate(&mut rig, entry, log);
    }
    for entry in &merged.drives {
        drive(&mut rig, entry, log);
    }
    check_columns(merged, log);
    for entry in &merged.effects {
        rig.effects.extend(effect(&rig, entry, log));
    }
    rig.sensors = RigSensors {
        rate: merged
            .rate
            .as_ref()
            .map(|rate| above_zero(rate.file, &rate.entry, "a sampling rate", log)),
        // Without encoders a recording contains exact derivatives, unless the file states otherwise.
        derivatives: merged.derivatives.unwrap_or(merged.encoders.is_empty()),
        encoders: channels(
            &merged.encoders,
            "coordinate",
            merged.coordinates.iter().map(|c| &c.entry.name),
            log,
        ),
        force_sensors: channels(
            &merged.force_sensors,
            "drive",
            merged.drives.iter().map(|d| &d.entry.name),
            log,
        ),
    };
    rig
}

/// Checks that a rig has coordinates, as many drives, and columns with different names.
fn check_columns(merged: &MergedRig, log: &mut RigLog) {
    let (n_coordinates, n_drives) = (merged.coordinates.len(), merged.drives.len());
    // One drive per degree of freedom; the error is placed at the last entry.
    if n_coordinates == 0 || n_drives != n_coordinates {
        let drives = merged.drives.last().map(|d| (d.file, d.entry.name.span()));
        let last = drives.or(merged.coordinates.last().map(|c| (c.file, c.entry.name.span())));
        let (file, range) = last.unwrap_or((0, 0..0));
        log.error(
            source_span(file, &range),
            format!("this rig has {n_coordinates} coordinate(s) and {n_drives} drive(s)"),
            "",
            "give one `[[coordinate]]` and one `[[drive]]` per degree of freedom",
        );
    }
    // Columns of a recording: time, each coordinate with its derivatives, and each drive.
    let mut columns = vec!["t".to_owned()];
    let coordinates = merged.coordinates.iter().map(|c| (c.file, &c.entry.name, true));
    let drives = merged.drives.iter().map(|d| (d.file, &d.entry.name, false));
    for (file, name, is_coordinate) in coordinates.chain(drives) {
        let suffixes: &[&str] = if is_coordinate { &["", "_d", "_dd"] } else { &[""] };
        for suffix in suffixes {
            let column = format!("{}{suffix}", name.get_ref());
            if columns.contains(&column) {
                log.error(
                    source_span(file, &name.span()),
                    format!("two columns of the recording would have the name `{column}`"),
                    "",
                    "choose another name",
                );
            }
            columns.push(column);
        }
    }
}

/// A body; its inertia must be physically possible.
fn body(item: &FileItem<BodyEntry>, log: &mut RigLog) -> RigBody {
    let (file, entry) = (item.file, &item.entry);
    let inertia = entry.inertia.as_ref().map_or_else(Matrix3::zeros, |spanned| {
        let i = spanned.get_ref();
        let matrix = Matrix3::new(i.xx, i.xy, i.xz, i.xy, i.yy, i.yz, i.xz, i.yz, i.zz);
        // Eigenvalues are computed for finite entries only.
        let moments = if matrix.iter().all(|x| x.is_finite()) {
            matrix.symmetric_eigenvalues()
        } else {
            Vector3::repeat(f64::NAN)
        };
        // A planar model has zz alone, which no real body has; this is accepted where only zz has an effect.
        if moments.min().is_nan() || moments.min() < -1e-9 * moments.amax() {
            log.error(
                source_span(file, &spanned.span()),
                format!(
                    "this inertia is not physically possible: its principal moments are {:.4}, {:.4}, {:.4}",
                    moments[0], moments[1], moments[2]
                ),
                "expected principal moments that are not below zero",
                "xy, xz and yz are the entries of the matrix: the negative products of inertia",
            );
        }
        matrix
    });
    // Without `at` and `rpy` the body's frame is the base frame in the nominal configuration.
    RigBody {
        name: entry.name.get_ref().clone(),
        nominal: BodyPose::from_xyz_rpy(
            vector(file, entry.at.as_ref(), log),
            vector(file, entry.rpy.as_ref(), log),
        ),
        mass: not_negative(file, entry.mass.as_ref(), "a mass", log),
        centre: vector(file, entry.centre.as_ref(), log),
        inertia,
    }
}

/// A name that does not exist, which has been reported.
struct UnknownBody;

/// Index of a body; `None` is the base.
fn find_body(rig: &Rig, file: usize, name: &RigName, log: &mut RigLog) -> Result<Option<usize>, UnknownBody> {
    if name.get_ref() == "base" {
        return Ok(None);
    }
    let found = rig.bodies.iter().position(|body| &body.name == name.get_ref());
    if found.is_none() {
        let mut known = vec!["base"];
        known.extend(rig.bodies.iter().map(|body| body.name.as_str()));
        log.unknown_name(file, name, "body", &known);
    }
    found.map(Some).ok_or(UnknownBody)
}

/// The place of a named point; reports an unknown name.
fn find_point(rig: &Rig, file: usize, name: &RigName, log: &mut RigLog) -> Option<BodyAnchor> {
    let found = rig.points.iter().find(|point| &point.name == name.get_ref());
    if found.is_none() {
        let known: Vec<&str> = rig.points.iter().map(|point| point.name.as_str()).collect();
        log.unknown_name(file, name, "point", &known);
    }
    found.map(|point| point.anchor)
}

/// Index of a joint with exactly one coordinate; reports any other.
fn find_joint(rig: &Rig, file: usize, name: &RigName, log: &mut RigLog) -> Option<usize> {
    let found = rig.joints.iter().position(|joint| &joint.name == name.get_ref());
    match found {
        None => {
            let known: Vec<&str> = rig.joints.iter().map(|joint| joint.name.as_str()).collect();
            log.unknown_name(file, name, "joint", &known);
            None
        }
        Some(at) if rig.joints[at].motion.is_none() => {
            log.error(
                source_span(file, &name.span()),
                format!("the joint `{}` does not have exactly one coordinate", name.get_ref()),
                "expected a revolute or a prismatic joint",
                "",
            );
            None
        }
        found => found,
    }
}

/// A lumped mass, whose two points must be on one body.
fn lumped_mass(rig: &Rig, item: &FileItem<RigLumpedMassEntry>, log: &mut RigLog) -> Option<RigLumpedMass> {
    let (file, entry) = (item.file, &item.entry);
    let mass = not_negative(file, Some(&entry.mass), "a mass", log);
    let at = find_point(rig, file, &entry.at, log)?;
    let moment_at = match &entry.moment_at {
        None => at,
        Some(name) => find_point(rig, file, name, log)?,
    };
    // The moment of a lumped mass may act at another point, but only on the same body.
    if let Some(name) = entry.moment_at.as_ref().filter(|_| moment_at.body != at.body) {
        log.error(
            source_span(file, &name.span()),
            format!("`{}` is on another body than `{}`", name.get_ref(), entry.at.get_ref()),
            "expected a point of the same body",
            "the mass belongs to one body, in the balance of forces and in the balance of moments",
        );
    }
    Some(RigLumpedMass {
        mass,
        at,
        moment_at: moment_at.at,
    })
}

/// A joint with its equations and its coordinate; without equations where an error has been reported.
fn joint(rig: &Rig, item: &FileItem<RigJointEntry>, log: &mut RigLog) -> RigJoint {
    let (file, entry) = (item.file, &item.entry);
    let mut joint = RigJoint {
        name: entry.name.get_ref().clone(),
        equations: Vec::new(),
        motion: None,
    };
    // Each error returns the joint without equations, so that its name still exists.
    let Some(kind) = joint::RigJointKind::from_name(entry.kind.get_ref()) else {
        log.unknown_name(file, &entry.kind, "kind of joint", &joint::RigJointKind::NAMES);
        return joint;
    };
    let [one, two] = entry.between.get_ref();
    let bodies = (find_body(rig, file, one, log), find_body(rig, file, two, log));
    // Without `axis` the joint's axis is z of the base frame.
    let axis = entry
        .axis
        .as_ref()
        .map_or_else(Vector3::z, |axis| vector(file, Some(axis), log));
    if !(axis.norm() > 0.0 && axis.norm().is_finite()) {
        let range = entry.axis.as_ref().map_or(0..0, toml::Spanned::span);
        log.error(
            source_span(file, &range),
            "this axis has no direction".to_owned(),
            "expected a vector other than zero",
            "",
        );
        return joint;
    }
    let (Ok(first), Ok(second)) = bodies else {
        return joint;
    };
    if first == second {
        let range = entry.between.span();
        log.error(
            source_span(file, &range),
            "this joint connects a body to itself".to_owned(),
            "expected two bodies",
            "",
        );
        return joint;
    }
    let Some([from, to]) = joint_anchors(rig, file, entry, [first, second], log) else {
        return joint;
    };
    // Directions of the equations are those of the nominal configuration, in the frames of both bodies.
    let nominal = |body: Option<usize>| body.map_or_else(BodyPose::identity, |b| rig.bodies[b].nominal);
    let parts = joint::equations(kind, from, to, &axis.normalize(), [nominal(first), nominal(second)]);
    joint.equations = parts.0;
    joint.motion = parts.1;
    joint
}

/// The place of a joint on each of its bodies.
fn joint_anchors(
    rig: &Rig,
    file: usize,
    entry: &RigJointEntry,
    bodies: [Option<usize>; 2],
    log: &mut RigLog,
) -> Option<[BodyAnchor; 2]> {
    // A place in the base frame becomes a place in the frame of a body, both in the nominal configuration.
    let nominal = |body: Option<usize>| body.map_or_else(BodyPose::identity, |b| rig.bodies[b].nominal);
    let on = |body: Option<usize>, p_W: Vector3<f64>| {
        let pose = nominal(body);
        BodyAnchor {
            body,
            at: pose.q_WB.inverse() * (p_W - pose.p_WB_W),
        }
    };
    let whole = source_span(file, &entry.name.span());
    match (&entry.at, &entry.points) {
        // The joint has one place in the base frame.
        (Some(at), None) => {
            let at = vector(file, Some(at), log);
            Some(bodies.map(|body| on(body, at)))
        }
        // The joint has a point of one body, which gives the place on the other, or a point of each body.
        (None, Some(points)) => {
            let names = points.get_ref();
            let anchors: Vec<BodyAnchor> = names
                .iter()
                .filter_map(|name| find_point(rig, file, name, log))
                .collect();
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
                        source_span(file, &points.span()),
                        "these points are not on the bodies of this joint".to_owned(),
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
                "the place of this joint is missing, or stated twice".to_owned(),
                "expected either `at` or `points`",
                "`at = [x, y, z]` is in the base frame, nominal configuration; `points` names points of its bodies",
            );
            None
        }
    }
}

/// The distance of two points of different bodies.
fn length(rig: &Rig, file: usize, entry: &LengthEntry, log: &mut RigLog) -> Option<PairFunction> {
    let from = find_point(rig, file, &entry.from, log);
    let to = find_point(rig, file, &entry.to, log);
    let pair = PairFunction {
        from: from?,
        to: to?,
        shape: PairQuantity::Distance,
    };
    // Two points of one body never move relative to each other.
    if pair.from.body == pair.to.body {
        log.error(
            source_span(file, &entry.to.span()),
            "the distance of two points of one body never changes".to_owned(),
            "expected a point of another body",
            "",
        );
        return None;
    }
    Some(pair)
}

/// Adds a coordinate, and sets its joint's nominal value.
fn coordinate(rig: &mut Rig, item: &FileItem<RigCoordinateEntry>, log: &mut RigLog) {
    let (file, entry) = (item.file, &item.entry);
    let nominal = entry.nominal.as_ref().map(|n| *n.get_ref());
    // Only a joint has a nominal value of its own.
    if let Some(wrong) = entry
        .nominal
        .as_ref()
        .filter(|n| !n.get_ref().is_finite() || entry.joint.is_none())
    {
        log.error(
            source_span(file, &wrong.span()),
            "this nominal value is not valid".to_owned(),
            "expected a finite value, for the coordinate of a joint; a length is determined by its points",
            "",
        );
    }
    // A coordinate measures either a joint or the distance of two points.
    let measures = match (&entry.joint, &entry.length) {
        (Some(name), None) => find_joint(rig, file, name, log).and_then(|joint| {
            let poses: Vec<BodyPose> = rig.bodies.iter().map(|body| body.nominal).collect();
            let motion = rig.joints[joint].motion.as_mut()?;
            // The reference of the joint is shifted so that its value in the nominal configuration is the stated one.
            if let Some(nominal) = nominal {
                joint::set_nominal(motion, nominal, &poses);
            }
            Some(*motion)
        }),
        (None, Some(points)) => length(rig, file, points, log),
        _ => {
            report_unclear_kind(file, &entry.name, "`joint` and `length`", log);
            None
        }
    };
    rig.coordinates.extend(measures.map(|measures| RigCoordinate {
        name: entry.name.get_ref().clone(),
        measures,
    }));
}

/// Adds a drive.
fn drive(rig: &mut Rig, item: &FileItem<RigDriveEntry>, log: &mut RigLog) {
    let (file, entry) = (item.file, &item.entry);
    // A drive acts either in a joint or along the distance of two points.
    let measures = match (&entry.joint, &entry.linear) {
        (Some(name), None) => find_joint(rig, file, name, log).and_then(|joint| rig.joints[joint].motion),
        (None, Some(points)) => length(rig, file, points, log),
        _ => {
            report_unclear_kind(file, &entry.name, "`joint` and `linear`", log);
            None
        }
    };
    rig.drives.extend(measures.map(|measures| RigDrive {
        name: entry.name.get_ref().clone(),
        measures,
    }));
}

/// Reports an entry with none or several of the keys that define it.
fn report_unclear_kind(file: usize, name: &RigName, keys: &str, log: &mut RigLog) {
    log.error(
        source_span(file, &name.span()),
        format!("the definition of `{}` is missing, or stated twice", name.get_ref()),
        &format!("expected exactly one of {keys}"),
        "",
    );
}

/// An effect; reports its errors at the places of the entry.
fn effect(rig: &Rig, item: &FileItem<RigEffectEntry>, log: &mut RigLog) -> Option<RigEffect> {
    let (file, entry) = (item.file, &item.entry);
    let at: Vec<&str> = entry.at.get_ref().iter().map(|name| name.get_ref().as_str()).collect();
    let values: Vec<(&str, f64)> = entry
        .values
        .iter()
        .map(|(name, value)| (name.get_ref().as_str(), *value.get_ref()))
        .collect();
    // Programs construct effects through the same function; here its faults get their places in the file.
    let faults = match rig.effect(entry.kind.get_ref(), &at, &values) {
        Ok(effect) => return Some(effect),
        Err(faults) => faults,
    };
    for found in faults {
        let range = match &found.part {
            EffectPart::Kind => entry.kind.span(),
            EffectPart::Places => entry.at.span(),
            EffectPart::Place(i) => entry.at.get_ref()[*i].span(),
            EffectPart::Value(symbol) => {
                let named = entry.values.keys().find(|name| name.get_ref() == symbol);
                named.map_or(entry.kind.span(), toml::Spanned::span)
            }
        };
        log.error(source_span(file, &range), found.message, &found.expected, &found.help);
    }
    None
}
