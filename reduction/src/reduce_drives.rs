//! Loops and step 4 of the reduction: adds loops, drives and effects to the draft, and checks that no group of the rig
//! is missing.

use modelmill_rig::{RigLog, source_span};

use crate::drive::check_linear;
use crate::plan::PlanName;
use crate::planar_draft::DraftEffect;
use crate::reduce::ReductionState;
use crate::report::AssumptionSize;
use crate::tolerance::distance_tolerance;
use crate::write::significant_digits;

impl ReductionState<'_> {
    /// Adds the loops of the plan. Reports points that do not coincide along the samples as faults.
    pub(crate) fn loops(&mut self, log: &mut RigLog) {
        let plan = self.names.plan;
        for entry in &plan.loops {
            let [one, two] = &entry.joins;
            if self.is_generated && self.is_implied_by_rotations([one, two], log) {
                let says = "closes by the parts that move alike and the loops before it".to_owned();
                self.report.add(2, entry.name.get_ref(), says, Vec::new());
                continue;
            }
            // Points of the model at both ends.
            let ends = (self.model_point(one, log), self.model_point(two, log));
            let (Some((first, a)), Some((second, b))) = ends else {
                continue;
            };
            // Positions of both points along the samples, as the model has them.
            let places = [a, b].map(|anchor| {
                let part = self
                    .parts
                    .iter()
                    .position(|part| part.bodies.first() == anchor.body.as_ref());
                self.contact_place(&anchor, part)
            });
            let gap = self.samples.largest(|moment| {
                let [p, r] = places.map(|place| place.plane_position(&self.parts, moment, &self.plane, &self.samples));
                (p - r).norm()
            });
            // Points that do not coincide in the samples are no loop.
            if gap > distance_tolerance(self.names.rig) || gap.is_nan() {
                log.error(
                    source_span(0, &two.span()),
                    format!(
                        "the loop `{}` does not close: its points are up to {} m apart",
                        entry.name.get_ref(),
                        significant_digits(gap, 3)
                    ),
                    "expected a point that coincides with the first one in the model",
                    "",
                );
            }
            self.report.add(
                2,
                entry.name.get_ref(),
                format!("closes where {first} coincides with {second}"),
                vec![AssumptionSize::new("gap", gap, "m")],
            );
            self.draft.loops.push((entry.name.get_ref().clone(), [first, second]));
        }
    }

    /// Whether a loop of a generated plan needs no equation.
    fn is_implied_by_rotations(&mut self, joins: [&PlanName; 2], log: &mut RigLog) -> bool {
        let [one, two] = joins.map(|name| {
            let anchor = self.names.point(name, log)?;
            let part = self
                .parts
                .iter()
                .position(|part| part.bodies.first() == anchor.body.as_ref());
            Some(self.contact_place(&anchor, part))
        });
        let (Some(one), Some(two)) = (one, two) else {
            return false;
        };
        self.is_loop_implied([one, two])
    }

    /// Step 4: adds the drives of the rig. A drive of a joint acts on the coordinate of a part; a linear drive gets two
    /// contact points.
    pub(crate) fn drives(&mut self, log: &mut RigLog) {
        let (rig, plan) = (self.names.rig, self.names.plan);
        let known: Vec<&str> = rig.drives.iter().map(|drive| drive.name.as_str()).collect();
        // Entries of drives that the rig does not have.
        for entry in plan
            .drive
            .iter()
            .filter(|entry| !known.contains(&entry.name.get_ref().as_str()))
        {
            log.unknown_name(0, &entry.name, "drive of the rig", &known);
        }
        for (d, drive) in rig.drives.iter().enumerate() {
            let entry = plan.drive.iter().find(|entry| entry.name.get_ref() == &drive.name);
            // Place for messages, and the ends of a linear drive; other drives act at a joint.
            let here = entry.map_or_else(|| &plan.name, |entry| &entry.name);
            let Some(ends) = rig.ends_of_drive(d) else {
                let coordinate = rig.coordinate_of_drive(d).map(|c| rig.coordinates[c].name.clone());
                // The coordinate must be an active one of the model.
                let active =
                    coordinate.filter(|name| self.draft.coordinates.iter().any(|c| &c.name == name && !c.passive));
                match active {
                    Some(coordinate) => {
                        self.report
                            .add(4, &drive.name, format!("drives {coordinate}"), Vec::new());
                        self.draft.drives.push((drive.name.clone(), Ok(coordinate)));
                    }
                    None => log.error(
                        source_span(0, &here.span()),
                        format!("the joint of the drive `{}` is not the joint of a part", drive.name),
                        "",
                        "write the joint's coordinate as `coordinate` of the part at this joint",
                    ),
                }
                continue;
            };
            // A linear drive acts between two contact points.
            let on_axis = entry.is_some_and(|entry| entry.contact_on_axis);
            let mut contacts = Vec::new();
            let mut names = Vec::new();
            for end in ends {
                let Some(name) = self.names.point_name(&end) else {
                    continue;
                };
                let named = PlanName::new(here.span(), name.clone());
                let Ok(part) = self.names.owner(&self.parts, &end, &named, log) else {
                    continue;
                };
                let mut contact = self.contact_place(&end, part);
                if on_axis {
                    // The plan places the contact on the axis of its part.
                    contact = contact.projected_on_axis();
                }
                self.declare(&name, contact);
                contacts.push(contact);
                names.push(name);
            }
            // Both ends were found: report the errors of the drive.
            if let (&[from, to], [one, two]) = (contacts.as_slice(), names.as_slice()) {
                let (plane, samples) = (&self.plane, &self.samples);
                check_linear(
                    &drive.name,
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

    /// Adds the effects at drives to the draft; other effects are left out and reported.
    pub(crate) fn effects(&mut self) {
        let rig = self.names.rig;
        for effect in &rig.effects {
            let (kind, values) = effect.law.kind_and_values();
            // Only effects at drives have the same place in the model.
            let drive = |place: &modelmill_rig::RigPlace| match place {
                modelmill_rig::RigPlace::Drive(d) => rig.drives.get(*d).map(|drive| drive.name.clone()),
                _ => None,
            };
            let at: Vec<String> = effect.places.iter().filter_map(drive).collect();
            let library = modelmill_spec::library();
            // The model needs the same kind of effect, with all its places.
            let known = library.iter().find(|known| known.name == kind);
            let Some(known) = known.filter(|_| at.len() == effect.places.len()) else {
                self.report
                    .add(4, kind, "acts in the rig and is left out of the model", Vec::new());
                continue;
            };
            let is_parameter = |symbol: &str| known.parameters.iter().any(|p| p.symbol == symbol);
            // Parameters of a model are linear: zeroth, first and second moment of the rod's mass about its pivot.
            let values = match effect.law {
                modelmill_rig::RigLaw::RodInertia { m, c, I } => {
                    vec![("Jr", I + m * c * c), ("Sr", m * c), ("mr", m)]
                }
                _ => values,
            };
            // Some values of the rig are constants of the model and not parameters.
            let (parameters, constants) = values
                .into_iter()
                .map(|(symbol, value)| (symbol.to_owned(), value))
                .partition(|(symbol, _)| is_parameter(symbol));
            self.report
                .add(4, kind, format!("at {} as in the rig", at.join(", ")), Vec::new());
            self.draft.effects.push(DraftEffect {
                kind: kind.to_owned(),
                at,
                parameters,
                constants,
            });
        }
    }

    /// Checks that every group is in the model or in `leave_out`, and reports lumped masses that the model places
    /// differently.
    pub(crate) fn check_completeness(&mut self, log: &mut RigLog) {
        let (rig, plan) = (self.names.rig, self.names.plan);
        // Bodies that the plan leaves out on purpose, with the size of what is neglected.
        let left = self.names.bodies(&plan.leave_out, &mut self.used_groups, log);
        for body in left {
            let solid = crate::planar::spatial_body(rig, body);
            self.report.add(
                2,
                &rig.bodies[body].name,
                "is left out",
                vec![
                    AssumptionSize::new("mass", solid.mass, "kg"),
                    AssumptionSize::new("inertia", solid.inertia.amax(), "kg m^2"),
                ],
            );
        }
        // Groups that the plan does not mention at all.
        let forgotten: Vec<&str> = self
            .names
            .groups
            .iter()
            .map(|(name, _)| name.as_str())
            .filter(|name| self.used_groups.iter().all(|used| used != name))
            .collect();
        if !forgotten.is_empty() {
            log.error(
                source_span(0, &plan.name.span()),
                format!("the plan does not mention {}", forgotten.join(", ")),
                "",
                "add each to a `[[part]]` or a `[[lumped_mass]]`, or list it in `leave_out`",
            );
        }
        // A rig can place a mass differently in the balances of forces and of moments, as the paper does; a model has
        // one place.
        let split = rig
            .lumped_masses
            .iter()
            .filter(|lumped| lumped.at.at != lumped.moment_at);
        for lumped in split {
            let about = lumped.at.body.map_or("base", |body| rig.bodies[body].name.as_str());
            let says = "has a mass with a different position in the balance of moments; the model uses the position of the \
                        balance of forces";
            self.report.add(
                2,
                about,
                says,
                vec![AssumptionSize::new(
                    "moved by",
                    (lumped.at.at - lumped.moment_at).norm(),
                    "m",
                )],
            );
        }
    }

    /// Reports constants of the plan for quantities that the model does not have.
    pub(crate) fn check_constants(&self, log: &mut RigLog) {
        for is in self.names.plan.constants.values().flat_map(|constant| &constant.is) {
            // The quantity must occur in the model.
            let symbols = &self.draft.constants.0;
            if !symbols
                .iter()
                .any(|symbol| symbol.stands_for.iter().any(|(what, _)| what == is.get_ref()))
            {
                let known: Vec<&str> = symbols
                    .iter()
                    .flat_map(|s| s.stands_for.iter().map(|(what, _)| what.as_str()))
                    .collect();
                log.unknown_name(0, is, "quantity of the model", &known);
            }
        }
    }
}
