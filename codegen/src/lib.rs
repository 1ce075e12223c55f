//! From a mechanism to its base parameters and fast code: the mill itself.

mod base;
mod closing;
mod closure;
mod dyad;
mod dynamics;
mod emit;
mod error;
mod evaluate;
mod exact;
pub mod expr;
pub mod field;
mod finite;
mod forms;
mod inertia;
mod linear;
mod linear_loops;
mod lower;
mod magnitude;
mod newton_euler;
mod numeric_pose;
mod passes;
mod programs;
mod projection;
mod reactions;
mod reduce;
mod regressor;
pub mod review;
mod rod;
mod self_test;
mod solvable;
mod spatial;
mod square;
mod torn;
mod tree;
mod vector;

use modelmill_spec::Mechanism;

pub use base::BaseParameter;
pub use dynamics::Dynamics;
pub use emit::{Emitted, EmittedFile, emit, emit_c, emit_python, emit_with_dynamics, module_name};
pub use error::DeriveError;
pub use evaluate::{Evaluator, PoseFault, PoseReason, States};
pub use exact::Monomial;
pub use lower::{Guard, Op, OperationCount, Program, Stage, ValueId};
pub use passes::PassCount;
pub use programs::{LoopPrograms, PassivePosition, Programs};
pub use reactions::{JointReaction, LoopReaction, Reactions};
pub use reduce::{Dependency, Method, Polynomial, Powers, RationalFunction, Reduction, Variable};

use expr::Graph;
use regressor::Equations;

/// Derives the columns of H for some products of parameters alone, each by itself and without reduction: what effects add
/// that a model may never have.
pub fn derive_columns(
    mechanism: &Mechanism,
    wanted: &dyn Fn(&Monomial) -> bool,
) -> Result<Derivation, DeriveError> {
    finite::check_values(mechanism)?;
    let mut graph = Graph::new();
    let equations = regressor::equations(&mut graph, mechanism)?;
    let reduction = reduce::unreduced(&equations.products, &equations.columns, wanted);
    let programs = programs::programs(&mut graph, mechanism, &equations, &reduction)?;
    Ok(Derivation {
        mechanism: mechanism.clone(),
        graph,
        reduction,
        programs,
        equations,
    })
}

/// Everything that the mill knows about a mechanism.
pub struct Derivation {
    /// The mechanism that was derived.
    pub mechanism: Mechanism,
    /// The arena of all expressions.
    pub graph: Graph,
    /// Which products are retained and how the others follow.
    pub reduction: Reduction,
    /// Straight-line programs, ready to be emitted or evaluated.
    pub programs: Programs,
    pub(crate) equations: Equations,
}

/// Derives the inverse dynamics of a mechanism and reduces it to base parameters, exactly.
pub fn derive(mechanism: &Mechanism) -> Result<Derivation, DeriveError> {
    finite::check_values(mechanism)?;
    let mut graph = Graph::new();
    let equations = regressor::equations(&mut graph, mechanism)?;
    let reduction = reduce::reduce(
        &mut graph,
        mechanism,
        &equations.projection,
        &equations.products,
        &equations.columns,
    )?;
    let programs = programs::programs(&mut graph, mechanism, &equations, &reduction)?;
    let derivation = Derivation {
        mechanism: mechanism.clone(),
        graph,
        reduction,
        programs,
        equations,
    };
    finite::check_results(&derivation)?;
    Ok(derivation)
}
