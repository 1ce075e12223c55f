//! What a model says of a recording before anything is believed: a regressor and the measured forces go in; the delay
//! between force and motion, and what swapping or turning round forces would gain, come out.
//!
//! For a regressor `W = Q R` the best fit to any forces `y` leaves `|y|^2 - |Q'y|^2`, so that one factorisation serves
//! every shift and every permutation of the forces.

use nalgebra::{DMatrix, DVector};

/// How well a regressor can explain forces.
#[derive(Debug, Clone)]
pub struct ForceAudit {
    q: DMatrix<f64>,
    n_channels: usize,
}

/// A delay of the forces behind the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceDelay {
    /// In steps of the recording; negative where the forces come first.
    pub samples: f64,
    /// Standard deviation of `samples`, from the residual and how much it resembles its neighbours.
    pub std: f64,
    /// Relative error of the best fit without and with the delay taken out.
    pub error: [f64; 2],
}

/// Something about the forces that would explain them better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Suspect {
    /// Two channels are exchanged.
    Swapped(usize, usize),
    /// A channel has another sign than the others; of two channels it is not known which.
    Turned(usize),
}

impl ForceAudit {
    /// Factorises a regressor of rows interleaved per sample; `None` if it has fewer rows than twice its columns.
    pub fn new(mut regressor: DMatrix<f64>, n_channels: usize) -> Option<Self> {
        if n_channels == 0 || regressor.nrows() < 2 * regressor.ncols() {
            return None;
        }
        for mut column in regressor.column_iter_mut() {
            let norm = column.norm();
            if norm > 0.0 {
                column /= norm;
            }
        }
        Some(Self {
            q: regressor.qr().q(),
            n_channels,
        })
    }

    /// Relative error of the best fit to forces interleaved per sample; `None` where they are all zero.
    pub fn error(&self, forces: &DVector<f64>) -> Option<f64> {
        let size = forces.norm_squared();
        let explained = self.q.tr_mul(forces).norm_squared();
        (size > 0.0).then(|| ((size - explained).max(0.0) / size).sqrt())
    }

    /// The shift of the forces that the regressor explains best, at most `most` steps to either side.
    /// `samples` are those of the rows in the recording, `forces[channel]` is the whole recording; all shifted samples
    /// must lie in it (asserted).
    /// `None` where the best shift is the largest one, or nothing is measured.
    pub fn delay(&self, samples: &[usize], forces: &[Vec<f64>], most: usize) -> Option<ForceDelay> {
        self.delay_counted(samples, forces, most, |_, _| true)
    }

    /// The same of the rows only of which `counts(row, channel)` says so; the others must be zero in the regressor.
    pub fn delay_counted(
        &self,
        samples: &[usize],
        forces: &[Vec<f64>],
        most: usize,
        counts: impl Fn(usize, usize) -> bool,
    ) -> Option<ForceDelay> {
        let counts = &counts;
        let shifted = |shift: usize| {
            let rows = samples.iter().enumerate().flat_map(|(row, sample)| {
                let at = sample + shift - most;
                let channels = forces.iter().enumerate();
                channels.map(move |(c, channel)| if counts(row, c) { channel[at] } else { 0.0 })
            });
            DVector::from_iterator(samples.len() * forces.len(), rows)
        };
        let errors: Vec<f64> = (0..=2 * most)
            .map(|shift| self.error(&shifted(shift)))
            .collect::<Option<_>>()?;
        let best = (0..errors.len()).min_by(|a, b| errors[*a].total_cmp(&errors[*b]))?;
        if best == 0 || best == 2 * most {
            return None;
        }
        // The squared error is a parabola around its smallest value.
        let [a, b, c] = [best - 1, best, best + 1].map(|i| errors[i] * errors[i]);
        let bend = a - 2.0 * b + c;
        let fraction = if bend > 0.0 {
            0.5 * (a - c) / bend
        } else {
            0.0
        };
        let rows = (0..samples.len())
            .flat_map(|row| (0..forces.len()).map(move |c| (row, c)))
            .filter(|(row, c)| counts(*row, *c))
            .count();
        let forces_then = shifted(best);
        let residual = &forces_then - &self.q * self.q.tr_mul(&forces_then);
        let alike = alike(&residual, forces.len());
        // The curvature of the squared error over the shift tells how sharply it is known.
        let variance = 2.0 * b / (rows.max(1) as f64 * bend.max(f64::MIN_POSITIVE));
        Some(ForceDelay {
            std: (variance * (1.0 + alike) / (1.0 - alike)).sqrt(),
            samples: best as f64 - most as f64 + fraction,
            error: [errors[most], errors[best]],
        })
    }

    /// The exchange or change of sign of forces that lowers the error most, with the error without and with it.
    pub fn suspect(&self, forces: &DVector<f64>) -> Option<(Suspect, [f64; 2])> {
        let n = self.n_channels;
        let now = self.error(forces)?;
        let changed = |change: Suspect| {
            let mut changed = forces.clone();
            for row in 0..forces.len() / n {
                match change {
                    Suspect::Swapped(a, b) => changed.swap((row * n + a, 0), (row * n + b, 0)),
                    Suspect::Turned(a) => changed[row * n + a] *= -1.0,
                }
            }
            changed
        };
        let swaps = (0..n).flat_map(|a| (a + 1..n).map(move |b| Suspect::Swapped(a, b)));
        swaps
            .chain((0..n).map(Suspect::Turned))
            .filter_map(|change| Some((change, [now, self.error(&changed(change))?])))
            .min_by(|a, b| a.1[1].total_cmp(&b.1[1]))
    }
}

/// Correlation of neighbouring rows of a channel, all channels together, at most 0.99.
fn alike(residual: &DVector<f64>, channels: usize) -> f64 {
    let n = residual.len();
    let pairs = (0..n.saturating_sub(channels)).map(|i| residual[i] * residual[i + channels]);
    let size = residual.norm_squared();
    if size > 0.0 {
        (pairs.sum::<f64>() / size).clamp(0.0, 0.99)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_noise::Noise;

    /// Two joints with inertia and friction each, coupled by gravity.
    fn rows(time: impl Fn(usize) -> f64, samples: &[usize]) -> DMatrix<f64> {
        DMatrix::from_row_iterator(
            2 * samples.len(),
            3,
            samples.iter().flat_map(|k| {
                let t = time(*k);
                let (a, b) = ((3.1 * t).sin(), (4.7 * t + 0.3).cos());
                [a, b, 0.2 * a, 0.5 * b, (1.9 * t).sin(), 0.1]
            }),
        )
    }

    const TRUTH: [f64; 3] = [2.0, -1.5, 0.7];

    fn forces(delay: f64, noise: f64) -> (Vec<usize>, Vec<Vec<f64>>) {
        let n = 3000;
        let all: Vec<usize> = (0..n).collect();
        let w = rows(|k| (k as f64 - delay) * 0.002, &all);
        let y = w * DVector::from_row_slice(&TRUTH);
        let mut random = Noise::new(7);
        let channels = (0..2).map(|c| {
            let values = (0..n).map(|k| y[2 * k + c] + noise * random.normal());
            values.collect()
        });
        let channels = channels.collect();
        ((30..n - 30).step_by(3).collect(), channels)
    }

    #[test]
    fn a_delay_is_found_to_a_fraction_of_a_sample() {
        for delay in [0.0, 3.0, 7.4, -2.6] {
            let (samples, forces) = forces(delay, 0.01);
            let explained = ForceAudit::new(rows(|k| k as f64 * 0.002, &samples), 2).unwrap();
            let found = explained.delay(&samples, &forces, 20).unwrap();
            assert!(
                (found.samples - delay).abs() < 0.1,
                "{found:?} instead of {delay}"
            );
            assert!(found.error[1] <= found.error[0] && found.error[1] < 0.02);
            assert!(found.std < 0.05 && (found.samples - delay).abs() < 5.0 * found.std + 0.02);
        }
        let (samples, forces) = forces(25.0, 0.01);
        let explained = ForceAudit::new(rows(|k| k as f64 * 0.002, &samples), 2).unwrap();
        assert_eq!(explained.delay(&samples, &forces, 20), None);
    }

    #[test]
    fn exchanged_and_turned_forces_are_found() {
        let (samples, forces) = forces(0.0, 0.01);
        let explained = ForceAudit::new(rows(|k| k as f64 * 0.002, &samples), 2).unwrap();
        let interleaved = |channels: [&Vec<f64>; 2], sign: f64| {
            let rows = samples
                .iter()
                .flat_map(|k| [channels[0][*k], sign * channels[1][*k]]);
            DVector::from_iterator(2 * samples.len(), rows)
        };
        let swapped = interleaved([&forces[1], &forces[0]], 1.0);
        let (found, [before, after]) = explained.suspect(&swapped).unwrap();
        assert_eq!(found, Suspect::Swapped(0, 1));
        assert!(before > 0.2 && after < 0.02, "{before} {after}");
        let turned = interleaved([&forces[0], &forces[1]], -1.0);
        // With two channels the one cannot be told from the other: all parameters may change their signs.
        let (found, [before, after]) = explained.suspect(&turned).unwrap();
        assert!(matches!(found, Suspect::Turned(_)));
        assert!(before > 0.2 && after < 0.02, "{before} {after}");
    }
}
