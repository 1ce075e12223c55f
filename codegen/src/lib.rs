//! From a mechanism to its base parameters and fast code: the mill itself.

mod derive;
mod emit;
mod error;
mod evaluate;
pub mod expr;
mod loops;
mod lower;
mod newton_euler;
mod on_request;
mod programs;
mod reduce;
mod regressor;
#[cfg(any(test, feature = "review"))]
pub mod review;
mod tree;

pub use derive::base::BaseParameter;
pub use derive::{Derivation, derive_columns};
pub use emit::{
    Emitted, EmittedFile, Form, LANGUAGES, Language, Source, emit, emit_with_dynamics, module_name,
    vectors_c,
};
pub use error::DeriveError;
pub use evaluate::{Evaluator, PoseFault, PoseReason, States};
pub use lower::{Guard, Op, OperationCount, Program, Stage, ValueId};
pub use modelmill_algebra::field;
pub use on_request::dynamics::Dynamics;
pub use on_request::passes::PassCount;
pub use on_request::reactions::{JointReaction, LoopReaction, Reactions};
pub use programs::{LoopPrograms, PassivePosition, Programs};
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
