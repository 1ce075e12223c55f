//! The angles whose sines and cosines a program computes before anything else.

use modelmill_codegen::{ProgramOp, ProgramStage, StraightLineProgram};

/// Pairs of sine and cosine whose angles need only arithmetic. They take much of the time of one state, and less if
/// they are computed together. Empty if there is only one.
pub(super) struct LeadingAngles {
    /// Indices of the sines; the cosine of each is the operation before.
    pub(super) sines: Vec<usize>,
    /// Operations that are written before all others, because the angles depend on them.
    pub(super) done: Vec<bool>,
}

impl LeadingAngles {
    /// Finds the pairs of a program.
    pub(super) fn from_program(program: &StraightLineProgram) -> Self {
        let n = program.ops.len();
        // Values that depend on inputs by sums, products and signs only.
        let mut plain = vec![false; n];
        let mut done = vec![false; n];
        let mut sines = Vec::new();
        for (i, op) in program.ops.iter().enumerate() {
            let mut of_plain = true;
            op.for_each_operand(|v| of_plain &= plain[v.index()]);
            // Fixed values are available before the state.
            let fixed = program.stages[i] == ProgramStage::Fixed;
            let simple = matches!(
                op,
                ProgramOp::Number(_)
                    | ProgramOp::Input(_)
                    | ProgramOp::Add(..)
                    | ProgramOp::Sub(..)
                    | ProgramOp::Mul(..)
                    | ProgramOp::Neg(_)
            );
            plain[i] = fixed || simple && of_plain;
            // A pair of cosine and sine.
            if let ProgramOp::Sin(a) = op
                && i > 0
                && program.ops[i - 1] == ProgramOp::Cos(*a)
                && of_plain
                && !fixed
            {
                sines.push(i);
                done[a.index()] = true;
            }
        }
        // One pair gains nothing.
        if sines.len() < 2 {
            return Self {
                sines: Vec::new(),
                done: vec![false; n],
            };
        }
        // All operands of the angles come first as well.
        for i in (0..n).rev() {
            if done[i] {
                program.ops[i].for_each_operand(|v| done[v.index()] = true);
            }
        }
        Self { sines, done }
    }

    /// The same after the operations have been permuted.
    pub(super) fn reorder(self, order: &[usize]) -> Self {
        let mut place = vec![0; self.done.len()];
        for (k, i) in order.iter().enumerate() {
            place[*i] = k;
        }
        Self {
            sines: self.sines.iter().map(|i| place[*i]).collect(),
            done: order.iter().map(|i| self.done[*i]).collect(),
        }
    }
}
