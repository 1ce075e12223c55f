//! Properties of an estimate in addition to its values, as JSON and as text for people: independent samples, weights,
//! parameters that are not essential, physical parameters, and the bias that instruments remove.

use modelmill_identify::ParameterInfo;
use modelmill_identify::estimate::PhysicalParameters;
use serde_json::{Value, json};

use crate::identify::regression::{InstrumentStatistics, RegressionEstimate};
use crate::identify::{EstimatorOptions, RefinementResult};
use crate::model::Model;
use crate::text::table::{ColumnAlignment, count, number, percent, significant, table};

/// Number of independent samples that the correlated ones are worth: the median over the parameters.
fn effective_samples(found: &RegressionEstimate) -> Option<f64> {
    // Parameters without a finite number, such as known ones, are left out.
    let mut all: Vec<f64> = found
        .uncertainty
        .effective_samples
        .iter()
        .copied()
        .filter(|x| *x > 0.0 && x.is_finite())
        .collect();
    // The median, since a parameter that acts rarely has very few samples.
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied()
}

/// The object `estimator` of `identify --json`.
///
/// `effective_samples` is the number of independent samples, `residual_correlation` the correlation of the
/// residuals at lag 1 for each drive, `bandwidth` the lag (samples) up to which correlations are counted. With
/// weights: `residual_scale` is the noise of each drive (N or N m). `prior`, `essential`, `physical` and
/// `instruments` are there if the option was used.
pub(crate) fn json(model: &Model, found: &RegressionEstimate, args: &EstimatorOptions) -> Value {
    let drives = model.row_names();
    // Lists of values per drive become objects with the names of the drives.
    let by_drive = |values: &[f64]| -> Value {
        drives
            .iter()
            .cloned()
            .zip(values.iter().map(|v| json!(v)))
            .collect::<serde_json::Map<_, _>>()
            .into()
    };
    // The correlation of residuals is always given, since the standard deviations depend on it.
    let mut value = json!({
        "weights": args.weights.name(),
        "effective_samples": effective_samples(found),
        "residual_correlation": by_drive(&found.uncertainty.residual_lag1),
        "bandwidth": found.uncertainty.bandwidth,
    });
    // Optional parts are added only if the estimator computed them.
    let mut put = |name: &str, what: Value| value[name] = what;
    if let Some(weighting) = &found.weighting {
        // Weights by drive are iterated with the noise of each drive.
        put("residual_scale", by_drive(&weighting.scales));
        put("iterations", json!(weighting.iterations));
        put("settled", json!(weighting.converged));
        if let Some(bound) = weighting.huber {
            put("robust", json!({ "bound": bound, "beyond": weighting.outliers }));
        }
    }
    match &found.refined {
        RefinementResult::Nothing => {}
        RefinementResult::Prior(sigma, beliefs) => {
            put("prior", json!({ "sigma": sigma, "constraints": beliefs }));
        }
        // Each removed parameter with the reason: its relative standard deviation and the probability that it
        // is zero.
        RefinementResult::Essential(dropped, rise) => {
            let dropped: Vec<Value> = dropped
                .iter()
                .map(|one| {
                    json!({
                        "name": model.base[found.unknown[one.parameter]].name,
                        "relative_std": one.relative_std.is_finite().then_some(one.relative_std),
                        "probability": one.probability,
                    })
                })
                .collect();
            put("essential", json!({ "dropped": dropped, "residual_rise": rise }));
        }
        // Parameters and bodies; the rise of the residual is relative to the solution without bounds.
        RefinementResult::Physical(physical, bodies, before) => {
            let parameters = &model.derivation.mechanism.parameters;
            let list: Vec<Value> = parameters
                .iter()
                .enumerate()
                .map(|(i, p)| {
                    json!({
                        "name": p.name, "value": physical.parameters[i], "std": physical.std[i], "unit": p.unit,
                        "nominal": p.nominal, "from_recording": physical.from_recording[i], "alone": physical.individually_determined[i],
                    })
                })
                .collect();
            let bodies: Vec<Value> = bodies
                .iter()
                .zip(&physical.margins)
                .map(|(name, margin)| json!({ "name": name, "margin": margin }))
                .collect();
            put(
                "physical",
                json!({ "parameters": list, "bodies": bodies, "residual_rise": physical.residual_norm / before - 1.0 }),
            );
        }
    }
    if let Some(InstrumentStatistics {
        strength,
        least_squares,
    }) = &found.instruments
    {
        // Comparison of both estimators, parameter by parameter.
        let bias: Vec<Value> = (0..found.unknown.len())
            .map(|i| json!({ "name": model.base[found.unknown[i]].name, "least_squares": least_squares[i] }))
            .collect();
        put("instruments", json!({ "strength": strength, "parameters": bias }));
    }
    value
}

/// The same as lines of text.
pub(crate) fn text(model: &Model, found: &RegressionEstimate, infos: &[ParameterInfo]) -> Vec<String> {
    let mut lines = Vec::new();
    let uncertainty = &found.uncertainty;
    // Independent samples, since they explain the size of the standard deviations.
    if let Some(effective) = effective_samples(found) {
        // One correlation for each drive.
        let correlations: Vec<String> = uncertainty.residual_lag1.iter().map(|c| significant(*c, 2)).collect();
        lines.push(format!(
            "The residuals are correlated in time (at lag 1, per drive: {}), so these {} samples are worth about {} \
             independent ones.",
            correlations.join(", "),
            uncertainty.samples,
            significant(effective, 2)
        ));
        lines.push("The standard deviations above allow for that.".to_owned());
    }
    // Noise of each drive, if it was used as weight.
    if let Some(weighting) = &found.weighting {
        // Drives with their noise in their own units.
        let scales: Vec<String> = weighting
            .scales
            .iter()
            .zip(model.row_names())
            .enumerate()
            .map(|(d, (s, drive))| format!("{drive} {} {}", significant(*s, 3), model.force_unit(d)))
            .collect();
        lines.push(format!(
            "noise of each drive used as weight: {} ({}{})",
            scales.join(", "),
            count(weighting.iterations, "iteration", "iterations"),
            if weighting.converged { "" } else { ", not converged" }
        ));
        // Robust weights reduce the influence of outliers.
        if let Some(bound) = weighting.huber {
            lines.push(format!(
                "robust weights: {} of the residuals exceed {bound} times the noise (of normally distributed ones 18 % \
                 exceed 1.345 times)",
                percent(Some(weighting.outliers))
            ));
        }
    }
    // The refinement, if one was requested.
    let name = |i: usize| infos[found.unknown[i]].name.clone();
    match &found.refined {
        RefinementResult::Nothing => {}
        RefinementResult::Prior(_, beliefs) => {
            lines.push(prior_text(*beliefs, found.unknown.len()));
        }
        // Names of the parameters that were removed.
        RefinementResult::Essential(dropped, rise) => {
            let names: Vec<String> = dropped.iter().map(|one| name(one.parameter)).collect();
            lines.push(if names.is_empty() {
                "all base parameters are essential".to_owned()
            } else {
                format!(
                    "not essential, fixed at their nominal values (0 if there is none): {}; the residual grows by {}",
                    names.join(", "),
                    percent(Some(*rise))
                )
            });
        }
        RefinementResult::Physical(physical, bodies, before) => {
            lines.extend(physical_text(model, physical, bodies, *before));
        }
    }
    // Instruments, with the bias of least squares that they remove.
    if let Some(InstrumentStatistics {
        strength,
        least_squares,
    }) = &found.instruments
    {
        lines.push(format!(
            "instruments: smallest correlation with the regressor {} (1 is ideal, below 0.2 is weak)",
            significant(*strength, 3)
        ));
        // The difference of both estimates in standard deviations shows the bias.
        let rows: Vec<Vec<String>> = (0..found.unknown.len())
            .map(|i| {
                let (value, std) = (found.solution.values[i], uncertainty.std[i]);
                vec![
                    name(i),
                    number(value),
                    number(least_squares[i]),
                    if std > 0.0 {
                        significant((least_squares[i] - value) / std, 2)
                    } else {
                        "—".to_owned()
                    },
                ]
            })
            .collect();
        lines.extend(table(
            0,
            &[
                ("parameter", ColumnAlignment::Left),
                ("instruments", ColumnAlignment::Right),
                ("least squares", ColumnAlignment::Right),
                ("difference / std", ColumnAlignment::Right),
            ],
            &rows,
        ));
    }
    lines
}

/// A body is named as nearly impossible if the smallest eigenvalue of its pseudo-inertia matrix is below this
/// part of that of the nominal body. By judgement.
const NEARLY_IMPOSSIBLE: f64 = 0.01;

/// How many base parameters have a soft constraint at their nominal value.
fn prior_text(beliefs: usize, unknown: usize) -> String {
    // Parameters without nominal value cannot be constrained.
    let constrained = count(beliefs, "base parameter", "base parameters");
    let without = match unknown - beliefs {
        0 => String::new(),
        n => format!(
            "; {} none, since their nominal values are 0 or not given",
            count(n, "base parameter has", "base parameters have")
        ),
    };
    format!("nominal values of {constrained} are used as soft constraints{without}")
}

/// Stands in place of a share if the recordings determine a parameter only in combination with others.
const NOT_ALONE: &str = "only in combination";
/// Below this share a parameter has its nominal value, and the share is printed as it is. By judgement.
const NEXT_TO_NOTHING: f64 = 0.01;
/// Below this share only rounding is left of it. By judgement.
const PRINTED_AS_ZERO: f64 = 1e-6;

/// Share of a physical parameter that the recordings determine, between 0 and 1, as text. The rest comes from
/// nominal values and from the bounds of physical bodies.
fn recording_share_text(physical: &PhysicalParameters, i: usize) -> String {
    // Rounding must not be printed as a share.
    let share = physical.from_recording[i];
    if share < PRINTED_AS_ZERO {
        "0 %".to_owned()
    } else if physical.individually_determined[i] || share < NEXT_TO_NOTHING {
        percent(Some(share))
    } else {
        NOT_ALONE.to_owned()
    }
}

/// Physical parameters as a table, with the growth of the residual and bodies at the limit of what is possible.
/// `before` is the residual norm without the bounds.
fn physical_text(model: &Model, physical: &PhysicalParameters, bodies: &[String], before: f64) -> Vec<String> {
    let parameters = &model.derivation.mechanism.parameters;
    // One row for each parameter, with the share that the recordings determine.
    let rows: Vec<Vec<String>> = parameters
        .iter()
        .enumerate()
        .map(|(i, p)| {
            vec![
                p.name.clone(),
                number(p.nominal),
                number(physical.parameters[i]),
                significant(physical.std[i], 2),
                recording_share_text(physical, i),
                p.unit.clone(),
            ]
        })
        .collect();
    // Parameters of effects that cannot be negative, such as friction, are in the same list as bodies.
    let terms = model.derivation.mechanism.effects.iter();
    let terms = terms.flat_map(|effect| &effect.terms);
    let of_effects: Vec<&str> = terms.map(|term| parameters[term.parameter.0].name.as_str()).collect();
    let is_of_effect = |name: &&String| of_effects.contains(&name.as_str());
    let others = bodies.iter().filter(is_of_effect).count();
    // The head says how much the bounds cost.
    let mut lines = vec![
        format!(
            "physical parameters of {}, all physically possible{}; the residual grows by {}",
            count(bodies.len() - others, "body", "bodies"),
            match others {
                0 => String::new(),
                n => format!(", and {}", count(n, "parameter of effects", "parameters of effects")),
            },
            percent(Some(physical.residual_norm / before - 1.0))
        ),
        String::new(),
    ];
    lines.extend(table(
        0,
        &[
            ("parameter", ColumnAlignment::Left),
            ("nominal", ColumnAlignment::Right),
            ("physical", ColumnAlignment::Right),
            ("std", ColumnAlignment::Right),
            ("from recording", ColumnAlignment::Right),
            ("unit", ColumnAlignment::Left),
        ],
        &rows,
    ));
    // The table uses this phrase, so that its meaning is stated once below.
    if (0..rows.len()).any(|i| recording_share_text(physical, i) == NOT_ALONE) {
        lines.push(format!(
            "{NOT_ALONE}: the recordings determine sums of this parameter and others, not the parameter itself; its value and \
             `std` also depend on nominal values and on the bounds of physical bodies"
        ));
    }
    // A body at its bound shows that the data ask for an impossible one.
    let tight = bodies
        .iter()
        .zip(&physical.margins)
        .filter(|(_, margin)| **margin < NEARLY_IMPOSSIBLE);
    for (body, margin) in tight {
        lines.push(format!(
            "{body} is at the limit of what is physically possible: its smallest eigenvalue is {} of the nominal one. Least \
             squares alone would give an impossible body; a missing effect is a usual cause",
            percent(Some(*margin))
        ));
    }
    lines
}
