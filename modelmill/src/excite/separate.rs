//! Difference of effects along a motion. An effect, its alternatives, and the effects of both cases go in; their
//! distance along a motion or a recording comes out.
//!
//! Columns are computed as the diagnosis computes them, so that kinds from the user's libraries are treated like all
//! others.

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
use crate::segment::RecordingSegment;
use modelmill_identify::diagnose::FORCE_ROUNDING;

/// The effects to be distinguished, derived.
pub(crate) struct SeparationSetup {
    /// The effect with fixed constants.
    truth: ChosenEffect,
    /// The effect as it would be fitted, if constants of it are searched for.
    fitted: Option<ChosenEffect>,
    /// Its alternatives.
    pub rivals: Vec<RivalEffect>,
    /// Effects that are present in both cases.
    common_effects: Vec<ChosenEffect>,
    /// Values of the effect's parameters by symbol; without any, each parameter is 1 and may have either sign.
    sizes: Vec<(String, f64)>,
    /// Noise of each drive's force, N or N m; `None` if unknown, which means equal.
    noise: Option<Vec<f64>>,
}

/// An alternative of the effect.
pub(crate) struct RivalEffect {
    /// The alternative with its constants.
    chosen: ChosenEffect,
    /// Whether the alternative is a special case of the effect, so that forces cannot show that the alternative is
    /// true.
    pub is_special_case: bool,
}

impl RivalEffect {
    /// Kind and places.
    pub(crate) fn effect(&self) -> &LocatedEffect {
        &self.chosen.named.effect
    }
}

/// The distance of an effect from its nearest alternative along a motion.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectDistance {
    /// Rms forces over all drives: force of the effect, and its residuals after fits of the base parameters and of the
    /// alternatives.
    pub figures: SeparationMeasure,
    /// Index of the nearest alternative.
    pub rival: usize,
    /// Constants of the nearest alternative.
    pub constants: Vec<(String, f64)>,
    /// The force by which the effect and its nearest alternative differ, rms over all drives, N or N m. It is the
    /// smaller of two residuals: that of the effect after a fit of the alternative, and that of the alternative after a
    /// fit of the effect. If the alternative is a special case of the effect, it is the first of them.
    pub force: f64,
}

impl SeparationSetup {
    /// Derives the effects: the one to be distinguished, its alternatives `from`, and those that are present in both
    /// cases.
    ///
    /// Fails when an effect is unknown or named twice.
    pub(crate) fn new(
        model: &Model,
        separate: &NamedEffect,
        from: &[NamedEffect],
        beside: &[NamedEffect],
    ) -> Outcome<Self> {
        // Each effect may be named once only.
        let all: Vec<&NamedEffect> = std::iter::once(separate).chain(from).chain(beside).collect();
        for (k, one) in all.iter().enumerate() {
            if all[..k].iter().any(|known| is_same_effect(known, one)) {
                return Err(Error::input(message!(
                    "{} is named twice; {}, {} and {} need different effects",
                    words::effect(&one.effect),
                    Remedy::option(OptionName::Separate),
                    Remedy::option(OptionName::From),
                    Remedy::option(OptionName::Beside)
                )));
            }
        }
        // Constants of alternatives are searched, those of other effects are fixed.
        let choose = |named: &NamedEffect, constants: ConstantPolicy| derive_effect(model, named, constants);
        let truth = choose(separate, ConstantPolicy::Usual)?;
        // A tilt of the base has sizes for its angles, which are constants of its kind.
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
        // A constant in which the effect is linear is estimated as a product with its parameter.
        for (symbol, value) in &separate.values {
            for (parameter, size) in &separate.values {
                if is_linear(symbol) && is_size(parameter) {
                    sizes.push((format!("{parameter}*{symbol}"), size * value));
                }
            }
        }
        sizes.retain(|(symbol, _)| is_size(symbol) || symbol.contains('*'));
        // An effect with searched constants is fitted over their ranges.
        let is_searched =
            |c: &modelmill_spec::KindConstant| matches!(c.search, Some(modelmill_spec::ConstantSearch::Range { .. }));
        let free = NamedEffect {
            effect: separate.effect.clone(),
            values: Vec::new(),
        };
        // A tilt has no searched constants.
        let is_tilt = truth.kind.mechanics == Some(modelmill_spec::Mechanics::Tilt);
        let fitted = (!is_tilt && truth.kind.constants.iter().any(is_searched))
            .then(|| choose(&free, ConstantPolicy::Searched))
            .transpose()?;
        // Whether an alternative is a special case is found later, along random motions.
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

    /// The effect that is to be distinguished.
    pub(crate) fn effect(&self) -> &LocatedEffect {
        &self.truth.named.effect
    }

    /// Values of its parameters by symbol; empty if they are unknown.
    pub(crate) fn sizes(&self) -> &[(String, f64)] {
        &self.sizes
    }

    /// Effects that are present in both cases.
    pub(crate) fn common_effects(&self) -> impl Iterator<Item = &LocatedEffect> {
        self.common_effects.iter().map(|one| &one.named.effect)
    }

    /// Sets the same noise for all drives, N or N m.
    pub(crate) fn set_noise(&mut self, size: f64, drives: usize) {
        self.noise = Some(vec![size; drives]);
    }

    /// The rms of the noise over all drives, N or N m, if it is known.
    pub(crate) fn noise(&self) -> Option<f64> {
        let noise = self.noise.as_ref()?;
        let squares: f64 = noise.iter().map(|n| n * n).sum();
        Some((squares / noise.len().max(1) as f64).sqrt())
    }

    /// Estimates from recordings what is not given: the noise, and the size of the effect by a fit together with the
    /// base.
    pub(crate) fn estimate_from_recordings(&mut self, model: &Model, data: &[RecordingSegment]) -> Outcome {
        // Forces of all recordings are joined drive by drive.
        let mut measured: Vec<Vec<f64>> = Vec::new();
        for one in data {
            let forces = crate::along::measured_forces(one)?;
            measured.resize(forces.len(), Vec::new());
            for (whole, force) in measured.iter_mut().zip(forces) {
                whole.extend(force);
            }
        }
        // Noise below rounding of the forces is not possible.
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
        // The size is fitted together with the base parameters, weighted by the noise.
        let runs: Vec<(&RecordingSegment, bool)> = data.iter().map(|one| (one, false)).collect();
        let samples = measured.first().map_or(0, Vec::len);
        let Some(terms) = self.separation_columns(model, &runs)? else {
            return Ok(());
        };
        let weights = self.weights(model.row_names().len());
        // The force of known parameters is subtracted.
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

    /// Weights of the rows of each drive: the mean noise divided by its own.
    fn weights(&self, drives: usize) -> Vec<f64> {
        match (&self.noise, self.noise()) {
            (Some(noise), Some(all)) => noise.iter().map(|n| all / n).collect(),
            _ => vec![1.0; drives],
        }
    }

    /// Columns of all effects along segments; `None` if the effect has no force there.
    fn separation_columns(
        &self,
        model: &Model,
        runs: &[(&RecordingSegment, bool)],
    ) -> Outcome<Option<SeparationColumns>> {
        let (mut columns, load, known) = base_columns(model, runs)?;
        let Some((candidate, choices)) = self.truth.candidate(model, runs, &load)? else {
            return Ok(None);
        };
        // Effects of both cases are fitted like base parameters.
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

    /// The distance of the effects along segments, for the alternatives with the indices `which`; `None` if the
    /// effect has no force there.
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
        let weights = self.weights(model.row_names().len());
        // All columns become matrices with weighted rows.
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
        // An alternative with searched constants has one column set for each choice.
        let mut owners: Vec<(usize, Vec<(String, f64)>)> = Vec::new();
        let mut rivals = Vec::new();
        for k in which {
            let rival = &self.rivals[*k].chosen;
            let found = rival.candidate(model, &runs, &terms.load)?;
            // An alternative without force explains nothing.
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
        // A special case is distinguished in one direction only.
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

    /// The effect's force: its columns times their values, or each column in its own unit if no value is known.
    fn force(&self, candidate: &CandidateEffect, columns: &DMatrix<f64>) -> DMatrix<f64> {
        if self.sizes.is_empty() {
            return columns.clone();
        }
        // Products of parameters have their own size.
        let value = |symbol: &str| {
            let known = self.sizes.iter().find(|(known, _)| known == symbol);
            known.map_or(0.0, |(_, value)| *value)
        };
        let values: Vec<f64> = (candidate.parameters.iter()).map(|p| value(&p.symbol)).collect();
        columns * DMatrix::from_column_slice(values.len(), 1, &values)
    }

    /// Symbols of parameters whose values have an impossible sign.
    pub(crate) fn wrong_signs(&self) -> Vec<&str> {
        let wrong = |symbol: &str, value: f64| {
            let parameter = self.truth.kind.parameters.iter();
            let sign = parameter.filter(|p| p.symbol == symbol).map(|p| p.sign).next();
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

    /// Whether the force of any effect is computed from nominal values.
    pub(crate) fn needs_nominal(&self) -> bool {
        let rivals = self.rivals.iter().map(|rival| &rival.chosen);
        std::iter::once(&self.truth)
            .chain(rivals)
            .chain(&self.common_effects)
            .any(ChosenEffect::needs_nominal)
    }
}

/// Whether both effects have the same kind and the same places, in any order.
fn is_same_effect(one: &NamedEffect, other: &NamedEffect) -> bool {
    one.effect.kind == other.effect.kind
        && one.effect.at.len() == other.effect.at.len()
        && one.effect.at.iter().all(|place| other.effect.at.contains(place))
}

/// Columns of the effects along segments.
struct SeparationColumns {
    /// Columns of base parameters and of effects that are present in both cases.
    base: Vec<ForceColumn>,
    /// Load of the drives.
    load: ForceColumn,
    /// Force of the known parameters.
    known: ForceColumn,
    /// The effect and its columns.
    truth: (CandidateEffect, Vec<ForceColumn>),
}

/// Columns as a matrix, drive by drive, each drive multiplied by its weight.
fn matrix(columns: &[ForceColumn], weights: &[f64], samples: usize) -> DMatrix<f64> {
    // Drives are stacked below each other; a drive without force stays zero.
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

/// A model with limits for the search of a motion that distinguishes effects.
pub(crate) struct SeparatingPlant<'a> {
    /// The model with its limits.
    pub inner: &'a ModelPlant<'a>,
    /// The same model.
    pub model: &'a Model,
    /// The effects.
    pub pair: &'a SeparationSetup,
    /// Indices of the alternatives that can be distinguished.
    pub which: Vec<usize>,
}

impl SeparatingPlant<'_> {
    /// The distance of the effects along a motion; `None` if a pose has no solution or the effect has no force.
    pub(crate) fn distance_along(&self, motion: &ExcitationMotion, which: &[usize]) -> Option<EffectDistance> {
        let data = [recording(self.inner, motion)?];
        self.pair.distance_along(self.model, &data, which).ok()?
    }
}

impl ExcitationPlant for SeparatingPlant<'_> {
    fn regressor(&self, motion: &ExcitationMotion) -> Option<DMatrix<f64>> {
        // Without unknown base parameters there is no condition number.
        self.inner.regressor(motion).filter(|matrix| matrix.ncols() > 0)
    }

    fn limits(&self) -> Vec<String> {
        self.inner.limits()
    }

    fn excess(&self, motion: &ExcitationMotion) -> Option<Vec<Vec<f64>>> {
        self.inner.excess(motion)
    }

    fn separation(&self, motion: &ExcitationMotion) -> Option<f64> {
        self.distance_along(motion, &self.which).map(|apart| apart.force)
    }
}

/// A motion as a segment with the forces of the nominal model.
fn recording(plant: &ModelPlant<'_>, motion: &ExcitationMotion) -> Option<RecordingSegment> {
    let samples = motion.q.first().map_or(0, Vec::len);
    let time = (0..samples).map(|i| i as f64).collect();
    let states = [motion.q.clone(), motion.qd.clone(), motion.qdd.clone()];
    let forces = Some(plant.forces(motion)?);
    Some(RecordingSegment::from(PreparedRun {
        lines: Vec::new(),
        prepared: PreparationRecord {
            decimate: 1,
            ..PreparationRecord::default()
        },
        ..PreparedRun::from_states("the trajectory".to_owned(), time, states, forces)
    }))
}
