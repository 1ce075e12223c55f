//! Candidates for a payload on every body of the model: a tool, a workpiece, a forgotten cover. They are tried
//! only if base parameters are fixed, as from an unloaded run; estimated base parameters would absorb a
//! payload.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::diagnose::{
    AttachedBody, CandidateEffect, CandidateNature, ChangeForce, ChangeShape, ColumnSource, EffectParameter,
    ForceColumn, LocatedEffect, SignConstraint,
};
use modelmill_spec::{Kinematics, Mechanism};

use crate::error::Outcome;
use crate::model::Model;
use crate::regressors::{SegmentList, regressor};
use crate::runs::payload::{PayloadColumns, TEN};

use super::thresholds::PAYLOAD_LEAST_EFFECT;

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
/// The first of them belong to a point mass; the others are second moments.
const POINT_MASS_PARAMETERS: usize = 4;

/// Columns of a load on one frame: mass, first moments and inertia.
pub(crate) struct FrameLoad {
    /// Name of the frame.
    pub(crate) frame: String,
    /// Columns of its ten parameters; zero for those without effect.
    pub(crate) columns: [ForceColumn; TEN],
}

/// Columns of a load on every body of `payloads`, the last body first: of two with the same effect it is the one that
/// carries tools.
///
/// Fails when a pose has no solution.
pub(crate) fn frame_loads(model: &Model, all: &SegmentList<'_>, payloads: &PayloadColumns) -> Outcome<Vec<FrameLoad>> {
    let columns = regressor(all, &ModelEvaluator::new(&payloads.derivation), model)?;
    let largest = columns.iter().map(size).fold(0.0, f64::max);
    // Columns at the level of rounding are zero.
    let of = |k: &Option<usize>| -> ForceColumn {
        let column = k.map(|k| &columns[k]);
        let column = column.filter(|column| size(column) > PAYLOAD_LEAST_EFFECT * largest);
        column.map_or_else(|| ForceColumn(vec![None; model.row_names().len()]), Clone::clone)
    };
    let frames = payloads.frames.iter().zip(&payloads.columns).rev();
    let loads = frames.map(|(frame, which)| FrameLoad {
        frame: frame.clone(),
        columns: which.each_ref().map(of),
    });
    Ok(loads.collect())
}

/// For every body a point mass, and the same with second moments.
pub(crate) fn payloads(model: &Model, loads: &[FrameLoad]) -> Vec<CandidateEffect> {
    // The size of the machine bounds the distance of the payload.
    let reach = reach(&model.derivation.mechanism);
    let mut candidates = Vec::new();
    for FrameLoad { frame, columns: ten } in loads {
        let has_effect = |k: &usize| match *k {
            k @ 0..POINT_MASS_PARAMETERS => !ten[k].is_zero(),
            k => {
                // A second moment acts through the two inertias about the other axes.
                let across = [[7, 9], [4, 9], [4, 7]][k - POINT_MASS_PARAMETERS];
                across.iter().any(|entry| !ten[*entry].is_zero())
            }
        };
        // Without weight and leverage it is the same as an inertia of the drive.
        if !(0..POINT_MASS_PARAMETERS).any(|k| has_effect(&k)) {
            continue;
        }
        // A point mass has four parameters, a general payload seven.
        for (most, refines) in [(POINT_MASS_PARAMETERS, "point_mass"), (PARAMETERS.len(), "payload")] {
            // Parameters without effect are not estimated.
            let free: Vec<usize> = (0..most).filter(has_effect).collect();
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
    candidates
}

/// Symbols of the inertia of a load about the origin of its frame.
const INERTIA: [&str; 6] = ["Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"];

/// A load that is taken or put down during a recording: for each last body a point mass, and a body with inertia.
///
/// Fails when the derivation of the columns fails, or when a pose has no solution.
pub(crate) fn load_changes(model: &Model, all: &SegmentList<'_>) -> Outcome<Vec<ChangeShape>> {
    let loads = frame_loads(model, all, &PayloadColumns::of_last_bodies(model)?)?;
    let each = loads
        .iter()
        .flat_map(|load| [(load, POINT_MASS_PARAMETERS), (load, TEN)]);
    Ok(each.filter_map(|(load, most)| load_change(load, most)).collect())
}

/// The change of a load with the first `most` of its ten parameters; `None` if none of them acts.
fn load_change(load: &FrameLoad, most: usize) -> Option<ChangeShape> {
    let acting: Vec<usize> = (0..most).filter(|k| !load.columns[*k].is_zero()).collect();
    let parameter = |k: &usize| {
        let (symbol, unit) = match *k {
            k @ 0..POINT_MASS_PARAMETERS => (PARAMETERS[k].0, PARAMETERS[k].1),
            k => (INERTIA[k - POINT_MASS_PARAMETERS], "kg m^2"),
        };
        EffectParameter {
            symbol: symbol.to_owned(),
            unit: unit.to_owned(),
            // A load may be put down as well.
            sign: SignConstraint::Any,
        }
    };
    // A body without first moments is no load.
    let has_weight = acting.iter().any(|k| *k < POINT_MASS_PARAMETERS);
    has_weight.then(|| ChangeShape {
        effect: LocatedEffect {
            kind: "payload_change".to_owned(),
            at: vec![load.frame.clone()],
        },
        parameters: acting.iter().map(parameter).collect(),
        force: ChangeForce::Columns(acting.iter().map(|k| load.columns[*k].clone()).collect()),
    })
}

/// Largest magnitude of a column.
fn size(column: &ForceColumn) -> f64 {
    let values = column.0.iter().flatten().flatten();
    values.fold(0.0_f64, |most, x| most.max(x.abs()))
}

/// Largest distance between two frames in the nominal pose, m; it bounds the distance of a payload from its frame.
pub(crate) fn reach(mechanism: &Mechanism) -> f64 {
    let nominal: Vec<f64> = mechanism.coordinates.iter().map(|c| c.nominal).collect();
    // Free joints are at their nominal values.
    let poses = Kinematics::new(mechanism).poses(&nominal);
    let origins: Vec<[f64; 3]> = poses.frames().iter().map(|pose| pose.origin).collect();
    let distance = |a: &[f64; 3], b: &[f64; 3]| -> f64 {
        let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
        squares.sum::<f64>().sqrt()
    };
    let pairs = origins.iter().flat_map(|a| origins.iter().map(move |b| (a, b)));
    pairs.map(|(a, b)| distance(a, b)).fold(0.0, f64::max)
}
