//! The block evaluator: runs a program over many states inside the process, so that a changed model file can be tried
//! on a recording at once, without a compiler.

use std::fmt;

use modelmill_spec::Mechanism;
use nalgebra::{DMatrix, DVector};

use crate::expr::{Atom, Unary};
use crate::lower::{Guard, Op, Program, Stage};
use crate::programs::PassivePosition;
use crate::{Derivation, Programs};

/// States per block: small enough for the cache, large enough to hide the interpretation.
const BLOCK: usize = 64;

/// Newton steps allowed for a pose, and the accuracy asked for (m or rad).
const NEWTON_STEPS: usize = 40;
const NEWTON_ACCURACY: f64 = 1e-13;

/// Motion of the active coordinates, one slice of equal length per coordinate, in the order of the model file.
#[derive(Clone, Debug, Default)]
pub struct States<'a> {
    /// Coordinates, rad or m.
    pub q: Vec<&'a [f64]>,
    /// Rates, rad/s or m/s.
    pub qd: Vec<&'a [f64]>,
    /// Accelerations, rad/s^2 or m/s^2.
    pub qdd: Vec<&'a [f64]>,
    /// Forces that the drives carry, for effects that depend on the load; empty if there are none.
    pub load: Vec<&'a [f64]>,
}

impl States<'_> {
    /// Number of states.
    pub fn len(&self) -> usize {
        self.q.first().map_or(0, |q| q.len())
    }

    /// Whether there is no state.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A state at which the model has no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PoseFault {
    /// Which state.
    pub sample: usize,
    /// Why.
    pub reason: PoseReason,
}

/// Why a pose has no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PoseReason {
    /// The loops cannot close there.
    OutOfReach,
    /// The passive coordinates or the drives' forces are not determined there.
    Singular,
}

impl fmt::Display for PoseFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.reason {
            PoseReason::OutOfReach => write!(
                f,
                "at sample {} the loops cannot close: the pose is out of reach",
                self.sample
            ),
            PoseReason::Singular => {
                write!(f, "at sample {} the mechanism is singular", self.sample)
            }
        }
    }
}

impl std::error::Error for PoseFault {}

/// Numeric values for a model's constants and base parameters, ready to run its programs.
#[derive(Clone, Debug)]
pub struct Evaluator<'a> {
    mechanism: &'a Mechanism,
    programs: &'a Programs,
    active: Vec<usize>,
    passive: Vec<usize>,
    constants: Vec<f64>,
}

impl<'a> Evaluator<'a> {
    /// An evaluator with the model file's values.
    pub fn new(derivation: &'a Derivation) -> Self {
        let constants = derivation
            .mechanism
            .constants
            .iter()
            .map(|c| c.value)
            .collect();
        Self::with_constants(derivation, constants)
    }

    /// An evaluator with other values of the constants, in the order of the file.
    pub fn with_constants(derivation: &'a Derivation, constants: Vec<f64>) -> Self {
        let projection = &derivation.equations.projection;
        Self {
            mechanism: &derivation.mechanism,
            programs: &derivation.programs,
            active: projection.active.clone(),
            passive: projection.passive.clone(),
            constants,
        }
    }

    /// H_min, one matrix row per state and drive (states outermost), one column per base parameter.
    pub fn regressor(&self, states: &States<'_>) -> Result<DMatrix<f64>, PoseFault> {
        self.matrix(&self.programs.regressor, states)
    }

    /// H for all products of p_g, laid out like [`Self::regressor`].
    pub fn full_regressor(&self, states: &States<'_>) -> Result<DMatrix<f64>, PoseFault> {
        self.matrix(&self.programs.full_regressor, states)
    }

    /// Forces of the drives for given base parameters: one vector per drive.
    pub fn inverse_dynamics(
        &self,
        states: &States<'_>,
        base: &[f64],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        self.run(&self.programs.inverse_dynamics, states, base)
    }

    /// Passive coordinates, then their rates, then their accelerations: one vector each.
    pub fn passive(&self, states: &States<'_>) -> Result<Vec<Vec<f64>>, PoseFault> {
        self.run(&self.programs.passive, states, &[])
    }

    /// Coordinates and rates of the drives, then their Jacobian row by row: one vector each.
    pub fn drives(&self, states: &States<'_>) -> Result<Vec<Vec<f64>>, PoseFault> {
        self.run(&self.programs.drives, states, &[])
    }

    fn matrix(&self, program: &Program, states: &States<'_>) -> Result<DMatrix<f64>, PoseFault> {
        let n_drives = self.mechanism.drives.len();
        let columns = self.run(program, states, &[])?;
        let n_columns = columns.len() / n_drives.max(1);
        Ok(DMatrix::from_fn(
            states.len() * n_drives,
            n_columns,
            |row, column| columns[(row % n_drives) * n_columns + column][row / n_drives],
        ))
    }

    fn run(
        &self,
        program: &Program,
        states: &States<'_>,
        base: &[f64],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        let passive = match &self.programs.passive_position {
            PassivePosition::Newton { residual } => self.newton(residual, states)?,
            PassivePosition::None | PassivePosition::Closed => Vec::new(),
        };
        let machine = Machine::new(program, |atom| self.fixed(atom, base));
        machine.run(states.len(), |atom| match atom {
            Atom::Coordinate(i) => match self.active.iter().position(|a| *a == i) {
                Some(k) => states.q[k],
                None => {
                    &passive[self
                        .passive
                        .iter()
                        .position(|p| *p == i)
                        .expect("a coordinate is active or passive")]
                }
            },
            Atom::Rate(i) => states.qd[self.position(i)],
            Atom::Acceleration(i) => states.qdd[self.position(i)],
            Atom::Load(d) => states.load[d],
            Atom::Pi | Atom::Constant(_) | Atom::Parameter(_) | Atom::Base(_) => {
                unreachable!("fixed atoms are no inputs of a state")
            }
        })
    }

    fn position(&self, coordinate: usize) -> usize {
        self.active
            .iter()
            .position(|a| *a == coordinate)
            .expect("passive rates are put in place")
    }

    fn fixed(&self, atom: Atom, base: &[f64]) -> f64 {
        match atom {
            Atom::Pi => std::f64::consts::PI,
            Atom::Constant(i) => self.constants[i],
            Atom::Parameter(i) => self.mechanism.parameters[i].nominal,
            Atom::Base(k) => base[k],
            _ => unreachable!("a state's atom is no fixed input"),
        }
    }

    /// Passive coordinates of every state by Newton's method, each started from the state before.
    fn newton(&self, residual: &Program, states: &States<'_>) -> Result<Vec<Vec<f64>>, PoseFault> {
        let n = self.passive.len();
        let machine = Machine::new(residual, |atom| self.fixed(atom, &[]));
        let nominal: Vec<f64> = self
            .passive
            .iter()
            .map(|p| self.mechanism.coordinates[*p].nominal)
            .collect();
        let nominal_active: Vec<f64> = self
            .active
            .iter()
            .map(|a| self.mechanism.coordinates[*a].nominal)
            .collect();
        let mut found: Vec<Vec<f64>> = vec![Vec::with_capacity(states.len()); n];
        let (mut at, mut guess) = (nominal_active, nominal);
        for sample in 0..states.len() {
            let target: Vec<f64> = states.q.iter().map(|q| q[sample]).collect();
            // From the pose before in steps that keep to the assembly mode.
            let distance = at
                .iter()
                .zip(&target)
                .map(|(a, b)| (a - b).abs())
                .fold(0.0, f64::max);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a small positive count"
            )]
            let steps = (distance / 0.1).ceil().clamp(1.0, 1000.0) as usize;
            let from = at.clone();
            for step in 1..=steps {
                let share = step as f64 / steps as f64;
                let active: Vec<f64> = from
                    .iter()
                    .zip(&target)
                    .map(|(a, b)| a + share * (b - a))
                    .collect();
                guess = self
                    .newton_pose(&machine, &active, guess)
                    .map_err(|reason| PoseFault { sample, reason })?;
            }
            at = target;
            for (column, value) in found.iter_mut().zip(&guess) {
                column.push(*value);
            }
        }
        Ok(found)
    }

    fn newton_pose(
        &self,
        machine: &Machine<'_>,
        active: &[f64],
        mut passive: Vec<f64>,
    ) -> Result<Vec<f64>, PoseReason> {
        let n = passive.len();
        for _ in 0..NEWTON_STEPS {
            let values = machine
                .run(1, |atom| match atom {
                    Atom::Coordinate(i) => match self.active.iter().position(|a| *a == i) {
                        Some(k) => &active[k..=k],
                        None => {
                            let k = self
                                .passive
                                .iter()
                                .position(|p| *p == i)
                                .expect("a coordinate is active or passive");
                            &passive[k..=k]
                        }
                    },
                    _ => unreachable!("a loop's residual depends on coordinates alone"),
                })
                .map_err(|fault| fault.reason)?;
            let residual = DVector::from_fn(n, |i, _| values[i][0]);
            let jacobian = DMatrix::from_fn(n, n, |i, j| values[n + i * n + j][0]);
            let step = jacobian.lu().solve(&residual).ok_or(PoseReason::Singular)?;
            for (x, dx) in passive.iter_mut().zip(step.iter()) {
                *x -= dx.clamp(-0.5, 0.5);
            }
            if !passive.iter().all(|x| x.is_finite()) {
                return Err(PoseReason::Singular);
            }
            if step.amax() < NEWTON_ACCURACY {
                return Ok(passive);
            }
        }
        Err(PoseReason::OutOfReach)
    }
}

/// A program with its fixed stage done and its values assigned to reusable slots.
struct Machine<'a> {
    program: &'a Program,
    /// Values of the fixed stage.
    fixed: Vec<f64>,
    /// Slot of each operation of the state stage.
    slots: Vec<usize>,
    n_slots: usize,
}

impl<'a> Machine<'a> {
    fn new(program: &'a Program, atom: impl Fn(Atom) -> f64) -> Self {
        let mut fixed = vec![0.0; program.ops.len()];
        for (i, op) in program.ops.iter().enumerate() {
            if program.stages[i] == Stage::Fixed {
                fixed[i] = match op {
                    Op::Input(input) => atom(*input),
                    _ => scalar(op, |v| fixed[v]),
                };
            }
        }
        let mut last_use: Vec<usize> = (0..program.ops.len()).collect();
        for (i, op) in program.ops.iter().enumerate() {
            op.for_each_operand(|v| last_use[v.index()] = i);
        }
        for value in program
            .outputs
            .iter()
            .copied()
            .chain(program.guards.iter().map(|g| g.value()))
        {
            last_use[value.index()] = program.ops.len();
        }
        let mut slots = vec![0; program.ops.len()];
        let (mut free, mut n_slots): (Vec<usize>, usize) = (Vec::new(), 0);
        let mut ends: Vec<Vec<usize>> = vec![Vec::new(); program.ops.len() + 1];
        for i in 0..program.ops.len() {
            if program.stages[i] == Stage::State {
                slots[i] = free.pop().unwrap_or_else(|| {
                    n_slots += 1;
                    n_slots - 1
                });
                ends[last_use[i]].push(slots[i]);
            }
            free.append(&mut ends[i]);
        }
        Self {
            program,
            fixed,
            slots,
            n_slots,
        }
    }

    fn run<'s>(
        &self,
        n: usize,
        input: impl Fn(Atom) -> &'s [f64],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        let mut outputs: Vec<Vec<f64>> = vec![Vec::with_capacity(n); self.program.outputs.len()];
        let inputs: Vec<Option<&[f64]>> = self
            .program
            .ops
            .iter()
            .zip(&self.program.stages)
            .map(|(op, stage)| match op {
                Op::Input(atom) if *stage == Stage::State => Some(input(*atom)),
                _ => None,
            })
            .collect();
        let mut memory = vec![[0.0; BLOCK]; self.n_slots];
        let mut start = 0;
        while start < n {
            let len = BLOCK.min(n - start);
            for (i, op) in self.program.ops.iter().enumerate() {
                if self.program.stages[i] == Stage::Fixed {
                    continue;
                }
                let mut result = [0.0; BLOCK];
                match (op, inputs[i]) {
                    (_, Some(values)) => result[..len].copy_from_slice(&values[start..start + len]),
                    _ => self.block(op, &memory, &mut result),
                }
                memory[self.slots[i]] = result;
            }
            for guard in &self.program.guards {
                let values = self.values(guard.value().index(), &memory);
                if let Some(k) = values[..len].iter().position(|v| !guard.passes(*v)) {
                    let reason = match guard {
                        Guard::Reachable(_) => PoseReason::OutOfReach,
                        Guard::Regular(..) => PoseReason::Singular,
                    };
                    return Err(PoseFault {
                        sample: start + k,
                        reason,
                    });
                }
            }
            for (output, value) in outputs.iter_mut().zip(&self.program.outputs) {
                output.extend_from_slice(&self.values(value.index(), &memory)[..len]);
            }
            start += len;
        }
        Ok(outputs)
    }

    fn values(&self, index: usize, memory: &[[f64; BLOCK]]) -> [f64; BLOCK] {
        if self.program.stages[index] == Stage::Fixed {
            [self.fixed[index]; BLOCK]
        } else {
            memory[self.slots[index]]
        }
    }

    fn block(&self, op: &Op, memory: &[[f64; BLOCK]], result: &mut [f64; BLOCK]) {
        let get = |v: crate::ValueId| self.values(v.index(), memory);
        let binary = |a, b, result: &mut [f64; BLOCK], f: fn(f64, f64) -> f64| {
            let (a, b): ([f64; BLOCK], [f64; BLOCK]) = (get(a), get(b));
            for k in 0..BLOCK {
                result[k] = f(a[k], b[k]);
            }
        };
        match op {
            Op::Add(a, b) => binary(*a, *b, result, |x, y| x + y),
            Op::Sub(a, b) => binary(*a, *b, result, |x, y| x - y),
            Op::Mul(a, b) => binary(*a, *b, result, |x, y| x * y),
            Op::Div(a, b) => binary(*a, *b, result, |x, y| x / y),
            Op::Atan2(a, b) => binary(*a, *b, result, f64::atan2),
            Op::Neg(a) | Op::Unary(_, a) | Op::Sin(a) | Op::Cos(a) => {
                let a = get(*a);
                for k in 0..BLOCK {
                    result[k] = scalar(op, |_| a[k]);
                }
            }
            Op::Number(_) | Op::Input(_) => unreachable!("numbers are fixed and inputs are copied"),
        }
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
        Op::Unary(function, a) => {
            let a = get(a);
            match function {
                Unary::Sqrt => a.sqrt(),
                Unary::Sign if a == 0.0 => 0.0,
                Unary::Sign => a.signum(),
                Unary::Abs => a.abs(),
                Unary::Tanh => a.tanh(),
                Unary::Exp => a.exp(),
                Unary::Sin => a.sin(),
                Unary::Cos => a.cos(),
            }
        }
    }
}
