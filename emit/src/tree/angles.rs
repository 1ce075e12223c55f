//! The angles of a program that come before everything else.

use modelmill_codegen::{ProgramOp, ProgramStage, StraightLineProgram};

/// Sines with their cosines whose angles need no other function, if there are several: they take much of the time of one
/// state, and less if they are computed at once.
pub(super) struct LeadingAngles {
    /// The sines; the cosine of each stands right before it.
    pub(super) sines: Vec<usize>,
    /// Which operations are written before all others: what the angles are made of.
    pub(super) done: Vec<bool>,
}

impl LeadingAngles {
    pub(super) fn from_program(program: &StraightLineProgram) -> Self {
        let n = program.ops.len();
        // What needs inputs and arithmetic alone.
        let mut plain = vec![false; n];
        let mut done = vec![false; n];
        let mut sines = Vec::new();
        for (i, op) in program.ops.iter().enumerate() {
            let mut of_plain = true;
            op.for_each_operand(|v| of_plain &= plain[v.index()]);
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
        if sines.len() < 2 {
            return Self {
                sines: Vec::new(),
                done: vec![false; n],
            };
        }
        for i in (0..n).rev() {
            if done[i] {
                program.ops[i].for_each_operand(|v| done[v.index()] = true);
            }
        }
        Self { sines, done }
    }

    /// The same where operations stand in another order.
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
