//! Permanent changes of parameters over the order of the runs, and their physical meaning.

use modelmill_identify::changes::{NormalEquations, RunPair, UncertainValue, change_points, weighted_mean};
use modelmill_identify::median;

use crate::runs::thresholds::{CHANGE_POINT_RUNS, MOST_UNEXPLAINED_SHARE};
use crate::runs::{FittedValue, PhysicalChange, RunAnalyser, RunChange, RunStatistics};

/// A permanent change of one parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterStep {
    /// Index of the base parameter.
    pub parameter: usize,
    /// Its mean over the runs since the previous change.
    pub before: FittedValue,
    /// Its mean over the runs until the next change.
    pub now: FittedValue,
}

impl ParameterStep {
    /// The size of the step in its standard deviations.
    fn sigmas(&self) -> f64 {
        (self.now.value - self.before.value).abs() / self.before.difference_std(self.now)
    }
}

/// A change point: from one run on, base parameters have other values permanently.
#[derive(Clone, Debug)]
pub struct ChangePoint {
    /// Index of the first run after the change.
    pub run: usize,
    /// Parameters that changed there, the clearest first.
    pub steps: Vec<ParameterStep>,
    /// The physical changes from the runs before this change point to those after it. The runs before begin at the
    /// previous change point; those after end at the next one.
    pub changes: Vec<RunChange>,
}

/// Drives whose forces show nothing, or whose friction is unknown, in at least one of the runs.
pub(crate) struct DriveDoubts {
    /// Whether the model describes the force of each drive.
    believed: Vec<bool>,
    /// Whether each drive stands nearly all the time.
    stands: Vec<bool>,
}

impl DriveDoubts {
    /// The doubts of one run.
    pub(crate) fn new(run: &RunStatistics) -> Self {
        let shares = run.unexplained.0.iter();
        Self {
            believed: shares.map(|share| *share <= MOST_UNEXPLAINED_SHARE).collect(),
            stands: run.stands.clone(),
        }
    }

    /// Adds the doubts of another run.
    pub(crate) fn add(&mut self, run: &RunStatistics) {
        let other = Self::new(run);
        for (one, other) in self.believed.iter_mut().zip(other.believed) {
            *one &= other;
        }
        for (one, other) in self.stands.iter_mut().zip(other.stands) {
            *one |= other;
        }
    }
}

/// Change points over the runs. `runs` are the base parameters of each run fitted alone, `wholes` their sums, and
/// `within` the differences between the parts of each. `before` is the reference run, and `doubts` are those of all
/// runs.
pub(crate) fn find_change_points(
    bench: &RunAnalyser<'_>,
    runs: &[&[FittedValue]],
    wholes: &[NormalEquations],
    within: &[f64],
    before: &RunStatistics,
    doubts: &DriveDoubts,
) -> Vec<ChangePoint> {
    let parameters: Vec<usize> = (0..bench.model.base.len())
        .filter(|k| !bench.model.is_known(*k))
        .collect();
    // Stage 1: steps of each parameter over the order of the runs.
    let mut steps: Vec<(usize, ParameterStep)> = Vec::new();
    for parameter in &parameters {
        let known: Vec<Option<UncertainValue>> = runs.iter().map(|run| known_value(run[*parameter])).collect();
        let mut bounds = change_points(&known, parameters.len());
        bounds.insert(0, 0);
        bounds.push(runs.len());
        for three in bounds.windows(3) {
            let [before, now] = [three[0]..three[1], three[1]..three[2]].map(|some| {
                let (value, std) = weighted_mean(&known[some])?;
                let std = Some(std);
                Some(FittedValue { value, std })
            });
            if let (Some(before), Some(now)) = (before, now) {
                let parameter = *parameter;
                steps.push((three[1], ParameterStep { parameter, before, now }));
            }
        }
    }
    // Stage 2: steps of neighbouring runs belong to one change point.
    let starts = step_runs(&steps);
    let bounds: Vec<usize> = [0].into_iter().chain(starts).chain([runs.len()]).collect();
    // Stage 3: the sums before and after each point are searched for physical changes.
    let point = |three: &[usize]| {
        let (start, at, end) = (three[0], three[1], three[2]);
        let own = steps.iter().filter(|(run, _)| run.abs_diff(at) <= CHANGE_POINT_RUNS);
        let mut own: Vec<ParameterStep> = own.map(|(_, step)| *step).collect();
        own.sort_by(|a, b| b.sigmas().total_cmp(&a.sigmas()));
        let both = RunPair {
            reference: wholes[start..at].to_vec(),
            later: wholes[at..end].to_vec(),
            within_run_spread: median(within[start..end].to_vec()),
        };
        let mut found = bench.significant_changes(&both, &before.sizes, &doubts.believed);
        bench.drop_unknown_friction(&mut found, |drive| doubts.stands[drive]);
        ChangePoint {
            run: at,
            steps: own,
            changes: bench.identified_changes(&found, &before.values),
        }
    };
    bounds.windows(3).map(point).collect()
}

/// Gives loads at change points the weights of the drives that a run has for the same load, so that known loads correct
/// both alike: the first run after the point that has it, or for a load that is put down the last one before. `runs` are
/// the changes of each run relative to the first one.
pub(crate) fn adopt_drive_weights(points: &mut [ChangePoint], runs: &[&[RunChange]]) {
    let frame = |one: &RunChange| match &one.change {
        PhysicalChange::Payload { frame, .. } => Some(frame.clone()),
        _ => None,
    };
    for point in points {
        let (earlier, later) = runs.split_at(point.run.min(runs.len()));
        for change in &mut point.changes {
            let Some(own) = frame(change) else { continue };
            let mut same = (later.iter().chain(earlier.iter().rev()).copied().flatten())
                .filter(|one| !one.drive_weights.is_empty() && frame(one).as_ref() == Some(&own));
            if let Some(one) = same.next() {
                change.drive_weights.clone_from(&one.drive_weights);
            }
        }
    }
}

/// The value with its standard deviation, if the run determines it.
fn known_value(fitted: FittedValue) -> Option<UncertainValue> {
    Some((fitted.value, fitted.std.filter(|d| *d > 0.0)?))
}

/// Indices of runs at which steps begin. Of neighbouring runs the one with the clearest steps is taken, since a
/// parameter with a large uncertainty in one run may show its change one run later.
fn step_runs(steps: &[(usize, ParameterStep)]) -> Vec<usize> {
    let mut weights: Vec<(usize, f64)> = Vec::new();
    for (run, step) in steps {
        let weight = step.sigmas().powi(2);
        match weights.iter_mut().find(|(at, _)| at == run) {
            Some((_, sum)) => *sum += weight,
            None => weights.push((*run, weight)),
        }
    }
    weights.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut kept: Vec<usize> = Vec::new();
    for (run, _) in weights {
        if kept.iter().all(|other| other.abs_diff(run) > CHANGE_POINT_RUNS) {
            kept.push(run);
        }
    }
    kept.sort_unstable();
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load(frame: &str, drive_weights: &[f64]) -> RunChange {
        RunChange {
            change: PhysicalChange::Payload {
                frame: frame.to_owned(),
                mass: None,
                centre: [None; 3],
            },
            gain: 0.0,
            unit: "m",
            rivals: Vec::new(),
            drive_weights: drive_weights.to_vec(),
            says: String::new(),
        }
    }

    /// A load has the weights of the same load after the point, not of one before it or on another body.
    #[test]
    fn a_load_at_a_change_point_is_weighed_as_in_the_runs_after_it() {
        let mut points = [ChangePoint {
            run: 2,
            steps: Vec::new(),
            changes: vec![load("tool", &[]), load("arm", &[])],
        }];
        let [first, before] = [Vec::new(), vec![load("tool", &[0.1, 0.9])]];
        let after = vec![load("base", &[1.0, 0.0]), load("tool", &[0.4, 0.6])];
        adopt_drive_weights(&mut points, &[&first, &before, &after]);
        let [tool, arm] = &points[0].changes[..] else { panic!() };
        assert_eq!(tool.drive_weights, [0.4, 0.6]);
        assert!(arm.drive_weights.is_empty());
    }
}
