//! A function of one state that is prepared once and called many times, as in a controller or a simulation: no list of
//! states, no allocation, and the same numbers as the evaluation of many states.

use modelmill_runtime::sin_cos_lanes;

use super::machine::{RegisterMachine, SlotInstruction, evaluate_unary};
use super::{CoordinateSource, ModelEvaluator};
use crate::expr::Atom;
use crate::lower::{PoseGuard, StraightLineProgram};
use crate::programs::PassivePosition;
use crate::{DynamicsPrograms, ValueId};

/// One step at one state.
#[derive(Clone, Copy, Debug)]
enum SingleStep {
    /// Copies number `.2` of array `.1` (positions, rates, accelerations, forces) to a slot.
    Input(usize, usize, usize),
    /// An operation on slots.
    Operation(SlotInstruction),
}

/// A function of one state, with fixed values of constants and base parameters.
pub struct SingleStateFunction {
    /// The steps, in order.
    steps: Vec<SingleStep>,
    /// The slots; fixed values are in theirs.
    memory: Vec<f64>,
    /// Slot of each output.
    outputs: Vec<usize>,
    /// Conditions on the state: the slot that is checked, and the slot of the size that it is compared with.
    guards: Vec<(PoseGuard, usize, Option<usize>)>,
    /// How many numbers of each array are read.
    widths: [usize; 4],
}

impl SingleStateFunction {
    /// Number of outputs.
    pub fn n_outputs(&self) -> usize {
        self.outputs.len()
    }

    /// Evaluates the function. `state` has positions, rates, accelerations and forces of the drives; arrays that the
    /// function does not read may be empty. Returns false, without a valid output, if the state has no finite
    /// solution or an array is too short; the evaluation of many states then states the fault.
    pub fn run(&mut self, state: [&[f64]; 4], out: &mut [f64]) -> bool {
        let is_complete = state.iter().zip(self.widths).all(|(array, width)| array.len() >= width);
        let is_finite = |array: &&[f64]| array.iter().all(|value| value.is_finite());
        if !is_complete || out.len() != self.outputs.len() || !state.iter().all(is_finite) {
            return false;
        }
        let memory = &mut self.memory;
        for step in &self.steps {
            match *step {
                SingleStep::Input(to, array, k) => memory[to] = state[array][k],
                SingleStep::Operation(operation) => apply(memory, operation),
            }
        }
        let is_satisfied = |(guard, value, size): &(PoseGuard, usize, Option<usize>)| {
            guard.is_satisfied(memory[*value], size.map_or(1.0, |size| memory[size]))
        };
        if !self.guards.iter().all(is_satisfied) {
            return false;
        }
        for (out, slot) in out.iter_mut().zip(&self.outputs) {
            *out = memory[*slot];
        }
        out.iter().all(|value| value.is_finite())
    }
}

/// Carries out one operation.
#[inline]
fn apply(memory: &mut [f64], operation: SlotInstruction) {
    match operation {
        SlotInstruction::Add(to, a, b) => memory[to] = memory[a] + memory[b],
        SlotInstruction::Sub(to, a, b) => memory[to] = memory[a] - memory[b],
        SlotInstruction::Mul(to, a, b) => memory[to] = memory[a] * memory[b],
        SlotInstruction::Div(to, a, b) => memory[to] = memory[a] / memory[b],
        SlotInstruction::Atan2(to, y, x) => memory[to] = memory[y].atan2(memory[x]),
        SlotInstruction::Neg(to, a) => memory[to] = -memory[a],
        SlotInstruction::Unary(to, function, a) => memory[to] = evaluate_unary(function, memory[a]),
        SlotInstruction::SinCos(sin, cos, a) => {
            let (mut s, mut c) = ([0.0], [0.0]);
            sin_cos_lanes(&[memory[a]], &mut s, &mut c);
            memory[sin] = s[0];
            memory[cos] = c[0];
        }
        SlotInstruction::Input(..) => unreachable!("inputs are steps of their own"),
    }
}

impl ModelEvaluator<'_> {
    /// Forces of the drives at one state; `None` if loops are solved by Newton's method, which needs the state before.
    pub fn single_inverse_dynamics(&self, base: &[f64]) -> Option<SingleStateFunction> {
        self.single(&self.programs.inverse_dynamics, base)
    }

    /// `H_min` at one state, row by row; `None` as above.
    pub fn single_regressor(&self) -> Option<SingleStateFunction> {
        self.single(&self.programs.regressor, &[])
    }

    /// The mass matrix at one state, row by row; `None` as above.
    pub fn single_mass_matrix(&self, dynamics: &DynamicsPrograms, base: &[f64]) -> Option<SingleStateFunction> {
        self.single(&dynamics.mass_matrix, base)
    }

    /// The bias forces at one state; `None` as above.
    pub fn single_bias(&self, dynamics: &DynamicsPrograms, base: &[f64]) -> Option<SingleStateFunction> {
        self.single(&dynamics.bias, base)
    }

    /// Prepares a program for single states.
    fn single(&self, program: &StraightLineProgram, base: &[f64]) -> Option<SingleStateFunction> {
        if matches!(self.programs.passive_position, PassivePosition::Newton(_)) {
            return None;
        }
        // Values that are not finite are reported by the evaluation of many states.
        if self.constants.iter().chain(base).any(|value| !value.is_finite()) {
            return None;
        }
        let machine = RegisterMachine::new(program, |atom| self.fixed_value(atom, base));
        let mut widths = [0; 4];
        let mut steps = Vec::with_capacity(machine.steps.len());
        for step in &machine.steps {
            let SlotInstruction::Input(to, atom) = *step else {
                steps.push(SingleStep::Operation(*step));
                continue;
            };
            let (array, k) = match atom {
                Atom::Coordinate(i) => match self.coordinate_source(i) {
                    CoordinateSource::Active(k) => (0, k),
                    CoordinateSource::Passive(_) => return None,
                },
                Atom::Rate(i) => (1, self.coordinate_position(i)),
                Atom::Acceleration(i) => (2, self.coordinate_position(i)),
                Atom::Load(d) => (3, d),
                _ => return None,
            };
            widths[array] = widths[array].max(k + 1);
            steps.push(SingleStep::Input(to, array, k));
        }
        let mut memory = vec![0.0; machine.n_slots];
        for (slot, value) in &machine.kept {
            memory[*slot] = *value;
        }
        let slot = |value: ValueId| machine.slots[value.index()];
        let guards = program.guards.iter();
        Some(SingleStateFunction {
            steps,
            memory,
            outputs: machine.outputs.clone(),
            guards: guards
                .map(|guard| (*guard, slot(guard.value()), guard.reference_size().map(slot)))
                .collect(),
            widths,
        })
    }
}
