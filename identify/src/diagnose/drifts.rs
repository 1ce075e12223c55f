//! Drift within a recording: of the zero of a force sensor, and of friction that warms up. Each recording has its own
//! parameters. A drifting zero also has a level, since its correct value is unknown.

use super::column::ForceColumn;
use super::problem::{
    CandidateEffect, CandidateNature, ColumnChoice, ColumnSource, DiagnosisProblem, EffectParameter, LocatedEffect,
    SignConstraint,
};

/// Candidates for a drift of the offset and of the friction of every channel; `units` are those of the forces,
/// `[channel]`.
pub fn drift_candidates(problem: &DiagnosisProblem, units: &[String]) -> Vec<CandidateEffect> {
    let layout = &problem.layout;
    // Segments of one recording share its parameters.
    let mut recordings: Vec<&str> = layout.segments.iter().map(|s| s.name.as_str()).collect();
    recordings.dedup();
    // Level and ramp of each recording.
    let ramps: Vec<[Vec<f64>; 2]> = recordings.iter().map(|name| recording_ramp(problem, name)).collect();
    let mut candidates = Vec::new();
    for (d, channel) in layout.channels.iter().enumerate() {
        // Friction column of one channel times a function of time.
        let product = |ramp: &[f64], column: &ForceColumn| -> ForceColumn {
            let mut only = ForceColumn(vec![None; layout.channels.len()]);
            let values = column.0[d].iter().flatten();
            only.0[d] = Some(values.zip(ramp).map(|(x, r)| x * r).collect());
            only
        };
        // Columns of the friction of a drive: rate, sign of the rate, and a constant.
        let Some([rate, sign, one]) = problem.friction.get(3 * d..3 * d + 3) else {
            continue;
        };
        // An offset drift scales the constant, a friction drift dry and viscous friction.
        for (kind, shapes) in [
            ("offset_drift", &[("F0", one)][..]),
            ("friction_drift", &[("Fc", sign), ("Fv", rate)]),
        ] {
            let mut parameters = Vec::new();
            let mut columns = Vec::new();
            let has_level = kind == "offset_drift";
            // Without a sensor there is no offset.
            if has_level && problem.is_idle(d) {
                continue;
            }
            // Every recording has parameters of its own.
            for ([level, ramp], name) in ramps.iter().zip(&recordings) {
                // Parameters for the change over the recording, and for an offset also its level.
                let changes = shapes.iter().map(|shape| ("change of ", ramp, shape));
                let levels = shapes.iter().map(|shape| ("", level, shape));
                for (lead, ramp, (symbol, shape)) in
                    changes.chain(levels.take(if has_level { shapes.len() } else { 0 }))
                {
                    let column = product(ramp, shape);
                    // The drive does not move in this recording.
                    if column.0[d].iter().flatten().all(|x| *x == 0.0) {
                        continue;
                    }
                    // Viscous friction has a unit of its own; the others have that of the force.
                    let unit = match *symbol {
                        "Fv" if units[d] == "N" => "N s/m",
                        "Fv" => "N m s/rad",
                        _ => units[d].as_str(),
                    };
                    parameters.push(EffectParameter {
                        symbol: format!("{lead}{symbol} in {name}"),
                        unit: unit.to_owned(),
                        sign: SignConstraint::Any,
                    });
                    columns.push(column);
                }
            }
            if columns.is_empty() {
                continue;
            }
            candidates.push(CandidateEffect {
                effect: LocatedEffect {
                    kind: kind.to_owned(),
                    at: vec![channel.clone()],
                },
                parameters,
                searched_constants: 0,
                is_part_of_load: false,
                refines: None,
                nature: CandidateNature::Disturbance,
                is_per_run: true,
                source: ColumnSource::Columns(vec![ColumnChoice {
                    constants: Vec::new(),
                    columns,
                }]),
            });
        }
    }
    candidates
}

/// Two functions of time: 1 within one recording and 0 in the others, and a ramp from -1/2 to 1/2 within that
/// recording.
fn recording_ramp(problem: &DiagnosisProblem, recording: &str) -> [Vec<f64>; 2] {
    let stretches = &problem.layout.segments;
    // The ramp covers all segments of the recording.
    let of = stretches.iter().filter(|s| s.name == recording);
    let samples: usize = of.map(|s| s.samples).sum();
    let last = samples.saturating_sub(1).max(1) as f64;
    let mut at = 0.0;
    let [mut level, mut ramp] = [(); 2].map(|()| Vec::with_capacity(problem.layout.samples()));
    for segment in stretches {
        for _ in 0..segment.samples {
            // Outside of the recording both functions are zero.
            let is_in = segment.name == recording;
            level.push(f64::from(u8::from(is_in)));
            ramp.push(if is_in { at / last - 0.5 } else { 0.0 });
            at += f64::from(u8::from(is_in));
        }
    }
    [level, ramp]
}
