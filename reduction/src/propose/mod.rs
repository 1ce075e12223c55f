//! Proposes a plan for a rig. The rig is moved through samples; bodies that move alike become one part, bodies that only
//! translate become point masses, and equal values share a symbol. The text of a plan file comes out, with what each
//! statement assumes as a comment.
//!
//! 1. `motion`: the plane, and how each body moves in it;
//! 2. `joints`: parts with their carriers, loops, and points of lumped masses;
//! 3. `text`: the plan, first with separate symbols, then with those of equal values shared.

mod joints;
mod motion;
mod text;
mod thresholds;

use modelmill_rig::Rig;

use crate::plan::plan;
use crate::reduce::draft;
use crate::samples::MotionPlane;
use joints::{ProposedMechanism, propose_mechanism};
use motion::{ClassifiedMotion, find_plane, sample_motion};
use text::{SharedSymbols, plan_text};
use thresholds::PLANE_SAMPLES;

/// A proposed plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlanProposal {
    /// The text of the plan file.
    pub text: String,
    /// What it proposes, one sentence each.
    pub remarks: Vec<String>,
}

/// Proposes a plan for a rig whose bodies move in one plane.
///
/// Fails with a reason and a remedy if the rig cannot be moved, is not planar, or needs a plan written by hand.
pub fn propose_plan(rig: &Rig) -> Result<PlanProposal, String> {
    let refuse = |says: String| {
        format!(
            "no plan can be proposed for the rig {}: {says}; write a plan by hand",
            rig.name
        )
    };
    let motion = ClassifiedMotion::new(rig).map_err(refuse)?;
    let mechanism = propose_mechanism(rig, &motion).map_err(refuse)?;
    if mechanism.parts.is_empty() {
        return Err(refuse(
            "no revolute joint connects a rotating body to the base".to_owned(),
        ));
    }
    // The first draft gives the values that can be equal.
    let separate = plan_text(rig, &motion, &mechanism, None);
    let read = |text: &str| plan("the proposed plan", text).map_err(|failure| refuse(failure.render(false)));
    let (symbols, report) = draft(rig, &read(&separate)?).map_err(|failure| refuse(failure.render(false)))?;
    let shared = SharedSymbols::new(rig, &symbols);
    let text = plan_text(rig, &motion, &mechanism, Some((&shared, &report)));
    read(&text)?;
    Ok(PlanProposal {
        text,
        remarks: describe(rig, &motion, &mechanism, &shared),
    })
}

/// The plane in which the bodies of a rig move; none if there is none, or if the rig cannot be moved.
pub(crate) fn motion_plane(rig: &Rig) -> Option<MotionPlane> {
    let (samples, _) = sample_motion(rig, PLANE_SAMPLES).ok()?;
    find_plane(rig, &samples).ok()
}

/// What a plan proposes, one sentence each.
fn describe(
    rig: &Rig,
    motion: &ClassifiedMotion,
    mechanism: &ProposedMechanism,
    shared: &SharedSymbols,
) -> Vec<String> {
    let names = |bodies: &[usize]| -> String {
        let names: Vec<&str> = bodies.iter().map(|body| rig.bodies[*body].name.as_str()).collect();
        names.join(", ")
    };
    let mut says = Vec::new();
    for part in &mechanism.parts {
        let members = &motion.families[part.family];
        let name = &rig.bodies[part.lead].name;
        says.push(match members.len() {
            1 => format!("{name} becomes a part"),
            _ => format!("{} move alike and become the part {name}", names(members)),
        });
    }
    for mass in &mechanism.lumped_masses {
        let places = match mass.at.len() {
            1 => "a point".to_owned(),
            n => format!("{n} points in equal shares"),
        };
        let verb = if mass.bodies.len() == 1 {
            "only translates and becomes a mass"
        } else {
            "only translate and become one mass"
        };
        says.push(format!("{} {verb} at {places}", names(&mass.bodies)));
    }
    if !mechanism.left_out.is_empty() {
        says.push(format!("{} have no place in the model", names(&mechanism.left_out)));
    }
    let ties = shared.ties();
    if !ties.is_empty() {
        says.push(format!("equal values share a symbol: {}", ties.join(", ")));
    }
    says
}
