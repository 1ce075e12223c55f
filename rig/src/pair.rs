//! Scalar functions of the poses of two bodies, of which joints, coordinates and drives consist.
//!
//! The motion of two bodies goes in; the function's value, its gradient with respect to the rates of both,
//! and the part of its second derivative that does not depend on accelerations come out.
//! Source: E. Haug, "Computer Aided Kinematics and Dynamics of Mechanical Systems" (1989), section 9.4
//! (dot-1, dot-2, spherical and distance constraints); the angle about an axis in the same manner.

use nalgebra::Vector3;

use crate::pose::BodyMotion;

/// A place fixed to a body, or to the base.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyAnchor {
    /// Index of the body; `None` is the base.
    pub body: Option<usize>,
    /// Place in the body's frame, m.
    pub at: Vector3<f64>,
}

/// The quantity that is measured between two bodies; directions are unit vectors in the frame of their body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum PairQuantity {
    /// A component, along a direction of the base frame, of the vector between the anchors.
    Component(Vector3<f64>),
    /// The same along a direction fixed to the first body.
    Along(Vector3<f64>),
    /// Cosine between a direction of the first body and one of the second.
    Cosine(Vector3<f64>, Vector3<f64>),
    /// Angle about `axis`, from `x` of the first body to `x_to` of the second; counted from `offset`.
    Angle {
        /// Axis, in the frame of the first body.
        axis: Vector3<f64>,
        /// Direction of angle zero, in the frame of the first body.
        x: Vector3<f64>,
        /// Direction that is measured, in the frame of the second body.
        x_to: Vector3<f64>,
        offset: f64,
    },
    /// Distance of the anchors.
    Distance,
}

/// A scalar function of the poses of two bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairFunction {
    /// Place on the first body.
    pub(crate) from: BodyAnchor,
    /// Place on the second body.
    pub(crate) to: BodyAnchor,
    /// The quantity.
    pub(crate) shape: PairQuantity,
}

/// Value and derivatives of a [`PairFunction`]: `second derivative = gradient . accelerations + bias`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PairDerivatives {
    pub(crate) value: f64,
    /// With respect to velocity and angular velocity of the first body, then of the second.
    pub(crate) gradient: [Vector3<f64>; 4],
    pub(crate) bias: f64,
}

impl PairFunction {
    /// Value, gradient and bias; `bodies` have poses and rates.
    pub(crate) fn derive(&self, bodies: &[BodyMotion], base: &BodyMotion) -> PairDerivatives {
        let motion = |anchor: &BodyAnchor| anchor.body.map_or(base, |body| &bodies[body]);
        let (one, two) = (motion(&self.from), motion(&self.to));
        let (r1, r2) = (one.R_WB * self.from.at, two.R_WB * self.to.at);
        let d = two.pose.p_WB_W + r2 - one.pose.p_WB_W - r1;
        let dd = two.v_WB_W + two.w_WB_W.cross(&r2) - one.v_WB_W - one.w_WB_W.cross(&r1);
        let bias_of_d = two.centripetal(&r2) - one.centripetal(&r1);
        // Gradient of `n . d` for a constant n.
        let along = |n: &Vector3<f64>| [-n, -r1.cross(n), *n, r2.cross(n)];
        match &self.shape {
            PairQuantity::Component(n) => PairDerivatives {
                value: n.dot(&d),
                gradient: along(n),
                bias: n.dot(&bias_of_d),
            },
            PairQuantity::Along(n) => {
                let n = one.R_WB * n;
                let mut gradient = along(&n);
                gradient[1] += n.cross(&d);
                PairDerivatives {
                    value: n.dot(&d),
                    gradient,
                    bias: one.centripetal(&n).dot(&d) + 2.0 * one.w_WB_W.cross(&n).dot(&dd) + n.dot(&bias_of_d),
                }
            }
            PairQuantity::Cosine(a, b) => {
                let (a, b) = (one.R_WB * a, two.R_WB * b);
                let turn = b.cross(&a);
                PairDerivatives {
                    value: a.dot(&b),
                    gradient: [Vector3::zeros(), -turn, Vector3::zeros(), turn],
                    bias: one.centripetal(&a).dot(&b)
                        + 2.0 * one.w_WB_W.cross(&a).dot(&two.w_WB_W.cross(&b))
                        + a.dot(&two.centripetal(&b)),
                }
            }
            PairQuantity::Angle { axis, x, x_to, offset } => {
                // Exact if both axes agree, as the joint's own equations require:
                // then the axis' own rotation has no effect on the second derivative.
                let y = one.R_WB * axis.cross(x);
                let (x, x_to, axis) = (one.R_WB * x, two.R_WB * x_to, one.R_WB * axis);
                PairDerivatives {
                    value: offset + libm::atan2(y.dot(&x_to), x.dot(&x_to)),
                    gradient: [Vector3::zeros(), -axis, Vector3::zeros(), axis],
                    bias: one.w_WB_W.cross(&axis).dot(&(two.w_WB_W - one.w_WB_W)),
                }
            }
            PairQuantity::Distance => {
                let length = d.norm();
                // A distance of zero has no direction; its zero gradient appears as a missing rank.
                let n = if length > 0.0 { d / length } else { d };
                let rate = n.dot(&dd);
                PairDerivatives {
                    value: length,
                    gradient: along(&n),
                    bias: n.dot(&bias_of_d)
                        + if length > 0.0 {
                            (dd.norm_squared() - rate * rate) / length
                        } else {
                            0.0
                        },
                }
            }
        }
    }

    /// Whether this is the distance of two points.
    pub(crate) fn is_distance(&self) -> bool {
        matches!(self.shape, PairQuantity::Distance)
    }

    /// Whether this is an angle.
    pub(crate) fn is_angle(&self) -> bool {
        matches!(self.shape, PairQuantity::Angle { .. })
    }

    /// Difference of two values; for angles between -pi and pi.
    pub(crate) fn wrapped_difference(&self, value: f64, target: f64) -> f64 {
        let difference = value - target;
        if matches!(self.shape, PairQuantity::Angle { .. }) {
            let turn = 2.0 * std::f64::consts::PI;
            difference - turn * libm::round(difference / turn)
        } else {
            difference
        }
    }
}

impl PairDerivatives {
    /// Adds `factor` times the gradient to a vector of all bodies' rates, six per body.
    pub(crate) fn scatter(&self, pair: &PairFunction, mut put: impl FnMut(usize, f64)) {
        for (anchor, k) in [(&pair.from, 0), (&pair.to, 2)] {
            if let Some(body) = anchor.body {
                for i in 0..3 {
                    put(6 * body + i, self.gradient[k][i]);
                    put(6 * body + 3 + i, self.gradient[k + 1][i]);
                }
            }
        }
    }
}
