//! Readings that repeat one number exactly: a stuck channel, or a limit. The recorded forces of a drive go in, before any
//! filter; the intervals come out.

use modelmill_identify::diagnose::white_noise;

use super::super::thresholds::{
    FROZEN_LEAST_NOISE_SHARE, FROZEN_MOST_REPEATS, FROZEN_MOST_SHARE, LIMIT_FEWEST_REPEATS, LIMIT_FEWEST_SAMPLES,
    LIMIT_LEAST_SHARE, SILENCE_FEWEST_SAMPLES, SILENCE_MOST_INTERVALS, SILENCE_SHORTEST_S,
};

/// Samples that have the same number exactly, one after the other.
struct RepeatedRun {
    /// First sample.
    start: usize,
    /// The first sample behind the last one.
    end: usize,
}

/// Exact repetitions of the forces of one drive.
#[derive(Default)]
pub(super) struct ForceRepeats {
    /// Intervals in which the reading is stuck at a value, each with its start and end, s, and the value.
    pub(super) stuck: Vec<([f64; 2], f64)>,
    /// Values that the readings do not exceed, each with the intervals in which they are there.
    pub(super) limits: Vec<(f64, Vec<[f64; 2]>)>,
    /// Whether the other readings have noise. If so, no motion explains an exact repetition.
    pub(super) others_have_noise: bool,
}

/// Readings of one drive that were measured, with their times.
pub(super) struct IntactReadings {
    /// Forces, N or N m.
    force: Vec<f64>,
    /// Times, s.
    time: Vec<f64>,
}

impl IntactReadings {
    /// The readings without those that are lost and were interpolated.
    pub(super) fn new(force: &[f64], time: &[f64], lost: Option<&[bool]>) -> Self {
        let is_lost = |k: usize| lost.is_some_and(|lost| lost.get(k) == Some(&true));
        let intact = || (0..force.len().min(time.len())).filter(|k| !is_lost(*k));
        Self {
            force: intact().map(|k| force[k]).collect(),
            time: intact().map(|k| time[k]).collect(),
        }
    }
}

/// Finds the exact repetitions of forces. Nothing is found where numbers repeat often, as those of coarse
/// steps and of commands that are constant in pieces do.
pub(super) fn find_repeats(readings: &IntactReadings) -> ForceRepeats {
    let IntactReadings { force, time } = readings;
    let n = force.len();
    let (Some(first), Some(last)) = (time.first(), time.last()) else {
        return ForceRepeats::default();
    };
    let step = (last - first) / (n.max(2) - 1) as f64;
    if n < SILENCE_FEWEST_SAMPLES || step.is_nan() || step <= 0.0 || force.iter().any(|x| !x.is_finite()) {
        return ForceRepeats::default();
    }
    let runs = repeated_runs(force);
    let span = |run: &RepeatedRun| [time[run.start], time[run.end - 1]];
    let low = force.iter().copied().fold(f64::INFINITY, f64::min);
    let high = force.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let is_long = |run: &RepeatedRun| {
        run.end - run.start >= SILENCE_FEWEST_SAMPLES && span(run)[1] - span(run)[0] >= SILENCE_SHORTEST_S
    };
    // A channel that is stuck once at its largest value is no limit: a limit is met again and again.
    let limits: Vec<(f64, Vec<RepeatedRun>)> = [low, high]
        .into_iter()
        .filter_map(|level| Some((level, runs_at_limit(force, &runs, level)?)))
        .collect();
    let is_of_limit = |run: &RepeatedRun| {
        limits
            .iter()
            .any(|(level, _)| force[run.start].total_cmp(level).is_eq())
    };
    let stuck: Vec<&RepeatedRun> = runs.iter().filter(|run| is_long(run) && !is_of_limit(run)).collect();
    // All other numbers must hardly ever repeat.
    let of_faults = |run: &&RepeatedRun| is_of_limit(run) || is_long(run);
    let others = n - runs
        .iter()
        .filter(of_faults)
        .map(|run| run.end - run.start)
        .sum::<usize>();
    let repeated: usize = runs
        .iter()
        .filter(|run| !of_faults(run))
        .map(|run| run.end - run.start - 1)
        .sum();
    if others < SILENCE_FEWEST_SAMPLES || repeated as f64 >= FROZEN_MOST_REPEATS * others as f64 {
        return ForceRepeats::default();
    }
    let are_others_most = others as f64 >= (1.0 - FROZEN_MOST_SHARE) * n as f64;
    let rms = (force.iter().map(|f| f * f).sum::<f64>() / n as f64).sqrt();
    ForceRepeats {
        others_have_noise: are_others_most && white_noise(force) > FROZEN_LEAST_NOISE_SHARE * rms,
        stuck: if !are_others_most || stuck.len() > SILENCE_MOST_INTERVALS {
            Vec::new()
        } else {
            stuck.into_iter().map(|run| (span(run), force[run.start])).collect()
        },
        limits: limits
            .into_iter()
            .map(|(level, runs)| (level, runs.iter().map(span).collect()))
            .collect(),
    }
}

/// The samples at an extreme value, in runs; `None` if the force meets it once or seldom.
fn runs_at_limit(force: &[f64], runs: &[RepeatedRun], level: f64) -> Option<Vec<RepeatedRun>> {
    let is_there = |k: usize| force[k].total_cmp(&level).is_eq();
    let long = runs
        .iter()
        .filter(|run| run.end - run.start >= LIMIT_FEWEST_REPEATS && is_there(run.start));
    let (times, count) = long.fold((0, 0), |(times, count), run| (times + 1, count + run.end - run.start));
    // Zero is the reading of a dead channel.
    if level == 0.0
        || times < 2
        || count < LIMIT_FEWEST_SAMPLES
        || (count as f64) < LIMIT_LEAST_SHARE * force.len() as f64
    {
        return None;
    }
    // Single samples are at the limit as well.
    let mut all: Vec<RepeatedRun> = Vec::new();
    for k in (0..force.len()).filter(|k| is_there(*k)) {
        match all.last_mut() {
            Some(run) if run.end == k => run.end = k + 1,
            _ => all.push(RepeatedRun { start: k, end: k + 1 }),
        }
    }
    Some(all)
}

/// All runs of at least two equal numbers.
fn repeated_runs(force: &[f64]) -> Vec<RepeatedRun> {
    let mut runs = Vec::new();
    let mut start = 0;
    for k in 1..=force.len() {
        if k == force.len() || force[k].total_cmp(&force[start]).is_ne() {
            if k - start > 1 {
                runs.push(RepeatedRun { start, end: k });
            }
            start = k;
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Times in s, and a smooth force with a small pseudorandom error.
    fn noisy() -> (Vec<f64>, Vec<f64>) {
        let time: Vec<f64> = (0..2000).map(|k| 0.005 * f64::from(k)).collect();
        let mut state = 1_u64;
        let force = time.iter().map(|t| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (2.0 * t).sin() + 0.01 * ((state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5)
        });
        let force = force.collect();
        (time, force)
    }

    #[test]
    fn a_number_that_repeats_for_a_time_is_stuck() {
        let (time, mut force) = noisy();
        assert!(find_repeats(&IntactReadings::new(&force, &time, None)).stuck.is_empty());
        let level = force[600];
        force[600..800].fill(level);
        let found = find_repeats(&IntactReadings::new(&force, &time, None));
        assert!(found.others_have_noise && found.limits.is_empty());
        assert_eq!(found.stuck, [([time[600], time[799]], level)]);
    }

    #[test]
    fn a_value_that_is_never_exceeded_is_a_limit() {
        let (time, force) = noisy();
        let clipped: Vec<f64> = force.iter().map(|x| x.clamp(-0.8, 0.9)).collect();
        let found = find_repeats(&IntactReadings::new(&clipped, &time, None));
        assert!(found.stuck.is_empty());
        let levels: Vec<f64> = found.limits.iter().map(|(level, _)| *level).collect();
        assert_eq!(levels, [-0.8, 0.9]);
    }

    /// Values in place of lost samples repeat, and a channel that drops to zero has no limit there.
    #[test]
    fn lost_samples_and_zeros_are_neither_stuck_nor_a_limit() {
        let (time, mut force) = noisy();
        let last = force[1500];
        force[1500..].fill(last);
        let lost: Vec<bool> = (0..force.len()).map(|k| k >= 1500).collect();
        assert!(
            find_repeats(&IntactReadings::new(&force, &time, Some(&lost)))
                .stuck
                .is_empty()
        );
        let (time, force) = noisy();
        let mut positive: Vec<f64> = force.iter().map(|x| x + 5.0).collect();
        positive[300..340].fill(0.0);
        positive[900..940].fill(0.0);
        assert!(
            find_repeats(&IntactReadings::new(&positive, &time, None))
                .limits
                .is_empty()
        );
    }

    #[test]
    fn commands_in_pieces_and_coarse_readings_are_no_faults() {
        let (time, force) = noisy();
        let in_pieces: Vec<f64> = (0..2000).map(|k| force[k / 100 * 100]).collect();
        let coarse: Vec<f64> = force.iter().map(|x| (5.0 * x).round() / 5.0).collect();
        for force in [in_pieces, coarse] {
            let found = find_repeats(&IntactReadings::new(&force, &time, None));
            assert!(found.stuck.is_empty() && found.limits.is_empty());
        }
    }
}
