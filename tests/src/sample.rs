//! States of motion to evaluate a model at.

use modelmill_codegen::{ModelEvaluator, MotionStates};
use modelmill_spec::Mechanism;

use crate::fixtures::Table;
use crate::stream::Stream;

/// States of the active coordinates, owned; one vector per coordinate.
#[derive(Clone, Debug, Default)]
pub struct Sample {
    /// Coordinates, rad or m.
    pub q: Vec<Vec<f64>>,
    /// Rates.
    pub qd: Vec<Vec<f64>>,
    /// Accelerations.
    pub qdd: Vec<Vec<f64>>,
    /// Loads of the drives.
    pub load: Vec<Vec<f64>>,
}

impl Sample {
    /// `n` random states: coordinates within `reach` of the nominal pose (half of it for lengths).
    pub fn random(mechanism: &Mechanism, n: usize, reach: f64, stream: &mut Stream) -> Self {
        let mut sample = Self::default();
        for coordinate in mechanism.coordinates.iter().filter(|c| !c.passive) {
            let reach = if coordinate.motion.is_angle() {
                reach
            } else {
                0.5 * reach
            };
            let mut draw = |centre: f64, reach: f64| -> Vec<f64> {
                (0..n).map(|_| centre + stream.between(-reach, reach)).collect()
            };
            sample.q.push(draw(coordinate.nominal, reach));
            let (rates, accelerations) = (draw(0.0, 2.0), draw(0.0, 8.0));
            let moved = f64::from(u8::from(coordinate.motion.has_rate()));
            sample.qd.push(rates.iter().map(|x| moved * x).collect());
            sample.qdd.push(accelerations.iter().map(|x| moved * x).collect());
        }
        for _ in &mechanism.drives {
            let mut draw = || (0..n).map(|_| stream.between(-50.0, 50.0)).collect();
            sample.load.push(draw());
        }
        sample
    }

    /// The states in the columns `q`, `q_d` and `q_dd` of a table, for every active coordinate.
    pub fn from_table(mechanism: &Mechanism, table: &Table) -> Self {
        let mut sample = Self::default();
        for coordinate in mechanism.coordinates.iter().filter(|c| !c.passive) {
            let column = |suffix: &str| table.column(&format!("{}{suffix}", coordinate.name));
            sample.q.push(column("").to_vec());
            sample.qd.push(column("_d").to_vec());
            sample.qdd.push(column("_dd").to_vec());
        }
        sample
    }

    /// As the evaluator takes them.
    pub fn states(&self) -> MotionStates<'_> {
        MotionStates {
            q: self.q.iter().map(Vec::as_slice).collect(),
            qd: self.qd.iter().map(Vec::as_slice).collect(),
            qdd: self.qdd.iter().map(Vec::as_slice).collect(),
            load: self.load.iter().map(Vec::as_slice).collect(),
        }
    }
    /// Number of states.
    pub fn len(&self) -> usize {
        self.q.first().map_or(0, Vec::len)
    }

    /// Whether there is no state.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The states for which `keep` holds.
    #[must_use]
    pub fn filtered(&self, keep: impl Fn(usize) -> bool) -> Self {
        let kept: Vec<usize> = (0..self.len()).filter(|i| keep(*i)).collect();
        let filter = |columns: &[Vec<f64>]| columns.iter().map(|c| kept.iter().map(|i| c[*i]).collect()).collect();
        Self {
            q: filter(&self.q),
            qd: filter(&self.qd),
            qdd: filter(&self.qdd),
            load: filter(&self.load),
        }
    }

    /// State number `i` alone.
    #[must_use]
    pub fn only(&self, i: usize) -> Self {
        self.filtered(|k| k == i)
    }

    /// The states that the mechanism can take, away from singular ones.
    #[must_use]
    pub fn reachable(&self, evaluator: &ModelEvaluator<'_>) -> Self {
        self.filtered(|i| {
            let one = self.only(i);
            evaluator.check_states(&one.states()).is_ok()
        })
    }
}
