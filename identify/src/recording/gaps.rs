//! Gaps in time: a recording goes in, the stretches between its gaps come out.

use crate::recording::SignalRecording;
use crate::signal::median;

/// Steps of time above this many times the usual one are gaps, across which nothing is filtered.
pub(crate) const GAP: f64 = 5.0;

impl SignalRecording {
    /// The recording cut at its gaps in time that are longer than `bridged`, s, each stretch with its lines; the whole if there
    /// are none.
    pub(crate) fn split_at_gaps(&self, bridged: f64) -> Vec<Self> {
        let Ok(time) = self.column("t") else {
            return vec![self.clone()];
        };
        let usual = median(time.windows(2).map(|w| w[1] - w[0]).collect());
        let mut edges = vec![0];
        edges.extend(
            (1..time.len())
                .filter(|i| time[*i] - time[*i - 1] > (GAP * usual).max(bridged) && usual > 0.0),
        );
        edges.push(time.len());
        if edges.len() == 2 {
            return vec![self.clone()];
        }
        edges
            .windows(2)
            .map(|edge| {
                let name = format!("{} from t = {} s on", self.file(), time[edge[0]]);
                self.extract_segment(name, edge[0], edge[1])
            })
            .collect()
    }
}
