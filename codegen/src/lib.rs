//! From a mechanism to its base parameters and fast code: derivation, reduction, straight-line programs and emitted
//! modules.
//!
//! A `Mechanism` goes in, a `Derivation` comes out. The stages: `tree` and `loops` (kinematics as expressions),
//! `newton_euler`
//! and `regressor` (forces, linear in p_g), `reduce` (base parameters), `programs` and `lower` (straight-line
//! programs); `emit`, `evaluate`, `review` and `on_request` read the result.
//!
//! Decision: this crate reads the validated `Mechanism` of `modelmill-spec` and no TOML. A second tree of types
//! with the same content would only be copied.

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
mod stop;
mod tree;

pub use derive::base::BaseParameterEntry;
pub use derive::{BaseFormulas, Derivation, derive_columns};
pub use error::DeriveError;
pub use evaluate::{ModelEvaluator, MotionStates, PoseFault, PoseReason, SingleStateFunction};
pub use lower::{OperationCount, PoseGuard, ProgramOp, ProgramStage, SINGULAR, StraightLineProgram, ValueId};
pub use modelmill_algebra::field;
pub use on_request::dynamics::DynamicsPrograms;
pub use on_request::passes::PassCount;
pub use on_request::reactions::{JointReaction, LoopReaction, ReactionPrograms};
pub use programs::{LoopPrograms, ModelPrograms, PassivePosition};
pub use reduce::base::BaseDenominator;
pub use reduce::{
    BaseReduction, ColumnDependency, FactorVariable, PowerProduct, RationalFunction, ReductionMethod,
    TrigonometricPolynomial,
};
pub use stop::StopRequest;
pub use tree::expressions::ParameterMonomial;

use modelmill_spec::Mechanism;

/// Derives the inverse dynamics of a mechanism and reduces it to base parameters, in exact arithmetic where possible.
///
/// A base is refused when its columns are almost dependent at the file's values, because its forces would be wrong.
pub fn derive(mechanism: &Mechanism) -> Result<Derivation, DeriveError> {
    derive_until(mechanism, StopRequest::NEVER)
}

/// The same; fails with [`DeriveError::Stopped`] once `stop` is requested.
pub fn derive_until(mechanism: &Mechanism, stop: StopRequest<'_>) -> Result<Derivation, DeriveError> {
    let derivation = derive::derive(mechanism, stop)?;
    evaluate::lost_digits::check_lost_digits(&derivation)?;
    Ok(derivation)
}
