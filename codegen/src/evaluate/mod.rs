//! The block evaluator: runs a program over many states inside the process, so that a changed model file can be tried
//! on a recording at once, without a compiler.
//!
//! Decision: the Python package uses this evaluator first and a C compiler on request, because any machine has the
//! evaluator. Irregular states go back to it from compiled code, so that faults have one definition.

pub(crate) mod lost_digits;
mod machine;

use std::fmt;

use modelmill_runtime::{Loops, PoseError, Scales, follow, solve_passive};
use modelmill_spec::Mechanism;
use nalgebra::DMatrix;

use crate::expr::Atom;
use crate::lower::{ProgramOp, StraightLineProgram};
use crate::programs::{LoopPrograms, PassivePosition};
use crate::{Derivation, DynamicsPrograms, ModelPrograms, ReactionPrograms};

use machine::{OutputBlock, RegisterMachine, SingleStateProgram};

/// Motion of the active coordinates, one slice of equal length per coordinate, in the order of the model file.
#[derive(Clone, Debug, Default)]
pub struct MotionStates<'a> {
    /// Coordinates, rad or m.
    pub q: Vec<&'a [f64]>,
    /// Rates, rad/s or m/s.
    pub qd: Vec<&'a [f64]>,
    /// Accelerations, rad/s^2 or m/s^2.
    pub qdd: Vec<&'a [f64]>,
    /// Forces that the drives carry, for effects that depend on the load; empty if there are none.
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

/// A state at which the model has no answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PoseFault {
    /// Which state.
    pub sample: usize,
    /// Why.
    pub reason: PoseReason,
}

/// Why a pose has no answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PoseReason {
    /// The loops cannot close there.
    OutOfReach,
    /// The passive coordinates or the drives' forces are not determined there.
    Singular,
    /// A term of the model, such as an effect of its own, has no finite value there.
    Undefined,
    /// An input is no finite number.
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
            PoseReason::Undefined => write!(
                f,
                "at sample {} a term of the model has no finite value",
                self.sample
            ),
            PoseReason::NotFinite { input } => {
                write!(f, "at sample {} `{input}` is no finite number", self.sample)
            }
        }
    }
}

impl std::error::Error for PoseFault {}

/// Numeric values for a model's constants and base parameters, ready to run its programs.
#[derive(Clone, Debug)]
pub struct ModelEvaluator<'a> {
    mechanism: &'a Mechanism,
    programs: &'a ModelPrograms,
    active: Vec<usize>,
    passive: Vec<usize>,
    constants: Vec<f64>,
}

impl<'a> ModelEvaluator<'a> {
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
            active: projection.loops.active.clone(),
            passive: projection.loops.passive.clone(),
            constants,
        }
    }

    /// The same with the parameters of another mechanism, which has the same entries.
    pub(crate) fn with_parameters(mut self, mechanism: &'a Mechanism) -> Self {
        self.mechanism = mechanism;
        self
    }

    /// p_min for the mechanism's parameters, as emitted code computes it.
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

    /// H_min block by block, for regressions over many states: `visit` gets how many states a block has (at most 64) and
    /// one column per drive and base parameter (drives outermost), a number for each state. Nothing is kept between blocks.
    ///
    /// Fails at the first state without an answer, and when `visit` does; what stands before a fault may have been shown.
    pub fn regressor_blocks<E: From<PoseFault>>(
        &self,
        states: &MotionStates<'_>,
        visit: impl FnMut(usize, &[&[f64]]) -> Result<(), E>,
    ) -> Result<(), E> {
        self.regressor_column_blocks(states, &|_| true, visit)
    }

    /// The same of some columns of H_min: the others are zero, and nothing is computed for them.
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

    /// H for all products of p_g, laid out like [`Self::regressor`].
    pub fn full_regressor(&self, states: &MotionStates<'_>) -> Result<DMatrix<f64>, PoseFault> {
        self.evaluate_matrix(&self.programs.full_regressor, states)
    }

    /// Forces of the drives for given base parameters: one vector per drive.
    pub fn inverse_dynamics(
        &self,
        states: &MotionStates<'_>,
        base: &[f64],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
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

    /// Generalised forces that rates alone ask for: one vector per independent coordinate.
    pub fn coriolis(
        &self,
        dynamics: &DynamicsPrograms,
        states: &MotionStates<'_>,
        base: &[f64],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        self.evaluate_program(&dynamics.coriolis, states, base)
    }

    /// Generalised forces that weight alone asks for: one vector per independent coordinate.
    pub fn gravity(
        &self,
        dynamics: &DynamicsPrograms,
        states: &MotionStates<'_>,
        base: &[f64],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        self.evaluate_program(&dynamics.gravity, states, base)
    }

    /// Generalised forces that effects ask for where nothing accelerates: one vector per independent coordinate.
    pub fn effects(
        &self,
        dynamics: &DynamicsPrograms,
        states: &MotionStates<'_>,
        base: &[f64],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        self.evaluate_program(&dynamics.effects, states, base)
    }

    /// `c + g + e`, generalised forces that do not depend on accelerations: one vector per independent coordinate.
    pub fn bias(
        &self,
        dynamics: &DynamicsPrograms,
        states: &MotionStates<'_>,
        base: &[f64],
    ) -> Result<Vec<Vec<f64>>, PoseFault> {
        let mut found = self.evaluate_program(&dynamics.bias, states, base)?;
        // The Jacobian of the drives stands behind them.
        found.truncate(self.active.len());
        Ok(found)
    }

    /// All determined components of the reactions for the parameters of the model file, one vector each, in the order in
    /// which the places of [`ReactionPrograms`] count them.
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
                    let driven =
                        (0..n_drives).map(|d| jacobian[d * n + a][sample] * forces[d][sample]);
                    driven.sum::<f64>() - bias[a][sample]
                })
                .collect();
            modelmill_runtime::solve(&mut matrix, &mut solution)
                .map_err(|error| fault(error.into()))?;
            for (column, value) in accelerations.iter_mut().zip(solution) {
                column.push(value);
            }
        }
        Ok(accelerations)
    }

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
            // Columns stand one after the other; drives take turns in each.
            let first = (k % n_columns) * n_rows + k / n_columns;
            for (i, value) in values.iter().enumerate() {
                entries[first + i * n_drives] = *value;
            }
        }
        Ok(matrix)
    }

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

    fn evaluate_blocks<E: From<PoseFault>>(
        &self,
        program: &StraightLineProgram,
        wanted: &dyn Fn(usize) -> bool,
        states: &MotionStates<'_>,
        base: &[f64],
        visit: impl FnMut(&OutputBlock<'_>) -> Result<(), E>,
    ) -> Result<(), E> {
        let (mut n, mut fault) = (
            states.len(),
            self.find_not_finite_input(program, states, base),
        );
        if let Some(fault) = &fault {
            n = fault.sample;
        }
        let mut passive = Vec::new();
        if let PassivePosition::Newton(loops) = &self.programs.passive_position {
            let found = self.solve_passive(loops, states, n);
            passive = found.passive;
            if let Some(earlier) = found.fault {
                n = earlier.sample;
                fault = Some(earlier);
            }
        }
        let machine =
            RegisterMachine::for_outputs(program, wanted, |atom| self.fixed_value(atom, base));
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
        // States before the first fault known so far may still have an earlier one.
        machine.run(n, input, visit)?;
        fault.map_or(Ok(()), |fault| Err(fault.into()))
    }

    /// The first state with an input that is no finite number; constants and base parameters belong to the first one.
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
        let name = |k: usize| &self.mechanism.coordinates[self.active[k]].name;
        let motion = [(&states.q, ""), (&states.qd, "_d"), (&states.qdd, "_dd")];
        let mut columns: Vec<(&[f64], String)> = Vec::new();
        for (values, suffix) in motion {
            let named = values.iter().enumerate();
            columns.extend(named.map(|(k, column)| (*column, format!("{}{suffix}", name(k)))));
        }
        // A load that nothing depends on is not looked at.
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

    /// Where a coordinate's values are.
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

    fn coordinate_position(&self, coordinate: usize) -> usize {
        self.active
            .iter()
            .position(|a| *a == coordinate)
            .expect("passive rates are put in place")
    }

    fn fixed_value(&self, atom: Atom, base: &[f64]) -> f64 {
        match atom {
            Atom::Pi => std::f64::consts::PI,
            Atom::Constant(i) => self.constants[i],
            Atom::Parameter(i) => self.mechanism.parameters[i].nominal,
            Atom::Base(k) => base[k],
            _ => unreachable!("a state's atom is no fixed input"),
        }
    }

    /// Passive coordinates of the first `n` states by Newton's method, each started from the state before; where that
    /// fails, from the nominal pose.
    fn solve_passive(
        &self,
        programs: &LoopPrograms,
        states: &MotionStates<'_>,
        n: usize,
    ) -> PassiveTrajectory {
        let machine = |program| RegisterMachine::new(program, |atom| self.fixed_value(atom, &[]));
        let loops = LoopEvaluator {
            evaluator: self,
            residual: SingleStateProgram::new(machine(&programs.residual)),
            scales: SingleStateProgram::new(machine(&programs.scales)),
        };
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
        let mut last: Option<(Vec<f64>, Vec<f64>)> = None;
        for sample in 0..n {
            let active: Vec<f64> = states.q.iter().map(|q| q[sample]).collect();
            let near = last.and_then(|(at, passive)| follow(&loops, &at, &passive, &active).ok());
            let found = near.map_or_else(
                || {
                    follow(
                        &loops,
                        &first_active,
                        first.as_ref().map_err(|e| *e)?,
                        &active,
                    )
                },
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

/// The first value that is no finite number; many at once are looked at, as nearly all are.
fn first_not_finite(values: &[f64]) -> Option<usize> {
    const AT_ONCE: usize = 64;
    let are_finite = |some: &[f64]| some.iter().fold(true, |all, x| all & x.is_finite());
    let start = AT_ONCE * values.chunks(AT_ONCE).position(|some| !are_finite(some))?;
    let further = values[start..].iter().position(|x| !x.is_finite())?;
    Some(start + further)
}

/// Where a coordinate's values are: among the active or the passive ones.
enum CoordinateSource {
    Active(usize),
    Passive(usize),
}

/// Passive coordinates of the states before the first fault.
struct PassiveTrajectory {
    passive: Vec<Vec<f64>>,
    fault: Option<PoseFault>,
}

/// The loops of one geometry, one pose at a time.
struct LoopEvaluator<'a> {
    evaluator: &'a ModelEvaluator<'a>,
    residual: SingleStateProgram<'a>,
    scales: SingleStateProgram<'a>,
}

impl LoopEvaluator<'_> {
    fn atom_value(&self, atom: Atom, active: &[f64], passive: &[f64]) -> f64 {
        let Atom::Coordinate(i) = atom else {
            unreachable!("a loop's residual depends on coordinates alone")
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
