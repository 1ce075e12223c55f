//! Gaps of joints in the nominal configuration, as the file states it: before the bodies are moved to close them.

use crate::pair::PairQuantity;
use crate::pose::{BodyMotion, BodyPose};
use crate::rig::Rig;

/// How far a joint is from closed.
#[derive(Clone, Debug, PartialEq)]
pub struct JointGap {
    /// Name of the joint.
    pub joint: String,
    /// Distance of its two places, m.
    pub distance: f64,
    /// Angle between its directions, rad.
    pub angle: f64,
}

impl Rig {
    /// The gap of each joint with the poses of the file.
    pub fn nominal_gaps(&self) -> Vec<JointGap> {
        let bodies: Vec<BodyMotion> = self
            .bodies
            .iter()
            .map(|body| BodyMotion::at_standstill(body.nominal))
            .collect();
        let base = BodyMotion::at_standstill(BodyPose::identity());
        let gap_of = |joint: &crate::rig::RigJoint| {
            let (mut distance, mut angle) = (0.0, 0.0_f64);
            for (pair, constant) in &joint.equations {
                let gap = pair.derive(&bodies, &base).value - constant;
                match pair.shape {
                    PairQuantity::Cosine(..) | PairQuantity::Angle { .. } => angle = angle.hypot(gap),
                    _ => distance = f64::hypot(distance, gap),
                }
            }
            JointGap {
                joint: joint.name.clone(),
                distance,
                angle,
            }
        };
        self.joints.iter().map(gap_of).collect()
    }
}
