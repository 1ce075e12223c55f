//! From a lowered program to statements: what is written inside what, what is called how, and in which order.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_codegen::expr::Atom;
use modelmill_codegen::names::QuantityName;
use modelmill_codegen::{PoseGuard, ProgramOp, ProgramStage, StraightLineProgram, ValueId};

use super::angles::LeadingAngles;
use super::order::order;
use super::scope::{NameScope, unique_name};
use super::{CodeExpression, CodeStatement, PoseCheck, RequestedAngle, StatementRoutine};
/// Formulas wider than this many characters with their names are divided, so that lines of a method have no more than 100.
const WIDEST: usize = 80;

/// What the angles that come first are called together.
pub(crate) const ANGLES: &str = "angles";

/// How many statements a function may have before they are put in groups, and how many make a group.
const LONG: usize = 2000;
const GROUP: usize = 250;

impl StatementRoutine {
    /// The statements of a program; `outputs` are names for its results, if they have any.
    pub(crate) fn new(
        program: &StraightLineProgram,
        scope: &NameScope,
        outputs: &[String],
    ) -> Self {
        Self::with_result_names(program, scope, outputs, false)
    }

    /// The same; if all results are to be called by names, each has one.
    pub(super) fn with_result_names(
        program: &StraightLineProgram,
        scope: &NameScope,
        outputs: &[String],
        results_have_names: bool,
    ) -> Self {
        let mut taken = scope.reserved_names_in(program);
        let first = LeadingAngles::from_program(program);
        let named = name_values(program, scope, outputs, &mut taken);
        let inside = inlined_values(program, &named, scope);
        let last = (!results_have_names).then_some(scope.sections.force_section());
        let sections = scope
            .sections
            .value_sections(program, &inside, &named, last);
        let turns_signs = sections.is_some();
        let sections = sections.unwrap_or_else(|| vec![0; program.ops.len()]);
        let order = order(program, &inside, &first.done, &sections);
        let mut place = vec![0; order.len()];
        for (k, i) in order.iter().enumerate() {
            place[*i] = k;
        }
        let mut builder = Builder {
            scope,
            taken,
            uses: Vec::new(),
            by_state: Vec::new(),
            outputs: vec![false; order.len()],
            inside: order.iter().map(|i| inside[*i]).collect(),
            named: named
                .into_iter()
                .map(|(i, name)| (place[i], name))
                .collect(),
            first: first.reorder(&order),
            values: vec![None; order.len()],
            next: [0; 2],
            sections: order.iter().map(|i| sections[*i]).collect(),
            turns_signs,
            results_have_names,
            program: program.reorder(&order),
        };
        (builder.uses, builder.by_state) = count_uses(&builder.program);
        for v in &builder.program.outputs {
            builder.outputs[v.index()] = true;
        }
        builder.routine()
    }
}

/// How often each value is used, sine and cosine of an angle counted as one, and whether something that is computed at
/// every state uses it.
fn count_uses(program: &StraightLineProgram) -> (Vec<usize>, Vec<bool>) {
    let n = program.ops.len();
    let (mut uses, mut by_state) = (vec![0; n], vec![false; n]);
    for (i, op) in program.ops.iter().enumerate() {
        if is_pair(&program.ops, i) {
            continue;
        }
        op.for_each_operand(|v| {
            uses[v.index()] += 1;
            by_state[v.index()] |= program.stages[i] == ProgramStage::State;
        });
    }
    for v in &program.outputs {
        uses[v.index()] += 1;
        by_state[v.index()] = true;
    }
    for v in program.guards.iter().flat_map(|guard| guard.values()) {
        // What is guarded has a name.
        uses[v.index()] += 2;
        by_state[v.index()] = true;
    }
    (uses, by_state)
}

/// Whether an operation is the sine that stands right after the cosine of the same angle.
fn is_pair(ops: &[ProgramOp], i: usize) -> bool {
    matches!((&ops[i], i.checked_sub(1).map(|j| &ops[j])), (ProgramOp::Sin(a), Some(ProgramOp::Cos(b))) if a == b)
}

/// Whether an operation is written where it is used, however often that is.
fn is_leaf(op: &ProgramOp) -> bool {
    matches!(op, ProgramOp::Number(_) | ProgramOp::Input(_))
}

/// What a value is called, and whether the name stands for its negative.
#[derive(Clone, Debug)]
pub(super) struct NamedValue {
    pub(super) name: String,
    negative: bool,
}

/// Names of values that mean something, results first.
fn name_values(
    program: &StraightLineProgram,
    scope: &NameScope,
    outputs: &[String],
    taken: &mut BTreeSet<String>,
) -> BTreeMap<usize, NamedValue> {
    let mut named = BTreeMap::new();
    let read: BTreeSet<&str> = (program.ops.iter())
        .filter_map(|op| match op {
            ProgramOp::Input(atom) => Some(scope.input_name(*atom)),
            _ => None,
        })
        .collect();
    for (v, name) in program.outputs.iter().zip(outputs) {
        // A result may be called as an input is elsewhere.
        if !read.contains(name.as_str()) && scope.is_input(name) {
            taken.remove(name);
        }
        let i = v.index();
        let plain = is_leaf(&program.ops[i]) || matches!(program.ops[i], ProgramOp::Neg(_));
        if !plain && !named.contains_key(&i) {
            let name = unique_name(name, taken);
            let negative = false;
            named.insert(i, NamedValue { name, negative });
        }
    }
    for (i, meaning) in scope.meanings.name_values(program) {
        if named.contains_key(&i) {
            continue;
        }
        let QuantityName { symbol, negative } = meaning;
        // The negative of a square would be an operation more.
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

/// Values that are written inside the only formula that uses them.
fn inlined_values(
    program: &StraightLineProgram,
    named: &BTreeMap<usize, NamedValue>,
    scope: &NameScope,
) -> Vec<bool> {
    let n = program.ops.len();
    let (uses, by_state) = count_uses(program);
    let mut inside = vec![false; n];
    let mut width = vec![0_usize; n];
    for (i, op) in program.ops.iter().enumerate() {
        let own = match op {
            ProgramOp::Number(value) => value.to_f64().to_string().len(),
            ProgramOp::Input(atom) => scope.input_name(*atom).len(),
            ProgramOp::Neg(_) => 1,
            ProgramOp::Unary(..) | ProgramOp::Sin(_) | ProgramOp::Cos(_) | ProgramOp::Atan2(..) => {
                8
            }
            ProgramOp::Add(..) | ProgramOp::Sub(..) | ProgramOp::Mul(..) | ProgramOp::Div(..) => 3,
        };
        let mut open = Vec::new();
        // A formula stands beside its name.
        let widest = WIDEST - named.get(&i).map_or(3, |n| n.name.len()).min(50);
        let mut total = own;
        op.for_each_operand(|v| {
            let k = v.index();
            let sine = matches!(program.ops[k], ProgramOp::Sin(_) | ProgramOp::Cos(_));
            let same_time = program.stages[k] == program.stages[i];
            let negation = matches!(program.ops[k], ProgramOp::Neg(_)) && same_time;
            let once = uses[k] == 1 && !named.contains_key(&k) && !sine && same_time;
            if is_leaf(&program.ops[k]) {
                total += width[k];
            } else if (once || negation)
                && !(by_state[k] && program.stages[k] == ProgramStage::Fixed)
            {
                inside[k] = once;
                total += width[k];
                if once {
                    open.push(k);
                }
            } else {
                total += named.get(&k).map_or(3, |n| n.name.len());
            }
        });
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

struct Builder<'a> {
    scope: &'a NameScope,
    /// In the order in which it is written.
    program: StraightLineProgram,
    taken: BTreeSet<String>,
    uses: Vec<usize>,
    by_state: Vec<bool>,
    /// Which values are results.
    outputs: Vec<bool>,
    inside: Vec<bool>,
    named: BTreeMap<usize, NamedValue>,
    first: LeadingAngles,
    /// The section in which each value stands.
    sections: Vec<usize>,
    /// Whether values are turned to the sign of what they are called. In long programs it decides which pairs of operations a
    /// compiler finds; they keep the signs of the recursion, and names where these agree.
    turns_signs: bool,
    /// Whether all results are called by names.
    results_have_names: bool,
    /// What stands for each value, once it is known.
    values: Vec<Option<CodeExpression>>,
    /// Numbers given to nameless values, once and at every state.
    next: [usize; 2],
}

impl Builder<'_> {
    fn routine(mut self) -> StatementRoutine {
        let mut once = Vec::new();
        let mut kept = Vec::new();
        for i in 0..self.program.ops.len() {
            if self.program.stages[i] != ProgramStage::Fixed {
                continue;
            }
            self.write_value(i, &mut once);
        }
        // A cosine has its name only once the sine after it is written.
        for (i, value) in self.values.iter().enumerate() {
            if self.program.stages[i] == ProgramStage::Fixed
                && !is_leaf(&self.program.ops[i])
                && self.by_state[i]
                && let Some(value) = value
            {
                value.for_each_name(&mut |name| kept.push(name.to_owned()));
            }
        }
        let mut state = self.write_leading_angles();
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
        let mut guards = self.program.guards.clone();
        let mut section = 0;
        for i in 0..self.program.ops.len() {
            if self.program.stages[i] == ProgramStage::Fixed {
                continue;
            }
            let headed = self.scope.sections.heading(self.sections[i]);
            if let Some(heading) = headed.filter(|_| self.sections[i] != section) {
                state.push(CodeStatement::Section(heading.to_owned()));
                section = self.sections[i];
            }
            if !self.first.done[i] {
                self.write_value(i, &mut state);
            }
            // A cosine is written with the sine after it; what needs it comes then.
            if i + 1 < self.program.ops.len() && is_pair(&self.program.ops, i + 1) {
                continue;
            }
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

    /// What each output is called, after the statements.
    fn results(&self) -> Vec<CodeExpression> {
        self.program
            .outputs
            .iter()
            .map(|v| self.operand_expression(*v))
            .collect()
    }

    /// Inputs that statements of either stage name.
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

    fn put_outputs(&self, i: usize, outputs: &[usize], statements: &mut Vec<CodeStatement>) {
        for k in outputs {
            statements.push(CodeStatement::Put {
                output: *k,
                value: self.value_expression(i).normalize_sign(),
            });
        }
    }

    fn value_expression(&self, i: usize) -> CodeExpression {
        let value = self.values[i].clone();
        value.expect("operands stand before what needs them")
    }

    fn operand_expression(&self, v: ValueId) -> CodeExpression {
        self.value_expression(v.index())
    }

    /// Writes one value: as a statement if it has a name, else for whoever uses it.
    fn write_value(&mut self, i: usize, statements: &mut Vec<CodeStatement>) {
        let op = self.program.ops[i].clone();
        let value = match &op {
            ProgramOp::Number(value) => CodeExpression::number(value),
            ProgramOp::Input(atom) => self.scope.input_expression(*atom),
            ProgramOp::Add(a, b) => {
                CodeExpression::add(self.operand_expression(*a), self.operand_expression(*b))
            }
            ProgramOp::Sub(a, b) => {
                CodeExpression::sub(self.operand_expression(*a), self.operand_expression(*b))
            }
            ProgramOp::Mul(a, b) => {
                CodeExpression::mul(self.operand_expression(*a), self.operand_expression(*b))
            }
            ProgramOp::Div(a, b) => {
                CodeExpression::div(self.operand_expression(*a), self.operand_expression(*b))
            }
            ProgramOp::Neg(a) => CodeExpression::neg(self.operand_expression(*a)),
            ProgramOp::Unary(function, a) => {
                CodeExpression::call(*function, self.operand_expression(*a))
            }
            ProgramOp::Atan2(y, x) => {
                CodeExpression::atan2(self.operand_expression(*y), self.operand_expression(*x))
            }
            ProgramOp::Sin(a) => return self.write_sine(i, *a, statements),
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
        // What is a result and nothing else is written where it is handed over.
        let only_put = self.uses[i] == 1
            && self.outputs[i]
            && !self.named.contains_key(&i)
            && !self.results_have_names;
        let unnamed = is_leaf(&op)
            || self.inside[i]
            || only_put && !self.is_precomputed(i)
            || matches!(op, ProgramOp::Neg(_))
                && !self.named.contains_key(&i)
                && !self.is_precomputed(i);
        if unnamed || (self.uses[i] == 0) {
            self.values[i] = Some(value);
            return;
        }
        let (name, value, turned) = self.choose_sign(i, value);
        let note = self.scope.value_note(&name);
        let written = CodeExpression::name(&name);
        statements.push(CodeStatement::Let { name, value, note });
        self.values[i] = Some(if turned {
            CodeExpression::neg(written)
        } else {
            written
        });
    }

    /// What is written for a value: its name, what the name stands for, and whether that is the negative. A sign that
    /// would be an operation of its own is left to those who use the value.
    fn choose_sign(&mut self, i: usize, value: CodeExpression) -> (String, CodeExpression, bool) {
        let fixed = self.program.stages[i] == ProgramStage::Fixed;
        let Some(NamedValue { name, negative }) = self.named.get(&i).cloned() else {
            let name = self.next_name(i);
            return match value {
                CodeExpression::Neg(value) if !fixed => (name, *value, true),
                value => (name, value.normalize_sign(), false),
            };
        };
        if negative && !self.turns_signs && !fixed {
            return (self.next_name(i), value, false);
        }
        let meant = if negative {
            CodeExpression::neg(value)
        } else {
            value
        };
        // Wrenches and Jacobians keep the sign of the equations.
        let keeps = fixed
            || ["F_", "M_", "J_"]
                .iter()
                .any(|start| name.starts_with(start));
        match meant.normalize_sign() {
            CodeExpression::Neg(other) if !keeps => (self.next_name(i), *other, !negative),
            meant => (name, meant, negative),
        }
    }

    /// Whether a value is computed once and used at every state.
    fn is_precomputed(&self, i: usize) -> bool {
        self.program.stages[i] == ProgramStage::Fixed && self.by_state[i]
    }

    /// A name for a value without a meaning.
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

    /// `s_theta1`, `c_theta1` and so on.
    fn angle_name(&mut self, i: usize, letter: &str, angle: ValueId) -> String {
        if let Some(named) = self.named.get(&i) {
            return named.name.clone();
        }
        let mut parts = Vec::new();
        let mut terms = 0;
        self.operand_expression(angle).for_each_name(&mut |name| {
            terms += 1;
            parts.push(name.to_owned());
        });
        let name = if terms > 3 {
            "angle".to_owned()
        } else {
            parts.join("_")
        };
        unique_name(&format!("{letter}_{name}"), &mut self.taken)
    }

    /// A sine, with its cosine if that stands right before it.
    fn write_sine(&mut self, i: usize, angle: ValueId, statements: &mut Vec<CodeStatement>) {
        let cosine = is_pair(&self.program.ops, i).then(|| {
            let name = self.angle_name(i - 1, "c", angle);
            self.values[i - 1] = Some(CodeExpression::name(&name));
            name
        });
        let sine = self.angle_name(i, "s", angle);
        self.values[i] = Some(CodeExpression::name(&sine));
        let asked = self.first.sines.iter().position(|sine| *sine == i);
        statements.push(CodeStatement::SinCos {
            angle: self.operand_expression(angle),
            sine: Some(sine),
            cosine,
            requested: asked,
        });
    }

    /// The angles that come first, and what they are made of.
    fn write_leading_angles(&mut self) -> Vec<CodeStatement> {
        let mut statements = Vec::new();
        if self.first.sines.is_empty() {
            return statements;
        }
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
            angles.push(RequestedAngle {
                value: self.operand_expression(angle),
                plain: matches!(self.program.ops[angle.index()], ProgramOp::Input(_)),
            });
        }
        statements.push(CodeStatement::Angles(angles));
        statements
    }

    fn pose_check(&self, guard: PoseGuard) -> PoseCheck {
        match guard {
            PoseGuard::Reachable(v) => PoseCheck::Reachable(self.operand_expression(v)),
            // Its magnitude is what counts.
            PoseGuard::Regular(v, size) => match self.operand_expression(v) {
                CodeExpression::Neg(value) => {
                    PoseCheck::Regular(*value, self.operand_expression(size))
                }
                value => PoseCheck::Regular(value, self.operand_expression(size)),
            },
            PoseGuard::Finite(v) => PoseCheck::Finite(self.operand_expression(v)),
        }
    }
}

/// The statements without names that nothing reads: a value may be written out in all places that use it, its sign turned.
fn without_unread(
    statements: Vec<CodeStatement>,
    results: &[CodeExpression],
) -> Vec<CodeStatement> {
    let mut read = BTreeSet::new();
    for result in results {
        result.for_each_name(&mut |name| {
            read.insert(name.to_owned());
        });
    }
    let mut kept = Vec::with_capacity(statements.len());
    for statement in statements.into_iter().rev() {
        if matches!(&statement, CodeStatement::Let { name, .. } if !read.contains(name)) {
            continue;
        }
        statement.for_each_name_read(&mut |name| {
            read.insert(name.to_owned());
        });
        kept.push(statement);
    }
    kept.reverse();
    kept
}

/// The statements without headings that nothing follows.
fn without_empty(statements: Vec<CodeStatement>) -> Vec<CodeStatement> {
    let is_heading = |statement: &CodeStatement| matches!(statement, CodeStatement::Section(_));
    let mut kept: Vec<CodeStatement> = Vec::with_capacity(statements.len());
    for statement in statements {
        if is_heading(&statement) && kept.last().is_some_and(is_heading) {
            kept.pop();
        }
        kept.push(statement);
    }
    if kept.last().is_some_and(is_heading) {
        kept.pop();
    }
    kept
}

/// Long programs in groups of statements, each a block that hands on what later ones need: every name opens a scope inside
/// the one before, and a compiler that writes debug information scope by scope into each other runs out of stack where
/// there are many thousands.
pub(super) fn group_statements(
    statements: Vec<CodeStatement>,
    kept: &[String],
) -> Vec<CodeStatement> {
    if statements.len() <= LONG {
        return statements;
    }
    let mut last_need: BTreeMap<String, usize> = BTreeMap::new();
    for (k, statement) in statements.iter().enumerate() {
        statement.for_each_name_read(&mut |name| {
            last_need.insert(name.to_owned(), k / GROUP);
        });
    }
    for name in kept {
        last_need.insert(name.clone(), usize::MAX);
    }
    let mut groups = Vec::new();
    let mut statements = statements.into_iter().peekable();
    while statements.peek().is_some() {
        let part: Vec<CodeStatement> = statements.by_ref().take(GROUP).collect();
        let mut handed = Vec::new();
        for statement in &part {
            statement.for_each_name_defined(&mut |name| {
                if last_need.get(name).is_some_and(|last| *last > groups.len()) {
                    handed.push(name.to_owned());
                }
            });
        }
        groups.push(CodeStatement::Group {
            statements: part,
            exported: handed,
        });
    }
    groups
}

impl CodeStatement {
    /// Calls `visit` for every name that it reads.
    fn for_each_name_read(&self, visit: &mut dyn FnMut(&str)) {
        match self {
            Self::Section(_) | Self::Group { .. } => {}
            Self::Let { value, .. } | Self::Put { value, .. } => value.for_each_name(visit),
            Self::SinCos {
                angle,
                requested: asked,
                ..
            } => match asked {
                Some(_) => visit(ANGLES),
                None => angle.for_each_name(visit),
            },
            Self::Angles(angles) => {
                for angle in angles {
                    angle.value.for_each_name(visit);
                }
            }
            Self::Guard(check) => match check {
                PoseCheck::Reachable(a) | PoseCheck::Finite(a) => a.for_each_name(visit),
                PoseCheck::Regular(a, size) => {
                    a.for_each_name(visit);
                    size.for_each_name(visit);
                }
            },
        }
    }

    /// Calls `visit` for every name that it gives.
    fn for_each_name_defined(&self, visit: &mut dyn FnMut(&str)) {
        match self {
            Self::Angles(_) => visit(ANGLES),
            Self::Section(_) | Self::Group { .. } | Self::Put { .. } | Self::Guard(_) => {}
            Self::Let { name, .. } => visit(name),
            Self::SinCos { sine, cosine, .. } => {
                for name in sine.iter().chain(cosine) {
                    visit(name);
                }
            }
        }
    }
}
