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
/// So many robots are held against each other to see what is usual, a few at a time.
const TOGETHER: usize = 4;
const LOOKED_AT: usize = 200;

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
    /// Robots that differ in something that physics has a name for, by more than twice what robots of this fleet differ by.
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
        .map(|k| usual(fits.iter().flatten().filter_map(|fit| told(fit[k])).map(|(x, _)| x).collect()))
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
        let within = within(ground, robots, &alike);
        for which in (0..robots.len()).filter(|k| fits[*k].is_some()) {
            let own = [robots[which].summary.whole.clone()];
            let changes = ground.common.changes(&parts, &own, within);
            if !changes.is_empty() {
                found.push(Outlier { which, changes });
            }
        }
    }
    let gain = |one: &Outlier| one.changes.first().map_or(0.0, |change| change.gain);
    found.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    Ok(Outliers { usual, apart, found })
}

/// By what robots that are alike differ among themselves, a few held against each other at a time.
fn within(ground: &Ground, robots: &[One], alike: &[usize]) -> f64 {
    let every = (alike.len() / LOOKED_AT).max(1);
    let some: Vec<usize> = alike.iter().copied().step_by(every).collect();
    let groups = some.chunks_exact(TOGETHER);
    let of = |group: &[usize]| {
        let parts: Vec<Moments> = group.iter().map(|k| robots[*k].summary.whole.clone()).collect();
        ground.common.within(&parts)
    };
    groups.map(of).fold(0.0, f64::max)
}

fn told(fitted: Fitted) -> Option<(f64, f64)> {
    Some((fitted.value, fitted.deviation?))
}

/// Median and robust deviation.
fn usual(mut values: Vec<f64>) -> Option<Fitted> {
    if values.is_empty() {
        return None;
    }
    let median = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        let n = values.len();
        (values[(n - 1) / 2] + values[n / 2]) / 2.0
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
