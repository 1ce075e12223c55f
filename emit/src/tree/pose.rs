//! What programs of a model have in common at a pose: where its loops close, where its drives are, and whether the pose has
//! an answer. It is written once, and every program begins with it.

use std::collections::{BTreeMap, BTreeSet};

use super::scope::NameScope;
use super::{PrecomputedValues, StatementRoutine};
use modelmill_codegen::expr::Atom;
use modelmill_codegen::{
    Derivation, PoseGuard, ProgramOp, ProgramStage, StraightLineProgram, ValueId,
};
use rustc_hash::FxHashMap;
/// The common part, and which values of it programs read.
#[derive(Clone, Debug)]
pub(crate) struct SharedPose {
    /// Operations by what they are: equal ones have equal numbers in all programs.
    numbers: FxHashMap<ProgramOp, ValueId>,
    /// Values that programs read, by number, with their places.
    read: BTreeMap<ValueId, usize>,
    /// What must hold, in numbers.
    guards: Vec<PoseGuard>,
    /// The coordinates that it reads.
    pub(crate) inputs: Vec<Atom>,
    /// Its statements; its results are what programs read.
    pub(crate) routine: StatementRoutine,
    /// What it computes once.
    pub(crate) once: PrecomputedValues,
}

impl SharedPose {
    /// What the programs of a derivation share, if they can fail; `scope` learns what its values are called.
    pub(super) fn new(derivation: &Derivation, scope: &mut NameScope) -> Option<Self> {
        let programs = &derivation.programs;
        let programs = [
            &programs.regressor,
            &programs.inverse_dynamics,
            &programs.passive,
            &programs.drives,
        ];
        let mut numbers = FxHashMap::default();
        let numbered = programs.map(|program| {
            let values = numbers_of(program, &mut numbers);
            let guards: Vec<PoseGuard> = program
                .guards
                .iter()
                .map(|guard| renumber_guard(*guard, &values))
                .collect();
            (program, values, guards)
        });
        let plain = programs.map(pose_dependent_values);
        // The begin of the guards that all programs have that have any of it.
        let common =
            |a: &[PoseGuard], b: &[PoseGuard]| a.iter().zip(b).take_while(|(a, b)| a == b).count();
        let (_, _, first) = &numbered[0];
        let others = numbered[1..].iter();
        let shared = others.map(|(_, _, guards)| common(first, guards));
        let n = shared.filter(|n| *n > 0).min()?;
        let guards = first[..n].to_vec();
        let is_client = |k: usize| numbered[k].2.starts_with(&guards);
        let clients: Vec<usize> = (0..programs.len()).filter(|k| is_client(*k)).collect();
        if clients.len() < 2 {
            return None;
        }
        let mut uses: BTreeMap<ValueId, usize> = BTreeMap::new();
        for k in &clients {
            let (program, values, _) = &numbered[*k];
            // Signs are left to those who read.
            let moving = (0..program.ops.len()).filter(|i| {
                let op = &program.ops[*i];
                let is_its = plain[*k][*i] && program.stages[*i] == ProgramStage::State;
                is_its && !is_leaf(op) && !matches!(op, ProgramOp::Neg(_))
            });
            let distinct: BTreeSet<ValueId> = moving.map(|i| values[i]).collect();
            for value in distinct {
                *uses.entry(value).or_insert(0) += 1;
            }
        }
        let shared = |value: &ValueId| uses.get(value).is_some_and(|n| *n > 1);
        let mut read = BTreeSet::new();
        for k in &clients {
            let (program, values, own) = &numbered[*k];
            for (i, op) in program.ops.iter().enumerate() {
                if !shared(&values[i]) {
                    op.for_each_operand(|v| _ = read.insert(values[v.index()]));
                }
            }
            read.extend(program.outputs.iter().map(|v| values[v.index()]));
            read.extend(own[n..].iter().flat_map(|guard| guard.values()));
        }
        read.retain(shared);
        let parts = clients
            .iter()
            .map(|k| (numbered[*k].0, &numbered[*k].1, &plain[*k]));
        let (program, places) = shared_program(parts, &shared, &guards, &read);
        let mut routine = StatementRoutine::with_result_names(&program, scope, &[], true);
        let values = scope.meanings.values(&program);
        let mut once = PrecomputedValues::new(scope);
        once.absorb(&mut routine);
        for (k, (value, output)) in routine.results.iter().zip(&program.outputs).enumerate() {
            scope.add_shared(Atom::Shared(k), value, values[output.index()]);
        }
        let inputs = routine.read.iter().copied();
        let inputs = inputs
            .filter(|atom| matches!(atom, Atom::Coordinate(_)))
            .collect();
        Some(Self {
            numbers,
            read: places,
            guards,
            inputs,
            routine,
            once,
        })
    }

    /// What is left of a program whose common part is computed before; none if it has another one.
    pub(crate) fn remaining_program(
        &self,
        program: &StraightLineProgram,
    ) -> Option<StraightLineProgram> {
        let mut numbers = self.numbers.clone();
        let values = numbers_of(program, &mut numbers);
        let guards: Vec<PoseGuard> = program
            .guards
            .iter()
            .map(|guard| renumber_guard(*guard, &values))
            .collect();
        if !guards.starts_with(&self.guards) {
            return None;
        }
        let mut rest = program.clone();
        for (i, op) in rest.ops.iter_mut().enumerate() {
            if let Some(k) = self.read.get(&values[i]) {
                *op = ProgramOp::Input(Atom::Shared(*k));
            }
        }
        rest.guards.drain(..self.guards.len());
        Some(rest.without_dead_code())
    }
}

/// The same guard of the values that stand for its own.
fn renumber_guard(guard: PoseGuard, values: &[ValueId]) -> PoseGuard {
    let new = |v: ValueId| values[v.index()];
    match guard {
        PoseGuard::Reachable(v) => PoseGuard::Reachable(new(v)),
        PoseGuard::Regular(v, size) => PoseGuard::Regular(new(v), new(size)),
        PoseGuard::Finite(v) => PoseGuard::Finite(new(v)),
    }
}

/// The numbers of a program's operations, the same for equal ones.
fn numbers_of(
    program: &StraightLineProgram,
    numbers: &mut FxHashMap<ProgramOp, ValueId>,
) -> Vec<ValueId> {
    let mut values: Vec<ValueId> = Vec::with_capacity(program.ops.len());
    for op in &program.ops {
        let op = match op.clone().map_operands(|v| values[v.index()]) {
            ProgramOp::Add(a, b) if b < a => ProgramOp::Add(b, a),
            ProgramOp::Mul(a, b) if b < a => ProgramOp::Mul(b, a),
            op => op,
        };
        let next = ValueId::from_index(numbers.len());
        values.push(*numbers.entry(op).or_insert(next));
    }
    values
}

fn is_leaf(op: &ProgramOp) -> bool {
    matches!(op, ProgramOp::Number(_) | ProgramOp::Input(_))
}

/// Which values follow from constants and coordinates alone.
fn pose_dependent_values(program: &StraightLineProgram) -> Vec<bool> {
    let mut plain: Vec<bool> = Vec::with_capacity(program.ops.len());
    for op in &program.ops {
        let mut is_plain = match op {
            ProgramOp::Input(atom) => {
                matches!(atom, Atom::Pi | Atom::Constant(_) | Atom::Coordinate(_))
            }
            _ => true,
        };
        op.for_each_operand(|v| is_plain &= plain[v.index()]);
        plain.push(is_plain);
    }
    plain
}

/// The program of what is shared, with what is read as its outputs, and the places of those.
fn shared_program<'a>(
    parts: impl Iterator<Item = (&'a StraightLineProgram, &'a Vec<ValueId>, &'a Vec<bool>)>,
    shared: &dyn Fn(&ValueId) -> bool,
    guards: &[PoseGuard],
    read: &BTreeSet<ValueId>,
) -> (StraightLineProgram, BTreeMap<ValueId, usize>) {
    let mut program = StraightLineProgram::default();
    let mut places: BTreeMap<ValueId, ValueId> = BTreeMap::new();
    for (part, values, plain) in parts {
        for (i, op) in part.ops.iter().enumerate() {
            let of_known =
                matches!(op, ProgramOp::Neg(v) if places.contains_key(&values[v.index()]));
            let fixed = part.stages[i] == ProgramStage::Fixed;
            let wanted = fixed || is_leaf(op) || of_known || shared(&values[i]);
            if !wanted || !plain[i] || places.contains_key(&values[i]) {
                continue;
            }
            let place = ValueId::from_index(program.ops.len());
            let op = op.clone().map_operands(|v| places[&values[v.index()]]);
            program.ops.push(op);
            program.stages.push(part.stages[i]);
            places.insert(values[i], place);
        }
    }
    let mut outputs: Vec<(ValueId, ValueId)> = read.iter().map(|v| (places[v], *v)).collect();
    outputs.sort_unstable();
    let of = |v: ValueId| places[&v];
    program.guards = guards
        .iter()
        .map(|guard| match guard {
            PoseGuard::Reachable(v) => PoseGuard::Reachable(of(*v)),
            PoseGuard::Regular(v, size) => PoseGuard::Regular(of(*v), of(*size)),
            PoseGuard::Finite(v) => PoseGuard::Finite(of(*v)),
        })
        .collect();
    program.outputs = outputs.iter().map(|(place, _)| *place).collect();
    let places = outputs
        .iter()
        .enumerate()
        .map(|(k, (_, value))| (*value, k));
    (program.without_dead_code(), places.collect())
}
