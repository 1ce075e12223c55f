//! Straight-line programs: the form that emission prints and the block evaluator runs.

use std::fmt;

#[cfg(any(test, feature = "json"))]
use serde::Serialize;

use crate::expr::{Atom, Rational, Unary};

/// Index of a value: that of the operation that computes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ValueId(u32);

impl ValueId {
    /// The value of the operation at a position.
    pub fn from_index(index: usize) -> Self {
        Self(u32::try_from(index).expect("programs below 4G operations"))
    }

    /// Position of its operation in [`StraightLineProgram::ops`].
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// One operation; its operands come before it in the program.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum ProgramOp {
    /// A number.
    Number(Rational),
    /// An input.
    Input(Atom),
    /// `a + b`
    Add(ValueId, ValueId),
    /// `a - b`
    Sub(ValueId, ValueId),
    /// `a * b`
    Mul(ValueId, ValueId),
    /// `a / b`
    Div(ValueId, ValueId),
    /// `-a`
    Neg(ValueId),
    /// A function of one argument.
    Unary(Unary, ValueId),
    /// Sine; the cosine of the same angle is usually the operation before.
    Sin(ValueId),
    /// Cosine.
    Cos(ValueId),
    /// Angle of the point (`x`, `y`), as `atan2(y, x)`; operands in the order y, x.
    Atan2(ValueId, ValueId),
}

impl ProgramOp {
    /// The same operation on the operands that `new` gives.
    #[must_use]
    pub fn map_operands(self, new: impl Fn(ValueId) -> ValueId) -> Self {
        match self {
            Self::Number(_) | Self::Input(_) => self,
            Self::Add(a, b) => Self::Add(new(a), new(b)),
            Self::Sub(a, b) => Self::Sub(new(a), new(b)),
            Self::Mul(a, b) => Self::Mul(new(a), new(b)),
            Self::Div(a, b) => Self::Div(new(a), new(b)),
            Self::Atan2(a, b) => Self::Atan2(new(a), new(b)),
            Self::Neg(a) => Self::Neg(new(a)),
            Self::Unary(f, a) => Self::Unary(f, new(a)),
            Self::Sin(a) => Self::Sin(new(a)),
            Self::Cos(a) => Self::Cos(new(a)),
        }
    }

    /// Calls `visit` for every operand, in order.
    pub fn for_each_operand(&self, mut visit: impl FnMut(ValueId)) {
        match self {
            Self::Number(_) | Self::Input(_) => {}
            Self::Add(a, b) | Self::Sub(a, b) | Self::Mul(a, b) | Self::Div(a, b) | Self::Atan2(a, b) => {
                visit(*a);
                visit(*b);
            }
            Self::Neg(a) | Self::Unary(_, a) | Self::Sin(a) | Self::Cos(a) => visit(*a),
        }
    }
}

/// When a value can be computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ProgramStage {
    /// Once for a geometry and a set of parameters.
    Fixed,
    /// At every state.
    State,
}

/// A determinant below this part of the magnitude of its terms counts as zero.
pub const SINGULAR: f64 = 1e-9;

/// A condition that a pose must satisfy for the model to have a solution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PoseGuard {
    /// The value must not be negative: otherwise the loops cannot close.
    Reachable(ValueId),
    /// The magnitude of the value must stay above 1e-9 of the second one, the fixed magnitude of its terms: otherwise
    /// the pose is singular.
    Regular(ValueId, ValueId),
    /// The value must be finite: otherwise a term of the model is undefined.
    Finite(ValueId),
}

impl PoseGuard {
    /// The guarded value.
    pub fn value(self) -> ValueId {
        match self {
            Self::Reachable(v) | Self::Regular(v, _) | Self::Finite(v) => v,
        }
    }

    /// The value to compare with, if there is one.
    pub fn reference_size(self) -> Option<ValueId> {
        match self {
            Self::Regular(_, size) => Some(size),
            Self::Reachable(_) | Self::Finite(_) => None,
        }
    }

    /// The guarded value and the value to compare with, if there is one.
    pub fn values(self) -> impl Iterator<Item = ValueId> {
        std::iter::once(self.value()).chain(self.reference_size())
    }

    /// Whether the condition is satisfied; `size` is the value to compare with. NaN never satisfies it.
    pub fn is_satisfied(self, value: f64, size: f64) -> bool {
        match self {
            Self::Reachable(_) => value >= 0.0,
            Self::Regular(..) => value.abs() > SINGULAR * size,
            Self::Finite(_) => value.is_finite(),
        }
    }
}

/// A program without branches and loops, with several outputs and conditions on the pose.
#[derive(Clone, Debug, Default)]
pub struct StraightLineProgram {
    /// Operations; operands come first.
    pub ops: Vec<ProgramOp>,
    /// Stage of each operation, in the order of `ops`.
    pub stages: Vec<ProgramStage>,
    /// Values that are returned, in the order of the program's documentation.
    pub outputs: Vec<ValueId>,
    /// Conditions on the pose, in the order in which faults are reported.
    pub guards: Vec<PoseGuard>,
}

impl StraightLineProgram {
    /// Which operations are needed by the guards and by those outputs whose index is `wanted`.
    pub(crate) fn needed_operations(&self, wanted: &dyn Fn(usize) -> bool) -> Vec<bool> {
        let mut needed = vec![false; self.ops.len()];
        // Outputs that are wanted, and all guards.
        let outputs = self.outputs.iter().enumerate();
        let outputs = outputs.filter(|(k, _)| wanted(*k)).map(|(_, value)| *value);
        let guards = self.guards.iter().flat_map(|guard| guard.values());
        for value in outputs.chain(guards) {
            needed[value.index()] = true;
        }
        // Backwards, so that the users of an operation are known before it.
        for (i, op) in self.ops.iter().enumerate().rev() {
            if needed[i] {
                op.for_each_operand(|v| needed[v.index()] = true);
            }
        }
        needed
    }
}

/// Operations per call. Changes of sign and precomputed values are not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(any(test, feature = "json"), derive(Serialize))]
pub struct OperationCount {
    /// Additions and subtractions.
    pub add: usize,
    /// Multiplications.
    pub mul: usize,
    /// Divisions.
    pub div: usize,
    /// Square roots.
    pub sqrt: usize,
    /// Pairs of sine and cosine of the same angle, and arc tangents.
    pub sincos: usize,
    /// Signs, absolute values, exponentials, hyperbolic tangents.
    #[cfg_attr(any(test, feature = "json"), serde(skip_serializing_if = "is_zero"))]
    pub other: usize,
}

/// Tells serde to leave out a count of zero.
#[cfg(any(test, feature = "json"))]
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde requires a reference")]
fn is_zero(n: &usize) -> bool {
    *n == 0
}

/// A list such as `12 additions, 9 multiplications, 1 division`; rare operations only if there are any.
impl fmt::Display for OperationCount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} additions, {} multiplications", self.add, self.mul)?;
        for (n, one, many) in [
            (self.div, "division", "divisions"),
            (self.sqrt, "square root", "square roots"),
            (self.sincos, "sine and cosine", "sines and cosines"),
            (self.other, "other function", "other functions"),
        ] {
            match n {
                0 => {}
                1 => write!(f, ", 1 {one}")?,
                _ => write!(f, ", {n} {many}")?,
            }
        }
        Ok(())
    }
}

impl StraightLineProgram {
    /// The same program without operations that no output and no guard needs.
    #[must_use]
    pub fn without_dead_code(self) -> Self {
        let mut needed = vec![false; self.ops.len()];
        for value in self
            .outputs
            .iter()
            .copied()
            .chain(self.guards.iter().flat_map(|g| g.values()))
        {
            needed[value.index()] = true;
        }
        for i in (0..self.ops.len()).rev() {
            if needed[i] {
                self.ops[i].for_each_operand(|operand| needed[operand.index()] = true);
            }
        }
        // The order of the remaining operations does not change.
        let kept: Vec<usize> = (0..self.ops.len()).filter(|i| needed[*i]).collect();
        self.reorder(&kept)
    }

    /// The same program with only its first `n` outputs. Conditions that other outputs are finite are removed.
    pub(crate) fn with_outputs(mut self, n: usize) -> Self {
        self.outputs.truncate(n);
        let outputs = &self.outputs;
        self.guards
            .retain(|guard| !matches!(guard, PoseGuard::Finite(v) if !outputs.contains(v)));
        self.without_dead_code()
    }

    /// The same program with the operations of `order`, in that order; operands must come before their users.
    #[must_use]
    pub fn reorder(&self, order: &[usize]) -> Self {
        // Position of each old value in the new program.
        let mut places: Vec<Option<ValueId>> = vec![None; self.ops.len()];
        let mut ordered = Self::default();
        for i in order {
            let op = self.ops[*i]
                .clone()
                .map_operands(|operand| places[operand.index()].expect("operands stand before what needs them"));
            let place = ordered.ops.len();
            places[*i] = Some(ValueId::from_index(place));
            ordered.ops.push(op);
            ordered.stages.push(self.stages[*i]);
        }
        // Outputs and guards refer to the new positions.
        let new = |value: &ValueId| places[value.index()].expect("outputs and guarded values are in the order");
        ordered.outputs = self.outputs.iter().map(new).collect();
        ordered.guards = self
            .guards
            .iter()
            .map(|guard| match guard {
                PoseGuard::Reachable(v) => PoseGuard::Reachable(new(v)),
                PoseGuard::Regular(v, size) => PoseGuard::Regular(new(v), new(size)),
                PoseGuard::Finite(v) => PoseGuard::Finite(new(v)),
            })
            .collect();
        ordered
    }

    /// Estimated cost per state in additions: a multiplication costs 1, a division or root 6, any other function 20.
    pub fn weight(&self) -> usize {
        let count = self.count_operations(ProgramStage::State);
        count.add + count.mul + 6 * (count.div + count.sqrt) + 20 * (count.sincos + count.other)
    }

    /// Counts the operations of one stage; sine and cosine of the same angle count as one.
    pub fn count_operations(&self, stage: ProgramStage) -> OperationCount {
        let mut count = OperationCount::default();
        // Angles whose sine or cosine is computed, each counted once.
        let mut angles = std::collections::BTreeSet::new();
        for (op, s) in self.ops.iter().zip(&self.stages) {
            if *s != stage {
                continue;
            }
            match op {
                ProgramOp::Add(..) | ProgramOp::Sub(..) => count.add += 1,
                ProgramOp::Mul(..) => count.mul += 1,
                ProgramOp::Div(..) => count.div += 1,
                ProgramOp::Unary(Unary::Sqrt, _) => count.sqrt += 1,
                ProgramOp::Sin(a) | ProgramOp::Cos(a) => _ = angles.insert(*a),
                ProgramOp::Atan2(..) => count.sincos += 1,
                ProgramOp::Unary(..) => count.other += 1,
                ProgramOp::Number(_) | ProgramOp::Input(_) | ProgramOp::Neg(_) => {}
            }
        }
        count.sincos += angles.len();
        count
    }
}
