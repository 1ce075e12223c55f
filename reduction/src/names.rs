//! Resolves the names of a plan in its rig: bodies, groups, points and parts. Names go in, indices and anchors come
//! out; all faults are collected in a log.

use modelmill_rig::{BodyAnchor, Rig, RigLog, source_span};

use crate::part::SubstitutionPart;
use crate::plan::{PlanEntry, PlanName};

/// A name that does not exist; the log has the fault.
pub(crate) struct UnknownName;

/// Names that a plan may use.
pub(crate) struct PlanNames<'a> {
    /// The rig.
    pub(crate) rig: &'a Rig,
    /// The plan.
    pub(crate) plan: &'a PlanEntry,
    /// Groups with the indices of their bodies; a body without a group is a group by itself.
    pub(crate) groups: Vec<(String, Vec<usize>)>,
}

impl<'a> PlanNames<'a> {
    /// Resolves the groups of a plan. Reports bodies that do not exist or are in two groups.
    pub(crate) fn new(rig: &'a Rig, plan: &'a PlanEntry, log: &mut RigLog) -> Self {
        let bodies: Vec<&str> = rig.bodies.iter().map(|body| body.name.as_str()).collect();
        let mut groups: Vec<(String, Vec<usize>)> = Vec::new();
        let mut taken = vec![false; bodies.len()];
        // Groups of the plan; a body belongs to one group at most.
        for group in &plan.group {
            let mut members = Vec::new();
            for name in &group.bodies {
                match bodies.iter().position(|body| body == name.get_ref()) {
                    None => log.unknown_name(0, name, "body of the rig", &bodies),
                    Some(at) if taken[at] => report_duplicate(name, "group", log),
                    Some(at) => {
                        taken[at] = true;
                        members.push(at);
                    }
                }
            }
            // A group without a valid body was reported already.
            if !members.is_empty() {
                groups.push((group.name.get_ref().clone(), members));
            }
        }
        // Bodies without a group are groups with their own names.
        for (at, body) in bodies.iter().enumerate().filter(|(at, _)| !taken[*at]) {
            groups.push(((*body).to_owned(), vec![at]));
        }
        Self { rig, plan, groups }
    }

    /// The bodies of some groups. Adds the groups to `used`, and reports groups that were used before or do not exist.
    pub(crate) fn bodies(&self, names: &[PlanName], used: &mut Vec<String>, log: &mut RigLog) -> Vec<usize> {
        // Each group may be used once, since its mass would be counted twice otherwise.
        let known: Vec<&str> = self.groups.iter().map(|(name, _)| name.as_str()).collect();
        let mut bodies = Vec::new();
        for name in names {
            match self.groups.iter().find(|(group, _)| group == name.get_ref()) {
                None => log.unknown_name(0, name, "group", &known),
                Some(_) if used.contains(name.get_ref()) => {
                    report_duplicate(name, "part or lumped mass", log);
                }
                Some((group, members)) => {
                    used.push(group.clone());
                    bodies.extend(members);
                }
            }
        }
        bodies
    }

    /// A point by its name in `[points]` of the plan or, if it is not there, in the rig.
    pub(crate) fn point(&self, name: &PlanName, log: &mut RigLog) -> Option<BodyAnchor> {
        // A name of the plan may stand for a point with another name in the rig.
        let renamed = self
            .plan
            .points
            .iter()
            .find(|(model, _)| model.get_ref() == name.get_ref());
        let wanted = renamed.map_or(name, |(_, rig)| rig);
        let found = find_rig_point(self.rig, wanted.get_ref());
        if found.is_none() {
            let known: Vec<&str> = self.rig.points.iter().map(|point| point.name.as_str()).collect();
            log.unknown_name(0, wanted, "point of the rig", &known);
        }
        found
    }

    /// The name in the model of a point of the rig; none if the point has no name.
    pub(crate) fn point_name(&self, anchor: &BodyAnchor) -> Option<String> {
        let is_here = |name: &str| find_rig_point(self.rig, name).as_ref() == Some(anchor);
        let renamed = self.plan.points.iter().find(|(_, rig)| is_here(rig.get_ref()));
        // The name in the rig can be used only if no other point of the model has it.
        let free = |name: &str| self.plan.points.keys().all(|model| model.get_ref() != name);
        renamed.map(|(model, _)| model.get_ref().clone()).or_else(|| {
            let own = self
                .rig
                .points
                .iter()
                .find(|point| &point.anchor == anchor && free(&point.name));
            own.map(|point| point.name.clone())
        })
    }

    /// The index of the part of a point; none for the base. Only points of leading bodies are in the model.
    pub(crate) fn owner(
        &self,
        parts: &[SubstitutionPart],
        anchor: &BodyAnchor,
        name: &PlanName,
        log: &mut RigLog,
    ) -> Result<Option<usize>, UnknownName> {
        // Points of the base need no part.
        let Some(body) = anchor.body else {
            return Ok(None);
        };
        let part = parts.iter().position(|part| part.bodies.first() == Some(&body));
        if part.is_none() {
            let leads: Vec<&str> = parts
                .iter()
                .filter_map(|part| part.bodies.first().map(|lead| self.rig.bodies[*lead].name.as_str()))
                .collect();
            log.error(
                source_span(0, &name.span()),
                format!(
                    "`{}` is on `{}`, which is not the leading body of a part",
                    name.get_ref(),
                    self.rig.bodies[body].name
                ),
                "expected a point of the base or of a leading body",
                &format!("leading bodies are {}", leads.join(", ")),
            );
        }
        part.map(Some).ok_or(UnknownName)
    }
}

/// A point of the rig by its name; or `JOINT@BODY`, the place of a revolute joint on one of its bodies or on `base`; or
/// `centre@BODY`, the centre of mass of a body.
pub(crate) fn find_rig_point(rig: &Rig, name: &str) -> Option<BodyAnchor> {
    if let Some(point) = rig.points.iter().find(|point| point.name == name) {
        return Some(point.anchor);
    }
    let (what, on) = name.split_once('@')?;
    let body = match on {
        "base" => None,
        on => Some(rig.bodies.iter().position(|body| body.name == on)?),
    };
    if let Some(joint) = rig.joints.iter().position(|joint| joint.name == what) {
        return rig.hinge(joint)?.into_iter().find(|anchor| anchor.body == body);
    }
    let centre = rig.bodies.get(body?)?.centre;
    (what == "centre").then_some(BodyAnchor { body, at: centre })
}

/// Reports a body or group that is used twice.
fn report_duplicate(name: &PlanName, what: &str, log: &mut RigLog) {
    log.error(
        source_span(0, &name.span()),
        format!("`{}` is in more than one {what}", name.get_ref()),
        "this is the second time",
        "its mass would be counted twice; delete one of them",
    );
}
