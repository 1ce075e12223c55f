//! White noise of a force, and the effective number of samples of a residual.

pub use crate::signal::white_noise;

/// Effective number of independent values of a series: `n / (1 + 2 sum of its autocorrelations)`, summed as long as the
/// sum of two neighbouring autocorrelations is positive (C. J. Geyer, Statistical Science 7, 1992). Between 2 and `n`.
pub fn effective_samples(values: &[f64]) -> f64 {
    let n = values.len();
    let mean = values.iter().sum::<f64>() / n.max(1) as f64;
    let centred: Vec<f64> = values.iter().map(|x| x - mean).collect();
    let variance = crate::signal::dot(&centred, &centred);
    if n < 4 || variance == 0.0 {
        return n as f64;
    }
    let correlation = |lag: usize| crate::signal::dot(&centred[..n - lag], &centred[lag..]) / variance;
    // The sum starts at 1; pairs of lags follow up to a quarter of the series.
    let mut sum = 1.0;
    let mut lag = 1;
    while lag + 1 < n / 4 {
        let pair = correlation(lag) + correlation(lag + 1);
        if pair <= 0.0 {
            break;
        }
        sum += 2.0 * pair;
        lag += 2;
    }
    (n as f64 / sum).clamp(2.0, n as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    #[test]
    fn noise_is_seen_under_motion_and_jumps() {
        let mut noise = TestNoise::new(3);
        let signal: Vec<f64> = (0..4000)
            .map(|i| {
                let t = 0.004 * f64::from(i);
                300.0 * t.sin() + 25.0 * (2.0 * t).cos().signum() + 2.0 * noise.normal()
            })
            .collect();
        assert!((white_noise(&signal) - 2.0).abs() < 0.1);
    }

    #[test]
    fn a_filtered_series_is_worth_less() {
        let mut noise = TestNoise::new(5);
        let mut last = 0.0;
        let white: Vec<f64> = (0..20_000).map(|_| noise.normal()).collect();
        let red: Vec<f64> = white
            .iter()
            .map(|e| {
                last = 0.9 * last + e;
                last
            })
            .collect();
        assert!(effective_samples(&white) > 15_000.0);
        // (1 + 0.9) / (1 - 0.9) = 19 for such a series.
        let worth = 20_000.0 / effective_samples(&red);
        assert!((14.0..25.0).contains(&worth), "{worth}");
    }
}
