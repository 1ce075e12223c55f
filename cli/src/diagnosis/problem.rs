//! A diagnosis from a model and its recordings: the problem is posed in numbers, and solved.

use std::path::{Path, PathBuf};

use modelmill_codegen::Evaluator;
use modelmill_identify::diagnose::{Column, Diagnosis, Problem, diagnose, white_noise};
use modelmill_spec::Loaded;

use crate::data::Data;
use crate::failure::Outcome;
use crate::model::Model;
use crate::progress::watched;

use super::candidates::{Candidates, candidates};
use super::columns::{Origin, columns, finer};
use super::loads::loads;
use super::numbers::{Runs, layout, regressor, stack, variables};

/// Which parameters keep their nominal values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Held {
    /// Those that are numbers of the file.
    Known,
    /// All.
    All,
}

/// What was asked and what was found.
pub(crate) struct Answer {
    pub(crate) problem: Problem,
    pub(crate) diagnosis: Diagnosis,
    pub(crate) candidates: Candidates,
    pub(crate) origins: Vec<Origin>,
}

/// Finds what a model lacks.
pub(crate) fn find(
    path: &Path,
    loaded: &Loaded,
    libraries: &[PathBuf],
    model: &Model,
    fit: &[Data],
    check: &[Data],
    held: Held,
) -> Outcome<Answer> {
    let candidates = watched("writing down what may be missing", 0, |_| {
        candidates(path, loaded, libraries, model)
    })?;
    let carried = loads(model, fit, check)?;
    let all: Vec<(&Data, bool)> = carried
        .iter()
        .map(|(one, is_check)| (one, *is_check))
        .collect();
    let (mut problem, origins) = watched("computing what each would add", 0, |_| {
        problem(&candidates, model, &all)
    })?;
    hold(&mut problem, model, held);
    let finer = |candidate: usize, constant: f64| match origins[candidate] {
        Origin::Entry(k) => finer(&candidates, model, &all, &candidates.entries[k], constant),
        Origin::Tilt | Origin::Delay => None,
    };
    let diagnosis = watched("looking for what is missing", 0, |_| {
        diagnose(&problem, &finer, &mut |_| {})
    });
    Ok(Answer {
        problem,
        diagnosis,
        candidates,
        origins,
    })
}

/// The problem in numbers, with all columns of the base.
fn problem(
    candidates: &Candidates,
    model: &Model,
    all: &Runs<'_>,
) -> Outcome<(Problem, Vec<Origin>)> {
    let measured = stack(all, |one| Ok(one.run.measured()?.to_vec()))?;
    let (columns, origins) = columns(candidates, model, all)?;
    let problem = Problem {
        layout: layout(model, all),
        noise: measured.iter().map(|force| white_noise(force)).collect(),
        measured: Column::new(measured),
        base: regressor(all, &Evaluator::new(&model.derivation), model)?,
        candidates: columns,
        variables: variables(model, all),
        held: None,
    };
    Ok((problem, origins))
}

/// Takes what is not free off the measured forces.
fn hold(problem: &mut Problem, model: &Model, held: Held) {
    let mut known = Column(vec![None; model.drives().len()]);
    let mut free = Vec::new();
    for (k, column) in std::mem::take(&mut problem.base).into_iter().enumerate() {
        if held == Held::All || model.is_known(k) {
            known.add(model.nominal[k], &column);
        } else {
            free.push(column);
        }
    }
    problem.base = free;
    if !known.is_zero() {
        problem.measured.add(-1.0, &known);
        problem.held = Some(known);
    }
}
