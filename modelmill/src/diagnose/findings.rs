//! What a diagnosis found, as values: the verdict, what is missing with estimates and doubles, the model with what was
//! found beside the model as it is, and where errors live. Text, JSON and the page print them.

use modelmill_boundary::message;
use modelmill_boundary::text::{CommandName, Message, OptionName, Remedy};
use modelmill_identify::diagnose::{
    DiagnosisVerdict, EffectParameter, IdentifiedEffect, LocatedEffect, ModelDiagnosis,
};
use modelmill_identify::{ErrorRegion, FitParameter, ParameterStatus, RecordingNote};
use modelmill_spec::Mechanics;
use modelmill_spec::edit::NewEffect;

use crate::along;
use crate::compare::{self, ErrorLocations};
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::{PreparedRecording, segments};
use crate::runs::RecordingDifference;
use crate::stretch::RecordingSegment;
use crate::text::table::percent;

use super::added::{self, CompletedModelFile};
use super::chosen::NamedEffect;
use super::faults;
use super::laws::{self, LawHypothesis};
use super::long;
use super::off_nominal::{OffNominalParameter, off_nominal_parameters, reversed_sign_note};
use super::problem::{self, DiagnosisQuery, DiagnosisSolution, FixedParameters};
use super::versions::ModelVersion;
use super::words::{self, ValidationMethod};

/// Fails where what is fitted to the recordings misses the forces of others by more than these are: nothing that is found in the
/// fit holds then.
fn check_prediction(answer: &DiagnosisSolution, judged: ValidationMethod) -> Outcome {
    let diagnosis = &answer.diagnosis;
    let last = diagnosis.steps.last();
    let Some(last) = last.filter(|last| last.check > 1.0) else {
        return Ok(());
    };
    if words::has_suspicion(diagnosis) {
        return Ok(());
    }
    Err(Error::input(message!(
        "what is fitted to these recordings ({} of the forces is left there) misses the forces {} by {}, more than a model without \
         any force would: nothing can be said of what is missing. Record longer to fit to, with all drives moving far and fast \
         ({}), or hold the parameters of an earlier run ({})",
        percent(Some(last.fit)),
        judged.phrase(),
        percent(Some(last.check)),
        Remedy::command(CommandName::Excite),
        Remedy::option(OptionName::Parameters)
    )))
}

/// Recordings that differ leave so many times as much where that is not said.
const NO_WORSE: f64 = 1.5;

/// What is asked of a diagnosis; [`Question::default`] identifies what the model file leaves open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiagnosisOptions {
    /// Which parameters keep their nominal values.
    pub fixed: FixedParameters,
    /// Where base parameters come out off their nominal values, ask once more with all of them held: they may hide what is
    /// missing.
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

/// What a diagnosis found.
pub struct DiagnosisFindings {
    /// Verdict, ladder, candidates with the reason of their refusal, and what is left unexplained.
    pub diagnosis: ModelDiagnosis,
    /// What is missing, with what is known of it.
    pub missing: Vec<MissingEffect>,
    /// Laws that no library holds and that would explain what nobody explains: hypotheses.
    pub laws: Vec<LawHypothesis>,
    /// What the recordings leave open.
    pub undecided: Vec<UndecidedEffect>,
    /// Base parameters of the bodies that are not what the file says, the farthest first.
    pub off_nominal: Vec<OffNominalParameter>,
    /// The same question with all parameters held at their nominal values, where some are off and it was asked for.
    pub with_nominal: Option<NominalDiagnosis>,
    /// Where the error sits that matters: what is left unexplained, or that of the model as it is.
    pub regions: Vec<ErrorRegion>,
    /// The model as it is, along all recordings.
    pub before: ModelVersion,
    /// The model with what was found, or why there is none; the reason is empty where nothing was found.
    pub after: Result<ModelVersion, Message>,
    /// What was found, as entries of a model file.
    pub entries: Vec<NewEffect>,
    /// The model file with them.
    pub edited: Option<CompletedModelFile>,
    /// Where the error of the model as it is lives.
    pub places: ErrorLocations,
    /// Where what is left in the end lives.
    pub residual_locations: Option<ErrorLocations>,
    /// Where errors are judged.
    pub validation: ValidationMethod,
    /// Remarks on the recordings.
    pub notes: Vec<RecordingNote>,
    /// What was asked and with which columns.
    pub(crate) answer: DiagnosisSolution,
    /// Variables on which errors may depend, along the recordings that are judged.
    pub(crate) variables: Vec<(String, Vec<f64>)>,
}

/// An effect that is missing.
#[derive(Clone, Debug, PartialEq)]
pub struct MissingEffect {
    /// Its kind and places.
    pub effect: LocatedEffect,
    /// Its parameters and constants.
    pub estimates: Vec<EffectEstimate>,
    /// How likely it is that it is there, between 0 and 1.
    pub probability: f64,
    /// What the recordings cannot tell it from.
    pub indistinguishable_from: Vec<LocatedEffect>,
    /// Which experiment tells it from these, as the library says.
    pub separating_experiment: Option<String>,
    /// The motion that would tell it from these, if one can be sought.
    pub separation: Option<SeparationProposal>,
}

/// An effect that the recordings leave open.
#[derive(Clone, Debug, PartialEq)]
pub struct UndecidedEffect {
    /// Its kind and places.
    pub effect: LocatedEffect,
    /// Why they do.
    pub reason: String,
    /// Which experiment would tell.
    pub separating_experiment: String,
}

/// Effects between which a motion is to decide.
#[derive(Clone, Debug, PartialEq)]
pub struct SeparationProposal {
    /// The effect that was found, with its values.
    pub effect: NamedEffect,
    /// What it may be taken for.
    pub rivals: Vec<LocatedEffect>,
    /// What is there in either case, with its constants.
    pub common_effects: Vec<NamedEffect>,
    /// Noise of the forces, if it is known.
    pub noise: Option<f64>,
}

/// An estimate of a found effect.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectEstimate {
    /// Symbol of the parameter or constant.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Standard deviation, where identification has the parameter by itself.
    pub std: Option<f64>,
    /// Unit of the value.
    pub unit: String,
}

/// A diagnosis with all parameters held at their nominal values.
pub struct NominalDiagnosis {
    /// Verdict, ladder and candidates.
    pub diagnosis: ModelDiagnosis,
    /// What is missing then.
    pub missing: Vec<(LocatedEffect, Vec<EffectEstimate>)>,
}

impl DiagnosisFindings {
    /// The entries that are worth adding: none while the recording or the model is in doubt.
    pub fn entries_to_add(&self) -> &[NewEffect] {
        if words::has_suspicion(&self.diagnosis) {
            &[]
        } else {
            &self.entries
        }
    }

    /// What is to be done where nothing, or not all, is to be added to the model file.
    pub(crate) fn further_action(&self) -> Option<&'static str> {
        if self.missing.is_empty() {
            return None;
        }
        if words::has_suspicion(&self.diagnosis) {
            return Some(
                "First clear up what the verdict begins with: effects may only make up for it.",
            );
        }
        let is_late = |found: &MissingEffect| {
            let is_its = |entry: &NewEffect| entry.kind == found.effect.kind;
            ["time_delay", "force_lag"].contains(&found.effect.kind.as_str())
                && !self.entries.iter().any(is_its)
        };
        self.missing.iter().any(is_late).then_some(
            "A force that is read late is mended where it is read: a model file has nothing for it.",
        )
    }
}

impl Model {
    /// Finds which physical effect the model lacks: `fit` is what parameters are fitted to, errors are judged on `check`, or
    /// by cross-validation if there is none.
    ///
    /// Fails when a recording is too short, holds no force, or leads where the mechanism cannot stand.
    pub fn diagnose(
        &self,
        fit: &[&PreparedRecording],
        check: &[&PreparedRecording],
        question: &DiagnosisOptions,
    ) -> Outcome<DiagnosisFindings> {
        let fewer = |all: &[&PreparedRecording]| -> Outcome<Vec<PreparedRecording>> {
            all.iter().map(|one| one.for_diagnosis(self)).collect()
        };
        let [fewer_fit, fewer_check] = [fewer(fit)?, fewer(check)?];
        let [of_fit, of_check] =
            [&fewer_fit, &fewer_check].map(|all| all.iter().collect::<Vec<&PreparedRecording>>());
        let data = segments(self, &of_fit, &of_check);
        let held = question.fixed;
        let recordings: Vec<&PreparedRecording> = of_fit.into_iter().chain(of_check).collect();
        let between =
            (self.host()).run_job("holding the recordings against each other", 0, |_| {
                faults::run_differences(self, &recordings)
            })?;
        let find = |between: &[RecordingDifference]| {
            let asked = DiagnosisQuery {
                fixed: held,
                in_full: true,
                run_differences: between,
            };
            problem::find_missing_effects(self, &data[0], &data[1], asked)
        };
        let mut answer = find(&between)?;
        let mut between = between;
        if !between.is_empty() {
            // What the model lacks may look as if the recordings differed.
            let without = find(&[])?;
            if without.mean_square_residual() < NO_WORSE * answer.mean_square_residual() {
                answer = without;
                between.clear();
            }
        }
        let judged = if data[1].is_empty() {
            ValidationMethod::CrossValidation
        } else {
            ValidationMethod::Check
        };
        if held == FixedParameters::Known {
            check_prediction(&answer, judged)?;
        }
        let notes = data.iter().flatten().flat_map(RecordingSegment::notes);
        let notes = self.caution().into_iter().chain(notes.cloned()).collect();
        let entries = added::entries(self, &answer);
        let (edited, after) = if entries.is_empty() {
            (None, Err(Message::new()))
        } else {
            match added::add_entries(self, &entries) {
                Ok(edited) => {
                    let after = version_with_effects(self, &edited, [fit, check], &data, held);
                    (Some(edited), after.map_err(|error| error.message()))
                }
                Err(error) => (None, Err(error.message())),
            }
        };
        let [fit_data, check_data] = data;
        let before = ModelVersion::new(self.clone(), fit_data, check_data, held)?;
        let places = judged_error_locations(&before)?;
        let left = after
            .as_ref()
            .ok()
            .map(self::judged_error_locations)
            .transpose()?;
        let variables = variables(&before)?;
        let mut findings = DiagnosisFindings {
            diagnosis: answer.diagnosis.clone(),
            missing: Vec::new(),
            laws: Vec::new(),
            undecided: Vec::new(),
            off_nominal: Vec::new(),
            with_nominal: None,
            regions: Vec::new(),
            before,
            after,
            entries,
            edited,
            places,
            residual_locations: left,
            validation: judged,
            notes,
            answer,
            variables,
        };
        findings.missing = missing_effects(&findings);
        findings.laws = laws::hypotheses(&findings.before.model, &findings.diagnosis);
        findings.undecided = undecided_effects(&findings);
        findings.off_nominal = off_nominal_parameters(findings.final_version());
        if let Some(note) = reversed_sign_note(findings.final_version(), &findings.off_nominal) {
            self.host().note(&note);
            findings.notes.push(note);
        }
        findings.regions = regions(&findings);
        if question.repeat_with_nominal
            && held != FixedParameters::All
            && !findings.off_nominal.is_empty()
        {
            findings.with_nominal = Some(nominal_diagnosis(&findings, &between)?);
        }
        Ok(findings)
    }
}

impl DiagnosisFindings {
    /// The model with what was found, or as it is.
    pub fn final_version(&self) -> &ModelVersion {
        self.after.as_ref().unwrap_or(&self.before)
    }

    /// Names of the drives, in the order of the channels.
    pub fn channels(&self) -> &[String] {
        &self.answer.problem.layout.channels
    }
}

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
    let is_later = model.derivation.mechanism.force_delay.to_bits() != delay.to_bits();
    let [fit, check] = if is_later {
        // With a delay forces belong to earlier states.
        let again = |recordings: &[&PreparedRecording]| -> Outcome<Vec<RecordingSegment>> {
            let mut all = Vec::new();
            for one in recordings {
                for stretch in one.prepare_for(&model)? {
                    all.push(long::thin_out(&model, &stretch)?);
                }
            }
            Ok(all)
        };
        [again(recordings[0])?, again(recordings[1])?]
    } else {
        before.clone()
    };
    let host = model.host().clone();
    host.run_job("identifying with what was found", 0, |_| {
        ModelVersion::new(model, fit, check, held)
    })?
}

/// The same question with all parameters held at their nominal values.
fn nominal_diagnosis(
    findings: &DiagnosisFindings,
    between: &[RecordingDifference],
) -> Outcome<NominalDiagnosis> {
    let version = &findings.before;
    let of = |is_check: bool| -> Vec<RecordingSegment> {
        let runs = version.data.iter().zip(&version.runs);
        let wanted = runs.filter(|(_, run)| run.is_check == is_check);
        wanted.map(|(data, _)| data.clone()).collect()
    };
    let asked = DiagnosisQuery {
        fixed: FixedParameters::All,
        in_full: false,
        run_differences: between,
    };
    let answer = problem::find_missing_effects(&version.model, &of(false), &of(true), asked)?;
    let missing = answer.diagnosis.effects.iter().map(|found| {
        let parameters = &answer.problem.candidates[found.candidate].parameters;
        (found.effect.clone(), search_estimates(parameters, found))
    });
    Ok(NominalDiagnosis {
        missing: missing.collect(),
        diagnosis: answer.diagnosis,
    })
}

fn missing_effects(findings: &DiagnosisFindings) -> Vec<MissingEffect> {
    let found = findings.diagnosis.effects.iter();
    found
        .map(|found| MissingEffect {
            effect: found.effect.clone(),
            estimates: estimates(findings, found),
            probability: found.probability,
            indistinguishable_from: found.indistinguishable_from.clone(),
            separating_experiment: separating_experiment(findings, found),
            separation: separation(findings, found),
        })
        .collect()
}

fn undecided_effects(findings: &DiagnosisFindings) -> Vec<UndecidedEffect> {
    let of = |effect: &LocatedEffect| {
        let mut kinds = findings.answer.candidates.kinds.iter();
        let kind = kinds.find(|kind| kind.name == effect.kind);
        let place = effect.at.join(" and ");
        let known = kind.map_or("", |kind| kind.doubles.as_str());
        let more = format!(
            "A motion over more of the travel of {place}, at other speeds and with another load, tells it from what the model has."
        );
        UndecidedEffect {
            effect: effect.clone(),
            reason: "along these motions its force is all but a combination of forces that the model has, so that even one as large \
                   as the drive's own is neither seen nor excluded"
                .to_owned(),
            separating_experiment: format!("{known} {more}").trim().to_owned(),
        }
    };
    findings
        .diagnosis
        .undetermined_effects
        .iter()
        .map(of)
        .collect()
}

/// Unit of a constant of a found effect at its places.
fn unit_of_constant(findings: &DiagnosisFindings, found: &IdentifiedEffect, name: &str) -> String {
    let candidates = &findings.answer.candidates;
    let kind = (candidates.kinds.iter()).find(|kind| kind.name == found.effect.kind);
    let constant = kind.and_then(|kind| kind.constants.iter().find(|one| one.symbol == name));
    let mut spots = candidates.singles.iter().flat_map(|single| &single.spots);
    let spot = spots.find(|spot| found.effect.at.contains(&spot.name));
    let units = constant.zip(spot).and_then(|(constant, spot)| {
        let mut units = constant.units.iter();
        units.find(|(carries, _)| *carries == spot.carries)
    });
    units.map_or_else(String::new, |(_, unit)| unit.clone())
}

/// Estimates as the search has them.
fn search_estimates(
    parameters: &[EffectParameter],
    found: &IdentifiedEffect,
) -> Vec<EffectEstimate> {
    let values = found.estimates.iter().zip(&found.standard_deviations);
    let of = |(p, (value, std)): (&EffectParameter, (&f64, &Option<f64>))| EffectEstimate {
        name: p.symbol.clone(),
        value: *value,
        std: *std,
        unit: p.unit.clone(),
    };
    parameters.iter().zip(values).map(of).collect()
}

/// Estimates of an effect with their deviations, from identification with everything that was found; where the model with
/// the effects cannot say them apart, those of the search.
fn estimates(findings: &DiagnosisFindings, found: &IdentifiedEffect) -> Vec<EffectEstimate> {
    let parameters = &findings.answer.problem.candidates[found.candidate].parameters;
    let mut all = search_estimates(parameters, found);
    all.extend(found.constants.iter().map(|(name, value)| EffectEstimate {
        name: name.clone(),
        value: *value,
        std: None,
        unit: unit_of_constant(findings, found, name),
    }));
    let is_its =
        |entry: &&NewEffect| entry.kind == found.effect.kind && entry.at == found.effect.at;
    if let Some(entry) = findings.entries.iter().find(is_its) {
        for estimate in &mut all {
            // What is held at zero, since its sign would make no sense, stays there.
            if estimate.value == 0.0 {
                continue;
            }
            if let Some(p) = identified_parameter(findings, entry, &estimate.name) {
                estimate.value = p.value;
                estimate.std = p.std;
            } else if let Some((_, constant)) = estimate.name.clone().split_once('*') {
                // A product of a parameter and a constant is told as the constant.
                let known = entry
                    .constants
                    .iter()
                    .find(|(symbol, _)| symbol == constant);
                if let Some((_, value)) = known {
                    estimate.value = *value;
                    constant.clone_into(&mut estimate.name);
                }
            }
        }
    }
    all
}

/// The identified parameter of an added effect, if the model with the effects has it by itself.
fn identified_parameter<'a>(
    findings: &'a DiagnosisFindings,
    entry: &NewEffect,
    symbol: &str,
) -> Option<&'a FitParameter> {
    let after = findings.after.as_ref().ok()?;
    let fit = &after.identified.as_ref()?.fit;
    let derivation = &after.model.derivation;
    let mechanism = &derivation.mechanism;
    let place = findings.entries.iter().position(|one| one == entry)?;
    let first = mechanism
        .effects
        .len()
        .checked_sub(findings.entries.len())?;
    let effect = mechanism.effects.get(first + place)?;
    let term = (effect.kind == entry.kind)
        .then(|| effect.terms.iter().find(|term| term.symbol == symbol))??;
    let reduction = &derivation.reduction;
    let k = reduction
        .retained
        .iter()
        .position(|k| reduction.products[*k].0 == [(term.parameter.0, 1)])?;
    fit.parameters
        .get(k)
        .filter(|p| p.status == ParameterStatus::Identified)
}

/// Which experiment tells an effect from its doubles, as the library says.
fn separating_experiment(findings: &DiagnosisFindings, found: &IdentifiedEffect) -> Option<String> {
    if found.indistinguishable_from.is_empty() {
        return None;
    }
    let kinds = &findings.answer.candidates.kinds;
    let kind = kinds.iter().find(|kind| kind.name == found.effect.kind)?;
    (!kind.doubles.is_empty()).then(|| kind.doubles.clone())
}

/// What a motion would have to decide. What only moves forces in time has no force of its own to be made large.
fn separation(
    findings: &DiagnosisFindings,
    found: &IdentifiedEffect,
) -> Option<SeparationProposal> {
    let is_force = |effect: &&LocatedEffect| {
        let kinds = findings.answer.candidates.kinds.iter();
        let mut kind = kinds.filter(|kind| kind.name == effect.kind);
        // What no library holds has no columns along another motion.
        kind.next()
            .is_some_and(|kind| kind.mechanics != Some(Mechanics::Delay))
    };
    let rivals = found.indistinguishable_from.iter().filter(is_force);
    let rivals: Vec<LocatedEffect> = rivals.cloned().collect();
    if rivals.is_empty() || !is_force(&&found.effect) {
        return None;
    }
    let values = estimates(findings, found).into_iter();
    let values = values.filter(|e| !e.name.contains('*') && e.value.is_finite());
    let others = findings.diagnosis.effects.iter();
    let others = others.filter(|other| other.effect != found.effect && is_force(&&other.effect));
    let noise = &findings.answer.problem.noise;
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

/// Where the error sits that matters: what is left unexplained, or that of the model as it is.
fn regions(findings: &DiagnosisFindings) -> Vec<ErrorRegion> {
    let diagnosis = &findings.answer.diagnosis;
    if diagnosis.verdict != DiagnosisVerdict::Unexplained {
        return findings.places.regions.clone();
    }
    let channels = &findings.answer.problem.layout.channels;
    let left = findings
        .residual_locations
        .as_ref()
        .unwrap_or(&findings.places);
    let mut regions = Vec::new();
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

/// A channel whose error sits nowhere in particular.
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
            "what is left of {name} is spread over all of the time, and {again:.0} % of its square comes again with the state"
        ),
        channel: name,
        variable: modelmill_identify::TIME_COLUMN.to_owned(),
        range,
        share: 1.0,
        samples: 1.0,
    }
}

/// Where the error of a model lives on the recordings that are judged.
fn judged_error_locations(version: &ModelVersion) -> Outcome<ErrorLocations> {
    let judged = version.validation_runs();
    let (first, last) = (
        judged.first().copied().unwrap_or(0),
        judged.last().map_or(0, |k| k + 1),
    );
    let runs = &version.runs[first..last];
    let measured: Vec<_> = runs.iter().map(|run| run.measured.clone()).collect();
    let forces: Vec<_> = runs.iter().map(|run| run.forces.clone()).collect();
    compare::error_locations(
        &version.model,
        &version.data[first..last],
        &measured,
        &forces,
    )
}

/// Variables along the recordings that are judged, one after the other.
fn variables(version: &ModelVersion) -> Outcome<Vec<(String, Vec<f64>)>> {
    let mut joined: Vec<(String, Vec<f64>)> = Vec::new();
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
