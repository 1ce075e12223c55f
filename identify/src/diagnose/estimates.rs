//! Values of a set of effects with their deviations, and how likely each of them is.
//!
//! Decision: odds from the likelihood are astronomic for the best candidate. So a fiftieth is reserved for causes
//! outside of all candidates, and a quarter where something of the effect's channels stays unexplained. The rest is
//! shared with the alternatives, by how much worse they are.

use nalgebra::DMatrix;

use super::bench::{Bench, Pick};
use super::pool::On;

/// Odds beyond which nothing speaks louder, in twice their logarithm.
const LOUDEST: f64 = 20.0;
/// How likely it is that the cause of what a found effect explains is another one, which no candidate says: where the rest is
/// noise, and where some of it comes again unexplained.
const OUTSIDE: f64 = 0.02;
const OUTSIDE_BESIDE_UNEXPLAINED: f64 = 0.25;

impl Bench<'_> {
    /// Values of each member's parameters with their standard deviations; none where others say the same. Rows count as
    /// many samples as the residual is worth.
    pub(crate) fn estimates(&self, picks: &[Pick], on: On) -> Vec<Vec<(f64, Option<f64>)>> {
        let which = self.columns(picks);
        let (factors, _) = self.fit(picks, on);
        let rest = self.rest(picks, &factors);
        let mut weights = self.weights.clone();
        for (d, weight) in weights.iter_mut().enumerate() {
            *weight *= self.worth(&rest, &[d]) / rest[d].len().max(1) as f64;
        }
        let gram = self.pool.gram(&which, &weights, on);
        let n = gram.nrows();
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
                // What is not known to a thousandth of what its column could say is no number of its own.
                let is_known = deviation.is_finite() && variance < 1e9 && factors[k] != 0.0;
                (factors[k], is_known.then_some(deviation))
            };
            all.push((at..at + pick.columns.len()).map(of).collect());
            at += pick.columns.len();
        }
        all
    }

    /// How likely it is that a member is there: by the odds against the set without it, shared with what cannot be told from
    /// it, of which it says how much worse each is. No evidence speaks against causes that nobody has thought of; they are
    /// likelier where something of its channels stays unexplained.
    pub(crate) fn probability(
        &self,
        picks: &[Pick],
        member: usize,
        rivals: &[f64],
        unexplained: &[usize],
    ) -> f64 {
        let mut without = picks.to_vec();
        let pick = without.remove(member);
        let channels = self.acted_on(&[pick]);
        let evidence = self.evidence(&without, picks, &channels);
        let for_it = (0.5 * evidence.bic.clamp(-LOUDEST, LOUDEST)).exp();
        let others = rivals.iter().map(|worse| (-0.5 * worse).exp());
        let share = 1.0 / (1.0 + others.sum::<f64>());
        let outside = if channels.iter().any(|d| unexplained.contains(d)) {
            OUTSIDE_BESIDE_UNEXPLAINED
        } else {
            OUTSIDE
        };
        (1.0 - outside) * share * for_it / (1.0 + for_it)
    }
}
