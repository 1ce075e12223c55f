//! A candidate for a clock that runs fast or slow in all recordings alike. Rates and accelerations follow from positions
//! and times: if the recorded time is too long by a share e, true rates are larger by e and true accelerations by 2 e.
//! A mechanism whose lengths are all larger by 2 e has the same forces, so that the recordings cannot distinguish the two.

use modelmill_identify::diagnose::{
    CandidateEffect, CandidateNature, ColumnChoice, ColumnSource, EffectParameter, ForceColumn, LocatedEffect,
    SignConstraint, TIME_BASE,
};

use crate::model::Model;
use crate::regressors::SegmentList;

/// Name of the candidate's parameter: the share by which recorded times are too long.
pub(crate) const CLOCK_SHARE: &str = "share";

/// The candidate; `None` if a derivative is missing. `slopes` are the derivatives of the forces by position, rate and
/// acceleration of each coordinate.
pub(crate) fn clock(
    model: &Model,
    all: &SegmentList<'_>,
    slopes: &[Option<[ForceColumn; 3]>],
) -> Option<CandidateEffect> {
    let mut column = ForceColumn(vec![None; model.row_names().len()]);
    for (i, slopes) in slopes.iter().enumerate() {
        let [_, by_rate, by_acceleration] = slopes.as_ref()?;
        for (factor, slope, is_rate) in [(1.0, by_rate, true), (2.0, by_acceleration, false)] {
            let motion = all.iter().flat_map(|(one, _)| {
                let values = if is_rate { &one.run.qd[i] } else { &one.run.qdd[i] };
                values.iter().copied().step_by(one.decimation())
            });
            let motion: Vec<f64> = motion.collect();
            let mut part = slope.clone();
            for values in part.0.iter_mut().flatten() {
                for (value, motion) in values.iter_mut().zip(&motion) {
                    *value *= motion;
                }
            }
            column.add(factor, &part);
        }
    }
    (!column.is_zero()).then(|| CandidateEffect {
        effect: LocatedEffect {
            kind: TIME_BASE.to_owned(),
            at: vec!["t".to_owned()],
        },
        parameters: vec![EffectParameter {
            symbol: CLOCK_SHARE.to_owned(),
            unit: "1".to_owned(),
            sign: SignConstraint::Any,
        }],
        searched_constants: 0,
        is_part_of_load: false,
        refines: None,
        nature: CandidateNature::Disturbance,
        is_per_run: false,
        source: ColumnSource::Columns(vec![ColumnChoice {
            constants: Vec::new(),
            columns: vec![column],
        }]),
    })
}
