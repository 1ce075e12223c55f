//! Scheduling, the last step of lowering: n-ary sums and products become binary operations. Fixed factors and terms are
//! grouped, so that they are computed once, and equal operations are shared.

use std::collections::BTreeSet;

use rustc_hash::FxHashMap;

use super::LoweringRequest;
use super::program::{PoseGuard, ProgramOp, ProgramStage, StraightLineProgram, ValueId};
use crate::expr::{Atom, AtomAngleSum, ExprId, Graph, Node, Rational};

/// An atom that is computed and not read.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AtomDefinition {
    /// The atom.
    pub(crate) atom: Atom,
    /// How it is computed.
    pub(crate) rule: AtomRule,
}

/// How an atom is computed.
#[derive(Clone, Copy, Debug)]
pub(crate) enum AtomRule {
    /// By an expression of its value, for coordinates that are coupled to others.
    Value(ExprId),
    /// A passive angle: `quarters` quarter turns plus the angle with this sine and cosine.
    ///
    /// The quarter turns are those of the nominal pose, so that the angle jumps only half a turn away from there.
    Turn {
        /// Number of quarter turns.
        quarters: i32,
        /// Sine of the remaining angle.
        sine: ExprId,
        /// Cosine of the remaining angle.
        cosine: ExprId,
    },
}

impl AtomRule {
    /// The expressions that it needs, in a fixed order.
    pub(crate) fn operands(self) -> Vec<ExprId> {
        match self {
            Self::Value(value) => vec![value],
            Self::Turn { sine, cosine, .. } => vec![sine, cosine],
        }
    }

    /// The same rule with its operands taken from `from`, in the order of `operands`.
    fn with_operands(self, from: &mut impl Iterator<Item = ExprId>) -> Self {
        let mut next = || from.next().expect("as many roots as operands");
        match self {
            Self::Value(_) => Self::Value(next()),
            Self::Turn { quarters, .. } => Self::Turn {
                quarters,
                sine: next(),
                cosine: next(),
            },
        }
    }
}

/// Writes the program for `roots`: outputs, then the expressions that must be reachable, regular (each with its size),
/// and the operands of definitions, with the counts of `request`.
pub(crate) fn schedule(graph: &Graph, roots: &[ExprId], request: &LoweringRequest<'_>) -> StraightLineProgram {
    // The roots are in the order in which the passes were given them.
    let (outputs, rest) = roots.split_at(request.outputs.len());
    let (reachable, rest) = rest.split_at(request.reachable.len());
    let (regular, defined) = rest.split_at(2 * request.regular.len());
    let mut defined = defined.iter().copied();
    // Tables of the expressions, and an empty program.
    let mut scheduler = ProgramScheduler {
        graph,
        fixed: fixed_nodes(graph, roots),
        uses: inverse_uses(graph, roots),
        program: StraightLineProgram::default(),
        known: FxHashMap::default(),
        values: FxHashMap::default(),
        defined: request
            .definitions
            .iter()
            .map(|d| (d.atom, d.rule.with_operands(&mut defined)))
            .collect(),
    };
    // Guards are computed first, so that no operation is spent on a pose without a solution.
    for id in reachable {
        let value = scheduler.value(*id);
        scheduler.program.guards.push(PoseGuard::Reachable(value));
    }
    for pair in regular.chunks(2) {
        let [value, size] = [pair[0], pair[1]].map(|id| scheduler.value(id));
        scheduler.program.guards.push(PoseGuard::Regular(value, size));
    }
    // Outputs after guards.
    let outputs: Vec<ValueId> = outputs.iter().map(|id| scheduler.value(*id)).collect();
    // Only values of a state may become undefined; fixed ones are checked elsewhere.
    if request.may_be_undefined {
        let distinct: BTreeSet<ValueId> = outputs.iter().copied().collect();
        let program = &mut scheduler.program;
        let moving = distinct
            .into_iter()
            .filter(|v| program.stages[v.index()] == ProgramStage::State);
        program.guards.extend(moving.map(PoseGuard::Finite));
    }
    scheduler.program.outputs = outputs;
    scheduler.program.without_dead_code()
}

/// For each node, whether it depends only on geometry and parameters.
pub(crate) fn fixed_nodes(graph: &Graph, roots: &[ExprId]) -> Vec<bool> {
    // Operands come before their users, so one pass is enough.
    let reachable = graph.reachable(roots);
    let mut fixed = vec![false; reachable.len()];
    for (i, needed) in reachable.into_iter().enumerate() {
        if !needed {
            continue;
        }
        let id = ExprId(u32::try_from(i).expect("graph below 4G nodes"));
        fixed[i] = is_fixed(graph.node(id), &fixed);
    }
    fixed
}

/// Whether a node is known once geometry and parameters are; `fixed` tells it of its operands.
pub(crate) fn is_fixed(node: &Node, fixed: &[bool]) -> bool {
    match node {
        Node::Rational(_) => true,
        Node::Atom(atom) => atom.is_fixed(),
        Node::Sin(angle) | Node::Cos(angle) => angle.atoms().all(Atom::is_fixed),
        Node::Sum(terms) => terms.iter().all(|(c, _)| fixed[c.index()]),
        Node::Product(factors) => factors.iter().all(|(c, _)| fixed[c.index()]),
        Node::Unary(_, c) => fixed[c.index()],
    }
}

/// Number of uses of each negative power; a power that is used twice becomes a shared reciprocal.
fn inverse_uses(graph: &Graph, roots: &[ExprId]) -> FxHashMap<(ExprId, i32), usize> {
    let mut uses = FxHashMap::default();
    for node in graph.nodes_of(roots) {
        if let Node::Product(factors) = node {
            for (base, n) in factors {
                if *n < 0 {
                    *uses.entry((*base, *n)).or_insert(0) += 1;
                }
            }
        }
    }
    uses
}

/// State of scheduling.
struct ProgramScheduler<'a> {
    /// The expressions.
    graph: &'a Graph,
    /// Per node, whether it is fixed.
    fixed: Vec<bool>,
    /// Uses of negative powers.
    uses: FxHashMap<(ExprId, i32), usize>,
    /// The operations so far.
    program: StraightLineProgram,
    /// Values by operation, so that equal operations are written once.
    known: FxHashMap<ProgramOp, ValueId>,
    /// Values by node.
    values: FxHashMap<ExprId, ValueId>,
    /// Rules of computed atoms.
    defined: FxHashMap<Atom, AtomRule>,
}

impl ProgramScheduler<'_> {
    /// The value of an operation, which is appended if it is new. It is as late as its latest operand.
    fn push_op(&mut self, op: ProgramOp) -> ValueId {
        // An equal operation exists already.
        if let Some(value) = self.known.get(&op) {
            return *value;
        }
        let mut stage = match &op {
            ProgramOp::Input(atom) if !atom.is_fixed() => ProgramStage::State,
            _ => ProgramStage::Fixed,
        };
        op.for_each_operand(|operand| stage = stage.max(self.program.stages[operand.index()]));
        let value = ValueId::from_index(self.program.ops.len());
        self.program.ops.push(op.clone());
        self.program.stages.push(stage);
        self.known.insert(op, value);
        value
    }

    /// The value of a number.
    fn number(&mut self, value: Rational) -> ValueId {
        self.push_op(ProgramOp::Number(value))
    }

    /// The value of a commutative operation, with its operands in increasing order, so that equal ones are found.
    fn commutative(&mut self, op: fn(ValueId, ValueId) -> ProgramOp, a: ValueId, b: ValueId) -> ValueId {
        self.push_op(op(a.min(b), a.max(b)))
    }

    /// Value of a node. Everything that it needs is scheduled first, so that the recursion is not as deep as the graph.
    fn value(&mut self, id: ExprId) -> ValueId {
        if let Some(value) = self.values.get(&id) {
            return *value;
        }
        for node in self.unknown_below(id) {
            if !self.values.contains_key(&node) && !self.is_inner(node) {
                let value = self.schedule_node(node);
                self.values.insert(node, value);
            }
        }
        match self.values.get(&id) {
            Some(value) => *value,
            None => {
                let value = self.schedule_node(id);
                self.values.insert(id, value);
                value
            }
        }
    }

    /// A node and all that it needs and that has no value yet; the order of the set puts operands first.
    fn unknown_below(&self, id: ExprId) -> BTreeSet<ExprId> {
        let mut found = BTreeSet::from([id]);
        let mut open = vec![id];
        while let Some(node) = open.pop() {
            self.graph.for_each_child(node, |child| {
                if !self.values.contains_key(&child) && found.insert(child) {
                    open.push(child);
                }
            });
        }
        found
    }

    /// Whether a node is a plain number, which becomes an operation where it is used.
    fn is_inner(&self, id: ExprId) -> bool {
        matches!(self.graph.node(id), Node::Rational(_))
    }

    /// The value of a node that has been scheduled, or of a number.
    fn scheduled_value(&mut self, id: ExprId) -> ValueId {
        if let Node::Rational(value) = self.graph.node(id) {
            return self.number(value.clone());
        }
        self.values[&id]
    }

    /// Appends the operations of one node, whose operands have been scheduled.
    fn schedule_node(&mut self, id: ExprId) -> ValueId {
        match self.graph.node(id).clone() {
            Node::Rational(value) => self.number(value),
            Node::Atom(atom) => self.atom(atom),
            Node::Sin(angle) => {
                let angle = self.angle(&angle);
                // The cosine is written before the sine, so that both are computed together.
                self.push_op(ProgramOp::Cos(angle));
                self.push_op(ProgramOp::Sin(angle))
            }
            Node::Cos(angle) => {
                let angle = self.angle(&angle);
                self.push_op(ProgramOp::Cos(angle))
            }
            Node::Sum(terms) => self.sum(&terms),
            Node::Product(factors) => self.product(&factors),
            Node::Unary(function, child) => {
                let child = self.scheduled_value(child);
                self.push_op(ProgramOp::Unary(function, child))
            }
        }
    }

    /// The value of an atom: an input, or computed by its rule.
    fn atom(&mut self, atom: Atom) -> ValueId {
        match self.defined.get(&atom).copied() {
            Some(AtomRule::Value(value)) => self.value(value),
            Some(AtomRule::Turn { quarters, sine, cosine }) => {
                let (y, x) = (self.value(sine), self.value(cosine));
                // The angle from its sine and cosine, moved to the turn of the nominal pose.
                let angle = self.push_op(ProgramOp::Atan2(y, x));
                if quarters == 0 {
                    return angle;
                }
                let pi = self.push_op(ProgramOp::Input(Atom::Pi));
                let factor = self.number(Rational::new(i64::from(quarters), 2));
                let turned = self.commutative(ProgramOp::Mul, factor, pi);
                self.commutative(ProgramOp::Add, turned, angle)
            }
            None => self.push_op(ProgramOp::Input(atom)),
        }
    }

    /// The value of a sum of angles with integer factors.
    fn angle(&mut self, angle: &AtomAngleSum) -> ValueId {
        let mut total: Option<ValueId> = None;
        // Terms with a factor other than one are multiplied.
        for (atom, n) in angle.terms() {
            let value = self.atom(*atom);
            let term = if n.abs() == 1 {
                value
            } else {
                let factor = self.number(Rational::integer(i64::from(n.abs())));
                self.commutative(ProgramOp::Mul, factor, value)
            };
            total = Some(match (total, *n < 0) {
                (None, false) => term,
                (None, true) => self.push_op(ProgramOp::Neg(term)),
                (Some(sum), false) => self.commutative(ProgramOp::Add, sum, term),
                (Some(sum), true) => self.push_op(ProgramOp::Sub(sum, term)),
            });
        }
        total.expect("an angle node has terms")
    }

    /// A linear combination: fixed terms first, then all others from left to right.
    fn sum(&mut self, terms: &[(ExprId, Rational)]) -> ValueId {
        // Terms of a state come after the fixed ones.
        let (fixed, moving): (Vec<_>, Vec<_>) = terms.iter().cloned().partition(|(id, _)| self.fixed[id.index()]);
        // Terms with their signs, which become additions and subtractions.
        let mut signed: Vec<(bool, ValueId)> = Vec::new();
        for (id, factor) in fixed.iter().chain(&moving) {
            // The sum of the fixed terms is complete before the first other term is added.
            if fixed.len() > 1 && signed.len() == fixed.len() && fixed.len() < terms.len() {
                signed = vec![self.add_signed(&signed)];
            }
            let value = self.scaled_value(*id, &factor.abs());
            signed.push((factor.is_negative(), value));
        }
        let (negative, value) = self.add_signed(&signed);
        if negative {
            self.push_op(ProgramOp::Neg(value))
        } else {
            value
        }
    }

    /// Adds signed values. Returns whether the sum has to be negated, and its value.
    fn add_signed(&mut self, signed: &[(bool, ValueId)]) -> (bool, ValueId) {
        // The sum begins with a positive term, so that no change of sign is needed.
        let start = signed.iter().position(|(negative, _)| !negative).unwrap_or(0);
        let all_negative = signed[start].0;
        let mut total = signed[start].1;
        for (i, (negative, value)) in signed.iter().enumerate() {
            if i == start {
                continue;
            }
            total = if *negative == all_negative {
                self.commutative(ProgramOp::Add, total, *value)
            } else {
                self.push_op(ProgramOp::Sub(total, *value))
            };
        }
        (all_negative, total)
    }

    /// `factor * id`; the factor is combined with fixed factors of a product.
    fn scaled_value(&mut self, id: ExprId, factor: &Rational) -> ValueId {
        if id == Graph::ONE {
            return self.number(factor.clone());
        }
        if factor.is_one() {
            return self.scheduled_value(id);
        }
        if let Node::Product(factors) = self.graph.node(id).clone() {
            let (fixed, moving): (Vec<_>, Vec<_>) = factors.iter().partition(|(f, _)| self.fixed[f.index()]);
            if !fixed.is_empty() && !moving.is_empty() {
                let k = self.powers(&fixed);
                let number = self.number(factor.clone());
                let k = self.commutative(ProgramOp::Mul, number, k);
                let m = self.powers(&moving);
                return self.commutative(ProgramOp::Mul, k, m);
            }
        }
        let value = self.scheduled_value(id);
        // Twice a value is an addition.
        if *factor == Rational::integer(2) {
            return self.push_op(ProgramOp::Add(value, value));
        }
        let number = self.number(factor.clone());
        self.commutative(ProgramOp::Mul, number, value)
    }

    /// A product: fixed factors are multiplied first.
    fn product(&mut self, factors: &[(ExprId, i32)]) -> ValueId {
        let (fixed, moving): (Vec<_>, Vec<_>) = factors.iter().partition(|(f, _)| self.fixed[f.index()]);
        match (fixed.is_empty(), moving.is_empty()) {
            (false, false) => {
                let k = self.powers(&fixed);
                let m = self.powers(&moving);
                self.commutative(ProgramOp::Mul, k, m)
            }
            _ => self.powers(factors),
        }
    }

    /// A product of powers: numerators from left to right, then one division by all denominators.
    fn powers(&mut self, factors: &[(ExprId, i32)]) -> ValueId {
        let mut total: Option<ValueId> = None;
        let mut divisors = Vec::new();
        for (id, n) in factors {
            // A denominator of several products is inverted once and then multiplied.
            let shared = *n < 0 && self.uses.get(&(*id, *n)).is_some_and(|u| *u > 1);
            let base = self.scheduled_value(*id);
            // Powers by repeated multiplication.
            let mut power = base;
            for _ in 1..n.abs() {
                power = self.commutative(ProgramOp::Mul, power, base);
            }
            if *n < 0 && !shared {
                divisors.push(power);
                continue;
            }
            if shared {
                let one = self.number(Rational::ONE);
                power = self.push_op(ProgramOp::Div(one, power));
            }
            total = Some(match total {
                None => power,
                Some(product) => self.commutative(ProgramOp::Mul, product, power),
            });
        }
        // All denominators that are not shared.
        let divisor = divisors
            .into_iter()
            .reduce(|a, b| self.commutative(ProgramOp::Mul, a, b));
        match (total, divisor) {
            (Some(product), None) => product,
            (Some(product), Some(divisor)) => self.push_op(ProgramOp::Div(product, divisor)),
            (None, Some(divisor)) => {
                let one = self.number(Rational::ONE);
                self.push_op(ProgramOp::Div(one, divisor))
            }
            (None, None) => self.number(Rational::ONE),
        }
    }
}
