//! How parameters are estimated from the rows of a regressor.

use crate::identify::refine::EstimateRefinement;

/// How parameters are estimated; [`EstimatorOptions::default`] is least squares, where need be with each drive by
/// its own residuals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EstimatorOptions {
    /// What each equation counts.
    pub weights: EquationWeights,
    /// Huber's robust estimate: residuals beyond this many standard deviations (taken from their median) count less; 1.345
    /// is usual.
    pub robust: Option<f64>,
    /// What is made of the solution of least squares.
    pub refinement: EstimateRefinement,
    /// Leave an equation out of the fit while its drive is slower than this part of its fastest, for at rest the friction
    /// takes any value; 0.01 is usual.
    pub standstill: Option<f64>,
}

/// What each equation counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum EquationWeights {
    /// `Channels` where drives have different units, and where cut-off and decimation are chosen; else `None`.
    #[default]
    Automatic,
    /// All the same: ordinary least squares.
    None,
    /// Each drive's are divided by the standard deviation of its residuals (iterated).
    Channels,
    /// Each sample's are divided by the standard deviation of the recording's columns `DRIVE_var`.
    Variance,
}

impl EquationWeights {
    /// What the JSON calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Automatic => "automatic",
            Self::None => "none",
            Self::Channels => "channels",
            Self::Variance => "variance",
        }
    }
}
