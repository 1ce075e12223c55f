//! Detects robots that differ from the others of their kind: summaries of robots go in, outliers with the physical
//! change come out.

use modelmill::runs::{FittedValue, RunChange};
use modelmill_identify::changes::NormalEquations;
use serde_json::{Value, json};

use crate::robot::change_json;
use crate::{FleetFault, FleetModel, FleetSummary};

/// Number of parts into which the similar robots, the reference, are summed up.
const PARTS: usize = 8;
/// Largest distance of a similar robot from the median in each parameter, in robust standard deviations.
const SIMILARITY_LIMIT: f64 = 3.5;
/// Smallest distance of an outlier: the square root of the gain of a change above its median over the robots, in median
/// absolute deviations. With normally distributed values one robot in a million exceeds it by chance.
const OUTLIER_LIMIT: f64 = 12.0;
/// Changes with at least this share of the largest distance are reported together, under the name of the one that
/// explains most.
const ASSOCIATED_SHARE: f64 = 0.5;

/// A robot for the comparison with others.
#[derive(Clone, Debug)]
pub struct RobotSummary {
    /// Its name.
    pub name: String,
    /// The sum of its recordings.
    pub summary: FleetSummary,
}

/// A robot that differs from the others.
#[derive(Clone, Debug)]
pub struct RobotOutlier {
    /// Index of the robot.
    pub robot: usize,
    /// The physical changes relative to the others, the most significant first.
    pub changes: Vec<RunChange>,
}

/// The usual values of a fleet, and its outliers.
#[derive(Clone, Debug)]
pub struct FleetOutliers {
    /// For each base parameter the median over the robots with the robust standard deviation between robots (1.4826
    /// times the median absolute deviation); `None` if no robot determines it.
    pub usual: Vec<Option<FittedValue>>,
    /// `[robot][parameter]`: distance from the median, in standard deviations between robots and of the estimate
    /// combined.
    pub distances: Vec<Vec<Option<f64>>>,
    /// Robots that differ by a physical change much larger than the differences between the robots of this fleet.
    pub found: Vec<RobotOutlier>,
}

/// Compares robots with each other. With fewer than eight similar robots there are no outliers.
///
/// Fails if summaries belong to another plan.
pub fn outliers(ground: &FleetModel, robots: &[RobotSummary]) -> Result<FleetOutliers, FleetFault> {
    let mut fits: Vec<Option<Vec<FittedValue>>> = Vec::new();
    for one in robots {
        ground.check_plan(&one.summary)?;
        fits.push(ground.solve(&one.summary).ok().map(|fit| fit.parameters));
    }
    let n = ground.parameters().len();
    let usual: Vec<Option<FittedValue>> = (0..n)
        .map(|k| {
            robust_centre(
                fits.iter()
                    .flatten()
                    .filter_map(|fit| value_and_std(fit[k]))
                    .map(|(x, _)| x)
                    .collect(),
            )
        })
        .collect();
    let apart: Vec<Vec<Option<f64>>> = fits
        .iter()
        .map(|fit| {
            let of = |k: usize| {
                let (value, std) = value_and_std(fit.as_ref()?[k])?;
                let usual = usual[k]?;
                let spread = usual.std?.hypot(std);
                (spread > 0.0).then(|| (value - usual.value) / spread)
            };
            (0..n).map(of).collect()
        })
        .collect();
    // Similar robots serve as reference: none of their parameters is far from the median.
    let is_alike =
        |k: &usize| fits[*k].is_some() && apart[*k].iter().flatten().all(|apart| apart.abs() < SIMILARITY_LIMIT);
    let alike: Vec<usize> = (0..robots.len()).filter(is_alike).collect();
    let mut found = Vec::new();
    if alike.len() >= PARTS {
        // The scatter between the parts shows how much the reference varies.
        let mut parts = vec![ground.empty_summary(); PARTS];
        for (i, k) in alike.iter().enumerate() {
            parts[i % PARTS].merge(&robots[*k].summary)?;
        }
        let parts: Vec<NormalEquations> = parts.into_iter().map(|part| part.all_columns).collect();
        let known: Vec<usize> = (0..robots.len()).filter(|k| fits[*k].is_some()).collect();
        // Square roots of gains are proportional to the size of a change.
        let roots: Vec<Vec<f64>> = known
            .iter()
            .map(|k| {
                let gains = ground.common.gains(&parts, &robots[*k].summary.all_columns);
                gains.into_iter().map(|gain| gain.max(0.0).sqrt()).collect()
            })
            .collect();
        let possible = roots.first().map_or(0, Vec::len);
        // For each possible change, median and median absolute deviation over all robots.
        let bounds: Vec<(f64, f64)> = (0..possible)
            .map(|g| {
                let of_all = robust_centre(roots.iter().map(|roots| roots[g]).collect());
                let (median, spread) = of_all.map_or((0.0, 0.0), |all| (all.value, all.std.unwrap_or(0.0)));
                (median, (spread / 1.4826).max(1.0))
            })
            .collect();
        for (which, roots) in known.iter().zip(&roots) {
            let beyond = |g: usize| (roots[g] - bounds[g].0) / bounds[g].1;
            let clearest = (0..possible).map(beyond).fold(0.0, f64::max);
            // A change in which robots hardly differ, such as the zero of a sensor, is significant even if it explains
            // only little of the difference. So the change that explains most gives the name.
            let clear = |g: &usize| beyond(*g) > OUTLIER_LIMIT && beyond(*g) > ASSOCIATED_SHARE * clearest;
            let named = (0..possible)
                .filter(clear)
                .max_by(|a, b| roots[*a].total_cmp(&roots[*b]));
            if let Some(g) = named {
                let mut change = ground
                    .common
                    .single_change(&parts, &robots[*which].summary.all_columns, g);
                let rivals = (0..possible).filter(|other| *other != g && clear(other));
                let rivals = rivals.map(|other| ground.common.name_of_change(other));
                change.rivals = rivals.collect();
                found.push(RobotOutlier {
                    robot: *which,
                    changes: vec![change],
                });
            }
        }
    }
    let gain = |one: &RobotOutlier| one.changes.first().map_or(0.0, |change| change.gain);
    found.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    Ok(FleetOutliers {
        usual,
        distances: apart,
        found,
    })
}

/// Value and standard deviation; none for a value that is not determined.
fn value_and_std(fitted: FittedValue) -> Option<(f64, f64)> {
    Some((fitted.value, fitted.std?))
}

/// Median, and robust standard deviation (1.4826 times the median absolute deviation).
fn robust_centre(mut values: Vec<f64>) -> Option<FittedValue> {
    if values.is_empty() {
        return None;
    }
    let median = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        let n = values.len();
        f64::midpoint(values[(n - 1) / 2], values[n / 2])
    };
    let value = median(&mut values);
    let mut distances: Vec<f64> = values.iter().map(|x| (x - value).abs()).collect();
    Some(FittedValue {
        value,
        std: Some(1.4826 * median(&mut distances)),
    })
}

impl FleetOutliers {
    /// JSON: `usual` has median and spread of each parameter, `differ` the outliers with their changes.
    pub fn json(&self, ground: &FleetModel, robots: &[RobotSummary]) -> Value {
        let infos = ground.parameters();
        let usual = infos.iter().zip(&self.usual).map(|(info, usual)| {
            json!({
                "name": info.name,
                "expression": info.expression,
                "median": usual.map(|usual| usual.value),
                "spread": usual.and_then(|usual| usual.std),
                "unit": info.unit,
            })
        });
        let found = self.found.iter().map(|one| {
            let apart = infos.iter().zip(&self.distances[one.robot]);
            json!({
                "robot": robots[one.robot].name,
                "changes": one.changes.iter().map(change_json).collect::<Vec<_>>(),
                "apart": apart.map(|(info, apart)| (info.name.clone(), json!(apart))).collect::<serde_json::Map<_, _>>(),
            })
        });
        json!({ "usual": usual.collect::<Vec<_>>(), "differ": found.collect::<Vec<_>>() })
    }
}
