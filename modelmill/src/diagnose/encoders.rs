//! Candidates for errors of encoders: a wrong zero, or an eccentric disc whose error repeats once or several
//! times per turn. The derivatives of the forces by position, rate and acceleration come from central
//! differences of the fitted model. The force of any small error of the motion is then a sum of three products.

use modelmill_identify::changes::NormalEquations;
use modelmill_identify::diagnose::{
    CandidateEffect, CandidateNature, ColumnChoice, ColumnSource, DiagnosisProblem, EffectParameter, ForceColumn,
    LocatedEffect, SignConstraint,
};

use crate::along;
use crate::model::Model;
use crate::segment::RecordingSegment;

use super::numbers::stack;
use super::places::is_free;
use super::problem::FixedParameters;
use super::thresholds::{ENCODER_WAVE_SAMPLES, SLOPE_JUMP_MEDIANS};
use crate::regressors::SegmentList;

/// Kind of a wrong zero of an encoder.
pub(super) const ENCODER_ZERO: &str = "encoder_zero";
/// How often an error may repeat per turn, or along the travel of a prismatic coordinate.
const TIMES: [u32; 16] = [1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 30, 36, 48, 60];
/// Steps of the differences, as parts of the largest value.
const STEP: f64 = 1e-5;
/// Rates below this many steps show no usual slope.
const USUAL_LEAST_STEPS: f64 = 10.0;

/// Derivatives of the forces by position, rate and acceleration of every active coordinate, for given base
/// parameters; `None` if the forces cannot be evaluated next to the recorded motion.
pub(crate) fn sensitivities(model: &Model, all: &SegmentList<'_>, values: &[f64]) -> Vec<Option<[ForceColumn; 3]>> {
    // One coordinate at a time; a failure of one does not affect the others.
    let coordinates = 0..model.active_coordinate_types().len();
    coordinates.map(|i| sensitivity(model, all, values, i)).collect()
}

/// Candidates for a constant offset of each encoder; a free body has no encoder.
pub(crate) fn zeros(model: &Model, slopes: &[Option<[ForceColumn; 3]>]) -> Vec<CandidateEffect> {
    let (active, _) = model.derivation.coordinates();
    let has_encoder = |i: &usize| !is_free(&model.derivation.mechanism, *i);
    // A free body is measured by other means than an encoder.
    let each = model.active_coordinate_types().into_iter().zip(slopes).zip(active);
    let each = each.filter_map(|(one, i)| has_encoder(&i).then_some(one));
    let candidate = |((name, is_angle), slopes): ((String, bool), &Option<[ForceColumn; 3]>)| {
        let [by_position, ..] = slopes.as_ref()?;
        let mut column = ForceColumn(vec![None; model.row_names().len()]);
        // The shift is the recorded minus the true position: forces are those of the true motion.
        column.add(-1.0, by_position);
        Some(CandidateEffect {
            source: ColumnSource::Columns(vec![ColumnChoice {
                constants: Vec::new(),
                columns: vec![column],
            }]),
            ..disturbance(ENCODER_ZERO, name, &["shift"], is_angle)
        })
    };
    each.filter_map(candidate).collect()
}

/// A fault of a coordinate's encoder with parameters in its unit.
fn disturbance(kind: &str, name: String, symbols: &[&str], is_angle: bool) -> CandidateEffect {
    // Errors of an encoder have the unit of its coordinate.
    let parameter = |symbol: &&str| EffectParameter {
        symbol: (*symbol).to_owned(),
        unit: if is_angle { "rad" } else { "m" }.to_owned(),
        sign: SignConstraint::Any,
    };
    CandidateEffect {
        effect: LocatedEffect {
            kind: kind.to_owned(),
            at: vec![name],
        },
        parameters: symbols.iter().map(parameter).collect(),
        searched_constants: 0,
        is_part_of_load: false,
        refines: None,
        nature: CandidateNature::Disturbance,
        is_per_run: false,
        source: ColumnSource::Columns(Vec::new()),
    }
}

/// Candidates for an error of each encoder with sine and cosine of its angle, for each possible number of waves
/// per turn.
pub(crate) fn encoders(
    model: &Model,
    all: &SegmentList<'_>,
    problem: &DiagnosisProblem,
    slopes: &[Option<[ForceColumn; 3]>],
) -> Vec<CandidateEffect> {
    let active = model.active_coordinate_types();
    let mut candidates = Vec::new();
    for (i, (name, is_angle)) in active.iter().enumerate() {
        // Position, rate or acceleration.
        let of = |order: usize| -> Vec<f64> {
            let mut all_values = Vec::new();
            for (one, _) in all {
                let run = &one.run;
                let values = [&run.q, &run.qd, &run.qdd][order];
                all_values.extend(values[i].iter().copied().step_by(one.decimation()));
            }
            all_values
        };
        // Motion of the coordinate at the decimated samples of all recordings.
        let [q, qd, qdd] = [0, 1, 2].map(of);
        let low = q.iter().copied().fold(f64::INFINITY, f64::min);
        let travel = q.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low;
        let fastest = qd.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        if travel.is_nan() || travel <= 0.0 || fastest <= 0.0 {
            continue;
        }
        let Some(slopes) = &slopes[i] else {
            continue;
        };
        // The largest step between samples decides which waves can be seen.
        let step = problem.layout.segments.iter().map(|s| s.step);
        let step = step.fold(f64::MIN_POSITIVE, f64::max);
        // A prismatic coordinate has no turn: its error repeats along the travel.
        let turn = if *is_angle { std::f64::consts::TAU } else { travel };
        let choice = |times: u32| {
            let k = std::f64::consts::TAU * f64::from(times) / turn;
            // At the largest rate a wave must have enough samples, or the low-pass would remove it.
            if k * fastest * step > std::f64::consts::TAU / ENCODER_WAVE_SAMPLES {
                return None;
            }
            let wave = |phase: f64| {
                let error = |j: usize| {
                    let (sin, cos) = (k * q[j] + phase).sin_cos();
                    // Error of the position, and its first and second derivative in time.
                    let rate = k * cos * qd[j];
                    [sin, rate, k * cos * qdd[j] - k * k * sin * qd[j] * qd[j]]
                };
                let mut column = ForceColumn(vec![None; model.row_names().len()]);
                for (order, slope) in slopes.iter().enumerate() {
                    let mut part = slope.clone();
                    for values in part.0.iter_mut().flatten() {
                        for (j, x) in values.iter_mut().enumerate() {
                            *x *= error(j)[order];
                        }
                    }
                    // Forces are those of the true motion.
                    column.add(-1.0, &part);
                }
                column
            };
            Some(ColumnChoice {
                constants: vec![("times_per_turn".to_owned(), f64::from(times))],
                // Sine and cosine, so that the phase is estimated linearly.
                columns: vec![wave(0.0), wave(0.5 * std::f64::consts::PI)],
            })
        };
        // Waves that are too short at the largest rate are skipped.
        let choices: Vec<ColumnChoice> = TIMES.into_iter().filter_map(choice).collect();
        if choices.is_empty() {
            continue;
        }
        candidates.push(CandidateEffect {
            searched_constants: 1,
            source: ColumnSource::Columns(choices),
            ..disturbance("encoder_eccentricity", name.clone(), &["sine", "cosine"], *is_angle)
        });
    }
    candidates
}

/// Base parameters by least squares, with each drive weighted by its squared force; fixed ones keep their
/// nominal values.
pub(crate) fn values(model: &Model, problem: &DiagnosisProblem, held: FixedParameters) -> Vec<f64> {
    let mut all = NormalEquations::new(problem.base.len());
    for (d, measured) in problem.measured.0.iter().enumerate() {
        // A drive without force has no equations.
        let Some(measured) = measured else { continue };
        let mut one = NormalEquations::new(problem.base.len());
        let columns: Vec<Option<&[f64]>> = problem.base.iter().map(|c| c.0[d].as_deref()).collect();
        one.add_rows(&columns, measured);
        // Each drive counts alike, whatever its force.
        let weight = one.total.max(f64::MIN_POSITIVE).recip();
        one.gram *= weight;
        one.rhs *= weight;
        all.merge(&one);
    }
    // The normal equations have one solution for all drives.
    let solved = all.solve().values;
    let mut next = solved.iter();
    (0..model.base.len())
        .map(|k| {
            if held == FixedParameters::All || model.is_known(k) {
                model.values[k]
            } else {
                next.next().copied().unwrap_or(0.0)
            }
        })
        .collect()
}

/// Derivatives of the forces by a position, its rate and its acceleration, decimated; `None` if the forces
/// cannot be evaluated next to the recorded motion.
fn sensitivity(model: &Model, all: &SegmentList<'_>, values: &[f64], coordinate: usize) -> Option<[ForceColumn; 3]> {
    let mut slopes = Vec::new();
    for order in 0..3 {
        let slope = stack(all, |one| {
            // The motion of the coordinate of which one derivative is changed by a step of either sign.
            let motion = &[&one.run.q, &one.run.qd, &one.run.qdd][order][coordinate];
            let largest = motion.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            let step = STEP * largest.max(f64::MIN_POSITIVE);
            let along = |step: f64| {
                let mut turned: RecordingSegment = one.clone();
                let run = &mut turned.run;
                for x in &mut [&mut run.q, &mut run.qd, &mut run.qdd][order][coordinate] {
                    *x += step;
                }
                along::forces(model, &turned, values)
            };
            let (back, ahead) = (along(-step)?, along(step)?);
            // A coordinate that stands has no rate of a certain sign: slopes there show no usual size.
            let is_usual: Vec<bool> = (motion.iter())
                .map(|x| order != 1 || x.abs() > USUAL_LEAST_STEPS * step)
                .collect();
            let pairs = ahead.iter().zip(&back);
            let slopes = pairs.map(|(ahead, back)| {
                let differences = ahead.iter().zip(back);
                let mut slope: Vec<f64> = differences.map(|(a, b)| (a - b) / (2.0 * step)).collect();
                clear_jumps(&mut slope, &is_usual);
                slope
            });
            Ok(slopes.collect())
        });
        slopes.push(ForceColumn::new(slope.ok()?));
    }
    <[ForceColumn; 3]>::try_from(slopes).ok()
}

/// Sets the slopes to zero at which a sign jumps between the two steps, such as that of dry friction. This is done before
/// a low-pass spreads them. `is_usual` marks the samples that show the usual size.
fn clear_jumps(slope: &mut [f64], is_usual: &[bool]) {
    // The median, since jumps of signs are rare but large.
    let usual = slope.iter().zip(is_usual).filter(|(_, is_usual)| **is_usual);
    let mut sizes: Vec<f64> = usual.map(|(x, _)| x.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let bound = SLOPE_JUMP_MEDIANS * sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
    for x in slope.iter_mut().filter(|x| x.abs() > bound) {
        *x = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A coordinate that stands for most of the time has jumps of dry friction there; they are cleared, and the slopes
    /// in motion stay.
    #[test]
    fn jumps_at_standstill_are_cleared_and_slopes_in_motion_stay() {
        let is_usual: Vec<bool> = (0..100).map(|k| k >= 80).collect();
        let mut slope: Vec<f64> = is_usual.iter().map(|moves| if *moves { 1.5 } else { 4e4 }).collect();
        clear_jumps(&mut slope, &is_usual);
        assert!(slope[..80].iter().all(|x| x.abs() < 1e-12));
        assert!(slope[80..].iter().all(|x| (x - 1.5).abs() < 1e-12));
    }
}
