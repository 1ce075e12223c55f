//! The equations of motion with actuators in place of measured forces.
//!
//! With `tau = H p` and the force `S k` of the actuators, `H p - S k = 0` has no force that must be measured. The
//! columns of `-S` join those of `H`, and the exact reduction treats gains as it treats masses.
//!
//! Decision: a signal such as a command stands as a coordinate that moves no body. Recordings, filters, exact reduction
//! and evaluation then treat it as they treat joints, and its row of the equations of motion is zero.

use num_rational::BigRational;
use num_traits::{One, Zero};

use super::{ActuatorTerm, ServoForce};
use crate::exact::{CoordinateIdx, ExactAngle, ExactExpression, ExactLength, ModelSymbol};
use crate::joint_motion::CoordinateMotion;
use crate::mechanism::{
    DriveKind, FrameAxis, FrameConvention, FrameIdx, FrameStep, JointCoordinate, Mechanism, ModelDrive, ModelFrame,
};

impl Mechanism {
    /// The same mechanism with the forces of its actuators in its equations: their drives have a measured force of zero,
    /// and each signal is a coordinate of the name of the signal, on a frame without bodies. Without actuators it is
    /// equal to the mechanism itself.
    #[must_use]
    pub fn with_servo_equations(&self) -> Self {
        let mut mechanism = self.clone();
        for actuator in &self.actuators {
            let known = mechanism.coordinates.iter().position(|c| c.name == actuator.signal);
            let signal = known.map_or_else(
                || add_signal(&mut mechanism, &actuator.signal, actuator.motion),
                CoordinateIdx,
            );
            mechanism.drives[actuator.drive.0].is_driven = false;
            // The force of the actuator is on the other side than that of the bodies.
            let terms = actuator.terms.iter().map(|term| ActuatorTerm {
                parameters: term.parameters.clone(),
                factor: ExactExpression::Negative(Box::new(term.factor.clone())),
            });
            mechanism.servo_forces.push(ServoForce {
                drive: actuator.drive,
                signal,
                terms: terms.collect(),
            });
        }
        mechanism
    }

    /// Whether a row of the equations of motion belongs to the signal of an actuator and to no body.
    pub fn is_signal_row(&self, drive: usize) -> bool {
        let DriveKind::Joint(i) = self.drives[drive].kind else {
            return false;
        };
        self.servo_forces.iter().any(|force| force.signal == i)
    }

    /// Whether the force of an actuator is part of a row of the equations of motion.
    pub fn is_servo_row(&self, drive: usize) -> bool {
        self.servo_forces.iter().any(|force| force.drive.0 == drive)
    }
}

/// Adds a coordinate that moves no body, with its frame and its row; returns the coordinate.
fn add_signal(mechanism: &mut Mechanism, name: &str, motion: CoordinateMotion) -> CoordinateIdx {
    let signal = CoordinateIdx(mechanism.coordinates.len());
    mechanism.coordinates.push(JointCoordinate {
        name: name.to_owned(),
        motion,
        passive: false,
        nominal: 0.0,
    });
    let step = if motion.is_angle() {
        FrameStep::Rotate(
            FrameAxis::Z,
            ExactAngle {
                pi: BigRational::zero(),
                terms: vec![(ModelSymbol::Coordinate(signal), 1)],
            },
        )
    } else {
        FrameStep::Translate(
            FrameAxis::Z,
            ExactLength {
                offset: ExactExpression::Rational(BigRational::zero()),
                coordinates: vec![(signal, BigRational::one())],
            },
        )
    };
    mechanism.frames.push(ModelFrame {
        name: format!("{name}_signal"),
        parent: FrameIdx(0),
        steps: vec![step],
        convention: FrameConvention::Transform(String::new()),
    });
    mechanism.drives.push(ModelDrive {
        name: format!("{name}_row"),
        kind: DriveKind::Joint(signal),
        is_driven: false,
    });
    signal
}
