//! Step 4: drives of the rig on the reduced model, and how far their lengths and directions are from the true ones.

use modelmill_rig::BodyAnchor;
use nalgebra::Vector2;

use crate::part::SubstitutionPart;
use crate::report::{AssumptionSize, ReductionReport};
use crate::samples::{MotionPlane, MotionSample, MotionSamples};

/// A place as the model has it: on a part, in its frame, or in the plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactPlace {
    pub(crate) part: Option<usize>,
    pub(crate) at: Vector2<f64>,
}

impl ContactPlace {
    pub(crate) fn plane_position(
        &self,
        parts: &[SubstitutionPart],
        moment: &MotionSample,
        plane: &MotionPlane,
        samples: &MotionSamples,
    ) -> Vector2<f64> {
        self.part.map_or(self.at, |part| {
            parts[part].model_position(&self.at, moment, plane, samples)
        })
    }

    /// The nearest place on the longitudinal axis at the same distance from the joint.
    pub(crate) fn projected_on_axis(self) -> Self {
        let at = Vector2::new(self.at.norm().copysign(self.at.x), 0.0);
        if self.part.is_some() {
            Self { at, ..self }
        } else {
            self
        }
    }
}

/// Compares a linear drive of the model with the rig's along the samples.
pub(crate) fn check_linear(
    name: &str,
    ends: [BodyAnchor; 2],
    contacts: [ContactPlace; 2],
    parts: &[SubstitutionPart],
    plane: &MotionPlane,
    samples: &MotionSamples,
    report: &mut ReductionReport,
) {
    let vectors = |moment: &MotionSample| {
        let truth = plane.plane_position(&moment.place(&ends[1]))
            - plane.plane_position(&moment.place(&ends[0]));
        let [from, to] =
            contacts.map(|contact| contact.plane_position(parts, moment, plane, samples));
        (truth, to - from)
    };
    let length = samples.largest(|moment| {
        let (truth, model) = vectors(moment);
        truth.norm() - model.norm()
    });
    let direction = samples.largest(|moment| {
        let (truth, model) = vectors(moment);
        truth.perp(&model).atan2(truth.dot(&model))
    });
    let out = samples.largest(|moment| {
        plane
            .normal
            .dot(&(moment.place(&ends[1]) - moment.place(&ends[0])))
    });
    report.add(
        4,
        name,
        "acts between the same points",
        vec![
            AssumptionSize::new("length is off by", length, "m"),
            AssumptionSize::new("direction by", direction, "rad"),
            AssumptionSize::new("leans out of the plane by", out, "m"),
        ],
    );
}
