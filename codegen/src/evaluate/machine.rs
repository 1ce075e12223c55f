//! The machine that runs a program over blocks of states. Values are in reusable slots of one block each, and every
//! operation is one loop, in the widest vectors of the processor that runs it.

use std::cell::RefCell;

use modelmill_runtime::sin_cos_lanes;
use pulp::{Arch, Simd, WithSimd};

use super::{PoseFault, PoseReason};
use crate::ValueId;
use crate::expr::{Atom, Unary};
use crate::lower::{PoseGuard, ProgramOp, ProgramStage, StraightLineProgram};

/// States per block: few enough for the cache, and many enough that interpreting the program costs little.
const BLOCK: usize = 64;

/// A program that runs for one state at a time, as Newton's method needs it.
pub(super) struct SingleStateProgram<'a> {
    /// The program.
    program: &'a StraightLineProgram,
    /// Values of all operations; those of the fixed stage are computed once.
    values: RefCell<Vec<f64>>,
}

impl<'a> SingleStateProgram<'a> {
    /// Takes over the fixed values of a machine.
    pub(super) fn new(machine: RegisterMachine<'a>) -> Self {
        Self {
            program: machine.program,
            values: RefCell::new(machine.fixed),
        }
    }

    /// Runs the program at one state; `read` gets a function that returns output k.
    pub(super) fn run<R>(&self, input: impl Fn(Atom) -> f64, read: impl FnOnce(&dyn Fn(usize) -> f64) -> R) -> R {
        let mut values = self.values.borrow_mut();
        // Only operations of the state are computed.
        let ops = self.program.ops.iter().zip(&self.program.stages);
        for (i, (op, stage)) in ops.enumerate() {
            if *stage == ProgramStage::State {
                values[i] = match op {
                    ProgramOp::Input(atom) => input(*atom),
                    _ => evaluate_op(op, |v| values[v]),
                };
            }
        }
        read(&|k| values[self.program.outputs[k].index()])
    }
}

/// A program with its fixed stage computed and its values assigned to reusable slots.
pub(super) struct RegisterMachine<'a> {
    /// The program.
    program: &'a StraightLineProgram,
    /// Values of the fixed stage by operation.
    fixed: Vec<f64>,
    /// Fixed values that the state stage reads, with their slots.
    pub(super) kept: Vec<(usize, f64)>,
    /// Instructions for every block, in order.
    pub(super) steps: Vec<SlotInstruction>,
    /// Slot of each operation of the state stage, and of fixed values that it reads.
    pub(super) slots: Vec<usize>,
    /// Slot of each output; outputs that are not wanted share a slot that stays zero.
    pub(super) outputs: Vec<usize>,
    /// Number of slots of the memory.
    pub(super) n_slots: usize,
}

/// One operation on slots; the target comes first and is never an operand.
#[derive(Clone, Copy, Debug)]
pub(super) enum SlotInstruction {
    /// Copies an input.
    Input(usize, Atom),
    /// `a + b`
    Add(usize, usize, usize),
    /// `a - b`
    Sub(usize, usize, usize),
    /// `a * b`
    Mul(usize, usize, usize),
    /// `a / b`
    Div(usize, usize, usize),
    /// Angle of a point, operands y and x.
    Atan2(usize, usize, usize),
    /// `-a`
    Neg(usize, usize),
    /// A function of one operand.
    Unary(usize, Unary, usize),
    /// Sine and cosine of the third slot; a value that is not needed goes to a spare slot.
    SinCos(usize, usize, usize),
}

/// Outputs of a program for the states of one block.
pub(super) struct OutputBlock<'m> {
    /// Number of states.
    pub(super) len: usize,
    /// One slice of this length per output.
    pub(super) columns: Vec<&'m [f64]>,
}

impl<'a> RegisterMachine<'a> {
    /// A machine for all outputs; `atom` gives the values of fixed inputs.
    pub(super) fn new(program: &'a StraightLineProgram, atom: impl Fn(Atom) -> f64) -> Self {
        Self::for_outputs(program, &|_| true, atom)
    }

    /// A machine for some outputs. The others are zero, and operations that only they need are skipped.
    pub(super) fn for_outputs(
        program: &'a StraightLineProgram,
        wanted: &dyn Fn(usize) -> bool,
        atom: impl Fn(Atom) -> f64,
    ) -> Self {
        // The fixed stage is computed here, once.
        let computed = program.needed_operations(wanted);
        let mut fixed = vec![0.0; program.ops.len()];
        for (i, op) in program.ops.iter().enumerate() {
            if computed[i] && program.stages[i] == ProgramStage::Fixed {
                fixed[i] = match op {
                    ProgramOp::Input(input) => atom(*input),
                    _ => evaluate_op(op, |v| fixed[v]),
                };
            }
        }
        // The last operation that reads each value, and whether the state stage or the caller reads it.
        let mut last_use: Vec<usize> = (0..program.ops.len()).collect();
        let mut needed = vec![false; program.ops.len()];
        let ops = program.ops.iter().enumerate();
        for (i, op) in ops.filter(|(i, _)| computed[*i]) {
            let is_state = program.stages[i] == ProgramStage::State;
            op.for_each_operand(|v| {
                last_use[v.index()] = i;
                needed[v.index()] |= is_state;
            });
        }
        let outputs = program.outputs.iter().enumerate();
        let outputs = outputs.filter(|(k, _)| wanted(*k)).map(|(_, value)| *value);
        // Outputs and guarded values live until the end of the block.
        for value in outputs.chain(program.guards.iter().flat_map(|g| g.values())) {
            last_use[value.index()] = program.ops.len();
            needed[value.index()] = true;
        }
        let mut slots = vec![0; program.ops.len()];
        let (mut free, mut n_slots): (Vec<usize>, usize) = (Vec::new(), 0);
        // Fixed values have slots that are never reused.
        for i in (0..program.ops.len()).filter(|i| program.stages[*i] == ProgramStage::Fixed) {
            if needed[i] {
                slots[i] = n_slots;
                n_slots += 1;
            }
        }
        // Slots of other values are free again after their last use.
        // Operations by their last use: the first one of each, and the next one with the same last use.
        let mut first_ending = vec![None; program.ops.len() + 1];
        let mut next_ending = vec![None; program.ops.len()];
        for i in 0..program.ops.len() {
            if computed[i] && program.stages[i] == ProgramStage::State {
                slots[i] = free.pop().unwrap_or_else(|| {
                    n_slots += 1;
                    n_slots - 1
                });
                next_ending[i] = first_ending[last_use[i]].replace(i);
            }
            let mut ending = first_ending[i];
            while let Some(k) = ending {
                free.push(slots[k]);
                ending = next_ending[k];
            }
        }
        let kept = (0..program.ops.len())
            .filter(|i| needed[*i] && program.stages[*i] == ProgramStage::Fixed)
            .map(|i| (slots[i], fixed[i]))
            .collect();
        // The spare slot takes the sine or cosine that is not needed; the zero slot is never written.
        let (spare, zero) = (n_slots, n_slots + 1);
        let steps = slot_instructions(program, &computed, &slots, spare);
        let outputs = program.outputs.iter().enumerate();
        let outputs = outputs.map(|(k, value)| if wanted(k) { slots[value.index()] } else { zero });
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

    /// Runs over `n` states and passes the outputs to `visit` block by block. Fails at the first state at which a guard
    /// is not satisfied, and if `visit` fails.
    pub(super) fn run<'s, E: From<PoseFault>>(
        &self,
        n: usize,
        input: impl Fn(Atom) -> &'s [f64],
        mut visit: impl FnMut(&OutputBlock<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        // Inputs by instruction, so that they are looked up once and not per block.
        let inputs: Vec<&[f64]> = self
            .steps
            .iter()
            .map(|step| match step {
                SlotInstruction::Input(_, atom) => input(*atom),
                _ => &[],
            })
            .collect();
        // Slots that are never written stay zero.
        let mut memory = vec![[0.0; BLOCK]; self.n_slots];
        // Fixed values fill their slots once for all blocks.
        for (slot, value) in &self.kept {
            memory[*slot] = [*value; BLOCK];
        }
        // The vector width of this processor.
        let arch = Arch::new();
        let mut start = 0;
        while start < n {
            // The last block may be shorter.
            let len = BLOCK.min(n - start);
            arch.dispatch(BlockExecution {
                steps: &self.steps,
                inputs: &inputs,
                states: start..start + len,
                memory: &mut memory,
            });
            if let Some((k, guard)) = self.first_fault(len, &memory) {
                let reason = match guard {
                    PoseGuard::Reachable(_) => PoseReason::OutOfReach,
                    PoseGuard::Regular(..) => PoseReason::Singular,
                    PoseGuard::Finite(_) => PoseReason::Undefined,
                };
                let sample = start + k;
                return Err(PoseFault { sample, reason }.into());
            }
            // Results are borrowed, not copied.
            let columns = self.outputs.iter().map(|slot| &memory[*slot][..len]);
            visit(&OutputBlock {
                len,
                columns: columns.collect(),
            })?;
            start += len;
        }
        Ok(())
    }

    /// The first state of a block at which a guard is not satisfied, and this guard. Of several guards at one state it
    /// is the one that emitted code checks first.
    fn first_fault(&self, len: usize, memory: &[[f64; BLOCK]]) -> Option<(usize, PoseGuard)> {
        let failing = self.program.guards.iter().filter_map(|guard| {
            // All states of the block are checked at once.
            let values = self.block_values(guard.value(), memory);
            let size = guard
                .reference_size()
                .map_or(1.0, |size| self.block_values(size, memory)[0]);
            let k = values[..len].iter().position(|v| !guard.is_satisfied(*v, size))?;
            Some((k, *guard))
        });
        // Emitted code checks fixed values before those of a state.
        let stage = |guard: &PoseGuard| self.program.stages[guard.value().index()];
        failing.min_by_key(|(k, guard)| (*k, stage(guard), guard.value()))
    }

    /// The values of an operation at the states of a block.
    fn block_values<'m>(&self, value: ValueId, memory: &'m [[f64; BLOCK]]) -> &'m [f64; BLOCK] {
        &memory[self.slots[value.index()]]
    }
}

/// The instructions of the state stage.
fn slot_instructions(
    program: &StraightLineProgram,
    computed: &[bool],
    slots: &[usize],
    spare: usize,
) -> Vec<SlotInstruction> {
    let slot = |v: &ValueId| slots[v.index()];
    let mut steps = Vec::with_capacity(program.ops.len());
    for (i, op) in program.ops.iter().enumerate() {
        if program.stages[i] == ProgramStage::Fixed || !computed[i] {
            continue;
        }
        let to = slots[i];
        let step = match op {
            ProgramOp::Input(atom) => SlotInstruction::Input(to, *atom),
            ProgramOp::Add(a, b) => SlotInstruction::Add(to, slot(a), slot(b)),
            ProgramOp::Sub(a, b) => SlotInstruction::Sub(to, slot(a), slot(b)),
            ProgramOp::Mul(a, b) => SlotInstruction::Mul(to, slot(a), slot(b)),
            ProgramOp::Div(a, b) => SlotInstruction::Div(to, slot(a), slot(b)),
            ProgramOp::Atan2(a, b) => SlotInstruction::Atan2(to, slot(a), slot(b)),
            ProgramOp::Neg(a) => SlotInstruction::Neg(to, slot(a)),
            ProgramOp::Cos(a) | ProgramOp::Unary(Unary::Cos, a) => SlotInstruction::SinCos(spare, to, slot(a)),
            // If both are needed, the cosine of the same angle is the operation before the sine, and the slot of the
            // angle is not reused yet.
            ProgramOp::Sin(a) if i > 0 && computed[i - 1] && program.ops[i - 1] == ProgramOp::Cos(*a) => {
                steps.pop();
                let cos = if slots[i - 1] == to { spare } else { slots[i - 1] };
                SlotInstruction::SinCos(to, cos, slot(a))
            }
            ProgramOp::Sin(a) | ProgramOp::Unary(Unary::Sin, a) => SlotInstruction::SinCos(to, spare, slot(a)),
            ProgramOp::Unary(function, a) => SlotInstruction::Unary(to, *function, slot(a)),
            ProgramOp::Number(_) => unreachable!("numbers are fixed"),
        };
        steps.push(step);
    }
    steps
}

/// The execution of all instructions on one block of states.
struct BlockExecution<'a, 's> {
    /// The instructions.
    steps: &'a [SlotInstruction],
    /// Per instruction the array that it reads, if it is an input.
    inputs: &'a [&'s [f64]],
    /// Range of the states.
    states: std::ops::Range<usize>,
    /// The slots.
    memory: &'a mut [[f64; BLOCK]],
}

impl WithSimd for BlockExecution<'_, '_> {
    type Output = ();

    // The vector width is chosen by the caller, so everything below must be inlined.
    #[allow(clippy::inline_always, reason = "the trait's manual requires it")]
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let memory = self.memory;
        for (step, input) in self.steps.iter().zip(self.inputs) {
            match *step {
                SlotInstruction::Input(to, _) => {
                    memory[to][..self.states.len()].copy_from_slice(&input[self.states.clone()]);
                }
                SlotInstruction::Add(to, a, b) => apply_binary(memory, to, a, b, |x, y| x + y),
                SlotInstruction::Sub(to, a, b) => apply_binary(memory, to, a, b, |x, y| x - y),
                SlotInstruction::Mul(to, a, b) => apply_binary(memory, to, a, b, |x, y| x * y),
                SlotInstruction::Div(to, a, b) => apply_binary(memory, to, a, b, |x, y| x / y),
                SlotInstruction::Atan2(to, a, b) => apply_binary(memory, to, a, b, f64::atan2),
                SlotInstruction::Neg(to, a) => apply_unary(memory, to, a, |x| -x),
                SlotInstruction::Unary(to, Unary::Sqrt, a) => apply_unary(memory, to, a, f64::sqrt),
                SlotInstruction::Unary(to, Unary::Abs, a) => apply_unary(memory, to, a, f64::abs),
                SlotInstruction::Unary(to, Unary::Sign, a) => apply_unary(memory, to, a, sign),
                SlotInstruction::Unary(to, function, a) => {
                    apply_unary(memory, to, a, |x| evaluate_unary(function, x));
                }
                SlotInstruction::SinCos(sin, cos, a) => {
                    let [sin, cos, a] = distinct_slots(memory, [sin, cos, a]);
                    sin_cos_lanes(a, sin, cos);
                }
            }
        }
    }
}

/// The slots as distinct arrays. A target is never an operand, so this cannot fail.
fn distinct_slots<const N: usize>(memory: &mut [[f64; BLOCK]], slots: [usize; N]) -> [&mut [f64; BLOCK]; N] {
    memory
        .get_disjoint_mut(slots)
        .expect("a step's target is none of its operands")
}

#[allow(
    clippy::inline_always,
    reason = "a function of its own would be compiled for the narrowest vectors"
)]
/// `to = operation(a)` on all states of a block.
#[inline(always)]
fn apply_unary(memory: &mut [[f64; BLOCK]], to: usize, a: usize, operation: impl Fn(f64) -> f64) {
    let [to, a] = distinct_slots(memory, [to, a]);
    for k in 0..BLOCK {
        to[k] = operation(a[k]);
    }
}

/// `to = operation(a, b)` on all states of a block. It is generic, so that every operation is a loop that the compiler
/// can vectorise.
#[allow(clippy::inline_always, reason = "as above")]
#[inline(always)]
fn apply_binary(memory: &mut [[f64; BLOCK]], to: usize, a: usize, b: usize, operation: impl Fn(f64, f64) -> f64) {
    if a == b {
        return apply_unary(memory, to, a, |x| operation(x, x));
    }
    let [to, a, b] = distinct_slots(memory, [to, a, b]);
    for k in 0..BLOCK {
        to[k] = operation(a[k], b[k]);
    }
}

/// -1, 0 or 1; NaN stays NaN.
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

/// A function of one operand at one state.
pub(super) fn evaluate_unary(function: Unary, x: f64) -> f64 {
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

/// An operation at one state; `value` gives the values of its operands.
fn evaluate_op(op: &ProgramOp, value: impl Fn(usize) -> f64) -> f64 {
    let get = |v: &crate::ValueId| value(v.index());
    match op {
        ProgramOp::Number(number) => number.to_f64(),
        ProgramOp::Input(_) => unreachable!("inputs are given"),
        ProgramOp::Add(a, b) => get(a) + get(b),
        ProgramOp::Sub(a, b) => get(a) - get(b),
        ProgramOp::Mul(a, b) => get(a) * get(b),
        ProgramOp::Div(a, b) => get(a) / get(b),
        ProgramOp::Neg(a) => -get(a),
        ProgramOp::Sin(a) => get(a).sin(),
        ProgramOp::Cos(a) => get(a).cos(),
        ProgramOp::Atan2(y, x) => get(y).atan2(get(x)),
        ProgramOp::Unary(function, a) => evaluate_unary(*function, get(a)),
    }
}
