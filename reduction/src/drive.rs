//! Step 4: drives of the rig on the reduced model, and how far their lengths and directions are from the true ones.

use modelmill_rig::Anchor;
use nalgebra::Vector2;

use crate::part::Part;
use crate::report::{Report, Size};
use crate::samples::{Moment, Plane, Samples};

/// A place as the model has it: on a part, in its frame, or in the plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contact {
    pub(crate) part: Option<usize>,
    pub(crate) at: Vector2<f64>,
}

impl Contact {
    pub(crate) fn place(
        &self,
        parts: &[Part],
        moment: &Moment,
        plane: &Plane,
        samples: &Samples,
    ) -> Vector2<f64> {
        self.part.map_or(self.at, |part| {
            parts[part].placed(&self.at, moment, plane, samples)
        })
    }

    /// The nearest place on the longitudinal axis at the same distance from the joint.
    pub(crate) fn on_axis(self) -> Self {
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
    ends: [Anchor; 2],
    contacts: [Contact; 2],
    parts: &[Part],
    plane: &Plane,
    samples: &Samples,
    report: &mut Report,
) {
    let vectors = |moment: &Moment| {
        let truth = plane.place(&moment.place(&ends[1])) - plane.place(&moment.place(&ends[0]));
        let [from, to] = contacts.map(|contact| contact.place(parts, moment, plane, samples));
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
            Size::new("length is off by", length, "m"),
            Size::new("direction by", direction, "rad"),
            Size::new("leans out of the plane by", out, "m"),
        ],
    );
}
