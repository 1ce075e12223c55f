//! When parameters changed and stayed changed, over the order of the runs, and what that is in physics.

use modelmill_identify::changes::{Moments, Runs, Told, mean, segments};

use nalgebra::DVector;

use crate::runs::rows::Sizes;
use crate::runs::{Bench, Changed, Fitted};

/// A change of one parameter from one stretch of runs to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Which base parameter.
    pub parameter: usize,
    /// Its mean over the runs since the change before.
    pub before: Fitted,
    /// Its mean over the runs until the next.
    pub now: Fitted,
}

impl Step {
    fn deviations(&self) -> f64 {
        (self.now.value - self.before.value).abs() / self.before.beside(self.now)
    }
}

/// A run from which on something was different and stayed so.
#[derive(Clone, Debug)]
pub struct ChangePoint {
    /// The first run after the change.
    pub run: usize,
    /// Parameters that changed there, the clearest first.
    pub steps: Vec<Step>,
    /// What it is: the runs since the change before, held against those until the next.
    pub changes: Vec<Changed>,
}

/// Change points over the runs; `runs` are the base parameters of each, fitted alone, `wholes` their sums and `within` by what
/// parts of each differ among themselves. `sizes` and `values` are those of a run that the others are held against.
pub(crate) fn found(
    bench: &Bench<'_>,
    runs: &[&[Fitted]],
    wholes: &[Moments],
    within: &[f64],
    sizes: &Sizes,
    values: &DVector<f64>,
) -> Vec<ChangePoint> {
    let parameters: Vec<usize> = (0..bench.model.base.len())
        .filter(|k| !bench.model.is_known(*k))
        .collect();
    let mut steps: Vec<(usize, Step)> = Vec::new();
    for parameter in &parameters {
        let told: Vec<Option<Told>> = runs.iter().map(|run| told(run[*parameter])).collect();
        let mut bounds = segments(&told, parameters.len());
        bounds.insert(0, 0);
        bounds.push(runs.len());
        for three in bounds.windows(3) {
            let [before, now] = [three[0]..three[1], three[1]..three[2]].map(|some| {
                let (value, deviation) = mean(&told[some])?;
                let deviation = Some(deviation);
                Some(Fitted { value, deviation })
            });
            if let (Some(before), Some(now)) = (before, now) {
                let parameter = *parameter;
                steps.push((
                    three[1],
                    Step {
                        parameter,
                        before,
                        now,
                    },
                ));
            }
        }
    }
    let starts = together(&steps);
    let bounds: Vec<usize> = [0].into_iter().chain(starts).chain([runs.len()]).collect();
    let point = |three: &[usize]| {
        let (start, at, end) = (three[0], three[1], three[2]);
        let own = steps.iter().filter(|(run, _)| run.abs_diff(at) <= 1);
        let mut own: Vec<Step> = own.map(|(_, step)| *step).collect();
        own.sort_by(|a, b| b.deviations().total_cmp(&a.deviations()));
        let both = Runs {
            reference: wholes[start..at].to_vec(),
            later: wholes[at..end].to_vec(),
            within: middle(&within[start..end]),
        };
        ChangePoint {
            run: at,
            steps: own,
            changes: bench.told(&bench.large(&both, sizes), values),
        }
    };
    bounds.windows(3).map(point).collect()
}

fn told(fitted: Fitted) -> Option<Told> {
    Some((fitted.value, fitted.deviation.filter(|d| *d > 0.0)?))
}

/// Runs at which steps begin; of neighbours the one with the clearest steps, since a parameter that is known badly in one run may
/// be seen to change one run later.
fn together(steps: &[(usize, Step)]) -> Vec<usize> {
    let mut weights: Vec<(usize, f64)> = Vec::new();
    for (run, step) in steps {
        let weight = step.deviations().powi(2);
        match weights.iter_mut().find(|(at, _)| at == run) {
            Some((_, sum)) => *sum += weight,
            None => weights.push((*run, weight)),
        }
    }
    weights.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut kept: Vec<usize> = Vec::new();
    for (run, _) in weights {
        if kept.iter().all(|other| other.abs_diff(run) > 1) {
            kept.push(run);
        }
    }
    kept.sort_unstable();
    kept
}

fn middle(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}
