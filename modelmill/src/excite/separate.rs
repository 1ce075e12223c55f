//! A model whose motion is to tell effects apart: an effect, what it may be taken for, and what is fitted in any case go
//! in; along a motion or a recording comes out by how much they differ.
//!
//! Columns come from where the diagnosis has them, so that kinds of one's own are told apart like all others.

use modelmill_boundary::message;
use modelmill_boundary::text::{OptionName, Remedy};
use modelmill_identify::diagnose::{
    CandidateEffect, ColumnChoice, ForceColumn, LocatedEffect, SignConstraint, white_noise,
};
use modelmill_identify::excite::separate::{
    SeparationMeasure, SeparationProblem, fit_coefficients, measure_separation,
};
use modelmill_identify::excite::{ExcitationMotion, ExcitationPlant};
use modelmill_identify::{PreparationRecord, PreparedRun};
use nalgebra::DMatrix;

use crate::diagnose::words;
use crate::diagnose::{ChosenEffect, ConstantPolicy, NamedEffect, base_columns, derive_effect};
use crate::error::{Error, Outcome};
use crate::excite::plant::ModelPlant;
use crate::model::Model;
use crate::stretch::RecordingSegment;
use modelmill_identify::diagnose::FORCE_ROUNDING;

/// What is to be told apart, derived.
pub(crate) struct SeparationSetup {
    /// The effect with its constants.
    truth: ChosenEffect,
    /// The effect as it would be fitted, where constants of it are searched for.
    fitted: Option<ChosenEffect>,
    /// What it may be taken for.
    pub rivals: Vec<RivalEffect>,
    /// What is there in either case.
    common_effects: Vec<ChosenEffect>,
    /// Values of the effect's parameters by symbol; of either sign if none is given.
    sizes: Vec<(String, f64)>,
    /// Noise of each drive's force; all alike if it is not known.
    noise: Option<Vec<f64>>,
}

/// What an effect may be taken for.
pub(crate) struct RivalEffect {
    chosen: ChosenEffect,
    /// Whether the effect holds it as a special case, so that nothing tells when the rival is true.
    pub is_special_case: bool,
}

impl RivalEffect {
    pub(crate) fn effect(&self) -> &LocatedEffect {
        &self.chosen.named.effect
    }
}

/// How far effects are apart along a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectDistance {
    pub figures: SeparationMeasure,
    /// The rival that is nearest, by its position, and its constants.
    pub rival: usize,
    pub constants: Vec<(String, f64)>,
    /// The smaller of both directions that can be told at all.
    pub force: f64,
}

impl SeparationSetup {
    /// Derives what the command line names.
    pub(crate) fn new(
        model: &Model,
        separate: &NamedEffect,
        from: &[NamedEffect],
        beside: &[NamedEffect],
    ) -> Outcome<Self> {
        let all: Vec<&NamedEffect> = std::iter::once(separate)
            .chain(from)
            .chain(beside)
            .collect();
        for (k, one) in all.iter().enumerate() {
            if all[..k].iter().any(|known| is_same_effect(known, one)) {
                return Err(Error::input(message!(
                    "{} is named twice; {}, {} and {} take different effects",
                    words::effect(&one.effect),
                    Remedy::option(OptionName::Separate),
                    Remedy::option(OptionName::From),
                    Remedy::option(OptionName::Beside)
                )));
            }
        }
        let choose =
            |named: &NamedEffect, constants: ConstantPolicy| derive_effect(model, named, constants);
        let truth = choose(separate, ConstantPolicy::Usual)?;
        let parameters = &truth.kind.parameters;
        let is_size = |symbol: &str| {
            truth.kind.mechanics == Some(modelmill_spec::Mechanics::Tilt)
                || parameters.iter().any(|p| p.symbol == symbol)
        };
        let constants = &truth.kind.constants;
        let is_linear = |symbol: &str| {
            let mut of = constants.iter().filter(|c| c.symbol == symbol);
            of.any(|c| c.search == Some(modelmill_spec::ConstantSearch::Linear))
        };
        let mut sizes: Vec<(String, f64)> = separate.values.clone();
        // A constant beside which the effect is linear is found as a product with its parameter.
        for (symbol, value) in &separate.values {
            for (parameter, size) in &separate.values {
                if is_linear(symbol) && is_size(parameter) {
                    sizes.push((format!("{parameter}*{symbol}"), size * value));
                }
            }
        }
        sizes.retain(|(symbol, _)| is_size(symbol) || symbol.contains('*'));
        let is_searched = |c: &modelmill_spec::KindConstant| {
            matches!(c.search, Some(modelmill_spec::ConstantSearch::Range { .. }))
        };
        let free = NamedEffect {
            effect: separate.effect.clone(),
            values: Vec::new(),
        };
        let is_tilt = truth.kind.mechanics == Some(modelmill_spec::Mechanics::Tilt);
        let fitted = (!is_tilt && truth.kind.constants.iter().any(is_searched))
            .then(|| choose(&free, ConstantPolicy::Searched))
            .transpose()?;
        let rivals = from
            .iter()
            .map(|named| {
                Ok(RivalEffect {
                    chosen: choose(named, ConstantPolicy::Searched)?,
                    is_special_case: false,
                })
            })
            .collect::<Outcome<Vec<RivalEffect>>>()?;
        let beside = beside
            .iter()
            .map(|named| choose(named, ConstantPolicy::Usual))
            .collect::<Outcome<Vec<ChosenEffect>>>()?;
        Ok(Self {
            truth,
            fitted,
            rivals,
            common_effects: beside,
            sizes,
            noise: None,
        })
    }

    /// The effect that is to be told from the others.
    pub(crate) fn effect(&self) -> &LocatedEffect {
        &self.truth.named.effect
    }

    /// Values of its parameters; none if they are not known.
    pub(crate) fn sizes(&self) -> &[(String, f64)] {
        &self.sizes
    }

    /// Effects that are there in either case.
    pub(crate) fn common_effects(&self) -> impl Iterator<Item = &LocatedEffect> {
        self.common_effects.iter().map(|one| &one.named.effect)
    }

    /// One noise for all drives.
    pub(crate) fn set_noise(&mut self, size: f64, drives: usize) {
        self.noise = Some(vec![size; drives]);
    }

    /// Noise of all drives together, if it is known.
    pub(crate) fn noise(&self) -> Option<f64> {
        let noise = self.noise.as_ref()?;
        let squares: f64 = noise.iter().map(|n| n * n).sum();
        Some((squares / noise.len().max(1) as f64).sqrt())
    }

    /// Takes from recordings what is not known: the noise, and the size of the effect by a fit beside the base.
    pub(crate) fn estimate_from_recordings(
        &mut self,
        model: &Model,
        data: &[RecordingSegment],
    ) -> Outcome {
        let mut measured: Vec<Vec<f64>> = Vec::new();
        for one in data {
            let forces = crate::along::measured_forces(one)?;
            measured.resize(forces.len(), Vec::new());
            for (whole, force) in measured.iter_mut().zip(forces) {
                whole.extend(force);
            }
        }
        if self.noise.is_none() {
            let noise = |force: &Vec<f64>| {
                let squares: f64 = force.iter().map(|f| f * f).sum();
                let size = (squares / force.len().max(1) as f64).sqrt();
                white_noise(force).max(FORCE_ROUNDING * size)
            };
            let noise: Vec<f64> = measured.iter().map(noise).collect();
            self.noise = noise.iter().all(|n| *n > 0.0).then_some(noise);
        }
        if !self.sizes.is_empty() {
            return Ok(());
        }
        let runs: Vec<(&RecordingSegment, bool)> = data.iter().map(|one| (one, false)).collect();
        let samples = measured.first().map_or(0, Vec::len);
        let Some(terms) = self.separation_columns(model, &runs)? else {
            return Ok(());
        };
        let weights = self.weights(model.drives().len());
        // What is known is taken off.
        let mut forces = ForceColumn::new(measured);
        forces.add(-1.0, &terms.known);
        let forces = matrix(&[forces], &weights, samples);
        let base = matrix(&terms.base, &weights, samples);
        let effect = matrix(&terms.truth.1, &weights, samples);
        let found = fit_coefficients(&base, &effect, forces.as_slice());
        let found = &found[base.ncols()..];
        self.sizes = terms
            .truth
            .0
            .parameters
            .iter()
            .map(|p| p.symbol.clone())
            .zip(found.iter().copied())
            .collect();
        Ok(())
    }

    /// Rows are divided by their noise relative to that of all.
    fn weights(&self, drives: usize) -> Vec<f64> {
        match (&self.noise, self.noise()) {
            (Some(noise), Some(all)) => noise.iter().map(|n| all / n).collect(),
            _ => vec![1.0; drives],
        }
    }

    /// Columns along recordings; `None` if the effect has none.
    fn separation_columns(
        &self,
        model: &Model,
        runs: &[(&RecordingSegment, bool)],
    ) -> Outcome<Option<SeparationColumns>> {
        let (mut columns, load, known) = base_columns(model, runs)?;
        let Some((candidate, choices)) = self.truth.candidate(model, runs, &load)? else {
            return Ok(None);
        };
        for one in &self.common_effects {
            if let Some((_, choices)) = one.candidate(model, runs, &load)? {
                columns.extend(choices.into_iter().flat_map(|choice| choice.columns));
            }
        }
        let Some(truth) = choices.into_iter().next() else {
            return Ok(None);
        };
        Ok(Some(SeparationColumns {
            base: columns,
            load,
            known,
            truth: (candidate, truth.columns),
        }))
    }

    /// How far the effects are apart along recordings, from the rivals of some positions; `None` if the effect has no force
    /// there.
    pub(crate) fn distance_along(
        &self,
        model: &Model,
        data: &[RecordingSegment],
        which: &[usize],
    ) -> Outcome<Option<EffectDistance>> {
        let runs: Vec<(&RecordingSegment, bool)> = data.iter().map(|one| (one, false)).collect();
        let samples: usize = data.iter().map(|one| one.time().len()).sum();
        let Some(terms) = self.separation_columns(model, &runs)? else {
            return Ok(None);
        };
        let weights = self.weights(model.drives().len());
        let of = |columns: &[ForceColumn]| matrix(columns, &weights, samples);
        let (candidate, columns) = &terms.truth;
        let fitted = match &self.fitted {
            Some(fitted) => fitted.candidate(model, &runs, &terms.load)?,
            None => None,
        };
        let fitted: Vec<DMatrix<f64>> = match fitted {
            Some((_, choices)) => choices.iter().map(|c| of(&c.columns)).collect(),
            None => vec![of(columns)],
        };
        let mut owners: Vec<(usize, Vec<(String, f64)>)> = Vec::new();
        let mut rivals = Vec::new();
        for k in which {
            let rival = &self.rivals[*k].chosen;
            let found = rival.candidate(model, &runs, &terms.load)?;
            // What has no effect mimics nothing.
            let choices = found.map_or_else(
                || {
                    vec![ColumnChoice {
                        constants: Vec::new(),
                        columns: Vec::new(),
                    }]
                },
                |(_, choices)| choices,
            );
            for choice in choices {
                rivals.push(of(&choice.columns));
                owners.push((*k, choice.constants));
            }
        }
        let figures = measure_separation(&SeparationProblem {
            base: of(&terms.base),
            effect: self.force(candidate, &of(columns)),
            fitted,
            rivals,
        });
        Ok(figures.map(|figures| {
            let (rival, constants) = owners[figures.rival].clone();
            let force = if self.rivals[rival].is_special_case {
                figures.residual
            } else {
                figures.residual.min(figures.reverse_residual)
            };
            EffectDistance {
                figures,
                rival,
                constants,
                force,
            }
        }))
    }

    /// The effect's force: its columns times their values, or each by itself in units where no value is known.
    fn force(&self, candidate: &CandidateEffect, columns: &DMatrix<f64>) -> DMatrix<f64> {
        if self.sizes.is_empty() {
            return columns.clone();
        }
        let value = |symbol: &str| {
            let known = self.sizes.iter().find(|(known, _)| known == symbol);
            known.map_or(0.0, |(_, value)| *value)
        };
        let values: Vec<f64> = (candidate.parameters.iter())
            .map(|p| value(&p.symbol))
            .collect();
        columns * DMatrix::from_column_slice(values.len(), 1, &values)
    }

    /// Parameters whose values are of a sign that makes no sense.
    pub(crate) fn wrong_signs(&self) -> Vec<&str> {
        let wrong = |symbol: &str, value: f64| {
            let parameter = self.truth.kind.parameters.iter();
            let sign = parameter
                .filter(|p| p.symbol == symbol)
                .map(|p| p.sign)
                .next();
            match sign.map(crate::diagnose::sign) {
                Some(SignConstraint::Positive) => value < 0.0,
                Some(SignConstraint::Negative) => value > 0.0,
                _ => false,
            }
        };
        let sizes = self.sizes.iter();
        sizes
            .filter(|(symbol, value)| wrong(symbol, *value))
            .map(|(symbol, _)| symbol.as_str())
            .collect()
    }

    /// Whether any force of an effect follows from nominal values.
    pub(crate) fn needs_nominal(&self) -> bool {
        let rivals = self.rivals.iter().map(|rival| &rival.chosen);
        std::iter::once(&self.truth)
            .chain(rivals)
            .chain(&self.common_effects)
            .any(ChosenEffect::needs_nominal)
    }
}

/// Whether both are one effect at the same places.
fn is_same_effect(one: &NamedEffect, other: &NamedEffect) -> bool {
    one.effect.kind == other.effect.kind
        && one.effect.at.len() == other.effect.at.len()
        && one
            .effect
            .at
            .iter()
            .all(|place| other.effect.at.contains(place))
}

/// Columns of a pair.
struct SeparationColumns {
    /// Of all that is fitted in any case.
    base: Vec<ForceColumn>,
    /// What the drives carry.
    load: ForceColumn,
    /// What the model's known parameters say.
    known: ForceColumn,
    truth: (CandidateEffect, Vec<ForceColumn>),
}

/// Columns with one drive below the other.
fn matrix(columns: &[ForceColumn], weights: &[f64], samples: usize) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(weights.len() * samples, columns.len());
    for (k, column) in columns.iter().enumerate() {
        for (d, (values, weight)) in column.0.iter().zip(weights).enumerate() {
            let Some(values) = values else { continue };
            let mut rows = matrix.view_mut((d * samples, k), (samples, 1));
            for (row, value) in rows.iter_mut().zip(values) {
                *row = weight * value;
            }
        }
    }
    matrix
}

/// A model with limits whose motion tells effects apart.
pub(crate) struct SeparatingPlant<'a> {
    pub inner: &'a ModelPlant<'a>,
    pub model: &'a Model,
    pub pair: &'a SeparationSetup,
    /// Rivals that can be told apart at all.
    pub which: Vec<usize>,
}

impl SeparatingPlant<'_> {
    /// How far the effects are apart along a motion.
    pub(crate) fn distance_along(
        &self,
        motion: &ExcitationMotion,
        which: &[usize],
    ) -> Option<EffectDistance> {
        let data = [recording(self.inner, motion)?];
        self.pair.distance_along(self.model, &data, which).ok()?
    }
}

impl ExcitationPlant for SeparatingPlant<'_> {
    fn regressor(&self, motion: &ExcitationMotion) -> Option<DMatrix<f64>> {
        // Without anything to find there is no condition.
        self.inner
            .regressor(motion)
            .filter(|matrix| matrix.ncols() > 0)
    }

    fn limits(&self) -> Vec<String> {
        self.inner.limits()
    }

    fn excess(&self, motion: &ExcitationMotion) -> Option<Vec<Vec<f64>>> {
        self.inner.excess(motion)
    }

    fn separation(&self, motion: &ExcitationMotion) -> Option<f64> {
        self.distance_along(motion, &self.which)
            .map(|apart| apart.force)
    }
}

/// A motion as a recording with the forces of the nominal model.
fn recording(plant: &ModelPlant<'_>, motion: &ExcitationMotion) -> Option<RecordingSegment> {
    let samples = motion.q.first().map_or(0, Vec::len);
    Some(RecordingSegment {
        run: PreparedRun {
            file: "the trajectory".to_owned(),
            time: (0..samples).map(|i| i as f64).collect(),
            q: motion.q.clone(),
            qd: motion.qd.clone(),
            qdd: motion.qdd.clone(),
            force: Some(plant.forces(motion)?),
            missing_force: Vec::new(),
            left_out: Vec::new(),
            lines: Vec::new(),
            repeatability: None,
            prepared: PreparationRecord {
                decimate: 1,
                ..PreparationRecord::default()
            },
            notes: Vec::new(),
        },
        variance: None,
        weights: None,
        maps_from_degrees: Vec::new(),
        faults: Vec::new(),
        load: None,
    })
}
