//! Functions of the constants as a black box, and how much work may go into asking it.

use modelmill_algebra::field::{FieldElement, RandomStream};

use crate::DeriveError;
use crate::expr::FieldPoint;

/// A black box in every prime field.
pub(crate) trait PrimeFieldOracle {
    /// Random constants.
    fn constants<const P: u64>(
        &self,
        stream: &mut RandomStream,
    ) -> Result<FieldPoint<FieldElement<P>>, DeriveError>;
    /// Values of all functions at given constants.
    fn values<const P: u64>(
        &mut self,
        constants: &FieldPoint<FieldElement<P>>,
    ) -> Result<Vec<FieldElement<P>>, DeriveError>;
    /// Says that so many operations will be done beside evaluation; an error where they are too many.
    fn charge(&mut self, operations: usize) -> Result<(), DeriveError>;
}

/// How many operations of the field may still be done. Time would differ from machine to machine, and with it the result.
#[derive(Clone, Debug)]
pub(super) struct OperationBudget {
    all: u64,
    left: u64,
}

impl OperationBudget {
    pub(super) fn new(operations: u64) -> Self {
        Self {
            all: operations,
            left: operations,
        }
    }

    pub(super) fn spend(&mut self, operations: usize) -> Result<(), DeriveError> {
        let operations = u64::try_from(operations).unwrap_or(u64::MAX);
        let left = self.left.checked_sub(operations);
        self.left = left.ok_or(DeriveError::FactorsTooLong {
            operations: self.all,
        })?;
        Ok(())
    }
}

/// A way in which a constant occurs, by index and whether inside sines and cosines. A constant that occurs in both ways
/// counts as two: no rational function ties a number to its sine.
pub(crate) type ConstantOccurrence = (usize, bool);
