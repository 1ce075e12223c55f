//! Coloured noise as an autoregressive process, and the filter that whitens it. Input: a residual; output:
//! coefficients, and filtered series.

/// Highest order of the process that is tried.
const MAX_ORDER: usize = 40;

/// An autoregression: `e_t = a_1 e_(t-1) + ... + a_p e_(t-p) + w_t` with white `w` (Box and Jenkins, Time Series
/// Analysis).
#[derive(Clone, Debug, PartialEq)]
pub struct AutoregressiveNoise {
    /// `a_1` to `a_p`; none for white noise.
    pub coefficients: Vec<f64>,
    /// Standard deviation of `w`, in the unit of the residual; 0 if the residual is zero.
    pub standard_deviation: f64,
    /// Best predictions from fewer than `p` past values, for the start of a segment: `[past values]`.
    starts: Vec<ShortPrediction>,
}

/// The best prediction of a value from the few values before it.
#[derive(Clone, Debug, PartialEq)]
struct ShortPrediction {
    /// Coefficients of the values before, the nearest first.
    coefficients: Vec<f64>,
    /// Standard deviation of its error, in the unit of the residual.
    standard_deviation: f64,
}

impl AutoregressiveNoise {
    /// Estimates the process from a residual in segments by the Yule-Walker equations (Levinson-Durbin recursion), with
    /// the order that minimises Schwarz' criterion. `floor` is the rms value of additional white noise, in the unit of
    /// the residual: the residual of a nearly exact model would otherwise be predicted too well.
    pub fn from_residual(segments: &[&[f64]], floor: f64) -> Self {
        let n: usize = segments.iter().map(|s| s.len()).sum();
        // Lags that few segments are long enough for cannot be estimated.
        let pairs = |lag: usize| segments.iter().map(|s| s.len().saturating_sub(lag)).sum::<usize>();
        let highest = (1..=MAX_ORDER.min(n / 20))
            .take_while(|lag| 2 * pairs(*lag) > n)
            .count();
        // Autocovariances; products never cross the border of a segment.
        let mut covariance: Vec<f64> = (0..=highest)
            .map(|lag| {
                let of_stretch = |s: &&[f64]| -> f64 {
                    let later = s.get(lag..).unwrap_or_default();
                    later.iter().zip(s.iter()).map(|(a, b)| a * b).sum()
                };
                // One segment has `n - lag` products. Borders remove more of them, which must not look like a
                // shorter memory.
                let lost = (n - lag) as f64 / pairs(lag).max(1) as f64;
                segments.iter().map(of_stretch).sum::<f64>() * lost / n.max(1) as f64
            })
            .collect();
        // White noise adds to the variance only.
        covariance[0] += floor * floor;
        let mut best = (f64::INFINITY, Vec::new(), covariance[0]);
        let (mut a, mut variance): (Vec<f64>, f64) = (Vec::new(), covariance[0]);
        let mut starts = Vec::new();
        // Levinson-Durbin: each order follows from the one before.
        for order in 0..=highest {
            if order > 0 {
                let known: f64 = (0..order - 1).map(|i| a[i] * covariance[order - 1 - i]).sum();
                let reflection = (covariance[order] - known) / variance;
                let before = a.clone();
                for i in 0..order - 1 {
                    a[i] = before[i] - reflection * before[order - 2 - i];
                }
                a.push(reflection);
                variance *= 1.0 - reflection * reflection;
            }
            // The series is predicted exactly up to rounding; higher orders are meaningless.
            if variance <= 1e-12 * covariance[0] {
                break;
            }
            // Schwarz' criterion: likelihood and number of coefficients.
            let cost = n as f64 * variance.ln() + order as f64 * (n as f64).ln();
            starts.push(ShortPrediction {
                coefficients: a.clone(),
                standard_deviation: variance.sqrt(),
            });
            if cost < best.0 {
                best = (cost, a.clone(), variance);
            }
        }
        // The recursion has found the predictions of all lower orders on its way.
        starts.truncate(best.1.len());
        Self {
            starts,
            coefficients: best.1,
            standard_deviation: best.2.max(0.0).sqrt(),
        }
    }

    /// Whitened series of one segment, in standard deviations of `w`. The first values have a short past and are
    /// predicted from that, so that segments between many gaps lose nothing.
    pub fn whiten(&self, series: &[f64]) -> Vec<f64> {
        let white = |t: usize| {
            let (coefficients, standard_deviation) = match self.starts.get(t) {
                Some(start) => (&start.coefficients, start.standard_deviation),
                None => (&self.coefficients, self.standard_deviation),
            };
            let past = coefficients.iter().enumerate();
            let known: f64 = past.map(|(i, a)| a * series[t - 1 - i]).sum();
            (series[t] - known) / standard_deviation
        };
        (0..series.len()).map(white).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    #[test]
    fn noise_through_a_filter_comes_out_white() {
        let mut noise = TestNoise::new(4);
        let truth = [1.6, -0.8];
        let mut series = vec![0.0; 20_000];
        for t in 2..series.len() {
            series[t] = truth[0] * series[t - 1] + truth[1] * series[t - 2] + 0.3 * noise.normal();
        }
        let (first, second) = series.split_at(7_000);
        let found = AutoregressiveNoise::from_residual(&[first, second], 0.0);
        assert!((found.standard_deviation - 0.3).abs() < 0.01, "{found:?}");
        assert_eq!(found.coefficients.len(), 2, "{found:?}");
        for (a, b) in found.coefficients.iter().zip(truth) {
            assert!((a - b).abs() < 0.02, "{found:?}");
        }
        let white = found.whiten(&series);
        let n = white.len() as f64;
        let product = |lag: usize| -> f64 { white[lag..].iter().zip(&white).map(|(a, b)| a * b).sum::<f64>() / n };
        assert!((product(0) - 1.0).abs() < 0.05);
        assert!((1..20).all(|lag| product(lag).abs() < 0.03));
    }

    /// Short segments have the same memory as long ones, and their first values count with variance 1.
    #[test]
    fn segments_between_gaps_come_out_white_from_their_start() {
        let mut noise = TestNoise::new(6);
        let mut series = vec![0.0; 24_000];
        for t in 2..series.len() {
            series[t] = 1.6 * series[t - 1] - 0.8 * series[t - 2] + 0.3 * noise.normal();
        }
        // Segments of 24 values, with a gap after each.
        let segments: Vec<&[f64]> = series.chunks(30).map(|some| &some[..24]).collect();
        let found = AutoregressiveNoise::from_residual(&segments, 0.0);
        assert!((found.standard_deviation - 0.3).abs() < 0.01, "{found:?}");
        let white: Vec<Vec<f64>> = segments.iter().map(|some| found.whiten(some)).collect();
        for t in 0..24 {
            let variance = white.iter().map(|some| some[t] * some[t]).sum::<f64>() / white.len() as f64;
            assert!((variance - 1.0).abs() < 0.2, "{t}: {variance}");
        }
    }

    #[test]
    fn white_noise_and_nothing_have_no_memory() {
        let mut noise = TestNoise::new(9);
        let white: Vec<f64> = (0..5_000).map(|_| noise.normal()).collect();
        assert!(AutoregressiveNoise::from_residual(&[&white], 0.0).coefficients.len() < 3);
        let nothing = AutoregressiveNoise::from_residual(&[&[0.0; 100]], 0.0);
        assert_eq!((nothing.coefficients.len(), nothing.standard_deviation), (0, 0.0));
        // A wave is foreseen without an error, but not below the floor.
        let wave: Vec<f64> = (0..5_000).map(|i| (0.1 * f64::from(i)).sin()).collect();
        assert!(AutoregressiveNoise::from_residual(&[&wave], 0.0).standard_deviation < 0.01);
        assert!(AutoregressiveNoise::from_residual(&[&wave], 0.1).standard_deviation > 0.1);
    }
}
