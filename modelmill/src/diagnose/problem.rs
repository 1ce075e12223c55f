//! States the search for missing effects in numbers and solves it. Input are a model and recordings, output is a
//! [`DiagnosisSolution`] with the problem, the diagnosis and the candidates.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::diagnose::{
    CandidateEffect, CandidateOutcome, ColumnChoice, ColumnProvider, ColumnSource, DiagnosisProblem, Disturbance,
    FORCE_ROUNDING, ForceColumn, LawSite, LoadDependentQuery, LocatedEffect, ModelDiagnosis, RejectionReason, diagnose,
    drift_candidates, reading_fault_candidates, signal_changes, white_noise,
};

use crate::along::drive_rates;
use crate::error::{Error, Outcome};
use crate::identify::regression::zero_force_message;
use crate::model::Model;
use crate::progress::JobHandle;
use crate::runs::RecordingDifference;
use crate::runs::payload::PayloadColumns;
use crate::segment::RecordingSegment;
use crate::text::table::count;
use modelmill_identify::RecordingNote;

use super::candidates::{DerivedCandidates, candidates};
use super::clock::clock;
use super::columns::{self, CandidateOrigin, load_dependent_columns, refined_columns};
use super::constants::{ClaimedConstant, constants};
use super::contacts::{
    contacts_beside_changes, contacts_in_residual, drop_doubtful_contacts, keep_contacts, leave_out_late_contacts,
};
use super::encoders::{self, encoders};
use super::estimates::round_by_deviation;
use super::faults::subtract_known;
use super::friction_memory::dahl_candidates;
use super::gears::gears;
use super::held_friction;
use super::laws::sites;
use super::measured_play;
use super::named_zeros::NamedZeros;
use super::numbers::{layout, stack, variables};
use super::payloads::{frame_loads, load_changes, payloads, reach};
use super::places::sharing_places;
use super::signal_delays::SignalDelays;
use super::standing_drives::StandingDrives;
use super::thresholds::FEWEST_SAMPLES;
use super::words;
use super::zero_or_tilt::{add_zeros_as_alternatives, base_joints};
use crate::regressors::{SegmentList, regressor};

/// Which base parameters are fixed at their nominal values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FixedParameters {
    /// Only those whose value is known because their expression contains no dynamic parameter, only constants and
    /// numbers ([`Model::is_known`]). All others are estimated.
    Known,
    /// All base parameters, with one exception: if the values of the model come from a fit with a covariance
    /// ([`Model::with_fit`]), they are not fixed but estimated, with values and covariance of the fit as a prior.
    All,
}

/// The problem, its solution and the candidates.
pub(crate) struct DiagnosisSolution {
    /// The problem in numbers, without columns.
    pub problem: DiagnosisProblem,
    /// Whether changes within recordings were searched.
    pub are_changes_searched: bool,
    /// What was not searched in forces that were computed from signals; `None` if all were measured.
    pub computed_forces_note: Option<RecordingNote>,
    /// Its solution.
    pub diagnosis: ModelDiagnosis,
    /// Candidates that `add` could add, with their derivation.
    pub candidates: DerivedCandidates,
}

impl DiagnosisSolution {
    /// The note that changes within recordings were not searched; `None` if they were.
    pub(crate) fn unsearched_changes_note(&self) -> Option<RecordingNote> {
        let note = || {
            RecordingNote::warning(
                "Changes within a recording, such as a load that is taken up, were not searched: the model has too many \
                 base parameters for this search. Divide the recording and compare its parts as runs.",
            )
        };
        (!self.are_changes_searched).then(note)
    }

    /// Mean square residual of each drive, N^2 or (N m)^2.
    pub(crate) fn mean_square_residuals(&self) -> impl Iterator<Item = f64> {
        let mean = |rest: &Vec<f64>| rest.iter().map(|r| r * r).sum::<f64>() / rest.len().max(1) as f64;
        self.diagnosis.residual.iter().map(mean)
    }

    /// Sum of the squared residuals of all drives, each relative to the squared force of the drive (1).
    pub(crate) fn mean_square_residual(&self) -> f64 {
        let forces = self.diagnosis.budgets.iter().map(|budget| budget.force.powi(2));
        let parts = forces.zip(self.mean_square_residuals());
        parts.map(|(force, square)| square / force.max(f64::MIN_POSITIVE)).sum()
    }
}

/// Options of the search.
#[derive(Clone, Copy)]
pub(crate) struct DiagnosisQuery<'a> {
    /// Which parameters keep their nominal values.
    pub fixed: FixedParameters,
    /// Whether to search for payloads, laws and alternatives too. Not in the second diagnosis with nominal
    /// values: there every wrong value of a body would look like a payload.
    pub in_full: bool,
    /// Differences between the recordings.
    pub run_differences: &'a [RecordingDifference],
    /// Whether the clock of the recordings may be wrong: a recorded rate would show that by itself.
    pub is_clock_in_question: bool,
    /// Errors of constants that an earlier search claims.
    pub claimed: &'a [ClaimedConstant],
    /// Whether effects are evaluated with the claimed errors.
    pub are_effects_at_claims: bool,
    /// Zeros of the model file that are candidates as wrong constants.
    pub zeros: Option<&'a NamedZeros>,
}

/// Finds the effects that a model lacks; `fit` are the fitted recordings, `check` the validation runs.
///
/// Fails when all forces are zero, when samples are too few, when a pose has no solution, and when a job is
/// cancelled.
pub(crate) fn find_missing_effects(
    model: &Model,
    fit: &[RecordingSegment],
    check: &[RecordingSegment],
    query: DiagnosisQuery<'_>,
) -> Outcome<DiagnosisSolution> {
    let held = query.fixed;
    // Stage 1: derive all candidates and evaluate their columns.
    let mut candidates = model
        .host()
        .run_job("deriving all candidates", 0, |_| candidates(model))??;
    if query.are_effects_at_claims {
        candidates.constant_errors = query.claimed.to_vec();
    }
    let all: Vec<(&RecordingSegment, bool)> = (fit.iter().map(|one| (one, false)))
        .chain(check.iter().map(|one| (one, true)))
        .collect();
    let (mut problem, made) = model
        .host()
        .run_job("computing the forces of all candidates", 0, |_| {
            problem(&candidates, model, &all)
        })??;
    let mut origins = made.origins;
    // Stage 2: fixed parameters and known faults are subtracted from the forces.
    let other_friction = match held {
        FixedParameters::All => held_friction::changes(model, &problem.base),
        FixedParameters::Known => Vec::new(),
    };
    fix_parameters(&mut problem, model, held);
    problem.effects_only = !query.in_full;
    let without_contacts = subtract_known(&mut problem, model, &all, query.run_differences)?;
    // Stage 3: faults of signals, of encoders, of gears and of lengths, which a model file cannot contain.
    let mut further = fault_candidates(model, &all, &problem, query)?;
    further.extend(other_friction);
    if query.in_full {
        if held == FixedParameters::All || problem.base.is_empty() {
            further.extend(payload_candidates(model, &all)?);
        }
        problem.change_shapes = load_changes(model, &all)?;
        problem
            .change_shapes
            .extend(signal_changes(&problem, &force_units(model)));
    }
    let joints = base_joints(&problem.candidates, &further, &encoders::values(model, &problem, held));
    let delays = SignalDelays::new(model, &all)?;
    further.extend(delays.candidates.iter().cloned());
    problem.candidates.extend(further);
    // None of these can be an entry of a model file.
    origins.resize(problem.candidates.len(), None);
    drop_excluded_candidates(
        &mut problem,
        &mut origins,
        model,
        &delays,
        &StandingDrives::find(model, &all)?,
    );
    // Stage 4: the search, which requests further columns while it runs.
    let supply = ColumnSupply {
        candidates: &candidates,
        origins: &origins,
        grids: &made.grids,
        model,
        all: &all,
        job: None,
    };
    let are_changes_searched = problem.searches_changes();
    let forces = (problem.measured.clone(), problem.removed.clone());
    let known = problem.candidates.len();
    let search = |problem: &mut DiagnosisProblem| {
        let host = model.host();
        host.run_job("searching for missing effects", 0, |job| {
            diagnose(problem, &supply.with_job(job))
        })
    };
    let mut diagnosis = search(&mut problem)?;
    // The audit knows neither changes in time, nor delays and other effects that the search finds: they look like
    // contacts, and the contacts that are left once they are known are found below.
    let kept = contacts_beside_changes(&diagnosis.disturbances, &all)
        .or_else(|| contacts_in_residual(&problem, &all, &diagnosis.complete_residual, &without_contacts));
    if let Some(kept) = kept.filter(|_| query.in_full) {
        keep_contacts(&mut problem, &all, kept, &without_contacts);
        (problem.measured, problem.removed) = forces.clone();
        problem.candidates.truncate(known);
        problem.change_intervals.clear();
        diagnosis = search(&mut problem)?;
    }
    // A missing effect hides small contacts: with the effects found, they stand out. Then the search is repeated.
    if query.in_full && leave_out_late_contacts(&mut problem, model, &all, &diagnosis.residual) {
        (problem.measured, problem.removed) = forces;
        // The first search added changes in time that a contact may have caused.
        problem.candidates.truncate(known);
        problem.change_intervals.clear();
        diagnosis = search(&mut problem)?;
    }
    drop_doubtful_contacts(
        &mut diagnosis.disturbances,
        &diagnosis.time_residuals,
        &problem.layout.channels,
    );
    let is_tilt = |one: &CandidateEffect| matches!(one.source, ColumnSource::Tilt(_));
    if let Some(tilt) = problem.candidates.iter().position(is_tilt) {
        add_zeros_as_alternatives(&mut diagnosis.effects, tilt, &joints);
    }
    measured_play::report_as_effects(model, &problem.candidates, &mut diagnosis);
    // Stage 5: texts, values that the model shares, and candidates that could not be evaluated.
    describe_findings(&mut diagnosis, model, made.undefined);
    Ok(DiagnosisSolution {
        problem: problem.without_columns(),
        are_changes_searched,
        computed_forces_note: delays.note(model),
        diagnosis,
        candidates,
    })
}

/// Adds texts, places that share a value, and the candidates that could not be evaluated.
fn describe_findings(diagnosis: &mut ModelDiagnosis, model: &Model, undefined: Vec<LocatedEffect>) {
    let mechanism = &model.derivation.mechanism;
    let found = diagnosis.effects.iter_mut().chain(&mut diagnosis.possible_effects);
    for one in found {
        one.shared_with = sharing_places(mechanism, &one.effect);
    }
    for one in &mut diagnosis.disturbances {
        describe_disturbance(one, model);
    }
    diagnosis
        .candidates
        .extend(undefined.into_iter().map(|effect| CandidateOutcome {
            effect,
            explained: 0.0,
            gain: 0.0,
            rejection_reason: Some(RejectionReason::NotFinite),
        }));
}

/// Candidates that a model file cannot contain: faults of signals and drifts, Dahl friction, then those that need the
/// derivatives of the forces by the motion.
///
/// Fails when a pose has no solution.
fn fault_candidates(
    model: &Model,
    all: &[(&RecordingSegment, bool)],
    problem: &DiagnosisProblem,
    query: DiagnosisQuery<'_>,
) -> Outcome<Vec<CandidateEffect>> {
    let mut found = reading_fault_candidates(problem);
    found.extend(drift_candidates(problem, &force_units(model)));
    found.extend(dahl_candidates(model, all)?);
    found.extend(motion_candidates(model, all, problem, query)?);
    Ok(found)
}

/// The unit of the force of each drive.
fn force_units(model: &Model) -> Vec<String> {
    (0..model.row_names().len())
        .map(|d| model.force_unit(d).to_owned())
        .collect()
}

/// Candidates of masses on the frames of a model.
///
/// Fails when a pose has no solution.
fn payload_candidates(model: &Model, all: &[(&RecordingSegment, bool)]) -> Outcome<Vec<CandidateEffect>> {
    let loads = frame_loads(model, all, &PayloadColumns::new(model)?)?;
    Ok(payloads(model, &loads))
}

/// Removes the candidates and changes that computed forces or standing drives exclude, with their origins, and adds the delays of
/// the signals to the base: estimated delays are estimated anew with each set of effects.
fn drop_excluded_candidates(
    problem: &mut DiagnosisProblem,
    origins: &mut Vec<CandidateOrigin>,
    model: &Model,
    delays: &SignalDelays,
    standing: &StandingDrives,
) {
    problem.change_shapes.retain(|one| !standing.excludes(&one.effect));
    let is_kept: Vec<bool> = (problem.candidates.iter())
        .map(|one| !delays.excludes(model, one) && !standing.excludes(&one.effect))
        .collect();
    let mut of_origins = is_kept.iter();
    origins.retain(|_| *of_origins.next().unwrap_or(&true));
    let mut of_candidates = is_kept.iter();
    problem.candidates.retain(|_| *of_candidates.next().unwrap_or(&true));
    problem.base.extend(delays.estimated.iter().cloned());
    problem.base_is_part_of_load.resize(problem.base.len(), false);
    problem.without_sensor = delays.is_commanded(model);
}

/// Completes a disturbance: the units of its place, and a sentence.
fn describe_disturbance(one: &mut Disturbance, model: &Model) {
    // A disturbance of a drive has the unit of its force.
    let drives = model.row_names();
    let place = one.at.first();
    let drive = drives.iter().position(|drive| Some(drive) == place);
    if let Some(d) = drive {
        for value in one.estimates.iter_mut().filter(|v| v.unit.is_empty()) {
            model.force_unit(d).clone_into(&mut value.unit);
        }
    }
    // Text and JSON state the same digits.
    for value in one.estimates.iter_mut().filter(|v| v.standard_deviation.is_some()) {
        value.value = round_by_deviation(value.value, value.standard_deviation);
    }
    if one.description.is_none() {
        one.description = Some(words::disturbance(one));
    }
}

/// Candidates that follow from the derivatives of the forces by the motion: errors of encoders, of the clock, of gears, of
/// lengths and angles.
///
/// Fails when a pose has no solution.
fn motion_candidates(
    model: &Model,
    all: &SegmentList<'_>,
    problem: &DiagnosisProblem,
    query: DiagnosisQuery<'_>,
) -> Outcome<Vec<CandidateEffect>> {
    let held = query.fixed;
    let values = encoders::values(model, problem, held);
    let slopes = encoders::sensitivities(model, all, &values);
    let mut candidates = encoders::zeros(model, &slopes);
    if query.is_clock_in_question {
        candidates.extend(clock(model, all, &slopes));
    }
    candidates.extend(encoders(model, all, problem, &slopes));
    candidates.extend(gears(model, all, &values, &slopes)?);
    candidates.extend(constants(model, all, query.zeros, query.claimed, &|k| {
        is_fixed(model, held, k)
    }));
    Ok(candidates)
}

/// Computes columns that the search requests while it runs.
struct ColumnSupply<'a> {
    /// Candidates that `add` could add.
    candidates: &'a DerivedCandidates,
    /// The entry that each candidate of the problem comes from.
    origins: &'a [CandidateOrigin],
    /// Values that are tried for the constant of each single candidate.
    grids: &'a [Vec<f64>],
    /// The model without the effects.
    model: &'a Model,
    /// Fitted recordings, then validation runs.
    all: &'a SegmentList<'a>,
    /// The job of the search, which may be cancelled.
    job: Option<&'a JobHandle>,
}

impl<'a> ColumnSupply<'a> {
    /// The same for a search that the job can cancel.
    fn with_job(&self, job: &'a JobHandle) -> ColumnSupply<'a> {
        ColumnSupply {
            job: Some(job),
            ..*self
        }
    }
}

impl ColumnProvider for ColumnSupply<'_> {
    fn is_cancelled(&self) -> bool {
        self.job.is_some_and(JobHandle::is_cancelled)
    }

    fn columns_for_constant(&self, candidate: usize, constant: f64) -> Option<Vec<ForceColumn>> {
        // Candidates without an entry have no searched constant.
        let (k, felt) = self.origins.get(candidate)?.as_ref()?;
        let entry = &self.candidates.entries[*k];
        let columns = refined_columns(self.candidates, self.model, self.all, entry, constant)?;
        let kept = columns.into_iter().zip(felt).filter(|(_, felt)| **felt);
        Some(kept.map(|(column, _)| column).collect())
    }

    fn sites(&self) -> Vec<LawSite> {
        // Poses without answer were reported when the recordings were evaluated for the first time.
        sites(self.candidates, self.model, self.all).unwrap_or_default()
    }

    fn load_dependent_columns(&self, load: &ForceColumn, which: LoadDependentQuery) -> Vec<(usize, ColumnChoice)> {
        // Either all candidates or one of them, with a given value of its constant.
        let only = match which {
            LoadDependentQuery::All => None,
            LoadDependentQuery::One(candidate, _) => {
                let Some(Some((entry, _))) = self.origins.get(candidate) else {
                    return Vec::new();
                };
                Some(*entry)
            }
        };
        let tried = |single: usize| match which {
            LoadDependentQuery::One(_, Some(value)) => vec![value],
            LoadDependentQuery::All | LoadDependentQuery::One(_, None) => grid_middle(&self.grids[single]),
        };
        // Poses without answer were reported when the recordings were evaluated for the first time.
        let made = load_dependent_columns(self.candidates, self.model, self.all, load, only, &tried);
        let made = made.unwrap_or_default();
        // From entries back to candidates of the problem.
        let place = |entry: usize| {
            let is_its = |origin: &CandidateOrigin| origin.as_ref().is_some_and(|(k, _)| *k == entry);
            self.origins.iter().position(is_its)
        };
        made.into_iter()
            .filter_map(|(entry, mut choices)| Some((place(entry)?, choices.pop()?)))
            .collect()
    }
}

/// The middle of a grid: close enough to detect an effect, at the cost of one value.
fn grid_middle(grid: &[f64]) -> Vec<f64> {
    grid.get(grid.len() / 2).copied().into_iter().collect()
}

/// The problem in numbers, with all columns of the base.
///
/// Fails when all forces are zero, when samples are too few, or when a pose has no solution.
fn problem(
    candidates: &DerivedCandidates,
    model: &Model,
    all: &SegmentList<'_>,
) -> Outcome<(DiagnosisProblem, columns::CandidateColumns)> {
    let measured = stack(all, |one| Ok(one.run.measured_forces()?.to_vec()))?;
    // Forces that are all zero come from a recording without them.
    if measured.iter().flatten().all(|force| *force == 0.0) {
        let file = all.first().map(|(one, _)| one.run.file.as_str());
        return Err(Error::input(zero_force_message(file.unwrap_or("the recording"))));
    }
    for (one, _) in all {
        let samples = one.time().len();
        if samples < FEWEST_SAMPLES {
            return Err(Error::input(format!(
                "{}: {} after decimation, too few to distinguish effects from chance. Give a longer recording or decimate less: \
                 at least {FEWEST_SAMPLES} are needed",
                one.run.file,
                count(samples, "sample is left", "samples are left"),
            )));
        }
    }
    // The noise and the layout come from the recordings, the columns from the model.
    let mut made = columns::candidate_columns(candidates, model, all)?;
    // A row without drive whose force is zero has no noise and no friction.
    let undriven = model.derivation.mechanism.drives.iter().map(|drive| !drive.is_driven);
    let idle = undriven
        .zip(&measured)
        .map(|(undriven, force)| undriven && force.iter().all(|f| *f == 0.0));
    let problem = DiagnosisProblem {
        layout: layout(model, all),
        noise: noise_levels(&measured, all)?,
        idle: idle.collect(),
        idle_squares: Vec::new(),
        measured: ForceColumn::new(measured),
        base: regressor(all, &ModelEvaluator::new(&model.derivation), model)?,
        candidates: std::mem::take(&mut made.candidates),
        base_is_part_of_load: (0..model.base.len()).map(|k| !model.is_effect(k)).collect(),
        friction: friction(model, all)?,
        variables: variables(model, all),
        fixed_forces: None,
        size: reach(&model.derivation.mechanism),
        ..DiagnosisProblem::default()
    };
    Ok((problem, made))
}

/// Whether a base parameter keeps its nominal value.
fn is_fixed(model: &Model, held: FixedParameters, k: usize) -> bool {
    held == FixedParameters::All || model.is_known(k)
}

/// Subtracts the forces of fixed parameters from the measured ones. Parameters of an earlier fit stay in the
/// base, with their standard deviations as prior.
fn fix_parameters(problem: &mut DiagnosisProblem, model: &Model, held: FixedParameters) {
    let is_held = |k: usize| is_fixed(model, held, k);
    let fitted: Vec<usize> = (0..model.base.len())
        .filter(|k| held == FixedParameters::All && !model.is_known(*k))
        .collect();
    problem.prior = model.information(&fitted);
    let has_prior = problem.prior.is_some();
    let is_fitted = |k: usize| has_prior && fitted.contains(&k);
    // The force of fixed parameters is summed; columns of the others stay.
    let mut known = ForceColumn(vec![None; model.row_names().len()]);
    let (mut free, mut is_part_of_load) = (Vec::new(), Vec::new());
    for (k, column) in std::mem::take(&mut problem.base).into_iter().enumerate() {
        if is_held(k) {
            known.add(model.values[k], &column);
        }
        if !is_held(k) || is_fitted(k) {
            free.push(column);
            is_part_of_load.push(problem.base_is_part_of_load[k]);
        }
    }
    // The columns of a tilt change with the base, and are split in the same way.
    for candidate in &mut problem.candidates {
        if let ColumnSource::Tilt(tilt) = &mut candidate.source {
            for change in &mut tilt.components {
                let mut free = Vec::new();
                for (k, column) in std::mem::take(&mut change.base).into_iter().enumerate() {
                    if is_held(k) {
                        change.fixed.add(model.values[k], &column);
                    } else {
                        free.push(column);
                    }
                }
                change.base = free;
            }
        }
    }
    problem.base = free;
    problem.base_is_part_of_load = is_part_of_load;
    if !known.is_zero() {
        problem.measured.add(-1.0, &known);
        problem.fixed_forces = Some(known);
    }
}

/// Columns of viscous friction, dry friction and an offset of every drive, in this order.
///
/// Fails when a pose has no solution.
fn friction(model: &Model, all: &SegmentList<'_>) -> Outcome<Vec<ForceColumn>> {
    let rates = stack(all, |one| drive_rates(model, one))?;
    let mut friction = Vec::new();
    for (d, rate) in rates.iter().enumerate() {
        // At exact standstill dry friction has no direction.
        let sign = |v: &f64| if *v == 0.0 { 0.0 } else { v.signum() };
        let signs = rate.iter().map(sign).collect();
        for values in [rate.clone(), signs, vec![1.0; rate.len()]] {
            let mut column = ForceColumn(vec![None; rates.len()]);
            column.0[d] = Some(values);
            friction.push(column);
        }
    }
    Ok(friction)
}

/// White noise of each force, N or N m. After decimation motion may look like noise, so the noise of all
/// recorded samples bounds it.
///
/// Fails when a recording has no forces.
fn noise_levels(measured: &[Vec<f64>], all: &SegmentList<'_>) -> Outcome<Vec<f64>> {
    let mut noises = Vec::with_capacity(measured.len());
    for (d, kept) in measured.iter().enumerate() {
        let mut recorded = Vec::new();
        for (one, _) in all {
            recorded.extend_from_slice(&one.run.measured_forces()?[d]);
        }
        noises.push(noise(kept).min(noise(&recorded)));
    }
    Ok(noises)
}

/// White noise of a force, at least the rounding of its numbers.
fn noise(force: &[f64]) -> f64 {
    let squares = force.iter().map(|f| f * f).sum::<f64>();
    let size = (squares / force.len().max(1) as f64).sqrt();
    white_noise(force).max(FORCE_ROUNDING * size)
}
