//! Functions of a model at given states, many at once: forces, regressor, mass matrix, bias, forward dynamics,
//! reactions. The derived equations are interpreted over blocks of states, so that no compiler is needed.

use std::ops::Range;
use std::sync::{Mutex, OnceLock};

use modelmill_codegen::{
    DynamicsPrograms, ModelEvaluator, MotionStates, PoseFault, PoseReason, ReactionPrograms, SingleStateFunction,
};
use modelmill_emit::vectors_c;
use rayon::prelude::*;

use crate::error::{Error, Outcome};
use crate::evaluate::reaction_components;
use crate::model::Model;

/// States evaluated at once: large compared with the preparation of a program, small compared with the cache.
const CHUNK: usize = 4096;

/// Values of many states, such as positions: one row for each state, one column for each coordinate or drive.
#[derive(Clone, Copy, Debug)]
pub struct StateMatrix<'a> {
    /// The values, as many as rows times columns.
    pub numbers: &'a [f64],
    /// Number of values of each state.
    pub width: usize,
    /// Whether values of one state are contiguous (row-major); otherwise values of one column are.
    pub by_state: bool,
}

impl StateMatrix<'_> {
    /// Number of states.
    fn len(&self) -> usize {
        self.numbers.len() / self.width.max(1)
    }

    /// The columns of a range of states, one vector for each column.
    fn columns(&self, states: &Range<usize>) -> Vec<Vec<f64>> {
        let n = self.len();
        (0..self.width)
            .map(|k| {
                if self.by_state {
                    let rows = &self.numbers[states.start * self.width..states.end * self.width];
                    rows.iter().skip(k).step_by(self.width).copied().collect()
                } else {
                    self.numbers[k * n + states.start..k * n + states.end].to_vec()
                }
            })
            .collect()
    }
}

/// States and the forces that act at them. An input that a function does not read may be omitted.
#[derive(Clone, Copy, Debug)]
pub struct StateSamples<'a> {
    /// Positions of the active coordinates, rad or m, in the order of [`Model::active_coordinates`].
    pub q: StateMatrix<'a>,
    /// Rates of the active coordinates, rad/s or m/s.
    pub qd: Option<StateMatrix<'a>>,
    /// Accelerations of the active coordinates, rad/s^2 or m/s^2.
    pub qdd: Option<StateMatrix<'a>>,
    /// Forces of the drives, N or N m: inputs of forward dynamics and of effects that depend on the load.
    pub forces: Option<StateMatrix<'a>>,
}

/// A function of a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ModelFunction {
    /// Forces of the drives, N or N m.
    InverseDynamics,
    /// H_min of eq. (10): a row for each drive, a column for each base parameter.
    Regressor,
    /// M of `J^T f = M q'' + b`: a row and a column for each active coordinate. f are the forces of the drives; J is
    /// the Jacobian of their coordinates with respect to the active coordinates.
    MassMatrix,
    /// b of `J^T f = M q'' + b`: generalised forces of rates, gravity and effects, one for each active coordinate.
    Bias,
    /// Accelerations of the active coordinates for given forces of the drives, rad/s^2 or m/s^2.
    ForwardDynamics,
    /// Forces and moments that joints and the cuts of loops transmit, for the parameters of the model file: the
    /// components that [`ModelFunctions::reactions`] names.
    Reactions,
}

impl ModelFunction {
    /// Whether rates, accelerations and forces are read, in this order; positions always are.
    fn required_inputs(self) -> [bool; 3] {
        match self {
            Self::InverseDynamics | Self::Regressor | Self::Reactions => [true, true, false],
            Self::MassMatrix => [false, false, false],
            Self::Bias => [true, false, false],
            Self::ForwardDynamics => [true, false, true],
        }
    }
}

/// Functions of a model at given states. Programs are derived at their first use and kept.
pub struct ModelFunctions {
    /// The model, with its own derivation.
    model: Model,
    /// Mass matrix and bias, once they were needed.
    dynamics: OnceLock<DynamicsPrograms>,
    /// Reactions, once they were needed.
    reactions: OnceLock<ReactionPrograms>,
    /// Functions that were evaluated at single states, the latest one last.
    single: Mutex<Vec<PreparedSingle>>,
}

/// Most functions for single states that are kept, each with its values of base parameters: callers often compare two
/// sets of values.
const MOST_SINGLE: usize = 12;

/// A function that is prepared for single states.
struct PreparedSingle {
    /// The function.
    function: ModelFunction,
    /// The values of base parameters in it.
    values: Vec<f64>,
    /// The prepared program; `None` if only many states can be evaluated.
    program: Option<SingleStateFunction>,
    /// Zeros for rates or accelerations on which the function does not depend.
    zeros: Vec<f64>,
}

impl Model {
    /// The model's functions at given states.
    pub fn functions(&self) -> ModelFunctions {
        ModelFunctions {
            model: self.clone(),
            dynamics: OnceLock::new(),
            reactions: OnceLock::new(),
            single: Mutex::new(Vec::new()),
        }
    }
}

/// Everything that is prepared once for all states.
struct FunctionPrograms<'a> {
    /// Interprets the programs of the derivation.
    evaluator: ModelEvaluator<'a>,
    /// Present for functions of the equation of motion.
    dynamics: Option<&'a DynamicsPrograms>,
    /// Present for reactions.
    reactions: Option<&'a ReactionPrograms>,
}

impl ModelFunctions {
    /// Names of the components of [`ModelFunction::Reactions`], such as `elbow.Fx`, and of those that the equations
    /// of motion do not determine.
    ///
    /// Fails when reactions cannot be derived.
    pub fn reactions(&self) -> Outcome<(Vec<String>, Vec<String>)> {
        let named = reaction_components(self.derived_reactions()?);
        Ok((named.determined, named.left_out))
    }

    /// Shape of a function at one state: rows and columns, 1 column for a vector.
    ///
    /// Fails when the function cannot be derived.
    pub fn shape(&self, function: ModelFunction) -> Outcome<[usize; 2]> {
        let (active, drives) = (self.model.active_coordinates().len(), self.model.row_names().len());
        Ok(match function {
            ModelFunction::InverseDynamics => [drives, 1],
            ModelFunction::Regressor => [drives, self.model.base.len()],
            ModelFunction::MassMatrix => [active, active],
            ModelFunction::Bias | ModelFunction::ForwardDynamics => [active, 1],
            ModelFunction::Reactions => [self.reactions()?.0.len(), 1],
        })
    }

    /// A function at all given states, row by row, state after state. `values` are those of the base parameters, in the
    /// order of the model. The work is distributed over all cores. Models with loops solved by Newton's method
    /// ([`Model::has_iterative_loops`]) use one core, since the initial guess at a state is the solution of the
    /// previous state.
    ///
    /// Fails when a required input is missing or has another length, and at the first state without a solution.
    ///
    /// ```
    /// use modelmill::Model;
    /// use modelmill::states::{ModelFunction, StateMatrix, StateSamples};
    ///
    /// let arm = Model::open("../model-spec/models/two_link.toml")?;
    /// // One state: the stretched arm at standstill, whose drives balance gravity (N m).
    /// let zero = StateMatrix { numbers: &[0.0, 0.0], width: 2, by_state: true };
    /// let states = StateSamples { q: zero, qd: Some(zero), qdd: Some(zero), forces: None };
    /// let functions = arm.functions();
    /// let forces = functions.evaluate_at(ModelFunction::InverseDynamics, &states, &arm.values)?;
    /// assert!(forces.len() == 2 && forces[0] > forces[1]);
    /// # Ok::<(), modelmill::Error>(())
    /// ```
    pub fn evaluate_at(&self, function: ModelFunction, given: &StateSamples<'_>, values: &[f64]) -> Outcome<Vec<f64>> {
        let parts = self.checked_inputs(function, given)?;
        if values.len() != self.model.base.len() {
            return Err(Error::input(format!(
                "{} values of base parameters are given; the model has {}",
                values.len(),
                self.model.base.len()
            )));
        }
        // Newton's method needs the states in order, as one chunk; otherwise chunks are independent.
        let n = given.q.len();
        let width: usize = self.shape(function)?.iter().product();
        let prepared = self.programs_for(function)?;
        let mut out = vec![0.0; n * width];
        let chunk = if self.model.has_iterative_loops() {
            n.max(1)
        } else {
            CHUNK
        };
        let one = |k: usize, out: &mut [f64]| {
            let states = k * chunk..(k * chunk + chunk).min(n);
            fill(function, &prepared, &parts, &states, values, out).map_err(|fault| PoseFault {
                sample: fault.sample + states.start,
                reason: fault.reason,
            })
        };
        // Faults count states within a chunk; the message counts them from the first.
        let of_state = |fault: PoseFault| Error::input(format!("{}: {fault}", self.model.path));
        if width == 0 || n == 0 {
            return Ok(out);
        }
        // A single chunk runs on this thread, without progress.
        if n <= chunk {
            one(0, &mut out).map_err(of_state)?;
            return Ok(out);
        }
        let what = "evaluating states";
        let found = self.model.host().run_job(what, n, |job| {
            let chunks = out.par_chunks_mut(chunk * width).enumerate();
            let done = chunks.map(|(k, out)| {
                job.step(out.len() / width)?;
                Ok::<_, Error>(one(k, out))
            });
            done.collect::<Outcome<Vec<_>>>()
        })??;
        // The first state without a solution is reported, whichever core found one first.
        for result in found {
            result.map_err(of_state)?;
        }
        Ok(out)
    }

    /// A function at one state, faster than [`ModelFunctions::evaluate_at`]. `state` contains positions, rates,
    /// accelerations and forces of the drives; an input that the function does not read may be empty. The result is
    /// written to `out`. Returns false if [`ModelFunctions::evaluate_at`] must be used instead; `out` is then not
    /// valid. That method states faults, and can evaluate loops that are solved by Newton's method.
    ///
    /// Fails when the function cannot be derived.
    pub fn evaluate_single(
        &self,
        function: ModelFunction,
        state: [&[f64]; 4],
        values: &[f64],
        out: &mut [f64],
    ) -> Outcome<bool> {
        // Another thread evaluates a state: this one does not wait for it.
        let Ok(mut known) = self.single.try_lock() else {
            return Ok(false);
        };
        let is_it = |one: &PreparedSingle| {
            let is_independent = function == ModelFunction::Regressor;
            one.function == function && (is_independent || one.values == values)
        };
        let place = match known.iter().rposition(is_it) {
            Some(place) => {
                // The function that was not used for longest is dropped first.
                known[place..].rotate_left(1);
                known.len() - 1
            }
            None => {
                if known.len() >= MOST_SINGLE {
                    known.remove(0);
                }
                known.push(PreparedSingle {
                    function,
                    values: values.to_vec(),
                    program: self.single_program(function, values)?,
                    zeros: vec![0.0; self.model.active_coordinates().len()],
                });
                known.len() - 1
            }
        };
        let PreparedSingle { program, zeros, .. } = &mut known[place];
        // Programs have inputs for all of the motion; those that the function does not depend on are zero.
        let [has_rates, has_accelerations, _] = function.required_inputs();
        let [q, qd, qdd, forces] = state;
        let qd = if has_rates { qd } else { zeros.as_slice() };
        let qdd = if has_accelerations { qdd } else { zeros.as_slice() };
        Ok((program.as_mut()).is_some_and(|program| program.run([q, qd, qdd, forces], out)))
    }

    /// The program of a function for single states, if it has one.
    ///
    /// Fails when the function cannot be derived.
    fn single_program(&self, function: ModelFunction, values: &[f64]) -> Outcome<Option<SingleStateFunction>> {
        if values.len() != self.model.base.len() {
            return Ok(None);
        }
        let evaluator = ModelEvaluator::new(&self.model.derivation);
        Ok(match function {
            ModelFunction::InverseDynamics => evaluator.single_inverse_dynamics(values),
            ModelFunction::Regressor => evaluator.single_regressor(),
            ModelFunction::MassMatrix => evaluator.single_mass_matrix(self.dynamics()?, values),
            ModelFunction::Bias => evaluator.single_bias(self.dynamics()?, values),
            ModelFunction::ForwardDynamics | ModelFunction::Reactions => None,
        })
    }

    /// A function as C source for many states ([`vectors_c`]), for callers with a C compiler. Base parameters are
    /// arguments of the function; all other values are those of the model.
    ///
    /// Fails for forward dynamics, which is not a list of assignments without branches, and for loops that are solved
    /// by Newton's method ([`Model::has_iterative_loops`]).
    pub fn vectors_c(&self, function: ModelFunction) -> Outcome<String> {
        let derivation = &self.model.derivation;
        if self.model.has_iterative_loops() || function == ModelFunction::ForwardDynamics {
            return Err(Error::input(format!(
                "{}: {} takes steps that depend on the state and is not compiled",
                self.model.path,
                if function == ModelFunction::ForwardDynamics {
                    "forward dynamics"
                } else {
                    "closing the loops by Newton's method"
                }
            )));
        }
        let program = match function {
            ModelFunction::InverseDynamics => &derivation.programs.inverse_dynamics,
            ModelFunction::Regressor => &derivation.programs.regressor,
            ModelFunction::MassMatrix => &self.dynamics()?.mass_matrix,
            ModelFunction::Bias | ModelFunction::ForwardDynamics => &self.dynamics()?.bias,
            ModelFunction::Reactions => &self.derived_reactions()?.program,
        };
        let width = self.shape(function)?.iter().product();
        Ok(vectors_c(derivation, program, width))
    }

    /// Positions, rates, accelerations and forces as far as the function reads them.
    ///
    /// Fails when one of them is missing or has another number of rows or columns.
    fn checked_inputs<'a>(
        &self,
        function: ModelFunction,
        given: &StateSamples<'a>,
    ) -> Outcome<[Option<StateMatrix<'a>>; 4]> {
        let (active, drives) = (self.model.active_coordinates().len(), self.model.row_names().len());
        // Effects that depend on the load need forces of the drives for every function.
        let [rates, accelerations, forces] = function.required_inputs();
        let by_load = self.model.load_dependent_effects();
        let n = given.q.len();
        let parts = [
            ("positions", Some(given.q), true, active),
            ("rates", given.qd, rates, active),
            ("accelerations", given.qdd, accelerations, active),
            (
                "forces of the drives",
                given.forces,
                forces || !by_load.is_empty(),
                drives,
            ),
        ];
        let mut found = [None; 4];
        for (slot, (name, rows, is_read, width)) in found.iter_mut().zip(parts) {
            match rows {
                _ if !is_read => {}
                None if name.starts_with("forces") && !forces => {
                    return Err(Error::input(format!(
                        "{} depends on the load: forces of the drives are needed in addition to the states",
                        by_load.join(", ")
                    )));
                }
                None => return Err(Error::input(format!("{name} are needed and not given"))),
                Some(rows) if rows.width != width || rows.numbers.len() != n * width => {
                    return Err(Error::input(format!(
                        "{name} have {} rows of {}; {n} rows of {width} are needed",
                        rows.len(),
                        rows.width
                    )));
                }
                Some(rows) => *slot = Some(rows),
            }
        }
        Ok(found)
    }

    /// The programs that a function needs, derived if this is their first use.
    ///
    /// Fails when a derivation fails or is cancelled.
    fn programs_for(&self, function: ModelFunction) -> Outcome<FunctionPrograms<'_>> {
        let needs_dynamics = matches!(
            function,
            ModelFunction::MassMatrix | ModelFunction::Bias | ModelFunction::ForwardDynamics
        );
        Ok(FunctionPrograms {
            evaluator: ModelEvaluator::new(&self.model.derivation),
            dynamics: needs_dynamics.then(|| self.dynamics()).transpose()?,
            reactions: (function == ModelFunction::Reactions)
                .then(|| self.derived_reactions())
                .transpose()?,
        })
    }

    /// The equation of motion, derived at its first use.
    ///
    /// Fails when the derivation fails or is cancelled.
    fn dynamics(&self) -> Outcome<&DynamicsPrograms> {
        if let Some(known) = self.dynamics.get() {
            return Ok(known);
        }
        let what = "deriving the equation of motion";
        let derived = (self.model.host()).run_job(what, 0, |_| self.model.derivation.dynamics())?;
        let derived = derived.map_err(|error| Error::derivation(&self.model.path, error))?;
        Ok(self.dynamics.get_or_init(|| derived))
    }

    /// The reactions, derived at their first use.
    ///
    /// Fails when the derivation fails or is cancelled.
    fn derived_reactions(&self) -> Outcome<&ReactionPrograms> {
        if let Some(known) = self.reactions.get() {
            return Ok(known);
        }
        let what = "deriving the reactions";
        let derived = (self.model.host()).run_job(what, 0, |_| self.model.derivation.reactions())?;
        let derived = derived.map_err(|error| Error::derivation(&self.model.path, error))?;
        Ok(self.reactions.get_or_init(|| derived))
    }
}

/// Writes a function at a range of states to `out`, one row for each state.
fn fill(
    function: ModelFunction,
    prepared: &FunctionPrograms<'_>,
    parts: &[Option<StateMatrix<'_>>; 4],
    states: &Range<usize>,
    values: &[f64],
    out: &mut [f64],
) -> Result<(), PoseFault> {
    let columns = parts.map(|rows| rows.map_or_else(Vec::new, |rows| rows.columns(states)));
    let zeros = vec![0.0; states.len()];
    let [q, qd, qdd, forces] = columns
        .each_ref()
        .map(|columns| columns.iter().map(Vec::as_slice).collect::<Vec<_>>());
    // The evaluator expects every input; those that the function does not read are zero.
    let all_zeros: Vec<&[f64]> = q.iter().map(|_| zeros.as_slice()).collect();
    let given = MotionStates {
        qd: if qd.is_empty() { all_zeros.clone() } else { qd },
        qdd: if qdd.is_empty() { all_zeros } else { qdd },
        q,
        load: forces.clone(),
    };
    let width = out.len() / states.len().max(1);
    let evaluator = &prepared.evaluator;
    let (dynamics, reactions) = (prepared.dynamics, prepared.reactions);
    let found = match (function, dynamics, reactions) {
        (ModelFunction::InverseDynamics, ..) => evaluator.inverse_dynamics(&given, values)?,
        (ModelFunction::MassMatrix, Some(dynamics), _) => evaluator.mass_matrix(dynamics, &given, values)?,
        (ModelFunction::Bias, Some(dynamics), _) => evaluator.bias(dynamics, &given, values)?,
        (ModelFunction::ForwardDynamics, Some(dynamics), _) => {
            evaluator.forward_dynamics(dynamics, &given, values, &forces)?
        }
        (ModelFunction::Reactions, _, Some(reactions)) => evaluator.reactions(reactions, &given)?,
        // The regressor is large: it is written block by block, without its columns in memory.
        (ModelFunction::Regressor, ..) => {
            let mut start = 0;
            return evaluator.regressor_blocks(&given, |len, columns| {
                scatter(columns, &mut out[start * width..(start + len) * width], start)?;
                start += len;
                Ok(())
            });
        }
        _ => unreachable!("the programs of a function are prepared before"),
    };
    let columns: Vec<&[f64]> = found.iter().map(Vec::as_slice).collect();
    scatter(&columns, out, 0)
}

/// Writes columns to rows of `out`; `first` is the state of the first row, for the place of a value that is not finite.
fn scatter(columns: &[&[f64]], out: &mut [f64], first: usize) -> Result<(), PoseFault> {
    for (k, row) in out.chunks_exact_mut(columns.len().max(1)).enumerate() {
        for (value, column) in row.iter_mut().zip(columns) {
            *value = column[k];
        }
        if row.iter().any(|value| !value.is_finite()) {
            return Err(PoseFault {
                sample: first + k,
                reason: PoseReason::Undefined,
            });
        }
    }
    Ok(())
}
