//! Which robots differ from the others of their kind, and in what: by summaries alone.

use modelmill::runs::{Changed, Fitted};
use modelmill_identify::changes::Moments;
use serde_json::{Value, json};

use crate::robot::change_json;
use crate::{Fault, Ground, Summary};

/// Robots that stand in for the others are summed up in so many parts.
const PARTS: usize = 8;
/// Robots are alike up to so many robust deviations in each parameter.
const ALIKE: f64 = 3.5;
/// What a change explains of a robot must lie, as a root, so many median distances above the median over the robots: a change of
/// one value of robots that are distributed normally does so once in a million.
const BEYOND: f64 = 12.0;
/// Changes that stand for this part of the clearest one are told together, by the name of the one that explains most.
const BESIDE: f64 = 0.5;

/// A robot as it is held against others.
#[derive(Clone, Debug)]
pub struct One {
    /// What it is called.
    pub name: String,
    /// Its recordings.
    pub summary: Summary,
}

/// A robot that differs.
#[derive(Clone, Debug)]
pub struct Outlier {
    /// Which, by place.
    pub which: usize,
    /// In what, the clearest first.
    pub changes: Vec<Changed>,
}

/// What is usual in a fleet, and who differs.
#[derive(Clone, Debug)]
pub struct Outliers {
    /// For each base parameter the median over the robots and the robust deviation of a robot from it, 1.4826 times the median
    /// distance; `None` where no robot determines it.
    pub usual: Vec<Option<Fitted>>,
    /// For each robot and base parameter how far it lies from the median, in deviations of the robots and of its own.
    pub apart: Vec<Vec<Option<f64>>>,
    /// Robots that differ in something that physics has a name for, by far more than robots of this fleet do.
    pub found: Vec<Outlier>,
}

/// Holds robots against each other. None differs where there are fewer than eight.
///
/// Fails where summaries are of another plan.
pub fn outliers(ground: &Ground, robots: &[One]) -> Result<Outliers, Fault> {
    let mut fits: Vec<Option<Vec<Fitted>>> = Vec::new();
    for one in robots {
        ground.check(&one.summary)?;
        fits.push(ground.solve(&one.summary).ok().map(|fit| fit.parameters));
    }
    let n = ground.parameters().len();
    let usual: Vec<Option<Fitted>> = (0..n)
        .map(|k| {
            middle(
                fits.iter()
                    .flatten()
                    .filter_map(|fit| told(fit[k]))
                    .map(|(x, _)| x)
                    .collect(),
            )
        })
        .collect();
    let apart: Vec<Vec<Option<f64>>> = fits
        .iter()
        .map(|fit| {
            let of = |k: usize| {
                let (value, deviation) = told(fit.as_ref()?[k])?;
                let usual = usual[k]?;
                let spread = usual.deviation?.hypot(deviation);
                (spread > 0.0).then(|| (value - usual.value) / spread)
            };
            (0..n).map(of).collect()
        })
        .collect();
    let is_alike = |k: &usize| {
        fits[*k].is_some() && apart[*k].iter().flatten().all(|apart| apart.abs() < ALIKE)
    };
    let alike: Vec<usize> = (0..robots.len()).filter(is_alike).collect();
    let mut found = Vec::new();
    if alike.len() >= PARTS {
        let mut parts = vec![ground.empty(); PARTS];
        for (i, k) in alike.iter().enumerate() {
            parts[i % PARTS].merge(&robots[*k].summary)?;
        }
        let parts: Vec<Moments> = parts.into_iter().map(|part| part.whole).collect();
        let known: Vec<usize> = (0..robots.len()).filter(|k| fits[*k].is_some()).collect();
        // Roots of gains are proportional to differences.
        let roots: Vec<Vec<f64>> = known
            .iter()
            .map(|k| {
                let gains = ground.common.gains(&parts, &robots[*k].summary.whole);
                gains.into_iter().map(|gain| gain.max(0.0).sqrt()).collect()
            })
            .collect();
        let possible = roots.first().map_or(0, Vec::len);
        let bounds: Vec<(f64, f64)> = (0..possible)
            .map(|g| {
                let of_all = middle(roots.iter().map(|roots| roots[g]).collect());
                let (median, spread) =
                    of_all.map_or((0.0, 0.0), |all| (all.value, all.deviation.unwrap_or(0.0)));
                (median, (spread / 1.4826).max(1.0))
            })
            .collect();
        for (which, roots) in known.iter().zip(&roots) {
            let beyond = |g: usize| (roots[g] - bounds[g].0) / bounds[g].1;
            let clearest = (0..possible).map(beyond).fold(0.0, f64::max);
            // What robots hardly differ in, such as the zero of a sensor, stands clear of them even where it explains little of a load:
            // the name is that of the change that explains most.
            let clear = |g: &usize| beyond(*g) > BEYOND && beyond(*g) > BESIDE * clearest;
            let named = (0..possible)
                .filter(clear)
                .max_by(|a, b| roots[*a].total_cmp(&roots[*b]));
            if let Some(g) = named {
                let mut change = ground
                    .common
                    .alone(&parts, &robots[*which].summary.whole, g);
                let rivals = (0..possible).filter(|other| *other != g && clear(other));
                let rivals = rivals.map(|other| ground.common.name_of_change(other));
                change.rivals = rivals.collect();
                found.push(Outlier {
                    which: *which,
                    changes: vec![change],
                });
            }
        }
    }
    let gain = |one: &Outlier| one.changes.first().map_or(0.0, |change| change.gain);
    found.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    Ok(Outliers {
        usual,
        apart,
        found,
    })
}

fn told(fitted: Fitted) -> Option<(f64, f64)> {
    Some((fitted.value, fitted.deviation?))
}

/// Median and robust deviation.
fn middle(mut values: Vec<f64>) -> Option<Fitted> {
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
    Some(Fitted {
        value,
        deviation: Some(1.4826 * median(&mut distances)),
    })
}

impl Outliers {
    /// What is usual and who differs, as JSON.
    pub fn json(&self, ground: &Ground, robots: &[One]) -> Value {
        let infos = ground.parameters();
        let usual = infos.iter().zip(&self.usual).map(|(info, usual)| {
            json!({
                "name": info.name,
                "expression": info.expression,
                "median": usual.map(|usual| usual.value),
                "spread": usual.and_then(|usual| usual.deviation),
                "unit": info.unit,
            })
        });
        let found = self.found.iter().map(|one| {
            let apart = infos.iter().zip(&self.apart[one.which]);
            json!({
                "robot": robots[one.which].name,
                "changes": one.changes.iter().map(change_json).collect::<Vec<_>>(),
                "apart": apart.map(|(info, apart)| (info.name.clone(), json!(apart))).collect::<serde_json::Map<_, _>>(),
            })
        });
        json!({ "usual": usual.collect::<Vec<_>>(), "differ": found.collect::<Vec<_>>() })
    }
}
