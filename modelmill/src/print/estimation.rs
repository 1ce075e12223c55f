//! What an estimate says beside its values: effective samples, weights, what was left out, bodies, bias; as JSON and for
//! people.

use modelmill_identify::ParameterInfo;
use modelmill_identify::estimate::PhysicalParameters;
use serde_json::{Value, json};

use crate::identify::regression::{InstrumentStatistics, RegressionEstimate};
use crate::identify::{EstimatorOptions, RefinementResult};
use crate::model::Model;
use crate::text::table::{ColumnAlignment, count, number, percent, significant, table};

/// The median over the parameters that have any.
fn effective_samples(found: &RegressionEstimate) -> Option<f64> {
    let mut all: Vec<f64> = found
        .deviations
        .effective_samples
        .iter()
        .copied()
        .filter(|x| *x > 0.0 && x.is_finite())
        .collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied()
}

/// What `identify --json` holds under `estimator`.
pub(crate) fn json(model: &Model, found: &RegressionEstimate, args: &EstimatorOptions) -> Value {
    let drives = model.drives();
    let by_drive = |values: &[f64]| -> Value {
        drives
            .iter()
            .cloned()
            .zip(values.iter().map(|v| json!(v)))
            .collect::<serde_json::Map<_, _>>()
            .into()
    };
    let mut value = json!({
        "weights": args.weights.name(),
        "effective_samples": effective_samples(found),
        "residual_correlation": by_drive(&found.deviations.residual_lag1),
        "bandwidth": found.deviations.bandwidth,
    });
    let mut put = |name: &str, what: Value| value[name] = what;
    if let Some(weighting) = &found.weighting {
        put("residual_scale", by_drive(&weighting.scales));
        put("iterations", json!(weighting.iterations));
        put("settled", json!(weighting.converged));
        if let Some(bound) = weighting.huber {
            put(
                "robust",
                json!({ "bound": bound, "beyond": weighting.outliers }),
            );
        }
    }
    match &found.refined {
        RefinementResult::Nothing => {}
        RefinementResult::Prior(sigma, beliefs) => {
            put("prior", json!({ "sigma": sigma, "constraints": beliefs }));
        }
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
            put(
                "essential",
                json!({ "dropped": dropped, "residual_rise": rise }),
            );
        }
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
        let bias: Vec<Value> = (0..found.unknown.len())
            .map(|i| json!({ "name": model.base[found.unknown[i]].name, "least_squares": least_squares[i] }))
            .collect();
        put(
            "instruments",
            json!({ "strength": strength, "parameters": bias }),
        );
    }
    value
}

/// The same for people, line by line.
pub(crate) fn text(
    model: &Model,
    found: &RegressionEstimate,
    infos: &[ParameterInfo],
) -> Vec<String> {
    let mut lines = Vec::new();
    let deviations = &found.deviations;
    if let Some(effective) = effective_samples(found) {
        let correlations: Vec<String> = deviations
            .residual_lag1
            .iter()
            .map(|c| significant(*c, 2))
            .collect();
        lines.push(format!(
            "effective samples {} of {}: residuals correlate with themselves one sample later by {}",
            significant(effective, 2),
            deviations.samples,
            correlations.join(", ")
        ));
    }
    if let Some(weighting) = &found.weighting {
        let scales: Vec<String> = weighting
            .scales
            .iter()
            .map(|s| significant(*s, 3))
            .collect();
        lines.push(format!(
            "scale of the residuals {}, after {}{}",
            scales.join(", "),
            count(weighting.iterations, "solution", "solutions"),
            if weighting.converged {
                ""
            } else {
                ", which had not settled yet"
            }
        ));
        if let Some(bound) = weighting.huber {
            lines.push(format!(
                "robust: {} of the equations are beyond {bound} scales; of normal errors 18 % are \
                 beyond 1.345",
                percent(Some(weighting.outliers))
            ));
        }
    }
    let name = |i: usize| infos[found.unknown[i]].name.clone();
    match &found.refined {
        RefinementResult::Nothing => {}
        RefinementResult::Prior(_, beliefs) => {
            lines.push(prior_text(*beliefs, found.unknown.len()))
        }
        RefinementResult::Essential(dropped, rise) => {
            let names: Vec<String> = dropped.iter().map(|one| name(one.parameter)).collect();
            lines.push(if names.is_empty() {
                "all base parameters are essential".to_owned()
            } else {
                format!(
                    "not essential, kept at their nominal values (0 where there is none): {}; the residual rises by {}",
                    names.join(", "),
                    percent(Some(*rise))
                )
            });
        }
        RefinementResult::Physical(physical, bodies, before) => {
            lines.extend(physical_text(model, physical, bodies, *before));
        }
    }
    if let Some(InstrumentStatistics {
        strength,
        least_squares,
    }) = &found.instruments
    {
        lines.push(format!(
            "instruments: smallest correlation with the regressor {} (1 is best, below 0.2 is weak)",
            significant(*strength, 3)
        ));
        let rows: Vec<Vec<String>> = (0..found.unknown.len())
            .map(|i| {
                let (value, std) = (found.solution.values[i], deviations.std[i]);
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
                ("apart, std", ColumnAlignment::Right),
            ],
            &rows,
        ));
    }
    lines
}

/// How many base parameters have a nominal value that counts.
fn prior_text(beliefs: usize, unknown: usize) -> String {
    let constraints = count(beliefs, "soft constraint", "soft constraints");
    let without = match unknown - beliefs {
        0 => String::new(),
        n => format!(
            "; {} without one, since their nominal values are 0 or not given",
            count(n, "base parameter goes", "base parameters go")
        ),
    };
    format!("{constraints} of nominal values count as measurements{without}")
}

/// What stands for a share where the recordings say something of a parameter, but not its value.
const NOT_ALONE: &str = "not alone";
/// Shares below this one say plainly enough that it is the nominal value that one sees.
const NEXT_TO_NOTHING: f64 = 0.01;

/// How much of a physical parameter the recordings say by themselves.
fn recording_share_text(physical: &PhysicalParameters, i: usize) -> String {
    let share = physical.from_recording[i];
    if physical.individually_determined[i] || share < NEXT_TO_NOTHING {
        percent(Some(share))
    } else {
        NOT_ALONE.to_owned()
    }
}

fn physical_text(
    model: &Model,
    physical: &PhysicalParameters,
    bodies: &[String],
    before: f64,
) -> Vec<String> {
    let parameters = &model.derivation.mechanism.parameters;
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
    let mut lines = vec![
        format!(
            "physical parameters of {} that can be; the residual rises by {}",
            count(bodies.len(), "body", "bodies"),
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
    if (0..rows.len()).any(|i| recording_share_text(physical, i) == NOT_ALONE) {
        lines.push(format!(
            "{NOT_ALONE}: the recordings tell combinations of this parameter with others, not it by itself; nominal values and \
             what a body can be do the rest, also in `std`"
        ));
    }
    let tight = bodies
        .iter()
        .zip(&physical.margins)
        .filter(|(_, margin)| **margin < 0.01);
    for (body, margin) in tight {
        lines.push(format!(
            "{body} is nearly impossible: its smallest eigenvalue is {} of the nominal one; least squares alone would leave \
             what bodies can have, as where an effect is missing",
            percent(Some(*margin))
        ));
    }
    lines
}
