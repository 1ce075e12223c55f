//! Finite Fourier series, eq. (15) of the paper. Input: coefficients; output: motion and its exact extremes.
//!
//! J. Swevers et al., "Optimal robot excitation and identification", IEEE Trans. Robotics and Automation 13 (1997).

use std::f64::consts::PI;

/// The motion of one coordinate,
/// `q(t) = offset + sum over k = 1.. of mu_k/(k omega) sin(k omega t) - nu_k/(k omega) cos(k omega t)`.
///
/// ```
/// use modelmill_identify::excite::FourierSeries;
/// let series = FourierSeries { offset: 1.0, mu: vec![0.0, 4.0], nu: vec![0.0, 0.0], omega: 2.0 };
/// // 1 + sin(4 t), with rate 4 cos(4 t)
/// let [low, high] = series.extremes(0);
/// assert!((low - 0.0).abs() < 1e-8 && (high - 2.0).abs() < 1e-8);
/// assert_eq!(series.at_time(0.0), [1.0, 4.0, 0.0]);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FourierSeries {
    /// Mean value, rad or m.
    pub offset: f64,
    /// `mu_1, mu_2, ...`, rad/s or m/s.
    pub mu: Vec<f64>,
    /// `nu_1, nu_2, ...`, as many as `mu`, rad/s or m/s.
    pub nu: Vec<f64>,
    /// Angular frequency of the first harmonic, rad/s.
    pub omega: f64,
}

impl FourierSeries {
    /// Coordinate, rate and acceleration at a time in s.
    pub fn at_time(&self, t: f64) -> [f64; 3] {
        let mut motion = [self.offset, 0.0, 0.0];
        for (k, (mu, nu)) in self.mu.iter().zip(&self.nu).enumerate() {
            let w = (k + 1) as f64 * self.omega;
            let (sin, cos) = (w * t).sin_cos();
            motion[0] += (mu * sin - nu * cos) / w;
            motion[1] += mu * cos + nu * sin;
            motion[2] += w * (nu * cos - mu * sin);
        }
        motion
    }

    /// The period, s.
    pub fn period(&self) -> f64 {
        2.0 * PI / self.omega
    }

    /// Bounds of the coordinate (0), its rate (1) or its acceleration (2) at all times: never too narrow, and too wide
    /// by at most 1e-9 of the motion's size.
    pub fn extremes(&self, derivative: usize) -> [f64; 2] {
        let mean = if derivative == 0 { self.offset } else { 0.0 };
        // Cosine and sine of each harmonic.
        let terms: Vec<[f64; 2]> = self
            .mu
            .iter()
            .zip(&self.nu)
            .enumerate()
            .map(|(k, (mu, nu))| {
                let w = (k + 1) as f64 * self.omega;
                match derivative {
                    0 => [-nu / w, mu / w],
                    1 => [*mu, *nu],
                    _ => [w * nu, -w * mu],
                }
            })
            .collect();
        let negative: Vec<[f64; 2]> = terms.iter().map(|[c, s]| [-c, -s]).collect();
        [mean - upper_bound(&negative), mean + upper_bound(&terms)]
    }

    /// The same motion, larger or smaller around its mean value.
    #[must_use]
    pub fn scale_amplitude(&self, factor: f64) -> Self {
        let times = |list: &[f64]| list.iter().map(|x| factor * x).collect();
        Self {
            offset: self.offset,
            mu: times(&self.mu),
            nu: times(&self.nu),
            omega: self.omega,
        }
    }
}

/// Upper bound of `sum of c_k cos(k x) + s_k sin(k x)`, at most 1e-9 of the sum of the amplitudes too high.
///
/// On an interval of width h the sum exceeds its greater end by at most `h^2/8` times a bound of its second derivative.
/// Intervals that may contain the maximum are halved.
fn upper_bound(terms: &[[f64; 2]]) -> f64 {
    let value = |x: f64| -> f64 {
        let harmonics = terms.iter().enumerate();
        harmonics
            .map(|(k, [c, s])| {
                let (sin, cos) = ((k + 1) as f64 * x).sin_cos();
                c * cos + s * sin
            })
            .sum()
    };
    let amplitude = |[c, s]: &[f64; 2]| c.hypot(*s);
    let size: f64 = terms.iter().map(amplitude).sum();
    if size == 0.0 {
        return 0.0;
    }
    let curvature: f64 = terms
        .iter()
        .enumerate()
        .map(|(k, term)| ((k + 1) as f64).powi(2) * amplitude(term))
        .sum();
    let tolerance = 1e-9 * size;
    let pieces = 8 * terms.len();
    let mut width = 2.0 * PI / pieces as f64;
    let ends: Vec<f64> = (0..=pieces).map(|i| value(i as f64 * width)).collect();
    let mut best = ends.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut open: Vec<(f64, f64, f64)> = (0..pieces).map(|i| (i as f64 * width, ends[i], ends[i + 1])).collect();
    while !open.is_empty() {
        let excess = curvature * width * width / 8.0;
        open.retain(|(_, left, right)| left.max(*right) + excess > best + tolerance);
        width *= 0.5;
        let mut halves = Vec::with_capacity(2 * open.len());
        for (x, left, right) in open {
            let middle = value(x + width);
            best = best.max(middle);
            halves.push((x, left, middle));
            halves.push((x + width, middle, right));
        }
        open = halves;
    }
    best + tolerance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::TestNoise;

    fn random(noise: &mut TestNoise, n: usize) -> FourierSeries {
        FourierSeries {
            offset: noise.normal(),
            mu: (0..n).map(|_| noise.normal()).collect(),
            nu: (0..n).map(|_| noise.normal()).collect(),
            omega: 0.5 + noise.uniform(),
        }
    }

    #[test]
    fn extremes_hold_every_value_and_are_reached() {
        let mut noise = TestNoise::new(7);
        for n in 1..=7 {
            let series = random(&mut noise, n);
            for derivative in 0..3 {
                let [low, high] = series.extremes(derivative);
                let values: Vec<f64> = (0..200_000)
                    .map(|i| series.at_time(series.period() * f64::from(i) / 200_000.0)[derivative])
                    .collect();
                let least = values.iter().copied().fold(f64::INFINITY, f64::min);
                let greatest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let size = greatest - least;
                assert!(low <= least && greatest <= high);
                assert!(least - low < 1e-6 * size && high - greatest < 1e-6 * size);
            }
        }
    }

    #[test]
    fn rates_are_derivatives() {
        let series = random(&mut TestNoise::new(3), 5);
        let step = 1e-5;
        for i in 0..20 {
            let t = 0.1 * f64::from(i);
            let (before, now, after) = (series.at_time(t - step), series.at_time(t), series.at_time(t + step));
            for d in 0..2 {
                let slope = (after[d] - before[d]) / (2.0 * step);
                assert!((slope - now[d + 1]).abs() < 1e-6);
            }
        }
    }
}
