//! Intervals in which a force is constant except for white noise.

use modelmill_identify::diagnose::white_noise;
use modelmill_identify::float_to_count;

use super::super::thresholds::{SILENCE_FEWEST_SAMPLES, SILENCE_NOISE_SIGMAS, SILENCE_SHORTEST_S};
use super::{SilenceCandidate, SilenceEvidence};
use crate::segment::RecordingSegment;

/// Duration of a block whose mean is compared with the level, s.
const BLOCK_S: f64 = 0.05;
/// Fewest samples of a block.
const BLOCK_FEWEST: usize = 8;

/// Intervals of a segment in which the force of a drive is constant except for white noise.
pub(super) fn flat_intervals(drive: usize, data: &RecordingSegment) -> Vec<SilenceCandidate> {
    let run = &data.run;
    let (Some(forces), Some(first), Some(last)) = (run.force.as_deref(), run.time.first(), run.time.last()) else {
        return Vec::new();
    };
    let (force, n) = (&forces[drive], run.time.len());
    let step = (last - first) / (n.max(2) - 1) as f64;
    let block = count(BLOCK_S / step).max(BLOCK_FEWEST);
    let shortest = count(SILENCE_SHORTEST_S / step).max(SILENCE_FEWEST_SAMPLES);
    let largest = force.iter().fold(0.0_f64, |most, f| most.max(f.abs()));
    let noise = white_noise(force).max(1e-9 * largest);
    // The mean of a block has less noise than a sample.
    let tolerance = SILENCE_NOISE_SIGMAS * noise / (block as f64).sqrt();
    let near = |sample: usize, level: f64| (force[sample] - level).abs() <= SILENCE_NOISE_SIGMAS * noise;
    let mean = |range: std::ops::Range<usize>| force[range.clone()].iter().sum::<f64>() / range.len() as f64;
    let mut found: Vec<SilenceCandidate> = Vec::new();
    let (mut start, mut last_from, mut last_end) = (0, 0, 0);
    while start + block <= n {
        let mut level = mean(start..start + block);
        let mut end = start;
        // Blocks follow as long as their mean is that of those before, and all samples are noise about it.
        while end + block <= n
            && (mean(end..end + block) - level).abs() <= tolerance
            && (end..end + block).all(|k| near(k, level))
        {
            let share = block as f64 / (end + block - start) as f64;
            level += share * (mean(end..end + block) - level);
            end += block;
        }
        if end - start < shortest {
            start += block;
            continue;
        }
        // The ends lie within the neighbouring blocks.
        let level = mean(start..end);
        let mut from = start;
        while from > 0 && start - from < block && near(from - 1, level) {
            from -= 1;
        }
        while end < n && near(end, level) {
            end += 1;
        }
        // Samples that were dropped at the ends of the recording belong to an interval that reaches them.
        let dropped = |is_at_end: bool, samples: usize| if is_at_end { (samples + 1) as f64 * step } else { 0.0 };
        let interval = [run.time[from], run.time[end - 1]];
        let reach = [
            interval[0] - dropped(from == 0, run.prepared.trimmed.0),
            interval[1] + dropped(end == n, run.prepared.trimmed.1),
        ];
        // One sample of large noise does not divide an interval.
        if let Some(last) = found.last_mut()
            && from <= last_end + block
            && (level - last.level).abs() <= tolerance
        {
            let weight = (last_end - last_from) as f64 / (end - last_from) as f64;
            last.level += (1.0 - weight) * (level - last.level);
            last.intervals[0][1] = interval[1];
            last.reach[0][1] = reach[1];
            last_end = end;
            start = end;
            continue;
        }
        (last_from, last_end) = (from, end);
        found.push(SilenceCandidate {
            drive,
            intervals: vec![interval],
            reach: vec![reach],
            level,
            noise,
            evidence: SilenceEvidence::Flat,
        });
        start = end;
    }
    found
}

/// A count that was computed, rounded down; at most a million.
fn count(value: f64) -> usize {
    float_to_count(value.clamp(0.0, 1e6))
}
