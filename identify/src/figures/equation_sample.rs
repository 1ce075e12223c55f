//! The equations of a model at one state, in a fit file: a model with other equations is recognised by other forces, also
//! where the expressions of its base parameters are the same.

use serde::{Deserialize, Serialize};

/// Forces of the drives at one state, for fixed values of the base parameters that depend on their number only.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct EquationSample {
    /// Positions of the active coordinates, rad or m.
    pub positions: Vec<f64>,
    /// Their rates, rad/s or m/s.
    pub rates: Vec<f64>,
    /// Their accelerations, rad/s^2 or m/s^2.
    pub accelerations: Vec<f64>,
    /// Forces of the drives that effects depend on, N or N m; unused without such effects.
    pub loads: Vec<f64>,
    /// The model's forces of the drives at this state, N or N m.
    pub forces: Vec<f64>,
}
