//! Findings of a diagnosis as values: verdict, missing effects with estimates and alternatives, the model without and
//! with the effects found, and regions where the error is largest. Text, JSON and the page print them.

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, OptionName, Remedy};
use modelmill_identify::diagnose::{
    DiagnosisVerdict, Disturbance, EffectSupport, IdentifiedEffect, LocatedEffect, ModelDiagnosis, TIME_BASE,
};
use modelmill_identify::{ErrorRegion, RecordingNote};
use modelmill_spec::Mechanics;
use modelmill_spec::edit::NewEffect;

use crate::along;
use crate::compare::{self, ErrorLocations};
use crate::error::{Error, Outcome};
use crate::faults::SuspectedFault;
use crate::model::Model;
use crate::recording::{PreparedRecording, segments};
use crate::runs::RecordingDifference;
use crate::segment::RecordingSegment;
use crate::text::table::percent;

use super::added_effects::{self, CompletedModelFile};
use super::clock::CLOCK_SHARE;
use super::completion::ModelCompletion;
use super::constants::CONSTANT_ERROR;
use super::corrected::CorrectedRecordings;
use super::effect_search::search_effects;
use super::elastic_drives::{ElasticAlternative, elastic_alternatives};
use super::estimates::{EffectEstimate, effect_estimates};
use super::faults;
use super::geometry_alternatives::{GeometryAlternative, GeometryError, geometry_alternatives};
use super::laws::{self, NamedLawProposal};
use super::long_recordings;
use super::model_versions::ModelVersion;
use super::named_zeros::NamedZeros;
use super::off_nominal::{OffNominalParameter, off_nominal_parameters, reversed_sign_note};
use super::problem::{self, DiagnosisQuery, DiagnosisSolution, FixedParameters};
use super::requested_effects::NamedEffect;
use super::standing_drives::StandingDrives;
use super::thresholds::{EQUAL_ALTERNATIVE_LEAST_SHARE, MOST_VALIDATION_ERROR};
use super::words::{self, ValidationMethod};

/// Fails if the error of the fitted model on validation data exceeds that of the prediction that all forces are zero:
/// findings of the fit are worthless then.
fn check_prediction(answer: &DiagnosisSolution, judged: ValidationMethod) -> Outcome {
    let diagnosis = &answer.diagnosis;
    let last = diagnosis.steps.last();
    let Some(last) = last.filter(|last| last.check > MOST_VALIDATION_ERROR) else {
        return Ok(());
    };
    if words::has_suspicion(diagnosis) {
        return Ok(());
    }
    Err(Error::input(message!(
        "the error {} is {} of the force ({} on the fitted data), more than that of the prediction that all forces are zero. So the \
         fit is useless, and no effect can be found. Fit a longer recording in which all drives move far and fast ({}), or fix the \
         parameters at those of an earlier fit ({})",
        judged.phrase(),
        percent(Some(last.check)),
        percent(Some(last.fit)),
        Remedy::command(CommandName::Excite),
        Remedy::option(OptionName::Parameters)
    )))
}

/// Options of a diagnosis. [`DiagnosisOptions::default`] estimates all base parameters whose values are not known, see
/// [`Model::is_known`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiagnosisOptions {
    /// Which base parameters are fixed at their nominal values; the others are estimated.
    pub fixed: FixedParameters,
    /// Whether to repeat the diagnosis with all base parameters fixed if some estimates differ from their nominal
    /// values. Such estimates may hide a missing effect.
    pub repeat_with_nominal: bool,
}

impl Default for DiagnosisOptions {
    fn default() -> Self {
        Self {
            fixed: FixedParameters::Known,
            repeat_with_nominal: true,
        }
    }
}

/// Result of [`Model::diagnose`]: the result of the search in [`Self::diagnosis`], effects with their alternatives and
/// experiments, the models without and with the effects found, and the edited model file.
pub struct DiagnosisFindings {
    /// Result of the search: the verdict, the error after each step, all candidates with the reasons why they were
    /// rejected, and the residual.
    pub diagnosis: ModelDiagnosis,
    /// The effects found: those that the model lacks.
    pub missing: Vec<MissingEffect>,
    /// Effects with a probability below 0.5. The verdict does not name them, and they are not added to the model.
    pub possible: Vec<MissingEffect>,
    /// Proposed force laws, which are in no library and would explain the residual: hypotheses, not findings.
    pub laws: Vec<NamedLawProposal>,
    /// Effects that the recordings can neither show nor exclude.
    pub undecided: Vec<UndecidedEffect>,
    /// Base parameters of bodies (not of effects) whose estimates differ from their nominal values. The largest
    /// difference comes first, in standard deviations of the estimate.
    pub off_nominal: Vec<OffNominalParameter>,
    /// The second diagnosis, with all base parameters fixed at their nominal values. `None` if it was not requested, if
    /// no estimate differs from its nominal value, or if all parameters were fixed in the first diagnosis, too.
    pub with_nominal: Option<NominalDiagnosis>,
    /// Errors of the geometry that explain as much as the effects in [`Self::missing`] together, the best first.
    /// They include errors of coordinates of points that the model file sets to zero.
    pub geometry_alternatives: Vec<GeometryAlternative>,
    /// Errors of encoders that elastic drives explain equally well.
    pub elastic_alternatives: Vec<ElasticAlternative>,
    /// The regions of large error that text and JSON report: ranges of a coordinate, velocity, load or time. If the
    /// verdict is [`DiagnosisVerdict::Unexplained`], they are regions of the residual of the unexplained drives.
    /// Otherwise they are the regions in [`Self::error_locations`].
    pub regions: Vec<ErrorRegion>,
    /// The given model, without added effects: its fit, and its forces along all recordings.
    pub before: ModelVersion,
    /// The same for the model with the effects found (the model of the file `edited`), or the reason why there is none.
    pub after: ModelCompletion,
    /// The effects found, as entries of a model file. Effects that a model file cannot contain have no entry.
    pub entries: Vec<NewEffect>,
    /// The text of the given model file with these entries added; `None` if there are none or they cannot be added.
    pub edited: Option<CompletedModelFile>,
    /// Where the error of the given model (without added effects) is large, whatever the verdict is: ranges of a
    /// coordinate, velocity, load or time. Their share of the squared error is larger than their share of the samples.
    pub error_locations: ErrorLocations,
    /// Where the error of the model with the effects found is large; `None` if there is no such model.
    pub residual_locations: Option<ErrorLocations>,
    /// The data on which errors are evaluated: validation runs, or cross-validation.
    pub validation: ValidationMethod,
    /// Notes on the model, on the recordings, and on estimates with an impossible sign.
    pub notes: Vec<RecordingNote>,
    /// Suspected mistakes, such as exchanged columns, for which a trial correction was made (in memory). All findings
    /// hold for the corrected recordings.
    pub corrected: Vec<SuspectedFault>,
    /// Suspected mistakes that could not be corrected: several explain a recording equally well, or the correction of
    /// one fails. If there are any, the diagnosis reports no other findings.
    pub unresolved: Vec<SuspectedFault>,
    /// The search problem and its solution, without the columns.
    pub(crate) answer: DiagnosisSolution,
    /// Variables on which errors may depend, along the recordings on which errors are evaluated.
    pub(crate) variables: Vec<(String, Vec<f64>)>,
}

/// An effect that the model lacks.
#[derive(Clone, Debug, PartialEq)]
pub struct MissingEffect {
    /// Its kind, and the elements of the mechanism (such as drives, coordinates and points) on which it acts.
    pub effect: LocatedEffect,
    /// Estimates of its parameters and constants.
    pub estimates: Vec<EffectEstimate>,
    /// Probability that the effect is present, between 0 and 1.
    pub probability: f64,
    /// The values from which the probability is computed.
    pub support: EffectSupport,
    /// Its alternatives: effects that explain the recordings equally well.
    pub indistinguishable_from: Vec<LocatedEffect>,
    /// Other places that share one value with this place in the model file. Estimates are then differences from the
    /// shared value. Empty if the model file has no such effect here.
    pub shared_with: Vec<String>,
    /// Experiment that distinguishes the effect from its alternatives, as described in the effect library. `None` if
    /// there are no alternatives, or the library describes no experiment.
    pub separating_experiment: Option<String>,
    /// Input of [`Model::excite`] for a motion that distinguishes the effect from its alternatives. `None` if there are
    /// no alternatives, or no motion can be planned.
    pub separation: Option<SeparationProposal>,
}

/// An effect that the recordings can neither show nor exclude.
#[derive(Clone, Debug, PartialEq)]
pub struct UndecidedEffect {
    /// Its kind, and the elements of the mechanism (such as drives, coordinates and points) on which it acts.
    pub effect: LocatedEffect,
    /// The reason, as a sentence without capital letter and full stop.
    pub reason: String,
    /// Experiment that would show whether the effect is present.
    pub separating_experiment: String,
}

/// Request for a motion that distinguishes an effect from its alternatives.
#[derive(Clone, Debug, PartialEq)]
pub struct SeparationProposal {
    /// The effect found, with the values of its parameters and constants.
    pub effect: NamedEffect,
    /// Its alternatives: those in [`MissingEffect::indistinguishable_from`] whose forces along another motion can be
    /// computed.
    pub rivals: Vec<LocatedEffect>,
    /// The other effects found, with their constants. They are assumed to be present, whether this
    /// effect or one of its alternatives is the true one.
    pub common_effects: Vec<NamedEffect>,
    /// Noise of the forces, rms over the drives, N or N m; `None` if it is zero or unknown.
    pub noise: Option<f64>,
}

/// A diagnosis with all base parameters fixed at their nominal values.
pub struct NominalDiagnosis {
    /// Result of the search: the verdict, the error after each step, all candidates, and the residual.
    pub diagnosis: ModelDiagnosis,
    /// The effects found, with their estimates.
    pub missing: Vec<(LocatedEffect, Vec<EffectEstimate>)>,
}

impl Model {
    /// Finds the physical effects that the model lacks. Parameters are fitted to the recordings `fit`. Errors are
    /// evaluated on the validation runs `check`, or by cross-validation if there are none. `options` contains the
    /// options.
    ///
    /// Fails if a recording is too short, has no forces, or contains positions at which the loops of the mechanism
    /// cannot close, and if the forces of the fitted model are worse than the prediction that all forces are
    /// zero.
    pub fn diagnose(
        &self,
        fit: &[&PreparedRecording],
        check: &[&PreparedRecording],
        options: &DiagnosisOptions,
    ) -> Outcome<DiagnosisFindings> {
        // What makes numbers meaningless comes first; the search runs on recordings without it.
        let corrected = (self.host()).run_job("looking for faults of the recordings", 0, |_| {
            CorrectedRecordings::new(self, fit, check)
        })??;
        let mut findings = match corrected {
            None => self.diagnose_prepared(fit, check, *options)?,
            Some(all) => {
                let [fit, check] = [&all.fit, &all.check].map(|runs| runs.iter().collect::<Vec<_>>());
                let mut findings = all.model.diagnose_prepared(&fit, &check, *options)?;
                findings.add_corrections(all.corrected, all.unresolved);
                findings
            }
        };
        findings.respect_faults();
        Ok(findings)
    }

    /// The diagnosis of recordings as they were prepared.
    ///
    /// Fails as [`Model::diagnose`] does.
    fn diagnose_prepared(
        &self,
        fit: &[&PreparedRecording],
        check: &[&PreparedRecording],
        options: DiagnosisOptions,
    ) -> Outcome<DiagnosisFindings> {
        // Long recordings are decimated first, to save memory and time.
        let fewer = |all: &[&PreparedRecording]| -> Outcome<Vec<PreparedRecording>> {
            all.iter().map(|one| one.for_diagnosis(self)).collect()
        };
        let [fewer_fit, fewer_check] = [fewer(fit)?, fewer(check)?];
        let [of_fit, of_check] = [&fewer_fit, &fewer_check].map(|all| all.iter().collect::<Vec<&PreparedRecording>>());
        let data = segments(self, &of_fit, &of_check);
        let held = options.fixed;
        let recordings: Vec<&PreparedRecording> = of_fit.into_iter().chain(of_check).collect();
        // Differences between recordings are found first, since they would look like effects.
        let mut between = (self.host()).run_job("comparing the recordings with each other", 0, |_| {
            faults::run_differences(self, &recordings)
        })??;
        let all: Vec<(&RecordingSegment, bool)> = data.iter().flatten().map(|one| (one, false)).collect();
        let standing = StandingDrives::find(self, &all)?;
        between.retain(|one| {
            let (_, places, _) = one.changed.change.parts(one.changed.unit);
            !standing.has_all(places)
        });
        let is_clock_in_question = !recordings.iter().any(|one| one.has_recorded_derivatives(self));
        let found = search_effects(self, &data, held, is_clock_in_question, &mut between)?;
        let (answer, named) = (found.solution, found.zeros);
        let judged = if data[1].is_empty() {
            ValidationMethod::CrossValidation
        } else {
            ValidationMethod::Check
        };
        if held == FixedParameters::Known {
            check_prediction(&answer, judged)?;
        }
        let notes = data.iter().flatten().flat_map(RecordingSegment::notes);
        let notes = self
            .caution()
            .into_iter()
            .chain(standing.note())
            .chain(notes.cloned())
            .collect();
        // The model file with the effects, and that model identified from the same recordings.
        let entries = added_effects::entries(self, &answer);
        let (edited, after) = if entries.is_empty() {
            (None, ModelCompletion::NothingToAdd)
        } else {
            match added_effects::add_entries(self, &entries) {
                Ok(edited) => {
                    let after = version_with_effects(self, &edited, [fit, check], &data, held);
                    (Some(edited), ModelCompletion::from(after))
                }
                Err(error) => (None, ModelCompletion::Refused(error.message())),
            }
        };
        let [fit_data, check_data] = data;
        // The given model, for comparison.
        let before = ModelVersion::new(self.clone(), fit_data, check_data, held)?;
        let error_locations = judged_error_locations(&before)?;
        let left = after.version().map(self::judged_error_locations).transpose()?;
        let variables = variables(&before)?;
        let mut findings = DiagnosisFindings {
            diagnosis: answer.diagnosis.clone(),
            missing: Vec::new(),
            possible: Vec::new(),
            laws: Vec::new(),
            undecided: Vec::new(),
            off_nominal: Vec::new(),
            with_nominal: None,
            geometry_alternatives: Vec::new(),
            elastic_alternatives: Vec::new(),
            regions: Vec::new(),
            before,
            after,
            entries,
            edited,
            error_locations,
            residual_locations: left,
            validation: judged,
            notes,
            corrected: Vec::new(),
            unresolved: Vec::new(),
            answer,
            variables,
        };
        // The parts of the findings that depend on others are filled in order.
        findings.missing = described_effects(&findings, &findings.diagnosis.effects);
        findings.possible = described_effects(&findings, &findings.diagnosis.possible_effects);
        findings.laws = laws::hypotheses(&findings.before.model, &findings.diagnosis);
        findings.undecided = undecided_effects(&findings);
        // Where something changes within a recording, no single set of values is valid for all of it.
        if !words::has_change_in_time(&findings.diagnosis) {
            findings.off_nominal = off_nominal_parameters(findings.final_version());
        }
        let turned = reversed_sign_note(findings.final_version(), &findings.off_nominal);
        let computed = findings.answer.computed_forces_note.clone();
        for note in [turned, findings.answer.unsearched_changes_note(), computed]
            .into_iter()
            .flatten()
        {
            self.host().note(&note);
            findings.notes.push(note);
        }
        findings.regions = regions(&findings);
        findings.find_alternatives(named.as_ref(), held, found.in_place_of_constants.as_ref())?;
        if options.repeat_with_nominal && held != FixedParameters::All && !findings.off_nominal.is_empty() {
            findings.with_nominal = Some(nominal_diagnosis(&findings, &between)?);
        }
        Ok(findings)
    }
}

impl DiagnosisFindings {
    /// Lists errors of the geometry and elastic drives that explain as much as what was found; `best` are errors of the
    /// geometry in place of wrong constants.
    ///
    /// Fails when it is cancelled.
    fn find_alternatives(
        &mut self,
        named: Option<&NamedZeros>,
        held: FixedParameters,
        best: Option<&GeometryAlternative>,
    ) -> Outcome {
        self.geometry_alternatives = alternatives_to_effects(self, named, held)?;
        if !self.share_with_geometry() {
            self.share_constants(best);
        }
        self.elastic_alternatives = elastic_alternatives(self.final_version(), &self.diagnosis.disturbances);
        Ok(())
    }

    /// Effects share their probability with an error of the geometry that explains as much with no more parts: the
    /// recordings cannot distinguish them. Returns whether there is such an error.
    fn share_with_geometry(&mut self) -> bool {
        let n_effects = self.missing.len();
        let is_equal =
            |one: &&GeometryAlternative| one.errors.len() <= n_effects && one.share >= EQUAL_ALTERNATIVE_LEAST_SHARE;
        let best = self.geometry_alternatives.iter().find(is_equal).cloned();
        if let Some(best) = &best {
            self.share_effects(best, &|_| true);
        }
        best.is_some()
    }

    /// Wrong constants in addition to other effects share their probability with errors of the geometry that explain as
    /// much.
    fn share_constants(&mut self, best: Option<&GeometryAlternative>) {
        let is_constant = |one: &LocatedEffect| one.kind == CONSTANT_ERROR;
        let has_others = self.missing.iter().any(|one| !is_constant(&one.effect));
        if let Some(best) = best.filter(|_| has_others) {
            self.share_effects(best, &is_constant);
        }
    }

    /// Some effects share their probability with errors of the geometry.
    fn share_effects(&mut self, best: &GeometryAlternative, are_shared: &dyn Fn(&LocatedEffect) -> bool) {
        let claimed: Vec<LocatedEffect> = self.missing.iter().map(|one| one.effect.clone()).collect();
        let alternatives: Vec<LocatedEffect> = best.errors.iter().map(GeometryError::as_effect).collect();
        let others: Vec<LocatedEffect> = (alternatives.iter().filter(|one| !claimed.contains(*one)).cloned()).collect();
        if others.is_empty() {
            return;
        }
        let found = self.diagnosis.effects.iter_mut().zip(&mut self.missing);
        // What both explanations have in common stays as certain as before.
        let is_shared = |one: &LocatedEffect| are_shared(one) && !alternatives.contains(one);
        for (found, missing) in found.filter(|(found, _)| is_shared(&found.effect)) {
            // With n equal explanations each has 1/n; one more makes it 1/(n + 1).
            let shared = found.probability / (1.0 + found.probability);
            for (probability, list) in [
                (&mut found.probability, &mut found.indistinguishable_from),
                (&mut missing.probability, &mut missing.indistinguishable_from),
            ] {
                *probability = shared;
                let new = others.iter().filter(|one| !list.contains(*one)).cloned();
                let new: Vec<LocatedEffect> = new.collect();
                list.extend(new);
            }
        }
    }

    /// The model with the effects found, or the given model if there is none.
    pub fn final_version(&self) -> &ModelVersion {
        self.after.version().unwrap_or(&self.before)
    }

    /// The experiment that decides whether effects of a kind are present at some places: the text of the
    /// library, and the motion to record.
    pub(crate) fn deciding_experiment(&self, kind: &str, places: &str) -> String {
        let mut kinds = self.answer.candidates.kinds.iter();
        let known = kinds.find(|one| one.name == kind);
        // The text of the library comes first, if it has one.
        let known = known.map_or("", |one| one.confused_with.as_str());
        let motion = format!(
            "To decide, record a motion over more of the travel of {places}, at other speeds and with another load."
        );
        format!("{known} {motion}").trim().to_owned()
    }

    /// Names of the drives, in the order of the indices used in `diagnosis`. A channel is the force of one drive.
    pub fn channels(&self) -> &[String] {
        &self.answer.problem.layout.channels
    }
}

/// The model with the effects, identified. If a delay changed, recordings are prepared again, since forces then
/// belong to earlier states.
///
/// Fails when the derivation of the model with the effects fails, or when it is cancelled.
fn version_with_effects(
    model: &Model,
    edited: &CompletedModelFile,
    recordings: [&[&PreparedRecording]; 2],
    before: &[Vec<RecordingSegment>; 2],
    held: FixedParameters,
) -> Outcome<ModelVersion> {
    let delay = model.derivation.mechanism.force_delay;
    let model = (model.host())
        .derive(&model.path, edited.loaded.clone())?
        .with_values_of(model);
    // Without a new delay the prepared segments are used again.
    let is_later = model.derivation.mechanism.force_delay.to_bits() != delay.to_bits();
    let [fit, check] = if is_later {
        // With a delay forces belong to earlier states.
        let again = |recordings: &[&PreparedRecording]| -> Outcome<Vec<RecordingSegment>> {
            let mut all = Vec::new();
            for one in recordings {
                for stretch in one.prepare_for(&model)? {
                    all.push(long_recordings::thin_out(&model, &stretch)?);
                }
            }
            Ok(all)
        };
        [again(recordings[0])?, again(recordings[1])?]
    } else {
        before.clone()
    };
    let host = model.host().clone();
    host.run_job("identifying with the effects found", 0, |_| {
        ModelVersion::new(model, fit, check, held)
    })?
}

/// The diagnosis with all parameters fixed at their nominal values.
///
/// Fails when it is cancelled.
fn nominal_diagnosis(findings: &DiagnosisFindings, between: &[RecordingDifference]) -> Outcome<NominalDiagnosis> {
    let version = &findings.before;
    // The diagnosis uses the same split into fitted and validation runs.
    let of = |is_check: bool| -> Vec<RecordingSegment> {
        let runs = version.data.iter().zip(&version.runs);
        let wanted = runs.filter(|(_, run)| run.is_check == is_check);
        wanted.map(|(data, _)| data.clone()).collect()
    };
    let query = DiagnosisQuery {
        fixed: FixedParameters::All,
        in_full: false,
        run_differences: between,
        is_clock_in_question: false,
        claimed: &[],
        are_effects_at_claims: false,
        zeros: None,
    };
    let answer = problem::find_missing_effects(&version.model, &of(false), &of(true), query)?;
    let missing =
        (answer.diagnosis.effects.iter()).map(|found| (found.effect.clone(), effect_estimates(&answer, found)));
    Ok(NominalDiagnosis {
        missing: missing.collect(),
        diagnosis: answer.diagnosis,
    })
}

/// Whether a disturbance is a clock that runs fast or slow in all recordings alike, which scaled lengths explain too.
pub(crate) fn is_common_clock(one: &Disturbance) -> bool {
    one.kind == TIME_BASE && one.estimates.iter().any(|quantity| quantity.name == CLOCK_SHARE)
}

/// Errors of the geometry that explain as much as all effects found together, or as a clock if that is all that was found.
///
/// Fails when it is cancelled.
fn alternatives_to_effects(
    findings: &DiagnosisFindings,
    named: Option<&NamedZeros>,
    held: FixedParameters,
) -> Outcome<Vec<GeometryAlternative>> {
    let has_clock = findings.diagnosis.disturbances.iter().any(is_common_clock);
    if findings.missing.is_empty() && !has_clock {
        return Ok(Vec::new());
    }
    let wrong = findings.missing.iter().filter(|one| one.effect.kind == CONSTANT_ERROR);
    let places: Vec<&str> = wrong.flat_map(|one| one.effect.at.iter().map(String::as_str)).collect();
    // Constants are compared by the same fit, other effects by what remains after them.
    let constants = if places.len() == findings.missing.len() {
        places
    } else {
        Vec::new()
    };
    let remaining = findings.answer.mean_square_residual();
    let n_effects = findings.missing.len().max(1);
    geometry_alternatives(&findings.before, named, held, &constants, n_effects, remaining)
}

/// Effects with estimates, alternatives and the experiment that separates them.
fn described_effects(findings: &DiagnosisFindings, effects: &[IdentifiedEffect]) -> Vec<MissingEffect> {
    effects
        .iter()
        .map(|found| MissingEffect {
            effect: found.effect.clone(),
            estimates: effect_estimates(&findings.answer, found),
            probability: found.probability,
            support: found.support,
            indistinguishable_from: found.indistinguishable_from.clone(),
            shared_with: found.shared_with.clone(),
            separating_experiment: separating_experiment(findings, found),
            separation: separation(findings, found),
        })
        .collect()
}

/// Effects that the recordings can neither show nor exclude, with the reason and the experiment that would decide.
fn undecided_effects(findings: &DiagnosisFindings) -> Vec<UndecidedEffect> {
    let of = |effect: &LocatedEffect| UndecidedEffect {
        effect: effect.clone(),
        reason:
            "along these motions its force is almost a combination of forces that the model has, so even an effect as \
                   large as the force of the drive can be neither shown nor excluded"
                .to_owned(),
        separating_experiment: findings.deciding_experiment(&effect.kind, &effect.at.join(" and ")),
    };
    findings.diagnosis.undecided_effects.iter().map(of).collect()
}

/// Experiment that distinguishes an effect from its alternatives, by the text of the library.
fn separating_experiment(findings: &DiagnosisFindings, found: &IdentifiedEffect) -> Option<String> {
    if found.indistinguishable_from.is_empty() {
        return None;
    }
    let kinds = &findings.answer.candidates.kinds;
    let kind = kinds.iter().find(|kind| kind.name == found.effect.kind)?;
    (!kind.confused_with.is_empty()).then(|| kind.confused_with.clone())
}

/// The request for a motion that distinguishes an effect from its alternatives; `None` for a delay, which adds
/// no force that a motion could make larger.
fn separation(findings: &DiagnosisFindings, found: &IdentifiedEffect) -> Option<SeparationProposal> {
    let is_force = |effect: &&LocatedEffect| {
        let kinds = findings.answer.candidates.kinds.iter();
        let mut kind = kinds.filter(|kind| kind.name == effect.kind);
        // A kind that is in no library has no columns along another motion.
        kind.next().is_some_and(|kind| kind.mechanics != Some(Mechanics::Delay))
    };
    // Alternatives without columns along other motions cannot be separated by planning.
    let rivals = found.indistinguishable_from.iter().filter(is_force);
    let rivals: Vec<LocatedEffect> = rivals.cloned().collect();
    if rivals.is_empty() || !is_force(&&found.effect) {
        return None;
    }
    let values = effect_estimates(&findings.answer, found).into_iter();
    let values = values.filter(|e| !e.name.contains('*') && e.value.is_finite());
    let others = findings.diagnosis.effects.iter();
    let others = others.filter(|other| other.effect != found.effect && is_force(&&other.effect));
    let noise = &findings.answer.problem.noise;
    // One figure for all drives, since the planned motion has no noise of its own.
    let squares: f64 = noise.iter().map(|n| n * n).sum();
    let noise = (squares / noise.len().max(1) as f64).sqrt();
    Some(SeparationProposal {
        effect: NamedEffect {
            effect: found.effect.clone(),
            values: values.map(|e| (e.name, e.value)).collect(),
        },
        rivals,
        common_effects: others
            .map(|other| NamedEffect {
                effect: other.effect.clone(),
                values: other.constants.clone(),
            })
            .collect(),
        noise: (noise > 0.0 && noise.is_finite()).then_some(noise),
    })
}

/// Regions of the residual of the unexplained drives if the verdict is that it is unexplained, otherwise of the error
/// of the given model.
fn regions(findings: &DiagnosisFindings) -> Vec<ErrorRegion> {
    let diagnosis = &findings.answer.diagnosis;
    if diagnosis.verdict != DiagnosisVerdict::Unexplained {
        return findings.error_locations.regions.clone();
    }
    let channels = &findings.answer.problem.layout.channels;
    let left = findings
        .residual_locations
        .as_ref()
        .unwrap_or(&findings.error_locations);
    let mut regions = Vec::new();
    // Each unexplained drive has at least one region.
    for d in &diagnosis.unexplained {
        let of_channel = left.regions.iter().filter(|r| r.channel == channels[*d]);
        let before = regions.len();
        regions.extend(of_channel.cloned());
        if regions.len() == before {
            regions.push(overall_region(findings, *d));
        }
    }
    regions
}

/// All of the time as a region, for a drive whose residual is largest nowhere in particular.
fn overall_region(findings: &DiagnosisFindings, channel: usize) -> ErrorRegion {
    let name = findings.answer.problem.layout.channels[channel].clone();
    let version = findings.final_version();
    let judged = version.validation_runs();
    let times = judged.iter().flat_map(|k| &version.runs[*k].time);
    let range = times.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], t| {
        [low.min(*t), high.max(*t)]
    });
    let again = 100.0 * findings.answer.diagnosis.repeatable_share[channel];
    ErrorRegion {
        says: format!(
            "the residual of {name} is spread over the complete recording, and {again:.0} % of its square is repeatable"
        ),
        channel: name,
        variable: modelmill_identify::TIME_COLUMN.to_owned(),
        range,
        share: 1.0,
        samples: 1.0,
    }
}

/// Regions of the error of a model, on the recordings on which errors are evaluated.
fn judged_error_locations(version: &ModelVersion) -> Outcome<ErrorLocations> {
    let judged = version.validation_runs();
    let (first, last) = (judged.first().copied().unwrap_or(0), judged.last().map_or(0, |k| k + 1));
    // Validation runs are contiguous, since fitted recordings come first.
    let runs = &version.runs[first..last];
    let measured: Vec<_> = runs.iter().map(|run| run.measured.clone()).collect();
    let forces: Vec<_> = runs.iter().map(|run| run.forces.clone()).collect();
    compare::error_locations(&version.model, &version.data[first..last], &measured, &forces)
}

/// Variables along the recordings on which errors are evaluated, one after the other.
///
/// Fails when a pose has no solution.
fn variables(version: &ModelVersion) -> Outcome<Vec<(String, Vec<f64>)>> {
    let mut joined: Vec<(String, Vec<f64>)> = Vec::new();
    // All runs have the same variables.
    for k in version.validation_runs() {
        let variables = along::variables(&version.model, &version.data[k])?;
        if joined.is_empty() {
            joined = variables;
        } else {
            for ((_, all), (_, more)) in joined.iter_mut().zip(variables) {
                all.extend(more);
            }
        }
    }
    Ok(joined)
}
