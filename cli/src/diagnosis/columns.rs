//! Numbers along the recordings: the model's columns, those of the candidates for every choice of their constants, and
//! the measured forces.

use std::path::Path;

use modelmill_codegen::Evaluator;
use modelmill_identify::diagnose::{
    Candidate, Choice, Column, Diagnosis, Effect, EffectParameter, Layout, Problem, Source,
    Stretch, diagnose, factors, white_noise,
};
use modelmill_identify::filters::decimate_table;
use modelmill_spec::{Loaded, Place};

use crate::data::Data;
use crate::failure::{Failure, Outcome};
use crate::model::Model;
use crate::progress::watched;

use super::candidates::{Candidates, Entry, Search, Single, candidates, sign};

/// Which parameters keep their nominal values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Held {
    /// Those that are numbers of the file.
    Known,
    /// All.
    All,
}

/// Finds what a model lacks; the problem as it was posed comes back with the answer.
pub(crate) fn find(
    path: &Path,
    loaded: &Loaded,
    model: &Model,
    fit: &[Data],
    check: &[Data],
    held: Held,
) -> Outcome<(Problem, Diagnosis)> {
    let t0 = std::time::Instant::now();
    let candidates = watched("writing down what may be missing", 0, |_| {
        candidates(path, loaded)
    })?;
    eprintln!("cand {:?}", t0.elapsed());
    let carried = loads(model, fit, check)?;
    let all: Vec<(&Data, bool)> = carried
        .iter()
        .map(|(one, is_check)| (one, *is_check))
        .collect();
    let t0 = std::time::Instant::now();
    let problem = problem(&candidates, model, &all, held)?;
    eprintln!("problem {:?}", t0.elapsed());
    let t0 = std::time::Instant::now();
    let finer =
        |candidate: usize, constant: f64| finer(&candidates, model, &all, candidate, constant);
    let diagnosis = watched("looking for what is missing", 0, |_| {
        diagnose(&problem, &finer, &mut |_| {})
    });
    eprintln!("search {:?}", t0.elapsed());
    Ok((problem, diagnosis))
}

/// What a diagnosis needs to know of a model and its recordings.
fn problem(
    candidates: &Candidates,
    model: &Model,
    all: &[(&Data, bool)],
    held: Held,
) -> Outcome<Problem> {
    let layout = layout(model, all);
    let measured = stack(all, |one| Ok(one.run.measured()?.to_vec()))?;
    let noise = measured.iter().map(|force| white_noise(force)).collect();
    let base = regressor(all, &Evaluator::new(&model.derivation), model)?;
    let mut problem = Problem {
        layout,
        measured: Column::new(measured),
        noise,
        variables: variables(model, all),
        ..Problem::default()
    };
    let mut of_held = Column(vec![None; model.drives().len()]);
    for (k, column) in base.into_iter().enumerate() {
        if held == Held::All || model.is_known(k) {
            of_held.add(model.nominal[k], &column);
        } else {
            problem.base.push(column);
        }
    }
    if !of_held.is_zero() {
        problem.measured.add(-1.0, &of_held);
        problem.held = Some(of_held);
    }
    problem.candidates = watched("computing what each would add", 0, |_| {
        columns(candidates, model, all)
    })?;
    Ok(problem)
}

fn layout(model: &Model, all: &[(&Data, bool)]) -> Layout {
    let stretch = |(one, is_check): &(&Data, bool)| {
        let time = one.time();
        let last = time.len().saturating_sub(1);
        Stretch {
            name: one.run.file.clone(),
            samples: time.len(),
            step: if last > 0 {
                (time[last] - time[0]) / last as f64
            } else {
                1.0
            },
            is_check: *is_check,
        }
    };
    Layout {
        channels: model.drives(),
        stretches: all.iter().map(stretch).collect(),
    }
}

/// Channels of all recordings one after the other, decimated like the forces.
fn stack(
    all: &[(&Data, bool)],
    mut of: impl FnMut(&Data) -> Outcome<Vec<Vec<f64>>>,
) -> Outcome<Vec<Vec<f64>>> {
    let mut stacked: Vec<Vec<f64>> = Vec::new();
    for (one, _) in all {
        let columns = of(one)?;
        stacked.resize(columns.len().max(stacked.len()), Vec::new());
        for (whole, column) in stacked.iter_mut().zip(columns) {
            whole.extend(decimated(column, one)?);
        }
    }
    Ok(stacked)
}

fn decimated(column: Vec<f64>, data: &Data) -> Outcome<Vec<f64>> {
    let factor = data.decimation();
    if factor == 1 || column.iter().all(|x| *x == 0.0) {
        return Ok(column.into_iter().step_by(factor).collect());
    }
    decimate_table(&column, 1, factor)
        .map_err(|error| Failure::Input(format!("{}: {error}", data.run.file)))
}

/// Columns of a regressor along all recordings.
fn regressor(
    all: &[(&Data, bool)],
    evaluator: &Evaluator<'_>,
    model: &Model,
) -> Outcome<Vec<Column>> {
    let drives = model.drives().len();
    let stacked = stack(all, |one| {
        let mut columns: Vec<Vec<f64>> = Vec::new();
        one.for_each_block(model, |states| {
            Ok::<_, Failure>(evaluator.regressor_blocks(states, |_, block| {
                columns.resize(block.len(), Vec::new());
                for (column, values) in columns.iter_mut().zip(block) {
                    column.extend_from_slice(values);
                }
                Ok(())
            }))
        })?;
        Ok(columns)
    })?;
    let n = stacked.len() / drives.max(1);
    // Drives are outermost.
    let mut by_column: Vec<Vec<Vec<f64>>> = vec![Vec::new(); n];
    for (k, values) in stacked.into_iter().enumerate() {
        by_column[k % n].push(values);
    }
    Ok(by_column.into_iter().map(Column::new).collect())
}

/// Variables on which an unknown force may depend.
fn variables(model: &Model, all: &[(&Data, bool)]) -> Vec<(String, Vec<f64>)> {
    let mut variables = Vec::new();
    for (i, name) in model.active().into_iter().enumerate() {
        for (suffix, order) in [("", 0), ("_d", 1), ("_dd", 2)] {
            let of = |one: &Data| -> Vec<f64> {
                let run = &one.run;
                let values = [&run.q, &run.qd, &run.qdd][order];
                values[i]
                    .iter()
                    .copied()
                    .step_by(one.decimation())
                    .collect()
            };
            let values = all.iter().flat_map(|(one, _)| of(one)).collect();
            variables.push((format!("{name}{suffix}"), values));
        }
    }
    variables
}

/// Candidates with their columns for every choice of their constants.
fn columns(
    candidates: &Candidates,
    model: &Model,
    all: &[(&Data, bool)],
) -> Outcome<Vec<Candidate>> {
    let scales = scales(candidates, model, all)?;
    let grids: Vec<Vec<f64>> = candidates
        .singles
        .iter()
        .zip(&scales)
        .map(|(single, scale)| grid(single, *scale))
        .collect();
    // `found[single][round]`; columns that are linear in a constant are looked at for its values 0 and 1.
    let mut found: Vec<Vec<Vec<Column>>> = vec![Vec::new(); candidates.singles.len()];
    let longest = grids.iter().map(Vec::len).max().unwrap_or(1);
    for (is_searched, rounds) in [(false, 2), (true, longest)] {
        let wanted: Vec<usize> = (0..candidates.singles.len())
            .filter(|k| candidates.singles[*k].is_searched() == is_searched)
            .collect();
        for round in 0..rounds {
            let of_round: Vec<usize> = wanted
                .iter()
                .copied()
                .filter(|k| round < 2 - usize::from(is_searched) || round < grids[*k].len())
                .collect();
            if of_round.is_empty() {
                continue;
            }
            let value = |k: usize, search: &Search| match search {
                Search::Given => None,
                Search::Linear => Some(round.min(1) as f64),
                _ => Some(grids[k][round.min(grids[k].len() - 1)]),
            };
            let columns = singles(candidates, &of_round, model, all, is_searched, &value)?;
            for (k, columns) in of_round.iter().zip(columns) {
                found[*k].push(columns);
            }
        }
    }
    Ok((candidates.entries.iter())
        .map(|entry| candidate(candidates, entry, &found, &grids))
        .collect())
}

/// Columns of some single candidates for given values of their constants.
fn singles(
    candidates: &Candidates,
    which: &[usize],
    model: &Model,
    all: &[(&Data, bool)],
    is_searched: bool,
    value: &dyn Fn(usize, &Search) -> Option<f64>,
) -> Outcome<Vec<Vec<Column>>> {
    let derivation = if is_searched {
        &candidates.searched
    } else {
        &candidates.known
    };
    let mechanism = &derivation.mechanism;
    let mut constants: Vec<f64> = mechanism.constants.iter().map(|c| c.value).collect();
    for k in which {
        for (_, name, search) in &candidates.singles[*k].constants {
            let at = mechanism.constants.iter().position(|c| c.name == *name);
            if let (Some(at), Some(value)) = (at, value(*k, search)) {
                constants[at] = value;
            }
        }
    }
    let evaluator = Evaluator::with_constants(derivation, constants);
    let columns = regressor(all, &evaluator, model)?;
    let reduction = &derivation.reduction;
    let of = |name: &String| -> Column {
        let p = mechanism.parameters.iter().position(|p| p.name == *name);
        let at = reduction.retained.iter().position(|product| {
            let powers = &reduction.products[*product].0;
            matches!(powers.as_slice(), [(q, 1)] if Some(*q) == p)
        });
        let none = || Column(vec![None; model.drives().len()]);
        at.map_or_else(none, |at| columns[at].clone())
    };
    Ok(which
        .iter()
        .map(|k| candidates.singles[*k].parameters.iter().map(of).collect())
        .collect())
}

/// A candidate from the columns of its single places.
fn candidate(
    candidates: &Candidates,
    entry: &Entry,
    found: &[Vec<Vec<Column>>],
    grids: &[Vec<f64>],
) -> Candidate {
    let first = &candidates.singles[entry.singles[0]];
    let kind = &candidates.kinds[first.kind];
    let is_linear = first.constants.iter().any(|c| c.2 == Search::Linear);
    let mut parameters: Vec<EffectParameter> = kind
        .parameters
        .iter()
        .map(|p| EffectParameter {
            symbol: p.symbol.clone(),
            unit: (p.units.iter())
                .find(|(c, _)| *c == first.spot.carries)
                .map_or_else(String::new, |(_, unit)| unit.clone()),
            sign: sign(p.sign),
        })
        .collect();
    if is_linear {
        parameters.push(EffectParameter {
            symbol: "shift".to_owned(),
            unit: String::new(),
            sign: modelmill_identify::diagnose::Sign::Any,
        });
    }
    let sum = |round: usize| -> Vec<Column> {
        let mut columns = found[entry.singles[0]][round].clone();
        for other in &entry.singles[1..] {
            let more = &found[*other];
            for (column, more) in columns.iter_mut().zip(&more[round.min(more.len() - 1)]) {
                column.add(1.0, more);
            }
        }
        columns
    };
    let searched = first
        .constants
        .iter()
        .find(|c| !matches!(c.2, Search::Given | Search::Linear));
    let choices = match searched {
        Some((symbol, _, _)) => (grids[entry.singles[0]].iter().enumerate())
            .map(|(round, value)| Choice {
                constants: vec![(symbol.clone(), *value)],
                columns: sum(round),
            })
            .collect(),
        None => {
            let mut columns = sum(0);
            if is_linear {
                let mut shifts = sum(1);
                for (shift, column) in shifts.iter_mut().zip(&columns) {
                    shift.add(-1.0, column);
                }
                columns.extend(shifts);
            }
            vec![Choice {
                constants: Vec::new(),
                columns,
            }]
        }
    };
    Candidate {
        effect: Effect {
            kind: kind.name.clone(),
            at: (entry.singles.iter())
                .map(|k| candidates.singles[*k].spot.name.clone())
                .collect(),
        },
        parameters,
        searched: usize::from(searched.is_some()),
        source: Source::Columns(choices),
    }
}

/// Columns of a candidate for another value of the constant that is searched for.
pub(crate) fn finer(
    candidates: &Candidates,
    model: &Model,
    all: &[(&Data, bool)],
    candidate: usize,
    constant: f64,
) -> Option<Vec<Column>> {
    let entry = &candidates.entries[candidate];
    let value = |_: usize, search: &Search| match search {
        Search::Given | Search::Linear => None,
        _ => Some(constant),
    };
    let mut found = singles(candidates, &entry.singles, model, all, true, &value)
        .ok()?
        .into_iter();
    let mut columns = found.next()?;
    for more in found {
        for (column, more) in columns.iter_mut().zip(&more) {
            column.add(1.0, more);
        }
    }
    Some(columns)
}

/// The recordings with the loads that the bodies make, for kinds that depend on them. The measured forces are no such load:
/// they hold friction already, so that a share of them with the sign of the rate explains itself. The base is fitted beside
/// friction of every drive.
fn loads(model: &Model, fit: &[Data], check: &[Data]) -> Outcome<Vec<(Data, bool)>> {
    let mut carried: Vec<(Data, bool)> = (fit.iter().map(|one| (one.clone(), false)))
        .chain(check.iter().map(|one| (one.clone(), true)))
        .collect();
    let all: Vec<(&Data, bool)> = carried
        .iter()
        .map(|(one, is_check)| (one, *is_check))
        .collect();
    let measured = Column::new(stack(&all, |one| Ok(one.run.measured()?.to_vec()))?);
    let base = regressor(&all, &Evaluator::new(&model.derivation), model)?;
    let rates = stack(&all, |one| crate::standstill::drive_rates(model, one))?;
    let mut friction = Vec::new();
    for (d, rate) in rates.iter().enumerate() {
        let signs: Vec<f64> = rate.iter().map(|v| v.signum()).collect();
        for values in [rate.clone(), signs, vec![1.0; rate.len()]] {
            let mut column = Column(vec![None; rates.len()]);
            column.0[d] = Some(values);
            friction.push(column);
        }
    }
    let free: Vec<usize> = (0..base.len()).filter(|k| !model.is_known(*k)).collect();
    let found = beside(&measured, &base, &free, &friction);
    let mut values = model.nominal.clone();
    for (k, value) in free.iter().zip(found) {
        values[*k] = value;
    }
    // The load is what is carried before any effect.
    for (k, value) in values.iter_mut().enumerate() {
        if model.is_effect(k) {
            *value = 0.0;
        }
    }
    for (one, _) in &mut carried {
        let evaluator = Evaluator::new(&model.derivation);
        let forces = crate::along::columns(model, one, |states| {
            evaluator.inverse_dynamics(states, &values)
        })?;
        one.load = Some(forces);
    }
    Ok(carried)
}

/// Least squares factors of some base columns beside others.
fn beside(measured: &Column, base: &[Column], free: &[usize], others: &[Column]) -> Vec<f64> {
    let columns: Vec<&Column> = free.iter().map(|k| &base[*k]).chain(others).collect();
    factors(measured, &columns)
        .into_iter()
        .take(free.len())
        .collect()
}

/// Largest rate and travel of the place of every single candidate.
fn scales(candidates: &Candidates, model: &Model, all: &[(&Data, bool)]) -> Outcome<Vec<[f64; 2]>> {
    let evaluator = Evaluator::new(&model.derivation);
    let mechanism = &model.derivation.mechanism;
    let (active, passive) = model.derivation.coordinates();
    let n = mechanism.drives.len();
    let drives = stack_states(all, model, |states| evaluator.drives(states))?;
    let passive_motion = if passive.is_empty() {
        Vec::new()
    } else {
        stack_states(all, model, |states| evaluator.passive(states))?
    };
    let motion = |order: usize, i: usize| -> Vec<f64> {
        let one = |(data, _): &(&Data, bool)| [&data.run.q, &data.run.qd][order][i].clone();
        all.iter().flat_map(one).collect()
    };
    let spread = |values: &[f64]| {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        high - low
    };
    let largest = |values: &[f64]| values.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let scale = |single: &Single| match single.spot.place {
        Place::Drive(d) => [largest(&drives[n + d.0]), spread(&drives[d.0])],
        Place::Coordinate(i) => {
            let at = |list: &[usize]| list.iter().position(|k| *k == i.0);
            match (at(&active), at(&passive)) {
                (Some(k), _) => [largest(&motion(1, k)), spread(&motion(0, k))],
                (None, Some(k)) => [
                    largest(&passive_motion[passive.len() + k]),
                    spread(&passive_motion[k]),
                ],
                (None, None) => [0.0, 0.0],
            }
        }
        _ => [0.0, 0.0],
    };
    Ok(candidates.singles.iter().map(scale).collect())
}

fn stack_states(
    all: &[(&Data, bool)],
    model: &Model,
    mut evaluate: impl FnMut(
        &modelmill_codegen::States<'_>,
    ) -> Result<Vec<Vec<f64>>, modelmill_codegen::PoseFault>,
) -> Outcome<Vec<Vec<f64>>> {
    let mut stacked: Vec<Vec<f64>> = Vec::new();
    for (one, _) in all {
        let columns = crate::along::columns(model, one, &mut evaluate)?;
        stacked.resize(columns.len(), Vec::new());
        for (whole, column) in stacked.iter_mut().zip(columns) {
            whole.extend(column);
        }
    }
    Ok(stacked)
}

/// Values of the constant that a single candidate searches for; one where there is none.
fn grid(single: &Single, [rate, travel]: [f64; 2]) -> Vec<f64> {
    let searched = single.constants.iter().map(|c| &c.2);
    for search in searched {
        match search {
            Search::OfRate([from, to], count) if rate > 0.0 => {
                let ratio = (to / from).powf(1.0 / (*count as f64 - 1.0));
                return (0..*count)
                    .map(|k| rate * from * ratio.powi(i32::try_from(k).unwrap_or(i32::MAX)))
                    .collect();
            }
            Search::OfTravel([from, to], count) if travel > 0.0 => {
                let times = |k: usize| from + (to - from) * k as f64 / (*count as f64 - 1.0);
                return (0..*count).map(|k| travel / times(k)).collect();
            }
            _ => {}
        }
    }
    vec![1.0]
}
