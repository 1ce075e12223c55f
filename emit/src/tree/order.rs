//! The order in which a program is written.
//!
//! Compilers keep close to the order of what they are given. The order in which expressions were made computes all
//! velocities before the first force, so that more values wait than a machine has registers, and each that waits is stored
//! and loaded again. Here, while less than [`MOST_WAITING_VALUES`] wait, the operation comes first that the longest chain of others
//! waits for, so that independent ones stand side by side; else the one that leaves the fewest.

//!
//! Decision: this is a list schedule. Without it, blocks of the Panda's regressor spend more time on storing values
//! than on multiplying. Guarded values keep their order, so that evaluator and emitted code name the same fault of
//! a pose.

use std::cmp::Reverse;

use modelmill_codegen::{ProgramOp, ProgramStage, StraightLineProgram};

/// How many values may wait before the ones that free others come first: a quarter of the registers of AVX-512. Constants
/// need some, and the compiler keeps to this order only roughly. Measured on the Panda between 2 and 28: above 12 blocks of
/// the regressor wait for memory, below 6 for results.
const MOST_WAITING_VALUES: usize = 8;

/// Operations that are written as one: a formula, or a sine with its cosine.
#[derive(Default)]
struct SchedulerStatement {
    /// In order.
    ops: Vec<usize>,
    /// Statements whose values it needs.
    needs: Vec<usize>,
    /// Statements that need its values.
    users: Vec<usize>,
    /// If a value of it is guarded, the statement with the next guarded one: of several faults of a pose the same
    /// one is told first, in whatever order the rest is written.
    next_guarded: Option<usize>,
    /// How many values wait after it; inputs wait where they are.
    values: usize,
    /// The section in which it stands.
    section: usize,
    /// Time from its start to the end of the program if nothing ever waits for a register, in cycles or thereabouts.
    height: usize,
}

/// The operations of a program in another order: those that are fixed as they were, then those of a state, with the ones
/// in `first` before all others. `fused` says which ones are written inside others, `sections` where each stands; what
/// stands in an earlier section comes first.
pub(crate) fn order(
    program: &StraightLineProgram,
    fused: &[bool],
    first: &[bool],
    sections: &[usize],
) -> Vec<usize> {
    let of_state = |i: &usize| program.stages[*i] == ProgramStage::State;
    let early = |i: &usize| !of_state(i) || first[*i];
    let n = program.ops.len();
    let mut order: Vec<usize> = (0..n).filter(early).collect();
    let mut statements = statements(program, fused, &|i| !early(&i));
    for statement in &mut statements {
        let of = statement.ops.iter().map(|i| sections[*i]);
        statement.section = of.max().unwrap_or(0);
    }
    for statement in schedule_statements(&statements) {
        order.extend(&statements[statement].ops);
    }
    order
}

/// The statements of those operations that are to be put in order.
fn statements(
    program: &StraightLineProgram,
    fused: &[bool],
    wanted: &dyn Fn(usize) -> bool,
) -> Vec<SchedulerStatement> {
    let n = program.ops.len();
    let mut statements: Vec<SchedulerStatement> = Vec::new();
    let mut owner = vec![usize::MAX; n];
    for (i, op) in program.ops.iter().enumerate() {
        if !wanted(i) || fused[i] {
            continue;
        }
        let with_cosine = matches!((op, i.checked_sub(1).map(|j| &program.ops[j])),
            (ProgramOp::Sin(a), Some(ProgramOp::Cos(b))) if a == b && wanted(i - 1));
        if with_cosine {
            let statement = owner[i - 1];
            statements[statement].ops.push(i);
            statements[statement].values += 1;
            owner[i] = statement;
            continue;
        }
        let this = statements.len();
        let mut statement = SchedulerStatement {
            values: usize::from(!matches!(op, ProgramOp::Input(_))),
            ..SchedulerStatement::default()
        };
        // Operands of what is written inside a formula are the formula's.
        let mut open = vec![i];
        while let Some(k) = open.pop() {
            statement.ops.push(k);
            program.ops[k].for_each_operand(|v| match v.index() {
                v if fused[v] && wanted(v) => open.push(v),
                v if owner[v] != usize::MAX => statement.needs.push(owner[v]),
                _ => {}
            });
        }
        statement.ops.sort_unstable();
        statement.needs.sort_unstable();
        statement.needs.dedup();
        owner[i] = this;
        for need in &statement.needs {
            statements[*need].users.push(this);
        }
        statements.push(statement);
    }
    let mut guarded: Vec<usize> = (program.guards.iter())
        .map(|guard| owner[guard.value().index()])
        .filter(|owner| *owner != usize::MAX)
        .collect();
    guarded.sort_unstable();
    guarded.dedup();
    for pair in guarded.windows(2) {
        statements[pair[0]].next_guarded = Some(pair[1]);
    }
    for k in (0..statements.len()).rev() {
        let longest = |users: &[usize]| users.iter().map(|u| statements[*u].height).max();
        let after = longest(&statements[k].users).unwrap_or(0);
        let own = statements[k]
            .ops
            .iter()
            .map(|i| latency_cycles(&program.ops[*i]));
        // Half of a formula's operations wait for the other half.
        let own = own
            .sum::<usize>()
            .div_ceil(statements[k].ops.len().clamp(1, 2));
        statements[k].height = after + own;
    }
    statements
}

/// Cycles until a result is there, on the machines of the day.
fn latency_cycles(op: &ProgramOp) -> usize {
    match op {
        ProgramOp::Number(_) | ProgramOp::Input(_) => 0,
        ProgramOp::Add(..) | ProgramOp::Sub(..) | ProgramOp::Mul(..) | ProgramOp::Neg(_) => 4,
        ProgramOp::Div(..) => 16,
        ProgramOp::Unary(..) | ProgramOp::Sin(_) | ProgramOp::Cos(_) | ProgramOp::Atan2(..) => 30,
    }
}

/// Statements in order.
fn schedule_statements(statements: &[SchedulerStatement]) -> Vec<usize> {
    let n = statements.len();
    let mut order = Vec::with_capacity(n);
    // How many statements each still waits for, and how many still wait for it.
    let mut missing: Vec<usize> = statements.iter().map(|s| s.needs.len()).collect();
    for next in statements.iter().filter_map(|s| s.next_guarded) {
        missing[next] += 1;
    }
    let mut waiting: Vec<usize> = statements.iter().map(|s| s.users.len()).collect();
    let mut ready: Vec<usize> = (0..n).filter(|k| missing[*k] == 0).collect();
    let mut live = 0;
    loop {
        let kept = |k: usize| {
            let statement = &statements[k];
            let last = statement.needs.iter().filter(|need| waiting[**need] == 1);
            let freed: usize = last.map(|need| statements[*need].values).sum();
            i64::try_from(statement.values).unwrap_or(i64::MAX)
                - i64::try_from(freed).unwrap_or(i64::MAX)
        };
        let best = (0..ready.len()).min_by_key(|place| {
            let k = ready[*place];
            let pressure = if live < MOST_WAITING_VALUES {
                0
            } else {
                kept(k)
            };
            (
                statements[k].section,
                pressure,
                Reverse(statements[k].height),
                k,
            )
        });
        let Some(best) = best else {
            break;
        };
        let k = ready.swap_remove(best);
        order.push(k);
        live += statements[k].values;
        for need in &statements[k].needs {
            waiting[*need] -= 1;
            if waiting[*need] == 0 {
                live -= statements[*need].values;
            }
        }
        // Outputs leave at once.
        if statements[k].users.is_empty() {
            live -= statements[k].values;
        }
        let next = statements[k].next_guarded;
        for user in statements[k].users.iter().chain(&next) {
            missing[*user] -= 1;
            if missing[*user] == 0 {
                ready.push(*user);
            }
        }
    }
    order
}
