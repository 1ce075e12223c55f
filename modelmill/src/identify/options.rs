//! Options of the estimation of parameters.

use crate::identify::refine::EstimateRefinement;

/// Options of the estimation. [`EstimatorOptions::default`] is least squares, with weights by drive where these are
/// needed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EstimatorOptions {
    /// Weights of the equations.
    pub weights: EquationWeights,
    /// Bound of Huber's robust estimate: residuals beyond this many standard deviations (estimated by their median)
    /// get less weight; 1.345 is usual.
    pub robust: Option<f64>,
    /// Refinement of the least-squares solution.
    pub refinement: EstimateRefinement,
    /// Exclude an equation while its drive is slower than this fraction of its fastest rate, since friction at
    /// standstill may have any value; 0.01 is usual.
    pub standstill: Option<f64>,
}

/// Weights of the equations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum EquationWeights {
    /// `Channels` if drives have different units, or if cut-off and decimation were chosen automatically; else `None`.
    #[default]
    Automatic,
    /// Equal weights: ordinary least squares.
    None,
    /// Equations of each drive are divided by the standard deviation of its residuals (iterated).
    Channels,
    /// Equations of each sample are divided by its standard deviation, from the columns `DRIVE_var` of the recording.
    Variance,
}

impl EquationWeights {
    /// Its name in the JSON and in options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Automatic => "automatic",
            Self::None => "none",
            Self::Channels => "channels",
            Self::Variance => "variance",
        }
    }
}
