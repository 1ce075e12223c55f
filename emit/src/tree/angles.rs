//! The angles of a program that come before everything else.

use modelmill_codegen::{Op, Program, Stage};

/// Sines with their cosines whose angles need no other function, if there are several: they take much of the time of one
/// state, and less if they are computed at once.
pub(super) struct AnglesFirst {
    /// The sines; the cosine of each stands right before it.
    pub(super) sines: Vec<usize>,
    /// Which operations are written before all others: what the angles are made of.
    pub(super) done: Vec<bool>,
}

impl AnglesFirst {
    pub(super) fn of(program: &Program) -> Self {
        let n = program.ops.len();
        // What needs inputs and arithmetic alone.
        let mut plain = vec![false; n];
        let mut done = vec![false; n];
        let mut sines = Vec::new();
        for (i, op) in program.ops.iter().enumerate() {
            let mut of_plain = true;
            op.for_each_operand(|v| of_plain &= plain[v.index()]);
            let fixed = program.stages[i] == Stage::Fixed;
            let simple = matches!(
                op,
                Op::Number(_) | Op::Input(_) | Op::Add(..) | Op::Sub(..) | Op::Mul(..) | Op::Neg(_)
            );
            plain[i] = fixed || simple && of_plain;
            if let Op::Sin(a) = op
                && i > 0
                && program.ops[i - 1] == Op::Cos(*a)
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
    pub(super) fn in_order(self, order: &[usize]) -> Self {
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
