//! Judges all hypotheses about faults of a recording: which one is decisive, and whether it is the only one.

use modelmill_boundary::message;
use modelmill_boundary::text::Message;

use super::bench::{FaultBench, HypothesisErrors, HypothesisRows};
use super::thresholds::{
    EQUIVALENT_ERROR_TOLERANCE, FIT_GAIN_DECISIVE, FIT_LOSS_TOLERANCE, FIT_MOST_RATIO, FRICTION_LEAST_FIT_GAIN,
    MOTION_LEAST_ERROR, MOTION_LEAST_NOMINAL_ERROR, NOMINAL_AFTER_MOST, NOMINAL_BEFORE_LEAST, NOMINAL_GAIN_DECISIVE,
    NOMINAL_LOSS_TOLERANCE, RIVAL_MARGIN, SIGN_RIVAL_MARGIN,
};
use super::{
    ENTRIES, FaultCorrection, FaultHypothesis, FaultSubject, ForceChange, MotionChange, RecordingFaultKind,
    SuspectedFault, gravity,
};
use crate::model::Model;
use crate::segment::RecordingSegment;
use crate::text::table::percent;

/// Most alternatives that are named.
const MOST_NAMED: usize = 3;
/// Largest number of multiplications for all changes of the motion, some seconds of one core; exceeds 32 bits.
const AFFORDABLE: u64 = 10_000_000_000;

/// A hypothesis with the errors under it.
pub(super) struct JudgedHypothesis {
    /// The hypothesis.
    hypothesis: FaultHypothesis,
    /// The errors.
    errors: HypothesisErrors,
    /// Sum of the logarithms by which fitted errors fall.
    fit_gain: f64,
    /// The same with nominal values.
    nominal_gain: f64,
}

impl JudgedHypothesis {
    /// Both gains together.
    fn score(&self) -> f64 {
        self.fit_gain + self.nominal_gain
    }

    /// Whether the recording speaks clearly for the hypothesis.
    fn is_decisive(&self, before: &HypothesisErrors) -> bool {
        let pairs = before.fit.iter().zip(&self.errors.fit);
        let mut ratios = pairs.filter_map(|(before, after)| Some((*after)? / (*before)?));
        let is_fitted = self.fit_gain > FIT_GAIN_DECISIVE
            && self.nominal_gain > -NOMINAL_LOSS_TOLERANCE
            && ratios.any(|ratio| ratio < FIT_MOST_RATIO);
        let is_likely = self.hypothesis.is_implausible_now && self.fit_gain > -FIT_LOSS_TOLERANCE && self.score() > 0.0;
        is_fitted || is_likely || self.is_decided_by_nominal(before) || self.is_decided_by_friction(before)
    }

    /// Whether friction decides, which brakes a machine whatever its model: with the signs as they are recorded it would
    /// drive some drives, and with the other signs it brakes them and drives no others. The fit must agree, unless the
    /// forces of two or more drives turn together. A single drive has no fit that could agree.
    fn is_decided_by_friction(&self, before: &HypothesisErrors) -> bool {
        let turned = self.errors.drives_braked_instead(before);
        let turns_all = turned > 1 && turned == before.dissipation.len();
        let least_gain = if turns_all {
            -FIT_LOSS_TOLERANCE
        } else {
            FRICTION_LEAST_FIT_GAIN
        };
        self.is_supported_by_friction(before, least_gain)
    }

    /// Whether friction would drive the machine with the signs as they are recorded and brakes it with the others, and the
    /// fitted errors fall by more than `least_gain` then.
    fn is_supported_by_friction(&self, before: &HypothesisErrors, least_gain: f64) -> bool {
        self.hypothesis.kind == RecordingFaultKind::WrongSign
            && self.errors.drives_braked_instead(before) > 0
            && self.fit_gain > least_gain
            && self.nominal_gain > -NOMINAL_LOSS_TOLERANCE
    }

    /// Whether the nominal values decide, as they must for a sign or a unit that a fit absorbs.
    fn is_decided_by_nominal(&self, before: &HypothesisErrors) -> bool {
        let (Some(before), Some(after)) = (&before.nominal, &self.errors.nominal) else {
            return false;
        };
        // The forces that the hypothesis changes, or all of them.
        let changed = &self.hypothesis.forces.0;
        let concerned = (0..after.len()).filter(|d| changed.is_empty() || changed.iter().any(|(to, _, _)| to == d));
        let mut pairs = concerned.filter_map(|d| Some((before[d]?, after[d]?)));
        let is_turned = |(before, after): (f64, f64)| before > NOMINAL_BEFORE_LEAST && after < NOMINAL_AFTER_MOST;
        let all = if changed.is_empty() {
            pairs.any(is_turned)
        } else {
            pairs.all(is_turned)
        };
        all && self.nominal_gain > NOMINAL_GAIN_DECISIVE && self.fit_gain > -FIT_LOSS_TOLERANCE
    }

    /// Whether two hypotheses explain the recording by the same errors, so that it does not matter which is corrected.
    fn is_equivalent(&self, other: &Self) -> bool {
        let alike = |a: &[Option<f64>], b: &[Option<f64>]| {
            a.iter().zip(b).all(|pair| match pair {
                (Some(a), Some(b)) => (a - b).abs() < EQUIVALENT_ERROR_TOLERANCE * a.max(*b),
                _ => true,
            })
        };
        let nominal = match (&self.errors.nominal, &other.errors.nominal) {
            (Some(a), Some(b)) => alike(a, b),
            _ => true,
        };
        nominal && alike(&self.errors.fit, &other.errors.fit)
    }
}

/// The suspected fault whose correction brings recording and model into the best agreement; `None` if no fault is
/// decisive.
pub(crate) fn find_fault(subject: &FaultSubject<'_>) -> Option<SuspectedFault> {
    let bench = FaultBench::new(subject.model, subject.segments)?;
    let rows = bench.rows(&MotionChange::None);
    let before = match &rows {
        Some(rows) => bench.errors(rows, &ForceChange::default()),
        None => HypothesisErrors::out_of_reach(&bench),
    };
    let judged = judge_all(subject, &bench, rows.as_ref(), &before);
    let (mut decisive, others): (Vec<JudgedHypothesis>, Vec<JudgedHypothesis>) =
        judged.into_iter().partition(|one| one.is_decisive(&before));
    decisive.sort_by(|a, b| b.score().total_cmp(&a.score()));
    let file = subject.raw.file();
    let best = decisive.first().map_or(f64::NEG_INFINITY, JudgedHypothesis::score);
    // Gravity changes the forces of all drives, so that several wrong columns may look like it.
    let direction = gravity::find_direction(subject, &bench, &before);
    if let Some(gravity) = direction.filter(|gravity| gravity.score > best - RIVAL_MARGIN) {
        let mut fault = gravity.fault;
        if let Some(rival) = decisive.first().filter(|_| gravity.score < best + RIVAL_MARGIN) {
            fault.clause = format!("either {}, or {}", fault.clause, rival.hypothesis.clause);
            fault.advice = Message::join([fault.advice, rival.hypothesis.advice.clone()], ", or ");
            fault.correction = None;
        }
        return Some(fault);
    }
    let best = decisive.first()?;
    let is_by_friction = best.is_decided_by_friction(&before);
    let margin = if is_by_friction {
        SIGN_RIVAL_MARGIN
    } else {
        RIVAL_MARGIN
    };
    // The direction of friction shows that a sign is wrong, but not whether it is that of the force or of the coordinate.
    let turned = best.errors.drives_braked_instead(&before);
    let supported_by_friction = others.iter().filter(|one| {
        is_by_friction
            && one.is_supported_by_friction(&before, -FIT_LOSS_TOLERANCE)
            && one.errors.drives_braked_instead(&before) >= turned
    });
    let rivals: Vec<&JudgedHypothesis> = (decisive[1..].iter().chain(supported_by_friction))
        .filter(|one| one.score() > best.score() - margin)
        .collect();
    let is_unique = rivals.iter().all(|one| one.is_equivalent(best));
    let evidence = if is_by_friction {
        friction_evidence_text(&before, &best.errors)
    } else {
        evidence_text(&before, &best.errors, rows.is_some())
    };
    let correction = is_unique.then(|| FaultCorrection::Columns(best.hypothesis.operations.clone()));
    let (clause, advice, at) = if rivals.is_empty() {
        (
            best.hypothesis.clause.clone(),
            best.hypothesis.advice.clone(),
            best.hypothesis.at.clone(),
        )
    } else {
        joined_hypotheses(best, &rivals)
    };
    Some(SuspectedFault {
        kind: best.hypothesis.kind,
        at,
        recordings: vec![file.to_owned()],
        clause,
        advice,
        evidence,
        fit_gain: best.fit_gain,
        correction,
    })
}

/// What a correction does to a recording.
pub(crate) struct CorrectionScore {
    /// Sum over the drives of the logarithms by which errors fall, fitted and with nominal values.
    pub(crate) gain: f64,
    /// Whether friction brakes the machine with the correction and would drive it without, at about the same fit.
    pub(crate) is_asked_by_friction: bool,
    /// Whether friction would drive the machine with the correction and brakes it without.
    pub(crate) is_refused_by_friction: bool,
}

/// What a correction does to a recording; `None` if the errors cannot be compared. Both states have a model, since gravity
/// is corrected there.
pub(crate) fn correction_score(
    before: (&Model, &[RecordingSegment]),
    after: (&Model, &[RecordingSegment]),
) -> Option<CorrectionScore> {
    let errors = |(model, segments): (&Model, &[RecordingSegment])| {
        let bench = FaultBench::new(model, segments)?;
        Some(match bench.rows(&MotionChange::None) {
            Some(rows) => bench.errors(&rows, &ForceChange::default()),
            None => HypothesisErrors::out_of_reach(&bench),
        })
    };
    let [before, after] = [errors(before)?, errors(after)?];
    let gain = after.fit_gain(&before) + after.nominal_gain(&before);
    Some(CorrectionScore {
        gain,
        is_refused_by_friction: before.drives_braked_instead(&after) > 0,
        is_asked_by_friction: after.drives_braked_instead(&before) > 0 && gain > -FIT_LOSS_TOLERANCE,
    })
}

/// Clause, advice and places of hypotheses that explain a recording equally well.
fn joined_hypotheses(best: &JudgedHypothesis, rivals: &[&JudgedHypothesis]) -> (String, Message, Vec<String>) {
    let all: Vec<&FaultHypothesis> = std::iter::once(best)
        .chain(rivals.iter().copied())
        .map(|one| &one.hypothesis)
        .collect();
    let named: Vec<String> = all.iter().take(MOST_NAMED).map(|one| one.clause.clone()).collect();
    let more = if all.len() > MOST_NAMED {
        ", or another column is at fault"
    } else {
        ""
    };
    let mut at: Vec<String> = Vec::new();
    // Only faults of the same kind share their places.
    for one in all.iter().filter(|one| one.kind == all[0].kind) {
        for place in &one.at {
            if !at.contains(place) {
                at.push(place.clone());
            }
        }
    }
    let advices = all.iter().take(MOST_NAMED).map(|one| one.advice.clone());
    (
        format!("either {}{more}", named.join(", or ")),
        Message::join(advices, ", or "),
        at,
    )
}

/// Judges the hypotheses of all entries. Changes of the motion are omitted if the model explains the recording well.
fn judge_all(
    subject: &FaultSubject<'_>,
    bench: &FaultBench<'_>,
    rows: Option<&HypothesisRows>,
    before: &HypothesisErrors,
) -> Vec<JudgedHypothesis> {
    let hypotheses: Vec<FaultHypothesis> = ENTRIES
        .iter()
        .flat_map(|entry| entry.hypotheses(subject, bench))
        .collect();
    let is_poor = before.fit.iter().flatten().any(|error| *error > MOTION_LEAST_ERROR)
        || before
            .mean_nominal()
            .is_some_and(|error| error > MOTION_LEAST_NOMINAL_ERROR);
    // Exchanges of coordinates are the most numerous, and are omitted if all would take too long.
    let columns = (subject.model.base.len() + 4) as u64;
    let cost = |n: usize| columns.pow(2) * (bench.samples() * bench.forces().len() * n) as u64;
    let judge = |hypothesis: FaultHypothesis, rows: &HypothesisRows| {
        let errors = bench.errors(rows, &hypothesis.forces);
        JudgedHypothesis {
            fit_gain: errors.fit_gain(before),
            nominal_gain: errors.nominal_gain(before),
            hypothesis,
            errors,
        }
    };
    let (of_forces, of_motion): (Vec<_>, Vec<_>) =
        hypotheses.into_iter().partition(|one| one.motion == MotionChange::None);
    let of_forces = of_forces.into_iter().filter_map(|one| Some(judge(one, rows?)));
    let mut judged: Vec<JudgedHypothesis> = of_forces.collect();
    // A wrong coordinate may look like a wrong force, so both are compared.
    let is_suspicious = is_poor || judged.iter().any(|one| one.is_decisive(before));
    let mut motions: Vec<(MotionChange, Option<HypothesisRows>)> = Vec::new();
    for hypothesis in of_motion {
        if !is_suspicious && !hypothesis.is_implausible_now || cost(motions.len() + 1) > AFFORDABLE {
            continue;
        }
        let known = motions.iter().position(|(motion, _)| *motion == hypothesis.motion);
        let place = known.unwrap_or_else(|| {
            motions.push((hypothesis.motion.clone(), bench.rows(&hypothesis.motion)));
            motions.len() - 1
        });
        judged.extend(motions[place].1.as_ref().map(|rows| judge(hypothesis, rows)));
    }
    judged
}

/// The errors before and after a correction, as a sentence.
pub(super) fn evidence_text(before: &HypothesisErrors, after: &HypothesisErrors, is_reachable: bool) -> String {
    if !is_reachable {
        return format!(
            "The mechanism cannot reach the poses as they are recorded; after the correction the best fit of the model has an \
             error of {} (geometric mean over the drives).",
            percent(Some(after.mean_fit()))
        );
    }
    // The nominal values are named if they decide.
    let (of, [before, after]) = match (before.mean_nominal(), after.mean_nominal()) {
        (Some(nominal), Some(corrected)) if after.fit_gain(before) < FIT_GAIN_DECISIVE => (
            "The model with its nominal values, compared with friction alone,",
            [nominal, corrected],
        ),
        _ => ("The best fit of the model", [before.mean_fit(), after.mean_fit()]),
    };
    format!(
        "{of} has an error of {} as recorded, and of {} after the correction (geometric mean over the drives).",
        percent(Some(before)),
        percent(Some(after))
    )
}

/// The direction of friction and the errors of the fit before and after a correction, as a sentence.
fn friction_evidence_text(before: &HypothesisErrors, after: &HypothesisErrors) -> String {
    format!(
        "As recorded, friction would drive the machine; after the correction it brakes it, as it must. The best fit of the \
         model has an error of {} as recorded, and of {} after the correction (geometric mean over the drives).",
        percent(Some(before.mean_fit())),
        percent(Some(after.mean_fit()))
    )
}

impl SuspectedFault {
    /// The note for a reader of the recording: what was found, what it means, what to do.
    pub(crate) fn note_text(&self) -> Message {
        let what = if self.kind == RecordingFaultKind::GravityDirection {
            "a comparison with the nominal values shows that"
        } else {
            "it seems that"
        };
        message!(
            "In {} {what} {}. {} Until this is corrected, all results are doubtful: {}.",
            self.recordings.join(", "),
            self.clause,
            self.evidence,
            self.advice
        )
    }
}
