//! Functions of the constants as a black box, and a limit of the work that their evaluation may take.

use modelmill_algebra::field::{FieldElement, RandomStream};

use crate::DeriveError;
use crate::expr::FieldPoint;
use crate::stop::StopRequest;

/// Functions that can be evaluated in every prime field, but not inspected.
pub(crate) trait PrimeFieldOracle {
    /// Random constants at which the functions exist.
    ///
    /// # Errors
    /// [`DeriveError::NoPointFound`] if there are no such constants.
    fn constants<const P: u64>(&self, stream: &mut RandomStream) -> Result<FieldPoint<FieldElement<P>>, DeriveError>;
    /// Values of all functions for given constants.
    ///
    /// # Errors
    /// A [`DeriveError`] if a value does not exist, or if the operations are used up.
    fn values<const P: u64>(
        &mut self,
        constants: &FieldPoint<FieldElement<P>>,
    ) -> Result<Vec<FieldElement<P>>, DeriveError>;
    /// Announces operations in addition to the evaluation.
    ///
    /// # Errors
    /// [`DeriveError::FactorsTooLong`] if the limit is exceeded.
    fn charge(&mut self, operations: usize) -> Result<(), DeriveError>;
}

/// Number of field operations that may still be done. A limit in seconds would give different results on different
/// machines.
#[derive(Clone, Debug)]
pub(super) struct OperationBudget<'a> {
    /// The limit.
    all: u64,
    /// Remaining operations.
    left: u64,
    /// The caller's request to stop before.
    stop: StopRequest<'a>,
}

impl<'a> OperationBudget<'a> {
    /// A budget of some operations, none of them used, that ends once `stop` is requested.
    pub(super) fn new(operations: u64, stop: StopRequest<'a>) -> Self {
        Self {
            all: operations,
            left: operations,
            stop,
        }
    }

    /// Uses some operations; an error if fewer remain, or the caller requested to stop.
    pub(super) fn spend(&mut self, operations: usize) -> Result<(), DeriveError> {
        self.stop.check()?;
        let operations = u64::try_from(operations).unwrap_or(u64::MAX);
        let left = self.left.checked_sub(operations);
        self.left = left.ok_or(DeriveError::FactorsTooLong { operations: self.all })?;
        Ok(())
    }
}

/// A way in which a constant occurs: its index, and whether it is in sines and cosines. A constant that occurs in both
/// ways counts as two, because no rational function relates a number to its sine.
pub(crate) type ConstantOccurrence = (usize, bool);
