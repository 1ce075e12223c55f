//! Candidates for a payload on every body of the model: a tool, a workpiece, a forgotten cover. They are tried only if base
//! parameters are fixed, as from an unloaded run; estimated base parameters would absorb a payload.

use modelmill_codegen::Evaluator;
use modelmill_identify::diagnose::{
    Body, Candidate, Column, Effect, EffectParameter, Nature, Sign, Source,
};
use modelmill_spec::{Kinematics, Mechanism};

use crate::error::Outcome;
use crate::model::Model;
use crate::regressors::{Runs, regressor};
use crate::runs::payload::{Payloads, TEN};

use super::thresholds::PAYLOAD_LEAST_EFFECT;

/// Symbols of the parameters, their units, and the sign that is possible.
const PARAMETERS: [(&str, &str, Sign); 7] = [
    ("mass", "kg", Sign::Positive),
    ("mx", "kg m", Sign::Any),
    ("my", "kg m", Sign::Any),
    ("mz", "kg m", Sign::Any),
    ("sxx", "kg m^2", Sign::Positive),
    ("syy", "kg m^2", Sign::Positive),
    ("szz", "kg m^2", Sign::Positive),
];
/// The first of them belong to a point mass; the others are second moments.
const OF_A_MASS: usize = 4;

/// For every body a point mass, and the same with second moments.
pub(crate) fn payloads(model: &Model, all: &Runs<'_>) -> Outcome<Vec<Candidate>> {
    let payloads = Payloads::new(model)?;
    let columns = regressor(all, &Evaluator::new(&payloads.derivation), model)?;
    let reach = reach(&model.derivation.mechanism);
    let largest = columns.iter().map(size).fold(0.0, f64::max);
    let mut candidates = Vec::new();
    // The last body first: of two with the same effect it is the one that carries tools.
    for (frame, which) in payloads.frames.iter().zip(&payloads.columns).rev() {
        let of = |k: &Option<usize>| -> Column {
            let column = k.map(|k| &columns[k]);
            let column = column.filter(|column| size(column) > PAYLOAD_LEAST_EFFECT * largest);
            column.map_or_else(|| Column(vec![None; model.drives().len()]), Clone::clone)
        };
        let ten: [Column; TEN] = which.each_ref().map(of);
        let has_effect = |k: &usize| match *k {
            k @ 0..OF_A_MASS => !ten[k].is_zero(),
            k => {
                // A second moment acts through the two inertias about the other axes.
                let across = [[7, 9], [4, 9], [4, 7]][k - OF_A_MASS];
                across.iter().any(|entry| !ten[*entry].is_zero())
            }
        };
        // Without weight and leverage it is the same as an inertia of the drive.
        if !(0..OF_A_MASS).any(|k| has_effect(&k)) {
            continue;
        }
        // A point mass has four parameters, a general payload seven.
        for (most, refines) in [(OF_A_MASS, "point_mass"), (PARAMETERS.len(), "payload")] {
            let free: Vec<usize> = (0..most).filter(has_effect).collect();
            let parameter = |k: &usize| {
                let (symbol, unit, sign) = PARAMETERS[*k];
                EffectParameter {
                    symbol: symbol.to_owned(),
                    unit: unit.to_owned(),
                    sign,
                }
            };
            candidates.push(Candidate {
                effect: Effect {
                    kind: "payload".to_owned(),
                    at: vec![frame.clone()],
                },
                parameters: free.iter().map(parameter).collect(),
                searched: 0,
                is_part_of_load: true,
                refines: Some(refines.to_owned()),
                nature: Nature::Effect,
                is_per_run: false,
                source: Source::Body(Body {
                    ten: ten.clone(),
                    free,
                    reach,
                }),
            });
        }
    }
    Ok(candidates)
}

/// Largest magnitude of a column.
fn size(column: &Column) -> f64 {
    let values = column.0.iter().flatten().flatten();
    values.fold(0.0_f64, |most, x| most.max(x.abs()))
}

/// Largest distance between two frames in the nominal pose, m; it bounds the distance of a payload from its frame.
pub(crate) fn reach(mechanism: &Mechanism) -> f64 {
    let nominal: Vec<f64> = mechanism.coordinates.iter().map(|c| c.nominal).collect();
    let poses = Kinematics::new(mechanism).poses(&nominal);
    let origins: Vec<[f64; 3]> = poses.frames().iter().map(|pose| pose.origin).collect();
    let distance = |a: &[f64; 3], b: &[f64; 3]| -> f64 {
        let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
        squares.sum::<f64>().sqrt()
    };
    let pairs = origins
        .iter()
        .flat_map(|a| origins.iter().map(move |b| (a, b)));
    pairs.map(|(a, b)| distance(a, b)).fold(0.0, f64::max)
}
