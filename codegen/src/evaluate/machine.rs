//! The machine that runs a program over blocks of states: values in reusable slots, each a block wide, and one loop per
//! operation, in the widest vectors of the processor that runs it.

use std::cell::RefCell;

use modelmill_runtime::sin_cos_lanes;
use pulp::{Arch, Simd, WithSimd};

use super::{PoseFault, PoseReason};
use crate::ValueId;
use crate::expr::{Atom, Unary};
use crate::lower::{Guard, Op, Program, Stage};

/// States per block: small enough for the cache, large enough to hide the interpretation.
const BLOCK: usize = 64;

/// A program for one state at a time, as Newton's method needs it.
pub(super) struct Scalar<'a> {
    program: &'a Program,
    /// Values of all operations; those of the fixed stage stay.
    values: RefCell<Vec<f64>>,
}

impl<'a> Scalar<'a> {
    pub(super) fn new(machine: Machine<'a>) -> Self {
        Self {
            program: machine.program,
            values: RefCell::new(machine.fixed),
        }
    }

    /// Runs the program and reads what is wanted of its outputs.
    pub(super) fn run<R>(
        &self,
        input: impl Fn(Atom) -> f64,
        read: impl FnOnce(&dyn Fn(usize) -> f64) -> R,
    ) -> R {
        let mut values = self.values.borrow_mut();
        let ops = self.program.ops.iter().zip(&self.program.stages);
        for (i, (op, stage)) in ops.enumerate() {
            if *stage == Stage::State {
                values[i] = match op {
                    Op::Input(atom) => input(*atom),
                    _ => scalar(op, |v| values[v]),
                };
            }
        }
        read(&|k| values[self.program.outputs[k].index()])
    }
}

/// A program with its fixed stage done and its values assigned to reusable slots.
pub(super) struct Machine<'a> {
    program: &'a Program,
    /// Values of the fixed stage.
    fixed: Vec<f64>,
    /// Those among them that the state stage needs, with their slots.
    kept: Vec<(usize, f64)>,
    /// What is done to every block, in order.
    steps: Vec<Step>,
    /// Slot of each operation of the state stage, and of fixed values that are needed there.
    slots: Vec<usize>,
    /// Slot of each output; of those that are not wanted one that stays zero.
    outputs: Vec<usize>,
    n_slots: usize,
}

/// One operation on slots; the target stands first and is never an operand.
#[derive(Clone, Copy, Debug)]
enum Step {
    Input(usize, Atom),
    Add(usize, usize, usize),
    Sub(usize, usize, usize),
    Mul(usize, usize, usize),
    Div(usize, usize, usize),
    Atan2(usize, usize, usize),
    Neg(usize, usize),
    Unary(usize, Unary, usize),
    /// Sine and cosine of the last one; a slot of its own takes the one that nobody needs.
    SinCos(usize, usize, usize),
}

/// Outputs of a program for some states.
pub(super) struct Block<'m> {
    /// How many states.
    pub(super) len: usize,
    /// One slice of that length per output.
    pub(super) columns: Vec<&'m [f64]>,
}

impl<'a> Machine<'a> {
    /// For all outputs.
    pub(super) fn new(program: &'a Program, atom: impl Fn(Atom) -> f64) -> Self {
        Self::of(program, &|_| true, atom)
    }

    /// For some outputs; the others are zero, and what only they need is not computed.
    pub(super) fn of(
        program: &'a Program,
        wanted: &dyn Fn(usize) -> bool,
        atom: impl Fn(Atom) -> f64,
    ) -> Self {
        let computed = program.needed(wanted);
        let mut fixed = vec![0.0; program.ops.len()];
        for (i, op) in program.ops.iter().enumerate() {
            if computed[i] && program.stages[i] == Stage::Fixed {
                fixed[i] = match op {
                    Op::Input(input) => atom(*input),
                    _ => scalar(op, |v| fixed[v]),
                };
            }
        }
        let mut last_use: Vec<usize> = (0..program.ops.len()).collect();
        let mut needed = vec![false; program.ops.len()];
        let ops = program.ops.iter().enumerate();
        for (i, op) in ops.filter(|(i, _)| computed[*i]) {
            let is_state = program.stages[i] == Stage::State;
            op.for_each_operand(|v| {
                last_use[v.index()] = i;
                needed[v.index()] |= is_state;
            });
        }
        let outputs = program.outputs.iter().enumerate();
        let outputs = outputs.filter(|(k, _)| wanted(*k)).map(|(_, value)| *value);
        for value in outputs.chain(program.guards.iter().flat_map(|g| g.values())) {
            last_use[value.index()] = program.ops.len();
            needed[value.index()] = true;
        }
        let mut slots = vec![0; program.ops.len()];
        let (mut free, mut n_slots): (Vec<usize>, usize) = (Vec::new(), 0);
        // Fixed values keep their slots.
        for i in (0..program.ops.len()).filter(|i| program.stages[*i] == Stage::Fixed) {
            if needed[i] {
                slots[i] = n_slots;
                n_slots += 1;
            }
        }
        let mut ends: Vec<Vec<usize>> = vec![Vec::new(); program.ops.len() + 1];
        for i in 0..program.ops.len() {
            if computed[i] && program.stages[i] == Stage::State {
                slots[i] = free.pop().unwrap_or_else(|| {
                    n_slots += 1;
                    n_slots - 1
                });
                ends[last_use[i]].push(slots[i]);
            }
            free.append(&mut ends[i]);
        }
        let kept = (0..program.ops.len())
            .filter(|i| needed[*i] && program.stages[*i] == Stage::Fixed)
            .map(|i| (slots[i], fixed[i]))
            .collect();
        // Where only one of sine and cosine is needed, the other goes here.
        let (spare, zero) = (n_slots, n_slots + 1);
        let steps = steps(program, &computed, &slots, spare);
        let outputs = program.outputs.iter().enumerate();
        let outputs = outputs.map(|(k, value)| {
            if wanted(k) {
                slots[value.index()]
            } else {
                zero
            }
        });
        Self {
            program,
            fixed,
            kept,
            steps,
            outputs: outputs.collect(),
            slots,
            n_slots: n_slots + 2,
        }
    }

    /// Runs over `n` states and shows the outputs block by block.
    pub(super) fn run<'s, E: From<PoseFault>>(
        &self,
        n: usize,
        input: impl Fn(Atom) -> &'s [f64],
        mut visit: impl FnMut(&Block<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let inputs: Vec<&[f64]> = self
            .steps
            .iter()
            .map(|step| match step {
                Step::Input(_, atom) => input(*atom),
                _ => &[],
            })
            .collect();
        let mut memory = vec![[0.0; BLOCK]; self.n_slots];
        for (slot, value) in &self.kept {
            memory[*slot] = [*value; BLOCK];
        }
        let arch = Arch::new();
        let mut start = 0;
        while start < n {
            let len = BLOCK.min(n - start);
            arch.dispatch(OneBlock {
                steps: &self.steps,
                inputs: &inputs,
                states: start..start + len,
                memory: &mut memory,
            });
            if let Some((k, guard)) = self.first_fault(len, &memory) {
                let reason = match guard {
                    Guard::Reachable(_) => PoseReason::OutOfReach,
                    Guard::Regular(..) => PoseReason::Singular,
                    Guard::Finite(_) => PoseReason::Undefined,
                };
                let sample = start + k;
                return Err(PoseFault { sample, reason }.into());
            }
            let columns = self.outputs.iter().map(|slot| &memory[*slot][..len]);
            visit(&Block {
                len,
                columns: columns.collect(),
            })?;
            start += len;
        }
        Ok(())
    }

    /// The first state of a block at which a guard fails, and the guard: of several, the one that emitted code sees first.
    fn first_fault(&self, len: usize, memory: &[[f64; BLOCK]]) -> Option<(usize, Guard)> {
        let failing = self.program.guards.iter().filter_map(|guard| {
            let values = self.values(guard.value(), memory);
            let size = guard
                .size()
                .map_or(1.0, |size| self.values(size, memory)[0]);
            let k = values[..len].iter().position(|v| !guard.passes(*v, size))?;
            Some((k, *guard))
        });
        // Fixed values come before those of a state there.
        let stage = |guard: &Guard| self.program.stages[guard.value().index()];
        failing.min_by_key(|(k, guard)| (*k, stage(guard), guard.value()))
    }

    fn values<'m>(&self, value: ValueId, memory: &'m [[f64; BLOCK]]) -> &'m [f64; BLOCK] {
        &memory[self.slots[value.index()]]
    }
}

/// The state stage on slots.
fn steps(program: &Program, computed: &[bool], slots: &[usize], spare: usize) -> Vec<Step> {
    let slot = |v: &ValueId| slots[v.index()];
    let mut steps = Vec::with_capacity(program.ops.len());
    for (i, op) in program.ops.iter().enumerate() {
        if program.stages[i] == Stage::Fixed || !computed[i] {
            continue;
        }
        let to = slots[i];
        let step = match op {
            Op::Input(atom) => Step::Input(to, *atom),
            Op::Add(a, b) => Step::Add(to, slot(a), slot(b)),
            Op::Sub(a, b) => Step::Sub(to, slot(a), slot(b)),
            Op::Mul(a, b) => Step::Mul(to, slot(a), slot(b)),
            Op::Div(a, b) => Step::Div(to, slot(a), slot(b)),
            Op::Atan2(a, b) => Step::Atan2(to, slot(a), slot(b)),
            Op::Neg(a) => Step::Neg(to, slot(a)),
            Op::Cos(a) | Op::Unary(Unary::Cos, a) => Step::SinCos(spare, to, slot(a)),
            // The cosine of the same angle stands right before the sine if both are needed; the angle is still there.
            Op::Sin(a) if i > 0 && computed[i - 1] && program.ops[i - 1] == Op::Cos(*a) => {
                steps.pop();
                let cos = if slots[i - 1] == to {
                    spare
                } else {
                    slots[i - 1]
                };
                Step::SinCos(to, cos, slot(a))
            }
            Op::Sin(a) | Op::Unary(Unary::Sin, a) => Step::SinCos(to, spare, slot(a)),
            Op::Unary(function, a) => Step::Unary(to, *function, slot(a)),
            Op::Number(_) => unreachable!("numbers are fixed"),
        };
        steps.push(step);
    }
    steps
}

/// All steps on one block of states.
struct OneBlock<'a, 's> {
    steps: &'a [Step],
    /// What each step reads, if it is an input.
    inputs: &'a [&'s [f64]],
    states: std::ops::Range<usize>,
    memory: &'a mut [[f64; BLOCK]],
}

impl WithSimd for OneBlock<'_, '_> {
    type Output = ();

    #[allow(clippy::inline_always, reason = "the trait's manual asks for it")]
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let memory = self.memory;
        for (step, input) in self.steps.iter().zip(self.inputs) {
            match *step {
                Step::Input(to, _) => {
                    memory[to][..self.states.len()].copy_from_slice(&input[self.states.clone()]);
                }
                Step::Add(to, a, b) => two(memory, to, a, b, |x, y| x + y),
                Step::Sub(to, a, b) => two(memory, to, a, b, |x, y| x - y),
                Step::Mul(to, a, b) => two(memory, to, a, b, |x, y| x * y),
                Step::Div(to, a, b) => two(memory, to, a, b, |x, y| x / y),
                Step::Atan2(to, a, b) => two(memory, to, a, b, f64::atan2),
                Step::Neg(to, a) => one(memory, to, a, |x| -x),
                Step::Unary(to, Unary::Sqrt, a) => one(memory, to, a, f64::sqrt),
                Step::Unary(to, Unary::Abs, a) => one(memory, to, a, f64::abs),
                Step::Unary(to, Unary::Sign, a) => one(memory, to, a, sign),
                Step::Unary(to, function, a) => one(memory, to, a, |x| unary(function, x)),
                Step::SinCos(sin, cos, a) => {
                    let [sin, cos, a] = distinct(memory, [sin, cos, a]);
                    sin_cos_lanes(a, sin, cos);
                }
            }
        }
    }
}

fn distinct<const N: usize>(
    memory: &mut [[f64; BLOCK]],
    slots: [usize; N],
) -> [&mut [f64; BLOCK]; N] {
    memory
        .get_disjoint_mut(slots)
        .expect("a step's target is none of its operands")
}

#[allow(
    clippy::inline_always,
    reason = "a function of its own would be compiled for the narrowest vectors"
)]
#[inline(always)]
fn one(memory: &mut [[f64; BLOCK]], to: usize, a: usize, operation: impl Fn(f64) -> f64) {
    let [to, a] = distinct(memory, [to, a]);
    for k in 0..BLOCK {
        to[k] = operation(a[k]);
    }
}

/// Generic, so that each operation is a loop of its own that the compiler can make wide.
#[allow(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn two(
    memory: &mut [[f64; BLOCK]],
    to: usize,
    a: usize,
    b: usize,
    operation: impl Fn(f64, f64) -> f64,
) {
    if a == b {
        return one(memory, to, a, |x| operation(x, x));
    }
    let [to, a, b] = distinct(memory, [to, a, b]);
    for k in 0..BLOCK {
        to[k] = operation(a[k], b[k]);
    }
}

/// -1, 0 or 1; what is no number stays what it is.
#[allow(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        x
    }
}

fn unary(function: Unary, x: f64) -> f64 {
    match function {
        Unary::Sqrt => x.sqrt(),
        Unary::Sign => sign(x),
        Unary::Abs => x.abs(),
        Unary::Tanh => x.tanh(),
        Unary::Exp => x.exp(),
        Unary::Sin => x.sin(),
        Unary::Cos => x.cos(),
    }
}

fn scalar(op: &Op, value: impl Fn(usize) -> f64) -> f64 {
    let get = |v: &crate::ValueId| value(v.index());
    match op {
        Op::Number(number) => number.to_f64(),
        Op::Input(_) => unreachable!("inputs are given"),
        Op::Add(a, b) => get(a) + get(b),
        Op::Sub(a, b) => get(a) - get(b),
        Op::Mul(a, b) => get(a) * get(b),
        Op::Div(a, b) => get(a) / get(b),
        Op::Neg(a) => -get(a),
        Op::Sin(a) => get(a).sin(),
        Op::Cos(a) => get(a).cos(),
        Op::Atan2(y, x) => get(y).atan2(get(x)),
        Op::Unary(function, a) => unary(*function, get(a)),
    }
}
