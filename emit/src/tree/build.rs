//! From a lowered program to statements: which values are inlined, what the others are called, and in which order they
//! stand.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_codegen::expr::Atom;
use modelmill_codegen::names::QuantityName;
use modelmill_codegen::{PoseGuard, ProgramOp, ProgramStage, StraightLineProgram, ValueId};

use super::angles::LeadingAngles;
use super::order::order;
use super::regroup::{group_statements, without_empty, without_unread};
use super::scope::{NameScope, unique_name};
use super::{CodeExpression, CodeStatement, PoseCheck, RequestedAngle, StatementRoutine};
/// Widest formula in characters, with the names in it, before it is divided; lines of an emitted method then have at
/// most 100 characters.
const WIDEST: usize = 80;

/// Comment on the size with which a test of singularity compares.
const SCALE_NOTE: &str = "scale for the test of singularity";

/// Name of the array of angles whose sines and cosines are computed together.
pub(crate) const ANGLES: &str = "angles";

impl StatementRoutine {
    /// The statements of a program. `outputs` are names for its results, possibly none.
    pub(crate) fn new(program: &StraightLineProgram, scope: &NameScope, outputs: &[String]) -> Self {
        Self::with_result_names(program, scope, outputs, false)
    }

    /// As `new`; with `results_have_names`, every result is a named value, so that other programs can refer to it.
    pub(super) fn with_result_names(
        program: &StraightLineProgram,
        scope: &NameScope,
        outputs: &[String],
        results_have_names: bool,
    ) -> Self {
        // Names, inlining and sections are decided on the program in its original order.
        // Names that this program may not use.
        let mut taken = scope.reserved_names_in(program);
        let first = LeadingAngles::from_program(program);
        let mut named = name_values(program, scope, outputs, &mut taken);
        let guard_scales = name_guard_scales(program, scope, &mut named, &mut taken);
        let inside = inlined_values(program, &named, scope);
        let last = (!results_have_names).then_some(scope.sections.force_section());
        let sections = scope.sections.value_sections(program, &inside, &named, last);
        let turns_signs = sections.is_some();
        let sections = sections.unwrap_or_else(|| vec![0; program.ops.len()]);
        // Everything is then permuted to the order in which it is written.
        let order = order(program, &inside, &first.done, &sections);
        let mut place = vec![0; order.len()];
        for (k, i) in order.iter().enumerate() {
            place[*i] = k;
        }
        // All tables in the new order.
        let mut builder = Builder {
            scope,
            taken,
            uses: Vec::new(),
            by_state: Vec::new(),
            outputs: vec![false; order.len()],
            inside: order.iter().map(|i| inside[*i]).collect(),
            named: named.into_iter().map(|(i, name)| (place[i], name)).collect(),
            first: first.reorder(&order),
            values: vec![None; order.len()],
            next: [0; 2],
            guard_scales: guard_scales.into_iter().map(|i| place[i]).collect(),
            sections: order.iter().map(|i| sections[*i]).collect(),
            turns_signs,
            results_have_names,
            program: program.reorder(&order),
        };
        (builder.uses, builder.by_state) = count_uses(&builder.program);
        // Mark the outputs.
        for v in &builder.program.outputs {
            builder.outputs[v.index()] = true;
        }
        builder.routine().with_entry_names(outputs)
    }
}

/// Number of uses of each value, with sine and cosine of an angle counted as one use, and whether an operation of a
/// state uses it.
fn count_uses(program: &StraightLineProgram) -> (Vec<usize>, Vec<bool>) {
    let n = program.ops.len();
    let (mut uses, mut by_state) = (vec![0; n], vec![false; n]);
    // The sine of a pair is not counted, because the cosine reads the same angle.
    for (i, op) in program.ops.iter().enumerate() {
        if is_pair(&program.ops, i) {
            continue;
        }
        op.for_each_operand(|v| {
            uses[v.index()] += 1;
            by_state[v.index()] |= program.stages[i] == ProgramStage::State;
        });
    }
    // An output counts as a use.
    for v in &program.outputs {
        uses[v.index()] += 1;
        by_state[v.index()] = true;
    }
    for v in program.guards.iter().flat_map(|guard| guard.values()) {
        // Counted twice, so that a guarded value gets a name.
        uses[v.index()] += 2;
        by_state[v.index()] = true;
    }
    (uses, by_state)
}

/// Whether an operation is the sine that follows the cosine of the same angle.
fn is_pair(ops: &[ProgramOp], i: usize) -> bool {
    matches!((&ops[i], i.checked_sub(1).map(|j| &ops[j])), (ProgramOp::Sin(a), Some(ProgramOp::Cos(b))) if a == b)
}

/// Whether an operation is inlined at every use: numbers and inputs.
fn is_leaf(op: &ProgramOp) -> bool {
    matches!(op, ProgramOp::Number(_) | ProgramOp::Input(_))
}

/// The name of a value, and whether the name stands for its negative.
#[derive(Clone, Debug)]
pub(super) struct NamedValue {
    /// The name.
    pub(super) name: String,
    /// Whether the named quantity is minus the value.
    negative: bool,
}

/// Names of results and of values that are known quantities, by index. Results have precedence.
fn name_values(
    program: &StraightLineProgram,
    scope: &NameScope,
    outputs: &[String],
    taken: &mut BTreeSet<String>,
) -> BTreeMap<usize, NamedValue> {
    let mut named = BTreeMap::new();
    // Names of the inputs that this program reads.
    let read: BTreeSet<&str> = (program.ops.iter())
        .filter_map(|op| match op {
            ProgramOp::Input(atom) => Some(scope.input_name(*atom)),
            _ => None,
        })
        .collect();
    // Results first, with the names that were given.
    for (v, name) in program.outputs.iter().zip(outputs) {
        // A result may have the name of an input that this program does not read.
        if !read.contains(name.as_str()) && scope.is_input(name) {
            taken.remove(name);
        }
        let i = v.index();
        // Numbers, inputs and their negatives need no name.
        let plain = is_leaf(&program.ops[i]) || matches!(program.ops[i], ProgramOp::Neg(_));
        if !plain && !named.contains_key(&i) {
            let name = unique_name(name, taken);
            let negative = false;
            named.insert(i, NamedValue { name, negative });
        }
    }
    // Then the known quantities.
    for (i, meaning) in scope.meanings.name_values(program) {
        if named.contains_key(&i) {
            continue;
        }
        let QuantityName { symbol, negative } = meaning;
        // The negative of a square would need another operation, so the square is named after its base.
        let squared = match program.ops[i] {
            ProgramOp::Mul(a, b) if a == b && negative => match &program.ops[a.index()] {
                ProgramOp::Input(atom) => Some(scope.input_name(*atom)),
                _ => named.get(&a.index()).map(|named| named.name.as_str()),
            },
            _ => None,
        };
        let (name, negative) = match squared {
            Some(base) => (format!("{base}_sq"), false),
            None => (symbol.text(), negative),
        };
        let name = unique_name(&name, taken);
        named.insert(i, NamedValue { name, negative });
    }
    named
}

/// Names the sizes with which tests of singularity compare: `scale_Delta_1` for a determinant `Delta_1`. Returns their
/// indices.
fn name_guard_scales(
    program: &StraightLineProgram,
    scope: &NameScope,
    named: &mut BTreeMap<usize, NamedValue>,
    taken: &mut BTreeSet<String>,
) -> BTreeSet<usize> {
    let mut scales = BTreeSet::new();
    for guard in &program.guards {
        let PoseGuard::Regular(value, size) = guard else {
            continue;
        };
        let i = size.index();
        if is_leaf(&program.ops[i]) || named.contains_key(&i) {
            continue;
        }
        // The sign of the compared value has no effect.
        let compared = match program.ops[value.index()] {
            ProgramOp::Neg(a) => a.index(),
            _ => value.index(),
        };
        let compared = match &program.ops[compared] {
            ProgramOp::Input(atom) => Some(scope.input_name(*atom)),
            _ => named.get(&compared).map(|named| named.name.as_str()),
        };
        let name = compared.map_or("scale".to_owned(), |compared| format!("scale_{compared}"));
        let name = unique_name(&name, taken);
        named.insert(i, NamedValue { name, negative: false });
        scales.insert(i);
    }
    scales
}

/// Which values are written inside the only formula that uses them.
fn inlined_values(program: &StraightLineProgram, named: &BTreeMap<usize, NamedValue>, scope: &NameScope) -> Vec<bool> {
    let n = program.ops.len();
    let (uses, by_state) = count_uses(program);
    let mut inside = vec![false; n];
    // Width in characters of each formula, with the names of its operands.
    let mut width = vec![0_usize; n];
    for (i, op) in program.ops.iter().enumerate() {
        // Width of the operator or function.
        let own = match op {
            ProgramOp::Number(value) => value.to_f64().to_string().len(),
            ProgramOp::Input(atom) => scope.input_name(*atom).len(),
            ProgramOp::Neg(_) => 1,
            ProgramOp::Unary(..) | ProgramOp::Sin(_) | ProgramOp::Cos(_) | ProgramOp::Atan2(..) => 8,
            ProgramOp::Add(..) | ProgramOp::Sub(..) | ProgramOp::Mul(..) | ProgramOp::Div(..) => 3,
        };
        // Operands that are inlined here, for the case that the formula is too wide.
        let mut open = Vec::new();
        // The name of the formula stands on the same line.
        let widest = WIDEST - named.get(&i).map_or(3, |n| n.name.len()).min(50);
        let mut total = own;
        op.for_each_operand(|v| {
            let k = v.index();
            // Sines and cosines always have names.
            let sine = matches!(program.ops[k], ProgramOp::Sin(_) | ProgramOp::Cos(_));
            // A value is inlined only in an operation of the same stage.
            let same_time = program.stages[k] == program.stages[i];
            let negation = matches!(program.ops[k], ProgramOp::Neg(_)) && same_time;
            let once = uses[k] == 1 && !named.contains_key(&k) && !sine && same_time;
            // Numbers and inputs are always written in place.
            if is_leaf(&program.ops[k]) {
                total += width[k];
            } else if (once || negation) && !(by_state[k] && program.stages[k] == ProgramStage::Fixed) {
                inside[k] = once;
                total += width[k];
                if once {
                    open.push(k);
                }
            } else {
                total += named.get(&k).map_or(3, |n| n.name.len());
            }
        });
        // If the formula is too wide, its widest operands become statements of their own.
        open.sort_by_key(|k| width[*k]);
        while total > widest
            && let Some(k) = open.pop()
            && width[k] > 12
        {
            inside[k] = false;
            total = total + 3 - width[k].min(total);
        }
        width[i] = total;
    }
    inside
}

/// State of the conversion of one program.
struct Builder<'a> {
    /// Names of inputs, quantities and sections.
    scope: &'a NameScope,
    /// The program, in the order in which it is written.
    program: StraightLineProgram,
    /// Names that may not be used again.
    taken: BTreeSet<String>,
    /// Number of uses per value.
    uses: Vec<usize>,
    /// Whether an operation of a state uses the value.
    by_state: Vec<bool>,
    /// Whether a value is an output.
    outputs: Vec<bool>,
    /// Whether a value is inlined.
    inside: Vec<bool>,
    /// Names of values.
    named: BTreeMap<usize, NamedValue>,
    /// The angles that are computed first.
    first: LeadingAngles,
    /// Values that are the scale of a test of singularity.
    guard_scales: BTreeSet<usize>,
    /// The section of each value.
    sections: Vec<usize>,
    /// Whether values get the sign of the quantity that names them. In long programs the signs decide which pairs of
    /// operations a compiler finds. These programs keep the signs of the recursion, and use a name only where its sign
    /// agrees.
    turns_signs: bool,
    /// Whether every output is a named value.
    results_have_names: bool,
    /// The expression by which each value is referred to, once it is written.
    values: Vec<Option<CodeExpression>>,
    /// Counters of generated names, for fixed values and values of a state.
    next: [usize; 2],
}

impl Builder<'_> {
    /// Writes all values and returns the statements of both stages.
    fn routine(mut self) -> StatementRoutine {
        // Fixed values first.
        let mut once = Vec::new();
        let mut kept = Vec::new();
        for i in 0..self.program.ops.len() {
            if self.program.stages[i] != ProgramStage::Fixed {
                continue;
            }
            self.write_value(i, &mut once);
        }
        // The precomputed values are collected afterwards, because a cosine gets its name when the sine after it is
        // written.
        for (i, value) in self.values.iter().enumerate() {
            if self.program.stages[i] == ProgramStage::Fixed
                && !is_leaf(&self.program.ops[i])
                && self.by_state[i]
                && let Some(value) = value
            {
                value.for_each_name(&mut |name| kept.push(name.to_owned()));
            }
        }
        // Then the state: angles, fixed outputs, and all other values with their guards and outputs.
        let mut state = self.write_leading_angles();
        // Outputs by the value that they are.
        let mut puts: Vec<Vec<usize>> = vec![Vec::new(); self.program.ops.len()];
        for (k, v) in self.program.outputs.iter().enumerate() {
            puts[v.index()].push(k);
        }
        for (i, outputs) in puts.iter().enumerate() {
            let zero = matches!(&self.program.ops[i], ProgramOp::Number(x) if x.is_zero());
            if self.program.stages[i] == ProgramStage::Fixed && !zero {
                self.put_outputs(i, outputs, &mut state);
            }
        }
        // Guards that have not been written yet.
        let mut guards = self.program.guards.clone();
        let mut section = 0;
        // Statements of the state in order.
        for i in 0..self.program.ops.len() {
            if self.program.stages[i] == ProgramStage::Fixed {
                continue;
            }
            // A heading is written when the section changes.
            let headed = self.scope.sections.heading(self.sections[i]);
            if let Some(heading) = headed.filter(|_| self.sections[i] != section) {
                state.push(CodeStatement::Section(heading.to_owned()));
                section = self.sections[i];
            }
            if !self.first.done[i] {
                self.write_value(i, &mut state);
            }
            // A cosine is written together with the sine after it; guards and outputs wait for that.
            if i + 1 < self.program.ops.len() && is_pair(&self.program.ops, i + 1) {
                continue;
            }
            // A guard follows the last of its values directly.
            guards.retain(|guard| {
                let ready = guard.values().all(|v| v.index() <= i);
                if ready {
                    let check = self.pose_check(*guard);
                    state.push(CodeStatement::Guard(check));
                }
                !ready
            });
            if is_pair(&self.program.ops, i) {
                self.put_outputs(i - 1, &puts[i - 1], &mut state);
            }
            self.put_outputs(i, &puts[i], &mut state);
        }
        // Headings and names that are not read any more are removed at the end.
        let (read_once, read) = self.reads();
        let results = self.results();
        StatementRoutine {
            once,
            kept,
            state: group_statements(without_empty(without_unread(state, &results)), &[]),
            read_once,
            read,
            results,
            n_outputs: self.program.outputs.len(),
        }
    }

    /// The expressions of the outputs after all statements.
    fn results(&self) -> Vec<CodeExpression> {
        self.program
            .outputs
            .iter()
            .map(|v| self.operand_expression(*v))
            .collect()
    }

    /// Inputs that fixed statements read, and inputs that statements of a state read.
    fn reads(&self) -> (BTreeSet<Atom>, BTreeSet<Atom>) {
        let mut reads = (BTreeSet::new(), BTreeSet::new());
        for (i, op) in self.program.ops.iter().enumerate() {
            op.for_each_operand(|v| {
                if let ProgramOp::Input(atom) = self.program.ops[v.index()] {
                    match self.program.stages[i] {
                        ProgramStage::Fixed => reads.0.insert(atom),
                        ProgramStage::State => reads.1.insert(atom),
                    };
                }
            });
        }
        let guarded = self.program.guards.iter().flat_map(|guard| guard.values());
        for v in self.program.outputs.iter().copied().chain(guarded) {
            if let ProgramOp::Input(atom) = self.program.ops[v.index()] {
                reads.1.insert(atom);
            }
        }
        reads
    }

    /// Appends the statements that store a value in its outputs.
    fn put_outputs(&self, i: usize, outputs: &[usize], statements: &mut Vec<CodeStatement>) {
        for k in outputs {
            statements.push(CodeStatement::Put {
                output: *k,
                value: self.value_expression(i).normalize_sign(),
                entry: String::new(),
            });
        }
    }

    /// The expression of a value; it must have been written.
    fn value_expression(&self, i: usize) -> CodeExpression {
        // Operands come first in the order.
        let value = self.values[i].clone();
        value.expect("operands stand before what needs them")
    }

    /// The expression of an operand.
    fn operand_expression(&self, v: ValueId) -> CodeExpression {
        self.value_expression(v.index())
    }

    /// Writes one value: as a statement if it has a name, else as an expression for its users.
    fn write_value(&mut self, i: usize, statements: &mut Vec<CodeStatement>) {
        let op = self.program.ops[i].clone();
        let value = match &op {
            ProgramOp::Number(value) => CodeExpression::number(value),
            ProgramOp::Input(atom) => self.scope.input_expression(*atom),
            ProgramOp::Add(a, b) => CodeExpression::add(self.operand_expression(*a), self.operand_expression(*b)),
            ProgramOp::Sub(a, b) => CodeExpression::sub(self.operand_expression(*a), self.operand_expression(*b)),
            ProgramOp::Mul(a, b) => CodeExpression::mul(self.operand_expression(*a), self.operand_expression(*b)),
            ProgramOp::Div(a, b) => CodeExpression::div(self.operand_expression(*a), self.operand_expression(*b)),
            ProgramOp::Neg(a) => CodeExpression::neg(self.operand_expression(*a)),
            ProgramOp::Unary(function, a) => CodeExpression::call(*function, self.operand_expression(*a)),
            ProgramOp::Atan2(y, x) => CodeExpression::atan2(self.operand_expression(*y), self.operand_expression(*x)),
            // Sines and cosines are written in pairs.
            ProgramOp::Sin(a) => return self.write_sine(i, *a, statements),
            // A cosine without a sine is written here; otherwise the sine writes both.
            ProgramOp::Cos(a) => {
                if !self
                    .program
                    .ops
                    .get(i + 1)
                    .is_some_and(|_| is_pair(&self.program.ops, i + 1))
                {
                    let cosine = self.angle_name(i, "c", *a);
                    self.values[i] = Some(CodeExpression::name(&cosine));
                    statements.push(CodeStatement::SinCos {
                        sine: None,
                        cosine: Some(cosine),
                        angle: self.operand_expression(*a),
                        requested: None,
                    });
                }
                return;
            }
        };
        // A value that is only an output is written in the statement that stores it.
        let only_put = self.uses[i] == 1 && self.outputs[i] && !self.named.contains_key(&i) && !self.results_have_names;
        // Whether the value is written at its uses only.
        let unnamed = is_leaf(&op)
            || self.inside[i]
            || only_put && !self.is_precomputed(i)
            || matches!(op, ProgramOp::Neg(_)) && !self.named.contains_key(&i) && !self.is_precomputed(i);
        if unnamed || (self.uses[i] == 0) {
            self.values[i] = Some(value);
            return;
        }
        // All others are named, with the sign chosen so that no extra operation is needed.
        let (name, value, turned) = self.choose_sign(i, value);
        // A comment names the equation on the page.
        let note = (self.guard_scales.contains(&i))
            .then(|| SCALE_NOTE.to_owned())
            .or_else(|| self.scope.value_note(&name));
        let written = CodeExpression::name(&name);
        statements.push(CodeStatement::Let { name, value, note });
        self.values[i] = Some(if turned { CodeExpression::neg(written) } else { written });
    }

    /// Name and expression of a statement, and whether the value is minus the named expression. A sign that would be an
    /// operation of its own is left to the users of the value.
    fn choose_sign(&mut self, i: usize, value: CodeExpression) -> (String, CodeExpression, bool) {
        // Fixed values are stored, so their sign must not be moved.
        let fixed = self.program.stages[i] == ProgramStage::Fixed;
        // A value without a meaning gets a generated name, and its sign is moved to its users.
        let Some(NamedValue { name, negative }) = self.named.get(&i).cloned() else {
            let name = self.next_name(i);
            return match value {
                CodeExpression::Neg(value) if !fixed => (name, *value, true),
                value => (name, value.normalize_sign(), false),
            };
        };
        // In long programs a name with the other sign is not used.
        if negative && !self.turns_signs && !fixed {
            return (self.next_name(i), value, false);
        }
        // The expression of the named quantity.
        let meant = if negative { CodeExpression::neg(value) } else { value };
        // Wrenches and Jacobians keep the sign of the equations.
        let keeps = fixed || ["F_", "M_", "J_"].iter().any(|start| name.starts_with(start));
        // A sign that cannot be absorbed gives the value a generated name instead.
        match meant.normalize_sign() {
            // The name would stand for the negative.
            CodeExpression::Neg(other) if !keeps => (self.next_name(i), *other, !negative),
            meant => (name, meant, negative),
        }
    }

    /// Whether a value is fixed and read at every state.
    fn is_precomputed(&self, i: usize) -> bool {
        self.program.stages[i] == ProgramStage::Fixed && self.by_state[i]
    }

    /// A generated name for a value without a meaning: `k1`, `x1`, ...
    fn next_name(&mut self, i: usize) -> String {
        let (letter, counter) = match self.program.stages[i] {
            ProgramStage::Fixed => ("k", 0),
            ProgramStage::State => ("x", 1),
        };
        loop {
            self.next[counter] += 1;
            let name = format!("{letter}{}", self.next[counter]);
            if self.taken.insert(name.clone()) {
                return name;
            }
        }
    }

    /// A name for a sine or cosine: `s_theta1`, `c_theta1`, ... Angles of more than three terms are called `angle`.
    fn angle_name(&mut self, i: usize, letter: &str, angle: ValueId) -> String {
        if let Some(named) = self.named.get(&i) {
            return named.name.clone();
        }
        // The names in the angle, joined.
        let mut parts = Vec::new();
        let mut terms = 0;
        self.operand_expression(angle).for_each_name(&mut |name| {
            terms += 1;
            parts.push(name.to_owned());
        });
        let name = if terms > 3 { "angle".to_owned() } else { parts.join("_") };
        unique_name(&format!("{letter}_{name}"), &mut self.taken)
    }

    /// Writes a sine, together with its cosine if that is the operation before.
    fn write_sine(&mut self, i: usize, angle: ValueId, statements: &mut Vec<CodeStatement>) {
        // The cosine gets its name here.
        let cosine = is_pair(&self.program.ops, i).then(|| {
            let name = self.angle_name(i - 1, "c", angle);
            self.values[i - 1] = Some(CodeExpression::name(&name));
            name
        });
        let sine = self.angle_name(i, "s", angle);
        self.values[i] = Some(CodeExpression::name(&sine));
        // Its position among the angles that are computed together.
        let asked = self.first.sines.iter().position(|sine| *sine == i);
        statements.push(CodeStatement::SinCos {
            angle: self.operand_expression(angle),
            sine: Some(sine),
            cosine,
            requested: asked,
        });
    }

    /// The statements that compute the angles of all sines and cosines that come first.
    fn write_leading_angles(&mut self) -> Vec<CodeStatement> {
        let mut statements = Vec::new();
        // One angle alone is not worth a list.
        if self.first.sines.is_empty() {
            return statements;
        }
        // Values that these angles are computed from.
        for i in 0..self.program.ops.len() {
            if self.first.done[i] && self.program.stages[i] == ProgramStage::State {
                self.write_value(i, &mut statements);
            }
        }
        let mut angles = Vec::new();
        for i in self.first.sines.clone() {
            let ProgramOp::Sin(angle) = self.program.ops[i] else {
                continue;
            };
            // The list in the order of the sines.
            angles.push(RequestedAngle {
                value: self.operand_expression(angle),
                plain: matches!(self.program.ops[angle.index()], ProgramOp::Input(_)),
            });
        }
        statements.push(CodeStatement::Angles(angles));
        statements
    }

    /// A guard with the expressions of its values.
    fn pose_check(&self, guard: PoseGuard) -> PoseCheck {
        match guard {
            PoseGuard::Reachable(v) => PoseCheck::Reachable(self.operand_expression(v)),
            // Only the magnitude is compared, so a sign is dropped.
            PoseGuard::Regular(v, size) => match self.operand_expression(v) {
                CodeExpression::Neg(value) => PoseCheck::Regular(*value, self.operand_expression(size)),
                value => PoseCheck::Regular(value, self.operand_expression(size)),
            },
            PoseGuard::Finite(v) => PoseCheck::Finite(self.operand_expression(v)),
        }
    }
}
