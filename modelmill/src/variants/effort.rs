//! Requirements on a drive along motions: force, power and work.

/// Requirements on a drive. Power is the force of the drive times its rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DriveEffort {
    /// The largest magnitude of the force, N or N m.
    pub peak: f64,
    /// Root mean square of the force over all samples, N or N m.
    pub rms: f64,
    /// The largest magnitude of the power, W.
    pub peak_power: f64,
    /// Root mean square of the power over all samples, W.
    pub rms_power: f64,
    /// Work of the drive while its power is positive, J; negative power is not subtracted.
    pub work: f64,
    /// Positive minus negative work, J.
    pub net_work: f64,
}

/// Sums over samples, from which the requirements are computed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EffortSums {
    /// Number of samples.
    samples: usize,
    /// Largest magnitude of the force, N or N m.
    peak: f64,
    /// Sum of squares of the force.
    squares: f64,
    /// Largest magnitude of the power, W.
    peak_power: f64,
    /// Sum of squares of the power.
    squares_of_power: f64,
    /// Positive work, J.
    work: f64,
    /// Positive minus negative work, J.
    net_work: f64,
}

impl EffortSums {
    /// Adds a motion: times, s, forces and rates, one value for each sample. Power is linear between samples.
    pub(super) fn add(&mut self, time: &[f64], force: &[f64], rate: &[f64]) {
        let power: Vec<f64> = force.iter().zip(rate).map(|(f, v)| f * v).collect();
        for (f, p) in force.iter().zip(&power) {
            self.peak = self.peak.max(f.abs());
            self.squares += f * f;
            self.peak_power = self.peak_power.max(p.abs());
            self.squares_of_power += p * p;
        }
        self.samples += time.len();
        for (t, p) in time.windows(2).zip(power.windows(2)) {
            let step = t[1] - t[0];
            self.net_work += 0.5 * step * (p[0] + p[1]);
            self.work += step * mean_of_positive(p[0], p[1]);
        }
    }

    /// The requirements over all motions that were added.
    pub(super) fn effort(self) -> DriveEffort {
        let mean = |squares: f64| (squares / self.samples.max(1) as f64).sqrt();
        DriveEffort {
            peak: self.peak,
            rms: mean(self.squares),
            peak_power: self.peak_power,
            rms_power: mean(self.squares_of_power),
            work: self.work,
            net_work: self.net_work,
        }
    }
}

/// The mean of the positive part of a line from `a` to `b`.
fn mean_of_positive(a: f64, b: f64) -> f64 {
    match (a > 0.0, b > 0.0) {
        (true, true) => 0.5 * (a + b),
        (true, false) => 0.5 * a * a / (a - b),
        (false, true) => 0.5 * b * b / (b - a),
        (false, false) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    #[test]
    fn a_sine_has_its_known_figures() {
        let n = 20_000;
        let angle = |k: usize| 2.0 * PI * k as f64 / n as f64;
        let time: Vec<f64> = (0..=n).map(angle).collect();
        let force: Vec<f64> = time.iter().map(|t| 3.0 * t.sin()).collect();
        let rate: Vec<f64> = time.iter().map(|t| 2.0 * t.cos()).collect();
        let mut gathered = EffortSums::default();
        gathered.add(&time, &force, &rate);
        // Power is 3 sin(2 t): its positive halves hold 3 J each, and nothing is left of a whole turn.
        let found = gathered.effort();
        let close = |found: f64, expected: f64| {
            assert!((found - expected).abs() < 2e-4, "{found} for {expected}");
        };
        close(found.peak, 3.0);
        close(found.rms, 3.0 / 2.0_f64.sqrt());
        close(found.peak_power, 3.0);
        close(found.rms_power, 3.0 / 2.0_f64.sqrt());
        close(found.work, 6.0);
        close(found.net_work, 0.0);
    }

    #[test]
    fn only_what_is_given_counts_as_work() {
        let mut gathered = EffortSums::default();
        // One second from 2 W to -1 W: two thirds of it give 2/3 J; the rest takes 1/6 J up.
        gathered.add(&[0.0, 1.0], &[2.0, -1.0], &[1.0, 1.0]);
        let found = gathered.effort();
        assert!((found.work - 2.0 / 3.0).abs() < 1e-15);
        assert!((found.net_work - 0.5).abs() < 1e-15);
        // Gaps between motions do no work.
        gathered.add(&[10.0], &[5.0], &[1.0]);
        assert!((gathered.effort().net_work - 0.5).abs() < 1e-15);
    }
}
