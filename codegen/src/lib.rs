//! Derivation: from a mechanism to its base parameters, equations and straight-line programs. `modelmill-emit` writes code of them.

mod derive;
mod error;
mod evaluate;
pub mod expr;
mod loops;
mod lower;
pub mod names;
mod newton_euler;
mod on_request;
mod programs;
mod reduce;
mod regressor;
#[cfg(any(test, feature = "review"))]
pub mod review;
mod tree;

pub use derive::base::BaseParameterEntry;
pub use derive::{BaseFormulas, Derivation, derive_columns};
pub use error::DeriveError;
pub use evaluate::{ModelEvaluator, MotionStates, PoseFault, PoseReason};
pub use lower::{
    OperationCount, PoseGuard, ProgramOp, ProgramStage, SINGULAR, StraightLineProgram, ValueId,
};
pub use modelmill_algebra::field;
pub use on_request::dynamics::DynamicsPrograms;
pub use on_request::passes::PassCount;
pub use on_request::reactions::{JointReaction, LoopReaction, ReactionPrograms};
pub use programs::{LoopPrograms, ModelPrograms, PassivePosition};
pub use reduce::base::BaseDenominator;
pub use reduce::{
    BaseReduction, ColumnDependency, FactorVariable, PowerProduct, RationalFunction,
    ReductionMethod, TrigonometricPolynomial,
};
pub use tree::expressions::ParameterMonomial;

use modelmill_spec::Mechanism;

/// Derives the inverse dynamics of a mechanism and reduces it to base parameters, exactly where that can be done.
///
/// A base whose columns all but depend on each other at the file's values, so that its forces are wrong, is refused.
pub fn derive(mechanism: &Mechanism) -> Result<Derivation, DeriveError> {
    let derivation = derive::derive(mechanism)?;
    evaluate::lost_digits::check_lost_digits(&derivation)?;
    Ok(derivation)
}
