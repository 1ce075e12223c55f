//! The block evaluator: runs a program over many states in the process, so that a changed model file can be tried on a
//! recording at once and without a compiler.
//!
//! A derivation and states go in, arrays of results or the first fault come out.
//!
//! Decision: the Python package uses this evaluator by default and a C compiler on request, because every machine can
//! run the evaluator. Compiled code hands irregular states back to it, so that faults have one definition.

pub(crate) mod lost_digits;
mod machine;
mod single;

use std::fmt;

use modelmill_runtime::{Loops, PoseError, Scales, follow, solve_passive};
use modelmill_spec::Mechanism;
use nalgebra::DMatrix;

use crate::expr::Atom;
use crate::lower::{ProgramOp, StraightLineProgram};
use crate::programs::{LoopPrograms, PassivePosition};
use crate::{Derivation, DynamicsPrograms, ModelPrograms, ReactionPrograms};

pub use single::SingleStateFunction;

use machine::{OutputBlock, RegisterMachine, SingleStateProgram};

/// Motion of the active coordinates: one slice per coordinate, in the order of the model file, all of equal length.
#[derive(Clone, Debug, Default)]
pub struct MotionStates<'a> {
    /// Coordinates, rad or m.
    pub q: Vec<&'a [f64]>,
    /// Rates, rad/s or m/s.
    pub qd: Vec<&'a [f64]>,
    /// Accelerations, rad/s^2 or m/s^2.
    pub qdd: Vec<&'a [f64]>,
    /// Forces of the drives, N or N m, for effects that depend on the load; empty if there are none.
    pub load: Vec<&'a [f64]>,
}

impl MotionStates<'_> {
    /// Number of states.
    pub fn len(&self) -> usize {
        self.q.first().map_or(0, |q| q.len())
    }

    /// Whether there is no state.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A state at which the model has no solution.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PoseFault {
    /// Index of the state, from 0.
    pub sample: usize,
    /// The reason.
    pub reason: PoseReason,
}

/// Why a pose has no solution.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PoseReason {
    /// The loops cannot close at this pose.
    OutOfReach,
    /// The passive coordinates or the forces of the drives are not determined at this pose.
    Singular,
    /// A term of the model, such as an effect given by an expression, has no finite value at this state.
    Undefined,
    /// An input is NaN or infinite.
    NotFinite {
        /// Its name in the model file, with `_d` and `_dd` for rates and accelerations; `p1_min`, ... for base parameters.
        input: String,
    },
}

impl From<PoseError> for PoseReason {
    fn from(error: PoseError) -> Self {
        match error {
            PoseError::OutOfReach => Self::OutOfReach,
            PoseError::Singular => Self::Singular,
            PoseError::Undefined => Self::Undefined,
            PoseError::NotFinite(input) => Self::NotFinite {
                input: input.to_owned(),
            },
        }
    }
}

/// One line that begins with the index of the state.
impl fmt::Display for PoseFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.reason {
            PoseReason::OutOfReach => write!(
                f,
                "at sample {} the loops cannot close: the pose is out of reach",
                self.sample
            ),
            PoseReason::Singular => {
                write!(f, "at sample {} the mechanism is singular", self.sample)
            }
            PoseReason::Undefined => write!(f, "at sample {} a term of the model has no finite value", self.sample),
            PoseReason::NotFinite { input } => {
                write!(f, "at sample {} `{input}` is no finite number", self.sample)
            }
        }
    }
}

impl std::error::Error for PoseFault {}

/// A model with values of its constants and parameters, which runs its programs over states.
#[derive(Clone, Debug)]
pub struct ModelEvaluator<'a> {
    /// The mechanism; its parameters are used where a program reads them.
    mechanism: &'a Mechanism,
    /// The programs.
    programs: &'a ModelPrograms,
    /// Indices of the active coordinates.
    active: Vec<usize>,
    /// Indices of the passive coordinates.
    passive: Vec<usize>,
    /// Values of the constants, in the order of the file.
    constants: Vec<f64>,
}

impl<'a> ModelEvaluator<'a> {
    /// An evaluator with the model file's values.
    pub fn new(derivation: &'a Derivation) -> Self {
        let constants = derivation.mechanism.constants.iter().map(|c| c.value).collect();
        Self::with_constants(derivation, constants)
    }

    /// An evaluator with other values of the constants, in the order of the file.
    pub fn with_constants(derivation: &'a Derivation, constants: Vec<f64>) -> Self {
        let projection = &derivation.equations.projection;
        Self {
            mechanism: &derivation.mechanism,
            programs: &derivation.programs,
            active: projection.loops.active.clone(),
            passive: projection.loops.passive.clone(),
            constants,
        }
    }

    /// The same evaluator with the parameters of another mechanism, which must have the same entries.
    pub(crate) fn with_parameters(mut self, mechanism: &'a Mechanism) -> Self {
        self.mechanism = mechanism;
        self
    }

    /// p_min from the mechanism's parameters, computed as in emitted code.
    pub(crate) fn base_parameters(&self) -> Vec<f64> {
        let program = &self.programs.base_parameters;
        let machine = RegisterMachine::new(program, |atom| self.fixed_value(atom, &[]));
        SingleStateProgram::new(machine).run(
            |_| unreachable!("base parameters do not depend on the state"),
            |output| (0..program.outputs.len()).map(output).collect(),
        )
    }

    /// H_min, one matrix row per state and drive (states outermost), one column per base parameter.
    pub fn regressor(&self, states: &MotionStates<'_>) -> Result<DMatrix<f64>, PoseFault> {
        self.evaluate_matrix(&self.programs.regressor, states)
    }

    /// H_min block by block, for regressions over many states. `visit` gets the number of states of a block (at most
    /// 64) and one column per drive and base parameter (drives outermost), each with one number per state. Nothing is
    /// stored between blocks.
    ///
    /// Fails at the first state without a solution, and if `visit` fails. Blocks before a fault may have been visited.
    pub fn regressor_blocks<E: From<PoseFault>>(
        &self,
        states: &MotionStates<'_>,
        visit: impl FnMut(usize, &[&[f64]]) -> Result<(), E>,
    ) -> Result<(), E> {
        self.regressor_column_blocks(states, &|_| true, visit)
    }

    /// The same for some columns of H_min; the others are zero and are not computed.
    pub fn regressor_column_blocks<E: From<PoseFault>>(
        &self,
        states: &MotionStates<'_>,
        wanted: &dyn Fn(usize) -> bool,
        mut visit: impl FnMut(usize, &[&[f64]]) -> Result<(), E>,
    ) -> Result<(), E> {
        let program = &self.programs.regressor;
        let columns = program.outputs.len() / self.mechanism.drives.len().max(1);
        self.evaluate_blocks(program, &|k| wanted(k % columns), states, &[], |block| {
            visit(block.len, &block.columns)
        })
    }

    /// H for all products of p_g, in the layout of [`Self::regressor`].
    pub fn full_regressor(&self, states: &MotionStates<'_>) -> Result<DMatrix<f64>, PoseFault> {
        self.evaluate_matrix(&self.programs.full_regressor, states)
    }

    /// Checks that the model has a solution at all states, without computing the entries of H.
    ///
    /// Fails where [`Self::full_regressor`] fails, with the same fault.
    pub fn check_states(&self, states: &MotionStates<'_>) -> Result<(), PoseFault> {
        // What guards do not read is skipped.
        self.evaluate_blocks(&self.programs.full_regressor, &|_| false, states, &[], |_| Ok(()))
    }

    /// Forces of the drives for given base parameters: one vector per drive.
    pub fn inverse_dynamics(&self, states: &MotionStates<'_>, base: &[f64]) -> Result<Vec<Vec<f64>>, PoseFault> {
        self.evaluate_program(&self.programs.inverse_dynamics, states, base)
    }

    /// Passive coordinates, then their rates, then their accelerations: one vector each.
    pub fn passive_motion(&self, states: &MotionStates<'_>) -> Result<Vec<Vec<f64>>, PoseFault> {
        self.evaluate_program(&self.programs.passive, states, &[])
    }

    /// Coordinates and rates of the drives, then their Jacobian row by row: one vector each.
    pub fn drive_motion(&self, states: &MotionStates<'_>) -> Result<Vec<Vec<f64>>, PoseFault> {
        self.evaluate_program(&self.programs.drives, states, &[])
    }

    /// Mass matrix row by row: one vector per entry. Accelerations of the states are not read here and below.
    pub fn mass_matrix(
        &self,
        dynamics: &DynamicsPrograms,
        states: &MotionStates<'_>,
        base: &[f64],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        self.evaluate_program(&dynamics.mass_matrix, states, base)
    }

    /// c, generalised forces that depend on the rates: one vector per independent coordinate.
    pub fn coriolis(
        &self,
        dynamics: &DynamicsPrograms,
        states: &MotionStates<'_>,
        base: &[f64],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        self.evaluate_program(&dynamics.coriolis, states, base)
    }

    /// g, generalised forces of gravity: one vector per independent coordinate.
    pub fn gravity(
        &self,
        dynamics: &DynamicsPrograms,
        states: &MotionStates<'_>,
        base: &[f64],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        self.evaluate_program(&dynamics.gravity, states, base)
    }

    /// e, generalised forces of the effects at zero acceleration: one vector per independent coordinate.
    pub fn effects(
        &self,
        dynamics: &DynamicsPrograms,
        states: &MotionStates<'_>,
        base: &[f64],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        self.evaluate_program(&dynamics.effects, states, base)
    }

    /// `c + g + e`, generalised forces at zero acceleration: one vector per independent coordinate.
    pub fn bias(
        &self,
        dynamics: &DynamicsPrograms,
        states: &MotionStates<'_>,
        base: &[f64],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        let mut found = self.evaluate_program(&dynamics.bias, states, base)?;
        // The Jacobian of the drives follows in the outputs.
        found.truncate(self.active.len());
        Ok(found)
    }

    /// All determined components of the reactions for the parameters of the model file: one vector each, in the order
    /// in which [`ReactionPrograms`] numbers them.
    pub fn reactions(
        &self,
        reactions: &ReactionPrograms,
        states: &MotionStates<'_>,
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        self.evaluate_program(&reactions.program, states, &[])
    }

    /// Forward dynamics: accelerations of the independent coordinates, one vector each, under the given forces of the
    /// drives, one slice each.
    pub fn forward_dynamics(
        &self,
        dynamics: &DynamicsPrograms,
        states: &MotionStates<'_>,
        base: &[f64],
        forces: &[&[f64]],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        let (n, n_drives) = (self.active.len(), self.mechanism.drives.len());
        let mass = self.evaluate_program(&dynamics.mass_matrix, states, base)?;
        let rest = self.evaluate_program(&dynamics.bias, states, base)?;
        let (bias, jacobian) = rest.split_at(n);
        let mut accelerations = vec![Vec::with_capacity(states.len()); n];
        // Per state: J' f - bias on the right-hand side, then a linear system with the mass matrix.
        for sample in 0..states.len() {
            let fault = |reason| PoseFault { sample, reason };
            for (d, force) in forces.iter().enumerate() {
                if !force[sample].is_finite() {
                    let input = self.mechanism.drives[d].name.clone();
                    return Err(fault(PoseReason::NotFinite { input }));
                }
            }
            let mut matrix: Vec<Vec<f64>> = mass
                .chunks(n.max(1))
                .map(|row| row.iter().map(|entry| entry[sample]).collect())
                .collect();
            let mut solution: Vec<f64> = (0..n)
                .map(|a| {
                    let driven = (0..n_drives).map(|d| jacobian[d * n + a][sample] * forces[d][sample]);
                    driven.sum::<f64>() - bias[a][sample]
                })
                .collect();
            modelmill_runtime::solve(&mut matrix, &mut solution).map_err(|error| fault(error.into()))?;
            for (column, value) in accelerations.iter_mut().zip(solution) {
                column.push(value);
            }
        }
        Ok(accelerations)
    }

    /// A program with one output per drive and column, as a matrix with one row per state and drive.
    fn evaluate_matrix(
        &self,
        program: &StraightLineProgram,
        states: &MotionStates<'_>,
    ) -> Result<DMatrix<f64>, PoseFault> {
        let n_drives = self.mechanism.drives.len();
        let columns = self.evaluate_program(program, states, &[])?;
        let n_columns = columns.len() / n_drives.max(1);
        let n_rows = states.len() * n_drives;
        let mut matrix = DMatrix::zeros(n_rows, n_columns);
        let entries = matrix.as_mut_slice();
        for (k, values) in columns.iter().enumerate() {
            // The matrix is stored column by column, with the drives of a state next to each other.
            let first = (k % n_columns) * n_rows + k / n_columns;
            for (i, value) in values.iter().enumerate() {
                entries[first + i * n_drives] = *value;
            }
        }
        Ok(matrix)
    }

    /// All outputs of a program at all states: one vector per output.
    fn evaluate_program(
        &self,
        program: &StraightLineProgram,
        states: &MotionStates<'_>,
        base: &[f64],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        let mut outputs = vec![Vec::with_capacity(states.len()); program.outputs.len()];
        self.evaluate_blocks(program, &|_| true, states, base, |block| {
            for (output, column) in outputs.iter_mut().zip(&block.columns) {
                output.extend_from_slice(column);
            }
            Ok::<(), PoseFault>(())
        })?;
        Ok(outputs)
    }

    /// Runs a program over the states block by block: checks inputs, solves for passive coordinates, then evaluates.
    fn evaluate_blocks<E: From<PoseFault>>(
        &self,
        program: &StraightLineProgram,
        wanted: &dyn Fn(usize) -> bool,
        states: &MotionStates<'_>,
        base: &[f64],
        visit: impl FnMut(&OutputBlock<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        // Number of states before the first known fault, and this fault.
        let (mut n, mut fault) = (states.len(), self.find_not_finite_input(program, states, base));
        if let Some(fault) = &fault {
            n = fault.sample;
        }
        // Loops without closed form: passive coordinates of all states come first.
        let mut passive = Vec::new();
        if let PassivePosition::Newton(loops) = &self.programs.passive_position {
            let found = self.solve_passive(loops, states, n);
            passive = found.passive;
            if let Some(earlier) = found.fault {
                n = earlier.sample;
                fault = Some(earlier);
            }
        }
        // Fixed values of the program are computed here, outputs that are not wanted are skipped.
        let machine = RegisterMachine::for_outputs(program, wanted, |atom| self.fixed_value(atom, base));
        let input = |atom| match atom {
            Atom::Coordinate(i) => match self.coordinate_source(i) {
                CoordinateSource::Active(k) => states.q[k],
                CoordinateSource::Passive(k) => &passive[k],
            },
            Atom::Rate(i) => states.qd[self.coordinate_position(i)],
            Atom::Acceleration(i) => states.qdd[self.coordinate_position(i)],
            Atom::Load(d) => states.load[d],
            Atom::Pi | Atom::Constant(_) | Atom::Parameter(_) | Atom::Base(_) => {
                unreachable!("fixed atoms are no inputs of a state")
            }
            Atom::Shared(_) => unreachable!("only emitted code has a pose apart"),
        };
        // A state before the known fault may have an earlier one of its own.
        machine.run(n, input, visit)?;
        fault.map_or(Ok(()), |fault| Err(fault.into()))
    }

    /// The first state with an input that is NaN or infinite; constants and base parameters count as inputs of the
    /// first state.
    fn find_not_finite_input(
        &self,
        program: &StraightLineProgram,
        states: &MotionStates<'_>,
        base: &[f64],
    ) -> Option<PoseFault> {
        let fault = |sample, input| {
            let reason = PoseReason::NotFinite { input };
            Some(PoseFault { sample, reason })
        };
        // Without a state there is no fault.
        if states.is_empty() {
            return None;
        }
        let of_constants = self.constants.iter().position(|x| !x.is_finite());
        if let Some(i) = of_constants {
            return fault(0, self.mechanism.constants[i].name.clone());
        }
        if let Some(k) = base.iter().position(|x| !x.is_finite()) {
            return fault(0, format!("p{}_min", k + 1));
        }
        // Names as in messages: coordinate, `_d` for its rate, `_dd` for its acceleration.
        let name = |k: usize| &self.mechanism.coordinates[self.active[k]].name;
        let motion = [(&states.q, ""), (&states.qd, "_d"), (&states.qdd, "_dd")];
        let mut columns: Vec<(&[f64], String)> = Vec::new();
        for (values, suffix) in motion {
            let named = values.iter().enumerate();
            columns.extend(named.map(|(k, column)| (*column, format!("{}{suffix}", name(k)))));
        }
        // A load that the program does not read is not checked.
        let uses_load = |op: &ProgramOp| matches!(op, ProgramOp::Input(Atom::Load(_)));
        if program.ops.iter().any(uses_load) {
            let drives = states.load.iter().zip(&self.mechanism.drives);
            columns.extend(drives.map(|(column, drive)| (*column, drive.name.clone())));
        }
        let first = columns
            .into_iter()
            .filter_map(|(column, name)| Some((first_not_finite(column)?, name)));
        let (sample, name) = first.min_by_key(|(sample, _)| *sample)?;
        fault(sample, name)
    }

    /// The array in which a coordinate's values are.
    fn coordinate_source(&self, coordinate: usize) -> CoordinateSource {
        let position = |list: &[usize]| list.iter().position(|i| *i == coordinate);
        position(&self.active).map_or_else(
            || {
                let k = position(&self.passive);
                CoordinateSource::Passive(k.expect("a coordinate is active or passive"))
            },
            CoordinateSource::Active,
        )
    }

    /// Position of an active coordinate. Rates and accelerations of passive ones never occur in programs.
    fn coordinate_position(&self, coordinate: usize) -> usize {
        self.active
            .iter()
            .position(|a| *a == coordinate)
            .expect("passive rates are replaced by expressions")
    }

    /// The value of an input that does not depend on the state.
    fn fixed_value(&self, atom: Atom, base: &[f64]) -> f64 {
        match atom {
            Atom::Pi => std::f64::consts::PI,
            Atom::Constant(i) => self.constants[i],
            Atom::Parameter(i) => self.mechanism.parameters[i].nominal,
            Atom::Base(k) => base[k],
            _ => unreachable!("a state's atom is no fixed input"),
        }
    }

    /// Passive coordinates of the first `n` states by Newton's method. Each state starts from the one before, or from
    /// the nominal pose if that fails.
    fn solve_passive(&self, programs: &LoopPrograms, states: &MotionStates<'_>, n: usize) -> PassiveTrajectory {
        let machine = |program| RegisterMachine::new(program, |atom| self.fixed_value(atom, &[]));
        let loops = LoopEvaluator {
            evaluator: self,
            residual: SingleStateProgram::new(machine(&programs.residual)),
            scales: SingleStateProgram::new(machine(&programs.scales)),
        };
        // The solution at the nominal pose defines the assembly mode.
        let nominal = |list: &[usize]| -> Vec<f64> {
            let coordinates = list.iter().map(|i| &self.mechanism.coordinates[*i]);
            coordinates.map(|c| c.nominal).collect()
        };
        let first_active = nominal(&self.active);
        let first = solve_passive(&loops, &first_active, &nominal(&self.passive));
        let mut followed = PassiveTrajectory {
            passive: vec![Vec::with_capacity(n); self.passive.len()],
            fault: None,
        };
        // Active and passive coordinates of the last state.
        let mut last: Option<(Vec<f64>, Vec<f64>)> = None;
        for sample in 0..n {
            // The pose of this state.
            let active: Vec<f64> = states.q.iter().map(|q| q[sample]).collect();
            // From the state before, which is usually close.
            let near = last.and_then(|(at, passive)| follow(&loops, &at, &passive, &active).ok());
            let found = near.map_or_else(
                || follow(&loops, &first_active, first.as_ref().map_err(|e| *e)?, &active),
                Ok,
            );
            match found {
                Ok(passive) => {
                    for (column, value) in followed.passive.iter_mut().zip(&passive) {
                        column.push(*value);
                    }
                    last = Some((active, passive));
                }
                Err(error) => {
                    let reason = error.into();
                    followed.fault = Some(PoseFault { sample, reason });
                    break;
                }
            }
        }
        followed
    }
}

/// Index of the first value that is NaN or infinite. Values are tested in groups, because nearly all are finite.
fn first_not_finite(values: &[f64]) -> Option<usize> {
    const AT_ONCE: usize = 64;
    let are_finite = |some: &[f64]| some.iter().fold(true, |all, x| all & x.is_finite());
    let start = AT_ONCE * values.chunks(AT_ONCE).position(|some| !are_finite(some))?;
    let further = values[start..].iter().position(|x| !x.is_finite())?;
    Some(start + further)
}

/// Position of a coordinate among the active or the passive ones.
enum CoordinateSource {
    /// Position among the active coordinates.
    Active(usize),
    /// Position among the passive coordinates.
    Passive(usize),
}

/// Passive coordinates of the states before the first fault.
struct PassiveTrajectory {
    /// One vector per passive coordinate.
    passive: Vec<Vec<f64>>,
    /// The fault, if there is one.
    fault: Option<PoseFault>,
}

/// The loops of one geometry, evaluated one pose at a time.
struct LoopEvaluator<'a> {
    /// Constants and indices of coordinates.
    evaluator: &'a ModelEvaluator<'a>,
    /// Residuals and their Jacobian.
    residual: SingleStateProgram<'a>,
    /// Scales of residuals and coordinates.
    scales: SingleStateProgram<'a>,
}

impl LoopEvaluator<'_> {
    /// The value of a coordinate at a pose.
    fn atom_value(&self, atom: Atom, active: &[f64], passive: &[f64]) -> f64 {
        let Atom::Coordinate(i) = atom else {
            unreachable!("a loop's residual depends on coordinates only")
        };
        match self.evaluator.coordinate_source(i) {
            CoordinateSource::Active(k) => active[k],
            CoordinateSource::Passive(k) => passive[k],
        }
    }
}

impl Loops for LoopEvaluator<'_> {
    type Number = f64;
    type Active = Vec<f64>;
    type Passive = Vec<f64>;
    type Matrix = Vec<Vec<f64>>;

    // Outputs: residuals, then the Jacobian row by row.
    fn linearise(&self, active: &Vec<f64>, passive: &Vec<f64>) -> (Vec<f64>, Vec<Vec<f64>>) {
        let n = passive.len();
        self.residual.run(
            |atom| self.atom_value(atom, active, passive),
            |output| {
                let row = |i: usize| (0..n).map(|j| output(n + i * n + j)).collect();
                ((0..n).map(output).collect(), (0..n).map(row).collect())
            },
        )
    }

    fn scales(&self, active: &Vec<f64>, passive: &Vec<f64>) -> Scales<Vec<f64>, Vec<f64>> {
        let (n, n_active) = (passive.len(), active.len());
        self.scales.run(
            |atom| self.atom_value(atom, active, passive),
            |output| Scales {
                residual: (0..n).map(output).collect(),
                passive: (n..2 * n).map(output).collect(),
                active: (2 * n..2 * n + n_active).map(output).collect(),
            },
        )
    }
}
