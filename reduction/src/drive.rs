//! Step 4: compares the linear drives of the reduced model with those of the rig. Contact points go in; the errors of
//! length and direction along the samples come out.

use modelmill_rig::BodyAnchor;
use nalgebra::Vector2;

use crate::part::SubstitutionPart;
use crate::report::{AssumptionSize, ReductionReport};
use crate::samples::{MotionPlane, MotionSample, MotionSamples};

/// A point of the model.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactPlace {
    /// Index of its part; none is the base.
    pub(crate) part: Option<usize>,
    /// Position in the frame of the part, or in the plane, m.
    pub(crate) at: Vector2<f64>,
}

impl ContactPlace {
    /// Its position in the plane at a sample, m.
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

    /// The nearest point on the longitudinal axis of its part at the same distance from the joint; points of the base
    /// stay.
    pub(crate) fn projected_on_axis(self) -> Self {
        // The distance from the joint is kept, on the side of the joint on which the point is.
        let at = Vector2::new(self.at.norm().copysign(self.at.x), 0.0);
        if self.part.is_some() { Self { at, ..self } } else { self }
    }
}

/// Compares a linear drive of the model with the rig's along the samples, and reports the largest errors.
pub(crate) fn check_linear(
    name: &str,
    ends: [BodyAnchor; 2],
    contacts: [ContactPlace; 2],
    parts: &[SubstitutionPart],
    plane: &MotionPlane,
    samples: &MotionSamples,
    report: &mut ReductionReport,
) {
    // Vector from the first to the second contact: projected truth, and model.
    let vectors = |moment: &MotionSample| {
        let truth = plane.plane_position(&moment.place(&ends[1])) - plane.plane_position(&moment.place(&ends[0]));
        let [from, to] = contacts.map(|contact| contact.plane_position(parts, moment, plane, samples));
        (truth, to - from)
    };
    // Errors of length and direction along the samples.
    let length = samples.largest(|moment| {
        let (truth, model) = vectors(moment);
        truth.norm() - model.norm()
    });
    let direction = samples.largest(|moment| {
        let (truth, model) = vectors(moment);
        truth.perp(&model).atan2(truth.dot(&model))
    });
    // The drive has a component along the normal if its points are not in one plane.
    let out = samples.largest(|moment| plane.normal.dot(&(moment.place(&ends[1]) - moment.place(&ends[0]))));
    report.add(
        4,
        name,
        "acts between the same points",
        vec![
            AssumptionSize::new("error of the length", length, "m"),
            AssumptionSize::new("error of the direction", direction, "rad"),
            AssumptionSize::new("component out of the plane", out, "m"),
        ],
    );
}
