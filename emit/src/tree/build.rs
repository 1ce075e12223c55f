//! From a lowered program to statements: what is written inside what, what is called how, and in which order.

use std::collections::{BTreeMap, BTreeSet};

use modelmill_codegen::expr::Atom;
use modelmill_codegen::names::Meaning;
use modelmill_codegen::{Guard, Op, Program, Stage, ValueId};

use super::angles::AnglesFirst;
use super::order::order;
use super::scope::{Scope, unique};
use super::{Asked, Check, Expression, Routine, Statement};

/// Formulas wider than this many characters with their names are divided, so that lines of a method have no more than 100.
const WIDEST: usize = 80;

/// What the angles that come first are called together.
pub(crate) const ANGLES: &str = "angles";

/// How many statements a function may have before they are put in groups, and how many make a group.
const LONG: usize = 2000;
const GROUP: usize = 250;

impl Routine {
    /// The statements of a program; `outputs` are names for its results, if they have any.
    pub(crate) fn new(program: &Program, scope: &Scope, outputs: &[String]) -> Self {
        Self::written(program, scope, outputs, false)
    }

    /// The same; if all results are to be called by names, each has one.
    pub(super) fn written(
        program: &Program,
        scope: &Scope,
        outputs: &[String],
        results_have_names: bool,
    ) -> Self {
        let mut taken = scope.taken_in(program);
        let first = AnglesFirst::of(program);
        let named = named(program, scope, outputs, &mut taken);
        let inside = inside(program, &named, scope);
        let last = (!results_have_names).then_some(scope.sections.forces());
        let sections = scope.sections.of(program, &inside, &named, last);
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
            first: first.in_order(&order),
            values: vec![None; order.len()],
            next: [0; 2],
            sections: order.iter().map(|i| sections[*i]).collect(),
            turns_signs,
            results_have_names,
            program: program.in_order(&order),
        };
        (builder.uses, builder.by_state) = uses(&builder.program);
        for v in &builder.program.outputs {
            builder.outputs[v.index()] = true;
        }
        builder.routine()
    }
}

/// How often each value is used, sine and cosine of an angle counted as one, and whether something that is computed at
/// every state uses it.
fn uses(program: &Program) -> (Vec<usize>, Vec<bool>) {
    let n = program.ops.len();
    let (mut uses, mut by_state) = (vec![0; n], vec![false; n]);
    for (i, op) in program.ops.iter().enumerate() {
        if is_pair(&program.ops, i) {
            continue;
        }
        op.for_each_operand(|v| {
            uses[v.index()] += 1;
            by_state[v.index()] |= program.stages[i] == Stage::State;
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
fn is_pair(ops: &[Op], i: usize) -> bool {
    matches!((&ops[i], i.checked_sub(1).map(|j| &ops[j])), (Op::Sin(a), Some(Op::Cos(b))) if a == b)
}

/// Whether an operation is written where it is used, however often that is.
fn is_leaf(op: &Op) -> bool {
    matches!(op, Op::Number(_) | Op::Input(_))
}

/// What a value is called, and whether the name stands for its negative.
#[derive(Clone, Debug)]
pub(super) struct Named {
    pub(super) name: String,
    negative: bool,
}

/// Names of values that mean something, results first.
fn named(
    program: &Program,
    scope: &Scope,
    outputs: &[String],
    taken: &mut BTreeSet<String>,
) -> BTreeMap<usize, Named> {
    let mut named = BTreeMap::new();
    let read: BTreeSet<&str> = (program.ops.iter())
        .filter_map(|op| match op {
            Op::Input(atom) => Some(scope.name(*atom)),
            _ => None,
        })
        .collect();
    for (v, name) in program.outputs.iter().zip(outputs) {
        // A result may be called as an input is elsewhere.
        if !read.contains(name.as_str()) && scope.is_input(name) {
            taken.remove(name);
        }
        let i = v.index();
        let plain = is_leaf(&program.ops[i]) || matches!(program.ops[i], Op::Neg(_));
        if !plain && !named.contains_key(&i) {
            let name = unique(name, taken);
            let negative = false;
            named.insert(i, Named { name, negative });
        }
    }
    for (i, meaning) in scope.meanings.of(program) {
        if named.contains_key(&i) {
            continue;
        }
        let Meaning { symbol, negative } = meaning;
        // The negative of a square would be an operation more.
        let squared = match program.ops[i] {
            Op::Mul(a, b) if a == b && negative => match &program.ops[a.index()] {
                Op::Input(atom) => Some(scope.name(*atom)),
                _ => named.get(&a.index()).map(|named| named.name.as_str()),
            },
            _ => None,
        };
        let (name, negative) = match squared {
            Some(base) => (format!("{base}_sq"), false),
            None => (symbol.text(), negative),
        };
        let name = unique(&name, taken);
        named.insert(i, Named { name, negative });
    }
    named
}

/// Values that are written inside the only formula that uses them.
fn inside(program: &Program, named: &BTreeMap<usize, Named>, scope: &Scope) -> Vec<bool> {
    let n = program.ops.len();
    let (uses, by_state) = uses(program);
    let mut inside = vec![false; n];
    let mut width = vec![0_usize; n];
    for (i, op) in program.ops.iter().enumerate() {
        let own = match op {
            Op::Number(value) => value.to_f64().to_string().len(),
            Op::Input(atom) => scope.name(*atom).len(),
            Op::Neg(_) => 1,
            Op::Unary(..) | Op::Sin(_) | Op::Cos(_) | Op::Atan2(..) => 8,
            Op::Add(..) | Op::Sub(..) | Op::Mul(..) | Op::Div(..) => 3,
        };
        let mut open = Vec::new();
        // A formula stands beside its name.
        let widest = WIDEST - named.get(&i).map_or(3, |n| n.name.len()).min(50);
        let mut total = own;
        op.for_each_operand(|v| {
            let k = v.index();
            let sine = matches!(program.ops[k], Op::Sin(_) | Op::Cos(_));
            let same_time = program.stages[k] == program.stages[i];
            let negation = matches!(program.ops[k], Op::Neg(_)) && same_time;
            let once = uses[k] == 1 && !named.contains_key(&k) && !sine && same_time;
            if is_leaf(&program.ops[k]) {
                total += width[k];
            } else if (once || negation) && !(by_state[k] && program.stages[k] == Stage::Fixed) {
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
    scope: &'a Scope,
    /// In the order in which it is written.
    program: Program,
    taken: BTreeSet<String>,
    uses: Vec<usize>,
    by_state: Vec<bool>,
    /// Which values are results.
    outputs: Vec<bool>,
    inside: Vec<bool>,
    named: BTreeMap<usize, Named>,
    first: AnglesFirst,
    /// The section in which each value stands.
    sections: Vec<usize>,
    /// Whether values are turned to the sign of what they are called. In long programs it decides which pairs of operations a
    /// compiler finds; they keep the signs of the recursion, and names where these agree.
    turns_signs: bool,
    /// Whether all results are called by names.
    results_have_names: bool,
    /// What stands for each value, once it is known.
    values: Vec<Option<Expression>>,
    /// Numbers given to nameless values, once and at every state.
    next: [usize; 2],
}

impl Builder<'_> {
    fn routine(mut self) -> Routine {
        let mut once = Vec::new();
        let mut kept = Vec::new();
        for i in 0..self.program.ops.len() {
            if self.program.stages[i] != Stage::Fixed {
                continue;
            }
            self.value(i, &mut once);
        }
        // A cosine has its name only once the sine after it is written.
        for (i, value) in self.values.iter().enumerate() {
            if self.program.stages[i] == Stage::Fixed
                && !is_leaf(&self.program.ops[i])
                && self.by_state[i]
                && let Some(value) = value
            {
                value.for_each_name(&mut |name| kept.push(name.to_owned()));
            }
        }
        let mut state = self.angles_first();
        let mut puts: Vec<Vec<usize>> = vec![Vec::new(); self.program.ops.len()];
        for (k, v) in self.program.outputs.iter().enumerate() {
            puts[v.index()].push(k);
        }
        for (i, outputs) in puts.iter().enumerate() {
            let zero = matches!(&self.program.ops[i], Op::Number(x) if x.is_zero());
            if self.program.stages[i] == Stage::Fixed && !zero {
                self.put(i, outputs, &mut state);
            }
        }
        let mut guards = self.program.guards.clone();
        let mut section = 0;
        for i in 0..self.program.ops.len() {
            if self.program.stages[i] == Stage::Fixed {
                continue;
            }
            let headed = self.scope.sections.heading(self.sections[i]);
            if let Some(heading) = headed.filter(|_| self.sections[i] != section) {
                state.push(Statement::Section(heading.to_owned()));
                section = self.sections[i];
            }
            if !self.first.done[i] {
                self.value(i, &mut state);
            }
            // A cosine is written with the sine after it; what needs it comes then.
            if i + 1 < self.program.ops.len() && is_pair(&self.program.ops, i + 1) {
                continue;
            }
            guards.retain(|guard| {
                let ready = guard.values().all(|v| v.index() <= i);
                if ready {
                    let check = self.check(*guard);
                    state.push(Statement::Guard(check));
                }
                !ready
            });
            if is_pair(&self.program.ops, i) {
                self.put(i - 1, &puts[i - 1], &mut state);
            }
            self.put(i, &puts[i], &mut state);
        }
        let (read_once, read) = self.reads();
        let results = self.results();
        Routine {
            once,
            kept,
            state: in_groups(without_empty(without_unread(state, &results)), &[]),
            read_once,
            read,
            results,
            n_outputs: self.program.outputs.len(),
        }
    }

    /// What each output is called, after the statements.
    fn results(&self) -> Vec<Expression> {
        self.program.outputs.iter().map(|v| self.of(*v)).collect()
    }

    /// Inputs that statements of either stage name.
    fn reads(&self) -> (BTreeSet<Atom>, BTreeSet<Atom>) {
        let mut reads = (BTreeSet::new(), BTreeSet::new());
        for (i, op) in self.program.ops.iter().enumerate() {
            op.for_each_operand(|v| {
                if let Op::Input(atom) = self.program.ops[v.index()] {
                    match self.program.stages[i] {
                        Stage::Fixed => reads.0.insert(atom),
                        Stage::State => reads.1.insert(atom),
                    };
                }
            });
        }
        let guarded = self.program.guards.iter().flat_map(|guard| guard.values());
        for v in self.program.outputs.iter().copied().chain(guarded) {
            if let Op::Input(atom) = self.program.ops[v.index()] {
                reads.1.insert(atom);
            }
        }
        reads
    }

    fn put(&self, i: usize, outputs: &[usize], statements: &mut Vec<Statement>) {
        for k in outputs {
            statements.push(Statement::Put {
                output: *k,
                value: self.at(i).settled(),
            });
        }
    }

    fn at(&self, i: usize) -> Expression {
        let value = self.values[i].clone();
        value.expect("operands stand before what needs them")
    }

    fn of(&self, v: ValueId) -> Expression {
        self.at(v.index())
    }

    /// Writes one value: as a statement if it has a name, else for whoever uses it.
    fn value(&mut self, i: usize, statements: &mut Vec<Statement>) {
        let op = self.program.ops[i].clone();
        let value = match &op {
            Op::Number(value) => Expression::number(value),
            Op::Input(atom) => self.scope.input(*atom),
            Op::Add(a, b) => Expression::add(self.of(*a), self.of(*b)),
            Op::Sub(a, b) => Expression::sub(self.of(*a), self.of(*b)),
            Op::Mul(a, b) => Expression::mul(self.of(*a), self.of(*b)),
            Op::Div(a, b) => Expression::div(self.of(*a), self.of(*b)),
            Op::Neg(a) => Expression::neg(self.of(*a)),
            Op::Unary(function, a) => Expression::call(*function, self.of(*a)),
            Op::Atan2(y, x) => Expression::atan2(self.of(*y), self.of(*x)),
            Op::Sin(a) => return self.sine(i, *a, statements),
            Op::Cos(a) => {
                if !self
                    .program
                    .ops
                    .get(i + 1)
                    .is_some_and(|_| is_pair(&self.program.ops, i + 1))
                {
                    let cosine = self.angle_name(i, "c", *a);
                    self.values[i] = Some(Expression::name(&cosine));
                    statements.push(Statement::SinCos {
                        sine: None,
                        cosine: Some(cosine),
                        angle: self.of(*a),
                        asked: None,
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
            || only_put && !self.is_handed(i)
            || matches!(op, Op::Neg(_)) && !self.named.contains_key(&i) && !self.is_handed(i);
        if unnamed || (self.uses[i] == 0) {
            self.values[i] = Some(value);
            return;
        }
        let (name, value, turned) = self.signed(i, value);
        let note = self.scope.note(&name);
        let written = Expression::name(&name);
        statements.push(Statement::Let { name, value, note });
        self.values[i] = Some(if turned {
            Expression::neg(written)
        } else {
            written
        });
    }

    /// What is written for a value: its name, what the name stands for, and whether that is the negative. A sign that
    /// would be an operation of its own is left to those who use the value.
    fn signed(&mut self, i: usize, value: Expression) -> (String, Expression, bool) {
        let fixed = self.program.stages[i] == Stage::Fixed;
        let Some(Named { name, negative }) = self.named.get(&i).cloned() else {
            let name = self.numbered(i);
            return match value {
                Expression::Neg(value) if !fixed => (name, *value, true),
                value => (name, value.settled(), false),
            };
        };
        if negative && !self.turns_signs && !fixed {
            return (self.numbered(i), value, false);
        }
        let meant = if negative {
            Expression::neg(value)
        } else {
            value
        };
        // Wrenches and Jacobians keep the sign of the equations.
        let keeps = fixed
            || ["F_", "M_", "J_"]
                .iter()
                .any(|start| name.starts_with(start));
        match meant.settled() {
            Expression::Neg(other) if !keeps => (self.numbered(i), *other, !negative),
            meant => (name, meant, negative),
        }
    }

    /// Whether a value is computed once and used at every state.
    fn is_handed(&self, i: usize) -> bool {
        self.program.stages[i] == Stage::Fixed && self.by_state[i]
    }

    /// A name for a value without a meaning.
    fn numbered(&mut self, i: usize) -> String {
        let (letter, counter) = match self.program.stages[i] {
            Stage::Fixed => ("k", 0),
            Stage::State => ("x", 1),
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
        self.of(angle).for_each_name(&mut |name| {
            terms += 1;
            parts.push(name.to_owned());
        });
        let name = if terms > 3 {
            "angle".to_owned()
        } else {
            parts.join("_")
        };
        unique(&format!("{letter}_{name}"), &mut self.taken)
    }

    /// A sine, with its cosine if that stands right before it.
    fn sine(&mut self, i: usize, angle: ValueId, statements: &mut Vec<Statement>) {
        let cosine = is_pair(&self.program.ops, i).then(|| {
            let name = self.angle_name(i - 1, "c", angle);
            self.values[i - 1] = Some(Expression::name(&name));
            name
        });
        let sine = self.angle_name(i, "s", angle);
        self.values[i] = Some(Expression::name(&sine));
        let asked = self.first.sines.iter().position(|sine| *sine == i);
        statements.push(Statement::SinCos {
            angle: self.of(angle),
            sine: Some(sine),
            cosine,
            asked,
        });
    }

    /// The angles that come first, and what they are made of.
    fn angles_first(&mut self) -> Vec<Statement> {
        let mut statements = Vec::new();
        if self.first.sines.is_empty() {
            return statements;
        }
        for i in 0..self.program.ops.len() {
            if self.first.done[i] && self.program.stages[i] == Stage::State {
                self.value(i, &mut statements);
            }
        }
        let mut angles = Vec::new();
        for i in self.first.sines.clone() {
            let Op::Sin(angle) = self.program.ops[i] else {
                continue;
            };
            angles.push(Asked {
                value: self.of(angle),
                plain: matches!(self.program.ops[angle.index()], Op::Input(_)),
            });
        }
        statements.push(Statement::Angles(angles));
        statements
    }

    fn check(&self, guard: Guard) -> Check {
        match guard {
            Guard::Reachable(v) => Check::Reachable(self.of(v)),
            // Its magnitude is what counts.
            Guard::Regular(v, size) => match self.of(v) {
                Expression::Neg(value) => Check::Regular(*value, self.of(size)),
                value => Check::Regular(value, self.of(size)),
            },
            Guard::Finite(v) => Check::Finite(self.of(v)),
        }
    }
}

/// The statements without names that nothing reads: a value may be written out in all places that use it, its sign turned.
fn without_unread(statements: Vec<Statement>, results: &[Expression]) -> Vec<Statement> {
    let mut read = BTreeSet::new();
    for result in results {
        result.for_each_name(&mut |name| {
            read.insert(name.to_owned());
        });
    }
    let mut kept = Vec::with_capacity(statements.len());
    for statement in statements.into_iter().rev() {
        if matches!(&statement, Statement::Let { name, .. } if !read.contains(name)) {
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
fn without_empty(statements: Vec<Statement>) -> Vec<Statement> {
    let is_heading = |statement: &Statement| matches!(statement, Statement::Section(_));
    let mut kept: Vec<Statement> = Vec::with_capacity(statements.len());
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
pub(super) fn in_groups(statements: Vec<Statement>, kept: &[String]) -> Vec<Statement> {
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
        let part: Vec<Statement> = statements.by_ref().take(GROUP).collect();
        let mut handed = Vec::new();
        for statement in &part {
            statement.for_each_name_made(&mut |name| {
                if last_need.get(name).is_some_and(|last| *last > groups.len()) {
                    handed.push(name.to_owned());
                }
            });
        }
        groups.push(Statement::Group {
            statements: part,
            handed,
        });
    }
    groups
}

impl Statement {
    /// Calls `visit` for every name that it reads.
    fn for_each_name_read(&self, visit: &mut dyn FnMut(&str)) {
        match self {
            Self::Section(_) | Self::Group { .. } => {}
            Self::Let { value, .. } | Self::Put { value, .. } => value.for_each_name(visit),
            Self::SinCos { angle, asked, .. } => match asked {
                Some(_) => visit(ANGLES),
                None => angle.for_each_name(visit),
            },
            Self::Angles(angles) => {
                for angle in angles {
                    angle.value.for_each_name(visit);
                }
            }
            Self::Guard(check) => match check {
                Check::Reachable(a) | Check::Finite(a) => a.for_each_name(visit),
                Check::Regular(a, size) => {
                    a.for_each_name(visit);
                    size.for_each_name(visit);
                }
            },
        }
    }

    /// Calls `visit` for every name that it gives.
    fn for_each_name_made(&self, visit: &mut dyn FnMut(&str)) {
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
