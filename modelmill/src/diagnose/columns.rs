//! Columns (forces per unit of a parameter) of all candidates along the recordings, for every value of their constants.

use modelmill_codegen::ModelEvaluator;
use modelmill_identify::diagnose::{
    CandidateEffect, CandidateNature, ColumnChoice, ColumnSource, EffectParameter, ForceColumn, ForceReadingFault,
    LocatedEffect, ReadingFaultKind, SignConstraint,
};
use modelmill_spec::{ActsOn, ConstantSearch, EffectKind, Mechanics};
use rayon::prelude::*;

use crate::error::Outcome;
use crate::model::Model;
use crate::segment::RecordingSegment;

use super::candidates::{
    CandidateEntry, ChangeCandidate, DerivedCandidates, EvaluationFrequency, SingleCandidate, grid, sign,
};
use super::numbers::PlaceMotions;
use super::places::CandidatePlace;
use super::tilt::{TILTS, tilt};
use crate::regressors::{SegmentList, regressor_of};

/// The kind whose column is a constant force of one.
const CONSTANT: &str = "force_offset";

/// Candidates with their columns, and the origin of each in the same order.
///
/// Fails when a pose has no solution.
pub(crate) fn candidate_columns(
    candidates: &DerivedCandidates,
    model: &Model,
    all: &SegmentList<'_>,
) -> Outcome<CandidateColumns> {
    // A linear constant is estimated like a parameter, all others are searched.
    let is_linear = |single: &SingleCandidate| single.constants.iter().any(|c| c.2 == ConstantSearch::Linear);
    // Stage 1: the values of constants, and the rounds in which they are evaluated.
    let grids = grids(candidates, model, all)?;
    // Without linear constants one evaluation of the known effects is enough.
    let of_known = if candidates.singles.iter().any(is_linear) { 2 } else { 1 };
    // `found[single][round]`; columns that are linear in a constant are evaluated at its values 0 and 1.
    let longest = grids.iter().map(Vec::len).max().unwrap_or(1);
    let rounds = (0..of_known)
        .map(|round| (EvaluationFrequency::Known, round))
        .chain((0..longest).map(|round| (EvaluationFrequency::Searched, round)));
    // Each round evaluates all candidates once, with one value of each constant; rounds run in parallel.
    let jobs: Vec<(EvaluationFrequency, usize, Vec<usize>)> = rounds
        .map(|(sort, round)| {
            let takes_part = |k: &usize| {
                candidates.singles[*k].sort == sort && (sort == EvaluationFrequency::Known || round < grids[*k].len())
            };
            let of_round = (0..candidates.singles.len()).filter(takes_part);
            (sort, round, of_round.collect())
        })
        .filter(|(_, _, of_round): &(_, _, Vec<usize>)| !of_round.is_empty())
        .collect();
    // Stage 2: evaluate all rounds.
    let made: Vec<Outcome<Vec<Vec<ForceColumn>>>> = jobs
        .par_iter()
        .map(|(sort, round, of_round)| {
            // Candidates with fewer values than rounds take no part in the later ones.
            let value = |k: usize, search: &ConstantSearch| match search {
                ConstantSearch::Linear => (*round).min(1) as f64,
                ConstantSearch::Range { .. } => grids[k][*round],
            };
            single_columns(candidates, of_round, model, all, *sort, &value)
        })
        .collect();
    // Stage 3: collect columns by single candidate and round, in the order of the rounds.
    let mut found: Vec<Vec<Vec<ForceColumn>>> = vec![Vec::new(); candidates.singles.len()];
    for ((_, _, of_round), columns) in jobs.iter().zip(made) {
        for (k, columns) in of_round.iter().zip(columns?) {
            found[*k].push(columns);
        }
    }
    // Stage 4: candidates are sums of single entries; those without finite values are reported.
    // Origins lead back from columns to entries.
    let (mut made, mut origins, mut undefined) = (Vec::new(), Vec::new(), Vec::new());
    for (k, entry) in candidates.entries.iter().enumerate() {
        if let Some((candidate, felt)) = candidate(candidates, entry, &found, &grids) {
            made.push(candidate);
            origins.push(Some((k, felt)));
        } else if entry.singles.iter().any(|k| !found[*k].iter().flatten().all(is_finite)) {
            undefined.push(effect(candidates, entry));
        }
    }
    // The candidates have copies, so this memory can be freed before the tilt is computed.
    drop(found);
    // Stage 5: tilt and delay, which change the model.
    if let Some((change, derivation)) = &candidates.tilt {
        let tilt = tilt(derivation, model, all)?;
        if !tilt.axes.is_empty() {
            // One angle for each axis about which a tilt has an effect.
            let angle = |axis: &usize| EffectParameter {
                symbol: TILTS[*axis].to_owned(),
                unit: "rad".to_owned(),
                sign: SignConstraint::Any,
            };
            let parameters = tilt.axes.iter().map(angle).collect();
            made.push(change_candidate(
                candidates,
                change,
                parameters,
                ColumnSource::Tilt(tilt),
            ));
            origins.push(None);
        }
    }
    if let Some(change) = &candidates.delay {
        // A force signal can be late, never early.
        let parameter = EffectParameter {
            symbol: "T".to_owned(),
            unit: "s".to_owned(),
            sign: SignConstraint::Positive,
        };
        made.push(change_candidate(
            candidates,
            change,
            vec![parameter],
            ColumnSource::ReadingFault(ForceReadingFault {
                kind: ReadingFaultKind::Delayed,
                channel: None,
            }),
        ));
        origins.push(None);
    }
    Ok(CandidateColumns {
        candidates: made,
        origins,
        undefined,
        grids,
    })
}

/// Values that are tried for the constant of each single candidate; one where it has none.
///
/// Fails when a pose has no solution.
fn grids(candidates: &DerivedCandidates, model: &Model, all: &SegmentList<'_>) -> Outcome<Vec<Vec<f64>>> {
    // Without constants no motion needs to be evaluated.
    let is_known = |single: &SingleCandidate| single.constants.is_empty();
    if candidates.singles.iter().all(is_known) {
        return Ok(vec![vec![1.0]; candidates.singles.len()]);
    }
    // Ranges may be relative to rate or travel of the place.
    let motions = PlaceMotions::new(model, all)?;
    let scales = shared_scales(candidates, &motions);
    let singles = candidates.singles.iter().zip(scales);
    Ok(singles.map(|(single, scale)| grid(single, scale)).collect())
}

/// Whether a column holds numbers only.
fn is_finite(column: &ForceColumn) -> bool {
    let mut values = column.0.iter().flatten().flatten();
    values.all(|x| x.is_finite())
}

/// Kind and places of an entry.
fn effect(candidates: &DerivedCandidates, entry: &CandidateEntry) -> LocatedEffect {
    // All places of an entry have the same kind.
    let first = &candidates.singles[entry.singles[0]];
    let singles = entry.singles.iter().map(|k| &candidates.singles[*k]);
    let places = singles.flat_map(|single| &single.spots);
    LocatedEffect {
        kind: candidates.kinds[first.kind].name.clone(),
        at: places.map(|spot| spot.name.clone()).collect(),
    }
}

/// Largest rate and travel of the place of each single candidate. Places that may share a constant use one
/// grid, that of the place that moves most.
fn shared_scales(candidates: &DerivedCandidates, motions: &PlaceMotions) -> Vec<[f64; 2]> {
    // Each place at first has the scale of its own motion.
    let own = |single: &SingleCandidate| motions.scale(single.spots[0].place);
    let mut scales: Vec<[f64; 2]> = candidates.singles.iter().map(own).collect();
    // A scale spreads over entries that share places, until nothing changes.
    loop {
        let before = scales.clone();
        for entry in &candidates.entries {
            let of_entry = entry.singles.iter().map(|k| scales[*k]);
            // The largest rate and travel among the places of the entry.
            let most = of_entry.fold([0.0_f64; 2], |m, s| [m[0].max(s[0]), m[1].max(s[1])]);
            for k in &entry.singles {
                scales[*k] = most;
            }
        }
        if scales == before {
            return scales;
        }
    }
}

/// Candidates in numbers.
pub(crate) struct CandidateColumns {
    /// Candidates with at least one column that is not zero.
    pub(crate) candidates: Vec<CandidateEffect>,
    /// Their origins, in the same order.
    pub(crate) origins: Vec<CandidateOrigin>,
    /// Effects whose expressions have no finite value somewhere along the recordings.
    pub(crate) undefined: Vec<LocatedEffect>,
    /// Values that are tried for the constant of each single candidate.
    pub(crate) grids: Vec<Vec<f64>>,
}

/// The entry of the candidates that a candidate in numbers comes from, and which of its parameters have an
/// effect; `None` where it changes the model rather than adds columns.
pub(crate) type CandidateOrigin = Option<(usize, Vec<bool>)>;

/// A candidate that changes the model instead of adding columns.
fn change_candidate(
    candidates: &DerivedCandidates,
    change: &ChangeCandidate,
    parameters: Vec<EffectParameter>,
    source: ColumnSource,
) -> CandidateEffect {
    CandidateEffect {
        effect: LocatedEffect {
            kind: candidates.kinds[change.kind].name.clone(),
            at: vec![change.spot.name.clone()],
        },
        parameters,
        searched_constants: 0,
        is_part_of_load: is_part_of_load(&candidates.kinds[change.kind]),
        refines: None,
        nature: CandidateNature::Effect,
        is_per_run: false,
        source,
    }
}

/// Columns of some single candidates for given values of their constants.
///
/// Fails when a pose has no solution.
fn single_columns(
    candidates: &DerivedCandidates,
    which: &[usize],
    model: &Model,
    all: &SegmentList<'_>,
    sort: EvaluationFrequency,
    value: &dyn Fn(usize, &ConstantSearch) -> f64,
) -> Outcome<Vec<Vec<ForceColumn>>> {
    // Candidates are derived in groups, so that the known ones are evaluated once only.
    let derivation = match sort {
        EvaluationFrequency::Known => &candidates.known,
        EvaluationFrequency::Searched => &candidates.searched,
        EvaluationFrequency::LoadDependent => &candidates.load_dependent,
    };
    let mechanism = &derivation.mechanism;
    // Nominal constants with claimed errors, and the given values for the searched ones.
    let mut constants = candidates.constant_values(derivation);
    for k in which {
        for (_, name, search) in &candidates.singles[*k].constants {
            if let Some(at) = mechanism.constants.iter().position(|c| c.name == *name) {
                constants[at] = value(*k, search);
            }
        }
    }
    // The reduction assigns products of parameters to columns.
    let evaluator = ModelEvaluator::with_constants(derivation, constants);
    let reduction = &derivation.reduction;
    // Each parameter of a candidate enters products with the power 1.
    let holds = |product: usize, parameter: usize| reduction.products[product].0.contains(&(parameter, 1));
    // All other columns of the derivation are zero in this round.
    let wanted = |k: usize| {
        let mut parameters = which.iter().flat_map(|w| &candidates.singles[*w].parameters);
        parameters.any(|(_, parameter)| holds(reduction.retained[k], *parameter))
    };
    // Columns of all requested candidates in one pass.
    let columns = regressor_of(all, &evaluator, model, &wanted)?;
    // In products with other parameters, such as a mass at an unknown place, the others have their nominal values.
    let of = |(_, parameter): &(String, usize)| -> ForceColumn {
        let mut sum = ForceColumn(vec![None; model.row_names().len()]);
        // A parameter may occur in several products.
        for (k, product) in reduction.retained.iter().enumerate() {
            let powers = &reduction.products[*product].0;
            if holds(*product, *parameter) {
                let others = powers.iter().filter(|(p, _)| p != parameter);
                let value = |(p, n): &(usize, u32)| {
                    let n = i32::try_from(*n).unwrap_or(i32::MAX);
                    mechanism.parameters[*p].nominal.powi(n)
                };
                sum.add(others.map(value).product(), &columns[k]);
            }
        }
        sum
    };
    Ok(which
        .iter()
        .map(|k| candidates.singles[*k].parameters.iter().map(of).collect())
        .collect())
}

/// Forces of the drives for a constant force or torque of one at each place where the library has a force offset.
///
/// Fails when a pose has no solution.
pub(crate) fn unit_forces(
    candidates: &DerivedCandidates,
    model: &Model,
    all: &SegmentList<'_>,
) -> Outcome<Vec<(CandidatePlace, ForceColumn)>> {
    // A constant force at one place.
    let is_constant = |k: &usize| {
        let single = &candidates.singles[*k];
        candidates.kinds[single.kind].name == CONSTANT && single.spots.len() == 1
    };
    let which: Vec<usize> = (0..candidates.singles.len()).filter(is_constant).collect();
    let made = single_columns(candidates, &which, model, all, EvaluationFrequency::Known, &|_, _| 1.0)?;
    // A force offset has one column.
    let of = |(k, columns): (&usize, Vec<ForceColumn>)| {
        let column = columns.into_iter().next()?;
        Some((candidates.singles[*k].spots[0].clone(), column))
    };
    Ok(which.iter().zip(made).filter_map(of).collect())
}

/// A candidate from the columns of its single places, with which of its parameters have an effect; `None` if none has.
fn candidate(
    candidates: &DerivedCandidates,
    entry: &CandidateEntry,
    found: &[Vec<Vec<ForceColumn>>],
    grids: &[Vec<f64>],
) -> Option<(CandidateEffect, Vec<bool>)> {
    let first = &candidates.singles[entry.singles[0]];
    // Symbols, units and signs come from the kind.
    let kind = &candidates.kinds[first.kind];
    let is_part_of_load = is_part_of_load(kind);
    let mut parameters: Vec<EffectParameter> = (first.parameters.iter())
        .filter_map(|(symbol, _)| {
            let parameter = kind.parameters.iter().find(|p| p.symbol == *symbol)?;
            // The unit depends on whether the place has a force or a torque.
            let carries = first.spots[0].carries;
            let unit = parameter.units.iter().find(|(c, _)| *c == carries);
            Some(EffectParameter {
                symbol: symbol.clone(),
                unit: unit.map_or_else(String::new, |(_, unit)| unit.clone()),
                sign: sign(parameter.sign),
            })
        })
        .collect();
    let effect = effect(candidates, entry);
    // Columns that depend on the load are computed later, for the load of the current fit.
    if first.sort == EvaluationFrequency::LoadDependent {
        let felt = vec![true; parameters.len()];
        // All parameters count as having an effect until the load is known.
        let candidate = CandidateEffect {
            effect,
            parameters,
            searched_constants: usize::from(first.range().is_some()),
            is_part_of_load,
            refines: kind.refines.clone(),
            nature: CandidateNature::Effect,
            is_per_run: false,
            source: ColumnSource::LoadDependent,
        };
        return Some((candidate, felt));
    }
    // Places of an entry share their parameters, so that their columns are added.
    let sum = |round: usize| -> Vec<ForceColumn> {
        // Columns of the first place, then those of the others.
        let mut columns = found[entry.singles[0]][round].clone();
        for other in &entry.singles[1..] {
            let more = &found[*other];
            for (column, more) in columns.iter_mut().zip(&more[round.min(more.len() - 1)]) {
                column.add(1.0, more);
            }
        }
        columns
    };
    // One choice for each value of the searched constant.
    let searched = first.range();
    let mut choices: Vec<ColumnChoice> = match searched {
        Some(symbol) => (grids[entry.singles[0]].iter().enumerate())
            .map(|(round, value)| ColumnChoice {
                constants: vec![(symbol.to_owned(), *value)],
                columns: sum(round),
            })
            .collect(),
        None => vec![ColumnChoice {
            constants: Vec::new(),
            columns: sum(0),
        }],
    };
    // A linear constant gives a further column instead of a search.
    let linear = first.constants.iter().find(|c| c.2 == ConstantSearch::Linear);
    if let (None, Some((symbol, _, _))) = (searched, linear) {
        // A column is affine in a linear constant, so the difference of its values at 1 and 0 is the column of
        // the product.
        let mut shifts = sum(1);
        for (shift, column) in shifts.iter_mut().zip(&choices[0].columns) {
            shift.add(-1.0, column);
        }
        for (p, shift) in shifts.into_iter().enumerate() {
            parameters.push(EffectParameter {
                symbol: format!("{}*{symbol}", parameters[p].symbol),
                unit: String::new(),
                sign: SignConstraint::Any,
            });
            choices[0].columns.push(shift);
        }
    }
    // Values of the constant for which a column is not finite are not tried.
    choices.retain(|choice| choice.columns.iter().all(is_finite));
    if choices.is_empty() {
        return None;
    }
    // Parameters without any effect, such as a mass on the base, are left out.
    let felt: Vec<bool> = (0..parameters.len())
        .map(|p| choices.iter().any(|choice| !choice.columns[p].is_zero()))
        .collect();
    let mut keep = felt.iter();
    parameters.retain(|_| *keep.next().unwrap_or(&false));
    for choice in &mut choices {
        let mut keep = felt.iter();
        choice.columns.retain(|_| *keep.next().unwrap_or(&false));
    }
    if parameters.is_empty() {
        return None;
    }
    // The candidate with one choice for each value of its constant.
    let candidate = CandidateEffect {
        effect,
        parameters,
        searched_constants: usize::from(searched.is_some()),
        is_part_of_load,
        refines: kind.refines.clone(),
        nature: CandidateNature::Effect,
        is_per_run: false,
        source: ColumnSource::Columns(choices),
    };
    Some((candidate, felt))
}

/// Whether the force of a kind is part of the load of the drives.
fn is_part_of_load(kind: &EffectKind) -> bool {
    (kind.mechanics).map_or(kind.on.contains(&ActsOn::Point), Mechanics::is_part_of_load)
}

/// Columns of candidates that depend on the load of the drives, of all or of one entry. Loads are stacked and
/// decimated like the forces; `tried` gives the values of the constant of each single candidate.
///
/// Fails when a pose has no solution.
pub(crate) fn load_dependent_columns(
    candidates: &DerivedCandidates,
    model: &Model,
    all: &SegmentList<'_>,
    load: &ForceColumn,
    only: Option<usize>,
    tried: &dyn Fn(usize) -> Vec<f64>,
) -> Outcome<Vec<(usize, Vec<ColumnChoice>)>> {
    // One entry is requested if its constant is refined.
    let is_wanted = |k: &usize| only.is_none_or(|e| candidates.entries[e].singles.contains(k));
    // Only candidates that depend on the load are evaluated.
    let which: Vec<usize> = (0..candidates.singles.len())
        .filter(|k| candidates.singles[*k].sort == EvaluationFrequency::LoadDependent && is_wanted(k))
        .collect();
    if which.is_empty() {
        return Ok(Vec::new());
    }
    // Loads of all recordings are stacked; each recording gets its own part, interpolated to all of its samples.
    let mut start = 0;
    let mut loaded = Vec::new();
    for (one, is_check) in all {
        // Number of decimated samples of this recording.
        let kept = one.time().len();
        let of = |values: &Option<Vec<f64>>| match values {
            Some(values) => interpolate(&values[start..start + kept], one.decimation(), one.samples()),
            None => vec![0.0; one.samples()],
        };
        // The copy of the segment has the loads of the current fit.
        let mut one = (*one).clone();
        one.load = Some(load.0.iter().map(of).collect());
        loaded.push((one, *is_check));
        start += kept;
    }
    // The segments with the current loads.
    let all: Vec<(&RecordingSegment, bool)> = loaded.iter().map(|(one, check)| (one, *check)).collect();
    let tried: Vec<Vec<f64>> = which.iter().map(|k| tried(*k)).collect();
    let place = |single: usize| which.iter().position(|w| *w == single);
    // `found[single][round]`.
    let mut found: Vec<Vec<Vec<ForceColumn>>> = vec![Vec::new(); which.len()];
    for round in 0..tried.iter().map(Vec::len).max().unwrap_or(0) {
        // Rounds as for the other candidates, one value of each constant at a time.
        let takes_part = |k: &usize| round < tried[*k].len();
        let of_round: Vec<usize> = (0..which.len()).filter(takes_part).collect();
        let value = |single: usize, search: &ConstantSearch| match search {
            ConstantSearch::Linear => 0.0,
            ConstantSearch::Range { .. } => place(single).map_or(1.0, |k| tried[k][round]),
        };
        let singles_of_round: Vec<usize> = of_round.iter().map(|k| which[*k]).collect();
        let columns = single_columns(
            candidates,
            &singles_of_round,
            model,
            &all,
            EvaluationFrequency::LoadDependent,
            &value,
        )?;
        for (k, columns) in of_round.into_iter().zip(columns) {
            found[k].push(columns);
        }
    }
    // Single candidates are summed to entries, as for the other candidates.
    let mut made = Vec::new();
    let wanted = candidates.entries.iter().enumerate();
    for (k, entry) in wanted.filter(|(k, _)| only.is_none_or(|only| only == *k)) {
        let places: Vec<usize> = entry.singles.iter().filter_map(|s| place(*s)).collect();
        let Some((first, others)) = places.split_first() else {
            continue;
        };
        // One choice for each value of the searched constant.
        let symbol = candidates.singles[entry.singles[0]].range();
        let choice = |(round, value): (usize, &f64)| {
            let mut columns = found[*first][round].clone();
            for other in others {
                for (column, more) in columns.iter_mut().zip(&found[*other][round]) {
                    column.add(1.0, more);
                }
            }
            // A column without finite values for these loads counts as zero.
            if !columns.iter().all(is_finite) {
                columns.fill(ForceColumn(vec![None; model.row_names().len()]));
            }
            ColumnChoice {
                constants: symbol.map(|one| (one.to_owned(), *value)).into_iter().collect(),
                columns,
            }
        };
        made.push((k, tried[*first].iter().enumerate().map(choice).collect()));
    }
    Ok(made)
}

/// Linear interpolation between samples of which every `factor`-th was kept.
fn interpolate(kept: &[f64], factor: usize, samples: usize) -> Vec<f64> {
    // The last value is kept beyond the end.
    let last = kept.len().saturating_sub(1);
    let at = |i: usize| {
        let k = (i / factor).min(last);
        let share = (i - k * factor) as f64 / factor as f64;
        kept[k] + share.min(1.0) * (kept[(k + 1).min(last)] - kept[k])
    };
    (0..samples).map(at).collect()
}

/// Columns of an entry for another value of the constant that is searched for.
pub(crate) fn refined_columns(
    candidates: &DerivedCandidates,
    model: &Model,
    all: &SegmentList<'_>,
    entry: &CandidateEntry,
    constant: f64,
) -> Option<Vec<ForceColumn>> {
    // Only the searched constant changes.
    let value = |_: usize, search: &ConstantSearch| match search {
        ConstantSearch::Linear => 0.0,
        ConstantSearch::Range { .. } => constant,
    };
    let found = single_columns(
        candidates,
        &entry.singles,
        model,
        all,
        EvaluationFrequency::Searched,
        &value,
    )
    .ok()?;
    // Columns of all places are added.
    let mut found = found.into_iter();
    let mut columns = found.next()?;
    for more in found {
        for (column, more) in columns.iter_mut().zip(&more) {
            column.add(1.0, more);
        }
    }
    columns.iter().all(is_finite).then_some(columns)
}
