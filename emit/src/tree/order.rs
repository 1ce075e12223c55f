//! The order in which the statements of a program are written: a list schedule for few live values.
//!
//! Compilers stay close to the order of the source. The order in which expressions were built computes all velocities
//! before the first force. Then more values are live than there are registers, and each of them is stored and loaded
//! again. Therefore, while fewer than [`MOST_WAITING_VALUES`] are live, the operation with the longest chain of
//! dependents comes first, so that independent operations are next to each other. With more live values, the operation
//! that leaves the fewest live values comes first.
//!
//! Decision: this is a list schedule. Without it, blocks of the Panda's regressor spend more time on storing values
//! than on multiplying. Guarded values keep their order, so that evaluator and emitted code name the same fault of
//! a pose.

use std::cmp::Reverse;

use modelmill_codegen::{ProgramOp, ProgramStage, StraightLineProgram};

/// Number of live values above which operations that end the life of others come first: a quarter of the registers of
/// AVX-512. Constants need some registers, and the compiler follows this order only roughly. Measured on the Panda
/// between 2 and 28: above 12, blocks of the regressor wait for memory; below 6, for results.
const MOST_WAITING_VALUES: usize = 8;

/// Operations that are written as one statement: a formula, or a sine with its cosine.
#[derive(Default)]
struct SchedulerStatement {
    /// The operations, in their order.
    ops: Vec<usize>,
    /// Statements whose values it reads.
    needs: Vec<usize>,
    /// Statements that read its values.
    users: Vec<usize>,
    /// The statement with the next guarded value, if it has one: the guards keep their order, so that the same fault of
    /// a pose is reported first in every order of the statements.
    next_guarded: Option<usize>,
    /// Number of values that it makes live; inputs count as none.
    values: usize,
    /// Its section; sections are written in order.
    section: usize,
    /// Approximate cycles from its start to the end of the program without any shortage of registers.
    height: usize,
}

/// The operations of a program in a new order: fixed ones as they were, those in `first`, then all others.
///
/// `fused` marks operations that are written inside another one, and `sections` is the section of each operation.
/// Operations of an earlier section come first.
pub(crate) fn order(program: &StraightLineProgram, fused: &[bool], first: &[bool], sections: &[usize]) -> Vec<usize> {
    // Fixed operations and those in `first` keep their order.
    let of_state = |i: &usize| program.stages[*i] == ProgramStage::State;
    // Operations that keep their place at the beginning.
    let early = |i: &usize| !of_state(i) || first[*i];
    let n = program.ops.len();
    let mut order: Vec<usize> = (0..n).filter(early).collect();
    let mut statements = statements(program, fused, &|i| !early(&i));
    // A statement belongs to the last section of its operations.
    for statement in &mut statements {
        let of = statement.ops.iter().map(|i| sections[*i]);
        statement.section = of.max().unwrap_or(0);
    }
    // All others in the order of the schedule.
    for statement in schedule_statements(&statements) {
        order.extend(&statements[statement].ops);
    }
    order
}

/// The statements of the operations that are `wanted`, with their dependencies and heights.
fn statements(
    program: &StraightLineProgram,
    fused: &[bool],
    wanted: &dyn Fn(usize) -> bool,
) -> Vec<SchedulerStatement> {
    let n = program.ops.len();
    let mut statements: Vec<SchedulerStatement> = Vec::new();
    // The statement of each operation.
    let mut owner = vec![usize::MAX; n];
    for (i, op) in program.ops.iter().enumerate() {
        // Inlined operations belong to the statement of their user.
        if !wanted(i) || fused[i] {
            continue;
        }
        // A sine right after the cosine of the same angle joins its statement.
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
        // Operands of an operation that is written inside a formula are operands of the formula.
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
        // The statement is known to its operands' statements as a reader.
        owner[i] = this;
        for need in &statement.needs {
            statements[*need].users.push(this);
        }
        statements.push(statement);
    }
    // Guarded statements in the order of the program form a chain.
    let mut guarded: Vec<usize> = (program.guards.iter())
        .map(|guard| owner[guard.value().index()])
        .filter(|owner| *owner != usize::MAX)
        .collect();
    guarded.sort_unstable();
    guarded.dedup();
    for pair in guarded.windows(2) {
        statements[pair[0]].next_guarded = Some(pair[1]);
    }
    // Heights from the end to the start: own latency plus the largest height of a reader.
    for k in (0..statements.len()).rev() {
        let longest = |users: &[usize]| users.iter().map(|u| statements[*u].height).max();
        let after = longest(&statements[k].users).unwrap_or(0);
        // Sum of the latencies of its operations.
        let own = statements[k].ops.iter().map(|i| latency_cycles(&program.ops[*i]));
        // The operations of a formula form a tree, of which about half lies on the longest path.
        let own = own.sum::<usize>().div_ceil(statements[k].ops.len().clamp(1, 2));
        statements[k].height = after + own;
    }
    statements
}

/// Approximate latency of an operation on current processors, in cycles.
fn latency_cycles(op: &ProgramOp) -> usize {
    match op {
        ProgramOp::Number(_) | ProgramOp::Input(_) => 0,
        ProgramOp::Add(..) | ProgramOp::Sub(..) | ProgramOp::Mul(..) | ProgramOp::Neg(_) => 4,
        ProgramOp::Div(..) => 16,
        ProgramOp::Unary(..) | ProgramOp::Sin(_) | ProgramOp::Cos(_) | ProgramOp::Atan2(..) => 30,
    }
}

/// The indices of the statements in the order in which they are written.
fn schedule_statements(statements: &[SchedulerStatement]) -> Vec<usize> {
    let n = statements.len();
    let mut order = Vec::with_capacity(n);
    // Per statement: how many statements it still waits for, and how many still wait for it.
    let mut missing: Vec<usize> = statements.iter().map(|s| s.needs.len()).collect();
    for next in statements.iter().filter_map(|s| s.next_guarded) {
        missing[next] += 1;
    }
    let mut waiting: Vec<usize> = statements.iter().map(|s| s.users.len()).collect();
    // Statements whose operands are available.
    let mut ready: Vec<usize> = (0..n).filter(|k| missing[*k] == 0).collect();
    // Number of values that are live now.
    let mut live = 0;
    loop {
        // Change of the number of live values if a statement is written next.
        let kept = |k: usize| {
            let statement = &statements[k];
            let last = statement.needs.iter().filter(|need| waiting[**need] == 1);
            let freed: usize = last.map(|need| statements[*need].values).sum();
            i64::try_from(statement.values).unwrap_or(i64::MAX) - i64::try_from(freed).unwrap_or(i64::MAX)
        };
        // Among the ready statements: first by section, then by live values if there are many, then by height.
        let best = (0..ready.len()).min_by_key(|place| {
            let k = ready[*place];
            let pressure = if live < MOST_WAITING_VALUES { 0 } else { kept(k) };
            (statements[k].section, pressure, Reverse(statements[k].height), k)
        });
        // Everything is written.
        let Some(best) = best else {
            break;
        };
        // The order of the ready statements has no meaning.
        let k = ready.swap_remove(best);
        order.push(k);
        // Operands whose last reader this was are no longer live.
        live += statements[k].values;
        for need in &statements[k].needs {
            waiting[*need] -= 1;
            if waiting[*need] == 0 {
                live -= statements[*need].values;
            }
        }
        // Outputs are stored at once and do not stay live.
        if statements[k].users.is_empty() {
            live -= statements[k].values;
        }
        let next = statements[k].next_guarded;
        // Readers and the next guarded statement may be ready now.
        for user in statements[k].users.iter().chain(&next) {
            missing[*user] -= 1;
            if missing[*user] == 0 {
                ready.push(*user);
            }
        }
    }
    order
}
