//! A further body on every body of the model: a tool, a workpiece, a forgotten cover. Beside free base parameters it is no
//! effect, since these take it up; where they are held, as from an unloaded run, its columns are known.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::diagnose::{
    AttachedBody, CandidateEffect, CandidateNature, ColumnSource, EffectParameter, ForceColumn,
    LocatedEffect, SignConstraint,
};
use modelmill_spec::{Kinematics, Mechanism};

use crate::error::Outcome;
use crate::model::Model;
use crate::regressors::{SegmentList, regressor};
use crate::runs::payload::{PayloadColumns, TEN};

/// Symbols of the parameters, their units, and the sign that is possible.
const PARAMETERS: [(&str, &str, SignConstraint); 7] = [
    ("mass", "kg", SignConstraint::Positive),
    ("mx", "kg m", SignConstraint::Any),
    ("my", "kg m", SignConstraint::Any),
    ("mz", "kg m", SignConstraint::Any),
    ("sxx", "kg m^2", SignConstraint::Positive),
    ("syy", "kg m^2", SignConstraint::Positive),
    ("szz", "kg m^2", SignConstraint::Positive),
];
/// Those of a mass at a place; the others say how it spreads.
const POINT_MASS_PARAMETERS: usize = 4;
/// A column whose largest value is below this part of the largest of all says nothing.
const NEGLIGIBLE: f64 = 1e-9;

/// A mass at a place of every body, and the same with what it spreads about that place.
pub(crate) fn payloads(model: &Model, all: &SegmentList<'_>) -> Outcome<Vec<CandidateEffect>> {
    let payloads = PayloadColumns::new(model)?;
    let columns = regressor(all, &ModelEvaluator::new(&payloads.derivation), model)?;
    let reach = reach(&model.derivation.mechanism);
    let largest = columns.iter().map(size).fold(0.0, f64::max);
    let mut candidates = Vec::new();
    // The farthest body first: of two that carry alike it is the one that tools are put on.
    for (frame, which) in payloads.frames.iter().zip(&payloads.columns).rev() {
        let of = |k: &Option<usize>| -> ForceColumn {
            let column = k.map(|k| &columns[k]);
            let column = column.filter(|column| size(column) > NEGLIGIBLE * largest);
            column.map_or_else(
                || ForceColumn(vec![None; model.drives().len()]),
                Clone::clone,
            )
        };
        let ten: [ForceColumn; TEN] = which.each_ref().map(of);
        let is_felt = |k: &usize| match *k {
            k @ 0..POINT_MASS_PARAMETERS => !ten[k].is_zero(),
            k => {
                let across = [[7, 9], [4, 9], [4, 7]][k - POINT_MASS_PARAMETERS];
                across.iter().any(|entry| !ten[*entry].is_zero())
            }
        };
        // Without weight or leverage it is another inertia of the drive.
        if !(0..POINT_MASS_PARAMETERS).any(|k| is_felt(&k)) {
            continue;
        }
        for (most, refines) in [
            (POINT_MASS_PARAMETERS, "point_mass"),
            (PARAMETERS.len(), "payload"),
        ] {
            let free: Vec<usize> = (0..most).filter(is_felt).collect();
            let parameter = |k: &usize| {
                let (symbol, unit, sign) = PARAMETERS[*k];
                EffectParameter {
                    symbol: symbol.to_owned(),
                    unit: unit.to_owned(),
                    sign,
                }
            };
            candidates.push(CandidateEffect {
                effect: LocatedEffect {
                    kind: "payload".to_owned(),
                    at: vec![frame.clone()],
                },
                parameters: free.iter().map(parameter).collect(),
                searched_constants: 0,
                is_part_of_load: true,
                refines: Some(refines.to_owned()),
                nature: CandidateNature::Effect,
                is_per_run: false,
                source: ColumnSource::Body(AttachedBody {
                    inertial_columns: ten.clone(),
                    estimated: free,
                    max_distance: reach,
                }),
            });
        }
    }
    Ok(candidates)
}

fn size(column: &ForceColumn) -> f64 {
    let values = column.0.iter().flatten().flatten();
    values.fold(0.0_f64, |most, x| most.max(x.abs()))
}

/// The largest distance between two frames in the nominal pose, m: nothing that a machine carries is farther away.
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
