//! Planning of motions that distinguish effects: which effects can be distinguished at all, how much they differ
//! along the trajectory, and how many samples that needs.

use crate::text::wrap::wrap_words;
use std::fmt::Write as _;

use modelmill_boundary::message;
use modelmill_boundary::text::{Message, OptionName, Remedy, RemedyWording};
use modelmill_identify::RecordingNote;
use modelmill_identify::diagnose::LocatedEffect;
use modelmill_identify::excite::{ExcitationLimits, Options, random_motions};
use modelmill_spec::PlaceLoad;
use serde_json::{Map, Value, json};

use crate::diagnose::words;
use crate::error::{Error, Outcome};
use crate::model::Model;
use crate::recording::{self, PreparedRecording};
use crate::segment::RecordingSegment;
use crate::text::table::{ColumnAlignment, count, significant, table};

use super::SeparationRequest;
use super::plant::ModelPlant;
use super::separate::{EffectDistance, SeparatingPlant, SeparationSetup};

/// Number of random motions before the search, to detect effects that no motion can distinguish.
const LOOKED_AT: usize = 24;
/// A difference is clear from this many standard deviations on, over all samples. `diagnose` calls effects
/// indistinguishable below three.
const PLAIN: f64 = 5.0;

/// Effects to be distinguished, prepared for the search.
pub(crate) struct SeparationTask {
    /// The effects.
    pub(crate) pair: SeparationSetup,
    /// Segments of the recordings for comparison.
    data: Vec<RecordingSegment>,
    /// Indices of the alternatives that can be distinguished.
    pub(crate) which: Vec<usize>,
    /// Notes on the effects.
    pub(crate) notes: Vec<RecordingNote>,
}

/// The difference of effects along a trajectory.
pub struct SeparationResult {
    /// The effects.
    pub(crate) task: SeparationTask,
    /// The distance along the trajectory, at the samples of the trajectory file.
    pub distance: EffectDistance,
    /// The distance along the best of the random trajectories, N or N m.
    pub random: f64,
    /// The distance along the given recordings; `None` if there are none.
    pub before: Option<EffectDistance>,
    /// Unit of the forces.
    pub unit: &'static str,
    /// Number of drives.
    pub drives: usize,
    /// Number of samples of one period.
    pub samples: usize,
}

/// Derives the requested effects, and evaluates random motions to find alternatives that cannot be distinguished.
///
/// Fails when the effect has no force, when base parameters absorb it, or when no alternative can
/// be distinguished.
pub(crate) fn prepare_separation(
    model: &Model,
    plant: &ModelPlant<'_>,
    limits: &[ExcitationLimits],
    options: &Options,
    request: &SeparationRequest,
    recordings: &[&PreparedRecording],
) -> Outcome<SeparationTask> {
    let mut notes = Vec::new();
    // The listener receives a note even if there is no result in the end.
    let mut note = |note: RecordingNote| {
        model.host().note(&note);
        notes.push(note);
    };
    // Values, noise and recordings of the request.
    let mut pair = SeparationSetup::new(model, &request.effect, &request.from, &request.common_effects)?;
    if let Some(size) = request.noise {
        pair.set_noise(size, model.row_names().len());
    }
    let [data, _] = recording::segments(model, recordings, &[]);
    if !data.is_empty() {
        pair.estimate_from_recordings(model, &data)?;
    }
    if let [first, ..] = pair.wrong_signs()[..] {
        note(RecordingNote::warning(format!(
            "the value of `{first}` has a sign that is not possible for `{}`",
            pair.effect().kind
        )));
    }
    // A difference that no random motion shows is taken as impossible.
    let motions = random_motions(plant, limits, options, LOOKED_AT)
        .map_err(|error| Error::input(format!("{}: {error}", model.path)))?;
    // Each alternative is tested alone along all random motions.
    let mut which = Vec::new();
    for k in 0..pair.rivals.len() {
        let probe = SeparatingPlant {
            inner: plant,
            model,
            pair: &pair,
            which: vec![k],
        };
        let all: Vec<EffectDistance> = motions.iter().filter_map(|m| probe.distance_along(m, &[k])).collect();
        // An effect without force anywhere has missing nominal values, or is not in the load path.
        let name = words::effect(pair.effect());
        if all.is_empty() {
            let why = if pair.needs_nominal() {
                "; its force is computed from nominal values, which the model file must give"
            } else {
                ""
            };
            return Err(Error::input(format!(
                "{}: {name} adds no force along any motion within the limits{why}",
                model.path
            )));
        }
        // What base parameters absorb along every motion cannot be found by any experiment.
        if all.iter().all(|one| one.figures.is_in_base()) {
            return Err(Error::input(format!(
                "{}: base parameters absorb {name} along every motion, so that no experiment finds it; it appears only as \
                 values that differ from the nominal ones",
                model.path
            )));
        }
        // An alternative that reproduces the effect along every motion is left out.
        if all.iter().all(|one| one.figures.is_mimicked()) {
            let rival = words::effect(pair.rivals[k].effect());
            note(RecordingNote::warning(message!(
                "no motion distinguishes {name} from {rival}, which explains the same forces together with the base parameters{}; \
                 it is left out",
                if pair.common_effects().next().is_some() {
                    message!(" and the effects of {}", Remedy::option(OptionName::Beside))
                } else {
                    Message::new()
                }
            )));
            continue;
        }
        // If the effect explains the alternative along every motion, only one direction counts.
        pair.rivals[k].is_special_case = all.iter().all(|one| one.figures.can_explain_rival());
        which.push(k);
    }
    // Without any alternative left there is no goal for the search.
    if which.is_empty() {
        return Err(Error::input(format!(
            "{}: no experiment distinguishes {} from {}; assume the simpler one unless other evidence contradicts it. If only \
             some values of the effect are equivalent, give others (NAME=VALUE after a colon)",
            model.path,
            words::effect(pair.effect()),
            words::effects(&pair.rivals.iter().map(|r| r.effect().clone()).collect::<Vec<_>>()),
        )));
    }
    Ok(SeparationTask {
        pair,
        data,
        which,
        notes,
    })
}

impl SeparationTask {
    /// The model for the search.
    pub(crate) fn plant<'a>(&'a self, inner: &'a ModelPlant<'a>, model: &'a Model) -> SeparatingPlant<'a> {
        SeparatingPlant {
            inner,
            model,
            pair: &self.pair,
            which: self.which.clone(),
        }
    }

    /// The distance of the effects along the recordings; `None` without recordings.
    pub(crate) fn distance_along_recordings(&self, model: &Model) -> Outcome<Option<EffectDistance>> {
        if self.data.is_empty() {
            return Ok(None);
        }
        self.pair.distance_along(model, &self.data, &self.which)
    }

    /// Number of samples of the recordings.
    fn samples(&self) -> usize {
        self.data.iter().map(|one| one.time().len()).sum()
    }

    /// The alternatives that can be distinguished.
    fn rivals(&self) -> Vec<LocatedEffect> {
        let of = |k: &usize| self.pair.rivals[*k].effect().clone();
        self.which.iter().map(of).collect()
    }

    /// The effect and its alternatives as text.
    pub(crate) fn description(&self) -> String {
        format!(
            "{} from {}",
            words::effect(self.pair.effect()),
            words::effects(&self.rivals())
        )
    }
}

/// Unit of the forces of a model, or of both kinds.
pub(crate) fn common_force_unit(model: &Model) -> &'static str {
    let mechanism = &model.derivation.mechanism;
    let carries = |drive: &modelmill_spec::ModelDrive| drive.kind.place_load(&mechanism.coordinates);
    // The unit is common only if all drives have it.
    let forces = mechanism
        .drives
        .iter()
        .filter(|drive| carries(drive) == PlaceLoad::Force)
        .count();
    match forces {
        0 => "N m",
        n if n == mechanism.drives.len() => "N",
        _ => "N or N m",
    }
}

impl SeparationResult {
    /// The difference in standard deviations of white noise, over some samples of each drive; `None` if the noise is
    /// unknown.
    fn deviations(&self, apart: &EffectDistance, samples: usize) -> Option<f64> {
        let noise = self.task.pair.noise()?;
        Some(apart.force / noise * ((samples * self.drives) as f64).sqrt())
    }

    /// Number of periods of the trajectory until the difference is clear, at least one; `None` if the noise is unknown.
    fn periods(&self) -> Option<f64> {
        let one = self.deviations(&self.distance, self.samples)?;
        Some((PLAIN / one).powi(2).ceil().max(1.0))
    }

    /// The result as one JSON object.
    pub fn json(&self) -> Value {
        // Directions that a special case cannot show are null.
        let pair = &self.task.pair;
        // Figures along a motion or a recording.
        let one = |apart: &EffectDistance, samples: usize| {
            let constants = apart.constants.iter().map(|(s, v)| (s.clone(), json!(v)));
            let is_held = pair.rivals[apart.rival].is_special_case;
            json!({
                "apart": apart.force,
                "effect": apart.figures.effect,
                "beyond_base": apart.figures.outside_base,
                "left": apart.figures.residual,
                "reverse": (!is_held).then_some(apart.figures.reverse_residual),
                "nearest": {
                    "kind": pair.rivals[apart.rival].effect().kind,
                    "at": pair.rivals[apart.rival].effect().at,
                    "constants": constants.collect::<Map<_, _>>(),
                },
                "samples": samples,
                "deviations": self.deviations(apart, samples),
            })
        };
        // Alternatives that no motion distinguishes are listed separately.
        let left_out: Vec<&LocatedEffect> = (0..pair.rivals.len())
            .filter(|k| !self.task.which.contains(k))
            .map(|k| pair.rivals[k].effect())
            .collect();
        let values = pair.sizes().iter().map(|(s, v)| (s.clone(), json!(v)));
        json!({
            "effect": pair.effect(),
            "values": values.collect::<Map<_, _>>(),
            "from": self.task.rivals(),
            "inseparable": left_out,
            "beside": pair.common_effects().collect::<Vec<_>>(),
            "noise": pair.noise(),
            "unit": self.unit,
            "trajectory": one(&self.distance, self.samples),
            "best_random": self.random,
            "periods_needed": self.periods(),
            "recordings": self.before.as_ref().map(|before| one(before, self.task.samples())),
        })
    }

    /// The result as lines of text. `evaluations` is the number of evaluated trajectories, `random` that of random
    /// ones.
    pub fn text(&self, evaluations: usize, random: usize, wording: &dyn RemedyWording) -> Vec<String> {
        let pair = &self.task.pair;
        let mut lines = vec![format!("  separates {}", self.task.description())];
        let beside: Vec<LocatedEffect> = pair.common_effects().cloned().collect();
        if !beside.is_empty() {
            lines.push(format!("  in addition to {} in both cases", words::effects(&beside)));
        }
        // The values of the effect scale all figures.
        let sizes: Vec<String> = (pair.sizes().iter())
            .map(|(symbol, value)| format!("{symbol} = {}", significant(*value, 5)))
            .collect();
        lines.push(if sizes.is_empty() {
            "  no size is given: each parameter of the effect is 1 in its unit, of either sign".to_owned()
        } else {
            format!("  with {}", sizes.join(", "))
        });
        // One line for the recordings, one for the best random trajectory, one for the result.
        lines.push(String::new());
        let force = |value: f64| self.force(value);
        let row = |name: &str, apart: &EffectDistance, samples: usize| {
            // The nearest alternative with the constants at which it is nearest.
            let nearest = pair.rivals[apart.rival].effect();
            let constants = apart.constants.iter();
            let constants: Vec<String> = constants
                .map(|(symbol, value)| format!("{symbol} = {}", significant(*value, 3)))
                .collect();
            let mut nearest = words::effect(nearest);
            if !constants.is_empty() {
                nearest = format!("{nearest}, {}", constants.join(", "));
            }
            let deviations = self.deviations(apart, samples);
            vec![
                name.to_owned(),
                force(apart.figures.effect),
                force(apart.force),
                deviations.map_or_else(String::new, |n| significant(n, 3)),
                nearest,
            ]
        };
        let mut rows: Vec<Vec<String>> = Vec::new();
        if let Some(before) = &self.before {
            rows.push(row("the recordings", before, self.task.samples()));
        }
        rows.push(vec![
            format!("best of {}", count(random, "random trajectory", "random trajectories")),
            String::new(),
            force(self.random),
            String::new(),
            String::new(),
        ]);
        rows.push(row("one period of this trajectory", &self.distance, self.samples));
        lines.extend(table(
            2,
            &[
                ("root mean square, all drives", ColumnAlignment::Left),
                ("effect", ColumnAlignment::Right),
                ("difference", ColumnAlignment::Right),
                ("in std deviations", ColumnAlignment::Right),
                ("nearest", ColumnAlignment::Left),
            ],
            &rows,
        ));
        // The gain over random motions and recordings shows what the search achieved.
        let gain = self.distance.force / self.random;
        let mut says = format!(
            "the difference is {} times that of the best random trajectory",
            significant(gain, 3)
        );
        if let Some(before) = &self.before
            && before.force > 0.0
        {
            let _ = write!(
                says,
                ", and {} times that of the recordings",
                significant(self.distance.force / before.force, 3)
            );
        }
        lines.push(format!(
            "  {says}; {} were evaluated",
            count(evaluations, "trajectory", "trajectories")
        ));
        lines.extend(self.remarks(wording));
        lines
    }

    /// A force with its unit.
    fn force(&self, value: f64) -> String {
        format!("{} {}", significant(value, 3), self.unit)
    }

    /// Explanations of the figures.
    fn remarks(&self, wording: &dyn RemedyWording) -> Vec<String> {
        let pair = &self.task.pair;
        let mut lines = indent_lines(&match (pair.noise(), self.periods()) {
            (Some(noise), Some(periods)) => format!(
                "With white noise of {}, {} of recording makes the difference {PLAIN} standard deviations, over all samples. \
                 Correlated noise needs longer; `diagnose` states how much information a recording contains.",
                self.force(noise),
                if periods > 1.0 {
                    format!("{periods} periods")
                } else {
                    "no more than one period".to_owned()
                }
            ),
            _ => message!(
                "With {} or {} the number of required periods is computed.",
                Remedy::option(OptionName::Noise).with_value("SIZE"),
                Remedy::option(OptionName::Data).with_value("RUN")
            )
            .format_for(wording),
        });
        // A special case is named, since forces cannot exclude the more general effect.
        for k in &self.task.which {
            let rival = &pair.rivals[*k];
            if rival.is_special_case {
                lines.extend(indent_lines(&format!(
                    "{} is a special case of {} here: if it is the true effect, both explain the forces, and only its simplicity favours it.",
                    words::effect(rival.effect()),
                    words::effect(pair.effect())
                )));
            }
        }
        lines
    }
}

/// A sentence wrapped into indented lines.
fn indent_lines(says: &str) -> Vec<String> {
    let lines = wrap_words(says, 98);
    lines.iter().map(|line| format!("  {line}")).collect()
}
