//! Estimates of a set of effects with their standard deviations.

use nalgebra::DMatrix;

use super::bench::{EffectSelector, SelectedEffect};
use super::pool::FitScope;
use super::thresholds::ESTIMATE_MOST_VARIANCE_RATIO;

impl EffectSelector<'_> {
    /// Estimates of each member's parameters with their standard deviations, `[effect][parameter]`; the deviation is
    /// `None` if other columns explain the same. Each channel counts with its effective number of samples.
    pub(crate) fn estimate_parameters(&self, picks: &[SelectedEffect], on: FitScope) -> Vec<Vec<(f64, Option<f64>)>> {
        let which = self.columns(picks);
        let (factors, _) = self.fit(picks, on);
        let rest = self.residual(picks, &factors);
        let mut weights = self.weights.clone();
        for (d, weight) in weights.iter_mut().enumerate() {
            let counted = self.pool.counted_samples(d, &(0..rest[d].len()));
            *weight *= self.effective_equations(&rest, &[d]) / counted.max(1) as f64;
        }
        let gram = self.pool.gram(&which, &weights, on);
        let n = gram.nrows();
        // Covariance from the inverse of the scaled normal equations; a tiny ridge keeps dependent columns solvable.
        let scale: Vec<f64> = (0..n).map(|i| gram[(i, i)].sqrt()).collect();
        let by = |i: usize, j: usize| {
            let size = scale[i] * scale[j];
            if size > 0.0 {
                gram[(i, j)] / size
            } else {
                f64::from(u8::from(i == j))
            }
        };
        let scaled = DMatrix::from_fn(n, n, |i, j| by(i, j) + if i == j { 1e-12 } else { 0.0 });
        let inverse = scaled.cholesky().map(|factor| factor.inverse());
        let mut at = self.base.len();
        let mut all = Vec::new();
        for pick in picks {
            let of = |k: usize| {
                let variance = inverse.as_ref().map_or(f64::NAN, |inverse| inverse[(k, k)]);
                let deviation = variance.sqrt() / scale[k];
                // An estimate whose uncertainty is far above what its column alone would give is not determined.
                let is_known = deviation.is_finite() && variance < ESTIMATE_MOST_VARIANCE_RATIO && factors[k] != 0.0;
                (factors[k], is_known.then_some(deviation))
            };
            all.push((at..at + pick.columns.len()).map(of).collect());
            at += pick.columns.len();
        }
        all
    }
}
