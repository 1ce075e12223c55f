//! Gaps in time: a recording goes in, the segments between its gaps come out.

use crate::recording::SignalRecording;
use crate::recording::thresholds::GAP_LEAST_STEPS;
use crate::signal::median;

impl SignalRecording {
    /// Splits the recording at its gaps in time that are also longer than `bridged`, s. Each segment keeps the lines
    /// of its samples. Without gaps the only segment is the recording itself.
    pub(crate) fn split_at_gaps(&self, bridged: f64) -> Vec<Self> {
        let Ok(time) = self.column("t") else {
            return vec![self.clone()];
        };
        // The median step is not affected by the gaps.
        let usual = median(time.windows(2).map(|w| w[1] - w[0]).collect());
        // Sample indices at which segments start, with both ends of the recording.
        let mut edges = vec![0];
        edges.extend(
            (1..time.len()).filter(|i| time[*i] - time[*i - 1] > (GAP_LEAST_STEPS * usual).max(bridged) && usual > 0.0),
        );
        edges.push(time.len());
        if edges.len() == 2 {
            return vec![self.clone()];
        }
        edges
            // The name of a segment states its start time.
            .windows(2)
            .map(|edge| {
                let name = format!("{} from t = {} s on", self.file(), time[edge[0]]);
                self.extract_segment(name, edge[0], edge[1])
            })
            .collect()
    }
}
