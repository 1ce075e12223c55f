//! From a mechanism to its base parameters, equations and straight-line programs: the mill itself. `modelmill-emit` writes code
//! of them.

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
pub mod review;
mod tree;

pub use derive::base::BaseParameter;
pub use derive::{BaseFormulas, Derivation, derive_columns};
pub use error::DeriveError;
pub use evaluate::{Evaluator, PoseFault, PoseReason, States};
pub use lower::{Guard, Op, OperationCount, Program, SINGULAR, Stage, ValueId};
pub use modelmill_algebra::field;
pub use on_request::dynamics::Dynamics;
pub use on_request::passes::PassCount;
pub use on_request::reactions::{JointReaction, LoopReaction, Reactions};
pub use programs::{LoopPrograms, PassivePosition, Programs};
pub use reduce::base::BaseDenominator;
pub use reduce::{Dependency, Method, Polynomial, Powers, RationalFunction, Reduction, Variable};
pub use tree::expressions::Monomial;

use modelmill_spec::Mechanism;

/// Derives the inverse dynamics of a mechanism and reduces it to base parameters, exactly where that can be done.
///
/// A base whose columns all but depend on each other at the file's values, so that its forces are wrong, is refused.
pub fn derive(mechanism: &Mechanism) -> Result<Derivation, DeriveError> {
    let derivation = derive::derive(mechanism)?;
    evaluate::lost_digits::check(&derivation)?;
    Ok(derivation)
}
