//! Options of the estimation of parameters.

use crate::identify::refine::EstimateRefinement;

/// Options of the estimation. [`EstimatorOptions::default`] is least squares with [`EquationWeights::Automatic`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EstimatorOptions {
    /// Weights of the equations.
    pub weights: EquationWeights,
    /// Bound of Huber's robust estimator, dimensionless: residuals larger than this many standard deviations get less
    /// weight. A usual bound is 1.345. The standard deviation is estimated per drive as 1.4826 times the median of the
    /// absolute residuals. `None` for no robust estimation.
    pub robust: Option<f64>,
    /// Refinement of the least-squares solution.
    pub refinement: EstimateRefinement,
    /// Bound of standstill, as a fraction of the maximum rate of the drive over all recordings of the fit; 0.01 is usual.
    /// Equations of the drive below this bound are excluded from the fit, in addition to those that the recordings leave
    /// out ([`StandstillRule`](crate::recording::StandstillRule)). `None` excludes no equation.
    pub standstill: Option<f64>,
}

/// Weights of the equations in a fit. There is one equation for each drive and sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum EquationWeights {
    /// [`Self::Channels`] if drives have different units, or if cut-off and decimation were chosen automatically;
    /// otherwise [`Self::None`]. With one drive or with instruments always [`Self::None`].
    #[default]
    Automatic,
    /// Equal weights: ordinary least squares.
    None,
    /// One weight for each drive: its equations are divided by the standard deviation of its residuals. Fit and weights
    /// are iterated. ("Channel" is the force signal of one drive.)
    Channels,
    /// Each equation is divided by the standard deviation of its measured force: the square root of the variance in the
    /// column `DRIVE_var` of the recording.
    Variance,
}

impl EquationWeights {
    /// Name of the weights in the JSON and in options.
    pub fn name(self) -> &'static str {
        match self {
            Self::Automatic => "automatic",
            Self::None => "none",
            Self::Channels => "channels",
            Self::Variance => "variance",
        }
    }
}
