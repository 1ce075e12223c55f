//! The two causes that the authors name for the errors of their model, each alone in the complete robot: longer lever
//! arms of the coupling elements and the platform, and contact points of the spindles beside the axes of the cranks.

use modelmill::{Model, Outcome};

use crate::bundled;
use crate::held::HeldDiagnosis;
use crate::runs::{self, PeriodicTrajectory};
use crate::study::{self, TreatmentStudy};

/// Distance by which the centres of mass of G2, G6 and G4 are moved, m.
pub(crate) const SHIFT: f64 = 0.1;
/// Distances of the contact points from the axes of the cranks, mm.
const CONTACTS: [i32; 2] = [20, 50];

/// The study of both causes.
pub(crate) struct AuthorCauses {
    /// Largest change of a spindle force when the centres are moved by [`SHIFT`], relative to the largest force.
    pub(crate) moved_centres: f64,
    /// Both treatments with contact points beside the axes.
    pub(crate) contacts: Vec<ContactStudy>,
    /// The diagnosis of the paper's model on the first of them, with fixed parameters.
    pub(crate) held: HeldDiagnosis,
}

/// Both treatments of m4 on a rig with contact points beside the axes of the cranks.
pub(crate) struct ContactStudy {
    /// Distance from the axis, m.
    pub(crate) offset: f64,
    /// Errors of both treatments, which neglect the distance.
    pub(crate) study: TreatmentStudy,
}

impl AuthorCauses {
    /// Simulates the rigs along both trajectories.
    pub(crate) fn new(models: [&Model; 2], trajectories: &[PeriodicTrajectory; 2], rate: f64) -> Outcome<Self> {
        let [paper, _] = models;
        let rig = bundled::rig("spidermill-full.toml")?;
        // The same robot with other centres of the bodies that only translate.
        let mut moved = rig.clone();
        for body in &mut moved.bodies {
            if ["G2", "G6", "G4"].contains(&body.name.as_str()) {
                body.centre.x += SHIFT;
                body.centre.y += SHIFT;
            }
        }
        let [before, after] = [&rig, &moved].map(|rig| runs::run(rig, paper, &trajectories[0], rate));
        let [before, after] = [before?, after?].map(|one| one.run.force.unwrap_or_default());
        let contacts = CONTACTS
            .iter()
            .map(|mm| ContactStudy::new(models, trajectories, rate, f64::from(*mm) / 1000.0))
            .collect::<Outcome<Vec<_>>>()?;
        // The diagnosis uses the first distance.
        let offset = f64::from(CONTACTS[0]) / 1000.0;
        let rig = contact_rig(offset)?;
        let [fit, check] = [&trajectories[0], &trajectories[1]].map(|one| runs::run(&rig, paper, one, rate));
        Ok(Self {
            moved_centres: study::largest_difference(&before, &after),
            contacts,
            held: HeldDiagnosis::new(paper, [&fit?, &check?], offset)?,
        })
    }
}

impl ContactStudy {
    /// Identifies and verifies both treatments on a rig with this distance.
    fn new(models: [&Model; 2], trajectories: &[PeriodicTrajectory; 2], rate: f64, offset: f64) -> Outcome<Self> {
        let rig = contact_rig(offset)?;
        let [identification, verification] = trajectories;
        Ok(Self {
            offset,
            study: TreatmentStudy::new(
                models,
                runs::run(&rig, models[0], identification, rate)?,
                runs::run(&rig, models[0], verification, rate)?,
            )?,
        })
    }
}

/// The complete robot with contact points beside the axes of the cranks.
fn contact_rig(offset: f64) -> Outcome<modelmill_rig::Rig> {
    let text = format!(
        "schema = 1\nname = \"contact\"\nextends = \"spidermill-full.toml\"\n\
         [[point]]\nname = \"A_left\"\non = \"G8\"\nat = [0.45, {offset}, 0]\n\
         [[point]]\nname = \"A_right\"\non = \"G11\"\nat = [0.45, {}, 0]\n",
        -offset
    );
    bundled::rig_variant("contact.toml", &text)
}
