//! Generates a plan for a rig: every body becomes a part, connected by the first revolute joint that reaches it from
//! the base. The remaining joints close loops.
//!
//! The plan is written as the text of a plan file, with points that are added to a copy of the rig. It is then read
//! like any plan.

use std::fmt::Write as _;

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, Remedy};
use modelmill_rig::{BodyAnchor, Rig, RigPoint};
use nalgebra::Vector3;

use crate::plan::{ReductionPlan, plan};

/// Generates a plan in which every body is a separate part.
///
/// Fails if a body cannot be reached by revolute joints; such rigs need a plan written by hand.
pub fn default_plan(rig: &Rig) -> Result<ReductionPlan, Message> {
    // Points are added to a copy of the rig.
    let mut rig = rig.clone();
    let hinges: Vec<(usize, [BodyAnchor; 2])> = (0..rig.joints.len())
        .filter_map(|j| rig.hinge(j).map(|anchors| (j, anchors)))
        .collect();
    // All joints must be revolute.
    if let Some(other) = (0..rig.joints.len()).find(|j| rig.hinge(*j).is_none()) {
        return Err(message!(
            "`{}` is not a revolute joint, so this rig needs a plan ({}), in which parts and lumped masses replace the \
             bodies at other joints",
            rig.joints[other].name,
            Remedy::option(OptionName::Plan)
        ));
    }
    // Tables of the parts, and those of the loops, which stand last.
    let mut text = format!("schema = 1\nname = \"{}_reduced\"\n", rig.name);
    // The plane z = 0 is the default; mechanisms in another plane have the axes of their joints along its normal.
    if let Some(plane) = tilted_plane(&rig) {
        let _ = writeln!(text, "\n[plane]\n{plane}");
    }
    let mut loops = String::new();
    let mut carried = vec![false; rig.bodies.len()];
    let is_carried = |carried: &[bool], body: Option<usize>| body.is_none_or(|body| carried[body]);
    // Grow the tree from the base: take the next joint with at least one end on a body that is already carried.
    let mut waiting = hinges.clone();
    while let Some(next) = waiting
        .iter()
        .position(|(_, [a, b])| is_carried(&carried, a.body) || is_carried(&carried, b.body))
    {
        let next = choose_joint(&rig, &waiting, &carried, next);
        let (joint, [a, b]) = waiting.remove(next);
        let name = rig.joints[joint].name.clone();
        if is_carried(&carried, a.body) && is_carried(&carried, b.body) {
            // Both ends are in the tree already, so this joint closes a loop.
            let ends = [a, b].map(|anchor| add_point(&mut rig, &name, anchor));
            let _ = writeln!(
                loops,
                "\n[[loop]]\nname = \"{name}\"\njoins = [\"{}\", \"{}\"]",
                ends[0], ends[1]
            );
            continue;
        }
        // The end that is carried already is on the carrier, the other one on the new part.
        let (at, from) = if is_carried(&carried, a.body) { (a, b) } else { (b, a) };
        let Some(body) = from.body else { continue };
        carried[body] = true;
        // The part with its joint, the end of its axis and its coordinate.
        let end = far_end(&rig, &hinges, body, &from.at);
        let points = [at, from, BodyAnchor { at: end, ..from }].map(|anchor| add_point(&mut rig, &name, anchor));
        let part = &rig.bodies[body].name;
        let on = at.body.map_or("base", |carrier| rig.bodies[carrier].name.as_str());
        let coordinate = rig
            .coordinate_of_joint(joint)
            .map_or(name, |c| rig.coordinates[c].name.clone());
        let _ = writeln!(
            text,
            "\n[[part]]\nname = \"{part}\"\ngroups = [\"{part}\"]\non = \"{on}\"\nat = \"{}\"\nfrom = \"{}\"\nto = \
             \"{}\"\ncoordinate = \"{coordinate}\"",
            points[0], points[1], points[2]
        );
    }
    // Bodies that no joint reaches.
    if let Some(body) = carried.iter().position(|reached| !reached) {
        return Err(message!(
            "`{}` is not connected to the base by revolute joints",
            rig.bodies[body].name
        ));
    }
    text.push_str(&loops);
    // Read the text like the file of a plan.
    let mut plan = plan("the plan generated for this rig", &text).map_err(|failure| failure.render(false))?;
    plan.rig = Some(Box::new(rig));
    Ok(plan)
}

/// The plane of motion as keys of a plan, if its normal is not z of the base.
fn tilted_plane(rig: &Rig) -> Option<String> {
    let plane = crate::propose::motion_plane(rig)?;
    let [normal, x] = [plane.normal, plane.x].map(|v| format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z));
    (plane.normal != Vector3::z()).then(|| format!("normal = {normal}\nx = {x}"))
}

/// The next joint of a coordinate that adds a body to the tree, else `next`. Coordinates come first, in whichever order
/// the joints stand: parts that move alike then share them.
fn choose_joint(rig: &Rig, waiting: &[(usize, [BodyAnchor; 2])], carried: &[bool], next: usize) -> usize {
    let is_carried = |anchor: &BodyAnchor| anchor.body.is_none_or(|body| carried[body]);
    let of_coordinate = waiting
        .iter()
        .position(|(joint, [a, b])| is_carried(a) != is_carried(b) && rig.coordinate_of_joint(*joint).is_some());
    of_coordinate.unwrap_or(next)
}

/// The end of a body's longitudinal axis: its farthest other joint, else its centre of mass, else a point along x.
fn far_end(rig: &Rig, hinges: &[(usize, [BodyAnchor; 2])], body: usize, from: &Vector3<f64>) -> Vector3<f64> {
    // Other joints on the body.
    let here = hinges
        .iter()
        .flat_map(|(_, anchors)| anchors)
        .filter(|anchor| anchor.body == Some(body));
    let candidates = here.map(|anchor| anchor.at);
    let farthest = candidates.max_by(|a, b| (a - from).norm().total_cmp(&(b - from).norm()));
    let is_apart = |place: &Vector3<f64>| (place - from).norm() > 1e-6;
    let centre = rig.bodies[body].centre;
    farthest
        .filter(is_apart)
        .or(Some(centre).filter(is_apart))
        .unwrap_or(from + Vector3::x())
}

/// The name of the point at an anchor; adds a new point if there is none.
fn add_point(rig: &mut Rig, stem: &str, anchor: BodyAnchor) -> String {
    if let Some(point) = rig.points.iter().find(|point| point.anchor == anchor) {
        return point.name.clone();
    }
    // The first number that gives a free name.
    let mut n = 1;
    let mut name = format!("{stem}_{n}");
    while rig.points.iter().any(|point| point.name == name) {
        n += 1;
        name = format!("{stem}_{n}");
    }
    rig.points.push(RigPoint {
        name: name.clone(),
        anchor,
    });
    name
}
