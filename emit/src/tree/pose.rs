//! The part of a pose that the programs of a model share: loop closure, drive lengths, and the guards of the pose. It
//! is emitted once as a struct, and every program that shares it reads its results.
//!
//! Operations are compared across programs by value numbering: equal operations on equal operands get the same number.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_codegen::expr::Atom;
use modelmill_codegen::{Derivation, PoseGuard, ProgramOp, ProgramStage, StraightLineProgram, ValueId};
use rustc_hash::FxHashMap;

use super::scope::NameScope;
use super::{PrecomputedValues, StatementRoutine};

/// The shared part of a pose, with the values of it that programs read.
#[derive(Clone, Debug)]
pub(crate) struct SharedPose {
    /// Value numbers by operation; equal operations of all programs have equal numbers.
    numbers: FxHashMap<ProgramOp, ValueId>,
    /// Values that programs read, by number, with their positions among the results.
    read: BTreeMap<ValueId, usize>,
    /// Guards of the pose that all sharing programs begin with, on numbered values.
    guards: Vec<PoseGuard>,
    /// Coordinates that it reads.
    pub(crate) inputs: Vec<Atom>,
    /// Its statements; its results are the values that programs read.
    pub(crate) routine: StatementRoutine,
    /// Its precomputed values.
    pub(crate) once: PrecomputedValues,
}

impl SharedPose {
    /// The shared part of the programs of a derivation; `None` if fewer than two programs have guards in common. Names
    /// of its values are added to `scope`.
    pub(super) fn new(derivation: &Derivation, scope: &mut NameScope) -> Option<Self> {
        let programs = &derivation.programs;
        // Programs that need a pose of which they may share a part.
        let programs = [
            &programs.regressor,
            &programs.inverse_dynamics,
            &programs.passive,
            &programs.drives,
        ];
        // One numbering for all programs, so that equal values are found across them.
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
        // Values that depend on nothing but constants and coordinates.
        let plain = programs.map(pose_dependent_values);
        // The longest beginning that the guards of the first program share with those of all other programs that share
        // any.
        let common = |a: &[PoseGuard], b: &[PoseGuard]| a.iter().zip(b).take_while(|(a, b)| a == b).count();
        let (_, _, first) = &numbered[0];
        let others = numbered[1..].iter();
        let shared = others.map(|(_, _, guards)| common(first, guards));
        // Programs without common guards are left out.
        let n = shared.filter(|n| *n > 0).min()?;
        let guards = first[..n].to_vec();
        let is_client = |k: usize| numbered[k].2.starts_with(&guards);
        // The programs that share the pose.
        let clients: Vec<usize> = (0..programs.len()).filter(|k| is_client(*k)).collect();
        if clients.len() < 2 {
            return None;
        }
        // Number of sharing programs in which each value of a state occurs.
        let mut uses: BTreeMap<ValueId, usize> = BTreeMap::new();
        for k in &clients {
            let (program, values, _) = &numbered[*k];
            // Changes of sign stay in the programs that read a value.
            let moving = (0..program.ops.len()).filter(|i| {
                let op = &program.ops[*i];
                let is_its = plain[*k][*i] && program.stages[*i] == ProgramStage::State;
                is_its && !is_leaf(op) && !matches!(op, ProgramOp::Neg(_))
            });
            // A value counts once per program.
            let distinct: BTreeSet<ValueId> = moving.map(|i| values[i]).collect();
            for value in distinct {
                *uses.entry(value).or_insert(0) += 1;
            }
        }
        // A value is shared if at least two programs compute it.
        let shared = |value: &ValueId| uses.get(value).is_some_and(|n| *n > 1);
        // A shared value is a result if a program uses it in an operation that is not shared, as an output or in a
        // guard.
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
        let parts = clients.iter().map(|k| (numbered[*k].0, &numbered[*k].1, &plain[*k]));
        // The shared part as a program of its own, and its statements.
        let (program, places) = shared_program(parts, &shared, &guards, &read);
        // Every result gets a name, because programs bind results by name.
        // Its statements, with names for all results.
        let mut routine = StatementRoutine::with_result_names(&program, scope, &[], true);
        // Values at the state by which quantities are named.
        let values = scope.meanings.values(&program);
        let mut once = PrecomputedValues::new(scope);
        once.absorb(&mut routine);
        for (k, (value, output)) in routine.results.iter().zip(&program.outputs).enumerate() {
            scope.add_shared(Atom::Shared(k), value, values[output.index()]);
        }
        // Constants are read from the geometry; only coordinates are arguments.
        let inputs = routine.read.iter().copied();
        let inputs = inputs.filter(|atom| matches!(atom, Atom::Coordinate(_))).collect();
        Some(Self {
            numbers,
            read: places,
            guards,
            inputs,
            routine,
            once,
        })
    }

    /// The program without the shared part, whose results become inputs. `None` if the program does not begin with the
    /// same guards.
    pub(crate) fn remaining_program(&self, program: &StraightLineProgram) -> Option<StraightLineProgram> {
        let mut numbers = self.numbers.clone();
        let values = numbers_of(program, &mut numbers);
        let guards: Vec<PoseGuard> = program
            .guards
            .iter()
            .map(|guard| renumber_guard(*guard, &values))
            .collect();
        // The guards are part of what is shared.
        if !guards.starts_with(&self.guards) {
            return None;
        }
        // The shared values are replaced in place; operations that only they needed are then dead code.
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

/// The same guard on the numbered values.
fn renumber_guard(guard: PoseGuard, values: &[ValueId]) -> PoseGuard {
    let new = |v: ValueId| values[v.index()];
    match guard {
        PoseGuard::Reachable(v) => PoseGuard::Reachable(new(v)),
        PoseGuard::Regular(v, size) => PoseGuard::Regular(new(v), new(size)),
        PoseGuard::Finite(v) => PoseGuard::Finite(new(v)),
    }
}

/// The value number of each operation of a program; new operations are added to `numbers`. Sums and products are
/// commutative.
fn numbers_of(program: &StraightLineProgram, numbers: &mut FxHashMap<ProgramOp, ValueId>) -> Vec<ValueId> {
    let mut values: Vec<ValueId> = Vec::with_capacity(program.ops.len());
    for op in &program.ops {
        // The operation on numbered operands.
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

/// Whether an operation is a number or an input, which costs nothing.
fn is_leaf(op: &ProgramOp) -> bool {
    matches!(op, ProgramOp::Number(_) | ProgramOp::Input(_))
}

/// Which values depend on nothing but constants and coordinates.
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

/// The shared values as a program whose outputs are the values in `read`, and the positions of these outputs. `parts`
/// are the sharing programs with value numbers and pose-dependent values.
fn shared_program<'a>(
    parts: impl Iterator<Item = (&'a StraightLineProgram, &'a Vec<ValueId>, &'a Vec<bool>)>,
    shared: &dyn Fn(&ValueId) -> bool,
    guards: &[PoseGuard],
    read: &BTreeSet<ValueId>,
) -> (StraightLineProgram, BTreeMap<ValueId, usize>) {
    // Built operation by operation, with positions by value number.
    let mut program = StraightLineProgram::default();
    let mut places: BTreeMap<ValueId, ValueId> = BTreeMap::new();
    // Values are appended in the order of the programs; those that are there already are skipped.
    for (part, values, plain) in parts {
        for (i, op) in part.ops.iter().enumerate() {
            // The negative of a shared value is kept, because another shared value may need it.
            let of_known = matches!(op, ProgramOp::Neg(v) if places.contains_key(&values[v.index()]));
            // Fixed values and leaves are added as well; those without a use are removed at the end.
            let fixed = part.stages[i] == ProgramStage::Fixed;
            let wanted = fixed || is_leaf(op) || of_known || shared(&values[i]);
            if !wanted || !plain[i] || places.contains_key(&values[i]) {
                continue;
            }
            // The operation on operands of the new program.
            let place = ValueId::from_index(program.ops.len());
            let op = op.clone().map_operands(|v| places[&values[v.index()]]);
            program.ops.push(op);
            program.stages.push(part.stages[i]);
            places.insert(values[i], place);
        }
    }
    // Outputs in the order of computation.
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
    let places = outputs.iter().enumerate().map(|(k, (_, value))| (*value, k));
    (program.without_dead_code(), places.collect())
}
