//! Trajectories: sampled coordinates with derivatives go in, the state at any time comes out.
//!
//! Between samples each coordinate is the polynomial of degree five that has value, rate and acceleration of both
//! neighbours (Hermite). Missing derivatives are finite differences over the five nearest samples, exact for
//! polynomials of degree four on any spacing: B. Fornberg, "Generation of finite difference formulas on
//! arbitrarily spaced grids" (1988).

use std::fmt;

use crate::kinematics::RigState;

/// Samples that a finite difference needs.
const STENCIL: usize = 5;

/// A prescribed motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory {
    /// Times, s, increasing.
    time: Vec<f64>,
    /// Samples of every coordinate, with all derivatives.
    coordinates: Vec<CoordinateSamples>,
}

/// One coordinate along the trajectory, as long as the times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CoordinateSamples {
    /// Values, rad or m.
    pub q: Vec<f64>,
    /// Rates; if missing, finite differences of the values are used.
    pub qd: Option<Vec<f64>>,
    /// Accelerations; if missing, finite differences of the rates, or else of the values, are used.
    pub qdd: Option<Vec<f64>>,
}

/// Why columns do not form a trajectory.
#[derive(Clone, Debug, PartialEq)]
pub enum TrajectoryError {
    /// There is no sample.
    Empty,
    /// A time is not later than the one before it.
    TimeGoesBack {
        /// Index of the sample, from 0.
        sample: usize,
    },
    /// A column has another length than the times, or a value that is not finite.
    Faulty {
        /// Index of the coordinate.
        coordinate: usize,
    },
    /// Derivatives are missing, and there are too few samples to compute them.
    TooShort,
}

impl fmt::Display for TrajectoryError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => write!(f, "the trajectory has no samples"),
            Self::TimeGoesBack { sample } => write!(
                f,
                "the time of sample {} is not later than the one before it; sort the samples by `t`",
                sample + 1
            ),
            Self::Faulty { coordinate } => write!(
                f,
                "the columns of coordinate {} do not have one finite number per time",
                coordinate + 1
            ),
            Self::TooShort => write!(
                f,
                "derivatives are missing, and computing them takes at least {STENCIL} samples; add samples, or the \
                 columns with `_d` and `_dd`"
            ),
        }
    }
}

impl std::error::Error for TrajectoryError {}

impl Trajectory {
    /// From times, s, and one entry per coordinate.
    ///
    /// Fails if times do not increase, lengths differ, or derivatives cannot be computed.
    pub fn new(time: Vec<f64>, coordinates: Vec<CoordinateSamples>) -> Result<Self, TrajectoryError> {
        if time.is_empty() {
            return Err(TrajectoryError::Empty);
        }
        let grows = |pair: &[f64]| pair[0] < pair[1] && (pair[1] - pair[0]).is_finite();
        if let Some(at) = time.windows(2).position(|pair| !grows(pair)) {
            return Err(TrajectoryError::TimeGoesBack { sample: at + 1 });
        }
        let sound = |column: &[f64]| column.len() == time.len() && column.iter().all(|x| x.is_finite());
        let mut complete = Vec::new();
        for (k, given) in coordinates.into_iter().enumerate() {
            let columns = [Some(&given.q), given.qd.as_ref(), given.qdd.as_ref()];
            if !columns.into_iter().flatten().all(|column| sound(column)) {
                return Err(TrajectoryError::Faulty { coordinate: k });
            }
            if (given.qd.is_none() || given.qdd.is_none()) && time.len() < STENCIL {
                return Err(TrajectoryError::TooShort);
            }
            let qdd = given.qdd.unwrap_or_else(|| match &given.qd {
                Some(qd) => differences(&time, qd, 1),
                None => differences(&time, &given.q, 2),
            });
            let qd = given.qd.unwrap_or_else(|| differences(&time, &given.q, 1));
            complete.push(CoordinateSamples {
                q: given.q,
                qd: Some(qd),
                qdd: Some(qdd),
            });
        }
        Ok(Self {
            time,
            coordinates: complete,
        })
    }

    /// From times, s, and a function that returns the state at each, for example a Fourier series.
    ///
    /// Fails if times do not increase or a state is not finite.
    pub fn from_function(time: Vec<f64>, state: impl Fn(f64) -> RigState) -> Result<Self, TrajectoryError> {
        let states: Vec<RigState> = time.iter().map(|t| state(*t)).collect();
        let n = states.first().map_or(0, |state| state.q.len());
        let column = |of: fn(&RigState) -> &Vec<f64>, k: usize| -> Vec<f64> {
            states.iter().filter_map(|state| of(state).get(k).copied()).collect()
        };
        let samples = (0..n).map(|k| CoordinateSamples {
            q: column(|state| &state.q, k),
            qd: Some(column(|state| &state.qd, k)),
            qdd: Some(column(|state| &state.qdd, k)),
        });
        let samples = samples.collect();
        Self::new(time, samples)
    }

    /// Times of the samples, s; at least one, increasing.
    pub fn time(&self) -> &[f64] {
        &self.time
    }

    /// Number of coordinates.
    pub fn n_coordinates(&self) -> usize {
        self.coordinates.len()
    }

    /// The state at a time; before the first and after the last sample the nearest polynomial is continued.
    pub fn state_at(&self, t: f64) -> RigState {
        let n = self.time.len();
        let after = self.time.partition_point(|sample| *sample <= t);
        // At a sample its own numbers are returned, bit for bit.
        if after > 0 && self.time[after - 1].to_bits() == t.to_bits() {
            return self.sample(after - 1);
        }
        if n == 1 {
            return self.sample(0);
        }
        let i = after.clamp(1, n - 1) - 1;
        let (left, right) = (self.sample(i), self.sample(i + 1));
        let h = self.time[i + 1] - self.time[i];
        let mut state = RigState::default();
        for k in 0..self.coordinates.len() {
            let ends = |s: &RigState| [s.q[k], h * s.qd[k], h * h * s.qdd[k]];
            let [q, qd, qdd] = quintic_hermite(ends(&left), ends(&right), (t - self.time[i]) / h);
            state.q.push(q);
            state.qd.push(qd / h);
            state.qdd.push(qdd / (h * h));
        }
        state
    }

    /// The state at sample `i`.
    fn sample(&self, i: usize) -> RigState {
        let of = |column: &Option<Vec<f64>>| column.as_ref().map_or(0.0, |column| column[i]);
        RigState {
            q: self.coordinates.iter().map(|c| c.q[i]).collect(),
            qd: self.coordinates.iter().map(|c| of(&c.qd)).collect(),
            qdd: self.coordinates.iter().map(|c| of(&c.qdd)).collect(),
        }
    }
}

/// Value and two derivatives, at `s` between 0 and 1, of the polynomial of degree five with given ones at both ends.
fn quintic_hermite(left: [f64; 3], right: [f64; 3], s: f64) -> [f64; 3] {
    // Around the left end: c0..c2 are its values, and c3..c5 are determined by the right end.
    let [c0, c1, c2] = [left[0], left[1], 0.5 * left[2]];
    let value = right[0] - c0 - c1 - c2;
    let rate = right[1] - c1 - 2.0 * c2;
    let bend = 0.5 * right[2] - c2;
    let c3 = 10.0 * value - 4.0 * rate + bend;
    let c4 = -15.0 * value + 7.0 * rate - 2.0 * bend;
    let c5 = 6.0 * value - 3.0 * rate + bend;
    [
        c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5)))),
        c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5))),
        2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5)),
    ]
}

/// The derivative of an order, 1 or 2, at each time from the five nearest samples.
fn differences(time: &[f64], values: &[f64], order: usize) -> Vec<f64> {
    (0..time.len())
        .map(|i| {
            let first = i.saturating_sub(STENCIL / 2).min(time.len() - STENCIL);
            let weights = fornberg_weights(time[i], &time[first..first + STENCIL], order);
            // Differences to the middle value: constants drop out exactly.
            weights
                .iter()
                .zip(&values[first..])
                .map(|(weight, value)| weight * (value - values[i]))
                .sum()
        })
        .collect()
}

/// Fornberg's weights of a derivative at `z` from samples at `x`.
fn fornberg_weights(z: f64, x: &[f64], order: usize) -> Vec<f64> {
    let mut c = vec![vec![0.0; order + 1]; x.len()];
    c[0][0] = 1.0;
    let mut c1 = 1.0;
    let mut c4 = x[0] - z;
    for i in 1..x.len() {
        let most = i.min(order);
        let mut c2 = 1.0;
        let c5 = c4;
        c4 = x[i] - z;
        for j in 0..i {
            let c3 = x[i] - x[j];
            c2 *= c3;
            if j + 1 == i {
                for k in (1..=most).rev() {
                    c[i][k] = c1 * (k as f64 * c[i - 1][k - 1] - c5 * c[i - 1][k]) / c2;
                }
                c[i][0] = -c1 * c5 * c[i - 1][0] / c2;
            }
            for k in (1..=most).rev() {
                c[j][k] = (c4 * c[j][k] - k as f64 * c[j][k - 1]) / c3;
            }
            c[j][0] = c4 * c[j][0] / c3;
        }
        c1 = c2;
    }
    c.iter().map(|row| row[order]).collect()
}

#[cfg(test)]
mod tests {
    use super::{CoordinateSamples, Trajectory, TrajectoryError};

    const TIME: [f64; 7] = [0.0, 0.1, 0.25, 0.3, 0.45, 0.6, 0.7];

    fn along(f: impl Fn(f64) -> f64) -> Vec<f64> {
        TIME.iter().map(|t| f(*t)).collect()
    }

    #[test]
    fn polynomials_of_degree_four_are_differentiated_exactly() {
        let q = along(|t| 1.0 - t + 2.0 * t * t - t.powi(4));
        let only = CoordinateSamples { q, qd: None, qdd: None };
        let trajectory = Trajectory::new(TIME.to_vec(), vec![only]).expect("enough samples");
        for t in TIME {
            let state = trajectory.state_at(t);
            assert!((state.qd[0] - (-1.0 + 4.0 * t - 4.0 * t.powi(3))).abs() < 1e-11);
            assert!((state.qdd[0] - (4.0 - 12.0 * t * t)).abs() < 1e-10);
        }
    }

    #[test]
    fn polynomials_of_degree_five_are_met_between_samples() {
        let samples = CoordinateSamples {
            q: along(|t| t.powi(5)),
            qd: Some(along(|t| 5.0 * t.powi(4))),
            qdd: Some(along(|t| 20.0 * t.powi(3))),
        };
        let trajectory = Trajectory::new(TIME.to_vec(), vec![samples]).expect("sound");
        for t in [0.05_f64, 0.27, 0.69, 0.75] {
            let state = trajectory.state_at(t);
            assert!((state.q[0] - t.powi(5)).abs() < 1e-14);
            assert!((state.qd[0] - 5.0 * t.powi(4)).abs() < 1e-12);
            assert!((state.qdd[0] - 20.0 * t.powi(3)).abs() < 1e-11);
        }
    }

    #[test]
    fn faults_are_named() {
        let one = |q: &[f64]| {
            vec![CoordinateSamples {
                q: q.to_vec(),
                qd: None,
                qdd: None,
            }]
        };
        let new = |time: &[f64], q: &[f64]| Trajectory::new(time.to_vec(), one(q)).unwrap_err();
        assert_eq!(new(&[], &[]), TrajectoryError::Empty);
        assert_eq!(
            new(&[0.0, 0.1, 0.1], &[0.0; 3]),
            TrajectoryError::TimeGoesBack { sample: 2 }
        );
        assert_eq!(new(&[0.0, 0.1], &[0.0; 3]), TrajectoryError::Faulty { coordinate: 0 });
        assert_eq!(new(&[0.0, 0.1], &[0.0; 2]), TrajectoryError::TooShort);
    }
}
