//! A hydraulic cylinder whose pressures are recorded: the drive force is the difference of pressure times area of its two
//! chambers. At a drive with a torque, a hydraulic motor: the areas are displacements, m^3/rad.

use super::{ActuatorGain, ActuatorKindEntry, ActuatorTerm, GainEntry, SignalQuantity, gain, signal};
use crate::exact::ExactExpression;
use crate::unit::UnitDimension;

/// See [`super::ActuatorKind::HydraulicCylinder`].
pub(super) struct HydraulicCylinder;

/// 1/Pa
const PER_PASCAL: UnitDimension = UnitDimension::new([-1, 1, 2, 0]);

impl ActuatorKindEntry for HydraulicCylinder {
    fn name(&self) -> &'static str {
        "hydraulic_cylinder"
    }

    fn formula(&self) -> &'static str {
        "area_a*pressure_a - area_b*pressure_b"
    }

    fn signals(&self) -> &'static [&'static str] {
        &["pressure_a", "pressure_b"]
    }

    fn quantity(&self) -> SignalQuantity {
        SignalQuantity::Pressure
    }

    fn is_commanded(&self) -> bool {
        false
    }

    /// Pressures are measured at the same time as positions.
    fn usual_delay(&self) -> Option<f64> {
        Some(0.0)
    }

    fn gains(&self) -> &'static [GainEntry] {
        const {
            &[
                gain("area_a", true, PER_PASCAL, 0),
                gain("area_b", false, PER_PASCAL, 0),
            ]
        }
    }

    /// A cylinder that acts in one direction has no `area_b`, and no second pressure.
    fn terms(&self, at: usize, gain: &dyn Fn(&str) -> Option<ActuatorGain>) -> Vec<ActuatorTerm> {
        let term = match at {
            0 => gain("area_a").map(|area| area.term(signal())),
            _ => gain("area_b").map(|area| area.term(ExactExpression::Negative(Box::new(signal())))),
        };
        term.into_iter().collect()
    }
}
