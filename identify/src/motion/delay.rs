//! Delayed force signals: the states of a run are taken earlier by the delay.
//!
//! The forces keep their samples with noise and jumps. States are smooth, so that they can be interpolated by the
//! cubic through the four nearest samples (Lagrange). A sample whose states would lie outside of the recording is
//! dropped.
//!
//! Decision: the states are shifted and not the forces, because states are smooth while forces jump at reversals
//! and are noisy.

use crate::motion::run::PreparedRun;

impl PreparedRun {
    /// Pairs every force with the states `delay` seconds before it. Returns how many samples at the start and at the
    /// end are dropped because states are missing. A negative delay pairs it with later states.
    ///
    /// `None` leaves the run unchanged, because fewer than four samples would remain.
    pub fn shift_states_by_delay(&mut self, delay: f64) -> Option<(usize, usize)> {
        let n = self.time.len();
        let (Some(&first), Some(&last)) = (self.time.first(), self.time.last()) else {
            return None;
        };
        // A delay of a multiple of the sampling time must not fail by rounding.
        let slack = 1e-9 * (last - first);
        let start = self.time.partition_point(|t| t - delay < first - slack);
        let end = self.time.partition_point(|t| t - delay <= last + slack);
        if n < 4 || end < start + 4 {
            return None;
        }
        // Weights for each remaining sample; the same for all coordinates.
        let stencils: Vec<(usize, [f64; 4])> = self.time[start..end]
            .iter()
            .map(|t| cubic_stencil(&self.time, t - delay))
            .collect();
        let states = (self.q.iter_mut()).chain(&mut self.qd).chain(&mut self.qdd);
        for column in states {
            *column = stencils
                .iter()
                .map(|(at, weights)| (0..4).map(|k| weights[k] * column[at + k]).sum())
                .collect();
        }
        // Times, forces and lines keep their values, but lose the dropped samples.
        let cut = |column: &mut Vec<f64>| {
            column.truncate(end);
            column.drain(..start);
        };
        cut(&mut self.time);
        self.force.iter_mut().flatten().for_each(cut);
        for out in &mut self.left_out {
            out.truncate(end);
            out.drain(..start);
        }
        self.lines.truncate(end);
        self.lines.drain(..start);
        Some((start, n - end))
    }
}

/// Index of the first of the four samples around a time, and their weights in the cubic through them.
fn cubic_stencil(time: &[f64], at: f64) -> (usize, [f64; 4]) {
    let above = time.partition_point(|t| *t < at);
    let first = above.saturating_sub(2).min(time.len() - 4);
    let nodes = &time[first..first + 4];
    let weight = |k: usize| {
        (0..4)
            .filter(|j| *j != k)
            .map(|j| (at - nodes[j]) / (nodes[k] - nodes[j]))
            .product()
    };
    (first, std::array::from_fn(weight))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uneven samples of cubics, with the time itself as the force.
    fn run(n: u32) -> PreparedRun {
        let time: Vec<f64> = (0..n).map(|i| 0.01 * f64::from(i) + 0.003 * f64::from(i % 3)).collect();
        let column = |of: fn(f64) -> f64| vec![time.iter().map(|t| of(*t)).collect()];
        let states = [
            column(|t| t * t * t - t),
            column(|t| 3.0 * t * t - 1.0),
            column(|t| 6.0 * t),
        ];
        let force = Some(vec![time.clone()]);
        PreparedRun {
            lines: (2..u64::from(n) + 2).collect(),
            ..PreparedRun::from_states("run.csv".to_owned(), time, states, force)
        }
    }

    #[test]
    fn cubics_are_met_exactly_and_lost_samples_are_counted() {
        for delay in [0.0, 0.0042, -0.0042, 0.013, 0.25] {
            let mut moved = run(60);
            let lost = moved.shift_states_by_delay(delay).expect("samples are left");
            let n = moved.time.len();
            assert_eq!(n + lost.0 + lost.1, 60);
            assert_eq!(lost.0 > 0, delay > 0.0);
            assert_eq!(lost.1 > 0, delay < 0.0);
            assert_eq!(moved.lines.len(), n);
            for i in 0..n {
                let t = moved.time[i] - delay;
                assert!((moved.q[0][i] - (t * t * t - t)).abs() < 1e-14);
                assert!((moved.qd[0][i] - (3.0 * t * t - 1.0)).abs() < 1e-13);
                assert!((moved.qdd[0][i] - 6.0 * t).abs() < 1e-13);
                let force = moved.force.as_ref().expect("a force")[0][i];
                assert_eq!(force.to_bits(), moved.time[i].to_bits(), "forces stay");
                let line = u64::try_from(i + lost.0 + 2).expect("a line");
                assert_eq!(moved.lines[i], line);
            }
        }
    }

    #[test]
    fn a_delay_beyond_the_recording_leaves_it() {
        let mut short = run(10);
        assert_eq!(short.shift_states_by_delay(5.0), None);
        assert_eq!(short.time.len(), 10);
        assert_eq!(run(3).shift_states_by_delay(0.0), None);
    }
}
